"""Singular values of very many small matrices, by one-sided Jacobi rotations in compiled code.

Columns a_i, a_j of A are turned until they are perpendicular; their lengths are then the singular
values:

    tan 2t = 2 a_i.a_j / (a_i.a_i - a_j.a_j)        |a_i.a_j| <= eps |a_i| |a_j|

Small values are found to high relative accuracy, which the eigenvalues of A' A are not.
Source: Golub & Van Loan, Matrix Computations, 4th ed., sec. 8.6.3; Demmel & Veselic, SIAM J. Matrix
Anal. 13 (1992).
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from linkwork.analysis.newton import in_threads
from linkwork.simulation.compiled import compiled_once

CHUNK = 16384
SWEEPS = 30
PERPENDICULAR = 2.0**-51

_STACK = types.Array(types.float64, 3, "C")
_ROWS = types.Array(types.float64, 2, "C")


@compiled_once("singular values", types.void(_STACK, _ROWS))
def _singular_values(A, values):
    """Overwrite `values` (N, n) with the singular values of A (N, n, m) by rows, largest first; A
    is used up."""
    count, n, m = A.shape
    for s in range(count):
        # One-sided Jacobi: pairs of rows are turned in their plane until all are perpendicular to
        # each other.
        for _ in range(SWEEPS):
            turned = False
            for i in range(n - 1):
                for j in range(i + 1, n):
                    # The cosine between the two rows decides.
                    ii, jj, ij = 0.0, 0.0, 0.0
                    for k in range(m):
                        ii += A[s, i, k] * A[s, i, k]
                        jj += A[s, j, k] * A[s, j, k]
                        ij += A[s, i, k] * A[s, j, k]
                    if not abs(ij) > PERPENDICULAR * math.sqrt(ii * jj):
                        continue
                    turned = True
                    # The smaller of the two turns that make them perpendicular.
                    zeta = (jj - ii) / (2 * ij)
                    t = math.copysign(1 / (abs(zeta) + math.sqrt(1 + zeta * zeta)), zeta)
                    c = 1 / math.sqrt(1 + t * t)
                    for k in range(m):
                        a, b = A[s, i, k], A[s, j, k]
                        A[s, i, k], A[s, j, k] = c * (a - t * b), c * (b + t * a)
            if not turned:
                break
        # Their lengths are the singular values, each put in its place among those before it.
        for i in range(n):
            total = 0.0
            for k in range(m):
                total += A[s, i, k] * A[s, i, k]
            value, j = math.sqrt(total), i
            while j > 0 and values[s, j - 1] < value:
                values[s, j] = values[s, j - 1]
                j -= 1
            values[s, j] = value


def singular_values(matrices: np.ndarray) -> np.ndarray:
    """Return the singular values, largest first, of a stack of matrices.

    Args:
        matrices: A (..., m, n), m >= n, finite; entries neither near overflow nor underflow when
            squared.

    Returns:
        sigma (..., n), to a relative accuracy of a few units in the last place of the largest one
        or better.
    """
    *leading, m, n = matrices.shape
    columns = np.array(np.swapaxes(matrices, -1, -2).reshape(-1, n, m), order="C")
    values = np.empty((len(columns), n))
    parts = [slice(k, k + CHUNK) for k in range(0, len(columns), CHUNK)]
    in_threads(lambda part: _singular_values(columns[part], values[part]), parts)
    return values.reshape(*leading, n)
