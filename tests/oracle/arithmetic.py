"""The little algebra the oracle needs, for two kinds of numbers: doubles, and mpmath's with any
number of digits.

Matrices are NumPy arrays of doubles or of objects; all but the solution of linear equations is the
same source for both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np


@dataclass(frozen=True)
class Arithmetic:
    """Name the numbers and the functions of them; `settled` is the Newton step after which another
    changes nothing."""

    number: Callable[[float], Any]
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    atan2: Callable[[Any, Any], Any]
    sqrt: Callable[[Any], Any]
    dtype: type
    settled: float

    def array(self, values: Any) -> np.ndarray:
        """Convert doubles, exactly."""
        converted = [self.number(x) for x in np.ravel(values)]
        return np.array(converted, dtype=self.dtype).reshape(np.shape(values))

    def zeros(self, *shape: int) -> np.ndarray:
        """Return zeros of this kind."""
        return self.array(np.zeros(shape))

    def eye(self, size: int) -> np.ndarray:
        """Return the identity matrix of this kind."""
        return self.array(np.eye(size))

    def unit(self, vector: np.ndarray) -> np.ndarray:
        """Normalise a vector."""
        return vector / self.sqrt(vector @ vector)

    def rotation(self, vector: np.ndarray) -> np.ndarray:
        """Return exp([vector x])."""
        square = vector @ vector
        if square == 0:
            return self.eye(3)
        angle, W = self.sqrt(square), skew(vector)
        return self.eye(3) + self.sin(angle) / angle * W + (1 - self.cos(angle)) / square * (W @ W)


def arithmetic(digits: int | None) -> Arithmetic:
    """Return doubles (None) or mpmath's numbers with so many decimal digits."""
    if digits is None:
        return Arithmetic(float, math.sin, math.cos, math.atan2, math.sqrt, float, 1e-9)
    context = mpmath.mp.clone()
    context.dps = digits
    names = (context.mpf, context.sin, context.cos, context.atan2, context.sqrt)
    return Arithmetic(*names, object, 10.0 ** (-digits / 2 - 1))


def skew(w: np.ndarray) -> np.ndarray:
    """Return [w x]."""
    x, y, z = w
    o = 0 * x
    return np.array([[o, -z, y], [z, o, -x], [-y, x, o]], dtype=w.dtype)


def axial(D: np.ndarray) -> np.ndarray:
    """Return the vector of the skew part of D: sin(angle) times the axis, for a rotation."""
    return np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]], dtype=D.dtype) / 2


def solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return A^-1 b: doubles by LAPACK, others by Gaussian elimination with scaled partial pivoting
    that skips zeros."""
    if A.dtype != object:
        return np.linalg.solve(A, b)
    scale = abs(A).max(axis=1)
    A, b = A / scale[:, None], (b.T / scale).T
    for k in range(len(A)):
        pivot = k + int(np.argmax(abs(A[k:, k])))
        A[[k, pivot]], b[[k, pivot]] = A[[pivot, k]], b[[pivot, k]]
        below = k + 1 + np.flatnonzero(A[k + 1 :, k])
        right = k + np.flatnonzero(A[k, k:])
        factor = A[below, k] / A[k, k]
        A[np.ix_(below, right)] -= np.multiply.outer(factor, A[k, right])
        b[below] -= np.multiply.outer(factor, b[k])
    for k in reversed(range(len(A))):
        right = k + 1 + np.flatnonzero(A[k, k + 1 :])
        b[k] = (b[k] - A[k, right] @ b[right]) / A[k, k]
    return b
