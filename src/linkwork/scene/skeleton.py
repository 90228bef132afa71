"""The points of a mechanism in a pose that are worth drawing, seen from the ground.

A body is its shapes. One without shapes is the set of points where its joints, springs, cables and
tools sit; their convex hull is drawn. The mass centre is added where these would not show the body:
on a body that hangs on one joint, and where the mass is nearly a point.

Links whose hinges' axes all meet in one point have all their joints there. But a hinge may stand
anywhere on its axis: it is moved to the foot of the mass centres of the two bodies it joins, and a
link between two such hinges is an arc about the point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.equations.joints import ElementaryMotion, held_length, motions_of, rows_of
from linkwork.mechanism import GROUND, Frame, Mechanism, PairJoint, Shape
from linkwork.mechanism.joints import SLIDES
from linkwork.robot import Robot, State
from linkwork.scene.cable_runs import CableRun, Placed, cable_points, cable_runs
from linkwork.scene.curves import arc, hull
from linkwork.scene.meshes import PlacedMesh, drawable, piece_of

TOGETHER = 1e-9  # distance of points, relative to the mechanism, below which they are one
APART = 0.1  # distance of points, relative to the mechanism, above which they are seen apart
POINT_MASS = 0.2
"""Radius of gyration over the distance to the farthest joint, below which a mass is nearly a
point."""
HINGE, SLIDER = (1, 0, False), (0, 1, False)  # motions of a joint


@dataclass(frozen=True)
class JointPlace:
    """Place a joint: its bodies, its frame's origins on the first and the second body (3) [m], and
    its motions' axes.

    turns, slides: axes (k, 3) that it turns about and slides along; ball: whether it turns freely
    threaded: whether it slides as it turns; rod: whether it holds nothing but a distance
    coordinates: their names; slide: that of the one that slides, if one does; driven: whether one
        of its rates is actuated
    tubed: whether it slides as a rod in a tube: between moving bodies, on one of which all joints
        stand at its end
    """

    name: str
    type: str
    connects: tuple[str, str]
    near: np.ndarray
    far: np.ndarray
    turns: np.ndarray
    slides: np.ndarray
    ball: bool
    threaded: bool
    rod: bool
    coordinates: tuple[str, ...]
    slide: str
    driven: bool
    tubed: bool = False

    @property
    def axes(self) -> np.ndarray:
        """Return the axes (k, 3) that it turns about, or those that it slides along where it turns
        about none."""
        return self.turns if len(self.turns) else self.slides

    @property
    def rail(self) -> np.ndarray | None:
        """Return the axis (3) of a joint that slides along one line."""
        return self.slides[0] if len(self.slides) == 1 else None

    @property
    def motions(self) -> tuple[int, int, bool]:
        """Return about how many axes it turns, along how many it slides, and whether it turns
        freely."""
        return len(self.turns), len(self.slides), self.ball

    @property
    def grounded(self) -> bool:
        """Tell whether one of the two bodies is the ground."""
        return GROUND in self.connects

    @property
    def ends(self) -> tuple[tuple[str, np.ndarray], tuple[str, np.ndarray]]:
        """Return the origins by body."""
        return (self.connects[0], self.near), (self.connects[1], self.far)


@dataclass(frozen=True)
class Skeleton:
    """Hold what is drawn of a mechanism in one pose, in the ground's axes [m].

    poses: places and turns of the ground and of all bodies
    bodies: the points (k, 3) of each body
    solids: the shapes of the bodies that have some, in their order
    arcs: the polylines of bodies that are arcs between two hinges
    joints: all that hold two bodies in some way
    gears: the two or more joints that a gear couples, by its name
    springs: their two ends (2, 3); cables: their straight runs
    anchors: the ends of springs and points of cables that are on the ground (k, 3)
    masses: the places (3) of masses that are nearly points, by body
    tools: origin (3) and axes (3, 3), in columns
    """

    poses: dict[str, Placed]
    bodies: dict[str, np.ndarray]
    solids: dict[str, tuple[PlacedMesh, ...]]
    arcs: dict[str, np.ndarray]
    joints: tuple[JointPlace, ...]
    gears: dict[str, tuple[JointPlace, ...]]
    springs: dict[str, np.ndarray]
    cables: dict[str, list[CableRun]]
    anchors: np.ndarray
    masses: dict[str, np.ndarray]
    tools: dict[str, Placed]

    @property
    def points(self) -> np.ndarray:
        """Return all points (N, 3)."""
        ends = [np.stack([joint.near, joint.far]) for joint in self.joints]
        corners = [solid.corners for solids in self.solids.values() for solid in solids]
        runs = [run.points for runs in self.cables.values() for run in runs]
        held = [*ends, *self.springs.values(), *runs]
        return np.concatenate([*self.bodies.values(), *corners, *self.arcs.values(), *held])

    @property
    def by_body(self) -> dict[str, np.ndarray]:
        """Return the points (k, 3) that move with each body."""
        corners = {
            name: [solid.corners for solid in solids] for name, solids in self.solids.items()
        }
        own = {name: [points, *corners.get(name, [])] for name, points in self.bodies.items()}
        return {name: np.concatenate(points) for name, points in own.items()} | self.arcs

    @property
    def outline(self) -> np.ndarray:
        """Return points (N, 3) close together along all lines that are drawn."""
        lines = [
            face
            for name, points in self.bodies.items()
            if name not in self.solids
            for face in hull(points)
        ]
        lines += [
            face for solids in self.solids.values() for solid in solids for face in solid.faces
        ]
        lines += [
            *self.arcs.values(),
            *self.springs.values(),
            *(np.stack([j.near, j.far]) for j in self.joints),
        ]
        t = np.linspace(0, 1, 13)[:, None]
        return np.concatenate(
            [
                a + t * (b - a)
                for line in lines
                for a, b in zip(line, np.roll(line, -1, axis=0), strict=True)
            ]
        )


def poses_of(robot: Robot, state: State) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return places and turns of the ground and of all bodies in one or more states."""
    axes = np.broadcast_to(np.eye(3), (*state.batch, 3, 3))
    return {GROUND: (np.zeros((*state.batch, 3)), axes)} | robot.body_poses(state)


