"""Servos: drives whose force is a linear function of position and rate with clipped ends, as the
actuators of MuJoCo are.

    c = command within its range            l = gear x,    l' = gear w
    f = (gain + gain_position l + gain_rate l') a + bias + bias_position l + bias_rate l'
    F = gear (f within its range)

The activation a is the command itself (`Servo`), follows it with a lag (`LaggingServo`), or
integrates it (`IntegratingServo`). A motor has a gain alone; kp on positions and kv on rates are
gain = kp, bias_position = -kp, bias_rate = -kv; a speed governor gain = kv, bias_rate = -kv; a
damper gain = 0, gain_rate = -kv.

Source: the MJCF reference of MuJoCo 4, "actuator/general".
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from linkwork import math
from linkwork.control.drives import Drive, Extra
from linkwork.control.records import number
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Positive

RANGES = ("command", "force", "activation")


@dataclass(frozen=True)
class Servo(Drive):
    """Give a force that the command, the position and the rate determine at once; the command may
    be a force, a position, a rate or an opening, as gain and bias make of it.

    Numbers that are left out are not there: no range, no bias; `numbers` holds the others.
    """

    gain: float = number("force by activation", "N, N m", default=1.0)
    gain_position: float = number("of the gain by l", "1/m, 1/rad", default=0.0)
    gain_rate: float = number("of the gain by l'", "s/m, s/rad", default=0.0)
    bias: float = number("force at zero", "N, N m", default=0.0)
    bias_position: float = number("force by l", "N/m, N m/rad", default=0.0)
    bias_rate: float = number("force by l'", "N s/m, N m s/rad", default=0.0)
    gear: float = number("l by joint coordinate", "1", default=1.0)
    least_command: float | None = number("bound of the command", "its unit", default=None)
    largest_command: float | None = number("bound of the command", "its unit", default=None)
    least_force: float | None = number("bound of f", "N, N m", default=None)
    largest_force: float | None = number("bound of f", "N, N m", default=None)

    type: ClassVar[str] = "servo"
    unit: ClassVar[str] = "as gain and bias make of it"

    def __post_init__(self) -> None:
        super().__post_init__()
        for what in RANGES:
            ends = [getattr(self, f"{end}_{what}", None) for end in ("least", "largest")]
            if None in ends or any(map(math.symbolic, ends)):
                continue
            if not ends[0] <= ends[1]:  # pyright: ignore
                raise LinkworkError(
                    f"least_{what} of {type(self).__name__} is {ends[0]:g} and largest_{what} "
                    f"{ends[1]:g}; give the smaller one as least_{what}"
                )

    @property
    def numbers(self):
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        there = {
            f.name: given[f.name]
            for f in fields(self)
            if f.name == "gain" or given[f.name] != f.default
        }
        return {
            name: float(value) for name, value in there.items() if not name.startswith("initial_")
        }

    def equations(self, command, x, w, z):
        length, rate, c = self.gear * x, self.gear * w, self.commanded(command)
        return self.force(c, length, rate), ()

    def commanded(self, command: Any) -> Any:
        """Return the command within its range."""
        return within(command, self.least_command, self.largest_command)

    def force(self, activation: Any, length: Any, rate: Any) -> Any:
        """Return F for an activation, l and l'.

        activation: of the command, one of muscles; length: l [m, rad]; rate: l' [m/s, rad/s].
        """
        gain = self.gain + self.gain_position * length + self.gain_rate * rate
        bias = self.bias + self.bias_position * length + self.bias_rate * rate
        return self.gear * within(gain * activation + bias, self.least_force, self.largest_force)


@dataclass(frozen=True)
class LaggingServo(Servo):
    """Be a `Servo` whose activation follows the command with a first-order lag, time_constant a' =
    c - a, and stays within its range."""

    time_constant: float = number("", "s", Positive, 1.0)
    least_activation: float | None = number("bound of a", "as the command", default=None)
    largest_activation: float | None = number("bound of a", "as the command", default=None)
    initial_activation: float = number("a at the start", "of the command", default=0.0)

    type: ClassVar[str] = "lagging_servo"

    @property
    def extras(self):
        return (Extra("activation", "as the command", self.initial_activation),)

    def equations(self, command, x, w, z):
        change = (self.commanded(command) - z[0]) / self.time_constant
        activation, change = bounded(z[0], change, self.least_activation, self.largest_activation)
        return self.force(activation, self.gear * x, self.gear * w), (change,)


@dataclass(frozen=True)
class IntegratingServo(Servo):
    """Be a `Servo` whose activation integrates the command, a' = c, and stays within its range."""

    least_activation: float | None = number("bound of a", "as its unit", default=None)
    largest_activation: float | None = number("bound of a", "as its unit", default=None)
    initial_activation: float = number("a at the start", "command times s", default=0.0)

    type: ClassVar[str] = "integrating_servo"

    @property
    def extras(self):
        return (Extra("activation", "command times s", self.initial_activation),)

    def equations(self, command, x, w, z):
        change = self.commanded(command)
        activation, change = bounded(z[0], change, self.least_activation, self.largest_activation)
        return self.force(activation, self.gear * x, self.gear * w), (change,)


def bounded(a: Any, change: Any, least: Any, largest: Any) -> tuple[Any, Any]:
    """Return an activation and its rate within bounds, at which it stays; None is no bound."""
    if largest is not None:
        change = math.where(a < largest, change, math.minimum(change, 0))
    if least is not None:
        change = math.where(a > least, change, math.maximum(change, 0))
    return within(a, least, largest), change


def within(value: Any, least: Any, largest: Any) -> Any:
    """Return a value within bounds; None is no bound."""
    value = value if least is None else math.maximum(value, least)
    return value if largest is None else math.minimum(value, largest)
