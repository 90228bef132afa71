"""Actuation: from forces on the independent rates to forces of the actuators.

    S' u = f,    S v the actuated rates                                 S: actuators x n

As many actuators as freedoms: one solution. More: those of least  sum weight_i u_i^2,

    u = W^-1 S (S' W^-1 S)^-1 f,

and internal forces, S' u_0 = 0, may be added at will. Fewer: some directions of v are driven by
nothing, and no u exists but for special motions; only idle freedoms are left to themselves, and
accelerate as the others make them.

All numbers here are in the mechanism's own units (`Units`): lengths over its own length, forces
times it, so that both u and f are energies [J], and a rank does not depend on the units of the
description.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.errors import LinkworkError

DRIVEN = 1e-6
MISSED = 1e-9


@dataclass(frozen=True, eq=False)
class Units:
    """Hold the own units, length [m] or 1 rad, of the actuated rates (actuators) and of the
    independent ones (n)."""

    actuators: np.ndarray
    rates: np.ndarray

    def map(self, S: np.ndarray) -> np.ndarray:
        """Return S (..., actuators, n) in own units."""
        return S * self.rates / self.actuators[:, None]

    def inertia(self, M: np.ndarray) -> np.ndarray:
        """Return M (..., n, n) in own units."""
        return M * self.rates * self.rates[:, None]


def least_forces(S: np.ndarray, f: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the forces u (..., actuators) of least  sum weight_i u_i^2  with S' u = f (..., n), or
    nearest to it."""
    left, values, right = np.linalg.svd(S)
    kept = np.zeros(S.shape[:-1], bool)  # directions of u that move the robot
    kept[..., : values.shape[-1]] = values > DRIVEN * values.max(
        axis=-1, initial=0.0, keepdims=True
    )
    parts = np.zeros(S.shape[:-1])
    r = values.shape[-1]
    np.divide((right @ f[..., None])[..., :r, 0], values, out=parts[..., :r], where=kept[..., :r])
    u = left @ parts[..., None]
    if not kept.all():
        internal = np.where(kept[..., None, :], 0.0, left)
        root = np.sqrt(weights)[:, None]
        u = u - internal @ (np.linalg.pinv(root * internal) @ (root * u))
    return u[..., 0]


def idle_left(S: np.ndarray, M: np.ndarray, f: np.ndarray, idle: int) -> np.ndarray:
    """Return f + M D y with D' (f + M D y) = 0: the forces on v when idle freedoms D, S D = 0,
    accelerate as they will.

    Args:
        S: (..., actuators, n); M: (..., n, n); f: (..., n), for accelerations whose idle part is
            not meant.
        idle: number of idle freedoms; where S leaves another number of directions undriven, f is
            returned.
    """
    rows = np.linalg.svd(np.concatenate([S, np.zeros_like(S[..., :1, :])], axis=-2))[2]
    D = np.swapaxes(rows[..., S.shape[-1] - idle :, :], -1, -2)
    if np.abs(S @ D).max(initial=0.0) > DRIVEN * np.abs(S).max(initial=0.0):
        return f
    push = np.swapaxes(D, -1, -2) @ f[..., None]
    y = np.linalg.solve(np.swapaxes(D, -1, -2) @ M @ D, -push)
    return f + (M @ D @ y)[..., 0]


def internal_forces(S: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return a basis (actuators x k) of the forces with S' u = 0 at one configuration, B' W B =
    1."""
    if not len(S):
        return np.zeros((0, 0))
    left, values, _ = np.linalg.svd(S)
    rank = int((values > DRIVEN * values.max(initial=0.0)).sum())
    if rank == len(S):
        return np.zeros((rank, 0))
    root = np.sqrt(weights)[:, None]
    Q, R = np.linalg.qr(root * left[:, rank:])
    return Q * np.sign(np.diag(R)) / root


def undriven(S: np.ndarray, independent: Sequence[str]) -> list[str]:
    """Name the directions of v that no actuator drives at one configuration: those with S d = 0, by
    their largest rates."""
    _, values, rows = np.linalg.svd(np.vstack([S, np.zeros((1, S.shape[1]))]))
    rank = int((values > DRIVEN * values.max(initial=0.0)).sum())
    names = []
    for direction in rows[rank:]:
        parts = [
            name
            for name, part in zip(independent, direction, strict=True)
            if abs(part) > 0.5 * abs(direction).max()
        ]
        names.append(" with ".join(parts))
    return names


def require_driven(
    S: np.ndarray,
    f: np.ndarray,
    u: np.ndarray,
    parts: np.ndarray,
    independent: Sequence[str],
    idle: int,
) -> None:
    """Refuse forces f on the rates that the actuators cannot give; idle freedoms may be left to
    themselves.

    Args:
        S: (..., actuators, n); f: (..., n); u: (..., actuators), nearest to S' u = f.
        parts: (...), the largest of the forces that f is the sum of, for they may cancel.
        independent: names of the rates.
        idle: number of idle freedoms.
    """
    rows = np.concatenate([S, np.zeros((*f.shape[:-1], 1, f.shape[-1]))], axis=-2)
    flat = rows.reshape(-1, *rows.shape[-2:])
    lacking = np.linalg.matrix_rank(flat, rtol=DRIVEN) < S.shape[-1] - idle
    missed = np.abs(np.einsum("...an,...a->...n", S, u) - f).max(axis=-1)
    lacking |= (missed > MISSED * parts).reshape(-1)
    if not lacking.any():
        return
    first = int(np.argmax(lacking))
    which = f" of state {first}" if len(flat) > 1 else ""
    raise LinkworkError(
        f"inverse dynamics{which} is not defined: the actuators do not drive "
        f"{', '.join(undriven(flat[first], independent))}; add actuators, or simulate the motion "
        "under given forces (forward dynamics)"
    )
