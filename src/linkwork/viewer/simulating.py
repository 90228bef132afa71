"""Runs that are started from the present pose: with constant forces, or held in the pose by springs
and dampers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.simulation import Run

SAMPLES_PER_SECOND, MOST_SAMPLES = 100, 4001
STIFF = 6.0  # frequency of held actuators, by the inertia each has in the pose [Hz]
DAMPED = 0.7  # their damping ratio
CONTROLLERS = ("constant forces", "hold the pose")


def simulate(
    robot: Robot, state: State, controller: str, forces: Mapping[str, float], duration: float
) -> Run:
    """Run from a state at rest.

    Args:
        robot, state: where to start.
        controller: one of `CONTROLLERS`.
        forces: constant forces of the actuators by name [N, N m]; a held robot bears them besides
            what holds it.
        duration: T [s].

    Raises:
        LinkworkError: a controller that does not fit the robot, a duration that is no positive
            number.
    """
    samples = (
        int(np.clip(duration * SAMPLES_PER_SECOND + 1, 2, MOST_SAMPLES))
        if np.isfinite(duration)
        else 2
    )
    times = np.linspace(0, duration, samples)
    drive = driving(robot, state, controller, forces)
    return robot.simulate(state, drive, duration=duration, save_at=times, on_singular="step_over")


def driving(
    robot: Robot, state: State, controller: str, forces: Mapping[str, float]
) -> dict[str, float] | Callable:
    """Return what drives the actuators from a state at rest: see `simulate`."""
    return dict(forces) if controller == CONTROLLERS[0] else holding(robot, state, forces)


def holding(robot: Robot, state: State, forces: Mapping[str, float]) -> Callable:
    """Return the law  u = u_0 + forces + k (q_0 - q) - d q'  of the actuators: u_0 holds the pose
    at rest.

    With m the inertia that an actuator moves alone (the diagonal of M), k = m (2 pi f)^2 and d = 2
    D m 2 pi f.
    """
    if robot.independent != robot.actuators:
        raise LinkworkError(
            "this robot's actuators do not determine its motion; they cannot hold a pose"
        )
    u = np.asarray(robot.inverse_dynamics(state, np.zeros(robot.mobility)))
    inertia = np.diag(robot.mass_matrix(state))
    omega = 2 * np.pi * STIFF
    rows = [
        (
            name,
            float(u[k]) + forces.get(name, 0.0),
            float(state[name]),
            float(inertia[k]) * omega**2,
        )
        for k, name in enumerate(robot.actuators)
    ]

    def law(t, seen):
        return {
            name: hold + k * (here - seen[name]) - 2 * DAMPED * k / omega * seen.rate(name)
            for name, hold, here, k in rows
        }

    return law
