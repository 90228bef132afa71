"""What every contender is given: states over the workspace, and one second of motion under sampled
forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import linkwork as lw
from linkwork.simulation import Sampled, Signal, as_signal

L1, L2 = 0.3, 0.15
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(3) / 2]])
ALONG = 2 * np.pi / 3 * np.arange(3)
CENTRE = np.array([0.5, np.sqrt(3) / 6, 0.8])
SPREAD = np.array([0.25, 0.25, 1.0])
REACH, PIVOT = 0.29, 0.5
REGION = (
    f"platform poses x, y within {SPREAD[0]} m of the base's centre and angle {CENTRE[2]} ± "
    f"{SPREAD[2]} rad (the singular surface near 0.83 rad runs through it), kept where every "
    f"vertex is within {REACH} m of its rail (out of reach at {L1} m) and the smallest relative "
    f"pivot exceeds {PIVOT}; rates normal with 1 m/s"
)


def workspace_states(robot: lw.Robot, count: int, seed: int = 20100) -> lw.State:
    """Return random states (count) of the 3-PRR over its workspace, on both sides of the singular
    surface."""
    random = np.random.default_rng(seed)
    poses: list[np.ndarray] = []
    while len(poses) < count:
        pose = CENTRE + SPREAD * random.uniform(-1, 1, 3)
        if np.abs(across_rails(pose)).max() < REACH and pivot(robot, pose) > PIVOT:
            poses.append(pose)
    return robot.assemble(tool=np.array(poses)).with_rates(random.normal(size=(count, 3)))


def across_rails(pose: np.ndarray) -> np.ndarray:
    """Return the signed distances of the platform's vertices from their rails (3,) [m]."""
    angle = pose[2] + ALONG
    vertices = pose[:2] - L2 * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.einsum(
        "ij,ij->i", vertices - CORNERS, np.column_stack([-np.sin(ALONG), np.cos(ALONG)])
    )


def pivot(robot: lw.Robot, pose: np.ndarray) -> float:
    """Return the smallest relative pivot of the elimination at a pose: 1 far from singular poses, 0
    in one."""
    return abs(float(robot.kernel("maps")(robot.assemble(tool=pose).q)[-1][0]))


@dataclass(frozen=True, eq=False)
class Task:
    """Hold one second of motion from a state at rest under forces over time.

    start: the state; signal: the forces as piecewise cubics; duration [s].
    """

    start: lw.State
    signal: Signal
    duration: float = 1.0


def second_of_pushing(robot: lw.Robot) -> Task:
    """Return a gentle task: from rest in the middle of the workspace, 0.5 N on the first slider for
    1 s."""
    return Task(robot.assemble(tool=[*CENTRE[:2], 1.2]), as_signal([0.5, 0.0, 0.0]))


def second_of_motion(robot: lw.Robot, samples: int = 1001) -> Task:
    """Return the work-precision task, rest to rest in 1 s.

    The forces are those of a circle of 50 mm, on which the platform swings by 0.2 rad around 1.2
    rad.
    """
    path = lw.paths.together(lw.paths.circle([0.5, 0.28], 0.05), lw.paths.swing(1.2, 0.2))
    motion = robot.follow(path, duration=1.0, samples=samples)
    forces = robot.inverse_dynamics(motion)
    assert isinstance(forces, Sampled)
    return Task(motion.state.at(0), as_signal(forces))
