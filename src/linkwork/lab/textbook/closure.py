"""The loop equations phi(q) = 0 of the paper's Eq. (1) and their Jacobian Phi of Eq. (2).

A joint that is not in the spanning tree closes one loop. Its second frame has one pose by the tree,
through its second body, (R, o), and one by its first body and its own coordinate, (R*, o*). The
loop is closed when both are the same:

    phi_loop = [o* - o; e],     exp([e x]) = E = R* R'
    Phi_loop q' = [v* - v; J(e)^-1 (omega* - E omega)]

For a planar mechanism this leaves x, y and the angle; in general dependent rows are found by a QR
factorisation with pivoting and dropped.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy.linalg import qr

from linkwork.lab.textbook.geometry import rotation_vector, rotation_vector_rate
from linkwork.lab.textbook.kinematics import (
    Configuration,
    MovingConfiguration,
    crossing,
    joint_motion,
)


def loop_poses(at: Configuration, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return both poses of a closing joint's second frame: by its first body (X*) and by the tree
    (X)."""
    joint = at.tree.mechanism.pairs[name]
    first, second = joint.connects
    X_1F, X_2F = at.tree.frames[name]
    return at.X[first] @ X_1F @ joint_motion(joint, at.coordinates[name]), at.X[second] @ X_2F


def loop_paths(at: Configuration, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the signs of the two paths to a closing joint's second frame, each (m,)."""
    first, second = at.tree.mechanism.pairs[name].connects
    return at.tree.path[first] + crossing(at.tree.moving, name), at.tree.path[second]


def loop_errors(at: Configuration) -> np.ndarray:
    """Return phi of all loops, six numbers each: position [m] and rotation vector [rad] in base
    axes."""
    errors = []
    for name in at.tree.closing:
        X_star, X = loop_poses(at, name)
        errors += [X_star[:3, 3] - X[:3, 3], rotation_vector(X_star[:3, :3] @ X[:3, :3].T)]
    return np.concatenate(errors) if errors else np.zeros(0)


def loop_jacobian(at: Configuration) -> np.ndarray:
    """Return Phi of all loops, six rows each, by m columns; exact for open loops too."""
    rows = [np.zeros((0, len(at.tree.moving)))]
    for name in at.tree.closing:
        X_star, X = loop_poses(at, name)
        s_star, s = loop_paths(at, name)
        twist_star, twist = at.unit_twists(X_star[:3, 3]) * s_star, at.unit_twists(X[:3, 3]) * s
        E = X_star[:3, :3] @ X[:3, :3].T
        rows += [
            twist_star[3:] - twist[3:],
            rotation_vector_rate(rotation_vector(E)) @ (twist_star[:3] - E @ twist[:3]),
        ]
    return np.vstack(rows)


def loop_jacobian_rate(during: MovingConfiguration) -> np.ndarray:
    """Return d/dt Phi of all loops along a motion in which the loops are closed (E = 1)."""
    at = during.at
    rows = [np.zeros((0, len(at.tree.moving)))]
    for name in at.tree.closing:
        o = loop_poses(at, name)[1][:3, 3]
        o_rate = during.twist(at.tree.mechanism.pairs[name].connects[1], o)[3:]
        s_star, s = loop_paths(at, name)
        twists_rate = during.unit_twists_rate(o, o_rate) * (s_star - s)
        rows += [twists_rate[3:], twists_rate[:3]]
    return np.vstack(rows)


def independent_rows(A: np.ndarray, count: int) -> np.ndarray | None:
    """Return `count` independent rows of A, in order; None where there are fewer (pivots below 1e-9
    of the first)."""
    if count == 0:
        return np.zeros(0, dtype=int)
    if count > min(A.shape):
        return None
    R, pivots = cast(tuple[np.ndarray, np.ndarray], qr(A.T, mode="r", pivoting=True))
    diagonal = abs(np.diag(R))
    return np.sort(pivots[:count]) if diagonal[count - 1] > 1e-9 * diagonal[0] else None
