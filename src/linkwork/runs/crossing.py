"""Crossing: one large step over a singular pose where the equations of motion fail but the motion
is smooth.

The pose lies ahead at the time t_0 where the chart's weakest pivot vanishes like (t_0 - t)^m.
Gauss's collocation with an even number s of nodes c_i over an interval h with t_0 in its middle
never evaluates there:

    Y_i = y + h sum_j a_ij f(t + c_j h, Y_j),  y_new = y + h sum_j b_j f(t + c_j h, Y_j),  order 2 s

by fixed-point iteration, the loops of every Y_i closed by Newton's method from the polynomial's own
q, so that all lie on one branch: the smooth one. Two numbers of nodes estimate the error, the finer
one going out from the polynomial of the coarser one; where the branch is not smooth they disagree,
and there is no crossing. What is asked for on the way over is the polynomial through its values at
the nodes and both ends, where all is regular: of the state it is the collocation's own.
Source: Hairer, Norsett & Wanner, Solving ODE I, sec. II.7 (collocation).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import Polynomial

from linkwork.equations.equations import smallest_singular
from linkwork.kernels import Kernel
from linkwork.kernels.bound import BoundFunction
from linkwork.model.charts import CompiledChart
from linkwork.model.closing import settled_one
from linkwork.runs.system import System
from linkwork.simulation import Status, Trajectory
from linkwork.simulation.turns import whole

NODES = (6, 8)
CONVERGED = 1.0  # change of the step by an iteration, in tolerances
ACCURATE = 10.0  # error of the step, in tolerances
FINEST = 1e-9  # relative tolerance that rounding near the pose allows
BEHIND = 0.25  # least pivot behind the pose, relative to the one before it
VANISHED = 1e-3  # of a pivot at a singular pose, over its largest value on the way
NEWTON = 8
ROUNDING = np.finfo(float).eps  # gap of loops, in own units, that doubles need not make smaller


@dataclass(frozen=True, eq=False)
class Crossed:
    """Hold what is known of a crossing at its K nodes, the start and the end among them: all of
    them are regular.

    t: their times (K,) [s]; y: states (q, v, z) there (K, n); u: inputs (K, nu); pivots: of the
        chart's blocks (K, blocks)
    evaluations: of the equations of motion that it took; chart: that it was made in
    """

    t: np.ndarray
    y: np.ndarray
    u: np.ndarray
    pivots: np.ndarray
    evaluations: int
    chart: CompiledChart

    def weights(self, t: np.ndarray) -> np.ndarray:
        """Return what of each node counts at times t (S, K)."""
        return lagrange(*((times - self.t[0]) / (self.t[-1] - self.t[0]) for times in (self.t, t)))

    def through(self, values: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return at times t (S, ...) what has the given values (K, ...) at the nodes."""
        return np.tensordot(self.weights(t), values, axes=1)

    def zeros(self, values: np.ndarray) -> list[tuple[float, bool]]:
        """Return when a quantity passes zero [s], and whether it rises; its values (K,) at the
        nodes tell between which."""
        found, polynomial = [], Polynomial.fit(self.t, values, self.t.size - 1)
        for k in np.flatnonzero(
            (values[:-1] * values[1:] < 0) | ((values[1:] == 0) & (values[:-1] != 0))
        ):
            low, high = self.t[k], self.t[k + 1]
            while low < (middle := (low + high) / 2) < high:
                low, high = (middle, high) if polynomial(middle) * values[k] > 0 else (low, middle)
            found.append((float(high), bool(values[k] < 0)))
        return found

    @cached_property
    def singular(self) -> float | None:
        """When rank is lost [s], the weakest pivot vanishes, changing its sign or not; None where
        that is not on the way."""
        values = self.pivots[:, int(np.argmin(np.abs(self.pivots).min(axis=0)))]
        polynomial = Polynomial.fit(self.t, values, self.t.size - 1)
        roots = np.concatenate([polynomial.roots(), polynomial.deriv().roots()]).real
        roots = roots[(self.t[0] <= roots) & (roots <= self.t[-1])]
        if not roots.size or np.abs(polynomial(roots)).min() > VANISHED * np.abs(values).max():
            return None
        pose = float(roots[np.argmin(np.abs(polynomial(roots)))])
        there, *nodes = self._least(
            np.concatenate([self.through(self.y, np.array([pose])), self.y])
        ).tolist()
        return pose if there <= VANISHED * max(nodes) else None

    def _least(self, y: np.ndarray) -> np.ndarray:
        """Return the least singular value of the constraints, over their sizes, at states
        (S, n)."""
        equations = self.chart.equations
        Phi = self.chart.constraint_jacobian(np.ascontiguousarray(y[:, : equations.nq]))
        return smallest_singular(equations.scaled(Phi), len(equations.chart.rows))


