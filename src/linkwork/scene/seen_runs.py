"""Runs with numbers of their own, as they are seen: what is drawn of a run are the bodies with the
values that the robot's free numbers had in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot
from linkwork.runs.resuming import as_in, described, held_otherwise
from linkwork.simulation import Run

ALIKE = 1e-9  # part of the robot's length that places may be apart


def shown_robot(robot: Robot, motion: Any) -> Robot:
    """Return the robot that is seen in a motion: in a run with the values that numbers of its
    description had there, which are freed where they are not."""
    if not isinstance(motion, Run):
        return robot
    values = described(robot, motion)
    others = {path: value for path, value in values.items() if path not in robot.parameters}
    freed = held_otherwise(robot, others)
    return as_in(robot.free(*freed) if freed else robot, values)


def require_lengths(robot: Robot, run: Any) -> None:
    """Refuse a run that had other lengths than a robot, by which its bodies were elsewhere; other
    masses are none of what is seen."""
    other = shown_robot(robot, run)
    if other is robot or not len(run.time):
        return
    positions = run.variables["joint_position"].values
    meant = other.body_poses(other.state(positions))
    try:
        own = robot.body_poses(robot.state(positions))
        apart = max(np.abs(own[name][0] - place).max() for name, (place, _) in meant.items())
    except LinkworkError:  # its loops are open here
        apart = np.inf
    if apart > ALIKE * robot.equations.tree.length:
        raise LinkworkError(
            "the run had other lengths than the robot that is shown, by which its bodies are "
            "elsewhere; show it alone"
        )
