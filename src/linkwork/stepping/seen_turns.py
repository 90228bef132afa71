"""Whole turns of joints that close loops, as steppers see them: where what acts reads such a
coordinate a state z tells its turns at every step (`control.continued`); else they are followed
from one asking to the next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.runs.system import System, followed_by

if TYPE_CHECKING:
    from linkwork.model.model import Model


def seen(
    robot: Model, system: System, read: np.ndarray, before: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Return coordinates of all joints (..., m) with their whole turns.

    read: off the tree's coordinates (..., m); before: when they were asked for last (..., m); z:
        the extra states now (..., nz)
    """
    followed = [state.name for state in system.states[len(system.extras) :]]
    if followed:
        before = before.copy()
        places = [robot.coordinates.index(name) for name in followed]
        before[..., places] = z[..., len(system.extras) :]
    return robot.labels.nearest(read, before)


def require_followed(robot: Model, system: System, state: State) -> None:
    """Refuse states (...) with whole turns that what acts reads and this system has no states for:
    they are made for the states with which a stepper is."""
    if system.acting is None:
        return
    needed = followed_by(robot, system.acting, state)
    missing = [name for names in needed for name in names if names not in system.acting.followed]
    if missing:
        raise LinkworkError(
            f"the state has whole turns of {', '.join(missing)}, which what acts reads, and the "
            "stepper was made with a state without; make a stepper of this state"
        )
