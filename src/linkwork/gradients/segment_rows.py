"""The rows of a segment of a run, at each of which a step ended, and what happened there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from linkwork.gradients.instants import Sampling, values
from linkwork.gradients.retraced import Retraced
from linkwork.gradients.switches import jumping
from linkwork.model.charts import CompiledChart
from linkwork.runs.passage import Segment
from linkwork.runs.system import System
from linkwork.simulation.fixed_steps import SymplecticEuler
from linkwork.simulation.methods import METHODS
from linkwork.simulation.native_occurrences import FAINT
from linkwork.simulation.native_parts import ROUNDING
from linkwork.simulation.rosenbrock import RODAS
from linkwork.simulation.tableaus import StepPlan

CLOSE = 2.0**-38  # how near to an event a step ends at it, relative to the time and to the step
PASSED = 2 * FAINT  # part of a step, near its start, in which parts that meet may be passed
ASIDE = 1e-9  # how far from an event both sides of it are looked at, relative to the time
SMOOTH, NOISE = 1e-6, 1e-10
"""Jump of a number of y' at an event that is none, relative to that number and to the largest."""


@dataclass(frozen=True, eq=False)
class SegmentRows:
    """Look at the rows of a segment; number: its own in the run."""

    whole: Retraced
    number: int

    @property
    def segment(self) -> Segment:
        return self.whole.segments[self.number]

    @property
    def chart(self) -> CompiledChart:
        return self.segment.chart

    @property
    def system(self) -> System:
        return self.whole.system

    @cached_property
    def t(self) -> np.ndarray:
        """Times of the rows (K,) [s]; fixed steps that miss a break by rounding are taken to end
        there, as by the loop (`native_parts.acting_from`)."""
        t, breaks = np.ascontiguousarray(self.segment.trajectory.t), self.system.inputs.breaks
        if self.plans[0].exponent or not breaks.size:
            return t
        ahead = breaks[np.minimum(breaks.searchsorted(t), breaks.size - 1)]
        near = ROUNDING * np.diff(t).max(initial=0.0)
        return np.where((t < ahead) & (ahead <= t + near), ahead, t)

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
    def last(self) -> int:
        """The last row."""
        return len(self.t) - 1

    @property
    def plans(self) -> tuple[StepPlan, StepPlan]:
        """Its method as loops take it, and as it steps what stands apart."""
        return plans_of(self.segment.method)

    @property
    def stiff(self) -> bool:
        """Whether its steps are those of the stiff method, which takes slopes where they begin."""
        return self.segment.method == RODAS.name

    @property
    def end(self) -> int | None:
        """The row of the event that ends the run, if one does so in this segment."""
        ended = self.whole.ended and self.segment is self.whole.segments[-1]
        return self.last if ended else None

    def state(self, row: int, held: np.ndarray, from_left: bool = False) -> Sampling:
        """Return the state of a row under some held inputs."""
        t = self.t[row : row + 1]
        u = np.concatenate([values(self.system.inputs, t, from_left)[0], held])
        return Sampling(np.array([self.number]), t, self.y[row : row + 1], u[None])

    def within(self, row: int, times: np.ndarray) -> np.ndarray:
        """Return states (K, n) of the dense output at times within the step from a row, made again:
        moved to end where the step did, which another one ends within its error of."""
        again, control = self.segment.again, self.segment.trajectory.control
        assert again is not None
        start, end = self.t[row : row + 2]
        done = again(np.append(times, end), -1 if control is None else row)
        y = done.rows[:, 1 : 1 + self.y.shape[1]]
        return y[:-1] + ((times - start) / (end - start))[:, None] * (self.y[row + 1] - y[-1])

    @property
    def ended_by(self) -> int:
        """The event that ended the run."""
        events = self.segment.trajectory.events.index
        return next(int(i) for i in events if self.system.events[i].terminal)

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
        """The rows at which steps ended at events, with the numbers of these: those that pass zero,
        rather than leap over it with inputs that jump, before those that leap with a law.

        Steps of a fixed length end at none. Where the motion jumps at a time that is the end of
        one, too, what acts in its stages is what acted there in the run, on whichever side.
        """
        if not self.system.events:
            return {}
        found, events = {}, self.segment.trajectory.events
        for time, event in zip(events.times, events.index, strict=True):
            row = int(np.abs(self.t - time).argmin())
            size = max(self.t[row], self.t[row] - self.t[row - 1])
            ended = abs(self.t[row] - time) <= CLOSE * size or self.late(row) > 0
            if not (self.system.events[event].cuts and ended):
                continue
            if not self.plans[0].exponent and self.jumps_in_time(row, int(event)):
                continue
            leaps = self.leaps(row, int(event))
            if not leaps or (row not in found and not self.whole.jump_at(self.t[row])):
                found[row] = int(event)
        return found

    def late(self, row: int) -> float:
        """Return how long after a row parts begin or cease to press that a step ended short of, and
        the next one passed near its start [s]; 0 if none do."""
        if row == self.last:
            return 0.0
        events, step = self.segment.trajectory.events, self.t[row + 1] - self.t[row]
        after = [
            time - self.t[row]
            for time, event in zip(events.times, events.index, strict=True)
            if self.system.events[event].meets and 0 < time - self.t[row] <= PASSED * step
        ]
        return max(after, default=0.0)

    def jumps_in_time(self, row: int, event: int) -> bool:
        """Tell whether y' jumps at an event that does not change with the state."""
        state, slope = self.state(row, self.held[max(row - 1, 0)], True), self.slope_before(row)
        of_state, _ = self.whole.by_state_and_time(self.chart, state, event, slope)
        before, behind = self.sides(row)
        return of_state == 0 and leaps(before[:-1], behind[:-1])

    def sides(self, row: int) -> tuple[np.ndarray, np.ndarray]:
        """Return y' and the cost on both sides of an event; alike where they differ by no more than
        at a kink that the step has not quite come to."""
        state, size = self.state(row, self.held[row - 1], from_left=True), self.t[row]
        before, earlier = self.beside(state, -ASIDE * size)
        behind, later = self.beside(state, ASIDE * size)
        off = max(CLOSE, self.late(row) / size) / ASIDE
        seeming = 2 * off * (np.abs(earlier) + np.abs(later))
        return before, np.where(np.abs(behind - before) <= seeming, before, behind)

    def leaps(self, row: int, event: int) -> bool:
        """Tell whether an event function leaps over zero at a row."""
        state = self.state(row, self.held[max(row - 1, 0)], from_left=True)
        return self.whole.leaps(self.chart, state, event, self.slope_before(row))

    def slope(self, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return y' in a state, and the cost, 0 if there is none."""
        p, cost = self.system.p(self.chart), self.whole.cost
        found = self.system.kernel(self.chart, "motion").flat(y, u, p)
        found[-1] = 0.0
        if cost is not None:
            found[-1] = self.system.kernel(self.chart, "events").flat(y, u, p)[cost]
        return found

    def beside(self, state: Sampling, aside: float) -> tuple[np.ndarray, np.ndarray]:
        """Return y' and the cost at an event from one side, by two instants along the motion
        there, and how they change between these."""
        (y,), (u,) = state.y, state.u
        along, signals = self.slope(y, u)[:-1], self.system.inputs
        times = state.t + aside * np.array([1.0, 2.0])
        inputs = values(signals, times, from_left=aside < 0)
        held = u[inputs.shape[1] :]
        near, far = (
            self.slope(y + d * along, np.concatenate([r, held]))
            for d, r in zip(times - state.t, inputs, strict=True)
        )
        return 2 * near - far, far - near

    def slope_before(self, row: int) -> np.ndarray:
        """Return y' before what happens at a row."""
        state = self.state(row, self.held[row - 1], from_left=True)
        return self.beside(state, -ASIDE * self.t[row])[0][:-1]


def leaps(before: np.ndarray, behind: np.ndarray) -> bool:
    """Tell whether a number of y' jumps."""
    sizes = np.maximum(np.abs(before), np.abs(behind))
    return bool(jumping(before, behind, sizes, SMOOTH, NOISE).any())


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
