"""How much of the limits of a motion its run takes, between the points of the mesh, too."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linkwork.design.motion_points import determinant
from linkwork.mechanism.joints import TURN
from linkwork.mechanism.limits import limited, undriven_speeds
from linkwork.motions import ActuatorLimits
from linkwork.robot import Robot
from linkwork.simulation import Run, Sampled

FINE = 20  # points in an interval at which the run is looked at
BEFORE = 1e-9  # of the duration, ahead of a leap of forces
KINDS = ("force", "speed", "power", "acceleration")


def shares(
    robot: Robot, run: Run, forces: Sampled, limits: ActuatorLimits, apart: float
) -> dict[str, float]:
    """Return the largest part of each kind of limit that is taken in a run under forces that are
    held in intervals.

    Args:
        robot, run, forces: what moved, how, and by what.
        limits: of the actuators; those of the description hold, too.
        apart: of singular poses, as `optimal_motion` says.

    Returns:
        By kind, where there is such a limit: "force", "speed", "power" and "acceleration" over
        what is allowed; "range": from the middle of a joint's range over its half (1 at an end), or
        1 less the distance to its only end over the mechanism's own length or 1 rad; "apart": the
        least determinant that is allowed over the least one.
    """
    ends = forces.times[1:]
    times = np.linspace(0.0, ends[-1], FINE * len(ends) + 1)
    fine = run.resampled(np.union1d(times, ends - BEFORE * ends[-1]))
    parts = [
        *taken_by_actuators(robot, fine, forces, limits),
        *taken_by_joints(robot, fine),
        *taken_by_poses(robot, fine, apart),
    ]
    kinds = dict.fromkeys(kind for kind, _ in parts)
    return {kind: float(max(part.max() for own, part in parts if own == kind)) for kind in kinds}


def taken_by_actuators(
    robot: Robot, run: Run, forces: Sampled, limits: ActuatorLimits
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield kinds of limits, and the parts of them that actuators take."""
    values = {"force": forces.values, "power": run["actuator_power"].values}
    if {*robot.actuators} <= {*robot.rates}:
        places = [robot.rates.index(name) for name in robot.actuators]
        for kind, quantity in (("speed", "joint_rate"), ("acceleration", "joint_acceleration")):
            values[kind] = run[quantity].values[:, places]
    given = limits.of_robot(robot)
    for kind in KINDS:
        if kind in values and np.isfinite(given[kind]).any():
            yield kind, np.abs(values[kind]) / given[kind]


def taken_by_joints(robot: Robot, run: Run) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the parts of their limits of speed that joints without actuators take, and those of
    the ranges of all joints."""
    rates, coordinates = run["joint_rate"].values, run["joint_position"].values
    for labels, speed in undriven_speeds(robot.mechanism):
        own = rates[:, [robot.rates.index(label) for label in labels]]
        yield "speed", np.linalg.norm(own, axis=1) / speed
    for label, own, name in limited(robot.mechanism):
        place = robot.coordinates.index(label)
        q, (lower, upper) = coordinates[:, place], own.interval
        if name.endswith(f".{TURN}"):
            q, lower = 2 * np.arccos(np.minimum(np.abs(q), 1.0)), -upper
        half = (upper - lower) / 2
        size = half if np.isfinite(half) else robot.labels.sizes[place]
        yield "range", 1 - np.minimum(q - lower, upper - q) / size


def taken_by_poses(robot: Robot, run: Run, apart: float) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the least determinant that is allowed over that at each time, endless beyond a singular
    pose."""
    if (D := determinant(robot)) is not None:
        left = D(robot.state(run["joint_position"].values).q.T, robot.p).full().ravel()
        left = left / left[0]
        yield "apart", np.divide(apart, left, out=np.full_like(left, np.inf), where=left > 0)
