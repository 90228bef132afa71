"""Contacts: which surfaces of two bodies may meet, and how they press and rub there.

A flat surface (a plane, a field of heights) meets the points of another one, each with the radius
of a ball about it: a sphere, the ends of a capsule, the corners of a box. Spheres and capsules meet
each other as well, and boxes meet spheres, capsules, points and the corners and edges of boxes.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from linkwork.mechanism.effects import Bristle, require_friction
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.impact import Impact
from linkwork.mechanism.record import Amount, MechanismError, Name, Positive, Real, Record, Vector3
from linkwork.mechanism.shapes import Shape, Touching


class Plane(Record):
    """Be the xy plane of a frame; what is solid lies below its z axis."""

    type: Literal["plane"] = "plane"
    frame: Frame = Field(default=Frame(), description="the plane's frame in the body's frame")


class HeightField(Record):
    """Be heights above the xy plane of a frame, at x = i dx, y = j dy: a bicubic spline through
    them, level outside.
    """

    type: Literal["height_field"] = "height_field"
    frame: Frame = Field(default=Frame(), description="the field's frame in the body's frame")
    heights: tuple[tuple[Real, ...], ...] = Field(
        description="heights z [m] by i along x, in it by j along y"
    )
    spacing: tuple[Positive, Positive] = Field(description="dx and dy [m]")

    @model_validator(mode="after")
    def _grid(self) -> Self:
        rows = {len(row) for row in self.heights}
        if len(self.heights) < 2 or len(rows) != 1 or min(rows) < 2:
            raise MechanismError(
                "the heights are no grid; give at least two rows of two heights, all of one length",
                ("heights",),
            )
        return self


class Points(Record):
    """Be points, each with a ball about it: the feet of a table, corners, a sampled mesh."""

    type: Literal["points"] = "points"
    points: tuple[Vector3, ...] = Field(
        min_length=1, description="the points in the body's frame [m]"
    )
    radius: Amount = Field(default=0.0, description="radius of the ball about each [m]")

    @property
    def frame(self) -> Frame:
        """The body's own frame."""
        return Frame()

    @property
    def touching(self) -> Touching:
        """Return the points themselves."""
        return Touching(self.points, self.radius, round=len(self.points) == 1)


Surface = Annotated[Plane | HeightField | Points | Shape, Field(discriminator="type")]


class Sliding(Record):
    """Rub against a sliding rate v: F = m N v / sqrt(v^2 + rate^2), with the normal force N and
    m = coefficient + (static - coefficient) exp(-(v / stribeck_rate)^2).

    With a bristle runs have its force for that.
    """

    coefficient: Amount = Field(default=0.0, description="friction over normal force of sliding")
    static: Amount | None = Field(
        default=None, description="the same at its peak, near rest; coefficient if left out"
    )
    stribeck_rate: Positive = Field(
        default=0.01, description="rate at which it has fallen most of the way [m/s]"
    )
    rate: Positive = Field(
        default=1e-3, description="rate at which smoothed friction has 71 % of its value [m/s]"
    )
    bristle: Bristle | None = Field(default=None, description="sticks in runs, by a state")

    @model_validator(mode="after")
    def _rubs(self) -> Self:
        require_friction(self.coefficient, self.static, self.bristle, "coefficient")
        return self


class Contact(Impact):
    """Let surfaces of two bodies meet: they press by the law of `Impact`, and rub.

    The depth is measured along the normal; where more than one point touches each has the law.
    """

    connects: tuple[Name, Name] = Field(description="names of the two bodies")
    surfaces: tuple[Surface, Surface] = Field(
        description="a surface of the first and one of the second body"
    )
    friction: Sliding = Field(default=Sliding(), description="rubs against sliding")
    edges: bool = Field(
        default=False, description="of two boxes: whether their edges press as well"
    )

    @property
    def touches(self) -> int:
        """In how many places the surfaces may meet."""
        solids = [of.touching for of in self.surfaces if not isinstance(of, Plane | HeightField)]
        if len(solids) == 1:
            return len(solids[0].points)
        if any(of.round for of in solids):
            return 1
        pairs = zip(solids, solids[::-1], strict=True)
        corners = sum(len(of.points) for of, other in pairs if other.halves)
        return corners + 24 * self.edges

    @model_validator(mode="after")
    def _meets(self) -> Self:
        flat = [isinstance(surface, Plane | HeightField) for surface in self.surfaces]
        kinds = " and ".join(surface.type for surface in self.surfaces)
        if all(flat):
            raise MechanismError(
                f"a contact of {kinds} has no place; give one of them points", ("surfaces",)
            )
        for index, surface in enumerate(self.surfaces):
            if not isinstance(surface, Plane | HeightField) and not surface.touching.points:
                raise MechanismError(
                    f"a {surface.type} has no corners to touch with; give a capsule, or points "
                    "on its rim",
                    ("surfaces", str(index)),
                )
        boxed = any(map(_is_box, self.surfaces)) and all(
            isinstance(of, Points) or _is_box(of) or _is_round(of) for of in self.surfaces
        )
        if not any(flat) and not boxed and not all(map(_is_round, self.surfaces)):
            raise MechanismError(
                f"{kinds} do not meet here: only spheres, capsules and single points meet each "
                "other, and boxes them, points and boxes; give one of them a plane or a field of "
                "heights, or make it of spheres or boxes",
                ("surfaces",),
            )
        if self.edges and not all(map(_is_box, self.surfaces)):
            raise MechanismError(
                f"{kinds} have no edges that cross; edges are of two boxes", ("edges",)
            )
        return self


def _is_round(surface: Surface) -> bool:
    """Tell whether a surface is a ball, or all between two."""
    return not isinstance(surface, Plane | HeightField) and surface.touching.round


def _is_box(surface: Surface) -> bool:
    """Tell whether a surface is that of a box."""
    return not isinstance(surface, Plane | HeightField) and bool(surface.touching.halves)


def touch_names(name: str, contact: Contact) -> tuple[str, ...]:
    """Return the names of the places where a contact's surfaces may meet: "heel", or "sole.1",
    "sole.2" ..."""
    count = contact.touches
    return (name,) if count == 1 else tuple(f"{name}.{i}" for i in range(1, count + 1))
