"""What each joint type means to the engines: a chain of elementary steps, coordinates read off
poses, rows that vanish.

The frames of a joint are turned so that its geometry is always the same one: the axis is z; a
universal joint's axes are x of the first and y of the second frame. Then, for the pose X_12 =
(R, p) of the second frame in the first,

    revolute   Rot(z, q)                    cylindrical  Rot(z, angle) Trans(z, slide)
    prismatic  Trans(z, q)                  universal    Rot(x, angle_1) Rot(y, angle_2)
    screw      Rot(z, q) Trans(z, pitch q)  planar       Trans(x, x) Trans(y, y) Rot(z, angle)
    spherical  R of the quaternion          free         Trans((x, y, z)) R of the quaternion

and with the twist t = (omega, v) of the second frame seen in the first: rates = F t, and H t = 0
for what is held. Leading dimensions (instants of time) are kept everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.mechanism import (
    CylindricalJoint,
    Frame,
    Friction,
    Limits,
    PairJoint,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    Spring,
    UniversalJoint,
)

Effects = Mapping[str, tuple[Friction, Spring, Limits, float]]
Motion = Literal["turn", "slide", "screw", "ball"]
X, Y, Z = np.eye(3)

MOTIONS: dict[str, tuple[tuple[Motion, np.ndarray], ...]] = {
    "fixed": (),
    "revolute": (("turn", Z),),
    "prismatic": (("slide", Z),),
    "screw": (("screw", Z),),
    "cylindrical": (("turn", Z), ("slide", Z)),
    "universal": (("turn", X), ("turn", Y)),
    "spherical": (("ball", Z),),
    "planar": (("slide", X), ("slide", Y), ("turn", Z)),
    "free": (("slide", X), ("slide", Y), ("slide", Z), ("ball", Z)),
    "rod": (),
}
"""The steps of each joint type in its turned frames."""

RATES = {
    "fixed": (),
    "revolute": (2,),
    "prismatic": (5,),
    "screw": (2,),
    "cylindrical": (2, 5),
    "universal": (0, 1),
    "spherical": (0, 1, 2),
    "planar": (3, 4, 2),
    "free": (3, 4, 5, 0, 1, 2),
    "rod": (),
}
"""The components of the twist (omega, v) that are the rates; a universal joint's second see
`rate_rows`."""

HELD = {
    "fixed": (0, 1, 2, 3, 4, 5),
    "revolute": (0, 1, 2, 3, 4),
    "prismatic": (0, 1, 3, 4, 5),
    "screw": (0, 1, 2, 3, 4),
    "cylindrical": (0, 1, 3, 4),
    "universal": (0, 1, 2, 5),
    "spherical": (0, 1, 2),
    "planar": (2, 3, 4),
    "free": (),
    "rod": (0,),
}
"""What is held: translations (0, 1, 2) and rotations (3, 4, 5) along x, y, z; a screw's 2 and a
rod's 0 see `held_rows`."""


@dataclass(frozen=True, eq=False)
class Step:
    """Move by one elementary motion along or about an axis of the joint's first frame, or by a
    ball.

    Attributes:
        motion: turn, slide, screw (a turn that advances by `pitch` per radian) or ball.
        axis: unit vector; a ball's means nothing.
        coordinates, rates: the joint's coordinates (a ball: four) and rates (a ball: three) that
            this step takes.
        backwards: the step leads from the joint's second frame to its first, which a ball must
            know.
        follows: the step is the slide of a split screw, by `pitch` times the coordinate of its
            turn.
    """

    motion: Motion
    axis: np.ndarray
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    pitch: float = 0.0
    backwards: bool = False
    follows: bool = False

    @property
    def factor(self) -> float:
        """Return the step's own displacement over the coordinate."""
        return self.pitch if self.follows else 1.0

    def halves(self) -> tuple[Step, Step]:
        """Return a screw as a turn and the slide that goes with it."""
        return replace(self, motion="turn"), replace(self, motion="slide", follows=True)

    def reversed(self) -> Step:
        """Return the inverse motion: about or along the opposite axis, so that its coordinate keeps
        its sign."""
        return replace(
            self,
            axis=self.axis if self.motion == "ball" else -self.axis,
            backwards=not self.backwards,
        )


@dataclass(frozen=True, eq=False)
class Edge:
    """Join two bodies: X_12 = F_1 S_1 S_2 ... F_2^-1 with turned frames F and the steps S in
    between.

    Attributes:
        joint, kind: name and type of the joint.
        bodies: from which body to which.
        frames: their turned joint frames, 4 x 4.
        steps: from the first to the second body.
        size: pitch of a screw [m/rad], length of a rod [m].
    """

    joint: str
    kind: str
    bodies: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray]
    steps: tuple[Step, ...]
    size: float = 0.0

    def reversed(self) -> Edge:
        """Return the same joint seen from the other body."""
        back = tuple(step.reversed() for step in reversed(self.steps))
        return replace(self, bodies=self.bodies[::-1], frames=self.frames[::-1], steps=back)


def edge(name: str, joint: PairJoint) -> Edge:
    """Turn a joint's frames and write its motion as steps."""
    kind, turn = kind_of(joint), np.eye(4)
    match joint:
        case UniversalJoint(axes=(first, second)):
            turn[:3, :3] = np.column_stack([first, second, np.cross(first, second)])
        case RevoluteJoint() | PrismaticJoint() | ScrewJoint() | CylindricalJoint():
            turn = turn_z_to(np.array(joint.axis))
    near, far = (pose_of(frame) @ turn for frame in joint.frames)
    size = (
        joint.pitch
        if isinstance(joint, ScrewJoint)
        else joint.length
        if isinstance(joint, RodJoint)
        else 0.0
    )
    coordinates, rates = iter(joint.coordinates(name)), iter(joint.rates(name))

    def step(motion: Motion, axis: np.ndarray) -> Step:
        takes, gives = (4, 3) if motion == "ball" else (1, 1)
        own = (
            tuple(next(coordinates) for _ in range(takes)),
            tuple(next(rates) for _ in range(gives)),
        )
        return Step(motion, axis, *own, pitch=size if motion == "screw" else 0.0)

    steps = tuple(step(*motion) for motion in MOTIONS[kind])
    return Edge(name, kind, joint.connects, (near, far), steps, size)


