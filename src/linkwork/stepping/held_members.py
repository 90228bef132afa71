"""What many robots that are stepped on together are: columns of arrays, and their charts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import wait
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from linkwork.checks import amount, shown
from linkwork.errors import LinkworkError
from linkwork.model.chart_transfer import reread
from linkwork.model.charts import OWN, CompiledChart
from linkwork.model.state import State
from linkwork.model.turning import turning
from linkwork.runs.members import Members
from linkwork.runs.passage import CLOSURE, SOFT, portion
from linkwork.runs.settings import Settings
from linkwork.runs.system import System
from linkwork.simulation import Status
from linkwork.simulation.compiled import entry_of
from linkwork.simulation.turns import whole
from linkwork.simulation.vectors import LANES
from linkwork.stepping.admitted import require_room
from linkwork.stepping.given_to_many import Index, which_of
from linkwork.stepping.member_parameters import MemberParameters
from linkwork.stepping.native_block import (
    LIMIT,
    LINE,
    NUMBERS,
    WHEN,
    Herd,
    StepDemands,
)
from linkwork.stepping.native_exchange import MemberPlaces, transfer
from linkwork.stepping.native_readings import ReadingTables, readings
from linkwork.stepping.seen_turns import seen
from linkwork.threads import crew

FEWEST = 256  # members that are worth a thread
OFTEN = OWN + 1  # evaluations that are to come, for which charts get code of their own
OK = int(Status.FINISHED)
READINGS, TRANSFER = entry_of(readings), entry_of(transfer)


class Codes(NamedTuple):
    """Addresses of kernels for states side by side; 0 where there is none."""

    motion: int
    closure: int
    readings: int


class HeldMembers:
    """Hold many members of a robot in memory, a column for each: see `Steppers`."""

    dt: float
    threads: int
    place: MemberPlaces
    _batch: Members
    _settings: Settings
    _free: bool

    def _furnish(self, own: np.ndarray | None) -> None:
        """Make the arrays, with a column for each member and some to fill the lanes."""
        batch, system = self._batch, self._batch.system
        equations, N = batch.robot.equations, len(batch)
        stride = -(-N // LANES) * LANES + LANES  # whole vectors, and no power of two
        nq, n, nz = equations.nq, equations.mobility, len(system.states)
        inputs, acting = system.inputs, system.acting
        first = int(acting.timed) if acting else 0
        commands = len(batch.robot.actuators) * self._free
        self._first = np.zeros((N, commands))
        self._first[:] = inputs.coefficients[0, 0, first : first + commands] if own is None else own
        size, free = nq + n + nz, batch.p.shape[1]
        y, held, turns, u, p, numbers = (
            lined(count, stride) for count in (size, size, nq, commands, free, NUMBERS)
        )
        self._herd = herd = Herd(y, held, turns, u, p, numbers, np.zeros(stride, np.intp))
        herd.p[:, :N] = batch.p.T
        if len(batch.p) > 1:
            self._batch = replace(batch, p=herd.p[:, :N].T)
        self.y, self.u = herd.y[:, :N].T, herd.u[:, :N].T
        self.q, self.v, self.z = self.y[:, :nq], self.y[:, nq : nq + n], self.y[:, nq + n :]
        self.status, self.time = herd.status[:N], herd.numbers[WHEN, :N].view()
        self.parameters = MemberParameters(batch, herd.p[:, :N])
        for told in (self.status, self.time):
            told.flags.writeable = False
        # What is asked of all of them.
        timed = np.delete(inputs.coefficients, range(first, first + commands), axis=2).size > 0
        own_turning = turning(batch.robot.turning, batch.robot.chart, acting)
        asked = np.ascontiguousarray(own_turning.table[:2])
        self._portion = max(1, portion(nq) // max(N, 1))
        held_to = CLOSURE * batch.robot.size, bool(batch.robot.redundant)
        self._asked = StepDemands(asked, self.dt, *held_to, first)
        self._inputs = self._settings.integrator.plan.table, inputs.table, timed
        self._seen = np.zeros((N, len(batch.robot.coordinates)))
        self._untold = ReadingTables(np.empty((N, 0)), np.empty((0, N)))
        self._charts: dict[object, tuple[int, CompiledChart]] = {}
        self._known: dict[CompiledChart, Codes] = {}
        self._of = np.zeros(N, int)  # the numbers of their charts
        self._lowered = False  # whether any bound of pivots may be
        # The steps after which lowered bounds are looked at, and how many lie between.
        self._look, self._short = np.zeros(N), np.ones(N)
        self.place = MemberPlaces(herd, self._seen, self._of)
        self._numbers: tuple[object, np.ndarray] = None, self._of  # of others' charts
        self._teams: list[tuple[CompiledChart, np.ndarray]] | None = None

    def __len__(self) -> int:
        return len(self._batch)

    @property
    def states(self) -> State:
        """The states, a stack of N in the robot's own independent rates; rates that these do not
        tell are nan. Whole turns of joints that close loops are followed from step to step where a
        controller or drive reads them, else from one asking to the next."""
        batch, N = self._batch, len(self)
        robot, nq, n = batch.robot, self._herd.turns.shape[0], batch.robot.mobility
        rates = np.full((N, n), np.nan)
        held = np.ascontiguousarray(self._herd.held[:, :N].T)
        for chart, who in self._grouped(np.arange(N)):
            q, v = held[who, :nq], held[who, nq : nq + n]
            found, kept = reread(robot, chart, robot.chart, q, v, batch.p_robot(who))
            rates[who[kept]] = found[kept]
        q = np.ascontiguousarray(whole(held[:, :nq], self._herd.turns[:, :N].T))
        (read,) = robot.kernel("positions")(q, batch.p_robot())
        self._seen[:] = seen(robot, batch.system, read, self._seen, held[:, nq + n :])
        return State.known(self._seen.copy(), rates, q, robot.coordinates, robot.independent)

    def read(self, out: np.ndarray | None = None, index: Index | None = None) -> np.ndarray:
        """Return what the `readings` that the steppers were made with say of the present states
        (N, readings).

        Args:
            out: where to write it; a new array if left out.
            index: of which members; the rows of others stay as they are.
        """
        shape = len(self), len(self._batch.system.events)
        if out is None:
            out = np.zeros(shape)
        require_room(out, shape)
        who = None if index is None else which_of(index, len(self))
        dense = np.ascontiguousarray(out)
        self.tell(ReadingTables(dense, self._untold.columns), who)
        if dense is not out:
            out[:] = dense
        return out

    def tell(self, told: ReadingTables, who: np.ndarray | None = None) -> bool:
        """Write what the readings say of the present states to two arrays; return whether all of it
        is finite.

        told: the first readings go to its `rows` (N, first), the others to its `columns` (others,
            N).
        who: numbers of members; all if left out.
        """
        running = who is None and not self.status.any()
        who = np.arange(len(self)) if who is None else who
        finite = True
        for chart, own in self._running() if running else self._grouped(who):
            given = self._codes(chart).readings, *self._inputs[1:], self._herd, self._asked
            finite &= all(self._shared(lambda x, given=given: READINGS(*given, x, told), own))
        return finite

    def _codes(self, chart: CompiledChart) -> Codes:
        """Return the addresses of the kernels for members side by side in a chart."""
        if chart not in self._known:
            system, constrained = self._batch.system, chart.equations.constrained
            self._known[chart] = Codes(
                system.side_by_side(chart, "motion", OFTEN),
                chart.closing_side_by_side(OFTEN) if constrained else 0,
                system.side_by_side(chart, "events", OFTEN) if system.events else 0,
            )
        return self._known[chart]

    def put(self, other: HeldMembers, index: Index | None = None, of: Index | None = None) -> None:
        """Put members where members of other steppers are, with all that these hold: at starts
        that were prepared, or back to what was kept.

        Args:
            other: steppers of the same robot, made with the same of all but states and forces'
                numbers.
            index: which; all if left out.
            of: where those are, as many members of the others, also one several times.

        Raises:
            LinkworkError: other steppers, or numbers, that do not fit; nobody is moved then.
        """
        self._require_twin(other)
        who, there = which_of(index, len(self)), which_of(of, len(other), repeated=True)
        if who.size != there.size:
            raise LinkworkError(
                f"{amount(who.size, 'member')} cannot be put where {there.size} are; give as many"
            )
        here, to, numbers = self.place, other.place, self.charts_of(other)
        self.note_put(other, TRANSFER(here, who, to, there, numbers))
        self._look[who], self._short[who] = other._look[there], other._short[there]

    def charts_of(self, other: HeldMembers) -> np.ndarray:
        """Return the numbers that charts of other steppers have here.

        other: steppers of the same robot.
        """
        if self._numbers[0] is not other or self._numbers[1].size != len(other._charts):
            own = [self._number(chart) for _, chart in other._charts.values()]
            self._numbers = other, np.array(own, np.intp)
        return self._numbers[1]

    def note_put(self, other: HeldMembers, changed: bool) -> None:
        """Take note that compiled code has put members where some of others are.

        other: those; changed: what it returned.
        """
        if changed:
            self._teams = None
        self._lowered |= other._lowered

    def independent(self, index: int) -> tuple[str, ...]:
        """Return the names of the rates that v holds of a member.

        index: of the member.
        """
        return self.chart(self._one(index)).independent

    def _enter(self, chart: CompiledChart, who: np.ndarray, y: np.ndarray) -> None:
        """Put members at states (M, n) in a chart."""
        herd = self._herd
        self._of[who] = self._number(chart)
        herd.held[:, who] = y.T
        seen = y.copy()
        nq = herd.turns.shape[0]
        seen[:, :nq] = whole(seen[:, :nq], herd.turns[:, who].T)
        herd.y[:, who] = seen.T
        herd.numbers[LIMIT, who], herd.status[who] = SOFT, OK
        self._teams = None

    def _number(self, chart: CompiledChart) -> int:
        """Return the number of a chart, a new one where it is not known."""
        return self._charts.setdefault(chart.key, (len(self._charts), chart))[0]

    def _running(self) -> list[tuple[CompiledChart, np.ndarray]]:
        """Return the members that go on, chart by chart."""
        if self._teams is None:
            self._teams = self._grouped(np.flatnonzero(self.status == OK))
        return self._teams

    def _grouped(self, who: np.ndarray) -> list[tuple[CompiledChart, np.ndarray]]:
        """Return members chart by chart."""
        numbers = self._of[who]
        groups = [(chart, who[numbers == number]) for number, chart in self._charts.values()]
        return [(chart, own) for chart, own in groups if own.size]

    @property
    def herd(self) -> Herd:
        """All that members are, for compiled code."""
        return self._herd

    def parameter_rows(self, names: Sequence[str]) -> np.ndarray:
        """Return in which rows of `herd.p` parameters stand.

        names: of them.
        """
        own, acting = self._batch.robot.parameters, self._batch.system.acting
        every = [*own, *(acting.parameters if acting else ())]
        return np.array([every.index(name) for name in names], np.intp)

    @property
    def system(self) -> System:
        """What all members are moved by, and what is read of them."""
        return self._batch.system

    def chart(self, i: int) -> CompiledChart:
        """Return the chart of a member.

        i: its index.
        """
        return next(chart for number, chart in self._charts.values() if number == self._of[i])

    def _shared(self, work: Callable[[np.ndarray], Any], who: np.ndarray) -> list[Any]:
        """Return what some work gives for shares of members, dealt over the threads."""
        parts = min(self.threads, who.size // FEWEST)
        if parts < 2:
            return [work(who)]
        size = -(-who.size // (parts * LANES)) * LANES
        with crew(parts) as pool:
            shares = [who[first : first + size] for first in range(0, who.size, size)]
            jobs = [pool.submit(work, share) for share in shares]
            wait(jobs)
        return [job.result() for job in jobs]

    def _require_twin(self, other: HeldMembers) -> None:
        """Refuse steppers whose members are no places for these."""
        if not isinstance(other, HeldMembers):
            raise LinkworkError(f"the others are {shown(other)}; give steppers of this robot")
        own, theirs = self._batch, other._batch
        keys = [of.system.acting.key if of.system.acting else "" for of in (own, theirs)]
        if own.robot is not theirs.robot or keys[0] != keys[1] or self.dt != other.dt:
            raise LinkworkError(
                "the other steppers are of another robot, of other forces, drives, wrenches or "
                "readings, or of another dt; make both alike"
            )

    def _one(self, index: int) -> int:
        found = which_of(index, len(self))
        if found.size != 1:
            raise LinkworkError(f"index {shown(index)} is none of one robot; give a number")
        return int(found[0])


def lined(rows: int, columns: int) -> np.ndarray:
    """Return zeros (rows, columns) of which the first stands at the beginning of a line of the
    cache."""
    memory = np.zeros(rows * columns + LINE)
    first = -memory.ctypes.data // memory.itemsize % LINE
    return memory[first : first + rows * columns].reshape(rows, columns)
