"""Cables as pictures show them: straight from point to point, each point moving with its body.

Where a surface stands between two points nothing is drawn: the points at which the cable touches it
move on every body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from linkwork.mechanism import Cable, Mechanism, ViaPoint

Placed = tuple[np.ndarray, np.ndarray]
"""Where a frame stands: origin (3) and axes (3, 3) in columns, in the ground's axes."""


class CableRun(NamedTuple):
    """Hold points (k, 3) [m] that a cable passes one after the other, straight between them, and
    the body that each moves with."""

    bodies: tuple[str, ...]
    points: np.ndarray


def cable_points(mechanism: Mechanism, poses: Mapping[str, Placed]) -> Iterator[tuple[str, list]]:
    """Yield each cable's name, and its path: body and place of a point, None of what is none."""
    for name, transmission in mechanism.transmissions.items():
        if isinstance(transmission, Cable):
            yield (
                name,
                [
                    (part.body, poses[part.body][0] + poses[part.body][1] @ np.array(part.point))
                    if isinstance(part, ViaPoint)
                    else None
                    for part in transmission.path
                ],
            )


def cable_runs(mechanism: Mechanism, poses: Mapping[str, Placed]) -> dict[str, list[CableRun]]:
    """Return the straight runs of each cable, by its name."""
    found: dict[str, list[CableRun]] = {}
    for name, path in cable_points(mechanism, poses):
        run: list[tuple[str, np.ndarray]] = []
        for place in [*path, None]:
            if place is not None:
                run.append(place)
                continue
            if len(run) > 1:
                bodies, points = zip(*run, strict=True)
                found.setdefault(name, []).append(CableRun(bodies, np.stack(points)))
            run = []
    return found
