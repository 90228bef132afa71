"""What touches: planes and fields of heights, as far as the mechanism comes, and the solids and
points of contacts on the ground and on bodies that are not drawn as shapes of their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from linkwork.mechanism import GROUND, Mechanism
from linkwork.mechanism.contact import HeightField, Plane, Points, Surface
from linkwork.scene.cable_runs import Placed
from linkwork.scene.colours import PALE
from linkwork.scene.meshes import BALL, FINEST, Mesh, PlacedMesh, piece_of
from linkwork.scene.parts import Bar, Hull, ScenePart
from linkwork.scene.skeleton import Skeleton, frame_pose, placed
from linkwork.solids.triangles import Triangles, simplified

# Lengths are relative to the mechanism
SHOWN, ANYWHERE = 0.15, 0.6  # around what is drawn above a surface, and where that may be led
FAR = 5.0  # above a surface, or below it, from which on that would make pictures small
EDGE, DOT = 0.004, 0.012  # radii of a line of the ground, and of points without one
ASIDE = 0.5  # part of a normal, or of an axis, in the picture's plane, below which it is not seen


def solids(mechanism: Mechanism, pose: Skeleton) -> list[tuple[str, str, PlacedMesh]]:
    """Return the solids that touch, each with its contact and its body, but for bodies that are
    drawn as shapes."""
    found = []
    for (body, surface), name in once(mechanism).items():
        if body in pose.solids or isinstance(surface, Plane | HeightField):
            continue
        own = frame_pose(pose.poses[body], surface.frame)
        if isinstance(surface, Points):
            size = np.full(3, surface.radius)
            balls = [PlacedMesh(BALL, placed(own, p), own[1], size) for p in surface.points]
            found += [(name, body, ball) for ball in balls]
        else:
            found.append((name, body, piece_of(surface).moved(*own)))
    return found


def solid_parts(found: list[tuple[str, str, PlacedMesh]], size: float) -> Iterator[ScenePart]:
    """Yield these solids, points without a radius as small balls."""
    for name, body, piece in found:
        if not piece.scale.any():
            piece = PlacedMesh(BALL, piece.position, piece.turn, np.full(3, DOT * size))
        yield ScenePart(name, "member", (body,), piece, PALE if body == GROUND else None)


def sheets(
    mechanism: Mechanism,
    poses: Mapping[str, Placed],
    points: np.ndarray,
    size: float,
    shown: bool,
    flat: bool,
) -> Iterator[ScenePart]:
    """Yield planes and fields of heights as far as points (N, 3) lie above or below them, and some
    more; in the plane, where they cut it.

    size: of the mechanism [m]; shown: whether the points are all that is shown, to which those that
        are far do not belong
    """
    room = (SHOWN if shown else ANYWHERE) * size
    for (body, surface), name in once(mechanism).items():
        if not isinstance(surface, Plane | HeightField):
            continue
        origin, turn = frame_pose(poses[body], surface.frame)
        own = (points - origin) @ turn
        reach = np.array([own.min(axis=0) - room, own.max(axis=0) + room])
        heights = np.array(surface.heights) if isinstance(surface, HeightField) else np.zeros(1)
        above, below = reach[0, 2] - heights.max(), heights.min() - reach[1, 2]
        if shown and max(above, below) > FAR * size:
            continue
        form = section(surface, (origin, turn), reach, size) if flat else sheet(surface, reach)
        if form is not None:
            part = ScenePart(name, "floor" if body == GROUND else "plate", (body,), form)
            yield part if flat else part.at({body: (origin, turn)})


def once(mechanism: Mechanism) -> dict[tuple[str, Surface], str]:
    """Return each surface of a body with the name of the first contact that it is in."""
    found: dict[tuple[str, Surface], str] = {}
    for name, contact in mechanism.contacts.items():
        for side in zip(contact.connects, contact.surfaces, strict=True):
            found.setdefault(side, name)
    return found


def sheet(surface: Plane | HeightField, reach: np.ndarray) -> Hull | PlacedMesh:
    """Return a rectangle of a plane, or the cells of a field, in their own axes; reach: least and
    largest coordinates (2, 3) that it has to cover."""
    if isinstance(surface, Plane):
        (left, low, _), (right, high, _) = reach
        corners = [(left, low, 0.0), (right, low, 0.0), (right, high, 0.0), (left, high, 0.0)]
        return Hull.of([np.array(corners)])
    (x, y), heights = grid(surface, reach)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), heights], axis=-1).reshape(-1, 3)
    numbers = np.arange(len(vertices)).reshape(heights.shape)
    a, b, c, d = numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    shown = simplified(Triangles(vertices, faces), FINEST)
    return PlacedMesh(Mesh(shown.vertices, facets=shown.faces, convex=False))


def grid(surface: HeightField, reach: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the places along x and y [m] of the cells of a field that are in reach, one at least,
    and their heights."""
    heights, places, cells = np.array(surface.heights), [], []
    for count, step, low, high in zip(heights.shape, surface.spacing, *reach[:, :2], strict=True):
        first = int(np.clip(np.floor(low / step), 0, count - 2))
        last = int(np.clip(np.ceil(high / step), first + 1, count - 1))
        cells.append(slice(first, last + 1))
        places.append(step * np.arange(first, last + 1))
    return places, heights[tuple(cells)]


def section(
    surface: Plane | HeightField, pose: Placed, reach: np.ndarray, size: float
) -> Bar | None:
    """Return the line in which a surface cuts the plane z = 0, what is solid to its right; None
    where it lies so much in that plane that there is none to be seen."""
    origin, turn = pose
    if isinstance(surface, Plane):
        normal = turn[:2, 2]
        if np.linalg.norm(normal) < ASIDE:
            return None
        along = np.array([normal[1], -normal[0], 0.0]) / np.linalg.norm(normal)
        ways = np.array([(x, y, 0.0) for x in reach[:, 0] for y in reach[:, 1]]) @ turn.T @ along
        return Bar(origin + np.outer([ways.min(), ways.max()], along), EDGE * size)
    if abs(turn[2, 1]) < ASIDE:
        return None
    (x, y), heights = grid(surface, reach)
    across = np.full(x.size, -origin[2] / turn[2, 1])
    z = np.array([np.interp(across[0], y, row) for row in heights])
    line = origin + np.stack([x, across, z], axis=-1) @ turn.T
    return Bar(line if turn[2, 1] < 0 else line[::-1], EDGE * size)
