"""Points of simple curves and outlines: convex hulls, arcs, springs, threads."""

from __future__ import annotations

import numpy as np

FLAT = 1e-6  # extent of points in a direction, relative to the largest, below which they have none
ARC = 13  # points of an arc
COILS = 6  # of a spring
STRAIGHT = 0.2  # part of a spring's length at either end
TURNS, PER_TURN = 3, 12  # of a thread, and its points


def hull(points: np.ndarray) -> list[np.ndarray]:
    """Return the faces of the convex hull of points (k, 3): a point (1, 3), a line (2, 3), a
    polygon or triangles (., 3)."""
    centred = points - points.mean(axis=0)
    _, extents, directions = np.linalg.svd(centred, full_matrices=False)
    dimensions = int((extents > FLAT * max(extents[0], FLAT)).sum()) if len(points) > 1 else 0
    if dimensions == 0:
        return [points[:1]]
    flat = centred @ directions[:dimensions].T
    if dimensions == 1:
        return [points[[int(flat[:, 0].argmin()), int(flat[:, 0].argmax())]]]
    from scipy.spatial import ConvexHull

    found = ConvexHull(flat)
    return (
        [points[found.vertices]] if dimensions == 2 else [points[face] for face in found.simplices]
    )


def arc(centre: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the arc (k, 3) about a centre from one point to another; its radius changes evenly
    from one to the other."""
    a, b = start - centre, end - centre
    radii = np.linalg.norm(a), np.linalg.norm(b)
    if not min(radii) > 0:
        return np.stack([start, end])
    a, b = a / radii[0], b / radii[1]
    angle = np.arccos(np.clip(a @ b, -1, 1))
    if not 1e-3 < angle < np.pi - 1e-3:
        return np.stack([start, end])
    t = np.linspace(0, 1, ARC)[:, None]
    directions = (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / np.sin(angle)
    return centre + ((1 - t) * radii[0] + t * radii[1]) * directions


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors e, f with e x f = axis; e lies in the xy plane, along x where the
    axis is along z."""
    e = np.array([-axis[1], axis[0], 0.0])
    length = np.linalg.norm(e)
    e = e / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    return e, np.cross(axis, e)


def zigzag(start: np.ndarray, end: np.ndarray, width: float, aside: np.ndarray) -> np.ndarray:
    """Return a coil spring (k, 3) between two points as seen from the side: straight ends, a zigzag
    to both sides."""
    if not np.linalg.norm(aside) > 0:
        return np.stack([start, end])
    places = np.concatenate(
        [[0, STRAIGHT], np.linspace(STRAIGHT, 1 - STRAIGHT, 2 * COILS + 1)[1:-1], [1 - STRAIGHT, 1]]
    )
    sides = np.concatenate([[0, 0], np.tile([0.5, -0.5], COILS)[:-1], [0, 0]])
    return (
        start
        + places[:, None] * (end - start)
        + sides[:, None] * width * aside / np.linalg.norm(aside)
    )


def helix(centre: np.ndarray, axis: np.ndarray, radius: float, length: float) -> np.ndarray:
    """Return a thread (k, 3) about an axis, half of its length to either side of the centre."""
    e, f = across(axis)
    t = np.linspace(-1, 1, TURNS * PER_TURN + 1)[:, None]
    angle = np.pi * TURNS * t
    return centre + length / 2 * t * axis + radius * (np.cos(angle) * e + np.sin(angle) * f)
