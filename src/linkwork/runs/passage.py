"""Passage: lead a run from chart to chart, and over singular poses where the motion itself is
smooth.

A run is a chain of segments, each integrated in one chart, and long ones in portions; between them
an interruption is heard. Where the chart's pivot falls below a soft bound the segment ends; if
another chart is well conditioned there the next segment uses it: q stays, the rates are re-read. If
none is, the configuration itself is nearly singular, and the run goes on in the same chart down to
the hard bound, or, if asked, steps over it (`crossing`). Which chart is next is a matter of q (and
p) alone, not of the charts known from elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from linkwork.model.chart_transfer import reread
from linkwork.model.charts import CompiledChart
from linkwork.model.turning import turning
from linkwork.patience import Kept
from linkwork.runs.crossing import Crossed, Crossing
from linkwork.runs.next_chart import LOWER, Choice, choice, lowered_bounds
from linkwork.runs.settings import Settings
from linkwork.runs.stiff_trial import Trial
from linkwork.runs.system import System, with_jacobian
from linkwork.simulation import (
    RODAS,
    Control,
    Method,
    Pace,
    Signal,
    Status,
    Trajectory,
    Turning,
    as_signal,
    stack,
)
from linkwork.simulation.events import Watch
from linkwork.simulation.integration import Problem, TimeSpan, advanced

if TYPE_CHECKING:
    from linkwork.model.model import Model

CLOSURE = 1e-13
SOFT = 0.05  # relative pivot at which a better chart is looked for
RECOVERED = 1.5  # pivot over the soft bound at which a lowered bound is raised again
SHORT = 1000  # shortest segments in a run's duration
LONGER = 4.0
"""First step in a new chart, in units of the next one in the old chart: as long as the one that
failed there."""
WORK, LEAST, MOST = 2**22, 2**11, 2**16  # steps, times nq^2, until a run looks for interruptions


@dataclass(frozen=True, eq=False)
class Segment:
    """Hold a part of a run that was integrated in one chart, or a singular pose that was stepped
    over in it.

    start: time, q and (v, z) that it went out from; method: its name; crossed: the way over the
        pose; lowered: the bound of its pivots, if it was lowered
    again: integrates it once more, saved at other times or (None) at every step, where a sampled
        controller acts from a row, by number (-1: the start), to the next, without calling it
    """

    chart: CompiledChart
    trajectory: Trajectory
    start: tuple[float, np.ndarray, np.ndarray]
    method: str
    again: Callable[[np.ndarray | None, int], Trajectory] | None = None
    crossed: Crossed | None = None
    lowered: Lowered | None = None


class Lowered(NamedTuple):
    """Hold a lowered bound of the pivots: when it was looked whether they have recovered, and for
    how long they were not to be looked at again [s]; over: whether the run would rather have
    stepped over the pose."""

    bound: float
    since: float
    short: float
    over: float


class Departure(NamedTuple):
    """Hold what a passage goes out from.

    chart: to start in; q, v, z: coordinates, independent rates of the chart, and extra states
    control: what a sampled controller holds; zeros if left out
    turns: whole turns of angles that are not in q; none if left out
    lowered: the bound of the pivots; the soft one if left out
    """

    chart: CompiledChart
    q: np.ndarray
    v: np.ndarray
    z: np.ndarray
    control: Control | None = None
    turns: np.ndarray | None = None
    lowered: Lowered | None = None


class Stand(NamedTuple):
    """Hold where a run stands between two segments.

    chart, t, q, v: what the next segment goes out from, v with the extra states; turns (nq): whole
        turns of angles that are not in q; control: what a sampled controller holds
    steps: how many are left; bound: the pivot at which the segment ends; short: its duration while
        the bound is lowered; since: when that began [s], at t if left out
    method: of integration; over: the singular pose that was stepped over to come here
    pace: the steps to go on with, where the last segment ended as its portion was full
    first_step: to go on with, in another chart; guessed if left out
    trial: of stiff steps in place of explicit ones
    """

    chart: CompiledChart
    t: float
    q: np.ndarray
    v: np.ndarray
    turns: np.ndarray | None
    control: Control | None
    steps: int
    bound: float
    short: float
    method: Method
    over: Segment | None = None
    pace: Pace | None = None
    first_step: float | None = None
    since: float | None = None
    trial: Trial = Trial()

    @property
    def looked(self) -> float:
        """When it was looked last whether the pivots have recovered [s]."""
        return self.t if self.since is None else self.since


@dataclass
class Passage:
    """Lead one run from a state to its end.

    system: what is integrated; start, end: times of the run [s]
    settings: how; save_at None: every step is saved; for explicit steps of a method that nobody
        asked for the stiff one is taken from where they are stiff
    pace: the step to begin with, guessed if left out
    watching: whether events are watched for at which no step ends
    interruptible: whether Ctrl-C ends a long run where it is, as a fault of the system, rather than
        throw away what was computed
    """

    robot: Model
    system: System
    start: float
    end: float
    settings: Settings
    pace: Pace | None = None
    watching: bool = True
    interruptible: bool = False

    def segments(self, begun: Departure) -> Iterator[Segment]:
        """Yield the segments of the run from its start, one after the other."""
        return self.onward(self.departed(begun))

    def departed(self, begun: Departure) -> Stand:
        """Return where the run stands at its start."""
        chart, q, v, z, control, turns, lowered = begun
        if turns is not None:
            q, turns = self.turning.begun(q, turns)
        chart, v = self.faced(chart, q), np.concatenate([v, z])
        if self.system.acting is not None:
            control = self.system.control(chart, control)
        here, settings = (chart, self.start, q, v, turns, control), self.settings
        stand = Stand(*here, settings.max_steps, SOFT, self.shortest, settings.integrator)
        if lowered is None or (settings.step_over and not lowered.over):
            return stand
        stand = stand._replace(bound=lowered.bound, short=lowered.short, since=lowered.since)
        return self._looked(stand) if self.until(stand) <= self.start else stand

    def lowered(self, stand: Stand) -> Lowered | None:
        """Return the bound of the pivots at a stand, if it is lowered."""
        over = float(self.settings.step_over)
        return (
            None if stand.bound == SOFT else Lowered(stand.bound, stand.looked, stand.short, over)
        )

    @property
    def turning(self) -> Turning:
        """How large coordinates may grow, and which angles are wrapped."""
        acting = self.system.acting
        own = self.robot.turning
        return own if acting is None else turning(own, self.robot.chart, acting)

    @cached_property
    def watch(self) -> Watch | None:
        """What no step may pass over beside the inputs."""
        return self.system.watch(self.robot.chart, (self.start, self.end))

    @property
    def shortest(self) -> float:
        """Duration of the shortest segments; a step of fixed length, whatever the duration."""
        return self.settings.integrator.step or (self.end - self.start) / SHORT

    def onward(self, stand: Stand | None) -> Iterator[Segment]:
        """Yield the segments from a stand on.

        While the bound is lowered segments are short, so that it is raised again when the pivots
        have recovered.
        """
        with Kept() as kept:
            while stand is not None:
                if stand.over is not None:
                    yield stand.over
                    if stand.t == self.end or not stand.over.trajectory.success:
                        return
                trajectory = self._integrate(stand)
                again = partial(self._again, stand, trajectory)
                at, name = (stand.t, stand.q, stand.v), stand.method.name
                lowered = self.lowered(stand)
                yield Segment(stand.chart, trajectory, at, name, again, lowered=lowered)
                stand.chart.count(trajectory.nfev)
                stand = self.after(stand, trajectory)
                if stand and self.interruptible and kept.interrupted(stand.pace is not None):
                    self.system = replace(self.system, faults=[KeyboardInterrupt()])
                    return

    def after(self, stand: Stand, done: Trajectory) -> Stand | None:
        """Return where the run stands after a segment, None at its end."""
        if done.status is Status.FINISHED and self.until(stand) == self.end:
            return None
        chart, t, q, v = stand.chart, done.end_time, done.q_end, done.v_end
        steps = stand.steps - done.steps - done.rejected
        here = stand._replace(
            t=t, q=q, v=v, turns=done.turns, control=done.control, steps=steps,
            over=None, pace=None, first_step=None, since=None,
        )  # fmt: skip
        if done.status is Status.TOO_MANY_STEPS and steps > 0 and not self.system.faults:
            return here._replace(**stand.trial.onward(done, self.settings.integrator))
        # A short segment under a lowered bound is over; or a stiff one, which goes on by RODAS.
        if done.status is Status.FINISHED:
            return self._looked(here)
        if done.status is Status.STIFF:
            return here._replace(method=RODAS, steps=max(steps, 1), trial=Trial(done.next_step))
        if done.status is not Status.SINGULAR or steps < 1:
            return None
        # The pivots are weak: the better chart there is taken, if it tells the same motion; near a
        # singular pose, where that is asked for, the way over it comes first.
        found = cast(Choice, self.robot.once(chosen, chart, q.tobytes()))
        tried = self.settings.step_over and not found.regular
        over = self._over(here, done) if tried else None
        if over is None:
            better, n = found.better, chart.equations.mobility
            told = better and reread(self.robot, chart, better, q, v[:n])
            if better and told and told[1]:
                control = self.system.control(better, done.control)
                return here._replace(
                    chart=better, v=np.concatenate([told[0], v[n:]]), control=control, bound=SOFT,
                    first_step=LONGER * done.next_step or None,
                )  # fmt: skip
            if self.settings.step_over and not tried:
                over = self._over(here, done)
        # Behind a pose that is stepped over, the same chart goes on as soon as it may.
        if over is not None:
            behind = over.trajectory
            short, q = behind.end_time - t, behind.q_end
            chart = self.faced(chart, q)
            bound = min(SOFT, 0.5 * chart.pivot(q))
            here = here._replace(chart=chart, t=behind.end_time, q=q, v=behind.v_end, control=None)
            return here._replace(bound=bound, short=short, over=over)
        # Nothing is better: the same chart goes on under a lower bound, down to the hard one.
        Phi, bounds = self.robot.chart.constraint_jacobian(q[None]), np.array([stand.bound])
        (bound,) = lowered_bounds(chart, Phi, bounds, np.array([chart.pivot(q)])).tolist()
        return here._replace(bound=bound) if bound and t < self.end else None

    def _looked(self, stand: Stand) -> Stand:
        """Return a stand at the end of a short segment: its bound is raised if the pivots have
        recovered, else it is looked at later."""
        if stand.chart.pivot(stand.q) > RECOVERED * SOFT:
            return stand._replace(bound=SOFT, short=self.shortest, since=None)
        return stand._replace(short=2 * stand.short, since=None)

    def until(self, stand: Stand) -> float:
        """Return the time at which the segment from a stand on ends: steps of fixed length end at
        their multiples under a lowered bound, too."""
        if stand.bound == SOFT:
            return self.end
        until, step = stand.looked + stand.short, self.settings.integrator.step
        return min(until if step is None else step * float(np.ceil(until / step - 1e-9)), self.end)

    def _again(
        self, stand: Stand, done: Trajectory, save_at: np.ndarray | None, row: int
    ) -> Trajectory:
        """Integrate a segment again. Samples within a step may have a weaker pivot than its ends,
        which kept to the bound."""
        until = self.until(stand)
        stand = stand if save_at is None else stand._replace(bound=LOWER * stand.bound)
        if stand.control is None:
            return self._along(stand, until, save_at, self.system.inputs)
        held = stand.control.held
        if row >= 0:
            held = done.u[row, done.u.shape[1] - held.size :]
            at = float(done.t[row]), done.q[row], done.v[row]
            stand = stand._replace(t=at[0], q=at[1], v=at[2], turns=None, first_step=None)
        end = float(done.t[row + 1]) if row + 1 < len(done.t) else done.end_time
        inputs = stack(self.system.inputs, as_signal(held))
        return self._along(stand._replace(control=None), end, save_at, inputs)

    def _integrate(self, stand: Stand) -> Trajectory:
        end, save_at = self.until(stand), self.settings.save_at
        if save_at is not None and not (stand.t == self.start and end == self.end):
            save_at = save_at[(save_at >= stand.t) & ((save_at <= end) | (end == self.end))]
        return self._along(stand, end, save_at, self.system.inputs)

    def _along(
        self, stand: Stand, end: float, save_at: np.ndarray | None, inputs: Signal
    ) -> Trajectory:
        chart, t, settings = stand.chart, stand.t, self.settings
        first = t == self.start and stand.method is settings.integrator
        steps = min(stand.steps, portion(stand.q.size))
        pace = stand.pace or (self.pace if first else None) or stand.first_step
        y, problem = np.concatenate((stand.q, stand.v)), self.problem(chart, stand.method, inputs)
        if any(stand.trial):
            steps = stand.trial.portion(steps)
            problem = problem._replace(leave_stiff=problem.leave_stiff and not stand.trial.waits)
        going_on = stand.bound, steps, save_at, pace, stand.control, stand.turns
        return advanced(problem, y, TimeSpan(stand.q.size, t, end, *going_on))

    def problem(self, chart: CompiledChart, method: Method, inputs: Signal) -> Problem:
        """Return what is integrated in a chart, and how."""
        system, settings, robot, turning = self.system, self.settings, self.robot, self.turning
        size = robot.equations.nq + robot.mobility + len(system.states)
        tolerances = system.tolerances(chart, settings.rtol, settings.atol, size)
        p = system.p(chart)
        return Problem(
            system.motion(chart),
            chart.single("closure_step").early_address if robot.equations.constrained else 0,
            self.with_jacobian.jacobian(chart) if method.stiff else 0,
            p,
            inputs,
            self.watch if system.acting else None,
            system.conditions(chart, self.watching) if system.acting else None,
            method,
            tolerances,
            settings.max_step,
            settings.max_steps,
            CLOSURE * robot.size,
            settings.leave_stiff,
            turning,
            bool(robot.redundant),
        )

    @cached_property
    def with_jacobian(self) -> System:
        """The same system, with the kernel that stiff methods need."""
        return with_jacobian(self.robot, self.system)

    def faced(self, chart: CompiledChart, q: np.ndarray) -> CompiledChart:
        """Return a chart with its pivots positive at q."""
        faced = chart.facing(q)
        return chart if faced is chart else self.robot.run_charts.setdefault(faced.key, faced)

    def _over(self, stand: Stand, done: Trajectory) -> Segment | None:
        """Return the way over the singular pose ahead of where a trajectory ended, None where there
        is no smooth one."""
        if self.system.sampler:
            return None
        chart, settings = stand.chart, self.settings
        held_to = CLOSURE * self.robot.size, settings.atol, settings.rtol
        crossing, start = Crossing(chart, self.system, *held_to), (stand.t, stand.q, stand.v)
        crossed = crossing.over(*start)
        if crossed is None:
            return None
        trajectory = crossing.recorded(crossed, done, self.end, settings.save_at)
        return Segment(chart, trajectory, start, stand.method.name, crossed=crossed)


def portion(nq: int) -> int:
    """Return after how many steps a run of nq coordinates looks whether it is interrupted: a matter
    of tenths of a second, and of the robot alone."""
    return max(LEAST, min(MOST, WORK // max(nq, 1) ** 2))


def chosen(robot: Model, chart: CompiledChart, q: bytes) -> Choice:
    """Return what a run goes on in that leaves a chart at q, told by its bytes."""
    return choice(robot, chart, np.frombuffer(q))
