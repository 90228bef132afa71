"""Drives: what stands between a command and the force on an actuated joint.

    F = F(command, x, w, z),    z' = f(command, x, w, z)       x, w: the joint's coordinate and rate

A drive is frozen data. Its numbers are free parameters of a run, named joint.number
("slide_1.resistance"), and its equations are written with its own fields: `equations` takes numbers
and symbols alike.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple

from linkwork import checks, math
from linkwork.control.records import ActingPart, described, number
from linkwork.mechanism.record import Amount, Positive

BOUNDED: dict[Any, Any] = {Positive: checks.positive, Amount: checks.amount_of}  # Real: any number


class Extra(NamedTuple):
    """Describe an extra state: its name, unit and value at the start."""

    name: str
    unit: str
    initial: float


@dataclass(frozen=True)
class Drive(ActingPart, ABC):
    """Turn a command into a force [N, N m] on a joint's rate, by way of extra states.

    type: its name in study files; unit: of the command
    positive: names of the numbers that have to be, beside those that are described so
    """

    type: ClassVar[str] = ""
    unit: ClassVar[str] = "N, N m"
    positive: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        told = {name: of.kind for name, of in described(type(self)).items()}
        told |= dict.fromkeys(self.positive, Positive)
        held = {f.name: f for f in fields(self)}
        for name, value in vars(self).items():
            if math.symbolic(value):
                continue
            what, own = f"{name} of {type(self).__name__}", held.get(name)
            if own is not None and own.type in (bool, "bool"):
                checks.switch(value, what)
            elif value is not None or not (own and "None" in str(own.type)):
                BOUNDED.get(told.get(name), checks.number)(value, what)

    @property
    def extras(self) -> tuple[Extra, ...]:
        """The extra states z."""
        return ()

    @abstractmethod
    def equations(self, command: Any, x: Any, w: Any, z: Any) -> tuple[Any, tuple[Any, ...]]:
        """Return the force and z' for a command, the joint's coordinate [m, rad] and rate, and
        z.

        command: in `unit`; x: [m, rad]; w: [m/s, rad/s]; z: values of `extras`, in order; each a
        number or a symbol.
        """

    def require_start(self, x: float) -> None:
        """Refuse the joint's coordinate [m, rad] at the start of a run if the drive cannot be
        there.

        x: of the joint that is driven.
        """

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of the drive's equations by name: free parameters."""
        values = {
            f.name: getattr(self, f.name) for f in fields(self) if not f.name.startswith("initial_")
        }
        return {name: float(value) for name, value in values.items() if not isinstance(value, bool)}


@dataclass(frozen=True)
class Ideal(Drive):
    """Give the force that is commanded."""

    def equations(self, command, x, w, z):
        return command, ()


@dataclass(frozen=True)
class Saturated(Drive):
    """Bound the force: F = command within +-limit; smooth: F = limit tanh(command / limit)."""

    limit: float = number("largest force", "N, N m", Positive)
    smooth: bool = False

    type: ClassVar[str] = "saturated"

    def equations(self, command, x, w, z):
        if self.smooth:
            return self.limit * math.tanh(command / self.limit), ()
        return math.clip(command, -self.limit, self.limit), ()


@dataclass(frozen=True)
class Lag(Drive):
    """Follow the command with a first-order lag: time_constant F' = command - F."""

    time_constant: float = number("", "s", Positive)
    initial_force: float = number("at the start", "N, N m", default=0.0)

    type: ClassVar[str] = "lag"

    @property
    def extras(self):
        return (Extra("force", "N, N m", self.initial_force),)

    def equations(self, command, x, w, z):
        return z[0], ((command - z[0]) / self.time_constant,)


@dataclass(frozen=True)
class DCMotor(Drive):
    """Drive a joint by a permanent-magnet motor through a gear; the command is the armature's
    voltage [V].

        L i' = V - R i - K N w,    F = N K i

    The rotor's inertia J belongs to the joint: its `rotor_inertia` is N^2 J.

    Source: Spong, Hutchinson & Vidyasagar, Robot Modeling and Control, sec. 6.2.
    """

    resistance: float = number("R", "ohm", Positive)
    inductance: float = number("L", "H", Positive)
    torque_constant: float = number("K", "N m/A = V s/rad", Positive)
    gear: float = number("N, motor angle per joint coordinate", "1; rad/m for a slide", default=1.0)
    initial_current: float = number("i at the start", "A", default=0.0)

    type: ClassVar[str] = "dc_motor"
    unit: ClassVar[str] = "V"

    @property
    def extras(self):
        return (Extra("current", "A", self.initial_current),)

    def equations(self, command, x, w, z):
        constant = self.torque_constant * self.gear
        return constant * z[0], (
            (command - self.resistance * z[0] - constant * w) / self.inductance,
        )
