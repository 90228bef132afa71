"""Recording: run from a state, and name and measure what was computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.robot import checks, limits
from linkwork.robot.passage import Passage, Segment
from linkwork.robot.state import State
from linkwork.simulation import Run, Sampled, Signal, Statistics, Status, Variable, as_signal
from linkwork.simulation.run import Deferred

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot

Forces = ArrayLike | Mapping[str, float] | Sampled | Signal | None
ON_SINGULAR = ("stop", "step_over")


def simulate(
    robot: Robot,
    state: State,
    forces: Forces,
    duration: float,
    save_at: ArrayLike | None,
    on_singular: str,
    options: Mapping[str, Any],
) -> Run:
    """Run from a state and record positions, rates, accelerations, forces, tool, energies and closure over time."""
    if state.batch:
        raise checks.LinkworkError("a run starts from one state, not from a stack; take one by state.at(index)")
    if on_singular not in ON_SINGULAR:
        raise checks.LinkworkError(f"on_singular is {on_singular!r}; give {' or '.join(map(repr, ON_SINGULAR))}")
    times = None if save_at is None else np.atleast_1d(checks.finite(save_at, "save_at"))
    passage = Passage(robot, as_input(robot, forces), duration, times, on_singular == "step_over", options)
    home, start = robot.charts[state.independent], robot.run_chart
    v = state.rates if start is home else start.from_tree(home.tree_rates(state.q, state.rates))
    segments = list(passage.segments(start, state.q, v))
    attrs = {"mechanism": robot.mechanism.name, "rtol": options["rtol"], "atol": options["atol"]}
    return record(robot, segments, attrs | {"charts": charts_taken(segments)})


def as_input(robot: Robot, forces: Forces) -> Signal:
    """Return actuator forces as a signal: zero, constant, by name, or sampled."""
    n = len(robot.actuators)
    if forces is None:
        return as_signal(np.zeros(n))
    if isinstance(forces, Mapping):
        checks.known(forces, robot.actuators, "actuator")
        forces = [forces.get(name, 0.0) for name in robot.actuators]
    if not isinstance(forces, Sampled | Signal):
        forces = checks.values_by_name(forces, robot.actuators, "forces")
    signal = as_signal(forces)
    if signal.coefficients.shape[2] != n:
        raise checks.LinkworkError(
            f"the forces have {signal.coefficients.shape[2]} columns; give {n}: {', '.join(robot.actuators)}"
        )
    return signal


def charts_taken(segments: Sequence[Segment]) -> str:
    """Say in which independent rates the run was integrated, from when on."""
    taken, last = [], ()
    for segment in segments:
        if segment.chart.independent != last:
            start = segment.trajectory.t[0] if len(segment.trajectory.t) else segment.trajectory.end_time
            taken.append(f"from {start:.6g} s: {', '.join(segment.chart.independent)}")
            last = segment.chart.independent
    return "; ".join(taken)


def record(robot: Robot, segments: Sequence[Segment], attrs: Mapping[str, object]) -> Run:
    """Name what a run's segments hold; what follows from it at the saved times is measured when it is first asked for."""
    kept = trimmed(segments)
    time = np.concatenate([segment.trajectory.t[rows] for segment, rows in kept])
    coords = {
        "time": Variable(("time",), time, {"units": "s"}),
        "coordinate": labels("coordinate", robot.coordinates, [robot.unit(label) for label in robot.coordinates]),
        "rate": labels("rate", robot.rates, [f"{robot.unit(label)}/s" for label in robot.rates]),
        "actuator": labels("actuator", robot.actuators),
    }
    if robot.mechanism.tools:
        coords["pose"] = labels("pose", ("x", "y", "angle") if robot.planar else ("x", "y", "z", "rx", "ry", "rz"))
    last = segments[-1].trajectory
    message = last.message
    if last.status is Status.SINGULAR:
        message += (
            " No choice of independent rates determines the motion there: branches of motion meet (a bifurcation), or "
            "it ends; on_singular='step_over' continues on a smooth branch where there is one."
        )
    variables = Deferred(partial(measure, robot, kept, time))
    return Run(variables, coords, dict(attrs), last.status, message, statistics(segments))


def trimmed(segments: Sequence[Segment]) -> list[tuple[Segment, slice]]:
    """Return the segments with the rows to keep: an instant saved by two of them is kept once."""
    kept, end = [], -np.inf
    for segment in segments:
        t = segment.trajectory.t
        first = int(np.searchsorted(t, end, side="right"))
        kept.append((segment, slice(first, len(t))))
        end = t[-1] if len(t) else end
    return kept


def statistics(segments: Sequence[Segment]) -> Statistics:
    """Add up what the segments took."""
    parts = [segment.trajectory for segment in segments]
    weakest = min(parts, key=lambda part: part.pivot)
    return Statistics(
        nfev=sum(part.nfev for part in parts),
        steps=sum(part.steps for part in parts),
        rejected=sum(part.rejected for part in parts),
        projections=sum(part.projections for part in parts),
        closure_error=max(part.closure_error for part in parts),
        pivot=weakest.pivot,
        pivot_time=weakest.pivot_time,
    )


def measure(robot: Robot, kept: Sequence[tuple[Segment, slice]], time: np.ndarray) -> dict[str, Variable]:
    """Return positions, rates and accelerations of all joints, forces, energies, tool and closure over time."""
    parts = [measured(segment, rows) for segment, rows in kept]
    q, u, residual, positions, rates, accelerations, kinetic, potential = map(np.concatenate, zip(*parts, strict=True))
    quantities = {
        "joint_position": ("coordinate", robot.labels.unwrapped(time, positions, rates), "m, rad"),
        "joint_rate": ("rate", rates, "m/s, rad/s"),
        "joint_acceleration": ("rate", accelerations, "m/s^2, rad/s^2"),
        "actuator_force": ("actuator", u, "N, N m"),
        "kinetic_energy": (None, kinetic, "J"),
        "potential_energy": (None, potential, "J"),
        "closure_error": (None, residual, "m, rad"),
    }
    if robot.mechanism.tools:
        quantities["tool_pose"] = ("pose", robot.tool_poses(q), "m, rad")
    return {
        name: Variable(("time", axis) if axis else ("time",), values, {"units": unit})
        for name, (axis, values, unit) in quantities.items()
    }


def measured(segment: Segment, rows: slice) -> tuple[np.ndarray, ...]:
    """Return q, u, residual, positions, rates and accelerations of all joints, and energies, in a segment's rows."""
    kernel, part = segment.chart.kernel, segment.trajectory
    q, v, u = part.q[rows], part.v[rows], part.u[rows]
    v_dot = kernel("motion")(q, v, u)[1]
    positions, joint_rates, joint_accelerations, _ = kernel("joints_motion")(q, v, v_dot)
    kinetic, potential, _ = kernel("energy")(q, v)
    return q, u, part.residual[rows], positions, joint_rates, joint_accelerations, kinetic[:, 0], potential[:, 0]


def passed_limits(robot: Robot, run: Run) -> tuple[str, ...]:
    """Return one sentence for each joint limit that is passed at a run's saved times."""
    positions = run.variables["joint_position"].values
    return limits.passed(robot.mechanism, robot.coordinates, positions, run.coords["time"].values)


def labels(axis: str, names: Sequence[str], units: Sequence[str] = ()) -> Variable:
    attrs = {"unit_of_each": ", ".join(units)} if units else {}
    return Variable((axis,), np.array(names, dtype=object), attrs)
