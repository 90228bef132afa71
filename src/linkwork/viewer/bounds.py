"""Joint limits as rows: how far a configuration lies inside them, and how that changes with the
tree's rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from linkwork.mechanism.joints import QUATERNION, TURN
from linkwork.mechanism.limits import limited
from linkwork.robot import Robot

SIDES = {-1: "lower", 1: "upper"}


@dataclass(frozen=True, eq=False)
class Bound:
    """Keep  side * x <= side * bound  for a joint coordinate x, or for the angle x = 2 acos |qw| of
    a free turn.

    name; bound [m, rad]; side: -1 of a lower, 1 of an upper limit; unit: m or rad
    places: of the coordinate (1) or the quaternion (4) among all coordinates; rates: of its rate
    (1), or of the angular velocity (3), among all rates
    """

    name: str
    bound: float
    side: int
    unit: str
    places: list[int]
    rates: list[int]

    def value(self, out: Mapping[str, np.ndarray]) -> float:
        """Return x [m, rad] by the outputs of `functions.assembly`."""
        values = out["coordinates"][self.places]
        return (
            float(values[0]) if len(values) == 1 else 2 * float(np.arccos(min(1.0, abs(values[0]))))
        )

    def row(self, out: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return dx/dw (nv): the coordinate's rate; of a free turn the angular velocity about its
        axis."""
        rows = out["J_coordinates"][self.rates]
        if len(self.places) == 1:
            return rows[0]
        w, *axis = out["coordinates"][self.places]
        return (
            np.copysign(1.0, w) * np.array(axis) @ rows / max(float(np.linalg.norm(axis)), 1e-300)
        )

    def __str__(self) -> str:
        return f"{self.name} is at its {SIDES[self.side]} limit {self.bound:.4g} {self.unit}"


def bounds_of(robot: Robot) -> tuple[Bound, ...]:
    """Return the limits of a robot's joints."""
    found = []
    for label, limits, name in limited(robot.mechanism):
        free = name.endswith(f".{TURN}")
        joint = name.removesuffix(f".{TURN}")
        coordinates = [f"{joint}.{part}" for part in QUATERNION] if free else [label]
        rates = [f"{joint}.{part}" for part in ("wx", "wy", "wz")] if free else [label]
        places = [robot.coordinates.index(name) for name in coordinates]
        indices = [robot.rates.index(name) for name in rates]
        unit = "rad" if free else robot.unit(label)
        for side, bound in ((-1, limits.lower), (1, limits.upper)):
            if bound is not None and not (free and side < 0):
                found.append(Bound(name, bound, side, unit, places, indices))
    return tuple(found)
