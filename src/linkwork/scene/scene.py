"""The scene: the one list of all that is drawn of a mechanism. It is made in one pose; in others
its parts are moved.

Whatever draws (figures in the plane and in space, films, the viewer) paints the list part by part,
by form and role, and knows no kinds of joints or shapes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.mechanism import GROUND, Mechanism
from linkwork.mechanism.limits import limited
from linkwork.robot import Robot, State
from linkwork.scene import surfaces
from linkwork.scene.colours import DRIVEN, TRIAD
from linkwork.scene.curves import hull
from linkwork.scene.ground import ground
from linkwork.scene.meshes import BALL, PlacedMesh, drawable
from linkwork.scene.parts import Bar, Coil, Hull, Moves, ScenePart, corners, moved
from linkwork.scene.skeleton import Skeleton, poses_of, skeleton
from linkwork.scene.symbols import symbol

# Lengths are relative to the mechanism
# Radii of bars, of a tool's axes, of the lines between geared joints, and of cables.
BAR, AXIS, COUPLING, CABLE = 0.011, 0.004, 0.003, 0.003
ARROW, MASS, WINDING = 0.09, 0.035, 0.025  # length of a tool's axes, radii of masses and of springs


@dataclass(frozen=True, eq=False)
class Scene:
    """Hold all that is drawn of a robot, in a pose, and how its bodies move from there in others.

    pose: the points; moves: of the ground and of all bodies, to each of the poses that are shown
        (K)
    shown: whether these are all that is shown; else the mechanism may be brought anywhere
    """

    robot: Robot
    pose: Skeleton
    moves: Moves
    shown: bool

    @property
    def flat(self) -> bool:
        """Tell whether the picture is in the plane, where heights are not seen."""
        return self.shown and self.robot.planar

    @property
    def count(self) -> int:
        """Return the number of poses that are shown."""
        return len(self.moves[GROUND][1])

    @cached_property
    def points(self) -> np.ndarray:
        """Return all points (N, 3) of all poses, and of what they are above [m]."""
        return np.concatenate([self.own_points, *(corners(part) for part in self.sheets)])

    @cached_property
    def own_points(self) -> np.ndarray:
        """Return the points (N, 3) of the mechanism in all poses [m]."""
        held = [*self.pose.by_body.items()]
        held += [(body, solid.corners) for _, body, solid in self.touching]
        elsewhere = [moved(own, (name,), self.moves).reshape(-1, 3) for name, own in held]
        return np.concatenate([self.pose.points, *elsewhere])

    @cached_property
    def size(self) -> float:
        """Return the largest extent of the mechanism's points [m]."""
        return float(np.ptp(self.own_points, axis=0).max()) or 1.0

    @cached_property
    def touching(self) -> list[tuple[str, str, PlacedMesh]]:
        """Return the solids of contacts that no shape of a body shows."""
        return surfaces.solids(self.robot.mechanism, self.pose)

    @cached_property
    def sheets(self) -> tuple[ScenePart, ...]:
        """Return the planes and fields of heights of contacts."""
        given = self.pose.poses, self.own_points, self.size, self.shown, self.flat
        return tuple(surfaces.sheets(self.robot.mechanism, *given))

    def moves_to(self, k: int) -> Moves:
        """Return how the bodies move to the other pose of a number."""
        return {name: (way[k], turn[k]) for name, (way, turn) in self.moves.items()}

    @cached_property
    def parts(self) -> tuple[ScenePart, ...]:
        """Return all that is drawn; rails are as long as the poses that are shown need, or as is
        allowed."""
        mechanism, planar = self.robot.mechanism, self.robot.planar
        pose, size = self.pose, self.size
        limits = None if self.shown else {own.coordinate: own.limits for own in limited(mechanism)}
        return (
            *self.sheets,
            *surfaces.solid_parts(self.touching, size),
            *ground(pose, self.moves, limits, size, planar),
            *bodies(mechanism, pose, size, self.flat),
            *(part for joint in pose.joints for part in symbol(joint, size)),
            *cables(mechanism, pose, size),
            *others(mechanism, pose, size, planar),
        )


