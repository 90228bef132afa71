"""Sources of faults: name what is infinite or undefined where a run ended, of what the user gave
rather than of what it led to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkwork.model.charts import CompiledChart
from linkwork.model.not_finite import in_motion
from linkwork.runs.passage import Segment
from linkwork.runs.system import System

AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  # times after the end of a run at which it is looked for [s]


def fault_source(system: System, segment: Segment) -> str:
    """Return what is not finite: forces or wrenches that act there or just behind, else what the
    integrator came upon."""
    last, chart, n = segment.trajectory, segment.chart, segment.trajectory.q_end.size
    held = last.control.held if last.control else np.empty(0)
    y, p, fault = np.concatenate([last.q_end, last.v_end]), system.p(chart), int(last.outcome.fault)
    for ahead in AHEAD:
        u = np.concatenate([system.inputs(last.end_time + ahead), held])
        slope = system.single(chart, "motion").flat(y, u, p)
        moved = y + ahead * np.where(np.isfinite(slope), slope, 0.0)[: y.size]
        lost = undefined(system, chart, np.concatenate([moved, u, p]), u)
        if lost or (lost := in_motion(chart, moved[:n])):
            return lost
        if fault < 0 and not np.isfinite(slope).all():
            fault = int(np.isfinite(slope).argmin())
        if fault < 0 and system.events:
            values = system.kernel(chart, "events").flat(np.concatenate([moved, u, p]))
            if not np.isfinite(values).all():
                fault = y.size + 1 + held.size + int(np.isfinite(values).argmin())
    return (
        came_upon(system, chart, held.size)[fault]
        if fault >= 0
        else "what the equations of motion return"
    )


def undefined(system: System, chart: CompiledChart, x: np.ndarray, u: np.ndarray) -> str:
    """Return the forces and wrenches that are not finite for a kernel's input x; nothing if there
    are none."""
    acting, actuators = system.acting, chart.equations.mechanism.actuators
    if acting is None:
        return named("the force on", actuators, u[None])
    values = system.kernel(chart, "recorded").flat(x)[chart.equations.mobility :]
    ends = 2 * len(actuators), 2 * len(actuators) + 6 * len(acting.wrenches)
    held = u[u.size - acting.held :].reshape(acting.held // max(len(actuators), 1), len(actuators))
    forces = np.concatenate([values[: ends[0]].reshape(2, -1), held])
    bodies = [repr(wrench.body) for wrench in acting.wrenches]
    wrenches = values[ends[0] : ends[1]].reshape(-1, 6).T
    return named("the controller's force on", actuators, forces) or named(
        "the wrench on", bodies, wrenches
    )


def named(what: str, names: Sequence[str], columns: np.ndarray) -> str:
    """Return the names whose columns hold numbers that are not finite; nothing if there are
    none."""
    lost = [
        name for name, values in zip(names, columns.T, strict=True) if not np.isfinite(values).all()
    ]
    return f"{what} {', '.join(lost)}" if lost else ""


def came_upon(system: System, chart: CompiledChart, held: int) -> list[str]:
    """Return what the integrator looks through, in its order: y', the pivot, held inputs, functions
    of events."""
    tree = chart.equations.tree
    return [
        *(f"the rate of {name}" for name in tree.coordinates),
        *(f"the acceleration of {name}" for name in chart.independent),
        *(f"the rate of {extra.name}" for extra in system.states),
        "the pivot",
        *["a held input"] * held,
        *(f"the function of the event {event.name!r}" for event in system.events),
    ]
