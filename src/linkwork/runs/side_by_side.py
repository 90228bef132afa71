"""Side by side: members of an ensemble in the lanes of vector registers, from chart to chart.

All members that stand in the same chart are integrated together, each from where and when it
stands. Where a chart's pivot falls below its bound a member stops, and goes on with all others that
go on in the same next chart, until all have come to their ends. What a member goes through is what
`Passage` leads a single run through: the same charts, bounds and times, which are a matter of the
member alone. What lanes cannot do members do by themselves, from where they stand (`one_by_one`):
stiff motions, and steps over singular poses.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from linkwork.equations.chart_choice import alike
from linkwork.model.chart_transfer import reread
from linkwork.model.charts import CompiledChart
from linkwork.model.turning import turning
from linkwork.runs.members import Members
from linkwork.runs.next_chart import choices, lowered_bounds
from linkwork.runs.one_by_one import Progress, Task
from linkwork.runs.passage import CLOSURE, LONGER, RECOVERED, SHORT, SOFT, Segment, Stand
from linkwork.runs.settings import Settings
from linkwork.simulation import Method, Status, Trajectory
from linkwork.simulation.admission import times_within
from linkwork.simulation.many import Occasion, Outcomes, Starts, integrate_many

EVALUATIONS = 100  # that a member takes in a chart, about
SHARE = 0.15  # of the time for one state alone that one of many side by side takes


def in_lanes(batch: Members, method: Method) -> bool:
    """Tell whether the lanes can do what is asked: explicit pairs, without sampled controllers and
    events that read what is given over time, past which no step may go."""
    acting = batch.system.acting
    over_time = acting is not None and bool(acting.events) and acting.events_over_time
    return method.in_lanes and not over_time and batch.system.sampler is None


@dataclass(frozen=True, eq=False)
class Stands:
    """Hold where members (M,) stand between two legs in one chart, side by side what `Stand` holds
    of a run.

    t: times (M,) [s]; y: states (q, v, z) (M, n)
    turns: whole turns of angles that are not in q (M, nq)
    saved: at how many of the times to save at they were (M,); steps: how many are left (M,)
    bound: the pivot at which the leg ends (M,)
    short: its duration while the bound is lowered (M,) [s]
    first_step: of the leg (M,) [s]; 0: it is guessed
    """

    chart: CompiledChart
    members: np.ndarray
    t: np.ndarray
    y: np.ndarray
    turns: np.ndarray
    saved: np.ndarray
    steps: np.ndarray
    bound: np.ndarray
    short: np.ndarray
    first_step: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> Stands:
        """Return some of the members."""
        parts = {name: values[rows] for name, values in vars(self).items() if name != "chart"}
        return Stands(self.chart, **parts)

    def until(self, end: float) -> np.ndarray:
        """Return when the leg ends (M,), at the latest; end: of the run [s]."""
        return np.where(self.bound == SOFT, end, np.minimum(self.t + self.short, end))


class Leg(NamedTuple):
    """Hold what became of members that went on together in one chart from where they stood."""

    stands: Stands
    outcomes: Outcomes

    @property
    def chart(self) -> CompiledChart:
        return self.stands.chart

    @property
    def members(self) -> np.ndarray:
        return self.stands.members

    def ends(self, rows: np.ndarray, save_at: np.ndarray) -> Stands:
        """Return where some of the members stand at the end of the leg."""
        before, done = self.stands[rows], self.outcomes
        t = done.end_time[rows]
        return replace(
            before,
            t=t,
            y=done.y_end[rows],
            turns=done.turns[rows],
            saved=np.searchsorted(save_at, t, "right"),
            steps=before.steps - done.steps[rows] - done.rejected[rows],
            first_step=np.zeros(rows.size),
        )

    def events(self, row: int) -> np.ndarray:
        """Return the rows (t, y, residual, event) of a member's events."""
        done, n = self.outcomes, self.outcomes.y_end.shape[1]
        own = done.events[done.events[:, -1] == row]
        return own[:, [*range(1 + n), -3, -2]]

    def stand(self, row: int, method: Method) -> Stand:
        """Return where a member stood as that of a run."""
        at = self.stands
        q, v = np.split(at.y[row], [self.chart.equations.nq])
        t, steps, bound, short = (of.item(row) for of in (at.t, at.steps, at.bound, at.short))
        here = self.chart, t, q, v, at.turns[row], None, steps, bound, short, method
        return Stand(*here, first_step=at.first_step.item(row) or None)