def scene_of(robot: Robot, state: State, shown: State | None = None) -> Scene:
    """Return the scene of a robot, made in one state.

    shown: the one or more states that are drawn; left out: the robot may be brought to any
    """
    pose = skeleton(robot, state)
    here = pose.poses
    there = here if shown is None else poses_of(robot, shown)
    moves = {}
    for name, (place, turn) in there.items():
        way = turn.reshape(-1, 3, 3) @ here[name][1].T
        moves[name] = (place.reshape(-1, 3) - way @ here[name][0], way)
    return Scene(robot, pose, moves, shown is not None)


def bodies(mechanism: Mechanism, pose: Skeleton, size: float, flat: bool) -> Iterator[ScenePart]:
    """Yield bodies as their shapes, or as plates, bars or arcs; masses as balls, and so single
    points that no joint shows."""
    for name, solids in pose.solids.items():
        for solid, shape in zip(solids, drawable(mechanism.bodies[name].shapes), strict=True):
            yield ScenePart(name, "member", (name,), solid, shape.colour)
    held = {body for joint in pose.joints for body in joint.connects}
    masses = dict(pose.masses)
    for name, points in (
        (name, points) for name, points in pose.bodies.items() if name not in pose.solids
    ):
        faces = hull(points * (1, 1, 0) if flat else points)
        if len(faces[0]) > 2:
            yield ScenePart(name, "plate", (name,), Hull.of(faces))
        elif len(faces[0]) == 2:
            yield ScenePart(name, "member", (name,), Bar(faces[0], BAR * size))
        elif name not in held:
            masses[name] = points[0]
    for name, points in pose.arcs.items():
        yield ScenePart(name, "member", (name,), Bar(points, BAR * size))
    for name, place in masses.items():
        yield ScenePart(
            name, "mass", (name,), PlacedMesh(BALL, place, np.eye(3), np.full(3, MASS * size))
        )


def cables(mechanism: Mechanism, pose: Skeleton, size: float) -> Iterator[ScenePart]:
    """Yield the straight runs of cables; those that are driven in the colour of what is."""
    for name, runs in pose.cables.items():
        colour = DRIVEN if name in mechanism.actuators else None
        for k, (bodies, points) in enumerate(runs):
            line = Bar(points, CABLE * size)
            yield ScenePart(f"{name}.{k}" if k else name, "cable", bodies, line, colour)


def others(mechanism: Mechanism, pose: Skeleton, size: float, planar: bool) -> Iterator[ScenePart]:
    """Yield springs, a line through the joints that a gear couples, and the axes of tools: x, y,
    and in space z."""
    for name, ends in pose.springs.items():
        yield ScenePart(
            name, "spring", mechanism.springs[name].connects, Coil(ends, WINDING * size)
        )
    for name, joints in pose.gears.items():
        line = Bar(np.stack([joint.far for joint in joints]), COUPLING * size)
        yield ScenePart(name, "gear", tuple(joint.connects[1] for joint in joints), line)
    for name, (origin, axes) in pose.tools.items():
        for axis, colour in list(zip(axes.T, TRIAD, strict=True))[: 2 if planar else 3]:
            line = Bar(np.stack([origin, origin + ARROW * size * axis]), AXIS * size)
            yield ScenePart(name, "tool", (mechanism.tools[name].body,), line, colour)


def upwards(robot: Robot) -> np.ndarray:
    """Return the unit vector that is up: against gravity, in the plane of a planar mechanism;
    without gravity y in the plane and z in space."""
    up = -np.array(robot.mechanism.gravity) * ((1, 1, 0) if robot.planar else (1, 1, 1))
    if np.linalg.norm(up) > 0:
        return up / np.linalg.norm(up)
    return np.eye(3)[1 if robot.planar else 2]
