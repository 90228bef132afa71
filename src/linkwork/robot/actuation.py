"""Actuation: from forces on the independent rates to forces of the actuators.

    S' u = f,    S v the actuated rates                                 S: actuators x n

As many actuators as freedoms: one solution. More: those of least  sum weight_i u_i^2,

    u = W^-1 S (S' W^-1 S)^-1 f,

and internal forces, S' u_0 = 0, may be added at will. Fewer: some directions of v are driven by nothing, and no u exists
but for special motions; only idle freedoms are left to themselves, and accelerate as the others make them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkwork.errors import LinkworkError

DRIVEN = 1e-6
MISSED = 1e-9


def least_forces(S: np.ndarray, f: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
    """Return the forces u (..., actuators) of least weighted norm with S' u = f (..., n), or nearest to it."""
    scale = np.ones(S.shape[-2]) if weights is None else 1 / np.sqrt(weights)
    transposed = np.swapaxes(S * scale[:, None], -1, -2)
    return scale * (np.linalg.pinv(transposed, rcond=DRIVEN) @ f[..., None])[..., 0]


def idle_left(S: np.ndarray, M: np.ndarray, f: np.ndarray, idle: int) -> np.ndarray:
    """Return f + M D y with D' (f + M D y) = 0: the forces on v when idle freedoms D, S D = 0, accelerate as they will.

    Args:
        S: (..., actuators, n); M: (..., n, n); f: (..., n), for accelerations whose idle part is not meant.
        idle: number of idle freedoms; where S leaves another number of directions undriven, f is returned.
    """
    rows = np.linalg.svd(np.concatenate([S, np.zeros_like(S[..., :1, :])], axis=-2))[2]
    D = np.swapaxes(rows[..., S.shape[-1] - idle :, :], -1, -2)
    if np.abs(S @ D).max(initial=0.0) > DRIVEN * np.abs(S).max(initial=0.0):
        return f
    push = np.swapaxes(D, -1, -2) @ f[..., None]
    y = np.linalg.solve(np.swapaxes(D, -1, -2) @ M @ D, -push)
    return f + (M @ D @ y)[..., 0]


def internal_forces(S: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (actuators x k) of the forces with S' u = 0 at one configuration."""
    if not len(S):
        return np.zeros((0, 0))
    left, values, _ = np.linalg.svd(S)
    rank = int((values > DRIVEN * values.max(initial=0.0)).sum())
    return left[:, rank:]


def undriven(S: np.ndarray, independent: Sequence[str]) -> list[str]:
    """Name the directions of v that no actuator drives at one configuration: those with S d = 0, by their largest rates."""
    _, values, rows = np.linalg.svd(np.vstack([S, np.zeros((1, S.shape[1]))]))
    rank = int((values > DRIVEN * values.max(initial=0.0)).sum())
    names = []
    for direction in rows[rank:]:
        parts = [
            name for name, part in zip(independent, direction, strict=True) if abs(part) > 0.5 * abs(direction).max()
        ]
        names.append(" with ".join(parts))
    return names


def require_driven(S: np.ndarray, f: np.ndarray, u: np.ndarray, independent: Sequence[str], idle: int) -> None:
    """Refuse forces f on the rates that the actuators cannot give; idle freedoms may be left to themselves.

    Args:
        S: (..., actuators, n); f: (..., n); u: (..., actuators), nearest to S' u = f.
        independent: names of the rates.
        idle: number of idle freedoms.
    """
    rows = np.concatenate([S, np.zeros((*f.shape[:-1], 1, f.shape[-1]))], axis=-2)
    flat = rows.reshape(-1, *rows.shape[-2:])
    lacking = np.linalg.matrix_rank(flat, rtol=DRIVEN) < S.shape[-1] - idle
    missed = np.abs(np.einsum("...an,...a->...n", S, u) - f).max(axis=-1).reshape(-1)
    lacking |= missed > MISSED * np.maximum(1, np.abs(f).max(axis=-1).reshape(-1))
    if not lacking.any():
        return
    first = int(np.argmax(lacking))
    which = f" of state {first}" if len(flat) > 1 else ""
    raise LinkworkError(
        f"inverse dynamics{which} is not defined: the actuators do not drive {', '.join(undriven(flat[first], independent))}; "
        "add actuators, or simulate the motion under given forces (forward dynamics)"
    )
