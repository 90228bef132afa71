"""Shapes of bodies: what a body looks like in drawings. They take no part in the motion, but for
those that a contact names; a body that does not say what it weighs weighs what its shapes with a
density do (`linkwork.mechanism.density`).

A simple shape is convex and stands about the origin of its own frame; what is not convex is made of
several, or is a mesh in a file. All that draws a simple shape knows it by its `outline` alone.
"""

from __future__ import annotations

import os
from itertools import product
from math import atan2, cos, pi, sin
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import AfterValidator, Field, model_validator

from linkwork.mechanism.frame import Frame
from linkwork.mechanism.record import MechanismError, Positive, Real, Record
from linkwork.mechanism.refusal import PLAIN, shown

__all__ = ["Box", "Capsule", "Cylinder", "Ellipsoid", "MeshFile", "Polygon", "Shape", "Sphere"]
ROUND = 1e-9  # how far the angles at the corners of a polygon may be from one full turn [rad]

Share = Annotated[float, Field(ge=0, le=1), PLAIN]
Colour = tuple[Share, Share, Share]

STEPS = 6  # of a quarter circle
QUARTER = (*((cos(pi / 2 * k / STEPS), sin(pi / 2 * k / STEPS)) for k in range(STEPS)), (0.0, 1.0))
SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))


class Outline(NamedTuple):
    """Outline a solid about the origin, before it is scaled along x, y and z.

    points: the corners (x, y) of a convex polygon, which is a plate half a unit to either side; or,
    `turned`, a profile (radius, height) that goes round z, from below to above
    """

    points: tuple[tuple[float, float], ...]
    scale: tuple[float, float, float]
    turned: bool = False


class Touching(NamedTuple):
    """Hold the points at which a solid touches a plane, with the radius of a ball about each.

    round: whether the solid is that ball, or all between two of them; halves: half its lengths
    along x, y and z, of one with faces across these
    """

    points: tuple[tuple[Any, Any, Any], ...] = ()
    radius: Any = 0.0
    round: bool = False
    halves: tuple[Any, ...] = ()


def rounded(half: float) -> tuple[tuple[float, float], ...]:
    """Return the profile of a cylinder of radius 1 from -half to half, with half balls on its
    ends."""
    above = tuple((radius, height + half) for radius, height in QUARTER)
    below = tuple((radius, -height) for radius, height in reversed(above))
    return below + above[0 if half else 1 :]


class ShapeBase(Record):
    """Say what all shapes share: where they stand in the body, their colour, and what they look
    like."""

    type: str
    frame: Frame = Field(default=Frame(), description="the shape's frame in the body's frame")
    colour: Colour | None = Field(default=None, description="red, green and blue, each from 0 to 1")
    density: Positive | None = Field(
        default=None, description="density [kg/m^3], by which a body that gives no mass is weighed"
    )

    @property
    def touching(self) -> Touching:
        """Return the points at which the solid touches a plane; none where they are not always the
        same."""
        return Touching()


class SimpleShape(ShapeBase):
    """Say what all shapes share that a few numbers describe."""

    @property
    def outline(self) -> Outline:
        """Return the outline of the solid."""
        raise NotImplementedError

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return the radius of a ball, radius and half length of a cylinder or capsule, half axes
        of a box or an ellipsoid [m]; nothing of any other."""
        return ()


class Box(SimpleShape):
    """Show a box with its middle in the frame's origin and its edges along the axes."""

    type: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="lengths along x, y and z [m]")

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return half the lengths along x, y and z."""
        x, y, z = self.size
        return x / 2, y / 2, z / 2

    @property
    def outline(self) -> Outline:
        """Return a square plate, scaled."""
        return Outline(SQUARE, self.size)

    @property
    def touching(self) -> Touching:
        """Return the corners."""
        x, y, z = (size / 2 for size in self.size)
        corners = tuple(product((-x, x), (-y, y), (-z, z)))
        return Touching(corners, halves=self.half_sizes)


class Cylinder(SimpleShape):
    """Show a cylinder about the z axis, as long to either side of the origin."""

    type: Literal["cylinder"] = "cylinder"
    radius: Positive = Field(description="radius [m]")
    length: Positive = Field(description="length along z [m]")

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return radius and half length."""
        return self.radius, self.length / 2

    @property
    def outline(self) -> Outline:
        """Return a line along z that goes round it."""
        return Outline(
            ((1.0, -0.5), (1.0, 0.5)), (self.radius, self.radius, self.length), turned=True
        )


