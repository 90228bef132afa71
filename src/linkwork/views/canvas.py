"""A canvas in two or three dimensions: lines, bars, faces, dots and text by their points in space,
nearer ones on top.

In two dimensions points are seen along z. In three, depth orders what lies on one level; it is that
of the view in which the picture is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from linkwork.scene.colours import EDGE, Colour
from linkwork.scene.meshes import PlacedMesh, brightness

POINTS = 382  # width of a bar as thick as the mechanism is large [pt]
BAR_IN_SPACE = 0.7  # width of bars in space, relative to those in the plane
OUTLINE = 2.3  # what a bar's dark edges add to its width [pt]
PAINTED, FAINTLY = 400, 120  # triangles of a mesh at most, and in paler poses
LAMP_FROM_ABOVE = np.array([-0.45, 0.7, 1.0])  # where it comes from in the plane
SHADOW = 0.35  # how much darker the faces of solids are where no light falls
LAMP = (-0.45, 0.7)  # where the light comes from, to the right and upwards of the viewer


@dataclass(frozen=True)
class Canvas:
    """Hold where and how strongly things are drawn.

    axes: of matplotlib; points: all that are drawn (N, 3) [m]; size: largest extent of the
        mechanism [m]
    towards: unit vector to the viewer (3), zero in the plane; strength: 1 in full, 0 white; level:
        below or above others
    """

    axes: Any
    points: np.ndarray
    size: float
    towards: np.ndarray
    strength: float = 1.0
    level: float = 0.0

    @classmethod
    def on(cls, axes: Any, points: np.ndarray) -> Canvas:
        """Make a canvas on axes for a mechanism with these points."""
        size = float(np.ptp(points, axis=0).max()) or 1.0
        if not hasattr(axes, "get_zlim"):
            return cls(axes, points, size, np.zeros(3))
        axes.computed_zorder = False
        return cls(axes, points, size, direction(axes.elev, axes.azim))

    @property
    def flat(self) -> bool:
        """Tell whether this is a canvas in the plane."""
        return not self.towards.any()

    @property
    def screen(self) -> np.ndarray:
        """Return the unit vectors to the right and upwards as seen (2, 3)."""
        if self.flat:
            return np.eye(3)[:2]
        right = np.cross((0.0, 0.0, 1.0), self.towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(self.towards, right)])

    def at(self, strength: float, level: float) -> Canvas:
        """Return the canvas for another strength and level."""
        return replace(self, strength=strength, level=level)

    def order(self, points: np.ndarray, level: float) -> float:
        """Return where in the order of drawing something stands: by level, and on a level by
        depth."""
        depth = (
            (points.reshape(-1, 3).mean(axis=0) - self.points.mean(axis=0))
            @ self.towards
            / self.size
        )
        return self.level + level + 0.05 * float(np.clip(depth, -1, 1))

    def width(self, radius: float) -> float:
        """Return the width of what is round by its radius [m], the same in small pictures [pt]."""
        return POINTS * radius / self.size

    def mixed(self, colour: Colour, dark: float = 0.0) -> tuple[float, ...]:
        """Return a colour, darkened by a part of itself, mixed with white."""
        from matplotlib.colors import to_rgb

        return tuple(1 - self.strength * (1 - (1 - dark) * part) for part in to_rgb(colour))

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Return coordinates (2 or 3, k) for the axes."""
        return points.T[:2] if self.flat else points.T

    def line(self, points: np.ndarray, level: float, **look: Any) -> None:
        """Draw a polyline (k, 3)."""
        look["color"] = self.mixed(look["color"])
        self.axes.plot(
            *self.seen(points), zorder=self.order(points[np.isfinite(points[:, 0])], level), **look
        )

    def bar(
        self, points: np.ndarray, level: float, width: float, colour: Colour, gid: str | None = None
    ) -> None:
        """Draw a polyline as a bar with dark edges."""
        width *= 1 if self.flat else BAR_IN_SPACE
        self.line(
            points, level, color=EDGE, lw=width + (OUTLINE if self.flat else OUTLINE * BAR_IN_SPACE)
        )
        self.line(points, level, color=colour, lw=width, gid=gid)

    def faces(
        self, faces: Sequence[np.ndarray], inside: Colour, edge: Colour, level: float, **look: Any
    ) -> None:
        """Draw plane polygons (k, 3) of as many corners each: one in the plane, the faces of a
        solid in space."""
        look |= {
            "fc": self.mixed(inside),
            "ec": self.mixed(edge),
            "zorder": self.order(np.concatenate(faces), level),
        }
        if self.flat:
            from matplotlib.patches import Polygon

            self.axes.add_patch(Polygon(faces[0][:, :2], joinstyle="round", **look))
        else:
            from mpl_toolkits.mplot3d.art3d import Poly3DCollection

            self.axes.add_collection3d(Poly3DCollection(faces, **look))

    def piece(
        self, piece: PlacedMesh, colour: Colour, level: float, gid: str | None = None
    ) -> None:
        """Draw a solid: its outline in the plane; in space its faces, shaded, with dark edges of
        the flat ones."""
        piece = piece.coarser(PAINTED if self.strength == 1.0 else FAINTLY)
        if self.flat and piece.mesh.convex:
            self.faces([piece.shadow], colour, EDGE, level, lw=1.3, gid=gid)
            return
        if self.flat:
            self.triangles_from_above(piece, colour, level, gid)
            return
        from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        light = self.towards + LAMP @ self.screen
        faces, flat = piece.faces, len(piece.mesh.flat)
        if not piece.mesh.convex:
            faces = [face for face in faces if self.faces_here(face)] or faces[:1]
        shadows = 1 - brightness(faces, light / np.linalg.norm(light))
        inside = [self.mixed(colour, SHADOW * dark) for dark in shadows]
        look = {
            "ec": [self.mixed(EDGE)] * flat + inside[flat:],
            "lw": [0.8] * flat + [0.3] * (len(faces) - flat),
        }
        order = self.order(piece.corners, level)
        self.axes.add_collection3d(
            Poly3DCollection(alike(faces), fc=inside, zorder=order, gid=gid, **look)
        )

    def faces_here(self, face: np.ndarray) -> bool:
        """Tell whether a triangle (3, 3) of a mesh looks at the viewer."""
        return bool(np.cross(face[1] - face[0], face[2] - face[0]) @ self.towards > 0)

    def triangles_from_above(
        self, piece: PlacedMesh, colour: Colour, level: float, gid: str | None
    ) -> None:
        """Draw a mesh in the plane: its triangles that look upwards, shaded, the higher on top."""
        from matplotlib.collections import PolyCollection

        corners = piece.corners[piece.mesh.faces]
        a, b, c = corners.swapaxes(0, 1)
        upwards = np.cross(b - a, c - a)[:, 2] > 0
        seen = corners[upwards][np.argsort(corners[upwards].mean(axis=1)[:, 2])]
        if len(seen):
            light = LAMP_FROM_ABOVE / np.linalg.norm(LAMP_FROM_ABOVE)
            inside = [self.mixed(colour, SHADOW * (1 - lit)) for lit in brightness([*seen], light)]
            order = self.order(piece.corners, level)
            self.axes.add_collection(
                PolyCollection(
                    [*seen[:, :, :2]], fc=inside, ec=inside, lw=0.3, zorder=order, gid=gid
                )
            )

    def dot(self, point: np.ndarray, level: float, marker: str = "o", **look: Any) -> None:
        """Draw a marker at a point."""
        look = {
            key: self.mixed(value) if key in ("mfc", "mec") else value
            for key, value in look.items()
        }
        self.axes.plot(*self.seen(point[None]), marker, zorder=self.order(point, level), **look)

    def text(self, point: np.ndarray, aside: np.ndarray, half: np.ndarray, words: str) -> None:
        """Write words in a box of half a size (2) beside a point, both as seen [m]."""
        middle = point + aside @ self.screen
        ground = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 1.0}
        style = {"ha": "center", "va": "center", "fontsize": 8, "linespacing": 1.1, "zorder": 9}
        self.axes.text(*self.seen(middle), words, bbox=ground, **style)
        if self.flat:
            self.axes.update_datalim([middle[:2] - half, middle[:2] + half])


def alike(faces: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return polygons with as many corners each, for what fills them up otherwise is not set: the
    last ones are repeated."""
    most = max(map(len, faces))
    return [
        np.concatenate([face, np.repeat(face[-1:], most - len(face), axis=0)]) for face in faces
    ]


def direction(elevation: float, azimuth: float) -> np.ndarray:
    """Return the unit vector to a viewer at these angles [deg]."""
    e, a = np.radians(elevation), np.radians(azimuth)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
