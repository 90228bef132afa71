"""Triangle meshes of simple solids: bars, balls, boxes, plates, bent tubes, coils.

All solids of revolution come from one function: a profile (radius, height) turned about an axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from linkwork.views.shapes import across

SIDES = 20  # of round solids
TUBE_SIDES = 8


@dataclass(frozen=True, eq=False)
class Mesh:
    """Hold vertices (V, 3) [m] and triangles (F, 3), whose corners run counter-clockwise seen from outside.

    smooth: whether the triangles stand for a surface without edges
    """

    vertices: np.ndarray
    faces: np.ndarray
    smooth: bool = False

    def moved(self, position: np.ndarray, turn: np.ndarray) -> Mesh:
        """Return the mesh with its points p at  position + turn p."""
        return Mesh(position + self.vertices @ turn.T, self.faces, self.smooth)

    @property
    def volume(self) -> float:
        """Return the enclosed volume [m^3], by the divergence theorem; positive where all faces look outwards."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float((a * np.cross(b, c)).sum() / 6)


def frame_along(axis: np.ndarray) -> np.ndarray:
    """Return the rotation matrix whose third column is along an axis of any length above zero."""
    unit = axis / np.linalg.norm(axis)
    e, f = across(unit)
    return np.stack([e, f, unit], axis=1)


def turned(profile: np.ndarray, sides: int = SIDES) -> Mesh:
    """Turn a profile (k, 2) of radius and height about z; it runs upwards, and ends on the axis or is closed by discs."""
    if profile[0, 0] > 0:
        profile = np.concatenate([[(0.0, profile[0, 1])], profile])
    if profile[-1, 0] > 0:
        profile = np.concatenate([profile, [(0.0, profile[-1, 1])]])
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    levels = [np.column_stack([radius * ring, np.full(sides, height)]) for radius, height in profile]
    return Mesh(np.concatenate(levels), stitched(len(profile), sides))


def stitched(rings: int, sides: int) -> np.ndarray:
    """Return the triangles between consecutive rings of as many points each."""
    low = np.arange(sides)
    high = np.roll(low, -1)
    band = np.concatenate([np.stack([low, high, high + sides], 1), np.stack([low, high + sides, low + sides], 1)])
    return np.concatenate([band + sides * k for k in range(rings - 1)])


def post(sides: int = SIDES) -> Mesh:
    """Return a cylinder of radius 1 from the origin to height 1 along z."""
    return turned(np.array([(1.0, 0.0), (1.0, 1.0)]), sides)


def ball() -> Mesh:
    """Return a sphere of radius 1 about the origin."""
    t = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    profile = np.stack([np.cos(t), np.sin(t)], axis=1)
    profile[[0, -1], 0] = 0.0
    return replace(turned(profile), smooth=True)


@cache
def capsule(length: float) -> Mesh:
    """Return a cylinder of radius 1 about z, half its length to either side, with half balls on its ends."""
    t = np.linspace(0, np.pi / 2, SIDES // 4 + 1)
    end = np.stack([np.cos(t), np.sin(t) + length / 2], axis=1)
    end[-1, 0] = 0.0
    return replace(turned(np.concatenate([end[::-1] * (1, -1), end])), smooth=True)


def block() -> Mesh:
    """Return a cube of side 1 about the origin."""
    return slab(np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2, 1.0)


def slab(polygon: np.ndarray, thickness: float) -> Mesh:
    """Return a plate about the xy plane on a convex polygon (k, 2) that runs counter-clockwise."""
    k = len(polygon)
    low, high = (np.column_stack([polygon, np.full(k, z)]) for z in (-thickness / 2, thickness / 2))
    fan = np.array([(0, i, i + 1) for i in range(1, k - 1)])
    return Mesh(np.concatenate([low, high]), np.concatenate([stitched(2, k), fan + k, fan[:, ::-1]]))


def plate(points: np.ndarray, thickness: float) -> Mesh:
    """Return the convex hull of points (k, 3) that lie in a plane, as a plate."""
    from scipy.spatial import ConvexHull

    centre = points.mean(axis=0)
    _, _, directions = np.linalg.svd(points - centre, full_matrices=False)
    turn = np.stack([directions[0], directions[1], np.cross(directions[0], directions[1])], axis=1)
    flat = ((points - centre) @ turn)[:, :2]
    return slab(flat[ConvexHull(flat).vertices], thickness).moved(centre, turn)


def solid(points: np.ndarray) -> Mesh:
    """Return the convex hull of points (k, 3) that do not lie in a plane."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    return Mesh(points, np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices))


def tube(line: np.ndarray, radius: float) -> Mesh:
    """Return a round tube along a polyline (k, 3), its ends closed."""
    directions = np.gradient(line, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    angles = 2 * np.pi * np.arange(TUBE_SIDES) / TUBE_SIDES
    side, rings = across(directions[0])[0], []
    for point, direction in zip(line, directions, strict=True):
        side = side - (side @ direction) * direction
        side /= np.linalg.norm(side)
        other = np.cross(direction, side)
        rings.append(point + radius * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * other))
    ends = [np.repeat(line[k][None], TUBE_SIDES, axis=0) for k in (0, -1)]
    return Mesh(np.concatenate([ends[0], *rings, ends[1]]), stitched(len(line) + 2, TUBE_SIDES))


def coil(turns: int, radius: float, wire: float) -> Mesh:
    """Return a helical spring of unit length from the origin along z, with straight ends on the axis."""
    t = np.linspace(0, 1, 16 * turns + 1)
    winding = np.stack([np.cos(2 * np.pi * turns * t), np.sin(2 * np.pi * turns * t)], axis=1)
    helix = np.column_stack([radius * winding, 0.15 + 0.7 * t])
    return tube(np.concatenate([[(0, 0, 0.0), (0, 0, 0.12)], helix, [(0, 0, 0.88), (0, 0, 1.0)]]), wire)


POST, BALL, BLOCK = post(), ball(), block()
