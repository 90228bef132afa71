"""Recording: run from a state, and name and measure what was computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.mechanism.files import written
from linkwork.robot import checks, derived, limits
from linkwork.robot.crossing import evaluated
from linkwork.robot.labels import POSES
from linkwork.robot.passage import Passage, Segment
from linkwork.robot.reactions import COMPONENTS
from linkwork.robot.state import State
from linkwork.robot.system import System
from linkwork.simulation import Control, Run, Statistics, Status, Variable
from linkwork.simulation.run import Deferred

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot

STATES = (
    *("joint_position", "joint_rate", "joint_acceleration", "actuator_force", "kinetic_energy", "potential_energy"),
    *("closure_error", "tool_pose", "drive_state", "command", "external_wrench"),
)
ON_SINGULAR = ("stop", "step_over")
CULPRITS = " The controller's force on {} is not finite there."
AHEAD = (1e-12, 1e-9, 1e-6, 1e-3)  # times after the end of a run at which undefined forces are looked for [s]


def simulate(
    robot: Robot,
    state: State,
    system: System,
    duration: float,
    save_at: ArrayLike | None,
    on_singular: str,
    options: Mapping[str, Any],
    start: float = 0.0,
    z: np.ndarray | None = None,
    control: Control | None = None,
) -> Run:
    """Run a system from a state and record positions, rates, accelerations, forces, tool, energies and closure over time.

    start: time at the start [s]; z: extra states there, the system's own if left out; control: what is held there
    """
    if state.batch:
        raise checks.LinkworkError("a run starts from one state, not from a stack; take one by state.at(index)")
    if on_singular not in ON_SINGULAR:
        raise checks.LinkworkError(f"on_singular is {on_singular!r}; give {' or '.join(map(repr, ON_SINGULAR))}")
    times = None if save_at is None else np.atleast_1d(checks.finite(save_at, "save_at"))
    passage = Passage(robot, system, start, start + duration, times, on_singular == "step_over", options)
    home, chart = robot.charts[state.independent], robot.run_chart
    v = state.rates if chart is home else chart.from_tree(home.tree_rates(state.q, state.rates))
    segments = list(passage.segments(chart, state.q, v, system.start if z is None else z, control))
    for fault in system.faults:
        if not isinstance(fault, Exception):
            raise fault
    attrs = asked(robot, system, options) | {"charts": charts_taken(segments)} | final(segments[-1])
    return record(robot, system, segments, attrs)


def asked(robot: Robot, system: System, options: Mapping[str, Any]) -> dict[str, object]:
    """Return what a run was asked for: whose it is, the method and its tolerances or step, and values of parameters."""
    method = options["method"]
    told: dict[str, object] = {"mechanism": robot.mechanism.name, "method": method.name}
    told |= {"rtol": options["rtol"], "atol": options["atol"]} if method.step is None else {"step": method.step}
    own = system.acting.parameters if system.acting else ()
    values = robot.parameters | dict(zip(own, system.parameters.tolist(), strict=True))
    return told | (
        {"parameters": ", ".join(f"{name} = {value:.12g}" for name, value in values.items())} if values else {}
    )


def final(segment: Segment) -> dict[str, object]:
    """Return what a run can be resumed from: time, coordinates, rates with extra states, and the next step."""
    last = segment.trajectory
    return {
        "final_time": last.end_time,
        "final_q": last.q_end.copy(),
        "final_v": last.v_end.copy(),
        "final_rates": ", ".join(segment.chart.independent),
        "final_pace": np.array(list(vars(last.pace).values())),
    } | (
        {} if last.control is None else {"final_held": last.control.held, "final_sample": last.control.next_sample or 0}
    )


def charts_taken(segments: Sequence[Segment]) -> str:
    """Say in which independent rates the run was integrated, from when on."""
    taken, last = [], ()
    for segment in segments:
        if segment.chart.independent != last:
            start = segment.trajectory.t[0] if len(segment.trajectory.t) else segment.trajectory.end_time
            taken.append(f"from {start:.6g} s: {', '.join(segment.chart.independent)}")
            last = segment.chart.independent
    return "; ".join(taken)


def record(robot: Robot, system: System, segments: Sequence[Segment], attrs: Mapping[str, object]) -> Run:
    """Name what a run's segments hold; what follows from it at the saved times is measured when it is first asked for."""
    kept = trimmed(segments)
    time = np.concatenate([segment.trajectory.t[rows] for segment, rows in kept])
    coords = {
        "time": Variable(("time",), time, {"units": "s"}),
        "coordinate": labels("coordinate", robot.coordinates, [robot.unit(label) for label in robot.coordinates]),
        "rate": labels("rate", robot.rates, [f"{robot.unit(label)}/s" for label in robot.rates]),
        "actuator": labels("actuator", robot.actuators),
    }
    if any(spring.damping for spring in robot.mechanism.springs.values()):
        coords["spring"] = labels("spring", tuple(robot.mechanism.springs))
    if robot.mechanism.tools:
        coords["pose"] = labels("pose", POSES[robot.planar])
    if system.extras:
        coords["extra"] = labels("extra", [x.name for x in system.extras], [x.unit for x in system.extras])
    if system.acting and system.acting.wrenches:
        coords["wrench"] = labels("wrench", [f"{i}: {w.body}" for i, w in enumerate(system.acting.wrenches)])
        coords["wrench_component"] = labels("wrench_component", COMPONENTS)
    if system.events:
        found = [segment.trajectory.events for segment in segments]
        happened = np.concatenate([part.index for part in found])
        coords["event"] = labels("event", [system.events[i].name for i in happened])
        coords["event_time"] = Variable(("event",), np.concatenate([part.times for part in found]), {"units": "s"})
    status, message = ending(system, segments[-1])
    variables = Record(robot, system, kept, time).variables
    error = system.faults[0] if system.faults else None
    transmitted = partial(derived.run_reactions, robot, system, kept)
    described = partial(written, robot.mechanism)
    return Run(variables, coords, dict(attrs), status, message, statistics(segments), error, transmitted, described)


