"""What steppers admit: states, times, forces and arrays by which steps can be taken."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import shown
from linkwork.control.sampler import Sampler
from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.runs.system import GIVEN, Forces

if TYPE_CHECKING:
    from linkwork.model.model import Model

COUNTED = 2.0**53  # steps that doubles tell apart


def is_free(forces: Forces) -> bool:
    """Tell whether forces are numbers, for which others may be given step by step."""
    return not (callable(forces) or isinstance(forces, (Sampler, *GIVEN)))


def require_one(robot: Model, state: State) -> None:
    """Refuse what is no state, or a stack of them."""
    if robot.own(state).batch:
        raise LinkworkError(
            f"the states are a stack of the shape {state.batch}; a stepper takes one: "
            "state.at(index)"
        )


def require_counted(time: float, dt: float) -> float:
    """Return a time [s]; refuse one so late that numbers of steps are not held in full."""
    if abs(time) > COUNTED * dt:
        raise LinkworkError(
            f"time {time:g} s is more than 2^53 steps of {dt:g} s, which numbers of steps do not "
            "tell apart; give an earlier one"
        )
    return time


def require_room(out: np.ndarray, shape: tuple[int, ...]) -> None:
    """Refuse what states cannot be written to."""
    if not isinstance(out, np.ndarray) or out.shape != shape or out.dtype != float:
        told = f"{out.dtype} of shape {out.shape}" if isinstance(out, np.ndarray) else shown(out)
        raise LinkworkError(f"out is {told}; give an array of floats of shape {shape}")
    if not out.flags.writeable:
        raise LinkworkError("out cannot be written, it is read-only; give an array of its own")
