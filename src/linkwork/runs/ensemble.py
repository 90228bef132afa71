"""Ensembles: many runs of one robot at a time, from many states, under many forces, with many
values of its parameters.

What the compiled lanes can do members do there, in the lanes of vector registers, over all threads,
from chart to chart (`side_by_side`); what the lanes cannot do they do by themselves, as
`Robot.simulate` does it (`one_by_one`). So every member comes to what it comes to alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import amount, by_name, switch
from linkwork.errors import LinkworkError
from linkwork.model import limits
from linkwork.model.state import Reached, State
from linkwork.notebooks import Portrayed
from linkwork.patience import hushed, ongoing
from linkwork.readonly import ReadOnlyArrays
from linkwork.runs import following, recording
from linkwork.runs.accuracy import compared, repeatable, tightened
from linkwork.runs.endings import ending
from linkwork.runs.measuring import measured
from linkwork.runs.member_events import Happened, happened, passed
from linkwork.runs.members import Members, members
from linkwork.runs.one_by_one import Progress, SingleRun, Task, by_themselves
from linkwork.runs.passage import Segment
from linkwork.runs.quantities import (
    QUANTITIES,
    Place,
    SavedQuantity,
    axes_of,
    coords_of,
    labels,
    told_by,
)
from linkwork.runs.running import smooth, watched
from linkwork.runs.saved_rows import SavedRows, last_states, saved
from linkwork.runs.saved_states import Aim
from linkwork.runs.settings import Settings
from linkwork.runs.side_by_side import Leg, begun, courses, in_lanes, side_by_side, unbegun
from linkwork.simulation import Run, Status, Variable
from linkwork.simulation.variables import dataset_of

if TYPE_CHECKING:
    import xarray

    from linkwork.model.model import Model

AT_ONCE = 1000  # members that are run again together
Again = Callable[[Sequence[int]], Iterator[tuple[int, Sequence[Segment], bool]]]
STATISTICS = ("nfev", "steps", "rejected", "pivot", "closure_error")


@dataclass(frozen=True, eq=False)
class Ensemble(ReadOnlyArrays, Portrayed):
    """Hold the results of N runs.

    status: how each member ended (N,), as `Status`; end_time: when (N,) [s]
    final: the last states reached, a stack of N, rates that no common chart tells nan; extras:
        drives and controllers there
    nfev, steps, rejected: evaluations of the equations of motion, accepted and rejected steps of
        each member (N,)
    pivot, closure_error: the smallest relative pivot and the largest loop residual of each member
        (N,)
    parameters: values that vary, by name (N,)
    members: what they went out from; rows: gives their states at the saved times; settings: how
        they were run
    events: what happened in a member's run, and when
    dataset: all of this, and joints and tool at the saved times, as an `xarray.Dataset` over
        (member, time, ...)
    """

    status: np.ndarray
    end_time: np.ndarray
    nfev: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    pivot: np.ndarray
    closure_error: np.ndarray
    parameters: Mapping[str, np.ndarray]
    members: Members = field(repr=False)
    rows: Callable[[], Sequence[SavedRows]] = field(repr=False)
    settings: Settings = field(repr=False)
    _happened: Happened = field(repr=False)
    _last: Callable[[], tuple[State, np.ndarray]] = field(repr=False)
    _passed: Happened = field(repr=False)
    _sentences: Callable[[int], str] = field(repr=False)
    _companion: Callable[[], Ensemble] | None = field(repr=False)
    _again: Again = field(repr=False)

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        found, counts = np.unique(self.status, return_counts=True)
        ways = ", ".join(f"{Status(s).name}: {k}" for s, k in zip(found, counts, strict=True))
        return f"Ensemble({amount(len(self), 'member')}{'; ' * bool(ways)}{ways})"

    def __reduce__(self) -> NoReturn:
        raise LinkworkError(
            "ensembles cannot be copied or pickled: they run members again by compiled code; send "
            "ensemble.dataset, ensemble.final or ensemble.run(member)"
        )

    @cached_property
    def final(self) -> State:
        """Return the last states reached, a stack of N."""
        state, _ = self._reached
        if not self.members.robot.labels.may_wind:
            return state
        return Reached.known(
            self._wound, state.rates, state.q, state.coordinates, state.independent
        )

    def _wound(self) -> np.ndarray:
        """Return the coordinates of all joints at the ends (N, m), with their whole turns."""
        state, _ = self._reached
        batch, parts = self.members, self.rows()
        count = 1 + max((int(part.times.max(initial=-1)) for part in parts), default=-1)
        time = np.full((len(batch), count + 1), np.nan)
        for part in parts:
            time[part.members, part.times] = part.t
        joints = [QUANTITIES[name] for name in ("joint_position", "joint_rate")]
        read, rates = measured(batch, parts, count + 1, joints).values()
        time[:, -1], read[:, -1] = self.end_time, state.positions
        chart, v = batch.robot.chart_of(state), np.nan_to_num(state.rates)
        rates[:, -1] = chart.kernel("joints_motion")(state.q, v, 0 * v, batch.p_robot())[1]
        return self.turned(time, read, rates)[:, -1]

    @property
    def extras(self) -> np.ndarray:
        """Return the extra states of drives and controllers at the end (N, nz)."""
        return self._reached[1]

    @cached_property
    def _reached(self) -> tuple[State, np.ndarray]:
        return self._last()

    @cached_property
    def error_estimate(self) -> np.ndarray:
        """Return the largest error of each member's last state (N,), relative to atol + rtol |y|:
        estimated.

        It is found by running all members again at a tenth of the tolerance (half of the step) when
        it is first asked for: see `linkwork.runs.accuracy`. nan for members that did not reach
        their ends, or that a Python function controls.
        """
        if self._companion is None:
            return np.full(len(self), np.nan)
        other = self._companion()
        y, y_c = (
            np.column_stack([one.final.q, one.final.rates, one.extras]) for one in (self, other)
        )
        start = np.zeros(y.shape)
        start[:, : self.members.q.shape[1]] = self.members.q
        robot, settings = self.members.robot, self.settings
        labels = robot.equations.tree.coordinates
        units = [*map(robot.unit, labels), *[""] * (y.shape[1] - len(labels))]
        size = np.maximum(np.abs(start), np.abs(y))
        allowed = (
            robot.chart_of(self.final).tolerances(1.0, settings.atol, y.shape[1])[1]
            + settings.rtol * size
        )
        largest = compared(y, y_c, allowed, units, settings.integrator).max(axis=1)
        reached = (self.status == Status.FINISHED) & (other.status == Status.FINISHED)
        return np.where(reached, largest, np.nan)

    @property
    def success(self) -> bool:
        """Tell whether all members reached their ends."""
        return not len(self.failed)

    @property
    def failed(self) -> np.ndarray:
        """Return the numbers of the members that did not reach their ends."""
        return np.flatnonzero(self.status != Status.FINISHED)

    def message(self, member: int) -> str:
        """Return the sentence with which a member's run ended; that of its error, too, as the
        message of `run(member)` does, where a Python function does not control it."""
        number = self._numbered(member)
        if self._companion is not None and self.status[number] != Status.CANCELLED:
            return self.run(number).message
        return self._sentences(number)

    def run(self, member: int) -> Run:
        """Return the run of one member, made once more by itself: what `Robot.simulate` gives, bit
        for bit what it came to among the others, with all quantities at the times that were saved
        (at every step where none were), `Run.sensitivity` and `Run.gradient`.

        Raises:
            LinkworkError: there is no member of that number.
        """
        number, times = self._numbered(member), self.settings.save_at
        robot, system = self.members.alone(number)
        settings = self.settings if len(times) else self.settings.but(save_at=None)
        return recording.simulate(robot, self.members.state(number), system, settings)

    def events(self, member: int) -> tuple[tuple[str, float], ...]:
        """Return the events of a member's run, each its name and time [s], in the order of the
        times."""
        of = self._happened.members == self._numbered(member)
        return tuple(
            zip(self._happened.names[of].tolist(), self._happened.times[of].tolist(), strict=True)
        )

    def singular_times(self, member: int) -> np.ndarray:
        """Return when a member stepped over singular poses (on_singular="step_over") [s]."""
        return self._passed.times[self._passed.members == self._numbered(member)]

    def limits_passed(self, member: int) -> tuple[str, ...]:
        """Return one sentence for each limit of a joint's coordinate or rate that a member passes
        at the saved times or at its end."""
        own = self._numbered(member)
        time, positions, rates = (values[own] for values in self._joints)
        return limits.passed(self.members.robot, positions, rates, time)

    @cached_property
    def _joints(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times, coordinates and rates of all joints (N, K + 1, ...): saved ones, and those
        at the ends."""
        batch, final = self.members, self.final
        found = self.measured([QUANTITIES["joint_position"], QUANTITIES["joint_rate"]])
        time = np.tile(self.settings.save_at, (len(self), 1))
        chart, v = batch.robot.chart_of(final), final.rates
        rates = chart.kernel("joints_motion")(final.q, v, 0 * v, batch.p_robot())[1]
        return (
            np.column_stack([time, self.end_time]),
            np.concatenate([found["joint_position"], final.positions[:, None]], axis=1),
            np.concatenate([found["joint_rate"], rates[:, None]], axis=1),
        )

    def measured(
        self,
        quantities: Iterable[SavedQuantity],
        aim: Aim | None = None,
        threads: int | None = None,
    ) -> dict[str, np.ndarray]:
        """Return quantities (N, K, ...) at the saved times by name; what a member did not reach is
        nan.

        aim: where a controller leads to; threads: all processors if left out
        """
        wanted, save_at = list(quantities), self.settings.save_at
        turning = [each.name for each in wanted if each.turning and self._may_wind]
        wanted += [QUANTITIES["joint_rate"]] if turning else []
        parts, count = self.rows(), len(save_at)
        found = measured(self.members, parts, count, wanted, aim=aim, threads=threads)
        times = np.broadcast_to(save_at, (len(self), count))
        for name in turning:
            found[name] = self.turned(times, found[name], found["joint_rate"])
        return found

    @property
    def _may_wind(self) -> bool:
        return self.members.robot.labels.may_wind

    def turned(self, time: np.ndarray, read: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return coordinates of all joints (N, K, m) that are read off the tree's with their whole
        turns (`following`)."""
        if not (self.members.robot.labels.may_wind and time.size):
            return read
        windings = following.of_members(self.members, time, read, rates, self.steps, self._again)
        return self.members.robot.labels.turned(read, windings)

    def _numbered(self, member: int) -> int:
        """Return the number of a member from 0 on; refuse one that is not there."""
        try:
            return range(len(self))[member]
        except (IndexError, TypeError):
            raise LinkworkError(
                f"there is no member {member!r}; there are {len(self)}, from 0 on"
            ) from None

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Return the ensemble as an `xarray.Dataset`; what a member did not reach is nan.

        Events, if any were asked for, lie one after the other along their own axis: event,
        event_time and event_member; and so do singular poses that were stepped over: singular_time
        and singular_member.
        """
        # What the table tells of the saved states.
        batch = self.members
        system, axes = batch.system, axes_of(batch.robot, batch.system.extras)
        told, times = told_by(Place.ENSEMBLE, axes), self.settings.save_at
        found = self.measured(told)
        variables = {
            each.name: each.told(found[each.name], system, "member", "time") for each in told
        }
        coords = {"time": Variable(("time",), times, {"units": "s"})} | coords_of(told, axes)
        # How the members ended, what that took, and what varied.
        variables |= {
            "status": Variable(
                ("member",), np.array([Status(s).name for s in self.status], dtype=object)
            ),
            "end_time": Variable(("member",), self.end_time, {"units": "s"}),
        }
        variables |= {name: Variable(("member",), getattr(self, name)) for name in STATISTICS}
        variables |= {
            name: Variable(("member",), values) for name, values in self.parameters.items()
        }
        # What happened on the way, of all members one after the other.
        if self.members.system.events:
            coords["event"] = labels("event", self._happened.names.tolist())
            coords["event_time"] = Variable(("event",), self._happened.times, {"units": "s"})
            coords["event_member"] = Variable(("event",), self._happened.members)
        if self._passed.times.size:
            coords["singular_time"] = Variable(
                ("singular_pose",), self._passed.times, {"units": "s"}
            )
            coords["singular_member"] = Variable(("singular_pose",), self._passed.members)
        caveats = self.members.robot.mechanism.caveats
        return dataset_of(variables, coords, {"caveats": "\n".join(caveats)} if caveats else {})


def ensemble(
    robot: Model,
    states: State,
    forces: Any,
    settings: Settings,
    *,
    parameters: Mapping[str, ArrayLike] | None = None,
    drives: Mapping[str, Any] | None = None,
    wrenches: Sequence[Any] = (),
    progress: bool | Progress = False,
) -> Ensemble:
    """Run an ensemble: see `Robot.ensemble`."""
    settings = settings.saved_from(0.0)
    if settings.save_at is None:
        settings = settings.but(save_at=np.empty(0))
    parameters = by_name(parameters, "parameters", "{'kp': [10.0, 20.0]}")
    events, stiff = watched(robot, settings.events), settings.integrator.stiff
    batch = members(
        robot, states, forces, parameters, drives, wrenches, events, settings.duration, stiff
    )
    settings = settings.suited(smooth(batch.system, batch.signals))
    with shown(progress) as report, hushed() if progress else ongoing("running the ensemble"):
        return completed(batch, settings, report)


def completed(batch: Members, settings: Settings, report: Progress) -> Ensemble:
    """Run members to their ends: in lanes as far as these lead, and by themselves."""
    if in_lanes(batch, settings.integrator):
        legs, tasks = side_by_side(batch, settings, report)
    else:
        legs, tasks = [], [Task(member) for member in range(len(batch))]
    cancelled = any((leg.outcomes.status == Status.CANCELLED).any() for leg in legs)
    singles = [] if cancelled or not tasks else by_themselves(batch, settings, tasks, report)
    return collected(batch, legs, singles, [task.member for task in tasks], settings)


def collected(
    batch: Members,
    legs: Sequence[Leg],
    singles: Sequence[SingleRun],
    asked: Sequence[int],
    settings: Settings,
) -> Ensemble:
    """Put the results of all members side by side.

    singles, asked: the runs of members by themselves, and the numbers of those that were to be run
    so: others were cancelled
    """
    # Numbers of all: those of the lanes, then of members that ran by themselves, then of the
    # cancelled.
    alone = {one.member: one for one in singles}
    unfinished = [member for member in asked if member not in alone]
    if not legs:
        legs = [Leg(stands, unbegun(stands)) for stands in begun(batch, settings)]
    numbers = totals(batch, legs)
    if asked:
        numbers = {name: values.copy() for name, values in numbers.items()}
    numbers["status"][unfinished] = Status.CANCELLED
    for one in singles:
        numbers["end_time"][one.member] = one.segments[-1].trajectory.end_time
        numbers["status"][one.member] = one.status
        for name in STATISTICS:
            numbers[name][one.member] = getattr(one.statistics, name)

    # Sentences, rows and events are worked out when they are first asked for.
    def sentence(member: int) -> str:
        if member in alone:
            return alone[member].message
        *others, last = courses(batch, settings, legs, [member])[member]
        status = Status(numbers["status"][member])
        last = replace(last, trajectory=replace(last.trajectory, status=status))
        return ending(batch.alone(member)[1], [*others, last])[1]

    def rows() -> list[SavedRows]:
        return list(saved(batch, legs, singles, settings.save_at))

    return Ensemble(
        parameters=batch.varied,
        members=batch,
        rows=rows,
        _happened=happened(batch, legs, singles),
        _passed=passed(singles),
        _last=lambda: last_states(batch, legs, singles),
        _sentences=sentence,
        _companion=companion(batch, settings),
        _again=partial(again, batch, settings, singles),
        settings=settings,
        **numbers,
    )


def totals(batch: Members, legs: Sequence[Leg]) -> dict[str, np.ndarray]:
    """Return what the members' legs came to and took together (N,), by name."""
    size, names = len(batch), ("status", "end_time", *STATISTICS)
    if len(legs) == 1 and legs[0].members.size == size:  # all of them, in their order
        found = {name: getattr(legs[0].outcomes, name) for name in names}
        return found | {"closure_error": closure_errors(batch, legs[0])}
    found = {name: np.zeros(size, int) for name in ("status", "nfev", "steps", "rejected")}
    found["end_time"] = np.zeros(size)
    found |= {name: np.full(size, np.nan) for name in ("pivot", "closure_error")}
    for leg in legs:
        own, done = leg.members, leg.outcomes
        found["status"][own], found["end_time"][own] = done.status, done.end_time
        for name in ("nfev", "steps", "rejected"):
            found[name][own] += getattr(done, name)
        found["pivot"][own] = np.fmin(found["pivot"][own], done.pivot)
        gaps = closure_errors(batch, leg)
        found["closure_error"][own] = np.fmax(found["closure_error"][own], gaps)
    return found


def closure_errors(batch: Members, leg: Leg) -> np.ndarray:
    """Return the largest gap (M,) of each member, that of rows that are not held where it is saved
    and at its end included."""
    found, equations = leg.outcomes, batch.robot.equations
    if equations.rows.unheld is None:
        return found.closure_error
    q = np.concatenate([found.samples, found.y_end[:, None]], axis=1)[..., : equations.nq]
    p = np.broadcast_to(batch.p_robot(leg.members)[:, None], (*q.shape[:2], batch.robot.p.size))
    return np.maximum(found.closure_error, np.nanmax(batch.robot.chart.unheld_gap(q, p), axis=1))


def again(
    batch: Members, settings: Settings, singles: Sequence[SingleRun], which: Sequence[int]
) -> Iterator[tuple[int, Sequence[Segment], bool]]:
    """Yield members with their segments that ran by themselves, and others once more; tell whether
    every step was saved."""
    whole = {
        one.member: one
        for one in singles
        if all(part.again or part.crossed for part in one.segments)
    }
    yield from ((member, whole[member].segments, False) for member in which if member in whole)
    left = [member for member in which if member not in whole]
    every = settings.but(save_at=None)
    for first in range(0, len(left), AT_ONCE):
        tasks = [Task(member) for member in left[first : first + AT_ONCE]]
        yield from (
            (one.member, one.segments, True)
            for one in by_themselves(batch, every, tasks, lambda done, total: None)
        )


def companion(batch: Members, settings: Settings) -> Callable[[], Ensemble] | None:
    """Return what runs all members again at a tighter tolerance; None where that is not
    possible."""
    if not repeatable(batch.system, settings):
        return None

    def other() -> Ensemble:
        tight = tightened(settings).but(save_at=np.empty(0))
        return completed(batch, tight, lambda done, total: None)

    return other


@contextmanager
def shown(progress: bool | Progress) -> Iterator[Progress]:
    """Give a function to report to: the caller's, one that moves a bar on the terminal, or one that
    does nothing."""
    if not callable(progress):
        switch(progress, "progress")
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda done, total: None
    else:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        with Progress("runs", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
            task = bar.add_task("runs", total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)
