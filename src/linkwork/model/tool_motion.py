"""Tool motion: twist and acceleration of the tool at states, and the same in its task coordinates.

    x' = E t = J v,    J = E T,    x'' = E t' + E' t        t = [omega; v] = T v

Of a whole rotation vector x' and x'' are the angular velocity and acceleration (`equations.task`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.mechanism.task import label
from linkwork.model import checks
from linkwork.model.asked import task_kernel
from linkwork.model.evaluation import outputs, require_regular
from linkwork.model.state import State
from linkwork.model.task import Task

if TYPE_CHECKING:
    from linkwork.model.model import Model


STEEP = 1e8  # rate of a coordinate per that of the tool, from which it has none


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Hold how a tool moves at states (...).

    pose: (..., 13), as `equations.task.POSE` says; T: (..., 6, n); twist, acceleration: [omega; v]
    and [alpha; a] (..., 6)
    """

    pose: np.ndarray
    T: np.ndarray
    twist: np.ndarray
    acceleration: np.ndarray

    def led(self, task: Task) -> LedMotion:
        """Return the same in task coordinates."""
        _, E, bias = task_kernel(task)(self.pose, self.twist)
        E = np.swapaxes(E.reshape(*E.shape[:-1], 6, len(task)), -1, -2)
        wrong = ~(np.abs(E).max(axis=-1) < STEEP)
        if wrong.any():
            raise LinkworkError(
                f"the tool's {label(task[int(np.argwhere(wrong)[0][-1])])} has no rate at this "
                "pose; choose another coordinate there"
            )
        return LedMotion(
            E @ self.T,
            (E @ self.twist[..., None])[..., 0],
            (E @ self.acceleration[..., None])[..., 0] + bias,
        )


@dataclass(frozen=True, eq=False)
class LedMotion:
    """Hold J (..., k, n), x' and x'' (..., k) of task coordinates."""

    jacobian: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray


def tool_motion(robot: Model, state: State, accelerations: np.ndarray | None = None) -> ToolMotion:
    """Return how the first tool moves at states; accelerations: v' (..., n), zero if left out."""
    robot.require_tool()
    v = robot.own(state).rates
    v_dot = 0 * v if accelerations is None else accelerations
    checks.together(state.batch, v_dot.shape[:-1])
    pose, T, twist, acceleration, pivot = outputs(robot, "tool_motion", state, v, v_dot)
    require_regular(robot, state, pivot, acceleration, v_dot, "accelerations")
    T = np.swapaxes(T.reshape(*T.shape[:-1], len(state.independent), 6), -1, -2)
    return ToolMotion(pose, T, twist, acceleration)
