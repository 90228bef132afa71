"""Rails of what slides on the ground: as long as limits allow, or else as a run or a hand needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linkwork.mechanism import GROUND
from linkwork.mechanism.limits import limited
from linkwork.robot import Robot, State
from linkwork.scene.ground import NEEDED
from linkwork.scene.scene import scene_of
from linkwork.scene.symbols import SLIDER

RAIL = "rail"  # role of parts


@dataclass(frozen=True, eq=False)
class Rail:
    """Hold a rail along  anchor + s axis: its number among the parts, the anchor (3) [m], a unit
    vector (3), from where to where it leads (s) [m], and the point (3) of a body, in its axes, that
    slides there [m].

    half: of the slider's length; room: by which it is longer at either end than a run needs [m]
    limited: whether limits say at both ends how long it is
    """

    part: int
    anchor: np.ndarray
    axis: np.ndarray
    ends: tuple[float, float]
    body: str
    point: np.ndarray
    half: float
    room: float
    limited: bool

    @property
    def start(self) -> np.ndarray:
        """Return where it begins (3) [m]."""
        return self.anchor + self.ends[0] * self.axis

    @property
    def length(self) -> float:
        """Return how long it is [m]."""
        return self.ends[1] - self.ends[0]

    def way(self, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Return where the slider is (...) [m] while the bodies have these poses."""
        origin, turn = poses[self.body]
        return (origin + turn @ self.point - self.anchor) @ self.axis

    def along(self, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Rail:
        """Return the rail as long as a motion, of stacks of poses, needs, and some more; as limits
        say where there are some."""
        if self.limited:
            return self
        way = self.way(poses)
        ends = float(way.min()) - self.room, float(way.max()) + self.room
        return replace(self, ends=(min(-self.half, ends[0]), max(self.half, ends[1])))

    def reaching(self, way: float) -> Rail:
        """Return the rail long enough for the slider at a place of it [m]."""
        ends = min(self.ends[0], way - self.half), max(self.ends[1], way + self.half)
        return self if ends == self.ends else replace(self, ends=ends)


def rails_of(robot: Robot, roles: Sequence[str]) -> tuple[Rail, ...]:
    """Return the rails of a robot that may be brought anywhere.

    roles: of its parts, among which the rails stand in the order of their joints
    """
    scene = scene_of(robot, robot.home)
    bounds = {own.coordinate: own.limits for own in limited(robot.mechanism)}
    joints, poses = {joint.name: joint for joint in scene.pose.joints}, scene.pose.poses
    shown = (part for part in scene.parts if part.role == RAIL)
    numbers = (k for k, role in enumerate(roles) if role == RAIL)
    found = []
    for number, part in zip(numbers, shown, strict=True):
        joint = joints[part.name]
        (_, anchor), (body, place) = sorted(joint.ends, key=lambda end: end[0] != GROUND)
        origin, turn = poses[body]
        axis, bound = joint.rail, bounds.get(joint.slide)
        ends = (part.form.points - anchor) @ axis  # pyright: ignore[reportAttributeAccessIssue]
        both = bound is not None and None not in (bound.lower, bound.upper)
        found.append(
            Rail(
                *(number, anchor, np.asarray(axis), (float(ends[0]), float(ends[1]))),
                *(body, turn.T @ (place - origin)),
                *(SLIDER[2] / 2 * scene.size, NEEDED * scene.size, both),
            )
        )
    return tuple(found)


def along(rails: tuple[Rail, ...], robot: Robot, states: State) -> tuple[Rail, ...]:
    """Return rails as long as a motion (K,) needs."""
    poses = robot.body_poses(states)
    return tuple(rail.along(poses) for rail in rails)


def grown(
    rails: tuple[Rail, ...], poses: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> tuple[Rail, ...]:
    """Return rails that are long enough in a pose; the same ones where they are already."""
    found = tuple(rail.reaching(float(rail.way(poses))) for rail in rails)
    return rails if all(a is b for a, b in zip(found, rails, strict=True)) else found
