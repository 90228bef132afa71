"""Stage 5, use: robots that are stepped on by whoever calls, alone or many at a time."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from linkwork.checks import known
from linkwork.model.state import State
from linkwork.stepping.errors import StepError
from linkwork.stepping.long_steps import tell_long_step
from linkwork.stepping.stepper import Stepper

if TYPE_CHECKING:
    from linkwork.model.model import Model
    from linkwork.stepping.steppers import Steppers

__all__ = ["StepError", "Stepper", "Steppers", "made"]


def made(
    robot: Model, state: Any, dt: float, forces: Any, options: Mapping[str, Any]
) -> Stepper | Steppers:
    """Return a stepper, or steppers of a stack of states: see `Robot.stepper`.

    robot, state, dt, forces, options: as there, the last by name.
    """
    if not (isinstance(state, State) and state.batch):
        known(options, named(Stepper), "option of a stepper")
        one = Stepper(robot, state, dt, forces, **options)
        tell_long_step(one.dt, one.longest_step)
        return one
    from linkwork.stepping.steppers import Steppers

    known(options, named(Steppers), "option of steppers")
    many = Steppers(robot, state, dt, forces, **options)
    tell_long_step(many.dt, many.longest_step)
    return many


def named(kind: type) -> tuple[str, ...]:
    """Return the options that a class takes by name."""
    parameters = inspect.signature(kind).parameters.values()
    return tuple(each.name for each in parameters if each.kind is each.KEYWORD_ONLY)


def __getattr__(name: str) -> Any:
    """Import what compiles code of its own when it is first asked for."""
    if name != "Steppers":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from linkwork.stepping.steppers import Steppers

    return Steppers