def ending(system: System, segment: Segment) -> tuple[Status, str]:
    """Return the status and the sentence with which a run ended."""
    last = segment.trajectory
    if system.faults:
        fault, status = system.faults[0], Status.CALLBACK_FAILED
        return status, status.sentence(time=last.end_time, error=f"{type(fault).__name__}: {fault}")
    if last.status is Status.SINGULAR:
        return last.status, last.message + (
            " No choice of independent rates determines the motion there: branches of motion meet (a bifurcation), or "
            "it ends; on_singular='step_over' continues on a smooth branch where there is one."
        )
    if last.status is Status.EVENT:
        name = system.events[int(last.events.index[-1])].name
        return last.status, f"The run was ended by the event {name!r} at t = {last.end_time:.9g} s."
    if last.status is Status.NON_FINITE:
        return last.status, last.message + undefined(system, segment)
    return last.status, last.message


def undefined(system: System, segment: Segment) -> str:
    """Name the actuators whose forces are not finite where a run ended, or just behind; nothing if there are none."""
    if system.acting is None:
        return ""
    last, names = segment.trajectory, system.acting.names.actuators
    if last.control is not None:
        newest = last.control.held[-len(names) :]
        lost = [name for name, force in zip(names, newest, strict=True) if not np.isfinite(force)]
        return CULPRITS.format(", ".join(lost)) if lost else ""
    y, p = np.concatenate([last.q_end, last.v_end]), system.p(segment.chart)
    motion, recorded = (system.kernel(segment.chart, name) for name in ("motion", "recorded"))
    for ahead in (0.0, *AHEAD):
        x = np.concatenate([y, system.inputs(last.end_time + ahead), p])
        slope = evaluated(motion, x)[: y.size]
        x[: y.size] += ahead * np.where(np.isfinite(slope), slope, 0.0)
        forces = evaluated(recorded, x)[segment.chart.equations.mobility :][: 2 * len(names)].reshape(2, -1)
        lost = [name for name, force in zip(names, forces.T, strict=True) if not np.isfinite(force).all()]
        if lost:
            return CULPRITS.format(", ".join(lost))
    return ""


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


