"""Mass, mass centre and inertia of what triangles enclose, for a density of one.

A triangle (a, b, c) and the origin make a tetrahedron of signed volume V = a . (b x c) / 6 with the
centre (a + b + c) / 4. With second moments P = int r r' dV the inertia is I = tr(P) 1 - P, and

    P = sum V / 20 (s s' + a a' + b b' + c c'),  s = a + b + c  (of a surface: area / 12 for V / 20)

which is exact for closed meshes whose triangles run counter-clockwise seen from outside. About a
point other than the origin the sums are the same where the mesh is closed; here it is the middle of
the surface for the mass centre, and the mass centre for the inertia, so that rounding stays small.

exact:   as above.
legacy:  with |V| for V, which counts too much where a mesh is not star-shaped about that point.
convex:  of the convex hull.
shell:   mass on the surface [kg/m^2].

Sources: D. Eberly, Polyhedral Mass Properties (Revisited), 2002; MuJoCo's documentation,
https://mujoco.readthedocs.io (asset/mesh, inertia) for the names and what they mean.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.solids.solid import Solid

Mode = Literal["exact", "legacy", "convex", "shell"]
MODES: tuple[Mode, ...] = ("exact", "legacy", "convex", "shell")
LEAST = 1e-12  # surface and volume that can be weighed, relative to those of a cube around


@dataclass(frozen=True, eq=False)
class Triangles:
    """Hold the vertices (V, 3) [m] of a mesh and its triangles (F, 3), by the numbers of their
    corners."""

    vertices: np.ndarray
    faces: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """Return the corners (F, 3, 3) of the triangles, one after the other [m]."""
        return self.vertices[self.faces]

    def moved(self, place: Callable[[np.ndarray], np.ndarray], mirrored: bool = False) -> Triangles:
        """Return the mesh with its vertices elsewhere; `mirrored`: its triangles run the other way
        round."""
        return Triangles(place(self.vertices), self.faces[:, ::-1] if mirrored else self.faces)

    def scaled(self, scale: np.ndarray) -> Triangles:
        """Return the mesh scaled along x, y and z; a negative product of the scales mirrors it."""
        return self.moved(lambda points: points * scale, bool(np.prod(scale) < 0))

    def joined(self) -> Triangles:
        """Return the mesh with vertices of equal place as one."""
        order = np.lexsort(self.vertices.T[::-1])
        ordered, numbers = self.vertices[order], np.empty(len(order), np.int64)
        first = np.ones(len(order), bool)
        first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
        numbers[order] = np.cumsum(first) - 1
        return Triangles(ordered[first], numbers[self.faces])

    @property
    def hull(self) -> Triangles:
        """Return the convex hull."""
        return hull_of(self.vertices)

    @property
    def open_edges(self) -> int:
        """Return at how many edges the triangles do not meet in pairs that run opposite ways; none
        of a closed mesh."""
        faces = self.joined().faces
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        ways = np.sign(edges[:, 1] - edges[:, 0])
        names = edges.min(axis=1) * (1 + edges.max(initial=0)) + edges.max(axis=1)
        _, numbers = np.unique(names, return_inverse=True)
        return int(np.count_nonzero(np.bincount(numbers, weights=ways)))


def hull_of(points: np.ndarray, options: str = "Qt") -> Triangles:
    """Return the convex hull of points (k, 3), its triangles counter-clockwise seen from outside.

    options: of Qhull, which are MuJoCo's

    Raises:
        LinkworkError: points that lie in a plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points, qhull_options=options)
    except (QhullError, ValueError):
        raise LinkworkError(
            "its points lie in a plane, so that it has no convex hull with a volume"
        ) from None
    faces, outwards = found.simplices, found.equations[:, :3]
    backwards = (normals_of(points[faces]) * outwards).sum(axis=1) < 0
    return Triangles(points, np.where(backwards[:, None], faces[:, ::-1], faces))


def normals_of(corners: np.ndarray) -> np.ndarray:
    """Return the normals (F, 3) of triangles, as long as twice their areas."""
    a, b, c = corners.swapaxes(0, 1)
    return np.cross(b - a, c - a)


def weighed(mesh: Triangles, mode: Mode = "exact") -> Solid:
    """Return mass, centre and inertia of a mesh for a density of one [kg/m^3; shell: kg/m^2].

    Raises:
        LinkworkError: a mesh without a surface or a volume, or whose triangles face inwards.
    """
    # What is summed over: triangles, each with a signed measure.
    corners = mesh.corners
    areas = np.linalg.norm(normals_of(corners), axis=1) / 2
    size = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
    if not areas.sum() > LEAST * size**2:
        raise LinkworkError("it has no surface")
    middle = areas @ corners.mean(axis=1) / areas.sum()
    if mode == "convex":
        corners = mesh.hull.corners

    def measures(about: np.ndarray) -> np.ndarray:
        if mode == "shell":
            return areas
        a, b, c = (corners - about).swapaxes(0, 1)
        volumes = (a * np.cross(b, c)).sum(axis=1) / 6
        return abs(volumes) if mode == "legacy" else volumes

    # The mass centre: of tetrahedra with their tops in the middle of the surface.
    parts, weight = measures(middle), 1.0 if mode == "shell" else 3 / 4
    whole = parts.sum()
    least = LEAST * (size**2 if mode == "shell" else size**3)
    if whole < least:
        raise LinkworkError(
            "its triangles face inwards; turn them round"
            if whole <= -least
            else "it encloses no volume"
        )
    centre = parts @ (weight * corners.mean(axis=1) + (1 - weight) * middle) / whole
    # Second moments about it.
    about, parts = corners - centre, measures(centre)
    sums = about.sum(axis=1)
    P = np.einsum("f,fi,fj->ij", parts, sums, sums) + np.einsum(
        "f,fki,fkj->ij", parts, about, about
    )
    P /= 12 if mode == "shell" else 20
    return Solid(float(parts.sum()), centre, np.trace(P) * np.eye(3) - P)


def simplified(mesh: Triangles, most: int) -> Triangles:
    """Return a mesh of at most so many triangles that looks alike: points of one cell of a grid are
    one, and triangles that have no three points any more vanish.

    Source: J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering complex
    scenes, 1993.
    """
    if len(mesh.faces) <= most:
        return mesh
    low, size = mesh.vertices.min(axis=0), float(np.ptp(mesh.vertices, axis=0).max())
    # Triangles grow as the square of the cells along a side; the finest grid that is coarse enough.
    cells = max(2, int(np.sqrt(most)))
    found = _clustered(mesh, low, size / cells)
    while len(found.faces) > most and cells > 2:
        cells = max(2, min(cells - 1, int(cells * np.sqrt(most / len(found.faces)))))
        found = _clustered(mesh, low, size / cells)
    return found if 0 < len(found.faces) <= most else hull_of(found.vertices)


def _clustered(mesh: Triangles, low: np.ndarray, side: float) -> Triangles:
    """Return a mesh with all points of a cell of a grid at the one that is the farthest out."""
    out = np.argsort(-np.linalg.norm(mesh.vertices - mesh.vertices.mean(axis=0), axis=1))
    cells = np.floor((mesh.vertices[out] - low) / side).astype(np.int64)
    _, chosen, numbers = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    cluster = np.empty(len(out), dtype=np.int64)
    cluster[out] = numbers.reshape(-1)
    faces = cluster[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return Triangles(mesh.vertices[out][chosen], faces[np.sort(first)])
