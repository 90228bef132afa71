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
        x, kernel = (self.pose, self.twist), task_kernel(task)
        if self.pose.ndim == 1:
            found, k = kernel.flat(*x), len(task)
            E, bias = found[k : 7 * k], found[7 * k :]
        else:
            _, E, bias = kernel(*x)
        if not np.abs(E).max(initial=0.0) < STEEP:
            steep = ~(np.abs(E.reshape(-1, len(task))).max(axis=0) < STEEP)
            raise LinkworkError(
                f"the tool's {label(task[int(np.argmax(steep))])} has no rate at this pose; choose "
                "another coordinate there"
            )
        E = np.swapaxes(E.reshape(*E.shape[:-1], 6, len(task)), -1, -2)
        return LedMotion(E, bias, self)


@dataclass(frozen=True, eq=False)
class LedMotion:
    """Hold how the tool of a motion moves in task coordinates: E (..., k, 6), and E' t (..., k)."""

    E: np.ndarray
    bias: np.ndarray
    tool: ToolMotion

    @property
    def jacobian(self) -> np.ndarray:
        """J (..., k, n)."""
        return self.E @ self.tool.T

    @property
    def rates(self) -> np.ndarray:
        """x' (..., k)."""
        return (self.E @ self.tool.twist[..., None])[..., 0]

    @property
    def accelerations(self) -> np.ndarray:
        """x'' (..., k)."""
        return (self.E @ self.tool.acceleration[..., None])[..., 0] + self.bias


def tool_motion(robot: Model, state: State, accelerations: np.ndarray | None = None) -> ToolMotion:
    """Return how the first tool moves at states; accelerations: v' (..., n), zero if left out."""
    robot.require_tool()
    v = robot.own(state).rates
    v_dot = 0 * v if accelerations is None else accelerations
    found, n = robot.directly("tool_motion", True).at(state, v_dot), len(state.independent)
    if found is not None:
        T, twist, acceleration = found[13:-12].reshape(n, 6).T, found[-12:-6], found[-6:]
        return ToolMotion(found[:13], T, twist, acceleration)
    checks.together(state.batch, v_dot.shape[:-1])
    pose, T, twist, acceleration, pivot = outputs(robot, "tool_motion", state, v, v_dot)
    require_regular(robot, state, pivot, acceleration, v_dot, "accelerations")
    T = np.swapaxes(T.reshape(*T.shape[:-1], n, 6), -1, -2)
    return ToolMotion(pose, T, twist, acceleration)
