"""ClosureRows made orthogonal by reflections: which of them are independent, and the motions that
they leave free.

    x' H = (0 .. +-|x| .. 0),    H = 1 - 2 v v',   |v| = 1

takes what the rows before leave of a row to a single column, its pivot; a row of which nothing is
left depends on them. The columns that are no pivots span, reflected back, the null space: N = H_1
H_2 ... E, with orthonormal columns. The rows of a constraint Jacobian touch few columns each;
pivots that few later rows touch keep the reflections as small.
Source: Golub & Van Loan 2013, sec. 5.1, 5.2 (Householder reflections); George & Heath 1980 (sparse
rows).
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from math import sqrt

import numpy as np

DEPENDENT_ROW = 1e-6  # what is left of a dependent row, over the longest row
LAST: dict[tuple[bytes, tuple[int, ...], float], Reflections] = {}
"""Those of the last matrix, by a digest of it, for matrices are large: its rows, what they hold and
what they leave free are asked for one after the other."""


@dataclass(frozen=True, eq=False)
class Reflections:
    """Hold the independent rows of a matrix, the pivots (columns) and the reflections.

    width: number of columns; reflections: columns that each touches, and v there
    """

    width: int
    rows: tuple[int, ...]
    pivots: tuple[int, ...]
    reflections: tuple[tuple[np.ndarray, np.ndarray], ...]

    @property
    def null_space(self) -> np.ndarray:
        """Return an orthonormal basis (columns x n) of what the rows leave free."""
        return self.mirrored(np.delete(np.eye(self.width), self.pivots, axis=1))

    @property
    def row_space(self) -> np.ndarray:
        """Return an orthonormal basis (columns x rank) of what the rows hold."""
        return self.mirrored(np.eye(self.width)[:, list(self.pivots)])

    def mirrored(self, basis: np.ndarray) -> np.ndarray:
        """Return columns (columns x n) that are reflected back, last reflection first, in place."""
        for columns, v in reversed(self.reflections):
            basis[columns] -= np.outer(2 * v, v @ basis[columns])
        return basis


def reflect(A: np.ndarray, dependent: float = DEPENDENT_ROW) -> Reflections:
    """Return the reflections that make the rows of A (rows x columns) orthogonal, one after the
    other.

    dependent: what is left of a dependent row, over the longest row
    """
    A = np.ascontiguousarray(A, float)
    key = sha256(A.data).digest(), A.shape, dependent
    if (found := LAST.get(key)) is None:
        found = reflected(A, dependent)[0]
        LAST.clear()
        LAST[key] = found
    return found


def reflected(A: np.ndarray, dependent: float = DEPENDENT_ROW) -> tuple[Reflections, np.ndarray]:
    """Return the reflections of `reflect`, and L (rows x rank) of  A = L Q',  but for what is left
    of dependent rows; Q: the columns of `row_space`."""
    rest, free = np.array(A, float), np.ones(A.shape[1], bool)
    least = dependent * np.linalg.norm(rest, axis=1).max(initial=0.0)
    rows, pivots, reflections = [], [], []
    ends = len(rest) - np.argmax(rest[::-1] != 0, axis=0) if len(rest) else free
    for row in range(len(rest)):
        columns = np.flatnonzero(free & (rest[row] != 0))
        x = rest[row, columns]
        length = sqrt(x @ x)
        if not length > least:
            continue
        # No row from `end` on has anything in these columns.
        ends[columns] = end = int(ends[columns].max())
        later = rest[row + 1 : end, columns]
        touching = later != 0
        place = int(np.argmin(touching.sum(axis=0)))
        rest[row, columns] = 0.0
        rest[row, columns[place]] = -np.copysign(length, x[place])
        x[place] += np.copysign(length, x[place])
        v = x / sqrt(x @ x)
        touched = np.flatnonzero(touching.any(axis=1))
        at = (row + 1 + touched)[:, None], columns
        rest[at] -= (later[touched] @ v)[:, None] * (2 * v)
        free[columns[place]] = False
        rows.append(row)
        pivots.append(int(columns[place]))
        reflections.append((columns, v))
    found = Reflections(A.shape[1], tuple(rows), tuple(pivots), tuple(reflections))
    return found, rest[:, pivots]


def least_singular(A: np.ndarray, rank: int) -> float | None:
    """Return the singular value number `rank` of a matrix whose rows have few elements; None where
    not as many of its rows are independent, or none is found.

    With  A = L Q'  and  L' = T P'  by reflections, T (rank x rank) is triangular and has A's
    singular values but for those of dependent rows. The least is found by Lanczos's method on
    (T T')^-1.
    Source: Golub & Van Loan 2013, sec. 10.1.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh, splu

    first, L = reflected(A)
    if len(first.rows) != rank:
        return None
    T = L[list(first.rows)]
    if len(A) > rank:
        second, T = reflected(L.T)
        if len(second.rows) != rank:
            return None
    solver = splu(csc_array(T), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    inverse = LinearOperator((rank, rank), lambda x: solver.solve(solver.solve(x), "T"))
    try:
        found = eigsh(inverse, 1, v0=np.ones(rank), return_eigenvectors=False)
    except ArpackNoConvergence:
        return None
    return float(1 / np.sqrt(found[0]))