def skeleton(robot: Robot, state: State) -> Skeleton:
    """Return the points, axes and tools of a robot in one state."""
    # Where bodies, mass centres, joints, springs and tools are.
    mechanism = robot.mechanism
    poses = poses_of(robot, state)
    centres = {
        name: placed(poses[name], body.centre_of_mass)
        for name, body in mechanism.bodies.items()
        if body.mass > 0
    }
    joints, meeting = joint_places(robot, poses, centres)
    springs = {
        name: np.stack(
            [placed(poses[body], p) for body, p in zip(spring.connects, spring.points, strict=True)]
        )
        for name, spring in mechanism.springs.items()
    }
    tools = {
        name: frame_pose(poses[tool.body], tool.frame) for name, tool in mechanism.tools.items()
    }
    # Bodies are drawn by their shapes, or between the points at which something holds them.
    anchors, points = held_points(mechanism, poses, joints, springs, tools)
    solids = {
        name: body_solids(shapes, poses[name])
        for name, body in mechanism.bodies.items()
        if (shapes := drawable(body.shapes))
    }
    masses = {
        name: centres[name]
        for name in point_masses(mechanism, points, centres)
        if name not in meeting and name not in solids
    }
    # A body without two points to be drawn between shows its mass centre, or its origin.
    for name, own in points.items():
        if name in masses or (name in centres and len(own) < 2):
            own.append(centres[name])
        elif not own:
            own.append(poses[name][0])
    apart = {name: meeting[name] for name in meeting if name not in solids}
    arcs = arcs_between(apart, points)
    bodies = {name: np.stack(found) for name, found in points.items() if name not in arcs}
    gears = {
        name: tuple(
            joint for joint in joints if not gear.ratios.keys().isdisjoint(joint.coordinates)
        )
        for name, gear in mechanism.gears.items()
    }
    cables = cable_runs(mechanism, poses)
    return Skeleton(
        poses, bodies, solids, arcs, joints, gears, springs, cables, anchors, masses, tools
    )


