"""Inertia of a body in axes that it turns against, and the moment that it takes to turn, by few
operations.

With principal moments I_a, I_b, I_c along principal axes a, b, c,

    R I R' = I_b 1 + (I_a - I_b) a a' + (I_c - I_b) c c'

and for a turn by an angle about k, one of the axes, with i and j the other two: what I_ii and I_jj
have in common stays, half their difference and I_ij turn by twice the angle, I_ik and I_jk by the
angle.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Vector, at_once, constant, present, snap, zero
from linkwork.equations.orientation import Orientation

OFF_DIAGONAL = (0, 1), (0, 2), (1, 2)
ALIKE = 1e-15  # difference of principal moments, over the largest, that is rounding


def turned_inertia(inertia: Vector, R: Orientation) -> ca.SX:
    """Return R I R' from the principal moments: I_b 1 + (I_a - I_b) a a' + (I_c - I_b) c c'.

    a, c are two principal axes in R's axes; where two moments are equal one of them is not needed.
    Of three moments about one of R's axes it is formed by twice the angle (`turned_about`). Where a
    number of I is free the product is formed as it stands.
    """
    if not present(inertia):
        return SX(3, 3)
    if isinstance(inertia, SX):
        return ca.densify(ca.mtimes([R.near, inertia, R.near.T]))
    if np.count_nonzero(inertia - np.diag(np.diagonal(inertia))) == 0:
        values, axes = np.diagonal(inertia), np.eye(3)
    else:
        values, axes = np.linalg.eigh(inertia)
    if all_differ(values) and np.count_nonzero(R.axis) == 1 and isinstance(R.right, np.ndarray):
        return turned_about(snap(R.right @ inertia @ R.right.T, np.abs(inertia).max()), R)
    middle = int(np.argsort(values)[1])
    result = constant(values[middle] * np.eye(3))
    for value, axis in zip(values, axes.T, strict=True):
        if abs(value - values[middle]) > ALIKE * np.max(np.abs(values)):
            a = R.turned(axis)
            result = result + float(value - values[middle]) * ca.mtimes(a, a.T)
    return ca.densify(result)


def all_differ(moments: np.ndarray) -> bool:
    """Tell whether no two of three principal moments are alike."""
    return bool(np.diff(np.sort(moments)).min() > ALIKE * np.abs(moments).max())


def turned_about(inertia: np.ndarray, R: Orientation) -> ca.SX:
    """Return Rot I Rot' for R's turn about one of its axes."""
    k = int(np.flatnonzero(R.axis)[0])
    order = [(k + 1) % 3, (k + 2) % 3, k]
    sine = ca.sin(R.angle) * float(R.axis[k])
    turned = turned_about_last(constant(inertia[np.ix_(order, order)]), ca.cos(R.angle), sine)
    back = np.argsort(order).tolist()
    return turned[back, back]


@at_once((3, 3), (1, 1), (1, 1))
def turned_about_last(inertia: ca.SX, c: ca.SX, s: ca.SX) -> ca.SX:
    """Return `turned_about` the last axis by an angle of this cosine and sine."""
    xx, yy, zz, xy, xz, yz = (inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), *OFF_DIAGONAL))
    double = 1 - 2 * s * s, 2 * s * c
    common = (xx + yy) / 2
    d, o = turned_pair((xx - yy) / 2, xy, *double)
    e, f = turned_pair(xz, yz, c, s)
    rows = (common + d, o, e), (o, common - d, f), (e, f, zz)
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def turned_pair(x: ca.SX, y: ca.SX, c: ca.SX, s: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return (x, y) turned by an angle of this cosine and sine."""
    return x * c - y * s, x * s + y * c


@at_once((3, 3), (3, 1), (3, 1), (3, 3))
def turning_moment(inertia: ca.SX, omega: ca.SX, alpha: ca.SX, A: ca.SX) -> ca.SX:
    """Return I alpha + omega x (I omega); A: their `turning_matrix`, off whose diagonal is what
    the products of inertia are multiplied by."""
    found = zero()
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[i] = inertia[i, i] * alpha[i]
        found[i] += (inertia[k, k] - inertia[j, j]) * (omega[j] * omega[k])
        found[i] += inertia[i, k] * A[j, i] - inertia[i, j] * A[k, i]
        found[i] += inertia[j, k] * (omega[j] * omega[j] - omega[k] * omega[k])
    return found
