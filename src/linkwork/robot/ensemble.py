"""Ensembles: many runs of one robot at a time, from many states, under many forces, with many values of its parameters.

Members are integrated in the lanes of vector registers, over all threads, in the chart that runs start in. Where its pivots
weaken a member needs another one: it is run again by itself, from chart to chart, as `Robot.simulate` does it. So every
member comes to what it comes to alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.robot import checks
from linkwork.robot.assembly import AssemblyKernel
from linkwork.robot.charts import CompiledChart
from linkwork.robot.labels import POSES
from linkwork.robot.members import Members, members
from linkwork.robot.passage import CLOSURE, SOFT, Passage, Segment
from linkwork.robot.recording import ON_SINGULAR, ending, labels, statistics, trimmed
from linkwork.robot.state import State
from linkwork.simulation import DORMAND_PRINCE, Statistics, Status, Variable
from linkwork.simulation.many import Outcomes, integrate_many

if TYPE_CHECKING:
    import xarray

    from linkwork.robot.robot import Robot

Progress = Callable[[int, int], None]
STATISTICS = ("nfev", "steps", "rejected", "pivot", "closure_error")


@dataclass(frozen=True, eq=False)
class Rows:
    """Hold states y = (q, v, z) in one chart: row i is that of member `members[i]` at the saved time `times[i]`."""

    chart: CompiledChart
    members: np.ndarray
    times: np.ndarray
    y: np.ndarray

    def split(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, v and z."""
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return self.y[:, :nq], self.y[:, nq : nq + n], self.y[:, nq + n :]


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Hold the results of N runs.

    status: how each member ended (N,), as `Status`; end_time: when (N,) [s]
    final: the last states reached, a stack of N; extras: of drives and controllers there (N, nz)
    nfev, steps, rejected: evaluations of the equations of motion, accepted and rejected steps of each member (N,)
    pivot, closure_error: the smallest relative pivot and the largest loop residual of each member (N,)
    parameters: values that vary, by name (N,)
    members: what they went out from; rows: gives their states at the saved times
    dataset: all of this, and joints and tool at the saved times, as an `xarray.Dataset` over (member, time, ...)
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
    rows: Callable[[], Sequence[Rows]] = field(repr=False)
    _last: Callable[[], tuple[State, np.ndarray]] = field(repr=False)
    _sentences: Callable[[int], str] = field(repr=False)
    _measure: Callable[[], tuple[dict[str, Variable], dict[str, Variable]]] = field(repr=False)

    def __len__(self) -> int:
        return len(self.status)

    def __repr__(self) -> str:
        found, counts = np.unique(self.status, return_counts=True)
        ways = ", ".join(f"{Status(s).name}: {k}" for s, k in zip(found, counts, strict=True))
        return f"Ensemble({len(self)} members; {ways})"

    @property
    def final(self) -> State:
        """Return the last states reached, a stack of N."""
        return self._reached[0]

    @property
    def extras(self) -> np.ndarray:
        """Return the extra states of drives and controllers at the end (N, nz)."""
        return self._reached[1]

    @cached_property
    def _reached(self) -> tuple[State, np.ndarray]:
        return self._last()

    @property
    def success(self) -> bool:
        """Tell whether all members reached their ends."""
        return not len(self.failed)

    @property
    def failed(self) -> np.ndarray:
        """Return the numbers of the members that did not reach their ends."""
        return np.flatnonzero(self.status != Status.FINISHED)

    def message(self, member: int) -> str:
        """Return the sentence with which a member's run ended."""
        return self._sentences(range(len(self))[member])

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Return the ensemble as an `xarray.Dataset`; what a member did not reach is nan."""
        import xarray

        variables, coords = self._measure()
        variables |= {
            "status": Variable(("member",), np.array([Status(s).name for s in self.status], dtype=object)),
            "end_time": Variable(("member",), self.end_time, {"units": "s"}),
        }
        variables |= {name: Variable(("member",), getattr(self, name)) for name in STATISTICS}
        variables |= {name: Variable(("member",), values) for name, values in self.parameters.items()}
        entries = [
            {name: (v.dims, v.values, dict(v.attrs)) for name, v in part.items()} for part in (variables, coords)
        ]
        return xarray.Dataset(*entries)


def ensemble(
    robot: Robot,
    states: State,
    forces: Any = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    *,
    duration: float,
    drives: Mapping[str, Any] | None = None,
    wrenches: Sequence[Any] = (),
    save_at: ArrayLike | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    max_step: float = np.inf,
    max_steps: int = 1_000_000,
    on_singular: str = "stop",
    threads: int | None = None,
    progress: bool | Progress = False,
) -> Ensemble:
    """Run an ensemble: see `Robot.ensemble`."""
    options = checks.run_options(duration, rtol, atol, max_step, max_steps)
    if on_singular not in ON_SINGULAR:
        raise LinkworkError(f"on_singular is {on_singular!r}; give {' or '.join(map(repr, ON_SINGULAR))}")
    times = np.empty(0) if save_at is None else np.atleast_1d(checks.finite(save_at, "save_at"))
    crew = members(robot, states, forces, parameters or {}, drives, wrenches, duration)
    with shown(progress) as report:
        parts, cancelled = together(crew, duration, times, options, threads, report)
        weak = [int(i) for part in parts for i in part.members[part.outcomes.status == Status.SINGULAR]]
        lone = (
            [] if cancelled else by_themselves(crew, weak, duration, times, on_singular == "step_over", options, report)
        )
    return collected(crew, parts, lone, times, max_steps)


@dataclass(frozen=True, eq=False)
class Part:
    """Hold what became of the members (M,) that were integrated together in one chart."""

    chart: CompiledChart
    members: np.ndarray
    outcomes: Outcomes


@dataclass(frozen=True, eq=False)
class Lone:
    """Hold what became of a member that was run by itself."""

    member: int
    segments: list[Segment]
    status: Status
    message: str

    @property
    def statistics(self) -> Statistics:
        """What the run took."""
        return statistics(self.segments)


def together(
    crew: Members, duration: float, times: np.ndarray, options: Mapping[str, Any], threads: int | None, report: Progress
) -> tuple[list[Part], bool]:
    """Run all members as far as they come in the chart that runs start in; tell whether they were cancelled.

    Its pivots are counted positive where the first member starts; members that start where they are negative then are run
    in the same chart, with its pivots counted positive there.
    """
    parts: list[Part] = []
    first = crew.robot.run_chart
    if len(crew) and crew.alone(0)[0].run_chart.pivot(crew.q[0]) < 0:
        ((first, _),) = faced(crew, np.array([0]))
    groups = [(first, np.arange(len(crew)))]

    def progress(ended: int, _: int) -> None:
        report(sum(len(part.members) for part in parts) + ended, len(crew))

    while groups:
        chart, indices = groups.pop()
        outcomes = integrate_many(
            crew.system.kernel(chart, "motion").batch_address,
            chart.kernel("closure_step").batch_address if chart.equations.constrained else None,
            crew.start(indices),
            crew.inputs(indices),
            crew.p[indices] if len(crew.p) > 1 else crew.p,
            nq=chart.equations.nq,
            duration=duration,
            save_at=times,
            pivot_bound=SOFT,
            closure_tol=CLOSURE * crew.robot.size,
            threads=threads,
            progress=progress,
            **options,
        )
        averted = (outcomes.status == Status.SINGULAR) & (outcomes.steps == 0) & (outcomes.pivot <= 0)
        if chart is first and averted.any():
            groups = list(faced(crew, indices[averted]))
            indices, outcomes = indices[~averted], outcomes.part(~averted)
        parts.append(Part(chart, indices, outcomes))
    return parts, any((part.outcomes.status == Status.CANCELLED).any() for part in parts)


def faced(crew: Members, averted: np.ndarray) -> Iterator[tuple[CompiledChart, np.ndarray]]:
    """Yield charts with their pivots positive where members start that the first chart is averted from, and these."""
    signs = crew.robot.run_chart.kernel("pivots")(crew.q[averted], crew.p_robot(averted))[0] < 0
    kinds = signs @ 2.0 ** np.arange(signs.shape[1])
    for kind in np.unique(kinds):
        indices = averted[kinds == kind]
        robot, _ = crew.alone(int(indices[0]))
        other = robot.run_chart.facing(crew.q[indices[0]])
        yield crew.robot.run_charts.setdefault(other.key, other), indices


def by_themselves(
    crew: Members,
    weak: Sequence[int],
    duration: float,
    times: np.ndarray,
    step_over: bool,
    options: Mapping[str, Any],
    report: Progress,
) -> list[Lone]:
    """Run members from chart to chart, one after the other; those that KeyboardInterrupt leaves out are not returned."""
    done = []
    try:
        for member in weak:
            robot, system = crew.alone(member)
            passage = Passage(robot, system, 0.0, duration, times, step_over, {"method": DORMAND_PRINCE, **options})
            q, v = crew.q[member], crew.v[member]
            segments = list(passage.segments(robot.run_chart, q, v, system.start))
            done.append(Lone(member, segments, *ending(system, segments[-1])))
            report(len(crew) - len(weak) + len(done), len(crew))
    except KeyboardInterrupt:
        pass
    return done


def collected(
    crew: Members, parts: Sequence[Part], lone: Sequence[Lone], times: np.ndarray, max_steps: int
) -> Ensemble:
    """Put the results of all members side by side."""
    count, alone = len(crew), {one.member: one for one in lone}
    numbers = {name: np.zeros(count) for name in ("end_time", "pivot", "closure_error")}
    numbers |= {name: np.zeros(count, dtype=int) for name in ("status", "nfev", "steps", "rejected")}
    for part in parts:
        for name, values in numbers.items():
            values[part.members] = getattr(part.outcomes, name)
    unfinished = [i for part in parts for i in part.members[part.outcomes.status == Status.SINGULAR] if i not in alone]
    numbers["status"][unfinished] = Status.CANCELLED
    for one in lone:
        numbers["end_time"][one.member], numbers["status"][one.member] = (
            one.segments[-1].trajectory.end_time,
            one.status,
        )
        for name in STATISTICS:
            numbers[name][one.member] = getattr(one.statistics, name)

    def sentence(member: int) -> str:
        if member in alone:
            return alone[member].message
        part = next(part for part in parts if member in part.members)
        row, outcomes = int(np.flatnonzero(part.members == member)[0]), part.outcomes
        return Status(numbers["status"][member]).sentence(
            time=outcomes.end_time[row],
            step=outcomes.next_step[row],
            rejected_pivot=outcomes.rejected_pivot[row],
            rejected_residual=outcomes.rejected_residual[row],
            pivot_bound=SOFT,
            closure_tol=CLOSURE * crew.robot.size,
            max_steps=max_steps,
        )

    def rows() -> list[Rows]:
        return list(saved(crew, parts, lone))

    return Ensemble(
        parameters=crew.varied,
        members=crew,
        rows=rows,
        _last=lambda: last_states(crew, parts, lone),
        _sentences=sentence,
        _measure=lambda: measured(crew, rows(), times),
        **numbers,
    )


def last_states(crew: Members, parts: Sequence[Part], lone: Sequence[Lone]) -> tuple[State, np.ndarray]:
    """Return the last states reached, in the home chart, and the extra states there."""
    robot, count = crew.robot, len(crew)
    q, v, z = (np.empty((count, size)) for size in (robot.equations.nq, robot.mobility, len(crew.system.extras)))
    rows = [Rows(part.chart, part.members, part.outcomes.end_time, part.outcomes.y_end) for part in parts]
    for one in lone:
        segment = one.segments[-1]
        y = np.concatenate([segment.trajectory.q_end, segment.trajectory.v_end])
        rows.append(Rows(segment.chart, np.array([one.member]), np.array([segment.trajectory.end_time]), y[None]))
    for row in rows:
        q[row.members], chart_v, z[row.members] = row.split()
        v[row.members] = chart_v
        if row.chart.independent != robot.independent:
            w = row.chart.kernel("tree_rates")(q[row.members], chart_v, crew.p_robot(row.members))[0]
            v[row.members] = robot.chart.from_tree(w)
    (positions,) = robot.kernel("positions")(q, crew.p_robot())
    return State(positions, v, q, robot.coordinates, robot.independent), z


def saved(crew: Members, parts: Sequence[Part], lone: Sequence[Lone]) -> Iterator[Rows]:
    """Yield the states at the saved times, chart by chart; of lone members those of their own runs."""
    alone = np.array([one.member for one in lone], dtype=int)
    for part in parts:
        kept = np.arange(part.outcomes.samples.shape[1]) < part.outcomes.saved[:, None]
        kept &= ~np.isin(part.members, alone)[:, None]
        rows, times = np.nonzero(kept)
        yield Rows(part.chart, part.members[rows], times, part.outcomes.samples[rows, times])
    for one in lone:
        start = 0
        for segment, rows in trimmed(one.segments):
            y = np.concatenate([segment.trajectory.q[rows], segment.trajectory.v[rows]], axis=1)
            times = np.arange(start, start + len(y))
            yield Rows(segment.chart, np.full(len(y), one.member), times, y)
            start += len(y)


def measured(
    crew: Members, parts: Sequence[Rows], times: np.ndarray
) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Return positions and rates of all joints, closure, tool and extra states at the saved times; and the axes' labels."""
    robot, extras = crew.robot, crew.system.extras
    shape = (len(crew), len(times))
    coords = {
        "time": Variable(("time",), times, {"units": "s"}),
        "coordinate": labels("coordinate", robot.coordinates, [robot.unit(label) for label in robot.coordinates]),
        "rate": labels("rate", robot.rates, [f"{robot.unit(label)}/s" for label in robot.rates]),
    }
    axes = {"joint_position": "coordinate", "joint_rate": "rate"}
    units = {"joint_position": "m, rad", "joint_rate": "m/s, rad/s", "tool_pose": "m, rad", "drive_state": ""}
    if robot.mechanism.tools:
        coords["pose"] = labels("pose", POSES[robot.planar])
        axes["tool_pose"] = "pose"
    if extras:
        coords["extra"] = labels("extra", [x.name for x in extras], [x.unit for x in extras])
        axes["drive_state"] = "extra"
        units["drive_state"] = ", ".join(extra.unit for extra in extras)
    values = {name: np.full((*shape, coords[axis].values.size), np.nan) for name, axis in axes.items()}
    for part in parts:
        (q, v, z), p, places = part.split(), crew.p_robot(part.members), (part.members, part.times)
        found = part.chart.kernel("joints_motion")(q, v, np.zeros(v.shape[1]), p)
        values["joint_position"][places], values["joint_rate"][places] = found[:2]
        if extras:
            values["drive_state"][places] = z
        if robot.mechanism.tools:
            values["tool_pose"][places] = AssemblyKernel(robot.kernel("assembly").given(p), robot.planar).tool_poses(q)
    jumping = robot.labels.jumping or robot.labels.quaternions
    for i in range(len(crew) if jumping else 0):
        kept = ~np.isnan(values["joint_rate"][i]).any(axis=-1)
        positions, rates = values["joint_position"][i, kept], values["joint_rate"][i, kept]
        values["joint_position"][i, kept] = robot.labels.unwrapped(times[kept], positions, rates)
    variables = {
        name: Variable(("member", "time", axes[name]), array, {"units": units[name]}) for name, array in values.items()
    }
    return variables, coords


@contextmanager
def shown(progress: bool | Progress) -> Iterator[Progress]:
    """Give a function to report to: the caller's, one that moves a bar on the terminal, or one that does nothing."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda done, total: None
    else:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        with Progress("runs", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
            task = bar.add_task("runs", total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)
