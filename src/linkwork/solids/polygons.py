"""Polygons of OBJ files, cut into triangles as MuJoCo's reader of such files does it, for a polygon
that is not flat encloses another volume by each way to cut it.

Four corners are cut along the shorter diagonal. Of more, ears are cut off one by one: from the
first corner on, in the plane of two axes, a triangle of three neighbours that turns as its first
side does about the origin, and that holds no other corner. What no ear is left of is left out.
Single precision, as there.

Source: github.com/tinyobjloader/tinyobjloader, tiny_obj_loader.h, what it does; MuJoCo 4.0.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

FLAT = np.finfo(np.float32).eps  # of cross products: corners below it tell no plane
MOST = 100  # corners


def in_triangles(content: bytes) -> bytes:
    """Return the text of an OBJ file with every polygon of more than three corners in triangles;
    one of points that are not there stays, to be told of by what reads the text."""
    told = [line.split() for line in content.splitlines()]
    points = [words[1:4] for words in told if words[:1] == [b"v"]]
    lines, so_far = [], 0
    for words in told:
        so_far += words[:1] == [b"v"]
        if words[:1] != [b"f"] or len(words) < 5:
            lines.append(b" ".join(words))
            continue
        corners = words[1:]
        try:
            numbers = [int(corner.split(b"/")[0]) for corner in corners]
            places = [points[k - 1 if k > 0 else so_far + k] for k in numbers]
            cut = triangles_of(np.array(places, dtype=np.float32))
        except (ValueError, IndexError):
            cut = [tuple(range(len(corners)))]
        lines += [b"f " + b" ".join(corners[k] for k in each) for each in cut]
    return b"\n".join(lines)


def triangles_of(corners: np.ndarray) -> list[tuple[int, ...]]:
    """Return the triangles, as numbers of corners, of a polygon's corners (k, 3), k > 3."""
    if len(corners) > MOST:
        return []
    if len(corners) > 4:
        return list(ears(corners[:, axes_of(corners)]))
    a, b, c, d = corners
    if ((c - a) ** 2).sum() < ((d - b) ** 2).sum():
        return [(0, 1, 2), (0, 2, 3)]
    return [(0, 1, 3), (1, 2, 3)]


def axes_of(corners: np.ndarray) -> list[int]:
    """Return the two axes whose plane the first proper corner lies in most."""
    sides = np.roll(corners, -1, axis=0) - corners
    crosses = np.abs(np.cross(sides, np.roll(sides, -1, axis=0)))
    proper = np.flatnonzero((crosses > FLAT).any(axis=1))
    if not len(proper):
        return [1, 2]
    x, y, z = crosses[proper[0]]
    if x > y and x > z:
        return [1, 2]
    return [0, 1] if z > x and z > y else [0, 2]


def ears(corners: np.ndarray) -> Iterator[tuple[int, ...]]:
    """Yield the triangles that are cut off a polygon in the plane, (k, 2), one after the other."""
    left, at, tries = list(range(len(corners))), 0, len(corners)
    while len(left) > 3 and tries > 0:
        at %= len(left)
        turned = left[at:] + left[:at]
        a, b, c = (corners[k] for k in turned[:3])
        turns = crossed(b - a, c - b) * crossed(a, b)
        if turns < 0 or any(inside(corners[k], (a, b, c)) for k in islice(turned, 3, None)):
            at, tries = at + 1, tries - 1
            continue
        yield turned[0], turned[1], turned[2]
        left.remove(turned[1])
        tries = len(left)
    if len(left) == 3:
        yield left[0], left[1], left[2]


def crossed(a: np.ndarray, b: np.ndarray) -> float:
    """Return the cross product of two vectors of the plane."""
    return a[0] * b[1] - a[1] * b[0]


def inside(point: np.ndarray, triangle: tuple[np.ndarray, ...]) -> bool:
    """Tell whether a ray from a point crosses the sides of a triangle an odd number of times."""
    odd = False
    for a, b in zip(triangle, (triangle[-1], *triangle[:-1]), strict=True):
        if (a[1] > point[1]) != (b[1] > point[1]):
            odd ^= bool(point[0] < (b[0] - a[0]) * (point[1] - a[1]) / (b[1] - a[1]) + a[0])
    return odd