def kind_of(joint: PairJoint) -> str:
    """Return the name of a joint's type."""
    return joint.type  # pyright: ignore[reportAttributeAccessIssue]


def effects_of(joint: PairJoint) -> Effects:
    """Return friction, spring, limits and rotor inertia by freedom, in the order of the steps."""
    return joint.effects()  # pyright: ignore[reportAttributeAccessIssue]


def pose_of(frame: Frame) -> np.ndarray:
    """Return the 4 x 4 pose of a frame."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(frame.rotation).as_matrix()
    pose[:3, 3] = frame.position
    return pose


def turn_z_to(axis: np.ndarray) -> np.ndarray:
    """Return a pose without translation whose z axis is the given unit axis."""
    pose = np.eye(4)
    if axis[2] < 1.0:
        pose[:3, :3] = upright(axis)
    return pose


def upright(z: np.ndarray) -> np.ndarray:
    """Return rotation matrices (..., 3, 3) whose z axes are these unit vectors (..., 3)."""
    aside = np.where(abs(z[..., :1]) < 0.7, X, Y)
    x = np.cross(aside, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


# Coordinates and rates, read off the second frame's pose X and twist in the first; (..., 4, 4) and
# (..., 6)


def coordinates_at(item: Edge, pose: np.ndarray) -> np.ndarray:
    """Return a joint's coordinates at X_12, shape (..., nq); angles within half a turn."""
    R, p = pose[..., :3, :3], pose[..., :3, 3]
    angle = np.arctan2(R[..., 1, 0], R[..., 0, 0])[..., None]
    match item.kind:
        case "revolute" | "screw":
            return angle
        case "prismatic":
            return p[..., 2:]
        case "cylindrical":
            return np.concatenate([angle, p[..., 2:]], axis=-1)
        case "universal":
            return np.stack(
                [np.arctan2(R[..., 2, 1], R[..., 1, 1]), np.arctan2(R[..., 0, 2], R[..., 0, 0])],
                axis=-1,
            )
        case "spherical":
            return quaternion_of(R)
        case "planar":
            return np.concatenate([p[..., :2], angle], axis=-1)
        case "free":
            return np.concatenate([p, quaternion_of(R)], axis=-1)
        case _:
            return np.zeros((*p.shape[:-1], 0))


def quaternion_of(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (w, x, y, z) with w >= 0 of rotation matrices."""
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return flat.reshape(*R.shape[:-2], 4)


def rate_rows(item: Edge, pose: np.ndarray) -> np.ndarray:
    """Return F with rates = F t at X_12, shape (..., nv, 6).

    The rates' derivatives are F t': the one row that moves, a universal joint's y axis of its
    second frame, moves perpendicular to omega.
    """
    shown = RATES[item.kind]
    unit = np.eye(6)[list(shown)].reshape(len(shown), 6)
    rows = np.array(np.broadcast_to(unit, (*pose.shape[:-2], len(shown), 6)))
    if item.kind == "universal":
        rows[..., 1, :3] = pose[..., :3, 1]
    return rows


# What a joint holds


def held_rows(item: Edge, pose: np.ndarray) -> np.ndarray:
    """Return H with H t = 0 for the joint's own motions, shape (..., h, 6), in the order of `HELD`.

    Universal: omega . (x_1 x y_2);  screw: v_z - pitch omega_z;  rod: v . p / |p|.
    """
    held = HELD[item.kind]
    unit = np.eye(6)[[(axis + 3) % 6 for axis in held]].reshape(len(held), 6)
    rows = np.array(np.broadcast_to(unit, (*pose.shape[:-2], len(held), 6)))
    if item.kind == "universal":
        rows[..., 3, :3] = np.cross(X, pose[..., :3, 1])
    elif item.kind == "screw":
        rows[..., 2, 2] = -item.size
    elif item.kind == "rod":
        p = pose[..., :3, 3]
        rows[..., 0, 3:] = p / np.linalg.norm(p, axis=-1, keepdims=True)
    return rows


def gaps(item: Edge, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what should vanish at X_12 in the order of `HELD`: translations (..., a) [m], then
    turns (..., b) [rad].

    To first order they change by H t where they are small.
    """
    R, p = pose[..., :3, :3], pose[..., :3, 3]
    held = HELD[item.kind]
    shifts = p[..., [axis for axis in held if axis < 3]]
    match item.kind:
        case "rod":
            shifts = np.linalg.norm(p, axis=-1, keepdims=True) - item.size
        case "screw" if item.size:
            advance = p[..., 2] / item.size - coordinates_at(item, pose)[..., 0]
            shifts = shifts.copy()
            shifts[..., 2] = item.size * (advance - 2 * np.pi * np.round(advance / (2 * np.pi)))
    match item.kind:
        case "fixed" | "prismatic":
            turns = (R[..., (2, 0, 1), (1, 2, 0)] - R[..., (1, 2, 0), (2, 0, 1)]) / 2
        case "universal":
            turns = -R[..., 0, 1:2]
        case _:
            turns = np.stack([-R[..., 1, 2], R[..., 0, 2]], axis=-1)[
                ..., : sum(axis > 2 for axis in held)
            ]
    return shifts, turns
