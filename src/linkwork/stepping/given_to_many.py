"""What is given to steppers of many robots, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import reals, shown
from linkwork.control.events import Event
from linkwork.control.tracing import Law
from linkwork.errors import LinkworkError
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.model.model import Model

Index = int | slice | Sequence[int] | np.ndarray


def require_states(robot: Model, state: State, size: int) -> State:
    """Return states, one or as many as are asked for; refuse others."""
    if robot.own(state, alike=not robot.parameters).batch not in ((), (size,)):
        raise LinkworkError(
            f"the states are a stack of the shape {state.batch}; give one, or {size}"
        )
    return state


def forces_given(u: ArrayLike, names: Sequence[str], N: int) -> np.ndarray:
    """Return forces of all members, (N, actuators) or (actuators), or refuse them."""
    given = reals(u)
    if given is None or given.shape not in ((N, len(names)), (len(names),)):
        what = shown(u) if given is None else f"of shape {given.shape}"
        raise LinkworkError(
            f"forces are {what}; give ({N}, {len(names)}) numbers, a row for each robot, or "
            f"{len(names)} for all: {', '.join(names)}"
        )
    return given


def which_of(index: Index | None, N: int, repeated: bool = False) -> np.ndarray:
    """Return the numbers of members (M,); repeated: whether one may be named several times."""
    if isinstance(index, np.ndarray) and index.dtype == bool and index.shape == (N,):
        return np.flatnonzero(index)
    every = np.arange(N)
    try:
        found = every if index is None else np.ascontiguousarray(np.atleast_1d(every[index]))
    except (IndexError, TypeError, ValueError):
        found = None
    if found is None or found.ndim != 1 or not (repeated or different(found)):
        raise LinkworkError(
            f"index {shown(index)} does not fit {N} robots; give a number, a slice, "
            f"{'' if repeated else 'different '}numbers, or a mask"
        )
    return found


def different(numbers: np.ndarray) -> bool:
    """Tell whether no number occurs twice."""
    return bool((numbers[1:] > numbers[:-1]).all()) or np.unique(numbers).size == numbers.size


def as_events(readings: Sequence[Law]) -> tuple[Event, ...]:
    """Return functions of (t, state) that give a number each as what a system watches."""
    if callable(readings) or not isinstance(readings, Sequence):
        told = "a function" if callable(readings) else shown(readings)
        raise LinkworkError(f"readings are {told}; give a list of functions of (t, state)")
    return tuple(Event(each, name=f"reading {i}") for i, each in enumerate(readings))
