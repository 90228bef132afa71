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

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.mechanism import Frame, Mechanism, PairJoint, RodJoint

Motion = Literal["turn", "slide", "screw", "ball"]
X, Y, Z = np.eye(3)
CROSSED = ("turn", "turn")  # motions of a universal joint

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

RODS = ("rod",)
"""The joint types whose frames keep a distance; their one row is told as the first translation."""


def rates_shown(kind: str) -> list[int]:
    """Return the components of the twist (omega, v) that are the rates; a universal joint's second
    see `rate_rows`."""
    found = []
    for motion, axis in MOTIONS[kind]:
        place = int(np.argmax(axis))
        found += [0, 1, 2] if motion == "ball" else [place + 3 * (motion == "slide")]
    return found


def held(kind: str) -> list[int]:
    """Return what is held: translations (0, 1, 2) and rotations (3, 4, 5) along x, y, z; a screw's
    2 see `held_rows`."""
    moved = [(component + 3) % 6 for component in rates_shown(kind)]
    return [0] if kind in RODS else [axis for axis in range(6) if axis not in moved]


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

    @property
    def motions(self) -> tuple[Motion, ...]:
        """Return what the steps are."""
        return tuple(step.motion for step in self.steps)

    @property
    def rod(self) -> bool:
        """Tell whether the joint keeps a distance and nothing else."""
        return self.kind in RODS

    def reversed(self) -> Edge:
        """Return the same joint seen from the other body."""
        back = tuple(step.reversed() for step in reversed(self.steps))
        return replace(self, bodies=self.bodies[::-1], frames=self.frames[::-1], steps=back)


def edge(name: str, joint: PairJoint) -> Edge:
    """Turn a joint's frames and write its motion as steps."""
    kind, turn = joint.type, turned(joint)
    near, far = (pose_of(frame) @ turn for frame in joint.frames)
    size = getattr(joint, "pitch", getattr(joint, "length", 0.0))
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


def turned(joint: PairJoint) -> np.ndarray:
    """Return the pose, without translation, in which the joint's axis is z; a universal joint's
    axes are x and y."""
    if (axes := getattr(joint, "axes", None)) is not None:
        turn = np.eye(4)
        turn[:3, :3] = np.column_stack([*axes, np.cross(*axes)])
        return turn
    return turn_z_to(np.array(getattr(joint, "axis", Z)))


def rods_of(mechanism: Mechanism) -> dict[str, RodJoint]:
    """Return the rods of a mechanism."""
    return {name: joint for name, joint in mechanism.pairs.items() if isinstance(joint, RodJoint)}


def pose_of(frame: Frame) -> np.ndarray:
    """Return the 4 x 4 pose of a frame."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(frame.orientation).as_matrix()
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
    if item.motions == CROSSED:
        angles = np.arctan2(R[..., 2, 1], R[..., 1, 1]), np.arctan2(R[..., 0, 2], R[..., 0, 0])
        return np.stack(angles, axis=-1)
    columns = [np.zeros((*p.shape[:-1], 0))]
    for motion, axis in MOTIONS[item.kind]:
        match motion:
            case "slide":
                columns.append(p @ axis[:, None])
            case "ball":
                columns.append(quaternion_of(R))
            case _:
                columns.append(np.arctan2(R[..., 1, 0], R[..., 0, 0])[..., None])
    return np.concatenate(columns, axis=-1)


def quaternion_of(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (w, x, y, z) with w >= 0 of rotation matrices."""
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return flat.reshape(*R.shape[:-2], 4)


def rate_rows(item: Edge, pose: np.ndarray) -> np.ndarray:
    """Return F with rates = F t at X_12, shape (..., nv, 6).

    The rates' derivatives are F t': the one row that moves, a universal joint's y axis of its
    second frame, moves perpendicular to omega.
    """
    shown = rates_shown(item.kind)
    unit = np.eye(6)[shown].reshape(len(shown), 6)
    rows = np.array(np.broadcast_to(unit, (*pose.shape[:-2], len(shown), 6)))
    if item.motions == CROSSED:
        rows[..., 1, :3] = pose[..., :3, 1]
    return rows


# What a joint holds


def held_rows(item: Edge, pose: np.ndarray) -> np.ndarray:
    """Return H with H t = 0 for the joint's own motions, shape (..., h, 6), in the order of `held`.

    Universal: omega . (x_1 x y_2);  screw: v_z - pitch omega_z;  rod: v . p / |p|.
    """
    unit = np.eye(6)[[(axis + 3) % 6 for axis in held(item.kind)]].reshape(-1, 6)
    rows = np.array(np.broadcast_to(unit, (*pose.shape[:-2], *unit.shape)))
    if item.motions == CROSSED:
        rows[..., 3, :3] = np.cross(X, pose[..., :3, 1])
    elif "screw" in item.motions:
        rows[..., 2, 2] = -item.size
    elif item.rod:
        p = pose[..., :3, 3]
        rows[..., 0, 3:] = p / np.linalg.norm(p, axis=-1, keepdims=True)
    return rows


def gaps(item: Edge, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what should vanish at X_12 in the order of `held`: translations (..., a) [m], then
    turns (..., b) [rad].

    To first order they change by H t where they are small.
    """
    R, p = pose[..., :3, :3], pose[..., :3, 3]
    shifts = p[..., [axis for axis in held(item.kind) if axis < 3]]
    if item.rod:
        shifts = np.linalg.norm(p, axis=-1, keepdims=True) - item.size
    elif "screw" in item.motions and item.size:
        advance = p[..., 2] / item.size - coordinates_at(item, pose)[..., 0]
        shifts[..., 2] = item.size * (advance - 2 * np.pi * np.round(advance / (2 * np.pi)))
    turning = [axis for axis in held(item.kind) if axis > 2]
    if item.motions == CROSSED:
        turns = -R[..., 0, 1:2]
    elif len(turning) == 3:
        turns = (R[..., (2, 0, 1), (1, 2, 0)] - R[..., (1, 2, 0), (2, 0, 1)]) / 2
    else:
        turns = np.stack([-R[..., 1, 2], R[..., 0, 2]], axis=-1)[..., : len(turning)]
    return shifts, turns
