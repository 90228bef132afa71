"""Retraced: a run gone through once more in its own steps, as a chain of links.

A run that was saved at some times only is run again, saved at every step; that takes the same
steps. What cannot be differentiated is refused by name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from linkwork.control.acting import Acting
from linkwork.errors import LinkworkError
from linkwork.gradients import run_kernels
from linkwork.gradients.links import (
    ChartChange,
    ControllerCall,
    InputsAt,
    Partials,
    Passing,
    PulledBack,
    ReadOff,
    RunLink,
    Steps,
)
from linkwork.gradients.native_steps import StateSizes
from linkwork.gradients.switches import Switching, require_no_jumps, switching
from linkwork.model.charts import CompiledChart
from linkwork.model.model import Model
from linkwork.runs.passage import CLOSURE, Segment
from linkwork.runs.run_record import RunRecord
from linkwork.runs.system import System, with_jacobian
from linkwork.simulation import Run, Signal, Status, Trajectory
from linkwork.simulation.fixed_steps import SymplecticEuler
from linkwork.simulation.methods import METHODS
from linkwork.simulation.native_between import ROUNDING
from linkwork.simulation.rosenbrock import RODAS
from linkwork.simulation.tableaus import StepPlan

CLOSE = 2.0**-38  # how near to an event a step ends at it, relative to the time and to the step
ASIDE = 1e-9  # how far from an event both sides of it are looked at, likewise
SMOOTH = 1e-6  # jump of y' at an event that is none, relative to it
OFF_JUMPS = 1e-11  # how far off a jump steps end and begin, relative to the step behind
OFF_KINKS, STIFFLY_OFF = 1e-7, 1e-5
"""How far off a kink the slopes of a step are taken, relative to the step, and those of a stiff
one, whose slopes are differentiated, too: kinks are rounded off within rounding. What is integrated
over that step is off by as much of its change."""
NEARER = 2.0**-8
"""Part of a step that is left to a next one before a break, and so on: stages, of lower order than
their step, fall behind its end by as much as their errors, which shrink faster than steps."""
TICKS = 2.0**-49  # how far off a jump steps end and begin at least, relative to the time
OF_TIME = 0.1  # part of an event function's rate by the state, below which it is an event of time
POWERS = np.arange(4.0)
GRAZING = 1e-9  # rate of an event function, relative to its parts, at which it does not pass zero


class Sampling(NamedTuple):
    """Instants of a run that are read (S): the numbers of their segments, times [s], states
    (S, n) and inputs (S, nr)."""

    segment: np.ndarray
    t: np.ndarray
    y: np.ndarray
    u: np.ndarray

    def of(self, numbers: slice) -> Sampling:
        """Return some of the instants."""
        return Sampling(*(part[numbers] for part in self))


class Aside(NamedTuple):
    """How far off a break of what acts the slopes of its own side are taken: steps end before it
    and begin after it [s], these in a state moved along the motion [s].

    earlier: how much earlier the last step before it begins [s], along the motion as well
    """

    ends: float
    begins: float
    moved: float
    earlier: float


@dataclass(frozen=True, eq=False)
class Retraced:
    """A run in its own steps.

    record: what it recorded; system: joined with what acts; segments: with every step saved
    samples: the instants that are read, those of the events last, `happened` being the numbers of
        these; ended: whether an event ended the run
    cost: which of the event functions is integrated over the run, if any
    """

    record: RunRecord
    system: System
    segments: Sequence[Segment]
    samples: Sampling
    happened: np.ndarray
    ended: bool
    cost: int | None = None

    @cached_property
    def held(self) -> int:
        """How many inputs a sampled controller holds."""
        return self.acting.held

    @property
    def robot(self) -> Model:
        return self.record.robot

    @property
    def acting(self) -> Acting:
        assert self.system.acting is not None
        return self.system.acting

    @cached_property
    def links(self) -> list[RunLink]:
        """The links of the run, in their order."""
        found, held = [], np.zeros(self.held)
        for number, segment in enumerate(self.segments):
            before = self.segments[number - 1]
            if number and before.chart.independent != segment.chart.independent:
                found.append(self._chart_change(before, segment.chart))
            own = OfSegment(self, number, segment, held)
            found += own.links()
            held = own.held[-1]
        return found

    def _chart_change(self, before: Segment, chart: CompiledChart) -> ChartChange:
        """Return the change to a chart at the end of a segment."""
        q, v = before.trajectory.q_end, before.trajectory.v_end[: self.robot.mobility]
        found = rates_jacobian(before.chart, q, v)[list(chart.equations.chart.independent)]
        end = q.size + v.size
        return ChartChange(found[:, : q.size], found[:, q.size : end], found[:, end:])

    def inputs_at(self, t: np.ndarray, from_left: bool = False) -> InputsAt:
        """Return how the inputs over time depend on their coefficients at times (K)."""
        signal = self.system.inputs
        piece, s = pieces(signal, t, from_left)
        c, s = signal.coefficients[piece], s[:, None]
        rates = c[:, 1] + s * (2 * c[:, 2] + 3 * s * c[:, 3])
        return InputsAt(piece, s**POWERS, rates)

    def partials(
        self,
        chart: CompiledChart,
        name: str,
        of: run_kernels.Expressions,
        states: Sampling,
        from_left: bool = False,
    ) -> Partials:
        """Return the Jacobians of expressions at instants in a chart; name: theirs."""
        joined, p = self.system.joined, self.system.p(chart)
        kernel = chart.compiled(
            f"{self.acting.key} {name} jacobian",
            lambda _: run_kernels.jacobian(joined(chart), of(joined(chart))),
        )
        x, n = np.concatenate([states.y, states.u], axis=1), states.y.shape[1]
        (flat,) = kernel(x, p)
        rows, end = flat.reshape(len(x), -1, x.shape[1] + p.size), x.shape[1]
        inputs = self.inputs_at(states.t, from_left)
        return Partials(rows[:, :, :n], rows[:, :, n:end], rows[:, :, end:], inputs)

    def values(self, name: str, of: run_kernels.Expressions, own: slice) -> np.ndarray:
        """Return expressions (K, rows) at samples of one segment; name: theirs; own: which."""
        states = self.samples.of(own)
        chart, joined = self.segments[states.segment[0]].chart, self.system.joined
        kernel = chart.compiled(
            f"{self.acting.key} {name} values",
            lambda _: run_kernels.read_off("values", joined(chart), of(joined(chart))),
        )
        return kernel(np.concatenate([states.y, states.u], axis=1), self.system.p(chart))[0]

    def pulled(
        self, name: str, of: run_kernels.Expressions, own: slice, bars: np.ndarray
    ) -> PulledBack:
        """Return the derivatives of a sum of bars (K, rows) times expressions at samples (K) of one
        segment; name: theirs; own: which samples."""
        states = self.samples.of(own)
        chart, joined = self.segments[states.segment[0]].chart, self.system.joined
        p = self.system.p(chart)
        kernel = chart.compiled(
            f"{self.acting.key} {name} pulled",
            lambda _: run_kernels.pulled(joined(chart), of(joined(chart))),
        )
        x, n = np.concatenate([states.y, states.u], axis=1), states.y.shape[1]
        rows = kernel.flat(x[0], bars[0], p)[None] if len(x) == 1 else kernel(x, bars, p)[0]
        y, r, p = rows[:, :n], rows[:, n : x.shape[1]], rows[:, x.shape[1] :]
        return PulledBack(y, r, p.sum(axis=0), self.inputs_at(states.t) if r.any() else None)

    def ends(self, place: int) -> bool:
        """Tell whether a sample is of the event that ended the run."""
        last = self.samples.segment[place] == len(self.segments) - 1
        return self.ended and last and self.samples.t[place] == self.segments[-1].trajectory.t[-1]

    def moment_of(self, number: int) -> Partials:
        """Return the Jacobian of the time of an event that happened, by its place among them."""
        place = len(self.samples.t) - len(self.happened) + number
        state = Sampling(*(part[place : place + 1] for part in self.samples))
        chart = self.segments[state.segment[0]].chart
        motion = self.system.kernel(chart, "motion")
        slope = motion.flat(state.y[0], state.u[0], self.system.p(chart))[:-1]
        return self.moment(chart, state, int(self.happened[number]), slope)

    def moment(
        self, chart: CompiledChart, state: Sampling, event: int, slope: np.ndarray
    ) -> Partials:
        """Return the Jacobian of the time of an event; slope: y' before it."""
        found, own = self._events(chart, state), slice(event, event + 1)
        y, r, p = found.y[:, own], found.r[:, own], found.p[:, own]
        parts = rates_of(found, event, slope)
        if not abs(parts.sum()) > GRAZING * np.abs(parts).sum():
            name = self.system.events[event].name
            raise LinkworkError(
                f"the event {name!r} at t = {state.t[0]:.9g} s touches zero rather than passing it,"
                " so that its time has no derivative; differentiate a run that ends before it"
            )
        rate = parts.sum()
        return Partials(-y / rate, -r / rate, -p / rate, found.inputs)

    def by_state_and_time(
        self, chart: CompiledChart, state: Sampling, event: int, slope: np.ndarray
    ) -> tuple[float, float]:
        """Return the rate of an event function by the state and by the inputs over time."""
        parts = rates_of(self._events(chart, state), event, slope)
        return parts[: len(slope)].sum(), parts[len(slope) :].sum()

    def _events(self, chart: CompiledChart, state: Sampling) -> Partials:
        return self.partials(chart, "events", lambda of: of.passing(), state, True)


