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
from linkwork.mechanism.shapes import Box, Capsule, Cylinder, Polygon, Shape, Sphere

__all__ = [
    "GROUND",
    "Body",
    "Box",
    "Capsule",
    "Cylinder",
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
    "Polygon",
    "PrismaticJoint",
    "RevoluteJoint",
    "RodJoint",
    "ScrewJoint",
    "Shape",
    "Sphere",
    "SphericalJoint",
    "Spring",
    "Tool",
    "UniversalJoint",
    "schema",
]
