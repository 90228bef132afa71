"""What each joint type means, in the oracle's own words: its motion, its coordinates, its rows.

The frame F2 has the pose (R, p) = (R_12, p_12) and the twist s = [omega; u] in F1: omega is its
angular velocity and u = p' its velocity, both relative to F1 and in F1's axes. The rows F and A of
a joint type give its rates and what vanishes, and beta is the rest of the derivative:

    w = F s,    0 = A s,    w' = F s',    0 = A s' + beta

F and A are constant, and beta zero, but for two types. A universal joint's second axis b = R a_2
turns (b' = omega x b); its rate b . omega has no rest since b' . omega = 0. A rod's direction n = p
/ |p| turns too.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from linkwork.mechanism import (
    CylindricalJoint,
    FixedJoint,
    FreeJoint,
    PairJoint,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    SphericalJoint,
    UniversalJoint,
)

from tests.oracle.arithmetic import skew

x, y, z = np.eye(3)
I, O = np.eye(3), np.zeros(3)  # noqa: E741

Pose = tuple[np.ndarray, np.ndarray]  # (R, p)


def rows(joint: PairJoint, R: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return F (rates) and A (constraints): each row six numbers for [omega; u]."""
    match joint:
        case FixedJoint():
            return stack(), stack(turns(I), slides(I))
        case RevoluteJoint(axis=e):
            return stack(turns(e)), stack(turns(across(e)), slides(I))
        case PrismaticJoint(axis=e):
            return stack(slides(e)), stack(turns(I), slides(across(e)))
        case ScrewJoint(axis=e, pitch=h):
            advance = slides(e) - h * turns(e)
            return stack(turns(e)), stack(turns(across(e)), slides(across(e)), advance)
        case CylindricalJoint(axis=e):
            return stack(turns(e), slides(e)), stack(turns(across(e)), slides(across(e)))
        case UniversalJoint(axes=(a, a_2)):
            b = R @ a_2
            return stack(turns(a), turns(b)), stack(turns(cross(a, b)), slides(I))
        case SphericalJoint():
            return stack(turns(I)), stack(slides(I))
        case PlanarJoint():
            return stack(slides(x), slides(y), turns(z)), stack(turns(x), turns(y), slides(z))
        case FreeJoint():
            return stack(slides(I), turns(I)), stack()
        case RodJoint():
            return stack(), stack(slides(p / np.linalg.norm(p)))
    raise NotImplementedError(f"the oracle knows no {type(joint).__name__}")


