"""The surface of a set of grid points in space: a net that separates them from all others.

A cube of eight neighbouring points that holds both kinds has a vertex, in the middle of the places
at which the cube's edges lead from one kind to the other; where an edge does so, the vertices of
the four cubes around it make a face. At the grid's ends the surface lies on the last points.

Source: S. F. F. Gibson, Constrained elastic surface nets, MICCAI 1998.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Cubes about an edge, counter-clockwise against its direction.
AROUND = np.array([(-1, -1), (0, -1), (0, 0), (-1, 0)])


@dataclass(frozen=True, eq=False)
class Surface:
    """Hold faces (f, 4, 3) of points, counter-clockwise seen from outside where all axes increase,
    and the grid's points (f, 3 indices) within and beyond at each; beyond may lie off the grid.
    """

    faces: np.ndarray
    points: np.ndarray
    beyond: np.ndarray


def surface(inside: np.ndarray, axes: Sequence[np.ndarray]) -> Surface:
    """Return the surface of the points of a grid (three axes) that are inside."""
    # All around one more layer of points that are not inside, at the places of the last ones.
    filled = np.pad(np.asarray(inside, bool), 1)
    padded = [np.pad(np.asarray(axis, float), 1, mode="edge") for axis in axes]
    total = np.zeros((*(size - 1 for size in filled.shape), 3))
    count = np.zeros(total.shape[:3])
    corners, points, beyond = [], [], []
    for k in range(3):
        # Edges along one axis that lead out of the set or into it, and where.
        start = np.argwhere(np.diff(filled, axis=k))
        step = np.eye(3, dtype=int)[k]
        near, far = (
            np.stack([axis[i] for axis, i in zip(padded, index.T, strict=True)], axis=1)
            for index in (start, start + step)
        )
        leaving = filled[tuple(start.T)]
        # The four cubes around each.
        across = np.zeros((4, 3), int)
        across[:, [(k + 1) % 3, (k + 2) % 3]] = AROUND
        cubes = start[:, None] + across
        np.add.at(total, tuple(np.moveaxis(cubes, -1, 0)), (near + far)[:, None] / 2)
        np.add.at(count, tuple(np.moveaxis(cubes, -1, 0)), 1)
        corners.append(np.where(leaving[:, None, None], cubes, cubes[:, ::-1]))
        points.append(np.where(leaving[:, None], start, start + step) - 1)
        beyond.append(np.where(leaving[:, None], start + step, start) - 1)
    vertices = total / np.maximum(count, 1)[..., None]
    return Surface(
        vertices[tuple(np.moveaxis(np.concatenate(corners), -1, 0))],
        np.concatenate(points),
        np.concatenate(beyond),
    )
