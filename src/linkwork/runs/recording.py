"""Recording: run from a state, and name and measure what was computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkwork.control.sampler import Sampler
from linkwork.control.tracing import reason
from linkwork.mechanism.files import written
from linkwork.model import chart_transfer, checks, limits
from linkwork.model.state import State
from linkwork.runs.accuracy import (
    WORTH_TELLING,
    Compared,
    Departure,
    called_alike,
    without_turns,
)
from linkwork.runs.fault_sources import fault_source
from linkwork.runs.next_chart import lost
from linkwork.runs.passage import Passage, Segment
from linkwork.runs.quantities import AXES
from linkwork.runs.run_record import RunRecord
from linkwork.runs.settings import Settings
from linkwork.runs.stiff_sources import stiff_source
from linkwork.runs.system import System
from linkwork.simulation import RODAS, Control, Pace, Run, Statistics, Status, Variable
from linkwork.simulation.run import SINGULAR_TIMES
from linkwork.simulation.signals import require_increasing
from linkwork.simulation.variables import Deferred

if TYPE_CHECKING:
    from linkwork.model.model import Model

COORDS = ("time", *AXES, "event", "event_time")
MOST_TOLD = 8  # singular poses whose times the message tells
ASKED = ("mechanism", "rtol", "atol", "step", "caveats", "parameters")
TOLD = (
    *("method", "charts", SINGULAR_TIMES),
    *(f"final_{name}" for name in ("time", "q", "v", "rates", "pace", "held", "turns")),
)
WOUND = ("final_windings",)
ERROR = ("error_estimate", "error_estimate_until")


class Left(NamedTuple):
    """Hold what a run had at its end, from which it is resumed, beside its state.

    time: [s]; extras: extra states; pace: step size
    held: inputs that a sampled controller held; turns: whole turns of angles that are not in the
    state's q
    """

    time: float
    extras: np.ndarray
    pace: Pace
    held: np.ndarray | None
    turns: np.ndarray | None


def simulate(
    robot: Model, state: State, system: System, settings: Settings, left: Left | None = None
) -> Run:
    """Run a system from a state and record positions, rates, accelerations, forces, tool, energies
    and closure over time.

    left: what a run that is resumed had at its end
    """
    if state.q.ndim > 1:
        raise checks.LinkworkError(
            "a run starts from one state, not from a stack; take one by state.at(index)"
        )
    start, z, pace, held, turns = left or (0.0, None, None, None, None)
    if settings.integrator.step is not None:
        pace = None
    control = None
    if held is not None and system.sampler:
        control = Control(0, system.sampler.period, held)
    end = start + settings.duration
    end, besides = start + settings.duration, np.empty(0)
    if settings.samples is not None:
        settings = settings.saved_from(start)
    if settings.save_at is not None and system.sampler:
        settings, besides = called_besides(system.sampler, settings, start, end)
    passage = Passage(robot, system, start, end, settings, pace, interruptible=True)
    chart, v = chart_transfer.start(robot, state)
    begun = Departure(
        chart, state.q, v, system.start(robot, state.positions, state.q, z), control, turns
    )
    segments = list(passage.segments(begun))
    return record(Compared(robot, passage, begun, segments), state, besides)


def again(made: Compared, state: State, samples: int | np.ndarray | None) -> Run:
    """Carry out a run once more, saved at other times [s], at so many from its start to where it
    ended, or (None) at every step."""
    passage, besides = made.passage, np.empty(0)
    last = made.segments[-1].trajectory.end_time
    times = np.linspace(passage.start, last, samples) if isinstance(samples, int) else samples
    settings = passage.settings.but(save_at=times)
    if passage.system.sampler and times is not None:
        given = passage.system.sampler, settings, passage.start, passage.end
        settings, besides = called_besides(*given)
    passage = replace(passage, settings=settings, interruptible=False)
    leading = passage
    if passage.system.faults:  # it was interrupted: it is to come as far, not further
        leading = replace(passage, system=replace(passage.system, faults=[]), end=last)
    segments = list(leading.segments(made.start))
    return record(replace(made, passage=passage, segments=segments), state, besides)


def called_besides(
    sampler: Sampler, settings: Settings, start: float, end: float
) -> tuple[Settings, np.ndarray]:
    """Return settings that save when a sampled controller is called, too, and those times [s]."""
    require_increasing("the times in save_at", settings.save_at)
    besides = np.setdiff1d(calls(sampler, start, end, settings.max_steps), settings.save_at)
    return settings.but(save_at=np.union1d(settings.save_at, besides)), besides


def calls(sampler: Sampler, start: float, end: float, most: int) -> np.ndarray:
    """Return the start of a run and when a sampled controller is called after it, the first `most`
    times [s]."""
    first = int(start / sampler.period)
    times = np.arange(first, min(int(end / sampler.period), first + most) + 2) * sampler.period
    return np.append(start, times[(times > start) & (times < end)])


def asked(robot: Model, system: System, settings: Settings) -> dict[str, object]:
    """Return what a run was asked for: whose it is, tolerances or step, and values of
    parameters."""
    found: dict[str, object] = {"mechanism": robot.mechanism.name, **settings.told}
    own = system.acting.parameters if system.acting else ()
    values = robot.parameters | dict(zip(own, system.parameters.tolist(), strict=True))
    if robot.mechanism.caveats:
        found["caveats"] = "\n".join(robot.mechanism.caveats)
    if values:
        found["parameters"] = ", ".join(
            f"{name} = {float(value)!r}" for name, value in values.items()
        )
    return found


def told(system: System, segments: Sequence[Segment]) -> dict[str, object]:
    """Return methods and charts taken, and what a run can be resumed from: time, coordinates,
    rates, extras, next step."""
    last = segments[-1].trajectory
    found: dict[str, object] = {
        "method": methods_taken(segments),
        "charts": charts_taken(segments),
        "final_time": last.end_time,
        "final_q": last.q_end.copy(),
        "final_v": last.v_end[: len(segments[-1].chart.independent) + len(system.extras)].copy(),
        "final_rates": ", ".join(segments[-1].chart.independent),
        "final_pace": np.array(astuple(last.pace)),
    }
    passed = singular_times(segments)
    if passed:
        found[SINGULAR_TIMES] = np.array(passed)
    if last.control:
        found["final_held"] = held_last(system, last.control)
    if last.turns.any():
        found["final_turns"] = last.turns.copy()
    return found


def singular_times(segments: Sequence[Segment]) -> list[float]:
    """Return when singular poses were stepped over [s]."""
    times = [
        (segment.crossed.singular, segment.trajectory.end_time)
        for segment in segments
        if segment.crossed
    ]
    return [time for time, end in times if time is not None and time <= end]


def held_last(system: System, control: Control) -> np.ndarray:
    """Return the inputs that a sampled controller held last, oldest first: before its last call
    where that failed.

    What that call pushed out is not known any more; nor is it needed, for the call is repeated
    first of all.
    """
    assert system.acting is not None
    if np.isfinite(control.held).all():
        return control.held
    n = len(system.acting.names.actuators)
    return np.concatenate([np.zeros(n), control.held[:-n]])


def methods_taken(segments: Sequence[Segment]) -> str:
    """Name the method, and that which a stiff run went on with, from when on."""
    first, last = segments[0].method, segments[-1].method
    begun = next(segment.start[0] for segment in segments if segment.method == last)
    return first if first == last else f"{first}, from {begun:.6g} s {last}"


def charts_taken(segments: Sequence[Segment]) -> str:
    """Say in which independent rates the run was integrated, from when on."""
    taken, last = [], ()
    for segment in segments:
        if segment.chart.independent != last:
            taken.append(f"from {segment.start[0]:.6g} s: {', '.join(segment.chart.independent)}")
            last = segment.chart.independent
    return "; ".join(taken)


def record(made: Compared, state: State, besides: np.ndarray) -> Run:
    """Name what a run's segments hold; what is asked of it, and what follows, is found when it is
    first asked for."""
    robot, system, segments, settings = (
        made.robot,
        made.passage.system,
        made.segments,
        made.passage.settings,
    )
    for fault in system.faults:
        if not isinstance(fault, Exception | KeyboardInterrupt):
            raise fault
    of = RunRecord(robot, system, segments, besides, state, settings.save_at is None)

    def sentences() -> str:
        _, message = ending(system, segments)
        adaptive, found = settings.integrator.step is None, made.estimate
        return (
            f"{message} {found}" if adaptive and found and found.ratio > WORTH_TELLING else message
        )

    def error() -> dict[str, object]:
        found = made.estimate
        ratio, until = (found.ratio, found.until) if found else (np.nan, np.nan)
        return {"error_estimate": ratio, "error_estimate_until": until}

    return Run(
        variables=of,
        coords=Deferred({COORDS: of.coords}),
        attrs=Deferred(
            {
                ASKED: partial(asked, robot, system, settings),
                TOLD: partial(told, system, segments),
                WOUND: of.final_windings,
                ERROR: error,
            }
        ),
        status=end(system, segments[-1]),
        message=sentences,  # pyright: ignore[reportArgumentType]
        statistics=partial(statistics, segments),  # pyright: ignore[reportArgumentType]
        error=system.faults[0] if system.faults else None,
        transmitted=of.reactions,
        errors=partial(errors, made, of) if made.known else None,
        ended=of.final,
        again=partial(again, made, state) if called_alike(system) else None,
        every=of.every,
        described=partial(written, robot.mechanism),
    )


def errors(made: Compared, of: RunRecord) -> dict[str, Variable]:
    """Return by how much a run differs from its companion at its saved times: positions and rates,
    and drive states."""
    other = RunRecord(made.robot, of.system, made.companion, np.empty(0), of.start, False)
    places = np.searchsorted(other.time, of.time[of.time <= other.time[-1]])
    found = {}
    for name in ("joint_position", "joint_rate", "drive_state"):
        if name in of:
            variable, exact = of[name], other[name].values[places]
            d = variable.values - np.pad(
                exact, [(0, len(of.time) - len(exact)), (0, 0)], constant_values=np.nan
            )
            units = [made.robot.unit(label) for label in made.robot.coordinates]
            found[name] = replace(
                variable, values=without_turns(d, units) if name == "joint_position" else d
            )
    return found


def ending(system: System, segments: Sequence[Segment]) -> tuple[Status, str]:
    """Return the status and the sentences with which a run ended."""
    status, message = ended(system, segments[-1])
    passed = [f"{time:.9g}" for time in singular_times(segments)]
    if not passed:
        return status, message
    which = "a singular pose" if len(passed) == 1 else f"{len(passed)} singular poses"
    return (
        status,
        (
            f"{message} It stepped over {which}, at t = "
            f"{', '.join(passed[:MOST_TOLD])}{' ...' * (len(passed) > MOST_TOLD)} s."
        ),
    )


def end(system: System, segment: Segment) -> Status:
    """Return the status with which a run's last segment ended."""
    if not system.faults:
        return segment.trajectory.status
    return (
        Status.CANCELLED
        if isinstance(system.faults[0], KeyboardInterrupt)
        else Status.CALLBACK_FAILED
    )


