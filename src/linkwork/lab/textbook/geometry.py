"""Rigid transforms and rotations: X = [R p; 0 1] turns components in a body's frame into components
in the base.

With [w x] the matrix of a cross product,

    [w x] r = w x r
    exp([e x]) = 1 + sin x / x [e x] + 2 sin^2(x/2) / x^2 [e x]^2,   x = |e|
    E = exp([e x])   ->   E' = [w x] E   with   e' = J(e)^-1 w,
    J(e)^-1 = 1 - [e x]/2 + (1 - (x/2) cot(x/2)) / x^2 [e x]^2
"""

from __future__ import annotations

from math import sin, tan

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.mechanism import Frame


def cross_matrix(w: np.ndarray) -> np.ndarray:
    """Return [w x], the 3 x 3 matrix with [w x] r = w x r."""
    x, y, z = w
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_vector(E: np.ndarray) -> np.ndarray:
    """Return e, axis times angle [rad], of the rotation matrix E = exp([e x])."""
    return Rotation.from_matrix(E).as_rotvec()


def rotation_vector_rate(e: np.ndarray) -> np.ndarray:
    """Return J(e)^-1 (3 x 3), which turns the angular velocity of E = exp([e x]) into e'."""
    x = float(np.linalg.norm(e))
    factor = (1 - x / 2 / tan(x / 2)) / x**2 if x > 1e-3 else 1 / 12 + x**2 / 720
    W = cross_matrix(e)
    return np.eye(3) - W / 2 + factor * W @ W


def transform(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return X = [R p; 0 1]."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X


def inverse(X: np.ndarray) -> np.ndarray:
    """Return X^-1 = [R' -R'p; 0 1]."""
    R, p = X[:3, :3], X[:3, 3]
    return transform(R.T, -R.T @ p)


def turn(vector: np.ndarray) -> np.ndarray:
    """Return the transform of a turn about the origin by a rotation vector [rad]."""
    x, W = float(np.linalg.norm(vector)), cross_matrix(vector)
    R = np.eye(3) + sin(x) / x * W + 2 * (sin(x / 2) / x) ** 2 * W @ W if x > 0 else np.eye(3)
    return transform(R, np.zeros(3))


def shift(vector: np.ndarray) -> np.ndarray:
    """Return the transform of a shift [m]."""
    return transform(np.eye(3), vector)


def frame_transform(frame: Frame) -> np.ndarray:
    """Return X_BF of a frame F fixed in a body B."""
    return shift(np.array(frame.position)) @ turn(np.array(frame.orientation))


def point(X: np.ndarray, r: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """Return p + R r: the point r of the body in the base's frame."""
    return X[:3, :3] @ np.asarray(r) + X[:3, 3]