@dataclass(frozen=True, eq=False)
class Record:
    """Measure what follows from a run's states at the saved times (K,), each kind of quantities when first asked for."""

    robot: Robot
    system: System
    kept: Sequence[tuple[Segment, slice]]
    time: np.ndarray

    @property
    def variables(self) -> Deferred:
        kinds = {STATES: self.states, derived.POWERS: self.powers, derived.BALANCE: self.balance}
        return Deferred({names: partial(self.named, quantities) for names, quantities in kinds.items()})

    def named(self, quantities: Callable[[], Mapping[str, derived.Quantity]]) -> dict[str, Variable]:
        """Return quantities over time as variables."""
        return {
            name: Variable(("time", *axes), values, {"units": unit})
            for name, (axes, values, unit) in quantities().items()
        }

    @cached_property
    def of(self) -> dict[str, np.ndarray]:
        """What was measured (K, ...), by name."""
        parts = [measured(segment, rows, self.system) for segment, rows in self.kept]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def states(self) -> dict[str, derived.Quantity]:
        """Return positions, rates and accelerations of all joints, forces, energies, tool and closure."""
        of = self.of
        positions, rates = of["positions"], of["rates"]
        quantities = {
            "joint_position": (("coordinate",), self.robot.labels.unwrapped(self.time, positions, rates), "m, rad"),
            "joint_rate": (("rate",), rates, "m/s, rad/s"),
            "joint_acceleration": (("rate",), of["accelerations"], "m/s^2, rad/s^2"),
            "actuator_force": (("actuator",), of["force"], "N, N m"),
            "kinetic_energy": ((), of["kinetic"], "J"),
            "potential_energy": ((), of["potential"], "J"),
            "closure_error": ((), of["residual"], "m, rad"),
        }
        if self.robot.mechanism.tools:
            quantities["tool_pose"] = (("pose",), self.robot.tool_poses(of["q"]), "m, rad")
        if self.system.extras:
            quantities["drive_state"] = (("extra",), of["z"], ", ".join(extra.unit for extra in self.system.extras))
        if self.system.acting:
            units = ", ".join(dict.fromkeys(drive.unit for drive in self.system.acting.drives))
            quantities["command"] = (("actuator",), of["command"], units)
        if self.system.acting and self.system.acting.wrenches:
            wrenches = of["wrenches"].reshape(len(self.time), -1, 6)
            quantities["external_wrench"] = (("wrench", "wrench_component"), wrenches, "N m, N")
        return quantities

    def powers(self) -> dict[str, derived.Quantity]:
        return derived.power_quantities(self.robot, self.system, self.kept, self.of)

    def balance(self) -> dict[str, derived.Quantity]:
        return derived.balance_quantities(self.robot, self.system, self.kept, self.of)


def measured(segment: Segment, rows: slice, system: System) -> dict[str, np.ndarray]:
    """Return what a segment's rows hold and what follows from it, by name; wrenches (moment, force) in the ground's axes."""
    kernel, part, n = segment.chart.kernel, segment.trajectory, segment.chart.equations.mobility
    q, v, z, u = part.q[rows], part.v[rows, :n], part.v[rows, n:], part.u[rows]
    found = {"q": q, "v": v, "z": z, "force": u, "residual": part.residual[rows]}
    if system.acting is None:
        v_dot = kernel("motion")(q, v, u)[1]
    else:
        p = system.p(segment.chart)
        v_dot, *values = system.kernel(segment.chart, "recorded")(q, v, z, u, p)
        found |= dict(zip(("command", "force", "wrenches"), values, strict=True))
    positions, joint_rates, joint_accelerations, _ = kernel("joints_motion")(q, v, v_dot)
    kinetic, potential, _ = kernel("energy")(q, v)
    found |= {"positions": positions, "rates": joint_rates, "accelerations": joint_accelerations}
    return found | {"kinetic": kinetic[:, 0], "potential": potential[:, 0]}


def passed_limits(robot: Robot, run: Run) -> tuple[str, ...]:
    """Return one sentence for each joint limit that is passed at a run's saved times."""
    positions = run.variables["joint_position"].values
    return limits.passed(robot.mechanism, robot.coordinates, positions, run.coords["time"].values)


def labels(axis: str, names: Sequence[str], units: Sequence[str] = ()) -> Variable:
    attrs = {"unit_of_each": ", ".join(units)} if units else {}
    return Variable((axis,), np.array(names, dtype=object), attrs)