def begun(batch: Members, settings: Settings) -> Iterator[Stands]:
    """Yield where the members start, in charts with their pivots positive there.

    That is the chart in which runs start where it tells their motion, else that in which they were
    given.
    """
    robot, z = batch.robot, len(batch.system.states)
    for chart, indices in (
        (batch.chart, np.flatnonzero(batch.told)),
        (robot.chart_of(batch.given), np.flatnonzero(~batch.told)),
    ):
        if not indices.size:
            continue
        y = batch.start(indices)
        if chart is not batch.chart:
            rates = np.broadcast_to(batch.given.rates, batch.v.shape)[indices]
            y = np.concatenate([batch.q[indices], rates, y[:, y.shape[1] - z :]], axis=1)
        shared = slice(1) if batch.alike and len(batch.p) == 1 else indices
        pivots = chart.kernel("pivots")(batch.q[shared], batch.p_robot(shared))[0]
        signs = np.where(pivots < 0, -1.0, 1.0)
        for own, rows in alike(signs):
            rows = np.arange(indices.size) if len(signs) < indices.size else rows
            size, faced = rows.size, chart.with_signs(own)
            numbers = 0.0, 0, settings.max_steps, SOFT, settings.duration / SHORT, 0.0
            t, saved, *going_on = (np.full(size, part) for part in numbers)
            turns = np.zeros((size, robot.equations.nq))
            own_chart = robot.run_charts.setdefault(faced.key, faced)
            own_y = y if size == len(y) else y[rows]
            yield Stands(own_chart, indices[rows], t, own_y, turns, saved, *going_on)


def side_by_side(
    batch: Members, settings: Settings, report: Progress
) -> tuple[list[Leg], list[Task]]:
    """Run all members as far as lanes lead them; return their legs, and the runs that go on alone.

    Members that are cancelled before they came to their ends have a last leg in which nothing was
    done.
    """
    times_within(settings.save_at, *batch.span)
    waiting: dict[object, list[Stands]] = {}
    legs: list[Leg] = []
    leaving: list[tuple[Leg, int]] = []
    cancelled = False

    def wait(stands: Iterable[Stands]) -> None:
        for one in stands:
            if one.members.size:
                waiting.setdefault(one.chart.key, []).append(one)

    def progress(ended: int, of: int) -> None:
        left = of + len(leaving) + sum(map(count, waiting.values()))
        report(len(batch) - left + ended, len(batch))

    wait(begun(batch, settings))
    while waiting and not cancelled:
        # First the chart in which most members stand: meanwhile there may be more of them in the
        # others.
        stands = joined(waiting.pop(max(waiting, key=lambda key: count(waiting[key]))))
        leg = Leg(stands, integrated(batch, settings, stands, progress))
        legs.append(leg)
        cancelled = bool((leg.outcomes.status == Status.CANCELLED).any())
        going, alone = onward(batch, settings, leg)
        wait(going)
        leaving += [(leg, row) for row in alone.tolist()]
    if not cancelled:
        progress(0, 0)
    legs += [Leg(stands, unbegun(stands)) for parts in waiting.values() for stands in parts]
    ways = courses(batch, settings, legs, [int(leg.members[row]) for leg, row in leaving])
    return legs, [
        Task(
            int(leg.members[row]), ways[int(leg.members[row])], leg.stand(row, settings.integrator)
        )
        for leg, row in leaving
    ]


def joined(parts: Sequence[Stands]) -> Stands:
    """Return members that stand in the same chart together."""
    first, *others = parts
    if not others:
        return first
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in vars(first)
        if name != "chart"
    }
    return replace(first, **columns)


def count(parts: Sequence[Stands]) -> int:
    """Return how many members there are."""
    return sum(part.members.size for part in parts)


