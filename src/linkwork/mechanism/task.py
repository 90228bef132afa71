"""Task coordinates: what of a tool's pose a mechanism is led in.

Positions are components of the tool's origin, angles those of its orientation R, both relative to
the ground or to the body that the tool is relative to:

    rx, ry, rz                rotation vector, R = exp([r x])
    roll, pitch, yaw          R = Rz(yaw) Ry(pitch) Rx(roll)
    azimuth, tilt, torsion    R = Rz(azimuth) Ry(tilt) Rz(torsion - azimuth)
    tilt_x, tilt_y            tilt (cos azimuth, sin azimuth): where the tool's z axis points,
                              regular where it is upright, too
    direction_x, _y, _z       components of the tool's z axis, of which two are independent
    turn                      about a stated axis a: R R_0' is a tilt of a after this turn, from a
                              stated orientation R_0
    distance                  of the tool's origin to a stated point

Source: Bonev, Zlatanov & Gosselin, Advantages of the modified Euler angles in the design and
control of PKMs, Parallel Kinematic Machines International Conference 2002 (tilt and torsion).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from linkwork.checks import shown, suggestion
from linkwork.mechanism.record import MechanismError, Name, Record, Vector3

__all__ = ["DistanceTo", "TaskCoordinate", "TurnAbout", "labels"]

LENGTHS = ("x", "y", "z")
ROTATION = ("rx", "ry", "rz")
ANGLES = ("angle", *ROTATION, "roll", "pitch", "yaw", "azimuth", "torsion", "tilt")
SWUNG = ("tilt_x", "tilt_y")
DIRECTIONS = ("direction_x", "direction_y", "direction_z")
NAMES = (*LENGTHS, *ANGLES, *SWUNG, *DIRECTIONS)


def known_name(name: str) -> str:
    """Accept the name of a coordinate of a pose."""
    if name not in NAMES:
        raise ValueError(
            f"{shown(name)} is no coordinate of a pose{suggestion(name, NAMES)}; there are "
            f"{', '.join(NAMES)}"
        )
    return name


TaskName = Annotated[
    str, AfterValidator(known_name), WithJsonSchema({"type": "string", "enum": list(NAMES)})
]


class TurnAbout(Record):
    """Lead a tool by its angle about a stated axis [rad], as SCARA robots and 3T1R platforms
    are."""

    type: Literal["turn"] = "turn"
    axis: Vector3 = Field(
        default=(0.0, 0.0, 1.0), description="direction of the axis, of any length"
    )
    zero: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="rotation vector of the orientation at which the angle is zero [rad]",
    )
    name: Name = Field(default="turn", description="name of the coordinate")

    @model_validator(mode="after")
    def _pointing(self) -> Self:
        if not any(self.axis):
            raise MechanismError("the axis has no length; give a direction", ("axis",))
        return self


class DistanceTo(Record):
    """Lead a tool by its distance to a point [m]."""

    type: Literal["distance"] = "distance"
    point: Vector3 = Field(default=(0.0, 0.0, 0.0), description="the point [m]")
    name: Name = Field(default="distance", description="name of the coordinate")


def kind(item: Any) -> Any:
    """Return what a description of a task coordinate is read as: the type of a record, or a
    name."""
    item = item.get("type") if isinstance(item, Mapping) else getattr(item, "type", "name")
    return item if item in ("turn", "distance", "name") else None


TaskCoordinate = Annotated[
    Annotated[TaskName, Tag("name")]
    | Annotated[TurnAbout, Tag("turn")]
    | Annotated[DistanceTo, Tag("distance")],
    Discriminator(kind),
]


def label(coordinate: TaskCoordinate) -> str:
    """Return the name of a task coordinate."""
    return coordinate if isinstance(coordinate, str) else coordinate.name


def labels(task: tuple[TaskCoordinate, ...]) -> tuple[str, ...]:
    """Return the names of task coordinates."""
    return tuple(map(label, task))


def is_angle(coordinate: TaskCoordinate) -> bool:
    """Tell whether a task coordinate is an angle that comes back after a whole turn."""
    return isinstance(coordinate, TurnAbout) or (coordinate in ANGLES and coordinate != "tilt")


def is_length(coordinate: TaskCoordinate) -> bool:
    """Tell whether a task coordinate is a length."""
    return isinstance(coordinate, DistanceTo) or coordinate in LENGTHS


def unit(coordinate: TaskCoordinate) -> str:
    """Return the unit of a task coordinate."""
    if is_length(coordinate):
        return "m"
    return "1" if coordinate in DIRECTIONS else "rad"
