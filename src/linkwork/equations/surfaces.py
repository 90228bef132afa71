"""Where surfaces of two bodies meet: the gap between them and its gradient, as expressions.

flat and ball    of the centre c in the frame of the flat surface z = h(x, y), radius R:
                 g = (c_z - h(c_x, c_y)) - R sqrt(1 + h_x^2 + h_y^2),  exact for a plane
round and round  of the nearest points p_1, p_2 of two segments (a ball's is a point):
                 g = |p_2 - p_1| - R_1 - R_2

A field's h is the bicubic spline through its heights, with the basis
B(s) = max(2 - |s|, 0)^3 / 6 - 2 max(1 - |s|, 0)^3 / 3  of width 4, and level beyond its edges.
Nearest points: Ericson, Real-Time Collision Detection, 2005, sec. 5.1.9.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Number, Vector, dot, rotation_matrix, vector
from linkwork.equations.tree import Node, Tree, offset
from linkwork.mechanism.contact import Contact, HeightField, Plane, Surface

TINY = 1e-300  # square of a distance that is not divided by zero
PARALLEL = 1e-12  # square of the sine between segments that count as parallel


@dataclass(frozen=True)
class Meeting:
    """Hold a place where two surfaces may meet, in the ground's axes: how far they are apart.

    centre: where the force acts that presses, along the `gradient` of the gap for a motion of the
        second body there; point: where they rub, and the unit `normal` there, out of the first body
    """

    gap: ca.SX
    centre: ca.SX
    gradient: ca.SX
    point: ca.SX
    normal: ca.SX

    def turned(self) -> Meeting:
        """Return the place with both bodies exchanged."""
        return Meeting(self.gap, self.centre, -self.gradient, self.point, -self.normal)


def meetings(tree: Tree, contact: Contact) -> Iterator[Meeting]:
    """Yield the places where the surfaces of a contact may meet."""
    nodes = [tree.node(body) for body in contact.connects]
    first, second = contact.surfaces
    if isinstance(first, Plane | HeightField):
        for centre, radius in balls(tree, nodes[1], second):
            yield on_flat(tree, nodes[0], first, centre, radius)
    elif isinstance(second, Plane | HeightField):
        for centre, radius in balls(tree, nodes[0], first):
            yield on_flat(tree, nodes[1], second, centre, radius).turned()
    else:
        yield between(*(balls(tree, *of) for of in zip(nodes, contact.surfaces, strict=True)))


def balls(tree: Tree, node: Node, surface: Surface) -> list[tuple[ca.SX, Number]]:
    """Return the middles of a surface's balls in the ground's axes, and their radius."""
    assert not isinstance(surface, Plane | HeightField)
    R, touching = rotation_matrix(surface.frame.rotation), surface.touching
    position = vector(surface.frame.position)
    local = [position + product(R, vector(point)) for point in touching.points]
    return [(SX(tree.point(node, point)), touching.radius) for point in local]


def product(R: np.ndarray, local: Vector) -> Vector:
    """Return R times a constant vector."""
    return ca.mtimes(SX(R), local) if isinstance(local, SX) else R @ local


def on_flat(
    tree: Tree, node: Node, surface: Plane | HeightField, centre: ca.SX, radius: Number
) -> Meeting:
    """Return where a ball meets a flat surface of a node's body."""
    # The centre in the surface's frame.
    frame = surface.frame
    R = ca.mtimes(node.R.matrix, SX(rotation_matrix(frame.rotation)))
    origin = node.O + offset(node, vector(frame.position))
    local = ca.mtimes(R.T, centre - origin)
    if isinstance(surface, Plane):
        gap, up = local[2] - radius, SX([0.0, 0.0, 1.0])
        return Meeting(gap, centre, R[:, 2], centre - (radius + gap / 2) * R[:, 2], R[:, 2])
    # Gap and slopes of a field at symbols, and then at the centre.
    c = SX.sym("c", 3)
    h = height(surface, c[0], c[1])
    slopes = ca.gradient(h, c)
    steep = ca.sqrt(1 + ca.sumsqr(slopes[:2]))
    gap = c[2] - h - radius * steep
    up = ca.vertcat(-slopes[:2], 1) / steep
    gap, up, along = ca.substitute([gap, up, ca.gradient(gap, c)], [c], [local])
    normal = ca.mtimes(R, up)
    return Meeting(gap, centre, ca.mtimes(R, along), centre - (radius + gap / 2) * normal, normal)


def height(field: HeightField, x: ca.SX, y: ca.SX) -> ca.SX:
    """Return the spline through a field's heights at x, y."""
    table = ca.vertcat(*(ca.horzcat(*row) for row in field.heights))
    weights = [
        basis(ca.fmin(ca.fmax(s / step, 0), count - 1), count)
        for s, step, count in zip((x, y), field.spacing, np.shape(field.heights), strict=True)
    ]
    across, along = (SX(through(count)) for count in np.shape(field.heights))
    knots = ca.mtimes([across, SX(table), along.T])
    return ca.mtimes([weights[0].T, knots, weights[1]])


def basis(s: ca.SX, count: int) -> ca.SX:
    """Return the basis splines (count + 2) about the places -1 ... count at s."""
    far = [ca.fabs(s - place) for place in range(-1, count + 1)]
    return ca.vertcat(*[ca.fmax(2 - d, 0) ** 3 / 6 - 2 * ca.fmax(1 - d, 0) ** 3 / 3 for d in far])


def through(count: int) -> np.ndarray:
    """Return the coefficients (count + 2, count) of the basis splines through unit values at the
    places, without curvature at both ends."""
    A = np.zeros((count + 2, count + 2))
    for i in range(count):
        A[1 + i, i : i + 3] = 1 / 6, 2 / 3, 1 / 6
    A[0, :3] = A[-1, -3:] = 1, -2, 1
    return np.linalg.inv(A)[:, 1:-1]


def between(first: list[tuple[ca.SX, Number]], second: list[tuple[ca.SX, Number]]) -> Meeting:
    """Return where two bodies meet, each a ball or all between two balls."""
    (p, q), radii = (
        nearest([end for end, _ in first], [end for end, _ in second]),
        (
            first[0][1],
            second[0][1],
        ),
    )
    apart = q - p
    distance = ca.sqrt(ca.sumsqr(apart) + TINY)
    normal, gap = apart / distance, distance - radii[0] - radii[1]
    point = p + (radii[0] + gap / 2) * normal
    return Meeting(gap, point, normal, point, normal)


def nearest(first: list[ca.SX], second: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return the nearest points of two segments, either of which may be a point."""
    a, b = first[0], second[0]
    if len(first) == len(second) == 1:
        return a, b
    if len(first) == 1:
        return a, on_segment(second, a)
    if len(second) == 1:
        return on_segment(first, b), b
    d, e, r = first[1] - a, second[1] - b, a - b
    dd, ee, de, dr, er = dot(d, d), dot(e, e), dot(d, e), dot(d, r), dot(e, r)
    s = share((de * er - dr * ee) / (dd * ee - de**2 + PARALLEL * dd * ee))
    t = share((de * s + er) / ee)
    s = share((de * t - dr) / dd)
    return a + s * d, b + t * e


def on_segment(ends: list[ca.SX], p: ca.SX) -> ca.SX:
    """Return the point of a segment that is nearest to a point."""
    d = ends[1] - ends[0]
    return ends[0] + share(dot(p - ends[0], d) / dot(d, d)) * d


def share(s: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(s, 0), 1)
