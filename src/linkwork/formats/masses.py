"""Mass and inertia of simple solids, and of what is put together from them.

m = density V,  I about the mass centre in the solid's own axes, z along cylinders and capsules
together:  c = sum m_i c_i / m,  I = sum R_i I_i R_i' + m_i (|d_i|^2 1 - d_i d_i'),  d_i = c_i - c
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi

import numpy as np

from linkwork.formats.poses import TINY
from linkwork.mechanism import Body

NOISE = 1e-12  # of a moment of inertia, relative to the greatest


@dataclass(frozen=True)
class Solid:
    """Hold mass [kg], mass centre (3,) [m] and inertia about it (3, 3) [kg m^2] in the axes of some
    frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    @classmethod
    def of_body(cls, body: Body) -> Solid:
        return cls(body.mass, np.array(body.centre_of_mass), body.inertia.tensor())

    def seen(self, X: np.ndarray) -> Solid:
        """Return the solid in the axes of A, where X = X_AB is the pose of its frame."""
        R = X[:3, :3]
        return Solid(self.mass, R @ self.centre + X[:3, 3], R @ self.inertia @ R.T)

    def scaled(self, factor: float) -> Solid:
        return Solid(factor * self.mass, self.centre, factor * self.inertia)

    def fields(self) -> dict:
        """Return the fields of a `Body`."""
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


def without_noise(inertia: np.ndarray, least: float) -> np.ndarray:
    """Return an inertia tensor whose moments below zero are zero where they are rounding: not below
    -`least`."""
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] >= 0 or moments[0] < -max(least, NOISE * moments[-1]):
        return inertia
    tensor = axes @ np.diag(np.maximum(moments, 0.0)) @ axes.T
    np.fill_diagonal(tensor, np.maximum(np.diag(tensor), 0.0))
    return tensor


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


def volume(kind: str, size: np.ndarray) -> float:
    """Return the volume [m^3] of a sphere (radius), capsule or cylinder (radius, half length),
    ellipsoid or box (half axes)."""
    match kind:
        case "sphere":
            return 4 / 3 * pi * size[0] ** 3
        case "capsule":
            return pi * size[0] ** 2 * (2 * size[1] + 4 / 3 * size[0])
        case "cylinder":
            return pi * size[0] ** 2 * 2 * size[1]
        case "ellipsoid":
            return float(4 / 3 * pi * np.prod(size))
        case _:
            return float(8 * np.prod(size))


def principal(kind: str, size: np.ndarray, mass: float) -> np.ndarray:
    """Return the principal moments of inertia (3,) [kg m^2] of a uniform solid; `size` as for
    `volume`."""
    match kind:
        case "sphere":
            return np.full(3, 0.4 * mass * size[0] ** 2)
        case "capsule":
            r, h = size[0], size[1]
            ends = mass * 2 * r / (2 * r + 3 * h)
            middle = mass - ends
            along = middle * r**2 / 2 + ends * 2 * r**2 / 5
            across = middle * (r**2 / 4 + h**2 / 3) + ends * (2 * r**2 / 5 + h**2 + 3 * r * h / 4)
            return np.array([across, across, along])
        case "cylinder":
            r, h = size[0], size[1]
            across = mass * (r**2 / 4 + h**2 / 3)
            return np.array([across, across, mass * r**2 / 2])
        case _:
            x, y, z = np.square(size)
            return mass / (5 if kind == "ellipsoid" else 3) * np.array([y + z, x + z, x + y])
