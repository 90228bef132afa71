"""Small vector algebra on CasADi expressions.

Constants are kept exact: numbers that differ from 0, 1/2 or 1 by rounding only are snapped, so that
what is zero by geometry is zero in the graph and everything built on it vanishes symbolically.

A free number of the description is a symbol p_i in its place. A constant vector (`Vector`) is an
array of numbers, or an expression where any of its numbers is free; a free number never counts as
zero.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import cache, lru_cache, reduce, wraps
from typing import overload

import casadi as ca
import numpy as np

from linkwork.equations.operators import SX

Number = float | ca.SX
Vector = np.ndarray | ca.SX
Drawn = Callable[..., ca.SX]
ROUNDING = 1e-14  # that files of CAD and products of some ten rotations have: up to 7e-15


@cache
def symbol(path: str) -> ca.SX:
    """Return the symbol of a free number of the description."""
    return SX.sym(path)


def at_once(*shapes: tuple[int, int]) -> Callable[[Drawn], Drawn]:
    """Let CasADi evaluate a function of expressions of these shapes in one call: from Python, each
    of its operators takes some 5 us, and each of its functions some 20."""

    def wrapper(f: Drawn) -> Drawn:
        @cache
        def graph() -> ca.Function:
            symbols = [SX.sym(f"x{k}", *shape) for k, shape in enumerate(shapes)]
            return ca.Function(f.__name__, symbols, [f(*symbols)])

        @wraps(f)
        def evaluated(*given: ca.SX) -> ca.SX:
            return graph().call(given)[0]

        return evaluated

    return wrapper


def constant(values: Vector) -> ca.SX:
    """Return constant numbers as an expression, not to be changed in place; the same ones are made
    once, for CasADi takes its time over that."""
    if isinstance(values, SX):
        return values
    return _constant(values.shape, np.ascontiguousarray(values, float).tobytes())


@lru_cache(maxsize=4096)
def _constant(shape: tuple[int, ...], values: bytes) -> ca.SX:
    return SX(np.frombuffer(values).reshape(shape))


def vector(numbers: Sequence[Number]) -> Vector:
    """Return numbers of the description as a vector."""
    free = any(isinstance(number, SX) for number in numbers)
    return ca.vertcat(*numbers) if free else np.array(numbers, float)


def present(value: Number | Vector) -> bool:
    """Tell whether a constant is anything but zero."""
    if isinstance(value, SX):
        return not value.is_zero()
    return bool(value.any() if isinstance(value, np.ndarray) else value)


@overload
def snap(values: np.ndarray, size: float | None = None) -> np.ndarray: ...
@overload
def snap(values: Vector, size: float | None = None) -> Vector: ...
def snap(values: Vector, size: float | None = None) -> Vector:
    """Replace numbers within rounding of a multiple of 1/2 by that multiple.

    size: of numbers that a zero may have come of; that of the largest one here, 1 at most, if left
    out
    """
    if isinstance(values, SX):
        entries = ca.vertsplit(ca.vec(values))
        constants = [abs(float(e)) for e in entries if e.is_constant()]
        size = min(1.0, max(constants, default=1.0)) if size is None else size
        snapped = [SX(snap(np.array(float(e)), size)) if e.is_constant() else e for e in entries]
        return ca.reshape(ca.vertcat(*snapped), *values.shape)
    return _snapped(values.shape, np.ascontiguousarray(values, float).tobytes(), size)


@lru_cache(maxsize=4096)
def _snapped(shape: tuple[int, ...], given: bytes, size: float | None) -> np.ndarray:
    """Return what `snap` makes of numbers, once for the same ones."""
    values = np.frombuffer(given).reshape(shape)
    size = min(1.0, np.abs(values).max(initial=0.0)) if size is None else size
    halves = np.round(2 * values) / 2
    near = np.abs(values - halves) < ROUNDING * np.maximum(size, np.abs(halves))
    snapped = np.where(near, halves, values)
    snapped.setflags(write=False)
    return snapped


def dense(matrix: ca.DM) -> np.ndarray:
    """Return a sparse matrix of numbers as an array."""
    values = np.zeros(matrix.shape)
    values[matrix.sparsity().get_triplet()] = matrix.nonzeros()
    return values


def rotation_matrix(vector: Sequence[float]) -> np.ndarray:
    """Return R = exp([vector x]) for a rotation vector [rad] (Rodrigues)."""
    v = np.asarray(vector, float)
    angle = float(np.linalg.norm(v))
    return turn_matrix(v / angle, angle) if angle > 0 else np.eye(3)


def turn_matrix(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return R = Rot(axis, angle) for a unit axis."""
    K = skew(axis)
    R: np.ndarray = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return snap(R)


