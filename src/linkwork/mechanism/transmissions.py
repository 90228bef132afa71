"""Transmissions: what an actuator's force acts along where that is not the rate of one joint, and
springs, friction and inertia with it.

A transmission has a length l(q), or only the rate of one, and a force f along it does the power
f l' on the mechanism: it acts on the rates w as J' f, with l' = J w.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import dist
from typing import Annotated, ClassVar, Literal, get_args

from pydantic import Field, model_validator

from linkwork.mechanism.effects import Effects, Friction, Spring, require_ends
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.impact import Stop
from linkwork.mechanism.record import (
    Amount,
    MechanismError,
    Name,
    PathName,
    Positive,
    Real,
    Record,
    Vector3,
)

__all__ = [
    "Cable",
    "CablePart",
    "Combination",
    "Displacement",
    "LoadedLength",
    "OverCylinder",
    "OverSphere",
    "PulleyBlock",
    "SlackSpring",
    "SliderCrank",
    "Thrust",
    "Transmission",
    "ViaPoint",
]


def acts(value: object) -> bool:
    """Tell whether a number is anything but zero; a free one is."""
    return not (isinstance(value, int | float) and value == 0)


class SlackSpring(Spring):
    """Pull a length towards its rest where it is shorter or longer than that:
    F as of a spring, of x = max(l - rest - slack, 0) + min(l - rest, 0)."""

    slack: Amount = Field(
        default=0.0, description="range of lengths from rest on without force [m, rad]"
    )


class LoadedLength(Record):
    """Say what acts along a length."""

    friction: Friction = Field(default=Friction(), description="resists the rate of the length")
    spring: SlackSpring = Field(
        default=SlackSpring(), description="pulls the length towards its rest"
    )
    inertia: Amount = Field(
        default=0.0, description="inertia that moves with the rate of the length [kg; kg m^2]"
    )
    stop: Stop | None = Field(
        default=None, description="presses back past ends of the length, as teeth with backlash"
    )

    @property
    def ends(self) -> dict[str, float]:
        """The lengths at which the stop begins, by side."""
        return Effects(stop=self.stop).ends

    @model_validator(mode="after")
    def _stops_somewhere(self):
        require_ends(Effects(stop=self.stop), ("stop",))
        return self

    @property
    def loads(self) -> tuple[float, ...]:
        """The numbers that are all zero where nothing acts."""
        stop = self.stop.stiffness if self.stop else 0.0
        return (*self.resistance, *self.spring.pulls, self.inertia, stop)

    @property
    def resistance(self) -> tuple[float, ...]:
        """The numbers that are all zero where nothing resists the rate."""
        stop = self.stop.stiffness if self.stop else 0.0
        return *self.friction.smooth, self.friction.coulomb, self.spring.damping, stop


class Combination(LoadedLength):
    """Add joint coordinates up to a length: l = offset + sum of ratio_i q_i; a force f along it is
    ratio_i f on the rate of each."""

    type: Literal["sum"] = "sum"
    ratios: Mapping[PathName, Real] = Field(
        description="ratio by coordinate, at least one [1; m/rad between kinds]"
    )
    offset: Real = Field(default=0.0, description="length where all coordinates are zero [m, rad]")

    @model_validator(mode="after")
    def _combines(self):
        if not any(self.ratios.values()):
            raise MechanismError(
                "combines no coordinate; give at least one ratio other than zero", ("ratios",)
            )
        return self


class ViaPoint(Record):
    """Lead a cable through a point of a body."""

    type: Literal["point"] = "point"
    body: Name = Field(description="name of the body")
    point: Vector3 = Field(default=(0.0, 0.0, 0.0), description="in the body's frame [m]")


class _Over(Record):
    """Lead a cable round a body's surface, the shorter way, where the straight way between the
    points before and behind it passes through; by one side of it; or inside it."""

    body: Name = Field(description="name of the body")
    frame: Frame = Field(default=Frame(), description="of the surface, in the body's frame")
    radius: Positive = Field(description="of the surface [m]")
    inside: bool = Field(
        default=False,
        description="it is led through the surface as through a ring, and touches it from within",
    )
    side: ViaPoint | None = Field(
        default=None,
        description="point by whose side of the surface the cable is led: it never crosses the "
        "half-line from the centre away from there; one of another body that comes nearer to the "
        "centre than the radius leads it inside",
    )

    @model_validator(mode="after")
    def _leads_by_one_side(self):
        if self.side is None:
            return self
        if self.inside:
            raise MechanismError("is inside, which has no side; leave one of both out", ("side",))
        away = dist(self.side.point, self.frame.position)
        if self.side.body == self.body and away < self.radius:
            raise MechanismError(
                f"is {away:g} m from the centre, within the radius of {self.radius:g} m; give a "
                "point outside, or inside: true",
                ("side",),
            )
        return self


class OverSphere(_Over):
    """Lead a cable round a sphere about the frame's origin."""

    type: Literal["sphere"] = "sphere"


class OverCylinder(_Over):
    """Lead a cable round a cylinder, without ends, about the frame's z axis."""

    type: Literal["cylinder"] = "cylinder"


class PulleyBlock(Record):
    """Begin a branch of a cable, and end the one before: its length counts by 1 / divisor."""

    type: Literal["pulley"] = "pulley"
    divisor: Positive = Field(description="by which the length of what follows is divided")


CablePart = Annotated[
    ViaPoint | OverSphere | OverCylinder | PulleyBlock, Field(discriminator="type")
]