def ended(system: System, segment: Segment) -> tuple[Status, str]:
    """Return the status and the sentence with which a run's last segment ended."""
    last = segment.trajectory
    if system.faults:
        status = end(system, segment)
        return status, status.sentence(time=last.end_time, error=reason(system.faults[0]))
    if last.status is Status.SINGULAR and not lost(segment.chart, last.q_end):
        return last.status, last.message + (
            f" The motion is given in the rates {', '.join(segment.chart.independent)}, which do "
            "not determine it there; others do: give the state at rest in these, by "
            "robot.in_chart, and then its rates."
        )
    if last.status is Status.SINGULAR:
        return last.status, last.message + (
            " No choice of independent rates determines the motion there: branches of motion "
            "meet (a bifurcation), or it ends; on_singular='step_over' continues on a smooth "
            "branch where there is one."
        )
    if last.status is Status.EVENT:
        name = next(
            event.name
            for event in map(system.events.__getitem__, last.events.index)
            if event.terminal
        )
        return last.status, f"The run was ended by the event {name!r} at t = {last.end_time:.9g} s."
    if last.status is Status.NON_FINITE:
        found = fault_source(system, segment)
        return last.status, last.status.sentence(
            **last.outcome._asdict(), **last.bounds, fault_source=found
        )
    return last.status, used_up(system, segment) or last.message


