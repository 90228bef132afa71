"""Frames fixed in bodies: their orientation as a constant, also where its numbers are free.

    R_BF = exp([rotation x]) exp([turn x])
    exp([r x]) = 1 + (sin a / a) [r x] + ((1 - cos a) / a^2) [r x]^2,    a = |r|

Both factors are smooth in r; near r = 0 they are their series in a^2, so that a free rotation may
be zero. Of a vector with one component the turn about that axis is formed, and adds to the angle of
an orientation that turns about it: a planar mechanism stays one.
Source: Murray, Li & Sastry 1994, ch. 2 (exponential of rotations).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Number, Vector, present, rotation_matrix
from linkwork.equations.orientation import Orientation
from linkwork.mechanism import Frame

SERIES = 8  # terms, to the last digit for squares of angles below NEAR
NEAR = 0.25  # [rad^2]


def frame_matrix(frame: Frame) -> Vector:
    """Return R_BF (3 x 3) of a frame in a body: numbers, or an expression of free ones."""
    R = exponential(frame.rotation)
    return R @ exponential(frame.turn) if any(map(present, frame.turn)) else R


def turned_by(R: Orientation, frame: Frame) -> Orientation:
    """Return R_0F = R_0B R_BF of a frame in a body with the orientation R_0B."""
    if all(isinstance(number, float) for number in (*frame.rotation, *frame.turn)):
        return R.then_constant(frame_matrix(frame))
    return turned(turned(R, frame.rotation), frame.turn)


def turned_back(R: Orientation, frame: Frame) -> Orientation:
    """Return R_0B = R_0F R_BF' of a body from that of a frame in it."""
    if all(isinstance(number, float) for number in (*frame.rotation, *frame.turn)):
        return R.then_constant(frame_matrix(frame).T)
    back = [[-number for number in vector] for vector in (frame.turn, frame.rotation)]
    return turned(turned(R, back[0]), back[1])


def turned(R: Orientation, vector: Sequence[Number]) -> Orientation:
    """Return R exp([vector x]), which turns about R's own axis where the vector is along it."""
    along = [k for k, number in enumerate(vector) if present(number)]
    if len(along) == 1 and R.keeps(np.eye(3)[along[0]]):
        return R.then_turn(np.eye(3)[along[0]], SX(vector[along[0]]))
    return R.then_constant(exponential(vector))


def exponential(vector: Sequence[Number]) -> Vector:
    """Return exp([vector x]) of a rotation vector [rad] (Rodrigues)."""
    if not any(isinstance(number, SX) for number in vector):
        return rotation_matrix([float(number) for number in vector])
    r, along = ca.vertcat(*vector), [k for k, number in enumerate(vector) if present(number)]
    if len(along) == 1:
        axis = np.eye(3)[along[0]]
        K, angle = SX(ca.skew(axis)), r[along[0]]
        return SX.eye(3) + ca.sin(angle) * K + (1 - ca.cos(angle)) * ca.mtimes(K, K)
    square = ca.sumsqr(r)
    near = square < NEAR
    angle = ca.sqrt(ca.if_else(near, 1, square))
    first = ca.if_else(near, series(square, 1), ca.sin(angle) / angle)
    half = ca.sin(angle / 2) / angle
    second = ca.if_else(near, series(square, 2), 2 * half * half)
    K = ca.skew(r)
    return SX.eye(3) + first * K + second * ca.mtimes(K, K)


def series(square: ca.SX, order: int) -> ca.SX:
    """Return the sum of (-a^2)^k / (2 k + order)!: sin a / a for 1, (1 - cos a) / a^2 for 2."""
    result = SX(0)
    for k in reversed(range(SERIES)):
        result = 1 / factorial(2 * k + order) - square * result
    return result
