"""The stepper: a robot that is stepped on by whoever calls, for real time and hardware in the loop.

    y(t + dt) = y(t) + the method's step under the forces u,    y = (q, v, z)

It is a run of `robot.simulate` that stands still between two steps: the same compiled loop, the
same charts.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import among, amount, count
from linkwork.errors import LinkworkError
from linkwork.kernels.from_python import Direct, Ends, call_of, left_to_others
from linkwork.model import chart_transfer, checks
from linkwork.model.state import State
from linkwork.patience import interruptions_held
from linkwork.runs import endings, recording, resuming, running
from linkwork.runs.cable_leaps import tell_leaps
from linkwork.runs.passage import Departure, Segment, Stand, portion
from linkwork.runs.recording import Left
from linkwork.runs.run_record import RunRecord
from linkwork.runs.settings import Settings
from linkwork.runs.system import Forces, require_starts
from linkwork.simulation import (
    FIXED,
    Control,
    MethodName,
    Pace,
    Run,
    Statistics,
    Status,
    Trajectory,
)
from linkwork.simulation.compiled import address_of
from linkwork.simulation.integration import TimeSpan
from linkwork.simulation.variables import Deferred
from linkwork.stepping.admitted import is_free, require_counted, require_one, require_room
from linkwork.stepping.endless import Endless
from linkwork.stepping.errors import StepError
from linkwork.stepping.long_steps import LongestStep, longest_step
from linkwork.stepping.native_run import CELL, NativeRun
from linkwork.stepping.native_stepping import OK, OPEN, PAUSED, UNCOVERED, UNDEFINED, UNFORCED
from linkwork.stepping.seen_turns import require_followed, seen

if TYPE_CHECKING:
    from linkwork.control import Drive, Wrench
    from linkwork.model.model import Model

DOUBLE, NONE = np.dtype(float), np.empty(0)
STEPS = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
ROUNDING = 1e-9  # of a step, within which a time is a multiple of it
KEPT = (
    "The state there is kept: write another one or reset the stepper, or let robot.resume("
    "stepper.run, ...) go on."
)
ONE = 1  # step, the default: what is equal but another object goes the longer way, and is checked


class Stepper:
    """Step a robot on, dt at a time, under forces that are known only then.

    Made by `Robot.stepper`. What happens within a step is what happens in `Robot.simulate` with the
    same method and step: charts change where they weaken, loops are closed, sampled controllers
    act, stops and contacts set in. Steps end at multiples of dt (counted from the start where that
    is none), so that times do not drift.

    Attributes:
        y: the state (q, v, z), of which q, v, z are views: coordinates of the tree (nq), in the
            order of `robot.equations.tree.coordinates`; independent rates (n), in that of
            `independent`, which may change from one step to the next; extra states of drives and
            controllers. These arrays stay the same, and may be read and written between two
            steps. Where q was written its loops are closed with the next step by moving the
            coordinates that are not independent.
        u: forces of the actuators (commands of their drives) that act until others are given
            [N, N m]; empty where a controller or signals were given.
        dt: length of a step [s].

    One thread may use a stepper at a time. It cannot be pickled: `run` can.
    """

    def __init__(
        self,
        robot: Model,
        state: State | Run,
        dt: float,
        forces: Forces = None,
        *,
        drives: Mapping[str, Drive] | None = None,
        wrenches: Sequence[Wrench] = (),
        parameters: Mapping[str, float] | None = None,
        method: MethodName = "rk4",
        rtol: float = 1e-8,
        atol: float = 1e-10,
    ):
        # What is integrated, and how: what `simulate` would take for a run of one step.
        self.dt = checks.positive(dt, "dt", "s")
        fixed = self.dt if among(method, FIXED) else None
        settings = Settings(duration=self.dt, method=method, step=fixed, rtol=rtol, atol=atol)
        begun, left, own = (
            resuming.left_by(robot, state) if isinstance(state, Run) else (state, None, {})
        )
        given = {**own, **(parameters or {})} if own else parameters
        self._robot, self._begun, self._system, self._settings = running.prepared(
            robot, begun, forces, settings, drives, wrenches, given, left
        )
        require_one(self._robot, self._begun)
        self._left = left
        # Where forces are written: to the inputs over time, in each of their pieces.
        inputs, traced = self._system.inputs, self._system.acting
        pieces, _, columns = inputs.coefficients.shape
        self._table, self._free = inputs.table.copy(), is_free(forces)
        powers = self._table[5 + pieces :][: 4 * pieces * columns].reshape(pieces, 4, columns)
        first = int(traced.timed) if traced else 0
        commands = powers[:, 0, first : first + len(self._robot.actuators) * self._free]
        self._pieces = commands if pieces > 1 and self._free else None
        self.u = commands[0] if pieces == 1 else commands[0].copy()
        self._first = self.u.copy()
        # The state that the user sees, and the cells of the compiled stepper.
        equations = self._robot.equations
        nq, n = equations.nq, equations.mobility
        self.y = np.zeros(nq + n + len(self._system.states))
        self.q, self.v, self.z = self.y[:nq], self.y[nq : nq + n], self.y[nq + n :]
        self._cells = np.zeros(len(CELL))
        self._counts = self._cells.view(np.int64)
        self._counts[CELL["u"]], self._counts[CELL["y"]] = (
            array.ctypes.data for array in (self.u, self.y)
        )
        self._counts[CELL["forces"]] = self.u.size
        # The compiled stepper, and where it reads and writes.
        address, self._portion = compiled(settings.integrator.stiff), portion(nq)
        self._cells[CELL["step"]], self._cells[CELL["last"]] = self.dt, inputs.span[1]
        self._places = self.u.ctypes.data, self._cells.ctypes.data
        self._steps = STEPS(address)
        alone = self._free and self._pieces is None
        self._single = self._directly(address) if alone else left_to_others
        self._set_out(self._begun, left, left.time if left else 0.0)

    def __repr__(self) -> str:
        name = self._robot.mechanism.name
        method = self._settings.integrator.name
        return f"Stepper({name!r}, t = {self.time:.9g} s, dt = {self.dt:g} s, {method})"

    def __reduce__(self) -> NoReturn:
        raise LinkworkError(
            "a stepper cannot be copied or pickled: it holds compiled code and its memory; send "
            "stepper.run, and make one of that by robot.stepper(run, dt)"
        )

    def step(
        self,
        u: ArrayLike | Mapping[str, float] | None = None,
        steps: int = ONE,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Take one step, or some, and return the state y = (q, v, z) there.

        Args:
            u: forces of the actuators (actuators) [N, N m], in their order or by name (others
                zero), which act over all of the steps; those of before if left out.
            steps: how many. Ctrl-C ends a great many between two of them, from where the stepper
                can go on.
            out: where to write the state (size of y); a new array if left out. With the stepper's
                own y no number is copied.

        Raises:
            StepError: a step that cannot be taken, with the time and what to do. The state is that
                after the last step that could be taken.
            LinkworkError: forces that do not fit; they are refused before anything happens.
        """
        # One step the shortest way.
        if steps is ONE and (out is None or out is self.y):
            y = self._single(self.u if u is None else u)
            if y is None and (code := self._told()):  # the step was not taken as a whole
                self._attend(code)
                y = self.y.copy()
            if y is not None:
                return y if out is None else out
        # Else the forces are written, and steps are taken in portions.
        steps = count(steps, "steps")
        if out is not None and out is not self.y:
            require_room(out, self.y.shape)
        if u is not None:
            if (
                type(u) is np.ndarray
                and u.shape == self.u.shape
                and u.dtype is DOUBLE
                and self._free
            ):
                self.u[:] = u
            else:
                self._command(u)
        if self._pieces is not None:
            self._pieces[:] = self.u
        if steps > self._portion:
            steps = portions_taken(self._take, steps, self._portion)
        self._take(steps)
        # The state goes where it is asked for.
        if out is None:
            return self.y.copy()
        if out is not self.y:
            out[:] = self.y
        return out

    @property
    def time(self) -> float:
        """When it is [s]."""
        return self._run.time

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the rates that v holds: those in which the motion is told best where it is."""
        return self._stand.chart.independent

    @property
    def closure_error(self) -> float:
        """The largest |phi(q)| at the present state."""
        closure = self._stand.chart.single("closure_step")
        return closure.flat(self.q, self._robot.p).item(-1)

    @property
    def longest_step(self) -> LongestStep:
        """The longest step that is stable where the robot stands: `step` [s], and what bounds it,
        by `name`, with how quickly it answers, `rate` [1/s]."""
        if self._settings.integrator.step is None:
            return LongestStep()
        chart, control, u = self._stand.chart, self._stand.control, self._system.inputs(self.time)
        u, p = np.append(u, control.held if control else ()), self._system.p(chart)
        return longest_step(self._system, chart, self.y, u, p, self._settings.integrator)

    @property
    def positions(self) -> np.ndarray:
        """Coordinates of all joints (m) [m, rad], as encoders tell them.

        Whole turns of angles of joints that close loops are followed from step to step where a
        controller or drive reads them, else from one asking to the next.
        """
        read = self._robot.kernel("positions").flat(self.q, self._robot.p)
        self._seen = seen(self._robot, self._system, read, self._seen, self.z)
        return self._seen

    @property
    def rates(self) -> np.ndarray:
        """Rates of all joints (m) [m/s, rad/s]."""
        chart, q, v = self._stand.chart, self.q, self.v
        if chart.told():
            return chart.joints_moving(q[None], v[None], 0 * v[None], chart.p, True)[1][0]
        kernel, m = chart.kernel("joints_motion"), len(self._robot.coordinates)
        return kernel.flat(q, v, 0 * v, chart.p)[m : m + len(self._robot.rates)]

    @property
    def state(self) -> State:
        """The present state, in the robot's own independent rates where these tell its motion, else
        in those of v; turns as of `positions`."""
        return self._record().final()

    @property
    def run(self) -> Run:
        """A `Run` of the present state alone, from which `Robot.resume` goes on, or another
        stepper."""
        record, segments = self._record(), [self._segment(Status.FINISHED)]
        done = segments[0].trajectory
        told = endings.asked(self._robot, self._system, self._settings)
        told |= endings.told(self._system, segments) | record.final_windings()
        return Run(
            variables=record,
            coords=Deferred({recording.COORDS: record.coords}),
            attrs=told,
            status=Status.FINISHED,
            message=Status.FINISHED.sentence(time=self.time),
            statistics=Statistics(0, 0, 0, 0, done.closure_error, done.pivot, done.pivot_time),
            ended=record.final,
            every=True,
        )

    def reset(self, state: State | None = None, time: float | None = None) -> None:
        """Put the stepper at a state, with extra states and controllers as at a start, and no
        forces.

        Args:
            state: of the robot; the one that the stepper was made with if left out, with what a run
                had left there.
            time: [s]; that at which it was made if left out.

        Raises:
            LinkworkError: as `Robot.stepper`; the stepper is then where it was.
        """
        begun, left = self._begun, self._left
        if state is not None:
            require_one(self._robot, state)
            begun, left = self._robot.own(state), None
            if self._system.acting is not None:
                require_starts(self._system, begun, self._system.parameters)
                require_followed(self._robot, self._system, begun)
                tell_leaps(self._robot, begun.q, self._robot.p)
        if time is not None:
            time = require_counted(checks.number(time, "time"), self.dt)
        elif self._left is not None:
            time = self._left.time
        self._set_out(begun, left, time or 0.0)
        self.u[:] = self._first

    def _set_out(self, state: State, left: Left | None, time: float) -> None:
        """Begin at a state, with what a run had left there."""
        robot, system = self._robot, self._system
        _, z, pace, held, turns, last, lowered, _ = left or (time, *[None] * 7)
        fixed, sampler = self._settings.integrator.step is not None, system.sampler
        control = Control(0, sampler.period, held) if held is not None and sampler else None
        passage = Endless(robot, system, time, np.inf, self._settings, None if fixed else pace)
        chart, v = chart_transfer.start(robot, state, last)
        z = system.start(robot, state.positions, state.q, z)
        stand = passage.departed(Departure(chart, state.q, v, z, control, turns, lowered))
        self._enter(passage, stand, passage.pace)
        # Steps end at multiples of dt; of a start beside them, so many after it.
        number = round(time / self.dt)
        beside = abs(time - number * self.dt) > ROUNDING * self.dt
        self._cells[CELL["origin"]] = time if beside else 0.0
        self._counts[CELL["number"]] = 0 if beside else number
        self._seen = state.positions

    def _enter(self, passage: Endless, stand: Stand, pace: Pace | None = None) -> None:
        """Go on from a stand: in its chart, under its bound of the pivot."""
        problem = passage.problem(stand.chart, stand.method, self._system.inputs)
        span = stand.t, stand.t + self.dt, stand.bound, self._settings.max_steps
        going_on = np.empty(0), pace, stand.control, stand.turns
        y, covered = np.concatenate((stand.q, stand.v)), TimeSpan(stand.q.size, *span, *going_on)
        begun = NativeRun(problem, y, covered, self._table)
        if begun.status is not Status.FINISHED:
            message = begun.trajectory(begun.status).message
            raise StepError(message, begun.status, stand.t)
        self._passage, self._run = passage, begun
        self._stand = stand._replace(steps=self._settings.max_steps)
        self._counts[CELL["run"]], self._counts[CELL["written"]] = begun.address, 0
        self._cells[CELL["until"]] = passage.until(stand)
        self.y[:] = begun.seen

    def _command(self, u: ArrayLike | Mapping[str, float]) -> None:
        """Take forces that are not simply an array of them, or refuse them."""
        names = self._robot.actuators
        if not self._free:
            raise LinkworkError(
                "the forces of this stepper are those that it was made with, a controller or "
                "signals; step without u, or leave forces out of robot.stepper"
            )
        by_name = isinstance(u, Mapping)
        given = (
            checks.actuator_forces(u, names)
            if by_name
            else checks.values_by_name(u, names, "forces", "actuator")
        )
        if given.shape != self.u.shape:
            raise LinkworkError(
                f"forces has shape {given.shape}; give {amount(len(names), 'number')}: "
                f"{', '.join(names)}"
            )
        self.u[:] = given

    def _take(self, steps: int) -> None:
        """Take so many steps."""
        if code := self._stepped(steps):
            self._attend(code)

    def _stepped(self, steps: int) -> int:
        """Take so many compiled steps; return OK, or why not all of them could be taken."""
        self._counts[CELL["count"]] = steps
        self._steps(*self._places)
        self._counts[CELL["count"]] = 1
        return self._told()

    def _told(self) -> int:
        """Return what came of compiled steps, once."""
        code = self._counts.item(CELL["code"])
        self._counts[CELL["code"]] = OK
        return code

    def _directly(self, address: int) -> Direct:
        """Return a call that takes forces, one step, and copies the state."""
        self._counts[CELL["count"]] = 1
        well, y = self._cells.ctypes.data + 8 * CELL["well"], self.y.ctypes.data
        ends = Ends(self._places[1], y, self.y.shape, well, 0.0, False, True)
        memory = self._cells, self.y, self.u
        return call_of(address, (self.u.size,), NONE, ends, *memory) or left_to_others

    def _attend(self, code: int) -> None:
        """Do what compiled steps were left for, and take those that are left; refuse where none can
        be taken."""
        while code:
            self._refuse_given(code)
            # What was done is told as that of a run; where a function failed, nothing goes on.
            status = Status.FINISHED if code == PAUSED else Status(code)
            faults, done = self._system.faults, self._run.trajectory(status)
            if faults:
                fault = faults.pop()
                faults.clear()
                status = Status.CALLBACK_FAILED
                told = f"{type(fault).__name__}: {fault}"
                sentence = status.sentence(time=self.time, error=told)
                raise StepError(sentence, status, self.time) from fault
            written = self._counts[CELL["written"]] and status is Status.SINGULAR
            self._stand.chart.count(done.nfev)
            left = self._onward(done, written=bool(written))
            self._enter(self._passage, left)
            code = self._stepped(self._counts.item(CELL["left"]))

    def _onward(self, done: Trajectory, written: bool) -> Stand:
        """Return where to go on; written: whether q was put where the chart's pivots may have other
        signs."""
        here, passage = self._stand, self._passage
        if written:
            faced = passage.faced(here.chart, done.q_end)
            if faced is not here.chart:
                return here._replace(
                    chart=faced, t=done.end_time, q=done.q_end, v=done.v_end, turns=done.turns,
                    control=self._system.control(faced, done.control),
                )  # fmt: skip
        stand = passage.after(here, done)
        if stand is None:
            _, message = endings.ended(self._system, self._segment(done.status))
            raise StepError(f"{message} {KEPT}", done.status, done.end_time)
        return stand

    def _refuse_given(self, code: int) -> None:
        """Refuse what the user has written or given."""
        time = self.time
        if code == UNFORCED:
            checks.finite(self.u, "forces")
        if code in (UNDEFINED, OPEN):
            written, self.y[:] = self.y.copy(), self._run.seen
            checks.finite(written, "the y that was written to the stepper")
            raise StepError(
                "the loops do not close at the q that was written, however the dependent "
                "coordinates are moved, and the state is what it was; write a q nearer to a closed "
                "configuration, or reset the stepper to a state of robot.assemble",
                Status.CLOSURE_LOST,
                time,
            )
        if code == UNCOVERED:
            raise StepError(
                f"what acts is sampled up to {self._system.inputs.span[1]:g} s, and the stepper is "
                f"at t = {time:.9g} s; give samples for longer, or reset the stepper",
                Status.FINISHED,
                time,
            )

    def _segment(self, status: Status) -> Segment:
        """Return the present state as the end of what was done in its chart."""
        chart, done = self._stand.chart, self._run.trajectory(status)
        start = done.end_time, done.q_end, done.v_end

        def again(save_at: np.ndarray | None, row: int) -> Trajectory:
            return done if save_at is None else replace(done, rows=done.rows[: len(save_at)])

        name, lowered = self._stand.method.name, self._passage.lowered(self._stand)
        return Segment(chart, done, start, name, again, lowered=lowered)

    def _record(self) -> RunRecord:
        """Return what tells all quantities of the present state."""
        home = self._robot.home
        named = home.coordinates, home.independent
        begun = State.known(self.positions, home.rates, self.q.copy(), *named)
        segments = [self._segment(Status.FINISHED)]
        return RunRecord(self._robot, self._system, segments, np.empty(0), begun, True)


def portions_taken(take: Callable[[int], None], steps: int, most: int) -> int:
    """Take steps in portions, between which Ctrl-C is heard; return how many the last one has,
    which is left to do."""
    while steps > most:
        with interruptions_held() as came:
            take(most)
        if came():
            raise KeyboardInterrupt
        steps -= most
    return steps


@cache
def compiled(stiff: bool) -> int:
    """Return the address of the steps of a kind of methods; the first time compiles them."""
    if stiff:
        from linkwork.stepping.native_stiff import steps
    else:
        from linkwork.stepping.native_explicit import steps
    return address_of(steps)
