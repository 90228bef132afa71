"""Freed numbers: a robot with more of its numbers free, whatever paths they are named by."""

from __future__ import annotations

from collections.abc import Iterable

from linkwork.mechanism.numbers import located
from linkwork.robot import Robot


def freed(robot: Robot, paths: Iterable[str]) -> tuple[Robot, dict[str, str]]:
    """Return the robot with these numbers free, too, and the paths by which they are: a number that
    is free by another path stays so."""
    free = {located(robot.mechanism, path)[0]: path for path in robot.parameters}
    names = {path: free.setdefault(located(robot.mechanism, path)[0], path) for path in paths}
    return robot.free(*(path for path in free.values() if path not in robot.parameters)), names
