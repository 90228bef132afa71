"""Sources of a tool's error: numbers of the description with tolerances, joints with play, drives
with a resolution.

Each source k is a vector of a few numbers that lies anywhere in a ball of radius s_k, alike: one
number between -s and s (a tolerance, half a step of a drive), the offset of a joint's two frames by
no more than its clearance. In d dimensions the deviation of each of its numbers is s / sqrt(d + 2).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.mechanism import GROUND, Mechanism
from linkwork.mechanism.number_patterns import can_be_free, paths_of
from linkwork.mechanism.numbers import Where, located
from linkwork.mechanism.parameter_units import unit_of_parameter
from linkwork.robot import Robot

ALONG = 1e-12  # of a cosine, by which an axis may differ from the one across the plane


@dataclass(frozen=True)
class ErrorSource:
    """Describe a source of errors.

    name: path of a number, name of a joint or an actuator
    kind: "tolerance", "clearance" or "resolution"
    size: radius of the ball that it lies in: a tolerance, a clearance, half a resolution [unit]
    numbers: paths of its numbers; none of a drive
    axes: directions of these in which it lies, orthonormal (d), where these are not all: of play in
        the plane on a body whose own axes are tilted against it
    """

    name: str
    kind: str
    size: float
    unit: str
    numbers: tuple[str, ...] = ()
    axes: tuple[tuple[float, ...], ...] = ()

    @property
    def moves(self) -> np.ndarray:
        """Steps of its numbers (numbers, d), one by one."""
        return np.array(self.axes).T if self.axes else np.eye(len(self.numbers))

    @property
    def deviation(self) -> float:
        """Standard deviation of each of its numbers, or along each of its axes [unit]."""
        return self.size / np.sqrt(max(self.moves.shape[1], 1) + 2)

    def __str__(self) -> str:
        said = {"tolerance": "", "clearance": ", clearance", "resolution": ", resolution"}
        return self.name + said[self.kind]


def sources_of(
    robot: Robot, tolerances: Any, clearances: Any, resolution: Any
) -> tuple[ErrorSource, ...]:
    """Return what `error_budget` is given as sources, with the paths of their numbers; refuse what
    names nothing, or the same number twice."""
    found = [
        *(tolerance(robot.mechanism, *item) for item in tolerances_of(robot.mechanism, tolerances)),
        *(clearance(robot, *item) for item in sizes_of(clearances, playing(robot), "clearance")),
        *(
            ErrorSource(name, "resolution", step / 2, robot.unit(name))
            for name, step in sizes_of(resolution, robot.actuators, "resolution", "actuator")
        ),
    ]
    if not found:
        raise LinkworkError(
            "no source of errors is given; give tolerances by path, such as {'rod_1.length': "
            "1e-5}, clearances by joint or resolutions by actuator"
        )
    return tuple(found)


def tolerances_of(mechanism: Mechanism, given: Any) -> Iterator[tuple[str, float]]:
    """Yield paths and tolerances, patterns replaced by all the paths that they match."""
    named = checks.by_name(given, "the tolerances", "{'rod_*.length': 1e-5}")
    taken: dict[Where, str] = {}
    for pattern, value in named.items():
        size = checks.positive(value, f"the tolerance of {pattern!r}")
        for path in paths_of(mechanism, pattern):
            where = located(mechanism, path)[0]
            if where in taken:
                raise LinkworkError(
                    f"the tolerances of {taken[where]!r} and {pattern!r} are both those of "
                    f"{path!r}; name it once"
                )
            taken[where] = pattern
            yield path, size


def tolerance(mechanism: Mechanism, path: str, size: float) -> ErrorSource:
    """Return the source that a number with a tolerance is."""
    return ErrorSource(path, "tolerance", size, unit_of_parameter(mechanism, path), (path,))


def playing(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints that hold two frames together, which may have play."""
    joints = robot.mechanism.joints.items()
    return tuple(
        name for name, joint in joints if hasattr(joint, "frames") and len(joint.rates(name)) < 6
    )


def clearance(robot: Robot, joint: str, size: float) -> ErrorSource:
    """Return the source that a joint with play is: the offset of its frame on its first body, or on
    its second where formulas place the first."""
    sides = [offsets(robot, joint, k) for k in (0, 1)]
    free = [side for side in sides if can_be_free(robot.mechanism, [*side[0]])]
    paths, axes = (free or sides)[0]
    return ErrorSource(joint, "clearance", size, "m", paths, axes)


def offsets(
    robot: Robot, joint: str, side: int
) -> tuple[tuple[str, ...], tuple[tuple[float, ...], ...]]:
    """Return the paths of the position of a joint's frame on one of its bodies, and the directions
    in which it may be off where these are not all: in the plane where the robot is planar."""
    path = f"joints.{joint}.frames.{side}.position"
    paths = tuple(f"{path}.{axis}" for axis in "xyz")
    if not robot.planar:
        return paths, ()
    # Of the body's axes, one may be across the plane.
    body = robot.mechanism.pairs[joint].connects[side]
    across = np.eye(3)[2] if body == GROUND else robot.body_poses(robot.home)[body][1][2]
    axis = int(np.argmax(np.abs(across)))
    if abs(across[axis]) > 1 - ALONG:
        return (*paths[:axis], *paths[axis + 1 :]), ()
    inside = np.linalg.svd(across[None])[2][1:]
    return paths, tuple(tuple(each.tolist()) for each in inside)


def sizes_of(
    given: Any, names: tuple[str, ...], kind: str, of: str = "joint"
) -> Iterator[tuple[str, float]]:
    """Yield names and sizes: one number for all, or by name."""
    if given is None:
        return
    if not isinstance(given, Mapping):
        given = dict.fromkeys(names, checks.positive(given, f"the {kind}"))
    checks.known(given, names, of, f" with a {kind}")
    for name, value in given.items():
        yield name, checks.positive(value, f"the {kind} of {name!r}")
