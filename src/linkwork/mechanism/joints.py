"""Joint types as data: which two bodies, where, about or along which axis.

A joint connects a first to a second body (`connects`) and has a frame on each (`frames`). Its coordinates measure the
second frame's motion relative to the first; at zero the two coincide. Any joint may close a loop: nothing here knows
of trees.
"""

from __future__ import annotations

from math import hypot
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from linkwork.mechanism.frame import Frame
from linkwork.mechanism.record import Name, Record, Vector3


def unit_axis(axis: Vector3) -> Vector3:
    """Normalise an axis; one without length is refused."""
    length = hypot(*axis)
    if length < 1e-12:
        raise ValueError(f"axis {list(axis)} has no length; give a direction such as [0, 0, 1]")
    x, y, z = axis
    return axis if abs(length - 1) < 1e-15 else (x / length, y / length, z / length)


Axis = Annotated[Vector3, AfterValidator(unit_axis)]


class JointBase(Record):
    """Connect the first body's frame F1 to the second body's frame F2."""

    connects: tuple[Name, Name] = Field(description="names of the first and the second body")
    frames: tuple[Frame, Frame] = Field(
        default=(Frame(), Frame()), description="joint frame in the first and in the second body"
    )


class FixedJoint(JointBase):
    """Weld the two frames together: no coordinate."""

    type: Literal["fixed"] = "fixed"


class RevoluteJoint(JointBase):
    """Let F2 turn by q [rad] about `axis` (the same components in F1 and F2): R_12 = Rot(axis, q), p_12 = 0."""

    type: Literal["revolute"] = "revolute"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")


class PrismaticJoint(JointBase):
    """Let F2 slide by q [m] along `axis` (the same components in F1 and F2): R_12 = 1, p_12 = q axis."""

    type: Literal["prismatic"] = "prismatic"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")


Joint = Annotated[FixedJoint | RevoluteJoint | PrismaticJoint, Field(discriminator="type")]