@dataclass(frozen=True, eq=False)
class OfSegment:
    """Make the links of a segment; number: its own; before: what a sampled controller held."""

    whole: Retraced
    number: int
    segment: Segment
    before: np.ndarray

    @property
    def chart(self) -> CompiledChart:
        return self.segment.chart

    @property
    def system(self) -> System:
        return self.whole.system

    @cached_property
    def t(self) -> np.ndarray:
        return np.ascontiguousarray(self.segment.trajectory.t)

    @cached_property
    def y(self) -> np.ndarray:
        part = self.segment.trajectory
        return np.ascontiguousarray(part.rows[:, 1 : 1 + part.y_end.size])

    @cached_property
    def held(self) -> np.ndarray:
        """What a sampled controller holds from each row on (K, nh)."""
        u = self.segment.trajectory.u
        return np.ascontiguousarray(u[:, u.shape[1] - self.whole.held :])

    @property
    def sizes(self) -> StateSizes:
        equations, p = self.chart.equations, self.system.p(self.chart)
        return StateSizes(
            n=self.y.shape[1],
            nq=equations.nq,
            signals=self.system.inputs.coefficients.shape[2],
            held=self.held.shape[1],
            parameters=p.size,
            own=len(equations.parameters),
            tolerance=CLOSURE * self.whole.robot.size,
            apart=equations.nq if self.segment.method == SymplecticEuler.name else 0,
            redundant=int(bool(self.whole.robot.redundant)),
        )

    def links(self) -> Iterator[RunLink]:
        """Yield the links: what happens at a row, and the steps to the next at which anything
        does."""
        last = len(self.t) - 1
        ends = sorted({0, last, *self.acts, *self.jumps, *self.kinks})
        if (branching := self.branching) is not None:
            x = np.column_stack([self.y, values(self.system.inputs, self.t, False), self.held])
            require_no_jumps(branching, self.system.p(self.chart), self.t, x, self.cuts.keys())
        yield from self.at(0)
        for a, b in pairwise(ends):
            yield self.steps(a, b)
            yield from self.at(b)

    @cached_property
    def branching(self) -> Switching | None:
        """How what acts branches."""
        return switching(self.system, self.chart, self.whole.cost)

    def at(self, row: int) -> Iterator[RunLink]:
        """Yield what happens at a row."""
        t = self.t[row]
        numbers = self.read[self.read_at.searchsorted(t) : self.read_at.searchsorted(t, "right")]
        if row == self.end:
            yield self.ending(numbers)
            return
        if row in self.jumps:
            yield self.jumps[row]
        if row in self.acts:
            state = self.state(row, self.held[row - 1] if row else self.before)
            yield ControllerCall(
                self.whole.partials(self.chart, "held", lambda of: of.outputs["next_held"], state)
            )
        if numbers.size:
            yield ReadOff(numbers)

    @property
    def end(self) -> int | None:
        """The row of the event that ends the run, if one does so in this segment."""
        last = self.whole.ended and self.segment is self.whole.segments[-1]
        return len(self.t) - 1 if last else None

    def state(self, row: int, held: np.ndarray, from_left: bool = False) -> Sampling:
        """Return the state of a row under some held inputs."""
        t = self.t[row : row + 1]
        u = np.concatenate([values(self.system.inputs, t, from_left)[0], held])
        return Sampling(np.array([self.number]), t, self.y[row : row + 1], u[None])

    @cached_property
    def read(self) -> np.ndarray:
        """The numbers of the samples of this segment, in the order of their times."""
        found = np.flatnonzero(self.whole.samples.segment == self.number)
        return found[self.whole.samples.t[found].argsort(kind="stable")]

    @cached_property
    def read_at(self) -> np.ndarray:
        """Their times [s]."""
        return self.whole.samples.t[self.read]

    def steps(self, a: int, b: int) -> Steps:
        """Return the steps from row a to row b, with the samples between."""
        t = self.t[a : b + 1]
        first, end = self.read_at.searchsorted(t[0], "right"), self.read_at.searchsorted(t[-1])
        times, numbers = self.read_at[first:end], self.read[first:end]
        rows = t.searchsorted(times)
        ends = t[rows] == times
        between = ~ends
        t, y, at = self.graded(a, b)
        within = (t.searchsorted(times[between]) - 1).clip(0, len(t) - 2)
        plan, apart = plans_of(self.segment.method)
        kernels = self.whole.acting, self.chart, self.whole.cost
        return Steps(
            run_kernels.addresses(*kernels),
            run_kernels.stiff_addresses(*kernels) if self.stiff else None,
            self.sizes,
            self.system.p(self.chart),
            plan.table,
            apart.table,
            self.system.inputs.table,
            t,
            y,
            self.held[a],
            at[rows[ends]],
            numbers[ends],
            within.astype(float),
            times[between],
            numbers[between],
        )

    @property
    def stiff(self) -> bool:
        """Whether its steps are those of the stiff method, which takes slopes where they begin."""
        return self.segment.method == RODAS.name

    @cached_property
    def kinks(self) -> set[int]:
        """Rows at which what acts has a kink: steps ended there at events, and nothing jumps."""
        jumping = {0, len(self.t) - 1, *self.acts, *self.jumps}
        jumping |= set(np.flatnonzero(np.isin(self.t, self.system.inputs.knots)).tolist())
        return self.cuts.keys() - jumping

    @cached_property
    def asides(self) -> dict[int, Aside]:
        """How far off kinks and jumps steps end and begin, by row."""
        found = {
            row: self.aside(row, event) for row, event in self.cuts.items() if row in self.breaks
        }
        if self.end and self.branching is not None:
            last = self.t[self.end] - self.t[self.end - 1]
            near, earlier = self.near(self.end, last)
            found[self.end] = Aside(ends=near, begins=near, moved=near, earlier=earlier)
        return found

    @property
    def breaks(self) -> set[int]:
        """Rows at which steps are taken aside."""
        return self.kinks | self.jumps.keys()

    def aside(self, row: int, event: int) -> Aside:
        """Return how far off the break of an event steps end and begin.

        At a kink they begin as far before its time as those before it end, so that an integral
        has no gap, and in a state moved so that g, the event's function, is that of behind:
        g_y y' moved - g_t begins = (g_y y' + g_t) begins. At a jump, and at a kink that is one of
        time, they go along the motion, and the gap is within rounding.
        """
        behind = self.t[row + 1] - self.t[row]
        state = self.state(row, self.held[row], from_left=True)
        slope = self.slope(state.y[0], state.u[0])[:-1]
        of_state, of_time = self.whole.by_state_and_time(self.chart, state, event, slope)
        if row in self.jumps or not abs(of_state) > OF_TIME * abs(of_time):
            near, earlier = self.near(row, behind)
            return Aside(ends=near, begins=near, moved=near, earlier=earlier)
        off, earlier = self.room(row, (STIFFLY_OFF if self.stiff else OFF_KINKS) * behind)
        moved = off * (1 + 2 * of_time / of_state)
        return Aside(ends=off, begins=-off, moved=moved, earlier=earlier)

    def near(self, row: int, step: float) -> tuple[float, float]:
        """Return how far before a jump the last step ends, and how much earlier it begins."""
        return self.room(row, max(OFF_JUMPS * step, TICKS * self.t[row]))

    def room(self, row: int, off: float) -> tuple[float, float]:
        """Return how far before a break the last step may end, `off` at most, and how much earlier
        it begins for that: it would begin within the break where it is as short, as one is that is
        left of a step that ended within rounding before it."""
        if self.t[row] - self.t[row - 1] > 2 * off:
            return off, 0.0
        fixed = {0, *self.acts, *self.breaks}
        if row - 1 in fixed or self.t[row - 1] - self.t[row - 2] <= 2 * off:
            return min(off, (self.t[row] - self.t[row - 1]) / 2), 0.0
        return off, off

    def beside_breaks(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Return times and states of the rows from a to b, so that slopes are those of the own
        side of kinks and jumps: steps end before one, and begin there in a state behind it."""
        t, y = self.t[a : b + 1].copy(), self.y[a : b + 1].copy()
        if a in self.asides:
            aside = self.asides[a]
            y[0] += aside.moved * self.slope(y[0], self.state(a, self.held[a]).u[0])[:-1]
            t[0] += aside.begins
        if b in self.asides:
            t[-1] -= self.asides[b].ends
            y[-1] -= self.asides[b].ends * self.slope_before(b)
            if (earlier := self.asides[b].earlier) > 0:
                slope = self.slope(y[-2], self.state(b - 1, self.held[b - 1]).u[0])[:-1]
                t[-2], y[-2] = t[-2] - earlier, y[-2] - earlier * slope
        return t, y

    def graded(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times and states of the rows from a to b beside breaks, and the places of the rows
        among them: steps that end near before a break at b are divided, ever finer towards it, so
        that all stages of each part are on its side."""
        t, y = self.beside_breaks(a, b)
        places = np.arange(len(t))
        if b not in self.asides:
            return t, y, places
        left = self.t[b] - t
        for i in np.flatnonzero(left[1:] < NEARER * np.diff(t))[::-1]:
            count = int(np.log(4 * left[i + 1] / left[i]) / np.log(NEARER))
            times = self.t[b] - left[i] * NEARER ** np.arange(1.0, count + 1)
            y = np.insert(y, i + 1, self.cubic(a + i, t[i : i + 2], y[i : i + 2], times), axis=0)
            t, places[i + 1 :] = np.insert(t, i + 1, times), places[i + 1 :] + count
        return t, y, places

    def cubic(self, row: int, t: np.ndarray, y: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return states within the step from a row, whose ends are t (2,) and y (2, n), by the
        slopes there."""
        held = self.held[row]
        given = values(self.system.inputs, t[:1], from_left=False)[0]
        start, end = self.slope(y[0], np.append(given, held))[:-1], self.slope_before(row + 1)
        h = t[1] - t[0]
        chord, left = (y[1] - y[0]) / h, ((t[1] - times) / h)[:, None]
        bend = left * (1 - left) * ((end - chord) * (1 - left) - (start - chord) * left)
        return y[1] - h * (left * chord + bend)

    @cached_property
    def acts(self) -> set[int]:
        """The rows at which a sampled controller is called."""
        control, sampler = self.segment.trajectory.control, self.system.sampler
        if sampler is None or control is None:
            return set()
        period, following = sampler.period, control.next_sample
        assert following is not None
        due = np.floor(self.t / period + ROUNDING)
        return {
            row
            for row, number in enumerate(due)
            if number < following
            and abs(self.t[row] - number * period) <= ROUNDING * period
            and not (row == 0 and self._called_before(number))
        }

    def _called_before(self, number: float) -> bool:
        """Tell whether the call of the first row was the last one of the segment before."""
        if not self.number:
            return False
        control = self.whole.segments[self.number - 1].trajectory.control
        return control is not None and (control.next_sample or 0) > number

    @cached_property
    def cuts(self) -> dict[int, int]:
        """The rows at which steps ended at events, with the numbers of these."""
        found, events = {}, self.segment.trajectory.events
        for time, event in zip(events.times, events.index, strict=True):
            row = int(np.abs(self.t - time).argmin())
            size = max(self.t[row], self.t[row] - self.t[row - 1])
            if self.system.events[event].cuts and abs(self.t[row] - time) <= CLOSE * size:
                found[row] = int(event)
        return found

    @cached_property
    def jumps(self) -> dict[int, Passing]:
        """Events at which steps end and y' jumps, by row."""
        found, last = {}, len(self.t) - 1
        for row, event in self.cuts.items():
            if not 0 < row < last:
                continue
            size = self.t[row]
            state = self.state(row, self.held[row - 1], from_left=True)
            before, behind = self.beside(state, -ASIDE * size), self.beside(state, ASIDE * size)
            jump, n = before - behind, self.y.shape[1]
            if (np.abs(jump) > SMOOTH * np.abs(before).max()).any():
                moment = self.whole.moment(self.chart, state, event, before[:n])
                found[row] = Passing(moment, jump[:n], float(jump[n]), np.empty(0, int))
        return found

    def slope(self, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return y' in a state, and the cost, 0 if there is none."""
        p, cost = self.system.p(self.chart), self.whole.cost
        found = self.system.kernel(self.chart, "motion").flat(y, u, p)
        found[-1] = 0.0
        if cost is not None:
            found[-1] = self.system.kernel(self.chart, "events").flat(y, u, p)[cost]
        return found

    def beside(self, state: Sampling, aside: float) -> np.ndarray:
        """Return y' and the cost at an event from one side, by two instants along the motion
        there."""
        (y,), (u,) = state.y, state.u
        along, signals = self.slope(y, u)[:-1], self.system.inputs
        times = state.t + aside * np.array([1.0, 2.0])
        inputs = values(signals, times, from_left=aside < 0)
        held = u[inputs.shape[1] :]
        near, far = (
            self.slope(y + d * along, np.concatenate([r, held]))
            for d, r in zip(times - state.t, inputs, strict=True)
        )
        return 2 * near - far

    def slope_before(self, row: int) -> np.ndarray:
        """Return y' before what happens at a row."""
        state = self.state(row, self.held[row - 1], from_left=True)
        return self.beside(state, -ASIDE * self.t[row])[:-1]

    def ending(self, numbers: np.ndarray) -> Passing:
        """Return the event that ends the run, where samples are taken."""
        events = self.segment.trajectory.events.index
        event = next(int(i) for i in events if self.system.events[i].terminal)
        row = len(self.t) - 1
        state = self.state(row, self.held[max(row - 1, 0)], from_left=True)
        slope = self.beside(state, -ASIDE * self.t[row])
        moment = self.whole.moment(self.chart, state, event, slope[:-1])
        return Passing(moment, slope[:-1], float(slope[-1]), numbers)


def rates_of(events: Partials, event: int, slope: np.ndarray) -> np.ndarray:
    """Return the parts of the rate of an event function: by each state, by each input over time."""
    by_input = events.r[0, event, : events.columns] * events.inputs.rates[0]
    return np.concatenate([events.y[0, event] * slope, by_input])


def pieces(signal: Signal, t: np.ndarray, from_left: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces of a signal that times (K) are in, and the times since their knots."""
    last = len(signal.coefficients) - 1
    if not last:
        return np.zeros(t.shape, int), t - signal.knots[0]
    piece = np.searchsorted(signal.knots, t, side="left" if from_left else "right") - 1
    piece = np.minimum(np.maximum(piece, 0), last)
    return piece, t - signal.knots[piece]


def values(signal: Signal, t: np.ndarray, from_left: bool) -> np.ndarray:
    """Return the values of a signal at times (K, columns)."""
    piece, s = pieces(signal, t, from_left)
    powers = s[:, None] ** POWERS
    if len(signal.coefficients) == 1:
        return powers @ signal.coefficients[0]
    return np.einsum("km,kmc->kc", powers, signal.coefficients[piece])


def rates_jacobian(chart: CompiledChart, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the Jacobian of w = L v (nv) in (q, v, p)."""
    kernel = chart.compiled("rates jacobian", run_kernels.rates_jacobian)
    return kernel.flat(q, v, chart.p).reshape(chart.equations.nv, -1)


def symplectic(of_rates: Sequence[int], of_q: Sequence[int]) -> tuple[StepPlan, StepPlan]:
    """Return symplectic steps by two slopes, the second one at the new rates: which of them moves
    the rates, and which q."""
    plans = (
        replace(
            SymplecticEuler.plan,
            a=np.array([[0.0] * 3, second, moved]),
            c=np.zeros(3),
            e=np.empty((0, 3)),
            dense=np.array([[*moved, 0.0]]),
            solution=2,
        )
        for second, moved in ((of_rates, of_rates), ([0] * 3, of_q))
    )
    return next(plans), next(plans)


@cache
def plans_of(method: str) -> tuple[StepPlan, StepPlan]:
    """Return the method of this name as loops take it, and as it steps what stands apart."""
    if method == SymplecticEuler.name:
        return symplectic(of_rates=[1, 0, 0], of_q=[0, 1, 0])
    known = (entry.make(1.0) if entry.fixed else entry.make() for entry in METHODS.values())
    plan = next(each.plan for each in known if each.name == method)
    return plan, plan


def retraced(
    run: Run, samples: bool = True, system: System | None = None, cost: int | None = None
) -> Retraced:
    """Return a run in its own steps; refuse what cannot be differentiated.

    Args:
        samples: whether the saved instants are read, or the last state alone.
        system: the run's, with more events behind its own; cost: which of these, if any, is
            integrated over the run.
    """
    if not isinstance(run, Run):
        raise LinkworkError(f"a run is differentiated, not {type(run).__name__}")
    record = run.variables
    if not isinstance(record, RunRecord):
        raise LinkworkError(
            "the run was read from a file, which holds its numbers alone; run it again by "
            "robot.simulate to differentiate it"
        )
    require_differentiable(record)
    every = run if run.every or run.again is None else run.again(None)
    own = every.variables
    assert isinstance(own, RunRecord)
    segments = own.segments
    if system is None:
        span = float(segments[0].start[0]), float(segments[-1].trajectory.end_time)
        system = with_jacobian(record.robot, record.system, span)
    last = len(segments) - 1
    kept = [*enumerate(record.kept)] if samples else [(last, (segments[-1], np.array([-1])))]
    parts = [sampled(system, i, of.trajectory, of.trajectory.rows[rows]) for i, (of, rows) in kept]
    happened = np.empty(0, int)
    if samples and system.events:
        trajectories = [segment.trajectory for segment in segments]
        happened = np.concatenate([part.events.index for part in trajectories])
        parts += [sampled(system, i, of, of.found, True) for i, of in enumerate(trajectories)]
    several = len(parts) > 1
    sampling = Sampling(*map(np.concatenate, zip(*parts, strict=True))) if several else parts[0]
    return Retraced(
        record, system, segments, sampling, happened, every.status is Status.EVENT, cost
    )


def sampled(
    system: System, segment: int, of: Trajectory, rows: np.ndarray, from_left: bool = False
) -> Sampling:
    """Return the instants that rows of a trajectory hold."""
    n, held = of.y_end.size, system.acting.held if system.acting else 0
    t, y, u = rows[:, 0], rows[:, 1 : 1 + n], values(system.inputs, rows[:, 0], from_left)
    if held:
        u = np.concatenate([u, rows[:, -2 - held : -2]], axis=1)
    return Sampling(np.full(len(rows), segment), t, y, u)


def require_differentiable(record: RunRecord) -> None:
    """Refuse runs with what has no derivative."""
    sampler = record.system.sampler
    if sampler is not None and not sampler.compiled:
        raise LinkworkError(
            "the sampled controller is a Python function, which cannot be differentiated; write it "
            "with linkwork.math and give Sampler(..., compiled=True)"
        )
    if sampler is not None and sampler.quantise is not None:
        raise LinkworkError(
            "the sampled controller reads coordinates in whole steps, whose derivative is zero or "
            "infinite; leave quantise out to differentiate the run"
        )
    for segment in record.segments:
        if segment.crossed is not None:
            raise LinkworkError(
                f"the run stepped over a singular pose by t = {segment.trajectory.end_time:.9g} s, "
                "where it has no derivative; differentiate a run that ends before it"
            )
