"""Meshes of simple solids: bars, balls, boxes, plates, bent tubes, coils; and pieces, which are
meshes that stand somewhere.

All solids of revolution come from one function: a profile (radius, height) turned about an axis.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path

import numpy as np

from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism.shapes import SQUARE, Shape, SimpleShape, rounded
from linkwork.scene.curves import across, hull
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.triangles import Triangles, simplified

SIDES = 24  # of round solids
PIN_SIDES, TUBE_SIDES = 12, 8  # of pins and of wires
UPRIGHT = 0.9  # cosine of the angle to z of what is seen along its axis
FINEST = 20_000  # triangles of one mesh that are shown at most

Polygons = Sequence[np.ndarray] | np.ndarray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Hold vertices (V, 3) [m] and convex polygons on them, whose corners run counter-clockwise
    seen from outside.

    flat: polygons with edges of their own; facets: of round surfaces; each the numbers of its
    corners. convex: whether it is seen as the outline of its corners
    """

    vertices: np.ndarray
    flat: Polygons = ()
    facets: Polygons = ()
    convex: bool = True

    @cached_property
    def faces(self) -> np.ndarray:
        """Return the polygons as triangles (F, 3)."""
        return np.array(
            [
                (p[0], p[k], p[k + 1])
                for p in (*self.flat, *self.facets)
                for k in range(1, len(p) - 1)
            ]
        )

    @property
    def smooth(self) -> bool:
        """Tell whether the polygons stand for one surface without edges."""
        return not len(self.flat)

    def moved(self, position: np.ndarray, turn: np.ndarray) -> Mesh:
        """Return the mesh with its points p at  position + turn p."""
        return replace(self, vertices=position + self.vertices @ turn.T)

    @property
    def volume(self) -> float:
        """Return the enclosed volume [m^3], by the divergence theorem; positive where all faces
        look outwards."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float((a * np.cross(b, c)).sum() / 6)


def frame_along(axis: np.ndarray) -> np.ndarray:
    """Return the rotation matrix whose third column is along an axis of any length above zero."""
    unit = axis / np.linalg.norm(axis)
    e, f = across(unit)
    return np.stack([e, f, unit], axis=1)


def turned(profile: np.ndarray, sides: int = SIDES) -> Mesh:
    """Turn a profile (k, 2) of radius and height about z; it runs upwards, and ends on the axis or
    is closed by discs."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    levels = [
        np.column_stack([radius * ring, np.full(sides, height)]) for radius, height in profile
    ]
    closed = [bool(radius > 0) for radius in profile[[0, -1], 0]]
    return Mesh(
        np.concatenate(levels), discs(len(profile), sides, closed), bands(len(profile), sides)
    )


def bands(rings: int, sides: int) -> np.ndarray:
    """Return the four-cornered faces (k, 4) between consecutive rings of as many points each."""
    low = np.arange(sides)
    high = np.roll(low, -1)
    band = np.stack([low, high, high + sides, low + sides], axis=1)
    return np.concatenate([band + sides * k for k in range(rings - 1)])


def discs(rings: int, sides: int, closed: Sequence[bool] = (True, True)) -> Polygons:
    """Return the first ring, seen from below, and the last one as faces, where they are to be
    closed."""
    ring = np.arange(sides)
    ends = (ring[::-1], ring + sides * (rings - 1))
    return [end for end, wanted in zip(ends, closed, strict=True) if wanted]


@cache
def outlined(points: tuple[tuple[float, float], ...], swept: bool) -> Mesh:
    """Return what a profile of radius and height sweeps about z, or a plate of thickness 1 on a
    convex polygon."""
    return turned(np.array(points)) if swept else slab(np.array(points), 1.0)


def slab(polygon: np.ndarray, thickness: float) -> Mesh:
    """Return a plate about the xy plane on a convex polygon (k, 2)."""
    k = len(polygon)
    (a, b), (c, d) = polygon[1] - polygon[0], polygon[2] - polygon[1]
    polygon = polygon if a * d > b * c else polygon[::-1]
    low, high = (np.column_stack([polygon, np.full(k, z)]) for z in (-thickness / 2, thickness / 2))
    return Mesh(np.concatenate([low, high]), [*discs(2, k), *bands(2, k)])


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
    return Mesh(points, list(np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)))


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
        rings.append(
            point + radius * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * other)
        )
    return Mesh(np.concatenate(rings), discs(len(line), TUBE_SIDES), bands(len(line), TUBE_SIDES))