@dataclass(frozen=True, eq=False)
class Crossing:
    """Step over a singular pose in one chart of a system; closure: largest |phi|; atol, rtol: of
    the run.

    The rates v of a crossing are those of the chart, then the system's extra states.
    """

    chart: CompiledChart
    system: System
    closure: float
    atol: float
    rtol: float

    def over(self, t: float, q: np.ndarray, v: np.ndarray) -> Crossed | None:
        """Return the way to behind the pose ahead of (t, q, v), as far as before it; None where
        there is no smooth one."""
        y = np.concatenate([q, v])
        slope = self._slope(self.system.inputs(t), y)
        gap = self._time_to_zero(q, slope[: q.size])
        if gap is None:
            return None
        h = 2 * gap
        coarse = self._step(t, h, y, np.tile(slope, (NODES[0], 1)))
        fine = coarse and self._step(t, h, y, between(*NODES)[1] @ coarse.slopes)
        if coarse is None or fine is None:
            return None
        q_new, closed = self._closed(fine.states[-1, : q.size])
        behind = abs(self.chart.pivot(q_new)) > BEHIND * abs(self.chart.pivot(q))
        if not (closed and behind and self._error(fine, coarse) <= ACCURATE):
            return None
        states = fine.states.copy()
        for state in states[1:]:
            state[: q.size], _ = self._closed(state[: q.size])
        times = t + h * nodes(NODES[1])
        pivots = self.chart.relative_pivots(np.ascontiguousarray(states[:, : q.size]))
        return Crossed(
            times,
            states,
            self.system.inputs(times),
            pivots,
            1 + fine.evaluations + coarse.evaluations,
            self.chart,
        )

    def _error(self, fine: Collocation, coarse: Collocation) -> float:
        """Return the difference of two collocations at the end and at all nodes of the finer one,
        in tolerances."""
        difference = fine.states - between(*NODES)[0] @ coarse.states
        return float((np.abs(difference) / self._tolerance(fine.states)).max())

    def nearby(self, crossed: Crossed, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the states y at times on the way (S, n), and their largest |phi| (S,).

        Loops are closed anew where that moves q by less than the tolerance: not near the pose,
        where they tell q no more.
        """
        states, nq = crossed.through(crossed.y, t), self.chart.equations.nq
        for state in states:
            q, _ = self._closed(state[:nq])
            if (np.abs(q - state[:nq]) <= self._tolerance(state)[:nq]).all():
                state[:nq] = q
        return states, np.array([self._residual(state[:nq]) for state in states])

    def recorded(
        self, crossed: Crossed, done: Trajectory, until: float, save_at: np.ndarray | None
    ) -> Trajectory:
        """Return a crossing, as far as the run goes, with what is saved and what happens on the
        way.

        done: what was integrated before it; until: the end of the run [s]; save_at: times to save
            [s], None for the crossing's end alone
        """
        # The run goes as far as its end, or the first event that ends it.
        happened = [
            (time, number) for time, number in sorted(self._events(crossed)) if time <= until
        ]
        ends = [self.system.events[event].terminal for _, event in happened]
        last = ends.index(True) if True in ends else None
        end = min(float(crossed.t[-1]), until) if last is None else happened[last][0]
        events = happened if last is None else happened[: last + 1]
        # States at the times to save, at events, and at the end, where it is the crossing's own.
        asked = np.array([end]) if save_at is None else save_at
        asked = asked[(asked > crossed.t[0]) & (asked <= end)]
        times = np.array([*asked, *(time for time, _ in events), end])
        states, residuals = self.nearby(crossed, times)
        kinds = np.array([*np.full(asked.size, -1), *(event for _, event in events), -1], float)
        if end == crossed.t[-1]:
            states[-1], residuals[-1] = crossed.y[-1], 0.0
        rows = np.column_stack([times, states, self.system.inputs(times), residuals, kinds])
        # The crossing counts as one step.
        weakest = np.abs(crossed.pivots).min(axis=1)
        status = Status.FINISHED if last is None else Status.EVENT
        outcome = done.outcome._replace(
            status=float(status),
            evaluations=float(crossed.evaluations),
            accepted=1.0,
            rejected=0.0,
            projections=0.0,
            time=float(end),
            step=0.0,
            pivot=float(weakest.min()),
            pivot_time=float(crossed.t[weakest.argmin()]),
            closure_error=float(residuals.max()),
        )
        # Rows of the run, without those of its events and its end.
        y_end, q = states[-1].copy(), slice(1, 1 + done.nq)
        rows[:, q] = whole(rows[:, q], done.turns)
        saved, found = rows[: asked.size], rows[asked.size : -1]
        return replace(
            done, rows=saved, found=found, y_end=y_end, outcome=outcome, control=None, status=status
        )

    def _events(self, crossed: Crossed) -> Iterator[tuple[float, int]]:
        """Yield when events happen on the way over a pose, and their numbers."""
        system, chart = self.system, self.chart
        if not system.events:
            return
        kernel, p = system.single(chart, "events"), system.p(chart)
        values = [
            kernel.flat(np.concatenate([y, u, p]))
            for y, u in zip(crossed.y, crossed.u, strict=True)
        ]
        for number, (event, of) in enumerate(zip(system.events, np.transpose(values), strict=True)):
            for time, rises in crossed.zeros(of):
                if event.direction >= 0 if rises else event.direction <= 0:
                    yield time, number

    def _time_to_zero(self, q: np.ndarray, slope: np.ndarray) -> float | None:
        """Return the time until the pivot p vanishes: m p / |p'| with m = 1 / (1 - p p'' / p'^2);
        slope: q'."""
        units = self.chart.equations.tree.units
        h = 1e-3 * max(1.0, np.abs(q / units).max()) / max(np.abs(slope / units).max(), 1e-3)
        p_0, p_1, p_2 = (abs(self.chart.pivot(q - k * h * slope)) for k in range(3))
        rate, curvature = (3 * p_0 - 4 * p_1 + p_2) / (2 * h), (p_0 - 2 * p_1 + p_2) / h**2
        if not rate < 0:
            return None
        multiplicity = 1 / max(1 - p_0 * curvature / rate**2, 0.1)
        return max(1, round(multiplicity)) * p_0 / -rate

    def _step(self, t: float, h: float, y: np.ndarray, slopes: np.ndarray) -> Collocation | None:
        """Return y along a step by collocation; None where the iteration does not converge.

        slopes: y' at the nodes (s, n) that the iteration goes out from.
        """
        a, b, c = gauss(len(slopes))
        inputs = self.system.inputs(t + h * c)
        change, evaluations, scale = np.inf, 0, self._tolerance(y)
        while True:
            evaluations += len(slopes)
            stages = y + h * a @ slopes
            previous = slopes
            slopes = np.array([self._slope(u, Y) for u, Y in zip(inputs, stages, strict=True)])
            last, change = change, float((np.abs(slopes - previous).max(axis=0) * h / scale).max())
            if change <= CONVERGED:
                return Collocation(
                    np.array([y, *(y + h * a @ slopes), y + h * b @ slopes]), slopes, evaluations
                )
            if not change < last / 2:
                return None

    def _tolerance(self, y: np.ndarray) -> np.ndarray:
        """Return the error that each number of y may have; a number small in its own unit counts as
        1 of it."""
        units = self.chart.tolerances(1.0, 1.0, y.shape[-1])[1]
        return self.atol * units + max(self.rtol, FINEST) * np.maximum(units, np.abs(y))

    def _slope(self, u: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y' = (q', v') under the inputs u, with the loops of q closed."""
        nq = self.chart.equations.nq
        q, _ = self._closed(y[:nq])
        return self._motion.flat(q, y[nq:], u, self.system.p(self.chart))[:-1]

    @cached_property
    def _motion(self) -> Kernel | BoundFunction:
        return self.system.single(self.chart, "motion")

    @cached_property
    def _closure(self) -> Kernel | BoundFunction | None:
        """Return what evaluates q -> one Newton step, largest |phi|; None where there is nothing to
        close."""
        return self.chart.single("closure_step") if self.chart.equations.constrained else None

    def _closed(self, q: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return q with its loops closed by Newton's method to rounding, and whether they are
        closed."""
        if self._closure is None:
            return q, True
        q, residual = settled_one(self._closure, q, self.chart.p, ROUNDING, NEWTON)
        return q, bool(residual <= self.closure)

    def _residual(self, q: np.ndarray) -> float:
        """Return the largest |phi(q)|."""
        return 0.0 if self._closure is None else self._closure.flat(q, self.chart.p).item(-1)


@dataclass(frozen=True, eq=False)
class Collocation:
    """Hold a step by collocation: states (s + 2, n) at c = 0, its s nodes and 1, slopes (s, n) at
    the nodes, evaluations."""

    states: np.ndarray
    slopes: np.ndarray
    evaluations: int


def lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return Lagrange's polynomials of the nodes (K,) at other places (S, K): what of each node
    counts at each place."""
    own = np.eye(nodes.size, dtype=bool)
    above = np.where(own, 1.0, (at[:, None] - nodes)[:, None, :]).prod(axis=2)
    return above / np.where(own, 1.0, nodes[:, None] - nodes).prod(axis=1)


@cache
def gauss(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a, b, c of Gauss's collocation: c the roots of Legendre's polynomial on [0, 1], order
    2 stages."""
    c = (np.polynomial.legendre.leggauss(stages)[0] + 1) / 2
    k = np.arange(1, stages + 1)
    inverse = np.linalg.inv(np.vander(c, increasing=True))
    a = (c[:, None] ** k / k) @ inverse
    b = (1 / k) @ inverse
    return a, b, c


@cache
def between(known: int, wanted: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what leads from a collocation's states, and from its slopes, to those at the nodes of
    another one."""
    own, other = nodes(known), nodes(wanted)
    return lagrange(own, other), lagrange(own[1:-1], other[1:-1])


def nodes(stages: int) -> np.ndarray:
    """Return 0, the nodes of Gauss's collocation, and 1."""
    return np.array([0.0, *gauss(stages)[2], 1.0])
