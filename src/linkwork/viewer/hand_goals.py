"""Goals of posing by hand: the tool at a pose, or joints at coordinates; each says how far off a
configuration is.

A goal's error e and its Jacobian J in the tree's rates are lengths: turns count times a length, so
that one metre and one such turn weigh the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import atan2, sqrt
from typing import Protocol

import numpy as np

from linkwork.equations.algebra import wrapped
from linkwork.mechanism.task import is_length
from linkwork.model.asked import ToolAsked

Outputs = Mapping[str, np.ndarray]
ASTRAY = 0.1  # how far a hand leads where nothing follows until that is said, relative to a turn


class HandGoal(Protocol):
    """Measure how far configurations are from what is wanted, by the outputs of
    `functions.assembly`."""

    @property
    def strict(self) -> bool:
        """Tell whether a goal that cannot be reached is given up, instead of reached as nearly as
        possible."""
        ...

    def rows(self, out: Outputs) -> tuple[np.ndarray, np.ndarray]:
        """Return the error e (k) [m] and its Jacobian (k, nv)."""
        ...

    def towards(self, out: Outputs, part: float) -> HandGoal:
        """Return the goal that lies on the way from a configuration to this one, at a part of it
        from 0 to 1."""
        ...

    def unled(self, out: Outputs) -> str:
        """Say that a hand leads to where nothing follows, if it does."""
        ...


@dataclass(frozen=True, eq=False)
class ToolGoal:
    """Want the tool at a position (3) [m] and, where `turns`, in an orientation R (3, 3), in the
    ground's axes.

    length: what a turn of 1 rad counts as [m]; planar: whether only x, y and the angle count
    task: the task coordinates that count alone, where the tool is led in other ones
    """

    position: np.ndarray
    orientation: np.ndarray
    length: float
    turns: bool
    planar: bool
    task: ToolAsked | None = None
    strict: bool = False

    def rows(self, out: Outputs) -> tuple[np.ndarray, np.ndarray]:
        """Return e = (p - p_0, l * rotation vector of R R_0') and the tool's Jacobian, turns times
        l; in a task e = x - x_0 and its Jacobian, likewise."""
        if self.task is not None:
            return self._task_rows(self.task, out)
        J, axes = out["J_tool"], (2 if self.planar else 3)
        error, rows = [(out["position"] - self.position)[:axes]], [J[3 : 3 + axes]]
        if self.turns:
            turn = rotation_vector(out["orientation"].reshape(3, 3) @ self.orientation.T)
            angular = slice(2, 3) if self.planar else slice(0, 3)
            error.append(self.length * turn[angular])
            rows.append(self.length * J[:3][angular])
        return np.concatenate(error), np.concatenate(rows)

    def towards(self, out: Outputs, part: float) -> ToolGoal:
        R = out["orientation"].reshape(3, 3)
        way = part * rotation_vector(self.orientation @ R.T)
        position = out["position"] + part * (self.position - out["position"])
        there = position, rotation_matrix(way) @ R
        return ToolGoal(*there, self.length, self.turns, self.planar, self.task)

    def unled(self, out: Outputs) -> str:
        """Say which coordinates the tool is led in while a hand leads it in others."""
        if self.task is None:
            return ""
        apart, led = replace(self, task=None).rows(out)[0], self.rows(out)[0]
        far = float(np.linalg.norm(apart)) > ASTRAY * self.length + float(np.linalg.norm(led))
        return f"the tool is led in {', '.join(self.task.labels)} alone" if far else ""

    def _task_rows(self, task: ToolAsked, out: Outputs) -> tuple[np.ndarray, np.ndarray]:
        wanted = {
            "position": self.position[None],
            "orientation": self.orientation.reshape(1, 9),
            "angle": np.arctan2(self.orientation[1:2, :1], self.orientation[:1, :1]),
        }
        here = {name: out[name][None] for name in ("position", "orientation", "angle", "J_tool")}
        scale = np.array([1.0 if is_length(item) else self.length for item in task.held])
        error = task.error(here, task.values(wanted))[0]
        return scale * error, scale[:, None] * task.jacobian(here)[0]


@dataclass(frozen=True, eq=False)
class JointGoal:
    """Want joint coordinates at values [m, rad].

    coordinates, rates: their indices among those of all joints; values; angular: which are angles;
    length: what an angle of 1 rad counts as [m]
    """

    coordinates: np.ndarray
    rates: np.ndarray
    values: np.ndarray
    angular: np.ndarray
    length: float
    strict: bool = True

    @property
    def scale(self) -> np.ndarray:
        return np.where(self.angular, self.length, 1.0)

    def rows(self, out: Outputs) -> tuple[np.ndarray, np.ndarray]:
        """Return e = l (q_i - value) and the rows of these joints' rates; angles are measured the
        short way round."""
        scale = self.scale
        return scale * self.off(out), scale[:, None] * out["J_coordinates"][self.rates]

    def off(self, out: Outputs) -> np.ndarray:
        error = out["coordinates"][self.coordinates] - self.values
        return np.where(self.angular, wrapped(error), error)

    def towards(self, out: Outputs, part: float) -> JointGoal:
        values = self.values + (1 - part) * self.off(out)
        return JointGoal(self.coordinates, self.rates, values, self.angular, self.length)

    def unled(self, out: Outputs) -> str:
        return ""


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """Return axis times angle [rad] of a rotation matrix, the short way round."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    twice_sine = np.array([zy - yz, xz - zx, yx - xy])
    sine, cosine = sqrt(twice_sine @ twice_sine) / 2, (xx + yy + zz - 1) / 2
    if sine > 1e-6 or cosine > 0:
        return twice_sine / 2 * (atan2(sine, cosine) / sine if sine > 1e-12 else 1.0)
    axis = np.linalg.eigh(R + R.T)[1][:, -1]  # half a turn: R + R' = 2 (2 a a' - 1)
    return np.pi * axis


def rotation_matrix(r: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a rotation vector [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(r).as_matrix()
