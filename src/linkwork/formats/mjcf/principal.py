"""The principal axes of an inertia as MuJoCo has them: by falling moments, with the signs that its
Jacobi rotations leave."""

from __future__ import annotations

from math import pi

import numpy as np

from linkwork.formats import poses

ROUNDED = 1e-12  # what MuJoCo takes for none, relative to the greatest
TURNS = 500
PAIRS = ((1, 2), (0, 2), (0, 1))
"""Rows and columns beside the diagonal; the first of the greatest is turned away."""


def principal_axes(tensor: np.ndarray) -> np.ndarray:
    """Return R (3, 3) whose columns are principal axes of a tensor (3, 3), the greatest moment
    first."""
    scaled, R = tensor / (np.abs(tensor).max() or 1.0), np.eye(3)
    # Jacobi's rotations: the greatest element beside the diagonal is turned away.
    for _ in range(TURNS):
        D = R.T @ scaled @ R
        row, column = max(PAIRS, key=lambda pair: abs(D[pair]))
        if abs(D[row, column]) < ROUNDED:
            break
        tau = (D[column, column] - D[row, row]) / (2 * D[row, column])
        tangent = (1.0 if tau >= 0 else -1.0) / (abs(tau) + np.sqrt(1 + tau * tau))
        R = R @ _turned(3 - row - column, np.arctan(tangent) * (2 * (column - row) - 3))
    # Quarter turns put the moments in order.
    moments = np.diag(R.T @ scaled @ R).copy()
    for k in (0, 1, 0):
        if moments[k] + ROUNDED < moments[k + 1]:
            moments[[k, k + 1]] = moments[[k + 1, k]]
            R = R @ _turned((k + 2) % 3, pi / 2)
    return R


def _turned(axis: int, angle: float) -> np.ndarray:
    return poses.turn(np.eye(3)[axis], angle)[:3, :3]
