"""Poses as 4 x 4 matrices X_AB: what the files' ways to write a position and an orientation come
to.

A point with components p in B has components X_AB p in A; X_AC = X_AB X_BC.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.mechanism import Frame, Shape
from linkwork.mechanism.record import Vector3

TINY = 1e-15  # what rounding leaves of a zero


def pose(position=(0.0, 0.0, 0.0), rotation: np.ndarray | None = None) -> np.ndarray:
    """Return the pose of a position [m] and a rotation matrix."""
    X = np.eye(4)
    X[:3, 3] = position
    if rotation is not None:
        X[:3, :3] = rotation
    return X


def of_frame(frame: Frame) -> np.ndarray:
    """Return the pose of a frame."""
    return pose(frame.position, Rotation.from_rotvec(frame.orientation).as_matrix())


def frame_of(X: np.ndarray) -> Frame:
    """Return the frame of a pose; what rounding left of zeros is zero."""
    if (X[:3, :3] == np.eye(3)).all():
        return Frame(position=triple(X[:3, 3]))
    return Frame(
        position=triple(X[:3, 3]), rotation=triple(Rotation.from_matrix(X[:3, :3]).as_rotvec())
    )


def carried(shapes: Iterable[Shape], X: np.ndarray) -> tuple[Shape, ...]:
    """Return shapes of B as shapes of A, where X = X_AB."""
    return tuple(
        shape.model_copy(update={"frame": frame_of(X @ of_frame(shape.frame))}) for shape in shapes
    )


def triple(vector) -> Vector3:
    """Return three numbers as a record wants them; what rounding left of zeros is zero."""
    x, y, z = (0.0 if abs(number) < TINY else float(number) for number in vector)
    return x, y, z


def inverse(X: np.ndarray) -> np.ndarray:
    """Return the pose seen from the other side, X_BA."""
    return pose(-X[:3, :3].T @ X[:3, 3], X[:3, :3].T)


def turn(axis, angle: float) -> np.ndarray:
    """Return Rot(axis, angle), axis of length 1, angle [rad]."""
    return pose(rotation=Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix())


def shift(vector) -> np.ndarray:
    """Return Trans(vector) [m]."""
    return pose(vector)


def point(X: np.ndarray, p) -> np.ndarray:
    """Return the components in A of a point given in B."""
    return X[:3, :3] @ np.asarray(p) + X[:3, 3]


def unit(vector) -> np.ndarray:
    """Return a vector scaled to length 1, however long or short it is."""
    vector = np.asarray(vector, float)
    vector = vector / np.max(np.abs(vector))
    return vector / np.linalg.norm(vector)


def from_z(z) -> np.ndarray:
    """Return the rotation matrix with that z axis which is the least turn away from no rotation."""
    x, y, w = unit(z)
    s = np.hypot(x, y)
    if s == 0.0:
        return np.diag([1.0, np.sign(w), np.sign(w)])
    return Rotation.from_rotvec(np.arctan2(s, w) / s * np.array([-y, x, 0.0])).as_matrix()


def across(z, near) -> np.ndarray:
    """Return the rotation matrix with that z axis and the x axis as near to a vector as can be."""
    z = unit(z)
    x = near - (near @ z) * z
    if np.linalg.norm(x) < 1e-6:
        x = np.eye(3)[np.argmin(abs(z))]
        x = x - (x @ z) * z
    x = unit(x)
    return np.column_stack([x, np.cross(z, x), z])


def completed(columns: dict[int, np.ndarray]) -> np.ndarray | None:
    """Return the rotation matrix that has some given unit columns; None where no rotation has
    them."""
    R = np.zeros((3, 3))
    for index, column in columns.items():
        R[:, index] = column
    missing = [index for index in range(3) if index not in columns]
    if len(missing) == 2:
        (given,) = columns
        R = np.roll(
            across(columns[given], np.eye(3)[np.argmin(abs(columns[given]))]), given - 2, axis=1
        )
    elif missing:
        (m,) = missing
        R[:, m] = np.cross(R[:, m - 2], R[:, m - 1])
    proper = np.max(abs(R.T @ R - np.eye(3))) < 1e-9 and np.linalg.det(R) > 0
    return R if proper else None


def from_quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """Return the rotation matrix of a quaternion, which is normalised; one without length is no
    rotation, as in MuJoCo."""
    if np.max(np.abs([w, x, y, z])) < TINY:
        return np.eye(3)
    w, x, y, z = unit([w, x, y, z])
    return Rotation.from_quat([w, x, y, z], scalar_first=True).as_matrix()


def to_quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix, w >= 0."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True, scalar_first=True)


def from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    return Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()


def to_rpy(rotation: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw of R = Rz(yaw) Ry(pitch) Rx(roll), to rounding at and near pitches of
    a quarter turn, too: roll is that of Rz(yaw)' R, whatever yaw is there."""
    (x, *_), (y, *_), (z, *_) = rotation
    pitch, yaw = np.arctan2(-z, np.hypot(x, y)), np.arctan2(y, x)
    sine, cosine = np.sin(yaw), np.cos(yaw)
    _, second, third = (cosine * rotation[1] - sine * rotation[0]).tolist()
    return np.arctan2(-third, second), pitch, yaw
