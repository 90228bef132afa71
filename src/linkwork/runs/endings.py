"""Endings: what is told of a run beside its quantities: what was asked, what it took, how it
ended."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, astuple, replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from linkwork.control.tracing import reason
from linkwork.errors import LinkworkError
from linkwork.model import limits
from linkwork.runs.accuracy import Compared, without_turns
from linkwork.runs.fault_sources import fault_source
from linkwork.runs.next_chart import lost
from linkwork.runs.passage import Segment
from linkwork.runs.run_record import RunRecord
from linkwork.runs.settings import Settings
from linkwork.runs.stiff_sources import stiff_source
from linkwork.runs.system import System
from linkwork.simulation import RODAS, Control, Run, Statistics, Status, Variable
from linkwork.simulation.run import SINGULAR_TIMES

if TYPE_CHECKING:
    from linkwork.model.model import Model

MOST_TOLD = 8  # singular poses whose times the message tells
ASKED = ("mechanism", "rtol", "atol", "step", "caveats", "parameters")
TOLD = (
    *("method", "charts", SINGULAR_TIMES),
    *(f"final_{name}" for name in ("time", "q", "v", "rates", "chart", "pace", "held", "turns")),
    "final_lowered",
)
WOUND = ("final_windings",)
ERROR = ("error_estimate", "error_estimate_until")
WAY = "on_singular='step_over' continues on a smooth branch where there is one"
NO_WAY = "no way over it is sought while a controller is called at a fixed rate"


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
        "final_chart": json.dumps(asdict(segments[-1].chart.key)),
        "final_pace": np.array(astuple(last.pace)),
    }
    passed = singular_times(segments)
    if passed:
        found[SINGULAR_TIMES] = np.array(passed)
    if last.control:
        found["final_held"] = held_last(system, last.control)
    if segments[-1].lowered:
        found["final_lowered"] = np.array(segments[-1].lowered)
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
            f"meet (a bifurcation), or it ends; {NO_WAY if system.sampler else WAY}."
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
    error = max(closure_error(segment) for segment in segments)
    weakest = min(parts, key=attrgetter("pivot"))
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
    if tuple(run.coords["coordinate"].values) != robot.coordinates:
        raise LinkworkError(
            f"the run is one of another robot, with the joints "
            f"{', '.join(run.coords['coordinate'].values)}; give a run of this one"
        )
    positions, rates = (run.variables[f"joint_{what}"].values for what in ("position", "rate"))
    return limits.passed(robot, positions, rates, run.coords["time"].values)
