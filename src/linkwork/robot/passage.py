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
from linkwork.simulation import Signal, Status, Trajectory, integrate

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
    """Hold a part of a run that was integrated in one chart."""

    chart: CompiledChart
    trajectory: Trajectory


@dataclass
class Passage:
    """Lead one run from a state to its end.

    forces: u over time; save_at: times to save or None for every step; step_over: whether singular poses are stepped over
    options: rtol, atol, max_step and max_steps of every segment
    """

    robot: Robot
    forces: Signal
    duration: float
    save_at: np.ndarray | None
    step_over: bool
    options: Mapping[str, Any]

    def segments(self, chart: CompiledChart, q: np.ndarray, v: np.ndarray) -> Iterator[Segment]:
        """Yield the segments of the run, one after the other.

        While the bound is lowered segments are short, so that it is raised again when the pivots have recovered.
        """
        t, bound, steps, short = 0.0, SOFT, self.options["max_steps"], self.duration / SHORT
        chart = self._faced(chart, q)
        while True:
            end = self.duration if bound == SOFT else min(t + short, self.duration)
            trajectory = self._integrate(chart, q, v, t, end, bound, steps)
            yield Segment(chart, trajectory)
            steps -= trajectory.steps + trajectory.rejected
            t, q, v = trajectory.end_time, trajectory.q_end, trajectory.v_end
            if trajectory.status is Status.FINISHED and end < self.duration:
                recovered = chart.pivot(q) > RECOVERED * SOFT
                bound, short = (SOFT, self.duration / SHORT) if recovered else (bound, 2 * short)
                continue
            if trajectory.status is not Status.SINGULAR or steps < 1:
                return
            Phi = chart.constraint_jacobian(q)
            regular = chart.equations.regular(Phi)
            landing = self._over(chart, t, q, v) if self.step_over and not regular else None
            better = self._better(chart, q, Phi, regular) if landing is None else None
            if better is not None:
                v, chart, bound = better.from_tree(chart.tree_rates(q, v)), better, SOFT
                continue
            if self.step_over and regular:
                landing = self._over(chart, t, q, v)
            if landing is not None:
                short, (t, q, v) = landing[0] - t, landing
                chart = self._faced(chart, q)
                bound = min(SOFT, 0.5 * chart.pivot(q))
            elif bound > checks.PIVOT_BOUND:
                bound = max(checks.PIVOT_BOUND, LOWER * min(bound, chart.pivot(q)))
            else:
                return
            if not t < self.duration:
                return

    def _integrate(
        self, chart: CompiledChart, q: np.ndarray, v: np.ndarray, t: float, end: float, bound: float, steps: int
    ) -> Trajectory:
        save_at = self.save_at
        if save_at is not None and (t > 0 or end < self.duration):
            save_at = save_at[(save_at >= t) & ((save_at <= end) | (end == self.duration))]
        return integrate(
            chart.kernel("motion").address,
            chart.kernel("closure_step").address if chart.equations.constrained else None,
            q,
            v,
            self.forces,
            chart.p,
            duration=end - t,
            start=t,
            save_at=save_at,
            closure_tol=CLOSURE * self.robot.size,
            pivot_bound=bound,
            **{**self.options, "max_steps": steps},
        )

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
        """Return time, q and v behind the singular pose ahead, or None."""
        tolerance = self.options["atol"], self.options["rtol"]
        return Crossing(chart, self.forces, CLOSURE * self.robot.size, *tolerance).over(t, self.duration, q, v)
