"""Mass, mass centre and inertia of solids, and of what is put together from them.

together:  c = sum m_i c_i / m,  I = sum R_i I_i R_i' + m_i (|d_i|^2 1 - d_i d_i'),  d_i = c_i - c
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

TINY = 1e-15  # what rounding leaves of a zero


@dataclass(frozen=True)
class Solid:
    """Hold mass [kg], mass centre (3,) [m] and inertia about it (3, 3) [kg m^2] in the axes of some
    frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    def seen(self, X: np.ndarray) -> Solid:
        """Return the solid in the axes of A, where X = X_AB is the pose (4, 4) of its frame."""
        R = X[:3, :3]
        return Solid(self.mass, R @ self.centre + X[:3, 3], R @ self.inertia @ R.T)

    def scaled(self, factor: float) -> Solid:
        return Solid(factor * self.mass, self.centre, factor * self.inertia)

    def fields(self) -> dict:
        """Return the fields of a body's description."""
        I = np.where(  # noqa: E741
            abs(self.inertia) < TINY * np.max(abs(self.inertia), initial=0), 0.0, self.inertia
        )
        elements = {
            "xx": I[0, 0],
            "yy": I[1, 1],
            "zz": I[2, 2],
            "xy": I[0, 1],
            "xz": I[0, 2],
            "yz": I[1, 2],
        }
        return {
            "mass": float(self.mass),
            "centre_of_mass": tuple(float(c) if abs(c) >= TINY else 0.0 for c in self.centre),
            "inertia": {name: float(value) for name, value in elements.items()},
        }


def together(solids: Iterable[Solid]) -> Solid:
    """Return several solids of one frame as one."""
    solids = list(solids)
    mass = sum(solid.mass for solid in solids)
    if mass == 0:
        return Solid(0.0, np.zeros(3), sum((solid.inertia for solid in solids), np.zeros((3, 3))))
    centre = sum(solid.mass * solid.centre for solid in solids) / mass
    inertia = np.zeros((3, 3))
    for solid in solids:
        d = solid.centre - centre
        inertia += solid.inertia + solid.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Solid(mass, np.asarray(centre), inertia)
