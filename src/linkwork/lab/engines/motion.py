"""Motion of bodies from motion of joints, and back.

A pose X_GB is a 4 x 4 matrix; a twist is (angular, linear) of a body's origin in the ground's axes,
and the acceleration of a body is the derivative of its twist. Leading dimensions (instants of time)
are kept everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.spatial.transform import Rotation

from linkwork.lab.engines.joints import Edge, Step, coordinates_at, edge, gaps, rate_rows
from linkwork.lab.engines.tree import EngineTree
from linkwork.mechanism import GROUND, Mechanism


class SeenFrame(NamedTuple):
    """Hold the pose (..., 4, 4) of a frame, its twist (..., 6) and the twist's derivative."""

    pose: np.ndarray
    twist: np.ndarray
    change: np.ndarray


@dataclass(frozen=True)
class BodyMotion:
    """Hold poses, shape (..., r, 4, 4), twists and their derivatives, shape (..., r, 6), of the
    named bodies' origins."""

    names: tuple[str, ...]
    poses: np.ndarray
    twists: np.ndarray
    accelerations: np.ndarray

    def at_one_instant(self) -> BodyMotion:
        """Return a motion without leading dimensions as one with one instant."""
        return BodyMotion(self.names, self.poses[None], self.twists[None], self.accelerations[None])

    def frame(self, body: str, frame: np.ndarray) -> SeenFrame:
        """Return pose, twist and the twist's derivative of a frame fixed in a body."""
        if body == GROUND:
            shape = self.poses.shape[:-3]
            still = np.zeros((*shape, 6))
            return SeenFrame(np.broadcast_to(frame, (*shape, 4, 4)), still, still)
        index = self.names.index(body)
        pose = self.poses[..., index, :, :] @ frame
        arm = pose[..., :3, 3] - self.poses[..., index, :3, 3]
        omega, velocity = np.split(self.twists[..., index, :], 2, axis=-1)
        alpha, acceleration = np.split(self.accelerations[..., index, :], 2, axis=-1)
        velocity = velocity + np.cross(omega, arm)
        acceleration = acceleration + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        twist = np.concatenate([omega, velocity], axis=-1)
        return SeenFrame(pose, twist, np.concatenate([alpha, acceleration], axis=-1))

    def across(self, item: Edge) -> SeenFrame:
        """Return pose X_12, twist and its derivative of a joint's second frame, seen and resolved
        in its first.

        d = p_2 - p_1;  v_12 = v_2 - v_1 - omega_1 x d;
        a_12 = a_2 - a_1 - alpha_1 x d - omega_1 x (omega_1 x d) - 2 omega_1 x v_12;
        alpha_12 = alpha_2 - alpha_1 - omega_1 x omega_12.
        """
        (near, twist, change), (far, other, rise) = map(self.frame, item.bodies, item.frames)
        omega, alpha = twist[..., :3], change[..., :3]
        d = far[..., :3, 3] - near[..., :3, 3]
        turning = other[..., :3] - omega
        sliding = other[..., 3:] - twist[..., 3:] - np.cross(omega, d)
        spin_up = rise[..., :3] - alpha - np.cross(omega, turning)
        speed_up = (
            rise[..., 3:]
            - change[..., 3:]
            - np.cross(alpha, d)
            - np.cross(omega, np.cross(omega, d) + 2 * sliding)
        )
        back = np.swapaxes(near[..., :3, :3], -1, -2)

        def seen(*vectors: np.ndarray) -> np.ndarray:
            return np.concatenate([applied(back, vector) for vector in vectors], axis=-1)

        twist, change = seen(turning, sliding), seen(spin_up, speed_up)
        return SeenFrame(np.linalg.inv(near) @ far, twist, change)


