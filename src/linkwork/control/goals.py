"""Goals: what a controller leads the actuated joints to: a fixed configuration, a motion, or
sampled coordinates.

x_d(t), x_d'(t), x_d''(t)  of a motion: one spline of its coordinates, and that spline's own
derivatives
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from linkwork import checks
from linkwork.control.observation import Names
from linkwork.control.plant import NamedCoordinates, TimedStates
from linkwork.errors import LinkworkError
from linkwork.simulation import Sampled, Signal, as_signal

Goal: TypeAlias = NamedCoordinates | TimedStates | Mapping[str, float] | Sampled | Signal


@dataclass(frozen=True, eq=False)
class DesiredMotion:
    """Hold the coordinates (na) of the actuated joints over time."""

    positions: Signal

    @cached_property
    def signals(self) -> tuple[Signal, Signal, Signal]:
        """x_d and its first and second derivative."""
        rates = self.positions.derivative()
        return self.positions, rates, rates.derivative()

    @property
    def still(self) -> bool:
        """Whether the coordinates are constant."""
        return (
            not self.positions.coefficients[:, 1:].any() and len(self.positions.coefficients) == 1
        )

    def at(self, t: Any) -> tuple[Any, Any, Any]:
        """Return x_d, x_d', x_d'' at a time, a number or the symbol."""
        if self.still:
            zero = np.zeros(self.positions.coefficients.shape[2])
            return self.positions(t), zero, zero
        return tuple(signal(t) for signal in self.signals)  # pyright: ignore[reportReturnType]


def target(goal: Goal, names: Names) -> DesiredMotion:
    """Return what a goal asks of the actuated joints.

    Args:
        goal: a `State`, a `Motion`, coordinates by name [m, rad], or a signal of the actuated
            coordinates in their order.
        names: of the robot.

    Raises:
        LinkworkError: actuators without a coordinate of their own, missing coordinates, signals of
            another width.
    """
    for name in names.actuators:
        if name not in names.coordinates:
            raise LinkworkError(
                f"the actuator {name!r} has no coordinate of its own to follow; write a controller"
            )
    # A signal of all actuators.
    if isinstance(goal, Sampled | Signal):
        signal = as_signal(goal)
        width, count = signal.coefficients.shape[2], len(names.actuators)
        if width != count:
            raise LinkworkError(
                f"the goal has {checks.amount(width, 'column')}; give {count}: "
                f"{', '.join(names.actuators)}"
            )
        checks.in_order(goal, names.actuators, "the coordinates of the goal")
        return DesiredMotion(signal)
    # A motion, read off its states.
    if hasattr(goal, "time") and hasattr(goal, "state"):
        columns = [goal.state[name] for name in names.actuators]  # pyright: ignore
        led = Sampled(goal.time, np.stack(columns, axis=-1))  # pyright: ignore
        return DesiredMotion(as_signal(led))
    # One place: a state, or coordinates by name.
    if isinstance(goal, Mapping) and (
        lacking := [name for name in names.actuators if name not in goal]
    ):
        raise LinkworkError(
            f"the goal lacks {', '.join(lacking)}; give all of {', '.join(names.actuators)}"
        )
    try:
        values = [
            checks.number(goal[name], f"{name} of the goal")  # pyright: ignore
            for name in names.actuators
        ]
    except (TypeError, AttributeError, IndexError):
        raise LinkworkError(
            f"the goal is {goal!r}; give a state, a motion, coordinates by name, or a signal of "
            f"{', '.join(names.actuators)}"
        ) from None
    return DesiredMotion(as_signal(values))
