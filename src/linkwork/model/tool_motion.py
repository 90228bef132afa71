"""Tool motion: twist and acceleration of the tool at states, and the same in its task coordinates.

    x' = E t = J v,    J = E T,    x'' = E t' + E' t        t = [omega; v] = T v

Of a whole rotation vector x' and x'' are the angular velocity and acceleration (`equations.task`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.mechanism.task import label
from linkwork.model.asked import task_kernel
from linkwork.model.evaluation import told
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


def tool_motion(
    robot: Model,
    state: State,
    accelerations: ArrayLike | Mapping[str, ArrayLike] | None = None,
) -> ToolMotion:
    """Return how the first tool moves at states; accelerations: v' (..., n), zero if left out."""
    robot.require_tool()
    v_dot = 0 * robot.own(state).rates if accelerations is None else accelerations
    return ToolMotion(*told(robot, "tool_motion", state, v_dot))