def integrated(batch: Members, settings: Settings, stands: Stands, progress: Progress) -> Outcomes:
    """Integrate members in their chart, each to its end or to where its pivot falls below the
    bound."""
    chart, system, save_at = stands.chart, batch.system, settings.save_at
    until = stands.until(settings.duration)
    last = np.searchsorted(save_at, until, "right")
    last[until == settings.duration] = save_at.size
    # All members of the chart at a time.
    rtol, atol = system.tolerances(chart, settings.rtol, settings.atol, stands.y.shape[1])
    states = int(SHARE * EVALUATIONS * stands.members.size)
    outcomes = integrate_many(
        system.side_by_side(chart, "motion", states),
        chart.closing_side_by_side(states) if chart.equations.constrained else None,
        stands.y,
        batch.inputs,
        batch.p,
        nq=chart.equations.nq,
        duration=settings.duration,
        rtol=rtol,
        atol=atol,
        save_at=save_at,
        max_step=settings.max_step,
        method=settings.integrator,  # pyright: ignore[reportArgumentType]
        leave_stiff=settings.leave_stiff,
        closure_tol=CLOSURE * batch.robot.size,
        threads=settings.threads,
        watch=batch.watched,
        progress=progress,
        turning=turning(batch.robot.turning, batch.robot.chart, system.acting),
        redundant=bool(batch.robot.redundant),
        starts=Starts(
            (stands.t, until, stands.bound),
            (stands.members, stands.steps, stands.saved, last),
            stands.turns,
            stands.first_step,
        ),
        occasion=occasion(batch, chart, states),
    )
    # What was evaluated counts for the choice of interpreter or machine code.
    chart.count(int(SHARE * outcomes.nfev.sum()))
    return outcomes


def occasion(batch: Members, chart: CompiledChart, states: int) -> Occasion | None:
    """Return the events to watch for in a chart, if there are any; states: that are evaluated
    there, in units of those that are evaluated alone."""
    system, events = batch.system, batch.system.conditions(chart)
    if events is None:
        return None
    closure = chart.single("closure_step").early_address if chart.equations.constrained else 0
    wide = system.side_by_side(chart, "events", states)
    return Occasion(system.motion(chart), closure, wide, events)


def unbegun(stands: Stands) -> Outcomes:
    """Return what became of members that are cancelled where they stand."""
    size = stands.members.size
    none, unknown = np.zeros(size, int), np.full(size, np.nan)
    return Outcomes(
        status=np.full(size, Status.CANCELLED),
        end_time=stands.t,
        y_end=stands.y,
        samples=np.empty((size, 0, stands.y.shape[1])),
        saved=stands.saved,
        nfev=none,
        steps=none,
        rejected=none,
        pivot=unknown,
        closure_error=unknown,
        next_step=unknown,
        rejected_pivot=unknown,
        rejected_residual=unknown,
        turns=stands.turns,
        events=np.empty((0, stands.y.shape[1] + 4)),
    )


def onward(batch: Members, settings: Settings, leg: Leg) -> tuple[list[Stands], np.ndarray]:
    """Return where members stand after a leg, chart by chart, and the rows of those who go on
    alone: as `Passage.after`."""
    # Only who is not at the end, and has steps left, may go on.
    done, before, end = leg.outcomes, leg.stands, settings.duration
    rows = np.flatnonzero((done.status != Status.FINISHED) | (before.until(end) < end))
    if not rows.size:
        return [], rows
    status, here = done.status[rows], leg.ends(rows, settings.save_at)
    paused = status == Status.FINISHED
    weak = np.flatnonzero((status == Status.SINGULAR) & (here.steps >= 1))
    alone = rows[status == Status.STIFF]

    # Where the bound is lowered legs are short: it is raised again when the pivots have recovered.
    rest = here[paused]
    recovered = pivots(batch, rest) > RECOVERED * SOFT
    bound = np.where(recovered, SOFT, rest.bound)
    short = np.where(recovered, settings.duration / SHORT, 2 * rest.short)
    going = [replace(rest, bound=bound, short=short)]

    # Where pivots have weakened members change charts; near a singular pose the bound is lowered.
    leaving = replace(here[weak], first_step=LONGER * done.next_step[rows[weak]])
    better, changed = in_better_charts(batch, leaving, not settings.step_over)
    left = weak[~changed]
    if settings.step_over:
        alone = np.concatenate([alone, rows[left]])
    else:
        rest = here[left]
        going.append(lowered(batch, rest[rest.t < end]))
    return [*going, *better], alone


def lowered(batch: Members, stands: Stands) -> Stands:
    """Return members who go on in a chart where none is better, under a lower bound."""
    q = stands.y[:, : batch.robot.equations.nq]
    Phi = batch.robot.chart.constraint_jacobian(q, varied(batch, stands))
    bounds = lowered_bounds(stands.chart, Phi, stands.bound, pivots(batch, stands))
    return replace(stands, bound=bounds)[bounds > 0]


