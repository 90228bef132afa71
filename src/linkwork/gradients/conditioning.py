"""Conditioning as runs record it (`linkwork.model.dexterity`), to be differentiated.

A quantity that is found from singular values is no expression; what it is found from is one. With
the motions L of the rates (in the mechanism's own units), A of the actuated rates and T of the task
along the independent ones, G = L' L, and scales D of the actuated rates and of the task,

    K = A G^-1 T' (T G^-1 T')^-1,    conditioning = s_k / s_1 of D_a K D_x^-1
    without a task: the smallest s of A in the metric G,  s^2 = min z' A' A z / z' G z,  at most 1

    ds_i = u_i' d(D_a K D_x^-1) v_i,      2 s ds = z' (d(A' A) - s^2 dG) z,    z' G z = 1

which there is not where two of those values are equal: the derivative is nan there.
Source: Golub & Van Loan, Matrix Computations, 4th ed. (2013), sec. 8.6 (singular values).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.control.joined import Joined
from linkwork.equations.symmetric import solve_symmetric
from linkwork.equations.task import held_task, mapped_rows
from linkwork.model.dexterity import actuated, characteristic_length, scales
from linkwork.model.task import Task, freedoms, task_if_any

if TYPE_CHECKING:
    from linkwork.model.model import Model

EQUAL = 1e-9  # relative distance of two singular values that are one


@dataclass(frozen=True, eq=False)
class Conditioning:
    """Tell a robot's conditioning by what it is found from: `matrices`, in one column."""

    robot: Model

    @cached_property
    def task(self) -> Task:
        """The coordinates that it is told by, those that the task is held by; none where this has a
        single one at most."""
        robot = self.robot
        task = (task_if_any(robot) if robot.mechanism.tools else None) or ()
        return held_task(task) if len(task) > 1 else ()

    @cached_property
    def scales(self) -> tuple[np.ndarray, np.ndarray]:
        """D_x and D_a; without a task the units of the actuated rates."""
        robot = self.robot
        if self.task:
            return scales(robot, self.task, robot.once(characteristic_length, self.task))
        length = robot.equations.tree.length
        of_each = [length if robot.unit(name) == "m" else 1.0 for name in actuated(robot)]
        return np.ones(0), 1 / np.array(of_each)

    def __call__(self, joined: Joined) -> ca.SX:
        """Return D_a K D_x^-1, or A' A and G, column by column."""
        equations, (x, driven) = joined.equations, self.scales
        names = actuated(self.robot)
        L = equations.elimination.L / equations.tree.rate_units
        rows = equations.joints.rate_rows(names)
        if names == self.robot.independent:
            places = [equations.tree.rates.index(name) for name in names]
            rows = ca.SX.eye(equations.nv)[places, :]
        A, G = ca.mtimes([ca.diag(driven), rows, equations.elimination.L]), ca.mtimes(L.T, L)
        if not self.task:
            return ca.densify(ca.vertcat(ca.vec(ca.mtimes(A.T, A)), ca.vec(G)))
        _, J = mapped_rows(equations.tree, equations.mechanism.first_tool, self.task)
        T = ca.mtimes([ca.diag(x), J, equations.elimination.L])
        Y = solve_symmetric(G, T.T)
        K = ca.mtimes(A, solve_symmetric(ca.mtimes(T, Y), Y.T).T)
        return ca.densify(ca.vec(K))

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the derivative (S, rows) of the conditioning by its matrices (S, rows)."""
        found = np.full(values.shape, np.nan)
        known = np.isfinite(values).all(axis=1)
        found[known] = (self._of_task if self.task else self._of_motions)(values[known])
        return found

    def _of_task(self, values: np.ndarray) -> np.ndarray:
        k = len(self.task)
        K = np.swapaxes(values.reshape(len(values), k, -1), 1, 2)
        u, s, v = np.linalg.svd(K, full_matrices=False)
        largest, smallest = s[:, 0, None, None], s[:, k - 1, None, None]
        first, last = (u[:, :, i, None] * v[:, i, None, :] for i in (0, k - 1))
        found = (last - smallest / largest * first) / largest
        found[is_equal(s[:, 0], s[:, 1]) | is_equal(s[:, k - 1], s[:, k - 2])] = np.nan
        return np.swapaxes(found, 1, 2).reshape(values.shape)

    def _of_motions(self, values: np.ndarray) -> np.ndarray:
        n = freedoms(self.robot)
        B, G = np.moveaxis(values.reshape(len(values), 2, n, n), 1, 0)
        # s^2 z = R'^-1 B R^-1 z in the metric G = R' R.
        inverse = np.linalg.inv(np.linalg.cholesky(G))
        squares, turned = np.linalg.eigh(inverse @ B @ np.swapaxes(inverse, 1, 2))
        z = np.einsum("sij,si->sj", inverse, turned[:, :, 0])
        own = z[:, :, None] * z[:, None, :]
        s = np.sqrt(np.maximum(squares[:, 0], 0))
        found = np.stack([own, -squares[:, 0, None, None] * own], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found /= 2 * s[:, None, None, None]
        if n > 1:
            found[is_equal(squares[:, 0], squares[:, 1])] = np.nan
        found[s > 1] = 0.0
        return found.reshape(values.shape)


def is_equal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Tell which singular values are one but for rounding."""
    return np.abs(a - b) <= EQUAL * np.maximum(np.abs(a), np.abs(b))
