"""The chain of links that a run is differentiated by: its steps, segment by segment, and what
happens between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from linkwork.control.joined import Joined
from linkwork.gradients import run_kernels
from linkwork.gradients.breaks import Breaks
from linkwork.gradients.links import ChartChange, ControllerCall, Passing, ReadOff, RunLink, Steps
from linkwork.gradients.native_steps import StateSizes, StepsTaken
from linkwork.gradients.retraced import Retraced
from linkwork.gradients.segment_rows import ASIDE, SegmentRows
from linkwork.model.charts import CompiledChart
from linkwork.runs.passage import CLOSURE, Segment
from linkwork.simulation.fixed_steps import SymplecticEuler


def chained(of: Retraced) -> list[RunLink]:
    """Return the links of a run, in their order."""
    found, held = [], np.zeros(of.held)
    for number, segment in enumerate(of.segments):
        before = of.segments[number - 1]
        if number and before.chart.independent != segment.chart.independent:
            found.append(chart_change(before, segment.chart))
        rows = SegmentRows(of, number)
        found += SegmentLinks(rows, held).links()
        held = rows.held[-1]
    return found


def chart_change(before: Segment, chart: CompiledChart) -> ChartChange:
    """Return the change to a chart at the end of a segment."""
    part = before.trajectory
    q, v = part.q_end, part.v_end[: len(before.chart.independent)]
    found = rates_jacobian(before.chart, q, v)[list(chart.equations.chart.independent)]
    end = q.size + v.size
    return ChartChange(found[:, : q.size], found[:, q.size : end], found[:, end:])


@dataclass(frozen=True, eq=False)
class SegmentLinks:
    """Make the links of a segment; before: what a sampled controller held."""

    rows: SegmentRows
    before: np.ndarray

    @cached_property
    def breaks(self) -> Breaks:
        return Breaks(self.rows)

    @property
    def sizes(self) -> StateSizes:
        rows = self.rows
        equations, p = rows.chart.equations, rows.system.p(rows.chart)
        return StateSizes(
            n=rows.y.shape[1],
            nq=equations.nq,
            signals=rows.system.inputs.coefficients.shape[2],
            held=rows.held.shape[1],
            parameters=p.size,
            own=len(equations.parameters),
            tolerance=CLOSURE * rows.whole.robot.size,
            apart=equations.nq if rows.segment.method == SymplecticEuler.name else 0,
            redundant=int(bool(rows.whole.robot.redundant)),
        )

    def links(self) -> Iterator[RunLink]:
        """Yield the links: what happens at a row, and the steps to the next at which anything
        does."""
        self.breaks.require_no_others()
        ends = sorted({0, self.rows.last, *self.rows.acts, *self.breaks.inner})
        yield from self.at(0)
        for a, b in pairwise(ends):
            yield self.steps(a, b)
            yield from self.at(b)

    def at(self, row: int) -> Iterator[RunLink]:
        """Yield what happens at a row."""
        rows, t = self.rows, self.rows.t[row]
        numbers = self.read[self.read_at.searchsorted(t) : self.read_at.searchsorted(t, "right")]
        if row == rows.end:
            yield self.ending(numbers)
            return
        if row in self.breaks.jumps:
            yield self.breaks.jumps[row]
        if row in rows.acts:
            state = rows.state(row, rows.held[row - 1] if row else self.before)
            yield ControllerCall(rows.whole.partials(rows.chart, "held", next_held, state))
        if numbers.size:
            yield ReadOff(numbers)

    @cached_property
    def read(self) -> np.ndarray:
        """The numbers of the samples of this segment, in the order of their times."""
        samples = self.rows.whole.samples
        found = np.flatnonzero(samples.segment == self.rows.number)
        return found[samples.t[found].argsort(kind="stable")]

    @cached_property
    def read_at(self) -> np.ndarray:
        """Their times [s]."""
        return self.rows.whole.samples.t[self.read]

    def steps(self, a: int, b: int) -> Steps:
        """Return the steps from row a to row b, with the samples between."""
        # Samples up to row b: those at ends of steps, and those between.
        rows, t = self.rows, self.rows.t[a : b + 1]
        first, end = self.read_at.searchsorted(t[0], "right"), self.read_at.searchsorted(t[-1])
        times, numbers = self.read_at[first:end], self.read[first:end]
        near = t.searchsorted(times)
        ends = t[near] == times
        between = ~ends
        inner = times[between]
        # The steps, beside breaks, and which of them the samples between are in.
        t, y, at = self.breaks.graded(a, b)
        within = np.maximum(np.minimum(t.searchsorted(inner) - 1, len(t) - 2), 0)
        plan, apart = rows.plans
        kernels = rows.whole.acting, rows.chart, rows.whole.cost
        taken = StepsTaken(
            p=rows.system.p(rows.chart),
            plan=plan.table,
            plan_apart=apart.table,
            signal=rows.system.inputs.table,
            t=t,
            y=y,
            held=rows.held[a],
            places=within.astype(float),
            times=inner,
        )
        return Steps(
            run_kernels.addresses(*kernels),
            run_kernels.stiff_addresses(*kernels) if rows.stiff else None,
            self.sizes,
            taken,
            at[near[ends]],
            numbers[ends],
            numbers[between],
        )

    def ending(self, numbers: np.ndarray) -> Passing:
        """Return the event that ends the run, where samples are taken."""
        rows, row = self.rows, self.rows.last
        state = rows.state(row, rows.held[max(row - 1, 0)], from_left=True)
        slope, _ = rows.beside(state, -ASIDE * rows.t[row])
        moment = rows.whole.moment(rows.chart, state, rows.ended_by, slope[:-1])
        return Passing(moment, slope[:-1], float(slope[-1]), numbers)


def next_held(joined: Joined) -> ca.SX:
    """Return what a sampled controller holds from its call on."""
    return joined.outputs["next_held"]


def rates_jacobian(chart: CompiledChart, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the Jacobian of w = L v (nv) in (q, v, p)."""
    kernel = chart.compiled("rates jacobian", run_kernels.rates_jacobian)
    return kernel.flat(q, v, chart.p).reshape(chart.equations.nv, -1)
