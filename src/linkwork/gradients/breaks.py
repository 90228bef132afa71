"""Breaks: where what acts jumps or has a kink, and how steps are told beside them.

Steps end at events. Where what acts jumps at one, or has a kink, slopes are to be those of the
step's own side, all stages included: steps end a little before a break, and begin behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from linkwork.gradients.instants import at_instants, values
from linkwork.gradients.links import Passing
from linkwork.gradients.segment_rows import SegmentRows, leaps
from linkwork.gradients.switches import Switching, require_no_jumps, switching, touching

OFF_JUMPS = 1e-11  # how far off a jump steps end and begin, relative to the step behind
OFF_KINKS, STIFFLY_OFF = 1e-7, 1e-5
"""How far off a kink the slopes of a step are taken, relative to the step, and those of a stiff
one, whose slopes are differentiated, too: kinks are rounded off within rounding. What is integrated
over that step is off by as much of its change."""
NEARER = 2.0**-8
"""Part of a step that is left to a next one before a break, and so on: stages, of lower order than
their step, fall behind its end by as much as their errors, which shrink faster than steps."""
STRAY = 4.0  # how far stages stray, times the square of the step and half the bend of the motion
TICKS, FARTHEST = 2.0**-49, 2.0**-38
"""How far off a jump steps end and begin at least, relative to the time, and at the most where they
end before the event or behind it, relative to the time or the step."""
OF_TIME = 0.1  # part of an event function's rate by the state, below which it is an event of time


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
class Breaks:
    """Tell the breaks of a segment."""

    rows: SegmentRows

    @cached_property
    def jumps(self) -> dict[int, Passing]:
        """Events at which steps end and y' jumps, by row."""
        rows, found = self.rows, {}
        for row, event in rows.cuts.items():
            if not 0 < row < rows.last:
                continue
            before, behind = rows.sides(row)
            jump, n = before - behind, rows.y.shape[1]
            if leaps(before, behind):
                state = rows.state(row, rows.held[row - 1], from_left=True)
                moment = rows.whole.moment(rows.chart, state, event, before[:n])
                found[row] = Passing(moment, jump[:n], float(jump[n]), np.empty(0, int))
        return found

    @cached_property
    def kinks(self) -> set[int]:
        """Rows at which what acts has a kink: steps ended there at events, and nothing jumps."""
        rows = self.rows
        jumping = {0, rows.last, *rows.acts, *self.jumps}
        jumping |= set(np.flatnonzero(np.isin(rows.t, rows.system.inputs.knots)).tolist())
        return rows.cuts.keys() - jumping

    @property
    def inner(self) -> set[int]:
        """Rows within the segment at which steps are taken aside."""
        return self.kinks | self.jumps.keys() if self.rows.cuts else set()

    @cached_property
    def branching(self) -> Switching | None:
        """How what acts branches."""
        return switching(self.rows.system, self.rows.chart, self.rows.whole.cost)

    @cached_property
    def asides(self) -> dict[int, Aside]:
        """How far off kinks and jumps steps end and begin, by row."""
        rows, inner, last = self.rows, self.inner, self.rows.last
        found = {row: self.aside(row, event) for row, event in rows.cuts.items() if row in inner}
        if last and last in {*rows.cuts, rows.end} and self.branching is not None:
            found[last] = self.near(last, last)
        return found

    def aside(self, row: int, event: int) -> Aside:
        """Return how far off the break of an event steps end and begin.

        At a kink they begin as far before its time as those before it end, so that an integral
        has no gap, and in a state moved so that g, the event's function, is that of behind:
        g_y y' moved - g_t begins = (g_y y' + g_t) begins. At a jump, and at a kink that is one of
        time, they go along the motion, and the gap is within rounding.
        """
        rows = self.rows
        state = rows.state(row, rows.held[row], from_left=True)
        slope = rows.slope(state.y[0], state.u[0])[:-1]
        of_state, of_time = rows.whole.by_state_and_time(rows.chart, state, event, slope)
        if row in self.jumps or not abs(of_state) > OF_TIME * abs(of_time):
            return self.near(row, row + 1)
        step = rows.t[row + 1] - rows.t[row]

        def of(off: float, earlier: float) -> Aside:
            moved = off * (1 + 2 * of_time / of_state)
            return Aside(ends=off, begins=-off, moved=moved, earlier=earlier)

        off = (STIFFLY_OFF if rows.stiff else OFF_KINKS) * step
        return self.beyond(row, off + rows.late(row), of)

    def near(self, row: int, after: int) -> Aside:
        """Return how far off a jump steps end and begin; after: the row that a step near it ends
        at."""
        t = self.rows.t
        off = max(OFF_JUMPS * (t[after] - t[after - 1]), TICKS * t[row])
        return self.beyond(row, off, lambda off, earlier: Aside(off, off, off, earlier))

    def beyond(self, row: int, off: float, of: Callable[[float, float], Aside]) -> Aside:
        """Return how far off a break steps end and begin, `off` [s] or farther: steps end at events
        but for rounding, and where they begin what acts is to have other modes than where those
        before end. of: what that is, by how far off, and how much earlier the last step begins."""
        t = self.rows.t
        farthest = FARTHEST * max(t[row], t[row] - t[row - 1])
        while True:
            found = of(*self.room(row, off))
            if self.branching is None or off > farthest or self.changes(row, found):
                return found
            off *= 4

    def changes(self, row: int, aside: Aside) -> bool:
        """Tell whether what acts has other modes behind a break than before it."""
        rows, of, p = self.rows, self.branching, self.rows.system.p(self.rows.chart)
        assert of is not None
        held = rows.held[max(row - 1, 0)], rows.held[row]
        before, behind = (
            of.kernel.flat(np.concatenate([y, values(rows.system.inputs, t, side)[0], h]), p)
            for (t, y), side, h in zip(
                (self.before(row, aside), self.behind(row, aside)), (True, False), held, strict=True
            )
        )
        return bool((before[: of.modes] != behind[: of.modes]).any())

    def room(self, row: int, off: float) -> tuple[float, float]:
        """Return how far before a break the last step may end, `off` at most, and how much earlier
        it begins for that: it would begin within the break where it is as short, as one is that is
        left of a step that ended within rounding before it."""
        t = self.rows.t
        if t[row] - t[row - 1] > 2 * off:
            return off, 0.0
        fixed = {0, *self.rows.acts, *self.inner}
        if row - 1 in fixed or t[row - 1] - t[row - 2] <= 2 * off:
            return min(off, (t[row] - t[row - 1]) / 2), 0.0
        return off, off

    def behind(self, row: int, aside: Aside) -> tuple[np.ndarray, np.ndarray]:
        """Return time (1,) and state at which the step behind a break begins."""
        return self.rows.t[[row]] + aside.begins, self.moved(row, aside.moved)

    def before(self, row: int, aside: Aside) -> tuple[np.ndarray, np.ndarray]:
        """Return time (1,) and state at which the step before a break ends."""
        slope = self.rows.slope_before(row)
        return self.rows.t[[row]] - aside.ends, self.rows.y[row] - aside.ends * slope

    def moved(self, row: int, by: float) -> np.ndarray:
        """Return the state of a row moved along the motion from there on [s]."""
        rows = self.rows
        u = rows.state(row, rows.held[row]).u[0]
        return rows.y[row] + by * rows.slope(rows.y[row], u)[:-1]

    def beside_breaks(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        """Return times and states of the rows from a to b, so that slopes are those of the own
        side of kinks and jumps: steps end before one, and begin there in a state behind it."""
        t, y = self.rows.t[a : b + 1], self.rows.y[a : b + 1]
        if not self.asides:
            return t, y
        t, y = t.copy(), y.copy()
        if a in self.asides:
            t[:1], y[0] = self.behind(a, self.asides[a])
        if b in self.asides:
            t[-1:], y[-1] = self.before(b, self.asides[b])
            if (earlier := self.asides[b].earlier) > 0:
                t[-2], y[-2] = t[-2] - earlier, self.moved(b - 1, -earlier)
        return t, y

    def graded(self, a: int, b: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times and states of the rows from a to b beside breaks, and the places of the rows
        among them: steps that end near before a break at b are divided, ever finer towards it, so
        that all stages of each part are on its side."""
        t, y = self.beside_breaks(a, b)
        places = np.arange(len(t))
        if b not in self.asides:
            return t, y, places
        left, continued = self.rows.t[b] - t, self.continues(b)
        for i in np.flatnonzero(left[1:] < np.diff(t))[::-1]:
            bend = self.bend(a + i, b) if continued else 0.0
            times = self.rows.t[b] - parts(left[i], 4 * left[i + 1], bend)
            if continued and len(times):
                inner = self.rows.within(a + i, times)
            else:
                inner = self.cubic(a + i, t[i : i + 2], y[i : i + 2], times)
            y, places[i + 1 :] = np.insert(y, i + 1, inner, axis=0), places[i + 1 :] + len(times)
            t = np.insert(t, i + 1, times)
        return t, y, places

    def continues(self, row: int) -> bool:
        """Tell whether y' does not jump at a break, but what is paid may: then a run's step up to
        it may have stages behind it, and has the right dense output."""
        if row in self.kinks:
            return True
        before, behind = self.rows.sides(row)
        return not leaps(before[:-1], behind[:-1])

    def bend(self, row: int, last: int) -> float:
        """Return how fast the rate of the event function at the last row has changed since another
        one, relative to itself [1/s]."""
        rows = self.rows
        event = rows.ended_by if last == rows.end else rows.cuts[last]
        first, end = rows.state(row, rows.held[row]), rows.state(last, rows.held[last - 1], True)
        slopes = rows.slope(first.y[0], first.u[0])[:-1], rows.slope_before(last)
        begun, ended = (
            sum(rows.whole.by_state_and_time(rows.chart, state, event, slope))
            for state, slope in zip((first, end), slopes, strict=True)
        )
        with np.errstate(divide="ignore", invalid="ignore"):  # an event that touches zero
            return abs(ended - begun) / (abs(ended) * (rows.t[last] - rows.t[row]))

    def cubic(self, row: int, t: np.ndarray, y: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return states within the step from a row, whose ends are t (2,) and y (2, n)."""
        rows = self.rows
        given = values(rows.system.inputs, t[:1], from_left=False)[0]
        start = rows.slope(y[0], np.append(given, rows.held[row]))[:-1]
        return cubic(t, y, np.stack([start, rows.slope_before(row + 1)]), times[:, None])

    def require_no_others(self) -> None:
        """Refuse a segment within whose steps what acts jumps: where they begin, where their stages
        look, and where they end, all on the step's own side of what happens at its ends."""
        branching = [
            own for own in (self.branching, touching(self.rows.system, self.rows.chart)) if own
        ]
        if not branching or not self.rows.last:
            return
        rows, inputs, ends = self.rows, self.rows.system.inputs, self.own_sides()
        p = rows.system.p(rows.chart)
        # The inputs at both ends, and at the stages between.
        nodes = np.unique([0.0, *rows.plans[0].c, 1.0])
        t = ends.t[0][:, None] + np.diff(ends.t, axis=0)[0][:, None] * nodes
        t[:, -1] = ends.t[1]
        r = values(inputs, t.ravel(), from_left=True).reshape(*t.shape, -1)
        r[:, 0] = values(inputs, t[:, 0], from_left=False)
        u = np.concatenate([r, np.repeat(rows.held[:-1, None], t.shape[1], axis=1)], axis=2)
        # The states there, by the slopes at both ends.
        motion = rows.system.kernel(rows.chart, "motion")
        edges = np.concatenate([ends.y, np.stack([u[:, 0], u[:, -1]])], axis=2)
        slopes = np.concatenate(at_instants(motion, edges, p), axis=2)[:, :, : ends.y.shape[2]]
        y = cubic(ends.t[:, :, None, None], ends.y[:, :, None], slopes[:, :, None], t[:, :, None])
        fixed = not rows.plans[0].exponent
        for own in branching:
            require_no_jumps(own, p, t, np.concatenate([y, u], axis=2), fixed)

    def own_sides(self) -> StepEnds:
        """Return where all steps begin and end, those at events on their own side of these."""
        rows = self.rows
        t, y = (np.stack([part[:-1], part[1:]]) for part in (rows.t, rows.y))
        for row in {*rows.cuts, *self.asides}:
            aside = self.asides.get(row) or self.near(row, min(row + 1, rows.last))
            if row < rows.last:
                t[0, row : row + 1], y[0, row] = self.behind(row, aside)
            if row:
                t[1, row - 1 : row], y[1, row - 1] = self.before(row, aside)
        return StepEnds(t, y)


def parts(left: float, least: float, bend: float) -> np.ndarray:
    """Return what is left of a way to a break behind each of its parts [s], of which all stages are
    before it: those of a part p are up to STRAY bend p^2 off, which is left, or half of it."""
    found = []
    while True:
        share = 1 - 2 / (1 + np.sqrt(1 + 4 * STRAY * bend * left))
        left *= min(0.5, max(NEARER, share))
        if left < least:
            return np.array(found)
        found.append(left)


class StepEnds(NamedTuple):
    """Where K steps begin and end: times (2, K) and states (2, K, n)."""

    t: np.ndarray
    y: np.ndarray


def cubic(t: np.ndarray, y: np.ndarray, slopes: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return states at times within a step, by those and the slopes at its ends (2, ...)."""
    h = t[1] - t[0]
    chord, left = (y[1] - y[0]) / h, (t[1] - times) / h
    bend = left * (1 - left) * ((slopes[1] - chord) * (1 - left) - (slopes[0] - chord) * left)
    return y[1] - h * (left * chord + bend)
