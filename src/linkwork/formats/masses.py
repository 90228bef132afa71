"""Mass and inertia of bodies as files hold them."""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Body
from linkwork.solids.solid import Solid

NOISE = 1e-12  # of a moment of inertia, relative to the greatest


def solid_of(body: Body) -> Solid:
    """Return mass, mass centre and inertia of a body in its own axes."""
    return Solid(body.mass, np.array(body.centre_of_mass), body.inertia.tensor())


def without_noise(inertia: np.ndarray, least: float) -> np.ndarray:
    """Return an inertia tensor whose moments below zero are zero where they are rounding: not below
    -`least`."""
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] >= 0 or moments[0] < -max(least, NOISE * moments[-1]):
        return inertia
    tensor = axes @ np.diag(np.maximum(moments, 0.0)) @ axes.T
    np.fill_diagonal(tensor, np.maximum(np.diag(tensor), 0.0))
    return tensor
