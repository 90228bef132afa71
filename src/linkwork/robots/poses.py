"""Poses with unit quaternions (w, x, y, z): the little algebra that closed-form references need."""

from __future__ import annotations

from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkwork.mechanism import Frame


def turn(axis: ArrayLike, angle: float) -> np.ndarray:
    """Return the quaternion of Rot(axis, angle), angle in rad, for a unit axis."""
    return np.concatenate(([cos(angle / 2)], sin(angle / 2) * np.asarray(axis, float)))


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the quaternion of R_a R_b: (a0 b0 - a.b, a0 b + b0 a + a x b)."""
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate(([scalar], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])))


def inverse(a: np.ndarray) -> np.ndarray:
    """Return the quaternion of R_a transposed."""
    return a * (1, -1, -1, -1)


def rotated(a: np.ndarray, vector: ArrayLike) -> np.ndarray:
    """Return R_a times a vector: v + 2 a0 (a x v) + 2 a x (a x v)."""
    v = np.asarray(vector, float)
    across = np.cross(a[1:], v)
    return v + 2 * a[0] * across + 2 * np.cross(a[1:], across)


class QuaternionPose(NamedTuple):
    """Place a body in the ground: position of its origin [m] and quaternion of its axes."""

    position: np.ndarray
    quaternion: np.ndarray

    @classmethod
    def of(cls, frame: Frame) -> QuaternionPose:
        """Return the pose of a body whose frame is placed in the ground."""
        angle = hypot(*frame.orientation)
        axis = np.array(frame.orientation) / angle if angle > 0 else np.zeros(3)
        return cls(np.array(frame.position), turn(axis, angle))

    def point(self, local: ArrayLike) -> np.ndarray:
        """Return a point of the body in the ground's axes [m]."""
        return self.position + rotated(self.quaternion, local)


def free_coordinates(name: str, pose: QuaternionPose) -> dict[str, float]:
    """Return the coordinates of a free joint between ground and a body in that pose."""
    values = (*pose.position, *pose.quaternion)
    return dict(
        zip(
            (f"{name}.{part}" for part in ("x", "y", "z", "qw", "qx", "qy", "qz")),
            map(float, values),
            strict=True,
        )
    )


def ball_coordinates(name: str, first: np.ndarray, second: np.ndarray) -> dict[str, float]:
    """Return the coordinates of a spherical joint between bodies with these quaternions: that of
    R_1' R_2."""
    quaternion = product(inverse(first), second)
    quaternion = quaternion if quaternion[0] >= 0 else -quaternion
    return dict(
        zip(
            (f"{name}.{part}" for part in ("qw", "qx", "qy", "qz")),
            map(float, quaternion),
            strict=True,
        )
    )
