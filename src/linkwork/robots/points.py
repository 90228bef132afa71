"""Points of bases and platforms: on a circle about z, or as the user lists them."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, radians, sin

import numpy as np

from linkwork.checks import reals
from linkwork.mechanism import MechanismError
from linkwork.robots.uniform import vector

Vector3 = tuple[float, float, float]

TRIANGLE = (-pi / 2, pi / 6, 5 * pi / 6)


def compass(azimuth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return e = (cos f, sin f, 0) and t = z x e for an azimuth f [rad]."""
    return np.array([cos(azimuth), sin(azimuth), 0.0]), np.array([-sin(azimuth), cos(azimuth), 0.0])


def circle(radius: float, azimuths: Sequence[float]) -> tuple[Vector3, ...]:
    """Return the points of a circle about z at these azimuths [deg]."""
    return tuple(vector(radius * compass(radians(f))[0]) for f in azimuths)


def six_points(name: str, points: Sequence[Sequence[float]]) -> np.ndarray:
    """Return six points as an array (6, 3) [m]; anything else is refused by the argument's name."""
    values = reals(points)
    if values is None or values.shape != (6, 3) or not np.isfinite(values).all():
        raise MechanismError("give six points of three finite coordinates each [m]", (name,))
    return values