def used_up(system: System, segment: Segment) -> str:
    """Return the sentence of a run whose explicit steps something stiff bounded until they were
    used up; nothing of others."""
    last = segment.trajectory
    if last.status is not Status.TOO_MANY_STEPS or segment.method == RODAS.name:
        return ""
    found = stiff_source(system, segment)
    facts = {**last.outcome._asdict(), **last.bounds, "remedy": f"or {found}"}
    return last.status.sentence(**facts) if found else ""


def statistics(segments: Sequence[Segment]) -> Statistics:
    """Add up what the segments took."""
    parts = [segment.trajectory for segment in segments]
    counts = zip(
        *[(part.nfev, part.steps, part.rejected, part.projections) for part in parts], strict=True
    )
    error, weakest = (
        max(closure_error(segment) for segment in segments),
        min(parts, key=attrgetter("pivot")),
    )
    return Statistics(
        *map(sum, counts), closure_error=error, pivot=weakest.pivot, pivot_time=weakest.pivot_time
    )


def closure_error(segment: Segment) -> float:
    """Return the largest gap of a segment, that of rows that are not held at its saved states and
    its end included."""
    part = segment.trajectory
    q = np.concatenate([part.q, part.y_end[None, : part.nq]])
    return max(part.closure_error, segment.chart.unheld_gap(q).max())


def passed_limits(robot: Model, run: Run) -> tuple[str, ...]:
    """Return one sentence for each joint limit that is passed at a run's saved times."""
    positions = run.variables["joint_position"].values
    return limits.passed(robot, positions, run.coords["time"].values)
