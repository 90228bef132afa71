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

import numpy as np

DEPENDENT_ROW = 1e-6  # what is left of a dependent row, over the longest row


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
        return self._reflected(np.delete(np.eye(self.width), self.pivots, axis=1))

    @property
    def row_space(self) -> np.ndarray:
        """Return an orthonormal basis (columns x rank) of what the rows hold."""
        return self._reflected(np.eye(self.width)[:, list(self.pivots)])

    def _reflected(self, basis: np.ndarray) -> np.ndarray:
        for columns, v in reversed(self.reflections):
            basis[columns] -= np.outer(2 * v, v @ basis[columns])
        return basis


def reflect(A: np.ndarray, dependent: float = DEPENDENT_ROW) -> Reflections:
    """Return the reflections that make the rows of A (rows x columns) orthogonal, one after the
    other.

    dependent: what is left of a dependent row, over the longest row
    """
    rest, free = np.array(A, float), np.ones(A.shape[1], bool)
    least = dependent * np.linalg.norm(rest, axis=1).max(initial=0.0)
    rows, pivots, reflections = [], [], []
    for row in range(len(rest)):
        columns = np.flatnonzero(free & (rest[row] != 0))
        x, later = rest[row, columns], rest[row + 1 :, columns]
        length = float(np.linalg.norm(x))
        if not length > least:
            continue
        touching = later != 0
        place = int(np.argmin(touching.sum(axis=0)))
        x[place] += np.copysign(length, x[place])
        v = x / np.linalg.norm(x)
        touched = np.flatnonzero(touching.any(axis=1))
        rest[np.ix_(row + 1 + touched, columns)] -= np.outer(later[touched] @ v, 2 * v)
        free[columns[place]] = False
        rows.append(row)
        pivots.append(int(columns[place]))
        reflections.append((columns, v))
    return Reflections(A.shape[1], tuple(rows), tuple(pivots), tuple(reflections))
