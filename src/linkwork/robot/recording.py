"""Recording: run the integrator from a state, and name and measure what it computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.robot import checks
from linkwork.robot.state import State
from linkwork.simulation import Run, Sampled, Signal, Statistics, Status, Trajectory, Variable, as_signal, integrate
from linkwork.simulation.run import Deferred

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
        closure_tol=CLOSURE * robot.size,
        pivot_bound=checks.PIVOT_BOUND,
    )
    return record(robot, trajectory, {"mechanism": robot.mechanism.name, "rtol": rtol, "atol": atol})


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
    """Name what a trajectory holds; what follows from it at the saved times is measured when it is first asked for."""
    coords = {
        "time": Variable(("time",), trajectory.t, {"units": "s"}),
        "joint": Variable(("joint",), names(robot.joints), {"unit_of_each": ", ".join(map(robot.unit, robot.joints))}),
        "actuator": Variable(("actuator",), names(robot.actuators)),
    }
    if robot.mechanism.tools:
        pose = ("x", "y", "angle") if robot.planar else ("x", "y", "z", "rx", "ry", "rz")
        coords["pose"] = Variable(("pose",), names(pose))
    message = trajectory.message
    if trajectory.status is Status.SINGULAR:
        locked = ", ".join(robot.actuators)
        message += f" It is actuator-singular: with {locked} locked the mechanism can still move there."
    statistics = Statistics(**{name: getattr(trajectory, name) for name in Statistics.__dataclass_fields__})
    variables = Deferred(partial(measure, robot, trajectory))
    return Run(variables, coords, dict(attrs), trajectory.status, message, statistics)


def measure(robot: Robot, trajectory: Trajectory) -> dict[str, Variable]:
    """Return positions, rates and accelerations of all joints, forces, energies, tool and closure over time."""
    q, v, u = trajectory.q, trajectory.v, trajectory.u
    _, v_dot, _ = robot.kernel("motion")(q, v, u)
    positions, rates, accelerations = robot.kernel("joints_motion")(q, v, v_dot)
    kinetic, potential = robot.kernel("energy")(q, v)
    quantities = {
        "joint_position": ("joint", robot.unwrapped(positions), "m, rad"),
        "joint_rate": ("joint", rates, "m/s, rad/s"),
        "joint_acceleration": ("joint", accelerations, "m/s^2, rad/s^2"),
        "actuator_force": ("actuator", u, "N, N m"),
        "kinetic_energy": (None, kinetic[:, 0], "J"),
        "potential_energy": (None, potential[:, 0], "J"),
        "closure_error": (None, trajectory.residual, "m, rad"),
    }
    if robot.mechanism.tools:
        quantities["tool_pose"] = ("pose", robot.tool_poses(q), "m, rad")
    return {
        name: Variable(("time", axis) if axis else ("time",), values, {"units": unit})
        for name, (axis, values, unit) in quantities.items()
    }


def names(labels: Sequence[str]) -> np.ndarray:
    return np.array(labels, dtype=object)
