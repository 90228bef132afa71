"""Stage 1, describe: a mechanism as frozen data, and its file format. No mathematics."""

from linkwork.mechanism.body import Body, Inertia
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.joints import FixedJoint, Joint, PrismaticJoint, RevoluteJoint
from linkwork.mechanism.mechanism import GROUND, Mechanism, Tool
from linkwork.mechanism.record import MechanismError

__all__ = [
    "GROUND",
    "Body",
    "FixedJoint",
    "Frame",
    "Inertia",
    "Joint",
    "Mechanism",
    "MechanismError",
    "PrismaticJoint",
    "RevoluteJoint",
    "Tool",
]