def coil(turns: int, radius: float, wire: float) -> Mesh:
    """Return a helical spring of unit length from the origin along z, with straight ends on the
    axis."""
    t = np.linspace(0, 1, 16 * turns + 1)
    winding = np.stack([np.cos(2 * np.pi * turns * t), np.sin(2 * np.pi * turns * t)], axis=1)
    helix = np.column_stack([radius * winding, 0.15 + 0.7 * t])
    return tube(
        np.concatenate([[(0, 0, 0.0), (0, 0, 0.12)], helix, [(0, 0, 0.88), (0, 0, 1.0)]]), wire
    )


POST = outlined(((1.0, 0.0), (1.0, 1.0)), True)  # radius 1, from the origin to height 1 along z
PIN = turned(np.array([(1.0, -0.5), (1.0, 0.5)]), PIN_SIDES)  # the same about the origin
BALL = outlined(rounded(0.0), True)  # radius 1
BLOCK = outlined(SQUARE, False)  # side 1


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """Hold a mesh that is scaled along its axes by `scale` (3), turned by `turn` (3, 3) and moved
    by `position` (3) [m]."""

    mesh: Mesh
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    scale: np.ndarray = field(default_factory=lambda: np.ones(3))

    @property
    def corners(self) -> np.ndarray:
        """Return the places of the vertices (V, 3)."""
        return self.position + (self.mesh.vertices * self.scale) @ self.turn.T

    @property
    def faces(self) -> list[np.ndarray]:
        """Return all faces (k, 3), the flat ones first."""
        corners = self.corners
        return [corners[polygon] for polygon in (*self.mesh.flat, *self.mesh.facets)]

    @property
    def shadow(self) -> np.ndarray:
        """Return the outline (k, 3) of what is convex as seen along z, at height zero."""
        return hull(self.corners * (1, 1, 0))[0]

    def is_disc(self, from_above: bool) -> bool:
        """Tell whether it is seen as a disc: a ball from everywhere, a pin along z from above."""
        return self.mesh is BALL or (
            from_above and self.mesh is PIN and abs(self.turn[2, 2]) > UPRIGHT
        )

    def coarser(self, most: int) -> PlacedMesh:
        """Return the piece with its triangles, where it is a mesh from a file, at most so many."""
        return self if self.mesh.convex else replace(self, mesh=_coarser(self.mesh, most))

    def moved(self, position: np.ndarray, turn: np.ndarray) -> PlacedMesh:
        """Return the piece with its points p at  position + turn p."""
        return replace(self, position=position + turn @ self.position, turn=turn @ self.turn)


def piece_of(shape: Shape) -> PlacedMesh:
    """Return a shape of a body as a piece in the shape's own axes.

    Raises:
        LinkworkError: half a sentence about a mesh that cannot be read.
    """
    if not isinstance(shape, SimpleShape):
        return PlacedMesh(_of_triangles(read_mesh(Path(shape.file)), shape.scale, FINEST))
    points, scale, swept = shape.outline
    return PlacedMesh(outlined(points, swept), scale=np.array(scale))


def drawable(shapes: Iterable[Shape]) -> tuple[Shape, ...]:
    """Return the shapes that can be drawn: all but meshes that cannot be read, which are told."""
    found = []
    for shape in shapes:
        try:
            piece_of(shape)
            found.append(shape)
        except LinkworkError as error:
            told = getattr(shape, "file", "")
            warnings.warn(f"the mesh {told!r} is not shown: it {error}", ModelWarning, stacklevel=2)
    return tuple(found)


@lru_cache(maxsize=256)
def _of_triangles(mesh: Triangles, scale: tuple[float, float, float], most: int) -> Mesh:
    found = simplified(mesh.joined(), most).scaled(np.array(scale))
    return Mesh(found.vertices, facets=found.faces, convex=False)


@lru_cache(maxsize=256)
def _coarser(mesh: Mesh, most: int) -> Mesh:
    found = simplified(Triangles(mesh.vertices, np.asarray(mesh.facets)), most)
    return replace(mesh, vertices=found.vertices, facets=found.faces)


def brightness(faces: Sequence[np.ndarray], light: np.ndarray) -> np.ndarray:
    """Return how bright faces that run counter-clockwise seen from outside are, from 0 to 1, lit
    from a direction (3)."""
    normals = np.array([np.cross(face[2] - face[0], face[-1] - face[1]) for face in faces])
    lengths = np.linalg.norm(normals, axis=1)
    return np.clip(normals @ light / np.where(lengths > 0, lengths, 1.0), 0, 1)
