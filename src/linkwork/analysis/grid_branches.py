"""Branches of a grid of poses: which solutions of neighbours lie on one working mode.

Where actuated joints share a stage of the inverse problem its determinant's sign is that of a
product: two legs turned over leave it as it is. There solutions count that are reached from the
guess from neighbour to neighbour without a leap, as

    |q_2 - q_1 - T| <= |T| + a little,    T = (K_1 + K_2) (x_2 - x_1) / 2

holds for each actuator along a branch, whose rates are q' = K x' (trapezoidal rule). Near a
stretched leg, where q is as a square root, T is larger than the difference; from one branch to
another their signs differ, or T is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.analysis._jacobians import Jacobians
from linkwork.analysis.newton import Solver
from linkwork.equations.algebra import wrapped

LITTLE = 0.1  # rad, or own lengths
PARTS = 8  # of the way between two poses that is gone with care
STEPS = 10  # of Newton's method from a neighbour


def coupled(J: Jacobians) -> bool:
    """Tell whether a stage of the inverse problem has several actuated joints."""
    rates = J.robot.equations.tree.rates
    places = {rates.index(name) for name in J.direct.what if name in rates}
    return any(len(places & {*stage.columns}) > 1 for stage in J.inverse.chart.stages)


def actuated(J: Jacobians, q: np.ndarray) -> np.ndarray:
    """Return the actuated coordinates (N, n), angles within half a turn of those at home."""
    robot = J.robot
    places = [robot.coordinates.index(name) for name in J.direct.what]
    values, home = robot.kernel("positions")(q)[0][:, places], robot.home.positions[places]
    return np.where(robot.labels.angular[places], home + wrapped(values - home), values)


@dataclass(frozen=True, eq=False)
class GridBranch:
    """Tell leaps between branches; mode: signs of the determinants."""

    J: Jacobians
    problem: Solver
    mode: np.ndarray

    @cached_property
    def angular(self) -> np.ndarray:
        """Which actuated coordinates are angles (n)."""
        robot = self.J.robot
        return robot.labels.angular[[robot.coordinates.index(name) for name in self.J.direct.what]]

    def differences(self, q_1: np.ndarray, q_2: np.ndarray) -> np.ndarray:
        """Return how far actuated coordinates are apart (N, n), angles the short way round."""
        apart = actuated(self.J, q_2) - actuated(self.J, q_1)
        return np.where(self.angular, wrapped(apart), apart)

    def leaps(self, q_1: np.ndarray, q_2: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Tell of neighbours (N, nq) with poses apart by steps (N, n) whether they lie on different
        branches (N)."""
        told = ((self.J(q_1)[0] + self.J(q_2)[0]) @ step[..., None])[..., 0] / 2
        little = LITTLE * np.where(self.angular, 1.0, self.J.robot.equations.tree.length)
        off = np.abs(self.differences(q_1, q_2) - told)
        return np.any(~(off <= np.abs(told) + little), axis=1)

    def own(
        self,
        shape: tuple[int, ...],
        q: np.ndarray,
        good: np.ndarray,
        poses: np.ndarray,
        start: np.ndarray,
    ) -> np.ndarray:
        """Return which of the solved poses (N) hang together, without leaps, with the one whose
        actuated coordinates are nearest to those of a start."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        if not good.any():
            return good
        index, pairs = np.arange(good.size).reshape(shape), []
        for axis in range(len(shape)):
            one, two = (np.take(index, part, axis).ravel() for part in parts_of(shape[axis]))
            both = good[one] & good[two]
            pairs.append(np.stack([one[both], two[both]]))
        one, two = np.concatenate([*pairs, np.zeros((2, 0), int)], axis=1)
        if one.size:
            whole = ~self.leaps(q[one], q[two], poses[two] - poses[one])
            one, two = one[whole], two[whole]
        graph = coo_array((np.ones(one.size), (one, two)), (good.size, good.size))
        _, labels = connected_components(graph, directed=False)
        solved = np.flatnonzero(good)
        away = self.differences(np.broadcast_to(start, q[solved].shape), q[solved])
        nearest = solved[int(np.argmin((away**2).sum(axis=1)))]
        return good & (labels == labels[nearest])

    def advanced(
        self, q: np.ndarray, begin: np.ndarray, end: np.ndarray, parts: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return configurations (N, nq) at poses that are gone to from others, in parts of the way,
        and which of them are reached without a leap (N)."""
        step, sure = (end - begin) / parts, np.ones(len(q), bool)
        for k in range(1, parts + 1):
            following, solved = self.problem.solve(q, begin + k * step, STEPS, self.mode)
            solved &= sure
            solved[solved] = ~self.leaps(q[solved], following[solved], step[solved])
            q, sure = following, solved
        return q, sure


def parts_of(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of neighbours along an axis."""
    places = np.arange(count)
    return places[:-1], places[1:]
