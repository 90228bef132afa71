"""The reference configuration: close the loops from the description's rough guess, and look around it.

Choices that need numbers (which rows are redundant, in which order to eliminate) are made at the closed reference
configuration and at a few closed configurations near it, so that an accident of one configuration decides nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

CLOSED = 1e-12
NEIGHBOURS = 4
SPREAD = 0.05


class OpenLoopsError(ArithmeticError):
    """Report that Newton's method does not close the loops; `worst` is the index of the row that stays most open."""

    def __init__(self, residual: np.ndarray):
        self.worst = int(np.argmax(np.abs(residual)))
        self.gap = float(np.abs(residual).max())
        super().__init__(f"row {self.worst} stays open by {self.gap:.3g}")


def close(system: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], q: np.ndarray, steps: int = 100) -> np.ndarray:
    """Solve phi(q) = 0 by damped Gauss-Newton steps of least length.

    Args:
        system: returns phi (rows) and its Jacobian (rows x nq).
        q: start.
        steps: most steps to take.

    Returns:
        q with max |phi| <= 1e-12 times the size of the coordinates.

    Raises:
        OpenLoopsError: where no step reduces the residual further.
    """
    q = np.array(q, float)
    phi, Phi = system(q)
    for _ in range(steps):
        size = np.abs(phi).max(initial=0.0)
        step = -np.linalg.lstsq(Phi, phi, rcond=1e-9)[0]
        step *= min(1.0, 0.5 / max(np.abs(step).max(initial=0.0), 1e-300))
        for _ in range(12):
            trial = q + step
            phi_trial, Phi_trial = system(trial)
            if not np.linalg.norm(phi_trial) > np.linalg.norm(phi) * (1 - 1e-4):
                break
            step = step / 2
        else:
            break
        q, phi, Phi = trial, phi_trial, Phi_trial
        if size <= CLOSED:
            break
    if not np.abs(phi).max(initial=0.0) <= CLOSED * max(1.0, np.abs(q).max(initial=0.0)):
        raise OpenLoopsError(phi)
    return q


def neighbours(system: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], q: np.ndarray) -> list[np.ndarray]:
    """Return closed configurations near q (fixed seed), as many of the attempts as close."""
    random = np.random.default_rng(20100)
    found = []
    for _ in range(NEIGHBOURS):
        try:
            found.append(close(system, q + SPREAD * random.standard_normal(q.size)))
        except OpenLoopsError:
            continue
    return found