class Cable(LoadedLength):
    """Measure the way of a cable from point to point and round bodies; tension is a force along
    it below zero."""

    type: Literal["cable"] = "cable"
    path: tuple[CablePart, ...] = Field(
        description="points that it passes, surfaces between them, and pulleys between branches"
    )

    @model_validator(mode="after")
    def _leads(self):
        kinds = [part.type for part in self.path]
        ahead = kinds[1:] if kinds[:1] == ["pulley"] else kinds
        for branch in " ".join(ahead).split("pulley"):
            parts = branch.split()
            apart = all("point" in pair for pair in pairwise(parts))
            if len(parts) < 2 or parts[0] != "point" or parts[-1] != "point" or not apart:
                raise MechanismError(
                    "a branch of a cable begins and ends with a point, has two or more, and none "
                    f"but single surfaces between them; here it is {', '.join(parts) or 'empty'}",
                    ("path",),
                )
        return self

    @property
    def rounded(self) -> tuple[int, ...]:
        """Places in the path of the surfaces where what acts along the cable has kinks."""
        surfaces = (k for k, part in enumerate(self.path) if isinstance(part, _Over))
        return tuple(surfaces) if any(map(acts, self.loads)) else ()

    @property
    def leaps(self) -> tuple[int, ...]:
        """Places in the path of the surfaces where energy of its own may leap: that of what moves
        with it where it changes sides, and that of a spring or stop where its length leaps."""
        stores = self.stop is not None or any(map(acts, (self.inertia, *self.spring.pulls)))
        parts = (self.path[k] for k in self.rounded)
        inside = (isinstance(part, _Over) and part.inside for part in parts)
        return tuple(k for k, no in zip(self.rounded, inside, strict=True) if stores and not no)

    @property
    def lines_up(self) -> tuple[int, ...]:
        """Places in the path of the cylinders where its rate leaps, and nothing else, as it changes
        sides."""
        found = []
        for k in self.rounded:
            part = self.path[k]
            if isinstance(part, OverCylinder) and part.side is None and not part.inside:
                found.append(k)
        return () if acts(self.inertia) else tuple(found)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that it touches, in its order, and of those that have its sides."""
        surfaces = (part for part in self.path if isinstance(part, _Over))
        sides = (part.side.body for part in surfaces if part.side is not None)
        touched = (part.body for part in self.path if not isinstance(part, PulleyBlock))
        return (*touched, *sides)


class Thrust(Record):
    """Act on a body with a force and a moment that move with it: f of the actuator is the wrench
    (f moment, f force)."""

    type: Literal["thrust"] = "thrust"
    body: Name = Field(description="name of the body")
    point: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="where the force acts, in the body's frame [m]"
    )
    force: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="force by f = 1, in the body's axes [1]"
    )
    moment: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="moment by f = 1, in the body's axes [m]"
    )
    resistance: ClassVar[tuple[float, ...]] = ()

    @model_validator(mode="after")
    def _pushes(self):
        if not any((*self.force, *self.moment)):
            raise MechanismError("pushes nowhere; give a force, a moment, or both", ("force",))
        return self


class SliderCrank(Record):
    """Act along the way of a massless slider that a massless rod joins to a pin: with a the
    slider's axis and v the vector to the pin from where the slider is at l = 0,

        l = a . v - sqrt((a . v)^2 + rod^2 - v . v)

    or a . v where the rod does not reach the axis."""

    type: Literal["slider_crank"] = "slider_crank"
    pin: ViaPoint = Field(description="where the rod ends on the crank")
    body: Name = Field(description="name of the body along which the slider moves")
    frame: Frame = Field(
        default=Frame(), description="of the slider in that body: it moves along its z axis"
    )
    rod: Positive = Field(description="length of the rod [m]")
    resistance: ClassVar[tuple[float, ...]] = ()

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that it acts on."""
        return self.pin.body, self.body


class Displacement(Record):
    """Act between two bodies along what a frame of one is displaced and turned against a frame of
    the other: l = force . p + moment . phi, with its origin p and the rotation vector phi, both
    seen from there. The rate is that of p, and of phi the angular velocity."""

    type: Literal["displacement"] = "displacement"
    body: Name = Field(description="name of the body")
    frame: Frame = Field(default=Frame(), description="in the body's frame")
    base: Name = Field(description="name of the other body, or ground")
    base_frame: Frame = Field(default=Frame(), description="in the other body's frame")
    force: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="force by f = 1, in the axes of the base's frame [1]"
    )
    moment: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="moment by f = 1, in the same axes [m]"
    )
    resistance: ClassVar[tuple[float, ...]] = ()

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that it acts on."""
        return self.body, self.base

    @model_validator(mode="after")
    def _pushes(self):
        if not any((*self.force, *self.moment)):
            raise MechanismError("pushes nowhere; give a force, a moment, or both", ("force",))
        return self


Transmission = Annotated[
    Combination | Cable | Thrust | SliderCrank | Displacement, Field(discriminator="type")
]
TYPES: dict[str, type[Record]] = {
    kind.model_fields["type"].default: kind for kind in get_args(get_args(Transmission)[0])
}
"""The types of transmissions by their name in files."""


def cables_among(lines: Mapping[str, Transmission], names: Sequence[str]) -> list[int]:
    """Return the places, among some names, of those that transmissions have as cables."""
    return [k for k, name in enumerate(names) if isinstance(lines.get(name), Cable)]
