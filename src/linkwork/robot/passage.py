"""Passage: lead a run from chart to chart, and over singular poses where the motion itself is smooth.

A run is a chain of segments, each integrated in one chart. Where the chart's pivot falls below a soft bound the segment
ends; if another chart is well conditioned there the next segment uses it: q stays, the rates are re-read. If none is,
the configuration itself is nearly singular, and the run goes on in the same chart down to the hard bound, or, if asked,
steps over it (`crossing`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.robot import checks
from linkwork.robot.charts import CompiledChart
from linkwork.robot.crossing import Crossing
from linkwork.robot.system import System
from linkwork.simulation import Control, Rosenbrock, Status, Trajectory, integrate

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot

CLOSURE = 1e-13
SOFT = 0.05  # relative pivot at which a better chart is looked for
NOT_WORSE, BETTER = 0.5, 10.0  # factors in conditioning for which a chart is changed: at a regular configuration, else
REUSED = 0.2  # relative pivot from which a chart that was chosen elsewhere is used again
RECOVERED = 1.5  # pivot over the soft bound at which a lowered bound is raised again
SHORT = 1000  # shortest segments in a run's duration
LOWER = 0.25  # the soft bound falls by this factor while no better chart is found


@dataclass(frozen=True, eq=False)
class Segment:
    """Hold a part of a run that was integrated in one chart; start: time, q and (v, z) that it went out from."""

    chart: CompiledChart
    trajectory: Trajectory
    start: tuple[float, np.ndarray, np.ndarray]


@dataclass
class Passage:
    """Lead one run from a state to its end.

    system: what is integrated; start, end: times of the run [s]
    save_at: times to save or None for every step; step_over: whether singular poses are stepped over
    options: method, rtol, atol, max_step and max_steps of every segment
    """

    robot: Robot
    system: System
    start: float
    end: float
    save_at: np.ndarray | None
    step_over: bool
    options: Mapping[str, Any]

    def segments(
        self, chart: CompiledChart, q: np.ndarray, v: np.ndarray, z: np.ndarray, control: Control | None = None
    ) -> Iterator[Segment]:
        """Yield the segments of the run, one after the other.

        While the bound is lowered segments are short, so that it is raised again when the pivots have recovered.

        Args:
            chart: to start in.
            q, v, z: coordinates, independent rates of the chart, and extra states at the start.
            control: what a sampled controller holds at the start; zeros if left out.
        """
        t, bound, steps = self.start, SOFT, self.options["max_steps"]
        shortest = (self.end - self.start) / SHORT
        short, n = shortest, v.size
        chart, v = self._faced(chart, q), np.concatenate([v, z])
        control = self.system.control(chart, control)
        while True:
            end = self.end if bound == SOFT else min(t + short, self.end)
            trajectory = self._integrate(chart, q, v, t, end, bound, steps, control)
            yield Segment(chart, trajectory, (t, q, v))
            control = trajectory.control
            steps -= trajectory.steps + trajectory.rejected
            t, q, v = trajectory.end_time, trajectory.q_end, trajectory.v_end
            if trajectory.status is Status.FINISHED and end < self.end:
                recovered = chart.pivot(q) > RECOVERED * SOFT
                bound, short = (SOFT, shortest) if recovered else (bound, 2 * short)
                continue
            if trajectory.status is not Status.SINGULAR or steps < 1:
                return
            Phi = chart.constraint_jacobian(q)
            regular = chart.equations.regular(Phi)
            landing = self._over(chart, t, q, v) if self.step_over and not regular else None
            better = self._better(chart, q, Phi, regular) if landing is None else None
            if better is not None:
                v = np.concatenate([better.from_tree(chart.tree_rates(q, v[:n])), v[n:]])
                chart, bound, control = better, SOFT, self.system.control(better, control)
                continue
            if self.step_over and regular:
                landing = self._over(chart, t, q, v)
            if landing is not None:
                short, (t, q, v) = landing[0] - t, landing
                chart = self._faced(chart, q)
                control = self.system.control(chart, control)
                bound = min(SOFT, 0.5 * chart.pivot(q))
            elif bound > checks.PIVOT_BOUND:
                bound = max(checks.PIVOT_BOUND, LOWER * min(bound, chart.pivot(q)))
            else:
                return
            if not t < self.end:
                return

    def _integrate(
        self,
        chart: CompiledChart,
        q: np.ndarray,
        v: np.ndarray,
        t: float,
        end: float,
        bound: float,
        steps: int,
        control: Control | None,
    ) -> Trajectory:
        save_at, options, first = self.save_at, {**self.options, "max_steps": steps}, t == self.start
        if save_at is not None and not (first and end == self.end):
            save_at = save_at[(save_at >= t) & ((save_at <= end) | (end == self.end))]
        if not first:
            options.pop("first_step", None)
        return integrate(
            self.system.kernel(chart, "motion").address,
            chart.kernel("closure_step").address if chart.equations.constrained else None,
            q,
            v,
            self.system.inputs,
            self.system.p(chart),
            duration=end - t,
            start=t,
            save_at=save_at,
            closure_tol=CLOSURE * self.robot.size,
            pivot_bound=bound,
            jacobian=self.system.kernel(chart, "jacobian").address if self.stiff else None,
            events=self.system.conditions(chart),
            control=control,
            **options,
        )

    @property
    def stiff(self) -> bool:
        """Whether the method needs the Jacobian."""
        return isinstance(self.options.get("method"), Rosenbrock)

    def _better(self, chart: CompiledChart, q: np.ndarray, Phi: np.ndarray, regular: bool) -> CompiledChart | None:
        """Return a chart that is better at q: any other one where q is regular, else one of much better conditioning."""
        robot = self.robot
        candidate = chart.better(q, tuple(robot.equations.tree.rates.index(name) for name in robot.independent))
        needed = NOT_WORSE if regular else BETTER
        if candidate.key == chart.key or candidate.conditioning(Phi) < needed * chart.conditioning(Phi):
            return None
        known = robot.run_charts.get(candidate.key)
        if known is not None and known.pivot(q) > REUSED:
            return known
        robot.run_charts[candidate.key] = candidate
        return candidate

    def _faced(self, chart: CompiledChart, q: np.ndarray) -> CompiledChart:
        """Return a chart with its pivots positive at q."""
        if chart.pivot(q) > 0:
            return chart
        faced = chart.facing(q)
        return self.robot.run_charts.setdefault(faced.key, faced)

    def _over(
        self, chart: CompiledChart, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Return time, q and (v, z) behind the singular pose ahead, or None."""
        if self.system.sampler:
            return None
        tolerance = self.options["atol"], self.options["rtol"]
        return Crossing(chart, self.system, CLOSURE * self.robot.size, *tolerance).over(t, self.end, q, v)
