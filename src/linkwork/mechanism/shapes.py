"""Shapes of bodies: what a body looks like in drawings. They have no mass and take no part in the motion.

Every shape is convex and stands about the origin of its own frame; what is not convex is made of several.
"""

from __future__ import annotations

from math import atan2, pi
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from linkwork.mechanism.frame import Frame
from linkwork.mechanism.record import MechanismError, Positive, Real, Record

ROUND = 1e-9  # how far the angles at the corners of a polygon may be from one full turn [rad]

Part = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[Part, Part, Part]


class ShapeBase(Record):
    """Say what all shapes share: where they stand in the body, and their colour."""

    type: str
    frame: Frame = Field(default=Frame(), description="the shape's frame in the body's frame")
    colour: Colour | None = Field(default=None, description="red, green and blue, each from 0 to 1")


class Box(ShapeBase):
    """Show a box with its middle in the frame's origin and its edges along the axes."""

    type: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="lengths along x, y and z [m]")


class Cylinder(ShapeBase):
    """Show a cylinder about the z axis, as long to either side of the origin."""

    type: Literal["cylinder"] = "cylinder"
    radius: Positive = Field(description="radius [m]")
    length: Positive = Field(description="length along z [m]")


class Sphere(ShapeBase):
    """Show a ball about the origin."""

    type: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="radius [m]")


class Capsule(ShapeBase):
    """Show a cylinder about the z axis with half a ball on either end, which add a radius to its length each."""

    type: Literal["capsule"] = "capsule"
    radius: Positive = Field(description="radius [m]")
    length: Positive = Field(description="length along z between the middles of the round ends [m]")


class Polygon(ShapeBase):
    """Show a plate: a convex polygon in the xy plane, half its thickness to either side."""

    type: Literal["polygon"] = "polygon"
    points: tuple[tuple[Real, Real], ...] = Field(
        min_length=3, description="corners (x, y) of a convex polygon, one after the other [m]"
    )
    thickness: Positive = Field(description="thickness along z [m]")

    @model_validator(mode="after")
    def _convex(self) -> Self:
        turns = [_turn(*(self.points[k - i] for i in (2, 1, 0))) for k in range(len(self.points))]
        same = all(turn > 0 for turn in turns) or all(turn < 0 for turn in turns)
        if not same or abs(abs(sum(turns)) - 2 * pi) > ROUND:
            raise MechanismError(
                "the corners are not those of a convex polygon in their order; give them one after the other, all turns "
                "to one side, and make what is not convex of several polygons",
                ("points",),
            )
        return self


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return the angle [rad] by which the way from a to b turns at b towards c, in [-pi, pi]."""
    (x, y), (u, v) = ((q[0] - p[0], q[1] - p[1]) for p, q in ((a, b), (b, c)))
    return atan2(x * v - y * u, x * u + y * v)


Shape = Annotated[Box | Cylinder | Sphere | Capsule | Polygon, Field(discriminator="type")]