def held_points(
    mechanism: Mechanism,
    poses: Mapping[str, Placed],
    joints: Iterable[JointPlace],
    springs: Mapping[str, np.ndarray],
    tools: Mapping[str, Placed],
) -> tuple[np.ndarray, dict[str, list[np.ndarray]]]:
    """Return the points of the ground at which springs and cables hang (k, 3), and those of each
    body at which joints, springs, cables and tools sit."""
    hung = [
        end
        for name, spring in mechanism.springs.items()
        for end in zip(spring.connects, springs[name], strict=True)
    ]
    hung += [place for _, path in cable_points(mechanism, poses) for place in path if place]
    anchors = np.array([p for body, p in hung if body == GROUND]).reshape(-1, 3)
    ends = [*hung, *(end for joint in joints for end in joint.ends)]
    ends += [(tool.body, tools[name][0]) for name, tool in mechanism.tools.items()]
    return anchors, {name: [p for body, p in ends if body == name] for name in mechanism.bodies}


def arcs_between(
    meeting: Mapping[str, np.ndarray], points: Mapping[str, Sequence[np.ndarray]]
) -> dict[str, np.ndarray]:
    """Return the arcs of bodies between two points apart from each other; meeting: where the axes
    of their joints meet."""
    size = np.ptp([p for own in points.values() for p in own], axis=0).max()
    return {
        name: arc(centre, *own)
        for name, centre in meeting.items()
        if len(own := points[name]) == 2 and np.ptp(own, axis=0).max() > TOGETHER * size
    }


def placed(pose: Placed, point: Sequence[float]) -> np.ndarray:
    """Return a body's point in the ground's axes."""
    return pose[0] + pose[1] @ np.asarray(point, float)


def body_solids(shapes: Iterable[Shape], pose: Placed) -> tuple[PlacedMesh, ...]:
    """Return the shapes of a body in the ground's axes."""
    return tuple(piece_of(shape).moved(*frame_pose(pose, shape.frame)) for shape in shapes)


def frame_pose(pose: Placed, frame: Frame) -> Placed:
    return placed(pose, frame.position), pose[1] @ rotation_matrix(frame.orientation)


def joint_places(
    robot: Robot, poses: Mapping[str, Placed], centres: Mapping[str, np.ndarray]
) -> tuple[tuple[JointPlace, ...], dict[str, np.ndarray]]:
    """Return the joints' places, and the points where all hinges of a body meet, by body."""
    joints = [
        joint_place(name, joint, poses, not set(joint.rates(name)).isdisjoint(robot.actuators))
        for name, joint in robot.mechanism.pairs.items()
        if rows_of(joint)
    ]
    meeting = meeting_points(joints, robot.bodies)
    moved = [moved_out(joint, meeting, centres) for joint in joints]
    return tuple(replace(joint, tubed=is_tubed(joint, moved)) for joint in moved), meeting