def varied(batch: Members, stands: Stands) -> np.ndarray | None:
    """Return the free parameters of members (M x np), None where they are the robot's own."""
    robot = batch.robot
    return batch.p_robot(stands.members) if batch.varied and robot.p.size else None


def in_better_charts(
    batch: Members, stands: Stands, everywhere: bool
) -> tuple[list[Stands], np.ndarray]:
    """Return members in the charts that are better where they stand, and which of them change (M,).

    everywhere: whether also at configurations that are not regular
    """
    robot, chart, nq, n = batch.robot, stands.chart, batch.robot.equations.nq, batch.robot.mobility
    changed = np.zeros(stands.members.size, bool)
    if not changed.size:
        return [], changed
    q, v, z = (np.ascontiguousarray(part) for part in np.split(stands.y, [nq, nq + n], axis=1))
    p = varied(batch, stands)
    regular, groups = choices(robot, chart, q, robot.chart.constraint_jacobian(q, p), p)
    found = []
    for chosen, better in groups:
        rows = chosen if everywhere else chosen[regular[chosen]]
        rates, kept = reread(robot, chart, better, q[rows], v[rows], p if p is None else p[rows])
        rows = rows[kept]
        y = np.concatenate([q[rows], rates[kept], z[rows]], axis=1)
        bound = np.full(rows.size, SOFT)
        found.append(replace(stands[rows], chart=better, y=y, bound=bound))
        changed[rows] = True
    return found, changed


def pivots(batch: Members, stands: Stands) -> np.ndarray:
    """Return the weakest relative pivots of members where they stand (M,)."""
    chart = stands.chart
    q = np.ascontiguousarray(stands.y[:, : chart.equations.nq])
    return chart.weighed(q, np.zeros(chart.equations.mobility), batch.p_robot(stands.members))[1]


def courses(
    batch: Members, settings: Settings, legs: Sequence[Leg], members: Sequence[int]
) -> dict[int, list[Segment]]:
    """Return what some members did in the lanes as segments of their own runs."""
    ways: dict[int, list[Segment]] = {member: [] for member in members}
    for leg in legs if ways else ():
        for row in np.flatnonzero(np.isin(leg.members, list(ways))).tolist():
            ways[int(leg.members[row])].append(segment(batch, settings, leg, row))
    return ways


def segment(batch: Members, settings: Settings, leg: Leg, row: int) -> Segment:
    """Return what a member did in a leg as a segment of its own run."""
    from linkwork.simulation.native_loop import LoopOutcome

    # The samples of the leg that are this member's.
    stand, done = leg.stand(row, settings.integrator), leg.outcomes
    first, saved = int(leg.stands.saved[row]), int(done.saved[row])
    rows = np.zeros((saved - first, 3 + done.y_end.shape[1]))
    rows[:, 0], rows[:, -1] = settings.save_at[first:saved], -1.0
    rows[:, 1:-2] = done.samples[row, first:saved]
    found = leg.events(row)
    # The outcome as the loop of one run tells it; what lanes do not have is zero.
    outcome = LoopOutcome(
        status=done.status[row],
        evaluations=done.nfev[row],
        accepted=done.steps[row],
        rejected=done.rejected[row],
        projections=0,
        fault=-1,
        next_sample=0,
        since=0,
        votes=0,
        time=float(done.end_time[row]),
        step=float(done.next_step[row]),
        growth=0.0,
        longest=0.0,
        ideal=0.0,
        pivot=float(done.pivot[row]),
        pivot_time=float(done.end_time[row]),
        closure_error=float(done.closure_error[row]),
        rejected_pivot=float(done.rejected_pivot[row]),
        rejected_residual=float(done.rejected_residual[row]),
    )
    bounds = {
        "pivot_bound": stand.bound,
        "closure_tol": CLOSURE * batch.robot.size,
        "max_steps": settings.max_steps,
    }
    end, turns, status = done.y_end[row], done.turns[row], Status(outcome.status)
    held = rows, found, end, turns, stand.q.size, outcome, None, bounds, status
    robot, _ = batch.alone(int(leg.members[row]))
    chart = leg.chart.with_parameters(robot.p)
    return Segment(chart, Trajectory(*held), (stand.t, stand.q, stand.v), stand.method.name)
