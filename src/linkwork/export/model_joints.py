"""The joints of a model of MuJoCo in the robot's terms, there and back.

Hinges and slides have the robot's own coordinates. A ball counts its turn from home, in the axes
of the body that it carries: with the joint's frames F1 and F2 (F2 and F1 where it leads backwards)
and the body B in ground at home,

    R_mujoco = A R B',   v_mujoco = B R' w,   A = R_B' R_F1,   B = R_B' R_F2

where R = R_12 and w is in F1's axes; dw/dt = R B' dv/dt, for w x w vanishes. A free joint of MuJoCo
has the body's origin and its velocity in ground's axes, and its angular velocity in its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.equations.joints import motions_of
from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.mjcf.model_plan import ADVANCE, Home, ModelPlan, Move
from linkwork.mechanism import GROUND, Mechanism, PairJoint
from linkwork.mechanism.joints import JointFreedom

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Moved:
    """Hold how a robot moves at one state: coordinates and rates of its joints by name, poses
    (4, 4) of its bodies, and their twists (6): angular velocity, and velocity of the mass
    centre."""

    positions: Mapping[str, float]
    rates: Mapping[str, float]
    poses: Mapping[str, np.ndarray]
    twists: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class ModelJoint:
    """Say where a joint of MuJoCo is in qpos and qvel, and which coordinates and rates of the robot
    it brings; none where the robot has no such joint."""

    q: slice
    v: slice
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]

    def into(self, moved: Moved) -> tuple[np.ndarray, np.ndarray]:
        """Return the joint's own part of qpos and qvel."""
        raise NotImplementedError

    def out_of(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Motion:
        """Return coordinates, rates and accelerations of the robot from MuJoCo's."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class HingeOrSlide(ModelJoint):
    """A hinge or a slide: q_mujoco = factor q of the coordinate `of`, a screw's slide its pitch
    times the angle."""

    of: JointFreedom
    factor: float

    def into(self, moved: Moved) -> tuple[np.ndarray, np.ndarray]:
        q, v = moved.positions[self.of.coordinates[0]], moved.rates[self.of.rates[0]]
        return np.array([self.factor * q]), np.array([self.factor * v])

    def out_of(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Motion:
        held = len(self.coordinates)
        return q[:held], v[:held], a[:held]


@dataclass(frozen=True, eq=False)
class Turned(ModelJoint):
    """A ball between the frames `ends` of two bodies, towards the body that it carries."""

    ends: tuple[tuple[str, np.ndarray], tuple[str, np.ndarray]]
    A: np.ndarray
    B: np.ndarray
    backwards: bool

    def into(self, moved: Moved) -> tuple[np.ndarray, np.ndarray]:
        first, second = (moved.poses[body][:3, :3] @ R for body, R in self.ends)
        spin = moved.twists[self.ends[1][0]][:3] - moved.twists[self.ends[0][0]][:3]
        q = poses.to_quaternion(self.A @ first.T @ second @ self.B.T)
        return np.asarray(q), self.B @ second.T @ spin

    def out_of(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Motion:
        R = self.A.T @ Rotation.from_quat(q, scalar_first=True).as_matrix() @ self.B
        into = -self.B.T if self.backwards else R @ self.B.T
        turned = poses.to_quaternion(R.T if self.backwards else R)
        return np.asarray(turned), into @ v, into @ a


@dataclass(frozen=True, eq=False)
class Floating(ModelJoint):
    """A free joint of MuJoCo: of a body with mass centre c, between frames F1 in ground and F2 on
    the body."""

    body: str
    centre: np.ndarray
    near: np.ndarray
    far: np.ndarray

    def into(self, moved: Moved) -> tuple[np.ndarray, np.ndarray]:
        X, twist = moved.poses[self.body], moved.twists[self.body]
        R, spin = X[:3, :3], twist[:3]
        going = twist[3:] - np.cross(spin, R @ self.centre)
        q = np.concatenate([X[:3, 3], poses.to_quaternion(R)])
        return q, np.concatenate([going, R.T @ spin])

    def out_of(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Motion:
        if not self.coordinates:
            return q[:0], v[:0], a[:0]
        R = Rotation.from_quat(q[3:], scalar_first=True).as_matrix()
        spin, gain, arm = R @ v[3:], R @ a[3:], R @ self.far[:3, 3]
        X = poses.inverse(self.near) @ poses.pose(q[:3], R) @ self.far
        back = self.near[:3, :3].T
        going = v[:3] + np.cross(spin, arm)
        rising = a[:3] + np.cross(gain, arm) + np.cross(spin, np.cross(spin, arm))
        return (
            np.concatenate([X[:3, 3], poses.to_quaternion(X[:3, :3])]),
            np.concatenate([back @ going, back @ spin]),
            np.concatenate([back @ rising, back @ gain]),
        )


def model_joints(
    mechanism: Mechanism, home: Home, held: ModelPlan, model: Any
) -> tuple[ModelJoint, ...]:
    """Return the joints of a model that was written as planned, in the order of qpos."""
    parts = {
        name if len(joint.freedoms) == 1 else f"{name}.{part.name}": (name, joint, part)
        for name, joint in mechanism.pairs.items()
        for part in joint.parts(name)
    }
    found: list[ModelJoint] = []
    for seat in held.seats.values():
        for move in seat.moves:
            q, v = (int(of[0]) for of in places(model, move))
            if move.kind == "free":
                found.append(floating(mechanism, move.name, seat.body, q, v))
            elif move.kind == "ball":
                _, joint, part = parts[move.name]
                found.append(turned(joint, part, move, home, seat.body, q, v))
            else:
                found.append(straight(parts, move, q, v))
    return tuple(found)


def places(model: Any, move: Move) -> tuple[np.ndarray, np.ndarray]:
    """Return where a joint begins in qpos and in qvel."""
    joint = model.joint(move.name)
    return joint.qposadr, joint.dofadr


def straight(
    parts: Mapping[str, tuple[str, PairJoint, JointFreedom]], move: Move, q: int, v: int
) -> HingeOrSlide:
    """Return a hinge or a slide; what goes along with a screw brings no coordinate."""
    at = slice(q, q + 1), slice(v, v + 1)
    if move.name in parts:
        part = parts[move.name][2]
        return HingeOrSlide(*at, part.coordinates, part.rates, part, 1.0)
    _, joint, part = parts[move.name.removesuffix(f".{ADVANCE}")]
    return HingeOrSlide(*at, (), (), part, float(motions_of(joint)[0].pitch or 0.0))


def turned(
    joint: PairJoint, part: JointFreedom, move: Move, home: Home, body: str, q: int, v: int
) -> Turned:
    """Return a ball that carries a body."""
    sides = [
        (name, poses.of_frame(frame)[:3, :3])
        for name, frame in zip(joint.connects, joint.frames, strict=True)
    ]
    first, second = sides[::-1] if move.backwards else sides
    back = home.poses[body][:3, :3].T
    A, B = (back @ home.poses[name][:3, :3] @ R for name, R in (first, second))
    at = slice(q, q + 4), slice(v, v + 3)
    return Turned(*at, part.coordinates, part.rates, (first, second), A, B, move.backwards)


def floating(mechanism: Mechanism, name: str, body: str, q: int, v: int) -> Floating:
    """Return a free joint of MuJoCo, which a body that only rods reach has of its own.

    Raises:
        LinkworkError: the joint leads to ground.
    """
    at, centre = (slice(q, q + 7), slice(v, v + 6)), np.array(mechanism.bodies[body].centre_of_mass)
    joint = mechanism.pairs.get(name)
    if joint is None:
        return Floating(*at, (), (), body, centre, np.eye(4), np.eye(4))
    if joint.connects[0] != GROUND:
        raise LinkworkError(
            f"joints.{name}: leads from {body!r} to ground, and MuJoCo's free joints lead from "
            f"ground; write connects: [ground, {body}], with the frames exchanged"
        )
    near, far = map(poses.of_frame, joint.frames)
    return Floating(*at, joint.coordinates(name), joint.rates(name), body, centre, near, far)
