"""Uniform simple shapes, filled or as shells: their volume or surface, and their moments of
inertia.

`size` is the radius of a sphere, radius and half length of a capsule or cylinder along z, the half
axes of an ellipsoid or box. A shell has its mass evenly on the surface; that of an ellipsoid lies
between it and one whose half axes are longer by LAYER, and its surface is Thomsen's.

Sources: MuJoCo's documentation, https://mujoco.readthedocs.io (geom, shellinertia); G. P. Michon,
https://www.numericana.com/answer/ellipsoid.htm (K. Thomsen's formula, within 1.1 %).
"""

from __future__ import annotations

from math import pi

import numpy as np

THOMSEN = 1.6075  # exponent of the formula
LAYER = 1e-6  # thickness of an ellipsoid's shell along its axes [m]


def volume(kind: str, size: np.ndarray) -> float:
    """Return the volume [m^3] of a shape."""
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


def surface(kind: str, size: np.ndarray) -> float:
    """Return the surface [m^2] of a shape."""
    match kind:
        case "sphere":
            return 4 * pi * size[0] ** 2
        case "capsule":
            return 4 * pi * size[0] * (size[0] + size[1])
        case "cylinder":
            return 2 * pi * size[0] * (size[0] + 2 * size[1])
    x, y, z = size
    if kind == "ellipsoid":
        mean = np.mean([(a * b) ** THOMSEN for a, b in ((x, y), (y, z), (z, x))])
        return float(4 * pi * mean ** (1 / THOMSEN))
    return float(8 * (x * y + y * z + z * x))


def principal(kind: str, size: np.ndarray, mass: float) -> np.ndarray:
    """Return the principal moments of inertia (3,) [kg m^2] of a uniform solid."""
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


def shell(kind: str, size: np.ndarray, mass: float) -> np.ndarray:
    """Return the principal moments of inertia (3,) [kg m^2] of a shape that is hollow."""
    match kind:
        case "sphere":
            return np.full(3, 2 / 3 * mass * size[0] ** 2)
        case "capsule":
            # A tube, and two half balls whose own mass centres are half a radius beyond its ends.
            r, h = size[0], size[1]
            ends = mass * r / (r + h)
            tube = mass - ends
            along = tube * r**2 + ends * 2 / 3 * r**2
            across = tube * (r**2 / 2 + h**2 / 3) + ends * (2 / 3 * r**2 + h * (h + r))
            return np.array([across, across, along])
        case "cylinder":
            # A tube, and a disc on either end.
            r, h = size[0], size[1]
            discs = mass * r / (r + 2 * h)
            tube = mass - discs
            across = tube * (r**2 / 2 + h**2 / 3) + discs * (r**2 / 4 + h**2)
            return np.array([across, across, tube * r**2 + discs * r**2 / 2])
        case "ellipsoid":
            outer = size + LAYER
            inside, whole = float(np.prod(size)), float(np.prod(outer))
            density = mass / (whole - inside)
            return principal(kind, outer, density * whole) - principal(kind, size, density * inside)
    # A box: two sheets across each axis, by the axis.
    x, y, z = size
    sheets = mass * np.array([y * z, z * x, x * y]) / (y * z + z * x + x * y)
    squares = np.square(size)
    # Second moments along each axis: a sheet across it has all its mass at the end, others spread.
    along = squares * (sheets + (mass - sheets) / 3)
    return np.array([along[1] + along[2], along[0] + along[2], along[0] + along[1]])