def applied(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the products of matrices (..., m, n) and vectors (..., n)."""
    return (matrices @ vectors[..., None])[..., 0]


# From the tree's joints to the bodies


@dataclass(frozen=True)
class Moving:
    """Hold a frame's pose, angular velocity, velocity of its origin, and their derivatives, in the
    ground's axes."""

    pose: np.ndarray
    omega: np.ndarray
    v: np.ndarray
    alpha: np.ndarray
    a: np.ndarray

    def to(self, fixed: np.ndarray) -> Moving:
        """Return the motion of a frame that is fixed in this one."""
        pose = self.pose @ fixed
        return replace(self._at(pose[..., :3, 3] - self.pose[..., :3, 3]), pose=pose)

    def across(self, step: Step, q: np.ndarray, w: np.ndarray, dw: np.ndarray) -> Moving:
        """Return the motion beyond a step with coordinates q (..., 1 or 4), rates w (..., 1 or 3),
        derivatives dw."""
        R = self.pose[..., :3, :3]
        if step.motion == "ball":
            turn = rotations(Rotation.from_quat(q.reshape(-1, 4), scalar_first=True), q)
            if step.backwards:
                turn = np.swapaxes(turn, -1, -2)
                w, dw = -applied(turn, w), -applied(turn, dw)
            return self._turned(turn, applied(R, w), applied(R, dw))
        axis, moved = R @ step.axis, self
        if step.motion in ("slide", "screw"):
            along = axis * (step.pitch if step.motion == "screw" else 1.0)
            moved = moved._slid(q * along, w * along, dw * along)
        if step.motion in ("turn", "screw"):
            turn = rotations(Rotation.from_rotvec(q.reshape(-1, 1) * step.axis), q)
            moved = moved._turned(turn, w * axis, dw * axis)
        return moved

    def _at(self, arm: np.ndarray) -> Moving:
        """Return the motion of the point at an arm."""
        swing = np.cross(self.omega, arm)
        return replace(
            self,
            v=self.v + swing,
            a=self.a + np.cross(self.alpha, arm) + np.cross(self.omega, swing),
        )

    def _slid(self, d: np.ndarray, speed: np.ndarray, speeding: np.ndarray) -> Moving:
        there, pose = self._at(d), np.array(self.pose)
        pose[..., :3, 3] += d
        a = there.a + 2 * np.cross(self.omega, speed) + speeding
        return replace(there, pose=pose, v=there.v + speed, a=a)

    def _turned(self, turn: np.ndarray, spin: np.ndarray, spinning: np.ndarray) -> Moving:
        pose = np.array(self.pose)
        pose[..., :3, :3] = pose[..., :3, :3] @ turn
        alpha = self.alpha + np.cross(self.omega, spin) + spinning
        return replace(self, pose=pose, omega=self.omega + spin, alpha=alpha)


def rotations(found: Rotation, like: np.ndarray) -> np.ndarray:
    """Return rotation matrices (..., 3, 3) with the leading dimensions of coordinates (..., n)."""
    return found.as_matrix().reshape(*like.shape[:-1], 3, 3)


def along_tree(
    mechanism: Mechanism,
    tree: EngineTree,
    positions: np.ndarray,
    rates: np.ndarray,
    accelerations: np.ndarray | None = None,
    known: Mapping[str, Moving] | None = None,
) -> BodyMotion:
    """Return the bodies' motion from the tree's joints.

    X_2 = X_1 F_1 S F_2^-1, and from the first frame to the second, d being the step's own
    displacement: omega_2 = omega_1 + w;  v_2 = v_1 + omega_1 x d + d';
    alpha_2 = alpha_1 + omega_1 x w + w';  a_2 = a_1 + alpha_1 x d + omega_1 x (omega_1 x d) + 2
    omega_1 x d' + d''.

    Args:
        mechanism, tree: the description and its tree.
        positions, rates, accelerations: of all joints, shapes (..., nq) and (..., nv) twice; of the
            cut joints unused.
        known: bodies whose motion is known without their joints.
    """
    # Ground stands still; what is known is not asked of joints.
    accelerations = np.zeros_like(rates) if accelerations is None else accelerations
    coordinate, rate = places(mechanism.coordinates), places(mechanism.rates)
    shape = positions.shape[:-1]
    still = np.zeros((*shape, 3))
    moving = {
        GROUND: Moving(np.broadcast_to(np.eye(4), (*shape, 4, 4)), still, still, still, still),
        **(known or {}),
    }
    # From body to body: to the joint's first frame, across its steps, back to the body's own frame.
    for item in tree.edges:
        if item.bodies[1] in moving:
            continue
        frame = moving[item.bodies[0]].to(item.frames[0])
        for step in item.steps:
            own = [coordinate[label] for label in step.coordinates]
            speeds = [rate[label] for label in step.rates]
            frame = frame.across(
                step, positions[..., own], rates[..., speeds], accelerations[..., speeds]
            )
        moving[item.bodies[1]] = frame.to(np.linalg.inv(item.frames[1]))
    names = tuple(mechanism.bodies)
    found = [moving[name] for name in names]
    return BodyMotion(
        names,
        poses=np.stack([body.pose for body in found], axis=-3),
        twists=np.stack([np.concatenate([body.omega, body.v], axis=-1) for body in found], axis=-2),
        accelerations=np.stack(
            [np.concatenate([body.alpha, body.a], axis=-1) for body in found], axis=-2
        ),
    )


def places(names: tuple[str, ...]) -> dict[str, int]:
    """Number names."""
    return {name: place for place, name in enumerate(names)}


# From the bodies to the joints


@dataclass(frozen=True)
class JointMotion:
    """Hold what the bodies' motion says of the joints: coordinates (k, nq), rates and their
    derivatives (k, nv), gaps."""

    positions: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    closure_error: float
    alignment_error: float


def read_joints(mechanism: Mechanism, motion: BodyMotion, start: np.ndarray) -> JointMotion:
    """Read the joints off, at k instants; angles are continuous in time and begin within half a
    turn of `start`, (nq,).

    Quaternions are continuous too, and begin on the side of `start`.
    """
    beginning = dict(zip(mechanism.coordinates, start, strict=True))
    positions: dict[str, np.ndarray] = {}
    rates, accelerations = [np.zeros((len(motion.poses), 0))], [np.zeros((len(motion.poses), 0))]
    shifts, turns = [0.0], [0.0]
    for name, joint in mechanism.pairs.items():
        item = edge(name, joint)
        pose, twist, change = motion.across(item)
        rows = rate_rows(item, pose)
        rates.append(applied(rows, twist))
        accelerations.append(applied(rows, change))
        positions |= continuous(item, coordinates_at(item, pose), beginning)
        for found, gap in zip((shifts, turns), gaps(item, pose), strict=True):
            found.append(float(np.max(np.linalg.norm(gap, axis=-1))))
    for gear in mechanism.gears.values():
        shown = sum(polyval(positions[q], [0, *gear.polynomial(q)]) for q in gear.ratios)
        turns.append(float(np.max(abs(shown - gear.offset))))
    columns = [positions[label] for label in mechanism.coordinates]
    return JointMotion(
        positions=np.stack(columns, axis=-1) if columns else np.zeros((len(motion.poses), 0)),
        rates=np.concatenate(rates, axis=-1),
        accelerations=np.concatenate(accelerations, axis=-1),
        closure_error=max(shifts),
        alignment_error=max(turns),
    )


def continuous(item: Edge, values: np.ndarray, start: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Return the coordinates of a joint (k, nq) by name, without jumps in time, from the side of
    `start` on."""
    shown: dict[str, np.ndarray] = {}
    columns = iter(np.moveaxis(values, -1, 0))
    for step in item.steps:
        own = np.stack([next(columns) for _ in step.coordinates], axis=-1)
        first = np.array([start[label] for label in step.coordinates])
        if step.motion == "ball":
            turns = np.sum(own * np.concatenate([first[None], own[:-1]]), axis=-1)
            own = own * np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, None]
        elif step.motion != "slide":
            own = np.unwrap(own, axis=0)
            own = own + 2 * np.pi * np.round((first - own[0]) / (2 * np.pi))
        shown |= zip(step.coordinates, own.T, strict=True)
    return shown
