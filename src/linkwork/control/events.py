"""Events: zeros of functions of (t, state) along a run, found on its dense output; ready ones for limits and singular poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from linkwork import math
from linkwork.control.tracing import Law
from linkwork.errors import LinkworkError
from linkwork.mechanism.limits import limited


@dataclass(frozen=True, eq=False)
class Event:
    """Watch for zeros of a traced function.

    function: (t, state) -> a number that passes zero when the event happens; it is traced as controllers are
    terminal: whether the run ends there; direction: 1 for zeros passed upwards only, -1 for downwards, 0 for both
    name: to report it by
    """

    function: Law
    terminal: bool = False
    direction: Literal[-1, 0, 1] = 0
    name: str = "event"

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise LinkworkError(f"the event {self.name!r} watches a function of (t, state), not {self.function!r}")
        if self.direction not in (-1, 0, 1):
            raise LinkworkError(f"the direction of the event {self.name!r} is {self.direction!r}; give -1, 0 or 1")


def limit_events(robot, terminal: bool = True) -> tuple[Event, ...]:
    """Return an event for each limit of a joint coordinate: it happens where the coordinate leaves its range.

    A free turn is limited by the angle between its joint's frames, 2 acos |qw|: its event is a zero of |qw| - cos(limit / 2).
    """
    events = []
    for label, limits, name in limited(robot.mechanism):
        free = name != label
        for bound, side in ((limits.lower, "lower"), (limits.upper, "upper")):
            if bound is not None:
                inside = within_turn(label, bound) if free else within(label, bound, 1 if side == "lower" else -1)
                events.append(Event(inside, terminal, -1, f"{name}: {side} limit"))
    return tuple(events)


def singular_events(robot, terminal: bool = True) -> tuple[Event, ...]:
    """Return the event of an actuator-singular pose: the determinant of S, actuated from independent rates, passes zero.

    A run changes its independent rates near such a pose, and passes it if its motion is regular there.
    """
    return (Event(lambda t, state: state.actuation_determinant, terminal, name="actuator-singular pose"),)


def within(label: str, bound: float, sign: int) -> Law:
    """Return how far a coordinate is inside of a bound [m, rad]."""
    return lambda t, state: sign * (state[label] - bound)


def within_turn(label: str, bound: float) -> Law:
    """Return how far a free turn is inside of its bound, in cosines of half the angle."""
    return lambda t, state: math.abs(state[label]) - math.cos(bound / 2)
