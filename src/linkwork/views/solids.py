"""Shapes of bodies as faces: polygons that are flat, and facets of what is round.

All shapes are convex, so that a shape is seen in the plane as the convex hull of its corners, and faces look away from
its middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from typing import assert_never

import numpy as np

from linkwork.mechanism import Box, Capsule, Cylinder, Polygon, Sphere
from linkwork.mechanism.shapes import Shape
from linkwork.views.shapes import hull, prism
from linkwork.views.style import LINK

SIDES, RINGS = 24, 5  # of what is round: facets around an axis, and from an equator to a pole
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
CUBE = CORNERS[[(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]]
ORIGIN, Z = np.zeros(3), np.array([0.0, 0.0, 1.0])

RGB = tuple[float, float, float]
Faces = tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Solid:
    """Hold flat faces and facets of round surfaces, (k, 3) each [m], and a colour."""

    flat: Faces
    round: Faces
    colour: RGB | str

    @property
    def faces(self) -> Faces:
        """Return all faces."""
        return self.flat + self.round

    @property
    def corners(self) -> np.ndarray:
        """Return the corners of all faces (k, 3)."""
        return np.concatenate(self.faces)

    @property
    def shadow(self) -> np.ndarray:
        """Return the outline (k, 3) as seen along z, at height zero."""
        return hull(self.corners * (1, 1, 0))[0]

    def moved(self, position: np.ndarray, turn: np.ndarray) -> Solid:
        """Return the solid with its points p at  position + turn p."""
        flat, facets = (tuple(position + face @ turn.T for face in faces) for faces in (self.flat, self.round))
        return Solid(flat, facets, self.colour)


def solid_of(shape: Shape) -> Solid:
    """Return the solid of a shape, in the shape's own frame."""
    return Solid(*faces_of(shape), shape.colour or LINK)


def faces_of(shape: Shape) -> tuple[Faces, Faces]:
    """Return the flat faces of a shape and the facets of its round surface."""
    match shape:
        case Box():
            return tuple(CUBE * shape.size), ()
        case Polygon():
            ring = np.column_stack([shape.points, np.zeros(len(shape.points))])
            low, high = (ring + side * shape.thickness / 2 * Z for side in (-1, 1))
            return (low, high, *band(low, high)), ()
        case Cylinder():
            wall, *ends = prism(ORIGIN, Z, shape.radius, shape.length, SIDES)
            return tuple(ends), tuple(wall)
        case Capsule():
            return (), rounded(shape.radius, shape.length)
        case Sphere():
            return (), rounded(shape.radius, 0.0)
    assert_never(shape)


def rounded(radius: float, length: float) -> Faces:
    """Return the facets of a cylinder about z with half balls on its ends, which is a ball where it has no length."""
    latitudes = np.linspace(0, np.pi / 2, RINGS + 1)
    profile = np.column_stack([radius * np.cos(latitudes), length / 2 + radius * np.sin(latitudes)])
    profile = np.concatenate([profile[::-1] * (1, -1), profile[0 if length else 1 :]])
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [np.column_stack([r * around, np.full(SIDES, z)]) for r, z in profile]
    return tuple(facet for low, high in pairwise(rings) for facet in band(low, high))


def band(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the four-cornered faces (k, 4, 3) between two rings of as many points (k, 3)."""
    return np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)


def brightness(faces: Faces, light: np.ndarray) -> np.ndarray:
    """Return how bright the faces of a convex solid are, from 0 to 1, in the light from a direction (3)."""
    middle = np.concatenate(faces).mean(axis=0)
    normals = np.array([np.cross(face[2] - face[0], face[-1] - face[1]) for face in faces])
    outwards = np.sign([normal @ (face.mean(axis=0) - middle) for normal, face in zip(normals, faces, strict=True)])
    return np.clip(outwards * (normals @ light) / np.linalg.norm(normals, axis=1), 0, 1)
