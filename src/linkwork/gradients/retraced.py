"""Retraced: a run gone through once more in its own steps.

A run that was saved at some times only is run again, saved at every step; that takes the same
steps. What cannot be differentiated is refused by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.control.acting import Acting
from linkwork.errors import LinkworkError
from linkwork.gradients import run_kernels
from linkwork.gradients.instants import Sampling, inputs_at, sampled, values
from linkwork.gradients.links import Partials, PulledBack
from linkwork.model.charts import CompiledChart
from linkwork.model.model import Model
from linkwork.runs.passage import Segment
from linkwork.runs.run_record import RunRecord
from linkwork.runs.system import System, with_jacobian
from linkwork.simulation import Run, Status

GRAZING = 1e-9
"""How deep an event function passes zero at least, relative to its value a step before; and its
rate, relative to the parts of that."""
AGO, LEAP = 1e-9, 100.0
"""How long before an event its function is looked at, relative to the time, and how many times
farther from zero than it moves in that time it is where it leaps over zero."""


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

    @property
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
        inputs = inputs_at(self.system.inputs, states.t, from_left)
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
        inputs = inputs_at(self.system.inputs, states.t, from_left=False) if r.any() else None
        return PulledBack(y, r, p.sum(axis=0), inputs)

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
        """Return the Jacobian of the time of an event; slope: y' before it. Where its function
        leaps over zero with inputs that jump, the time is theirs."""
        found, own = self._events(chart, state), slice(event, event + 1)
        y, r, p = found.y[:, own], found.r[:, own], found.p[:, own]
        parts = rates_of(found, event, slope)
        rate = parts.sum()
        if self.leaps(chart, state, event, slope):
            if not self.jump_at(float(state.t[0])):
                raise LinkworkError(
                    f"the event {self.system.events[event].name!r} at t = {state.t[0]:.9g} s leaps "
                    "over zero with what acts, so that its time is that of another event, which is "
                    "not known; watch for what makes it leap by a linkwork.control.Event with "
                    "cuts=True"
                )
            return Partials(0 * y, 0 * r, 0 * p, found.inputs)
        if not abs(rate) > GRAZING * np.abs(parts).sum() or self.grazes(chart, state, event, rate):
            name = self.system.events[event].name
            raise LinkworkError(
                f"the event {name!r} at t = {state.t[0]:.9g} s touches zero rather than passing it,"
                " so that its time has no derivative; differentiate a run that ends before it"
            )
        return Partials(-y / rate, -r / rate, -p / rate, found.inputs)

    def leaps(self, chart: CompiledChart, state: Sampling, event: int, slope: np.ndarray) -> bool:
        """Tell whether an event function leaps over zero together with what acts, rather than
        passing it: a moment ago it was farther from zero than it moves in that time."""
        ago = AGO * state.t
        before = values(self.system.inputs, state.t - ago, from_left=True)[0]
        u, p = np.concatenate([before, state.u[0, before.size :]]), self.system.p(chart)
        g = self.system.kernel(chart, "events").flat(state.y[0] - ago * slope, u, p)[event]
        moved = ago[0] * np.abs(rates_of(self._events(chart, state), event, slope)).sum()
        return bool(abs(g) > LEAP * moved)

    def jump_at(self, t: float) -> bool:
        """Tell whether inputs may jump at a time: a signal has a break, or a controller is
        called."""
        sampler, times = self.system.sampler, self.system.inputs.breaks
        if sampler is not None:
            times = np.append(times, round(t / sampler.period) * sampler.period)
        return bool((np.abs(times - t) <= AGO * t).any())

    def grazes(self, chart: CompiledChart, state: Sampling, event: int, rate: float) -> bool:
        """Tell whether an event function g hardly falls below zero before it turns back, as the
        parabola with its rate and with its value a step before does:

        g(t) = g' t + g'' t^2 / 2,   g(-h) = g_before,   deepest g = -g'^2 / (2 g'')
        """
        number = int(state.segment[0])
        part = self.segments[number].trajectory
        row = max(int(part.t.searchsorted(state.t[0])) - 1, 0)
        h = state.t[0] - part.t[row]
        if not h > 0:
            return False
        before = sampled(self.system, number, part, part.rows[row : row + 1])
        events, p = self.system.kernel(chart, "events"), self.system.p(chart)
        g = events.flat(before.y[0], before.u[0], p)[event]
        bend = 2 * (g + rate * h) / h**2
        return not rate**2 > 2 * abs(bend) * GRAZING * abs(g)

    def by_state_and_time(
        self, chart: CompiledChart, state: Sampling, event: int, slope: np.ndarray
    ) -> tuple[float, float]:
        """Return the rate of an event function by the state and by the inputs over time."""
        parts = rates_of(self._events(chart, state), event, slope)
        return parts[: len(slope)].sum(), parts[len(slope) :].sum()

    def _events(self, chart: CompiledChart, state: Sampling) -> Partials:
        return self.partials(chart, "events", lambda of: of.passing(), state, True)


def rates_of(events: Partials, event: int, slope: np.ndarray) -> np.ndarray:
    """Return the parts of the rate of an event function: by each state, by each input over time."""
    by_input = events.r[0, event, : events.columns] * events.inputs.rates[0]
    return np.concatenate([events.y[0, event] * slope, by_input])


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
        system = with_jacobian(record.robot, record.system)
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