def joint_place(
    name: str, joint: PairJoint, poses: Mapping[str, Placed], driven: bool
) -> JointPlace:
    """Place a joint by the poses of its two bodies."""
    # Axes before a turn are the first body's, those behind it the second's.
    (near, R_1), (far, R_2) = (
        frame_pose(poses[body], frame)
        for body, frame in zip(joint.connects, joint.frames, strict=True)
    )
    motions = [
        (motion, R_2 if turned else R_1) for motion, turned in after_turns(motions_of(joint))
    ]
    return JointPlace(
        name,
        joint.type,
        joint.connects,
        near,
        far,
        turns=np.array([R @ m.turn for m, R in motions if m.turns and not m.ball]).reshape(-1, 3),
        slides=np.array(
            [R @ m.slide / np.linalg.norm(m.slide) for m, R in motions if m.slides]
        ).reshape(-1, 3),
        ball=any(motion.ball for motion, _ in motions),
        threaded=any(motion.turns and motion.slides for motion, _ in motions),
        rod=held_length(joint) is not None,
        coordinates=joint.coordinates(name),
        slide=next(
            (
                own
                for own, what in zip(joint.coordinates(name), joint.freedoms, strict=False)
                if what in SLIDES
            ),
            "",
        ),
        driven=driven,
    )


def after_turns(motions: Sequence[ElementaryMotion]) -> list[tuple[ElementaryMotion, bool]]:
    """Tell of each motion whether a turn comes before it: its axis then belongs to the second
    frame, else to the first."""
    return [
        (motion, any(before.turns for before in motions[:k])) for k, motion in enumerate(motions)
    ]


def is_tubed(joint: JointPlace, joints: Sequence[JointPlace]) -> bool:
    """Tell whether a joint slides as a rod in a tube, far enough to be seen."""
    points = [p for other in joints for _, p in other.ends]
    size = float(np.ptp(points, axis=0).max())
    if (
        joint.motions != SLIDER
        or joint.grounded
        or np.linalg.norm(joint.far - joint.near) < APART * size
    ):
        return False
    for body, end in joint.ends:
        own = np.array([p for other in joints for name, p in other.ends if name == body])
        if len(own) > 1 and np.abs(own - end).max() < TOGETHER * size:
            return True
    return False


# Hinges that meet


def meeting_points(joints: Sequence[JointPlace], bodies: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the point where all joints of a body stand, for the bodies with two hinges or more and
    nothing else."""
    size = max(
        (float(np.abs(p).max()) for joint in joints for p in (joint.near, joint.far)), default=0.0
    )
    found = {}
    for name in bodies:
        own = [(joint.motions, p) for joint in joints for body, p in joint.ends if body == name]
        places = np.array([p for _, p in own])
        if (
            len(own) > 1
            and {motions for motions, _ in own} == {HINGE}
            and np.ptp(places, axis=0).max() <= TOGETHER * size
        ):
            found[name] = places[0]
    return found


def moved_out(
    joint: JointPlace, meeting: Mapping[str, np.ndarray], centres: Mapping[str, np.ndarray]
) -> JointPlace:
    """Move a hinge of a body whose hinges meet along its axis, to the foot of its bodies' mass
    centres."""
    reach = [
        (centres[body] - joint.near) @ joint.axes[0]
        for body in joint.connects
        if body in centres and len(joint.axes)
    ]
    if not reach or set(joint.connects).isdisjoint(meeting):
        return joint
    way = np.mean(reach) * joint.axes[0]
    return replace(joint, near=joint.near + way, far=joint.far + way)


# Masses


def point_masses(
    mechanism: Mechanism,
    points: Mapping[str, Sequence[np.ndarray]],
    centres: Mapping[str, np.ndarray],
) -> list[str]:
    """Name the bodies whose mass is a point, or nearly one on a body that hangs on one joint, away
    from a joint."""
    everything = np.array(
        [*centres.values(), *(p for own in points.values() for p in own)]
    ).reshape(-1, 3)
    size = float(np.ptp(everything, axis=0).max()) if len(everything) else 0.0
    found = []
    for name, centre in centres.items():
        body = mechanism.bodies[name]
        far = max((float(np.linalg.norm(p - centre)) for p in points[name]), default=0.0)
        hangs = sum(name in joint.connects for joint in mechanism.pairs.values()) == 1
        radius = sqrt(body.inertia.tensor().diagonal().max() / body.mass)
        if far > APART * size and radius <= (POINT_MASS * far if hangs else 0.0):
            found.append(name)
    return found
