"""Many robots that are stepped on together, a member in each lane of the vector registers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import among, by_name, count, shown
from linkwork.errors import LinkworkError
from linkwork.model import checks
from linkwork.model.chart_transfer import reread
from linkwork.model.charts import CompiledChart
from linkwork.model.closing import settled
from linkwork.model.parameters import with_parameters
from linkwork.model.state import State
from linkwork.runs.cable_leaps import gaps, leaps, may_leap, tell_leaps
from linkwork.runs.members import Members, forces_of_each, members, require_closed
from linkwork.runs.passage import RECOVERED, SOFT
from linkwork.runs.running import EXAMPLE
from linkwork.runs.settings import Settings
from linkwork.runs.side_by_side import Stands, begun, in_better_charts, lowered, pivots
from linkwork.runs.system import require_starts
from linkwork.simulation import FIXED, MethodName, Status
from linkwork.simulation.compiled import entry_of
from linkwork.stepping.admitted import is_free, require_counted, require_room
from linkwork.stepping.errors import StepError
from linkwork.stepping.given_to_many import (
    Index,
    as_events,
    forces_given,
    require_states,
    which_of,
)
from linkwork.stepping.held_members import OK, HeldMembers
from linkwork.stepping.long_steps import LongestStep, longest_step
from linkwork.stepping.native_block import (
    LEFT,
    LIMIT,
    NUMBER,
    ORIGIN,
    SLACK,
    TURNED,
    WHEN,
    WRITTEN,
    Herd,
)
from linkwork.stepping.native_many import steps
from linkwork.stepping.native_readings import ReadingTables
from linkwork.stepping.seen_turns import require_followed, seen
from linkwork.stepping.stepper import NONE, ROUNDING, Stepper, portions_taken
from linkwork.threads import usable_processors

if TYPE_CHECKING:
    from linkwork.control import Drive, Wrench
    from linkwork.control.tracing import Law
    from linkwork.model.model import Model
    from linkwork.runs.system import Forces

SINGULAR = int(Status.SINGULAR)
STEPS = entry_of(steps)
LOOKED = 16  # members at most of which the longest stable step is found


class Steppers(HeldMembers):
    """Step N robots on together, dt at a time, each under its own forces.

    Made by `Robot.stepper` of a stack of states. A member does what a `Stepper` does alone with the
    same method, "rk4" or "symplectic_euler"; its neighbours do not matter. One whose step cannot be
    taken keeps the state before it and tells why by its `status`; the others go on.

    Attributes:
        y: the states (N, n), of which q (N, nq), v (N, n) and z (N, nz) are views: as of a
            `Stepper`, to be read and written between two steps.
        u: forces of the actuators (N, actuators) that act until others are given [N, N m]; (N, 0)
            where a controller or signals were given.
        status: how each member is (N,), as `Status`: FINISHED, 0, of those that go on; another one
            until the member is `reset`.
        time: of each member (N,) [s].
        parameters: numbers of drives and controllers, by name (N,), to be read and written between
            two steps; those of the robot that were given are told here, too, and may be written
            where they leave the loops closed. Assigning a whole one checks it at once.
        dt: length of a step [s]; threads: over which they are dealt.
    """

    def __init__(
        self,
        robot: Model,
        states: State,
        dt: float,
        forces: Forces = None,
        *,
        drives: Mapping[str, Drive] | None = None,
        wrenches: Sequence[Wrench] = (),
        parameters: Mapping[str, ArrayLike] | None = None,
        readings: Sequence[Law] = (),
        method: MethodName = "rk4",
        threads: int | None = None,
    ):
        self.dt = checks.positive(dt, "dt", "s")
        self.threads = usable_processors() if threads is None else count(threads, "threads")
        if not among(method, FIXED):
            kept = " or ".join(map(repr, FIXED))
            raise LinkworkError(
                f"many robots are stepped on together by {kept}, not by {shown(method)}; make a "
                "stepper of each, robot.stepper(states.at(0), ...), for other methods"
            )
        self._settings = Settings(duration=self.dt, method=method, step=self.dt)
        own, given = forces_of_each(robot, forces)
        if own is not None and not isinstance(own, np.ndarray):
            raise LinkworkError(
                "signals of each robot are no forces of steppers; give those of the moment to step"
            )
        values = by_name(parameters, "parameters", EXAMPLE)
        self._given = {"method": method, "drives": drives, "wrenches": wrenches}
        watched = as_events(readings)
        self._batch = members(
            robot, states, forces, values, drives, wrenches, watched, self.dt, False
        )
        if self._batch.system.sampler is not None:
            raise LinkworkError(
                "a sampled controller is not stepped on in many robots together; make a stepper of "
                "each, robot.stepper(states.at(0), ...), or give it as a controller (t, state)"
            )
        self._forces, self._free = given, is_free(forces)
        self._leaps = leaps(self._batch.robot.mechanism)
        self._furnish(own)
        self.reset()

    def __repr__(self) -> str:
        name, on = self._batch.robot.mechanism.name, int((self.status == OK).sum())
        return f"Steppers({name!r}, {len(self)} robots, {on} go on, dt = {self.dt:g} s)"

    def __reduce__(self) -> NoReturn:
        raise LinkworkError(
            "steppers cannot be copied or pickled: they hold compiled code and its memory; send "
            "steppers.states, and make others of these"
        )

    def step(
        self,
        u: ArrayLike | None = None,
        steps: int = 1,
        out: np.ndarray | None = None,
        index: Index | None = None,
    ) -> np.ndarray:
        """Take one step, or some, of all members that go on, and return the states (N, n).

        Args:
            u: forces of the actuators (N, actuators), or (actuators) for all [N, N m], which act
                over all of the steps; those of before if left out. Of numbers that are not finite
                the member is told, by its status.
            steps: how many. Ctrl-C ends a great many between two of them, from where the steppers
                can go on.
            out: where to write the states; a new array if left out. With the steppers' own y no
                number is copied.
            index: which of them: numbers, a slice, or a mask (N,); all if left out. The others stay
                where they are.

        Raises:
            LinkworkError: forces that do not fit; signals that end; parameters that were written
                and that nothing may have; they are refused before anything happens.
        """
        steps = count(steps, "steps")
        if out is not None and out is not self.y:
            require_room(out, self.y.shape)
        self.parameters.require()
        if u is not None:
            self._command(u)
        self._require_signals(steps)
        who = slice(None) if index is None else which_of(index, len(self))
        if steps > self._portion:
            steps = portions_taken(partial(self._take, who), steps, self._portion)
        self._take(who, steps)
        if out is None:
            return self.y.copy()
        if out is not self.y:
            out[:] = self.y
        return out

    def step_and_tell(self, told: ReadingTables, steps: int = 1, *, idle: np.ndarray) -> bool:
        """Take one step, or some, as `step`, and write what the `readings` say of all members then.

        Args:
            told: where to write it: the first readings to its `rows` (N, first), the others to its
                `columns` (others, N).
            steps: how many.
            idle: numbers of members that stay where they are.

        Returns:
            Whether all that was written is finite.

        Raises:
            LinkworkError: signals that end; refused before anything happens.
        """
        self._require_signals(steps)
        if not self._leaps and steps <= self._portion and not self.status.any():
            return self._go_on(slice(None), steps, told, idle)
        who = np.delete(np.arange(len(self)), idle)
        self._take(who, portions_taken(partial(self._take, who), steps, self._portion))
        return self.tell(told)

    def _take(self, who: np.ndarray | slice, steps: int) -> None:
        """Take so many steps of members, of those that go on."""
        if not self._leaps:
            self._go_on(who, steps)
            return
        for _ in range(steps):
            self._beside_leaps(who)

    def _beside_leaps(self, who: np.ndarray | slice) -> None:
        """Take one step of members of which cables may leap: who comes near that takes it as a
        `Stepper` would, and where it ends there keeps the state before it."""
        herd, charts, running = self._herd, self._of.copy(), self.status == OK
        before, q = Herd(*(part.copy() for part in herd)), self.q.copy()
        self._go_on(who, 1)
        robot, p = self._batch.robot, self._batch.p_robot()
        seen = [gaps(robot, place, p) for place in (q, (q + self.q) / 2, self.q)]
        for i in np.flatnonzero(running & may_leap(*seen)).tolist():
            after, chart = Herd(*(part[..., i].copy() for part in herd)), self._of[i]
            self._set(i, Herd(*(part[..., i] for part in before)), charts[i])
            try:
                self.alone(i).step()
                self._set(i, after, chart)
            except StepError as error:
                herd.status[i], self._teams = int(error.status), None

    def _set(self, i: int, column: Herd, chart: int) -> None:
        """Put a member back to a column of numbers, and to its chart."""
        for part, own in zip(self._herd, column, strict=True):
            part[..., i] = own
        self._of[i], self._teams, self._lowered = chart, None, True

    def _go_on(
        self,
        who: np.ndarray | slice,
        steps: int,
        told: ReadingTables | None = None,
        idle: Sequence[int] | np.ndarray = (),
    ) -> bool:
        """Take so many steps of members, of those that go on and are not idle, whatever happens
        within; write what is to be told of all, and return whether it is finite."""
        left = self._herd.numbers[LEFT]
        left[:] = 0
        left[who] = steps
        if len(idle):
            left[idle] = 0
        # Charts are changed where they weaken, and lowered bounds looked at, until nobody has steps
        # left.
        later = self._held_back()
        stopped, finite = self._dealt(self._running(), told)
        while stopped or later.any():
            if stopped:
                self._teams = None
                self._change_charts()
            self._raise_bounds()
            left[: later.size] += later
            later = self._held_back()
            on = [(chart, who[left[who] > 0]) for chart, who in self._running()]
            stopped, well = self._dealt([(chart, who) for chart, who in on if who.size], told)
            finite &= well
        self._raise_bounds()
        return finite

    def _held_back(self) -> np.ndarray:
        """Take from members under a lowered bound the steps that are left behind the one after
        which it is looked at, and return how many (N,)."""
        if not self._lowered:
            return NONE
        numbers, N = self._herd.numbers, len(self)
        low = (numbers[LIMIT, :N] < SOFT) & (self.status == OK)
        # Of those that compiled code has put where others are it is not known when.
        lost = low & (self._look <= numbers[NUMBER, :N])
        self._short[lost], self._look[lost] = 1, numbers[NUMBER, :N][lost] + 1
        over = np.where(low, numbers[LEFT, :N] - (self._look - numbers[NUMBER, :N]), 0.0)
        numbers[LEFT, :N] -= np.maximum(over, 0.0)
        return np.maximum(over, 0.0)

    @property
    def longest_step(self) -> LongestStep:
        """The longest step that is stable where the members stand, of which some are looked at: as
        of a `Stepper`."""
        some = np.unique(np.linspace(0, len(self) - 1, LOOKED).astype(int)) if len(self) else ()
        return min((self._longest_step(i) for i in some), default=LongestStep())

    def _longest_step(self, i: int) -> LongestStep:
        """Return the longest stable step of a member."""
        u = self._batch.inputs_at(np.array([i]), self.time[[i]], np.empty((1, 0)))[0]
        p, y = (np.ascontiguousarray(part[:, i]) for part in (self._herd.p, self._herd.y))
        chart, method = self.chart(i), self._settings.integrator
        return longest_step(self._batch.system, chart, y, u, p, method)

    def alone(self, index: int) -> Stepper:
        """Return a `Stepper` of the member at an index as it is: its `run` is told in all
        quantities, and where the member ended its `step` raises why."""
        i, batch = self._one(index), self._batch
        robot, chart = batch.robot, self.chart(i)
        values = {name: float(given[i]) for name, given in self.parameters.items()}
        own = {name: values.pop(name) for name in list(values) if name in robot.parameters}
        robot = with_parameters(robot, own) if own else robot
        forces = self.u[i].copy() if self._free else self._forces
        given: dict[str, Any] = {**self._given, "parameters": values or None}
        q = np.ascontiguousarray(self.q[i])
        robot.charts.setdefault(chart.independent, chart)
        state = robot.make_state(q, np.ascontiguousarray(self.v[i]))
        turned = seen(robot, batch.system, state.positions, self._seen[i], self.z[i])
        state = replace(state, positions=turned, independent=chart.independent)
        stepper = Stepper(robot, state, self.dt, forces, **given)
        stepper.reset(state, float(self.time[i]))
        stepper.z[:] = self.z[i]
        return stepper

    def reset(
        self, index: Index | None = None, state: State | None = None, time: ArrayLike = 0.0
    ) -> None:
        """Put members at states, with extra states of drives and controllers as at a start, and the
        forces of the start.

        Args:
            index: which: a number, a slice, numbers, or a mask (N,); all if left out.
            state: one for all of them, or a stack of as many; those that they were made with if
                left out.
            time: [s].

        Raises:
            LinkworkError: what does not fit; nobody is moved then.
        """
        who = which_of(index, len(self))
        times = checks.finite(time, "time")
        if times.shape not in ((), who.shape) or (times < 0).any():
            raise LinkworkError(
                f"time {shown(time)} does not fit; give one from 0 s on, or one for each of "
                f"{who.size} robots"
            )
        require_counted(float(times.max(initial=0.0)), self.dt)
        batch = self._some(who, state)
        require_closed(batch.robot, np.ascontiguousarray(batch.q), batch.p_robot(), who)
        for stands in begun(batch, self._settings):
            q, v, z = np.split(stands.y, [self.q.shape[1], self.q.shape[1] + self.v.shape[1]], 1)
            p = batch.p_robot(stands.members)
            kernel = stands.chart.kernel("closure_step")
            q, _ = settled(kernel, np.ascontiguousarray(q), p, self._asked.closure_tol)
            self._enter(stands.chart, who[stands.members], np.concatenate([q, v, z], 1))
        self._herd.turns[:, who], self._herd.u[:, who] = 0.0, self._first[who].T
        self._herd.numbers[TURNED, who] = 0.0
        self._start(who, np.broadcast_to(times, who.shape))
        self._short[who] = 1
        self._seen[who] = batch.given.positions

    def _some(self, who: np.ndarray, state: State | None) -> Members:
        """Return what some members go out from: what they did at first, or other states."""
        batch = self._batch
        p = batch.p[who] if len(batch.p) > 1 else batch.p
        if state is None:
            given = batch.given.at(who) if batch.given.batch else batch.given
            told, q, v = batch.told[who], batch.q[who], batch.v[who]
            return replace(batch, given=given, told=told, q=q, v=v, p=p, forces=None)
        robot, given = batch.robot, require_states(batch.robot, state, who.size)
        require_starts(batch.system, given, p[:, robot.p.size :])
        require_followed(robot, batch.system, given)
        tell_leaps(robot, given.q, p[:, : robot.p.size])
        q, v = (np.broadcast_to(x, (who.size, x.shape[-1])).copy() for x in (given.q, given.rates))
        chart, told = robot.chart_of(given), np.ones(who.size, bool)
        if chart is robot.chart and chart is not robot.run_chart:
            own = np.ascontiguousarray(p[:, : robot.p.size])
            v, told = reread(robot, chart, robot.run_chart, q, v, own)
            chart = robot.run_chart
        return replace(batch, given=given, chart=chart, told=told, q=q, v=v, p=p, forces=None)

    def _start(self, who: np.ndarray, time: np.ndarray) -> None:
        """Put members at times: steps end at multiples of dt, of a start beside them so many after
        it."""
        number = np.rint(time / self.dt)
        beside = np.abs(time - number * self.dt) > ROUNDING * self.dt
        numbers = self._herd.numbers
        numbers[WHEN, who], numbers[SLACK, who] = time, 1.0
        numbers[ORIGIN, who] = np.where(beside, time, 0.0)
        numbers[NUMBER, who], numbers[WRITTEN, who] = np.where(beside, 0, number), 0.0

    def _dealt(
        self, teams: Sequence[tuple[CompiledChart, np.ndarray]], told: ReadingTables | None
    ) -> tuple[int, bool]:
        """Take the steps that are left of members; return how many had to stop, and whether what is
        told of them is finite."""
        stopped, finite = 0, True
        for chart, who in teams:
            motion, closure, reading = self._codes(chart)
            given = motion, closure, *self._inputs, self._herd, self._asked
            then = (0, self._untold) if told is None else (reading, told)
            work = partial(self._share, given, then)
            for number, well in self._shared(work, who):
                stopped, finite = stopped + number, finite and well
        return stopped, finite

    @staticmethod
    def _share(given: tuple, then: tuple, share: np.ndarray) -> tuple[int, bool]:
        """Take the steps of a share of members."""
        return STEPS(*given, share, *then)

    def _change_charts(self) -> None:
        """Let members whose pivots have weakened go on in better charts, or under a lower bound;
        those for whom there is none are left where they stopped."""
        herd = self._herd
        for chart, who in self._grouped(np.flatnonzero(self.status == SINGULAR)):
            # q that was written may lie where the pivots have other signs.
            faced = herd.numbers[WRITTEN, who] > 0
            for i in who[faced].tolist():
                own = chart.facing(np.ascontiguousarray(herd.held[: self.q.shape[1], i]))
                self._enter(own, np.array([i]), herd.held[:, [i]].T)
                herd.numbers[WRITTEN, i] = 0.0
            stands = self._stands(chart, who[~faced])
            better, changed = in_better_charts(self._batch, stands, True)
            for other in better:
                self._enter(other.chart, other.members, other.y)
            # Where nothing is better the bound is lowered, down to the hard one.
            left = lowered(self._batch, stands[np.flatnonzero(~changed)])
            herd.numbers[LIMIT, left.members] = left.bound
            herd.status[left.members], self._lowered = OK, True
            self._look[left.members] = (
                herd.numbers[NUMBER, left.members] + self._short[left.members]
            )

    def _raise_bounds(self) -> None:
        """Raise the bounds that were lowered where the pivots have recovered: it is looked after
        one step, then after two more, and so on, as a `Stepper` does."""
        if not self._lowered:
            return
        limit, number = (self._herd.numbers[row, : len(self)] for row in (LIMIT, NUMBER))
        due = (limit < SOFT) & (self.status == OK) & (number >= self._look)
        for chart, who in self._grouped(np.flatnonzero(due)):
            well = pivots(self._batch, self._stands(chart, who)) > RECOVERED * SOFT
            limit[who[well]] = SOFT
            self._short[who] = np.where(well, 1, 2 * self._short[who])
            self._look[who] = number[who] + self._short[who]
        self._lowered = limit.min(initial=SOFT) < SOFT

    def _stands(self, chart: CompiledChart, who: np.ndarray) -> Stands:
        """Return where members stand in a chart."""
        herd, none = self._herd, np.zeros(who.size, int)
        t, bound = herd.numbers[WHEN, who], herd.numbers[LIMIT, who]
        y, turns = (np.ascontiguousarray(part[:, who].T) for part in (herd.held, herd.turns))
        short = np.full(who.size, self.dt)
        return Stands(chart, who, t, y, turns, none, none + 1, bound, short, np.zeros(who.size))

    def _command(self, u: ArrayLike) -> None:
        """Take forces of all members, or refuse them."""
        names, N = self._batch.robot.actuators, len(self)
        if not self._free:
            raise LinkworkError(
                "the forces of these steppers are those that they were made with, a controller or "
                "signals; step without u, or leave forces out of robot.stepper"
            )
        self.u[:] = forces_given(u, names, N)

    def _require_signals(self, steps: int) -> None:
        """Refuse steps for which signals are not known."""
        end = self._batch.system.inputs.span[1]
        if end < np.inf:
            latest = self.time[self.status == OK].max(initial=0.0)
            if latest + steps * self.dt > end + ROUNDING * self.dt:
                raise LinkworkError(
                    f"what acts is sampled up to {end:g} s, and the last of the robots is at t = "
                    f"{latest:.9g} s; give samples for longer, or reset the robots"
                )