class Sphere(SimpleShape):
    """Show a ball about the origin."""

    type: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="radius [m]")

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return the radius."""
        return (self.radius,)

    @property
    def outline(self) -> Outline:
        """Return half a circle that goes round z."""
        return Outline(rounded(0.0), (self.radius, self.radius, self.radius), turned=True)

    @property
    def touching(self) -> Touching:
        """Return the middle with the radius."""
        return Touching(((0.0, 0.0, 0.0),), self.radius, round=True)


class Capsule(SimpleShape):
    """Show a cylinder about the z axis with half a ball on either end, which add a radius to its
    length each."""

    type: Literal["capsule"] = "capsule"
    radius: Positive = Field(description="radius [m]")
    length: Positive = Field(description="length along z between the middles of the round ends [m]")

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return radius and half length."""
        return self.radius, self.length / 2

    @property
    def outline(self) -> Outline:
        """Return a line with quarter circles at its ends that goes round z."""
        return Outline(
            rounded(self.length / self.radius / 2),
            (self.radius, self.radius, self.radius),
            turned=True,
        )

    @property
    def touching(self) -> Touching:
        """Return the middles of the round ends with their radius."""
        ends = ((0.0, 0.0, -self.length / 2), (0.0, 0.0, self.length / 2))
        return Touching(ends, self.radius, round=True)


class Ellipsoid(SimpleShape):
    """Show an ellipsoid about the origin, its axes along x, y and z."""

    type: Literal["ellipsoid"] = "ellipsoid"
    radii: tuple[Positive, Positive, Positive] = Field(description="half axes along x, y and z [m]")

    @property
    def half_sizes(self) -> tuple[float, ...]:
        """Return the half axes."""
        return self.radii

    @property
    def outline(self) -> Outline:
        """Return half a circle that goes round z, scaled."""
        return Outline(rounded(0.0), self.radii, turned=True)


class Polygon(SimpleShape):
    """Show a plate: a convex polygon in the xy plane, half its thickness to either side."""

    type: Literal["polygon"] = "polygon"
    points: tuple[tuple[Real, Real], ...] = Field(
        min_length=3, description="corners (x, y) of a convex polygon, one after the other [m]"
    )
    thickness: Positive = Field(description="thickness along z [m]")

    @property
    def outline(self) -> Outline:
        """Return the polygon itself."""
        return Outline(self.points, (1.0, 1.0, self.thickness))

    @property
    def touching(self) -> Touching:
        """Return the corners of both faces."""
        return Touching(self.corners)

    @property
    def corners(self) -> tuple[tuple[float, float, float], ...]:
        """Return the corners of both faces, one after the other."""
        z = self.thickness / 2
        return tuple((x, y, side) for x, y in self.points for side in (-z, z))

    @model_validator(mode="after")
    def _convex(self) -> Self:
        turns = [_turn(*(self.points[k - i] for i in (2, 1, 0))) for k in range(len(self.points))]
        same = all(turn > 0 for turn in turns) or all(turn < 0 for turn in turns)
        if not same or abs(abs(sum(turns)) - 2 * pi) > ROUND:
            raise MechanismError(
                "the corners are not those of a convex polygon in their order; give them one after "
                "the other, all turns to one side, and make what is not convex of several polygons",
                ("points",),
            )
        return self


def _whole(path: str) -> str:
    """Return a path from the root of the file system."""
    if not path.strip() or "\0" in path:
        raise ValueError(f"{shown(path)} is no path; name a file of a mesh")
    return os.path.abspath(path)


class MeshFile(ShapeBase):
    """Show the triangles of a file: STL, OBJ, PLY, OFF, glTF, COLLADA or MSH.

    They have the file's own axes, and its unit times `scale`. Counter-clockwise seen from outside,
    as files have them, and closed, they have a mass too.
    """

    type: Literal["mesh"] = "mesh"
    file: Annotated[str, AfterValidator(_whole)] = Field(
        description="path of the file, relative to the mechanism's file or to where one works"
    )
    scale: tuple[Real, Real, Real] = Field(
        default=(1.0, 1.0, 1.0),
        description="factors of the file's x, y and z; negative ones mirror",
    )
    inertia: Literal["exact", "convex", "shell"] = Field(
        default="exact",
        description="what has the density: what the mesh encloses, its convex hull, or its surface "
        "[kg/m^2]",
    )

    @model_validator(mode="after")
    def _extended(self) -> Self:
        if 0 in self.scale:
            raise MechanismError("a factor is 0; give factors other than 0", ("scale",))
        return self


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return the angle [rad] by which the way from a to b turns at b towards c, in [-pi, pi]."""
    (x, y), (u, v) = ((q[0] - p[0], q[1] - p[1]) for p, q in ((a, b), (b, c)))
    return atan2(x * v - y * u, x * u + y * v)


Shape = Annotated[
    Box | Cylinder | Sphere | Capsule | Ellipsoid | Polygon | MeshFile, Field(discriminator="type")
]