def rest(
    joint: PairJoint, R: np.ndarray, p: np.ndarray, omega: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Return beta, one number per row of A."""
    beta = np.zeros(len(rows(joint, R, p)[1]))
    match joint:
        case UniversalJoint(axes=(a, a_2)):  # (a x b)' . omega
            beta[0] = cross(a, cross(omega, R @ a_2)) @ omega
        case RodJoint():  # n' . u = (u - n (n . u)) . u / |p|
            length = np.linalg.norm(p)
            beta[0] = (u @ u - (p @ u / length) ** 2) / length
    return beta


def coordinates(
    joint: PairJoint, R: np.ndarray, p: np.ndarray, near: Sequence[float]
) -> np.ndarray:
    """Return the joint's coordinates at (R, p), angles within half a turn of `near`'s.

    A screw's turns are counted by its advance. Where R has parts that the joint does not allow, an
    angle is that of the nearest allowed orientation (the twist of a swing-twist decomposition).
    """
    match joint:
        case RevoluteJoint(axis=e):
            return np.array([wrapped(twist(R, e), near[0])])
        case PrismaticJoint(axis=e):
            return np.array([p @ e])
        case ScrewJoint(axis=e, pitch=h):
            return np.array([wrapped(twist(R, e), float(p @ e) / h if h else near[0])])
        case CylindricalJoint(axis=e):
            return np.array([wrapped(twist(R, e), near[0]), p @ e])
        case UniversalJoint(axes=(a, a_2)):
            b = R @ a_2
            first = atan2(a @ cross(a_2, b), b @ a_2)
            second = twist(turned(a, first).T @ R, a_2)
            return np.array([wrapped(first, near[0]), wrapped(second, near[1])])
        case SphericalJoint():
            return quaternion(R)
        case PlanarJoint():
            return np.array([p[0], p[1], wrapped(twist(R, z), near[2])])
        case FreeJoint():
            return np.concatenate([p, quaternion(R)])
    return np.zeros(0)


def motion(joint: PairJoint, q: ArrayLike) -> Pose:
    """Return (R, p) at the joint's coordinates q; a rod does not say."""
    q = np.asarray(q, dtype=float)
    match joint:
        case RevoluteJoint(axis=e):
            return turned(e, q[0]), O
        case PrismaticJoint(axis=e):
            return I, q[0] * np.array(e)
        case ScrewJoint(axis=e, pitch=h):
            return turned(e, q[0]), h * q[0] * np.array(e)
        case CylindricalJoint(axis=e):
            return turned(e, q[0]), q[1] * np.array(e)
        case UniversalJoint(axes=(a, b)):
            return turned(a, q[0]) @ turned(b, q[1]), O
        case SphericalJoint():
            return from_quaternion(q), O
        case PlanarJoint():
            return turned(z, q[2]), np.array([q[0], q[1], 0.0])
        case FreeJoint():
            return from_quaternion(q[3:]), q[:3]
    return I, O


def residual(joint: PairJoint, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return how far (R, p) is from the joint's motion, one number per row of A [m, rad].

    With (R_q, p_q) the joint's motion at the coordinates that are read from (R, p): A
    [log(R R_q'); p - p_q].
    """
    if isinstance(joint, RodJoint):
        return np.array([np.linalg.norm(p) - joint.length])
    R_q, p_q = motion(joint, coordinates(joint, R, p, [0.0] * 7))
    _, A = rows(joint, R_q, p_q)
    return A @ np.concatenate([logarithm(R @ R_q.T), p - p_q])


# Rows and rotations


def stack(*parts: np.ndarray) -> np.ndarray:
    """Return rows (k, 6)."""
    return np.concatenate([np.zeros((0, 6)), *parts])


def turns(directions: ArrayLike) -> np.ndarray:
    """Return the rows that take omega's components along these directions."""
    directions = np.atleast_2d(directions)
    return np.hstack([directions, 0 * directions])


def slides(directions: ArrayLike) -> np.ndarray:
    """Return the rows that take u's components along these directions."""
    directions = np.atleast_2d(directions)
    return np.hstack([0 * directions, directions])


def across(e: ArrayLike) -> np.ndarray:
    """Return two unit vectors perpendicular to e, as rows."""
    u = cross(e, I[np.argmin(np.abs(e))])
    u /= np.linalg.norm(u)
    return np.array([u, cross(e, u)])


def cross(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Return a x b, for vectors of three."""
    return skew(np.asarray(a)) @ b


def exponential(vector: ArrayLike) -> np.ndarray:
    """Return the rotation matrix of a rotation vector."""
    return Rotation.from_rotvec(vector).as_matrix()


def logarithm(R: np.ndarray) -> np.ndarray:
    """Return the rotation vector of R, the short way."""
    return Rotation.from_matrix(R).as_rotvec()


def turned(e: ArrayLike, angle: float) -> np.ndarray:
    """Return Rot(e, angle)."""
    return exponential(angle * np.asarray(e))


def twist(R: np.ndarray, e: ArrayLike) -> float:
    """Return the angle of R's turn about e, what is left being a turn about an axis across e."""
    w, *v = quaternion(R)
    return 2 * atan2(np.dot(e, v), w)


def wrapped(angle: float, near: float) -> float:
    """Return the angle plus the whole turns that bring it nearest to `near`."""
    return angle + 2 * pi * round((near - angle) / (2 * pi))


def quaternion(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (w, x, y, z) with w >= 0."""
    return Rotation.from_matrix(R).as_quat(canonical=True)[[3, 0, 1, 2]]


def from_quaternion(q: ArrayLike) -> np.ndarray:
    """Return R of a quaternion (w, x, y, z) of any length."""
    return Rotation.from_quat(np.asarray(q)[[1, 2, 3, 0]]).as_matrix()
