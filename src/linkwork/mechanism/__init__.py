"""Stage 1, describe: a mechanism as frozen data, and its file format. No mathematics."""

from linkwork.mechanism.body import Body, Inertia
from linkwork.mechanism.effects import Friction, Limits, PointSpring, Spring
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.joints import (
    CylindricalJoint,
    FixedJoint,
    FreeJoint,
    GearJoint,
    Joint,
    PairJoint,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    SphericalJoint,
    UniversalJoint,
)
from linkwork.mechanism.json_schema import schema
from linkwork.mechanism.mechanism import GROUND, Mechanism, Tool
from linkwork.mechanism.record import MechanismError

__all__ = [
    "GROUND",
    "Body",
    "CylindricalJoint",
    "FixedJoint",
    "Frame",
    "FreeJoint",
    "Friction",
    "GearJoint",
    "Inertia",
    "Joint",
    "Limits",
    "Mechanism",
    "MechanismError",
    "PairJoint",
    "PlanarJoint",
    "PointSpring",
    "PrismaticJoint",
    "RevoluteJoint",
    "RodJoint",
    "ScrewJoint",
    "SphericalJoint",
    "Spring",
    "Tool",
    "UniversalJoint",
    "schema",
]
