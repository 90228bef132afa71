"""Crossing: one large step over a singular pose where the equations of motion fail but the motion is smooth.

The pose lies ahead at the time t_0 where the chart's weakest pivot vanishes like (t_0 - t)^m. Gauss's collocation with an
even number s of nodes c_i over an interval h with t_0 in its middle never evaluates there:

    Y_i = y + h sum_j a_ij f(t + c_j h, Y_j),     y_new = y + h sum_j b_j f(t + c_j h, Y_j),     order 2 s

by fixed-point iteration, the loops of every Y_i closed by Newton's method from the polynomial's own q, so that all lie on
one branch: the smooth one. Two numbers of nodes estimate the error; where the branch is not smooth they disagree, and
there is no crossing.
Source: Hairer, Norsett & Wanner, Solving ODE I, sec. II.7 (collocation).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from linkwork.kernels import Kernel
from linkwork.robot.charts import CompiledChart
from linkwork.robot.system import System

NODES = (6, 4)
CONVERGED = 1.0  # change of the step by an iteration, in tolerances
ACCURATE = 10.0  # error of the step, in tolerances
FINEST = 1e-9  # relative tolerance that rounding near the pose allows
BEHIND = 0.25  # least pivot behind the pose, relative to the one before it
NEWTON = 8


@dataclass(frozen=True, eq=False)
class Crossing:
    """Step over a singular pose in one chart of a system; closure: largest |phi|; atol, rtol: of the run.

    The rates v of a crossing are those of the chart, then the system's extra states.
    """

    chart: CompiledChart
    system: System
    closure: float
    atol: float
    rtol: float

    def over(self, t: float, end: float, q: np.ndarray, v: np.ndarray) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Return time, q and v behind the pose ahead of (t, q, v), not after `end`; None where there is no smooth way."""
        gap = self._time_to_zero(t, q, v)
        if gap is None:
            return None
        h = min(2 * gap, end - t)
        y = np.concatenate([q, v])
        fine, coarse = (self._step(t, h, y, nodes) for nodes in NODES)
        if fine is None or coarse is None:
            return None
        error = np.abs(fine - coarse) / self._tolerance(fine)
        q_new, closed = self._closed(fine[: q.size])
        behind = abs(self.chart.pivot(q_new)) > BEHIND * abs(self.chart.pivot(q)) or t + h == end
        if not (closed and behind and error.max() <= ACCURATE):
            return None
        return t + h, q_new, fine[q.size :]

    def _time_to_zero(self, t: float, q: np.ndarray, v: np.ndarray) -> float | None:
        """Return the time until the pivot p vanishes: m p / |p'| with m = 1 / (1 - p p'' / p'^2)."""
        slope = self._slope(self.system.inputs(t), np.concatenate([q, v]))[: q.size]
        units = self.chart.equations.tree.units
        h = 1e-3 * max(1.0, np.abs(q / units).max()) / max(np.abs(slope / units).max(), 1e-3)
        p_0, p_1, p_2 = (abs(self.chart.pivot(q - k * h * slope)) for k in range(3))
        rate, curvature = (3 * p_0 - 4 * p_1 + p_2) / (2 * h), (p_0 - 2 * p_1 + p_2) / h**2
        if not rate < 0:
            return None
        multiplicity = 1 / max(1 - p_0 * curvature / rate**2, 0.1)
        return max(1, round(multiplicity)) * p_0 / -rate

    def _step(self, t: float, h: float, y: np.ndarray, nodes: int) -> np.ndarray | None:
        """Return y_new by collocation at a number of nodes; None where the iteration does not converge."""
        a, b, c = gauss(nodes)
        first, *inputs = self.system.inputs(t + h * np.array([0.0, *c]))
        slopes, change = np.tile(self._slope(first, y), (nodes, 1)), np.inf
        scale = self._tolerance(y)
        while True:
            stages = y + h * a @ slopes
            previous, slopes = slopes, np.array([self._slope(u, Y) for u, Y in zip(inputs, stages, strict=True)])
            last, change = change, float((np.abs(slopes - previous).max(axis=0) * h / scale).max())
            if change <= CONVERGED:
                return y + h * b @ slopes
            if not change < last / 2:
                return None

    def _tolerance(self, y: np.ndarray) -> np.ndarray:
        """Return the error that each number of y may have; a number small in its own unit counts as 1 of it."""
        units = self.chart.tolerances(1.0, y.size)
        return self.atol * units + max(self.rtol, FINEST) * np.maximum(units, np.abs(y))

    def _slope(self, u: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y' = (q', v') under the inputs u, with the loops of q closed."""
        nq = self.chart.equations.nq
        q, _ = self._closed(y[:nq])
        x = np.concatenate([q, y[nq:], u, self.system.p(self.chart)])
        return evaluated(self.system.kernel(self.chart, "motion"), x)[:-1]

    def _closed(self, q: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return q with its loops closed by Newton's method to the last digit, and whether they are closed."""
        if not self.chart.equations.constrained:
            return q, True
        best, residual = q, np.inf
        for _ in range(NEWTON):
            out = evaluated(self.chart.kernel("closure_step"), np.concatenate([q, self.chart.p]))
            if not (out[-1] < residual and np.isfinite(q).all()):
                break
            best, residual, q = q, out[-1], out[:-1]
        return best, residual <= self.closure


def evaluated(kernel: Kernel, x: np.ndarray) -> np.ndarray:
    """Return a kernel's outputs for one state."""
    return kernel.flat(x)


@cache
def gauss(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a, b, c of Gauss's collocation: c the roots of Legendre's polynomial on [0, 1], order 2 stages."""
    c = (np.polynomial.legendre.leggauss(stages)[0] + 1) / 2
    k = np.arange(1, stages + 1)
    inverse = np.linalg.inv(np.vander(c, increasing=True))
    a = (c[:, None] ** k / k) @ inverse
    b = (1 / k) @ inverse
    return a, b, c