def skew(v: np.ndarray) -> np.ndarray:
    """Return the matrix [v x] of the cross product."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])


def cross_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b; NumPy's own takes ten times as long for single vectors."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def zero() -> ca.SX:
    return SX.zeros(3)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Return an angle [rad] between -pi and pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def inner(a: Vector, b: Vector) -> Number:
    """Return a . b of constant vectors."""
    return ca.dot(SX(a), SX(b)) if isinstance(a, SX) or isinstance(b, SX) else float(a @ b)


def outer(a: Vector, b: Vector) -> Vector:
    """Return a b' of constant vectors."""
    return ca.mtimes(SX(a), SX(b).T) if isinstance(a, SX) or isinstance(b, SX) else np.outer(a, b)


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return zero() if a.is_zero() or b.is_zero() else ca.cross(a, b)


def dot(a: ca.SX, b: ca.SX) -> ca.SX:
    return ca.dot(a, b)


def spin(omega: ca.SX, r: ca.SX) -> ca.SX:
    """Return omega x (omega x r) = omega (omega . r) - (omega . omega) r."""
    if omega.is_zero() or r.is_zero():
        return zero()
    return omega * dot(omega, r) - dot(omega, omega) * r


@at_once((3, 1), (3, 1))
def turning_matrix(omega: ca.SX, alpha: ca.SX) -> ca.SX:
    """Return A (3 x 3) with  A r = alpha x r + omega x (omega x r)."""
    (x, y, z), (u, v, w) = ca.vertsplit(omega), ca.vertsplit(alpha)
    yz, zx, xy, xx, yy, zz = y * z, z * x, x * y, x * x, y * y, z * z
    rows = (-(yy + zz), xy - w, zx + v), (xy + w, -(xx + zz), yz - u), (zx - v, yz + u, -(xx + yy))
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


@at_once((3, 1), (3, 1), (3, 1), (3, 1))
def point_acceleration(a: ca.SX, omega: ca.SX, alpha: ca.SX, r: ca.SX) -> ca.SX:
    """Return a + alpha x r + omega x (omega x r), the acceleration of a point at r of a body."""
    return ca.mac(turning_matrix(omega, alpha), r, ca.densify(a))


def total(parts: Sequence[ca.SX]) -> ca.SX:
    """Return the sum of vectors (3), zero where there are none."""
    return reduce(operator.add, parts) if parts else zero()


def quaternion_matrix(p: ca.SX) -> ca.SX:
    """Return R of a unit quaternion p = (w, x, y, z): R = 1 + 2 w [u x] + 2 [u x]^2, u =
    (x, y, z)."""
    w, x, y, z = (p[i] for i in range(4))
    X, Y, Z = 2 * x, 2 * y, 2 * z
    xX, xY, xZ, yY, yZ, zZ = x * X, x * Y, x * Z, y * Y, y * Z, z * Z
    wX, wY, wZ = w * X, w * Y, w * Z
    rows = (
        (1 - (yY + zZ), xY - wZ, xZ + wY),
        (xY + wZ, 1 - (xX + zZ), yZ - wX),
        (xZ - wY, yZ + wX, 1 - (xX + yY)),
    )
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def quaternion_map(p: ca.SX) -> ca.SX:
    """Return the map (4 x 3) with p' = (0, omega) p / 2 from omega, in the axes of the first frame,
    for p of R_12."""
    w, x, y, z = (p[i] / 2 for i in range(4))
    rows = (-x, -y, -z), (w, z, -y), (-z, w, x), (y, -x, w)
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def matrix_quaternion(R: ca.SX) -> ca.SX:
    """Return the unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.

    Every column of the symmetric matrix 4 p p', whose elements are linear in R, is along p; the
    longest is taken.
    """
    d = [
        1 + R[0, 0] + R[1, 1] + R[2, 2],
        1 + R[0, 0] - R[1, 1] - R[2, 2],
        1 - R[0, 0] + R[1, 1] - R[2, 2],
        1 - R[0, 0] - R[1, 1] + R[2, 2],
    ]
    wx, wy, wz = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, xz, yz = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    columns = [(d[0], wx, wy, wz), (wx, d[1], xy, xz), (wy, xy, d[2], yz), (wz, xz, yz, d[3])]
    longest = ca.fmax(ca.fmax(d[0], d[1]), ca.fmax(d[2], d[3]))
    p = ca.vertcat(*columns[3])
    for column, diagonal in zip(columns[:3], d[:3], strict=True):
        p = ca.if_else(diagonal >= longest, ca.vertcat(*column), p)
    p = p / ca.sqrt(ca.sumsqr(p))
    return ca.if_else(p[0] < 0, -p, p)
