"""Goals: what a controller leads the actuated joints to: a fixed configuration, a motion, or
sampled coordinates.

x_d(t), x_d'(t), x_d''(t)  of a motion: one spline of its coordinates, and that spline's own
derivatives; where its samples are too few for that, by its own rates, this is warned of
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from linkwork import checks
from linkwork.control.observation import Names
from linkwork.control.plant import NamedCoordinates, TimedStates
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.simulation import Sampled, Signal, as_signal

FEW = 0.01
"""Of its largest rate, by which that of a spline may differ from a motion's own: it is then off by
some 0.2 % of the range."""

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
        warn_of_few(goal)
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


def warn_of_few(goal: Any) -> None:
    """Warn where the spline through a motion's samples has other rates there than the motion
    itself: between them it goes another way."""
    known = getattr(goal.state, "coordinates", ())
    named = enumerate(getattr(goal.state, "independent", ()))
    joints = [(k, name) for k, name in named if name in known]
    if not joints or len(goal.time) < 2:
        return
    # Of each joint, over the largest rate that it has; of one that hardly moves, over a part of
    # that of all.
    own = goal.state.rates[:, [k for k, _ in joints]]
    led = Sampled(goal.time, np.stack([goal.state[name] for _, name in joints], axis=-1))
    rates = as_signal(led).derivative()(goal.time)
    largest = np.abs([own, rates]).max(axis=(0, 1))
    off = np.abs(rates - own).max(axis=0) / np.maximum(largest, FEW * largest.max() or 1.0)
    if off.max() > FEW:
        warnings.warn(
            f"the {len(goal.time)} samples of the motion are few for the spline through them, "
            f"which is followed: its rates at the samples differ by {off.max():.2g} of the largest "
            "from the motion's own; give it more samples",
            ModelWarning,
            stacklevel=2,
        )
