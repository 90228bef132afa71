"""Stage 1, describe: a mechanism as frozen data, and its file format. No mathematics."""

from linkwork.mechanism import joints, shapes, transmissions
from linkwork.mechanism.bearing import GearTeeth, JournalBearing, SlidingBearing
from linkwork.mechanism.body import Body, Inertia
from linkwork.mechanism.contact import Contact, HeightField, Plane, Points, Sliding
from linkwork.mechanism.effects import Bristle, Effects, Friction, Lift, Limits, PointSpring, Spring
from linkwork.mechanism.fluid import BoxDrag, EllipsoidDrag, Fluid
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.impact import Stop
from linkwork.mechanism.joints import *  # noqa: F403 - all types of joints
from linkwork.mechanism.json_schema import schema
from linkwork.mechanism.mechanism import GROUND, Mechanism, Tool
from linkwork.mechanism.record import MechanismError
from linkwork.mechanism.shapes import *  # noqa: F403 - all shapes
from linkwork.mechanism.task import DistanceTo, TurnAbout
from linkwork.mechanism.transmissions import *  # noqa: F403 - all transmissions

__all__ = [
    "GROUND",
    "Body",
    "BoxDrag",
    "Bristle",
    "Contact",
    "DistanceTo",
    "Effects",
    "EllipsoidDrag",
    "Fluid",
    "Frame",
    "Friction",
    "GearTeeth",
    "HeightField",
    "Inertia",
    "JournalBearing",
    "Lift",
    "Limits",
    "Mechanism",
    "MechanismError",
    "Plane",
    "PointSpring",
    "Points",
    "Sliding",
    "SlidingBearing",
    "Spring",
    "Stop",
    "Tool",
    "TurnAbout",
    "schema",
]
__all__ += joints.__all__
__all__ += shapes.__all__
__all__ += transmissions.__all__
