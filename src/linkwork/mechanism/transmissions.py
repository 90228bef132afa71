"""Transmissions: what an actuator's force acts along where that is not the rate of one joint, and
springs, friction and inertia with it.

A transmission has a length l(q), or only the rate of one, and a force f along it does the power
f l' on the mechanism: it acts on the rates w as J' f, with l' = J w.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, get_args

from pydantic import Field, model_validator

from linkwork.mechanism.effects import Friction, Spring
from linkwork.mechanism.record import (
    Amount,
    MechanismError,
    Name,
    PathName,
    Real,
    Record,
    Vector3,
)

__all__ = ["Combination", "LoadedLength", "SlackSpring", "Thrust", "Transmission"]


class SlackSpring(Spring):
    """Pull a length towards its rest where it is shorter or longer than that:
    F = -stiffness (max(l - rest - slack, 0) + min(l - rest, 0)) - damping l'."""

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

    @property
    def loads(self) -> tuple[float, ...]:
        """The numbers that are all zero where nothing acts."""
        return (*self.resistance, self.spring.stiffness, self.inertia)

    @property
    def resistance(self) -> tuple[float, ...]:
        """The numbers that are all zero where nothing resists the rate."""
        return self.friction.viscous, self.friction.coulomb, self.spring.damping


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


Transmission = Annotated[Combination | Thrust, Field(discriminator="type")]
TYPES: dict[str, type[Record]] = {
    kind.model_fields["type"].default: kind for kind in get_args(get_args(Transmission)[0])
}
"""The types of transmissions by their name in files."""
