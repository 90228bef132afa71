"""Recording: run the integrator from a state, and name and measure what it computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.robot import checks
from linkwork.robot.state import State
from linkwork.simulation import Run, Sampled, Signal, Statistics, Trajectory, Variable, as_signal, integrate

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot

CLOSURE = 1e-13

Forces = ArrayLike | Mapping[str, float] | Sampled | Signal | None


def simulate(
    robot: Robot,
    state: State,
    forces: Forces,
    duration: float,
    rtol: float,
    atol: float,
    save_at: ArrayLike | None,
    max_step: float,
    max_steps: int,
) -> Run:
    """Integrate from a state and record positions, rates, accelerations, forces, tool, energies and closure over time."""
    if state.batch:
        raise checks.LinkworkError("a run starts from one state, not from a stack; take one by state.at(index)")
    trajectory = integrate(
        robot.kernel("motion").address,
        robot.kernel("closure_step").address if robot.equations.cuts else None,
        state.coordinates,
        state.rates,
        as_input(robot, forces),
        duration=duration,
        rtol=rtol,
        atol=atol,
        save_at=save_at,
        max_step=max_step,
        max_steps=max_steps,
        closure_tol=CLOSURE * size(robot),
    )
    return record(robot, trajectory, {"mechanism": robot.mechanism.name, "rtol": rtol, "atol": atol})


def size(robot: Robot) -> float:
    """Return the largest length in the description [m], at least 1: rounding in phi grows with it."""
    frames = [frame for joint in robot.mechanism.joints.values() for frame in joint.frames]
    return max(1.0, *(abs(x) for frame in frames for x in frame.position), *np.abs(robot.home.coordinates))


def as_input(robot: Robot, forces: Forces) -> Signal:
    """Return actuator forces (n) as a signal: zero, constant, by name, or sampled."""
    n = robot.mobility
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


def record(robot: Robot, trajectory: Trajectory, attrs: Mapping[str, object]) -> Run:
    """Name what a trajectory holds and measure at every saved time what follows from it."""
    q, v, u = trajectory.q, trajectory.v, trajectory.u
    _, v_dot, _ = robot.kernel("motion")(q, v, u)
    positions, rates, accelerations = robot.kernel("joints_motion")(q, v, v_dot)
    kinetic, potential = robot.kernel("energy")(q, v)
    joint_units = [robot.unit(name) for name in robot.joints]
    per_joint, per_actuator = ("time", "joint"), ("time", "actuator")
    variables = {
        "joint_position": Variable(per_joint, robot.unwrapped(positions), units("m, rad")),
        "joint_rate": Variable(per_joint, rates, units("m/s, rad/s")),
        "joint_acceleration": Variable(per_joint, accelerations, units("m/s^2, rad/s^2")),
        "actuator_force": Variable(per_actuator, u, units("N, N m")),
        "kinetic_energy": Variable(("time",), kinetic[:, 0], units("J")),
        "potential_energy": Variable(("time",), potential[:, 0], units("J")),
        "closure_error": Variable(("time",), trajectory.residual, units("m, rad")),
    }
    coords = {
        "time": Variable(("time",), trajectory.t, units("s")),
        "joint": Variable(("joint",), np.array(robot.joints, dtype=object), {"unit_of_each": ", ".join(joint_units)}),
        "actuator": Variable(("actuator",), np.array(robot.actuators, dtype=object)),
    }
    if robot.mechanism.tools:
        names = ["x", "y", "angle"] if robot.planar else ["x", "y", "z", "rx", "ry", "rz"]
        variables["tool_pose"] = Variable(("time", "pose"), robot.tool_poses(q), units("m, rad"))
        coords["pose"] = Variable(("pose",), np.array(names, dtype=object))
    statistics = Statistics(**{name: getattr(trajectory, name) for name in Statistics.__dataclass_fields__})
    return Run(variables, coords, dict(attrs), trajectory.status, trajectory.message, statistics)


def units(text: str) -> dict[str, str]:
    return {"units": text}
