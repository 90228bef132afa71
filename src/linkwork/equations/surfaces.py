"""Where surfaces of two bodies meet: the gap between them and its gradient, as expressions.

flat and ball    of the centre c in the frame of the flat surface z = h(x, y), radius R:
                 g = (c_z - h(c_x, c_y)) - R sqrt(1 + h_x^2 + h_y^2),  exact for a plane;
                 beyond an edge of the field, h_x or h_y under the root fade
round and round  of the nearest points p_1, p_2 of two segments (a ball's is a point):
                 g = |p_2 - p_1| - R_1 - R_2
box and others   of balls, capsules, corners and edges: `boxes`

A field's h is the bicubic spline through its heights, level beyond its edges: in a cell, t in
[0, 1] from its lower corner,
h = w(t_x)^T P w(t_y),  w(t) = ((1 - t)^3, 3 t^3 - 6 t^2 + 4, 3 (t + t^2 - t^3) + 1, t^3) / 6,
P the 4 x 4 coefficients about it.
Nearest points: Ericson, Real-Time Collision Detection, 2005, sec. 5.1.9.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Number, Vector, dot, vector
from linkwork.equations.boxes import on_box, through_box
from linkwork.equations.frames import frame_matrix
from linkwork.equations.meeting import PARALLEL, TINY, Meeting, share
from linkwork.equations.tree import Node, Tree, offset
from linkwork.mechanism.contact import Contact, HeightField, Plane, Points, Surface
from linkwork.mechanism.shapes import Shape

EDGES = [(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit]
"""Ends of a box's edges among its corners."""


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
    elif first.touching.halves or second.touching.halves:
        yield from boxed(tree, nodes, first, second)
        if contact.edges:
            yield from crossing(tree, nodes, first, second)
    else:
        yield between(*(balls(tree, *of) for of in zip(nodes, contact.surfaces, strict=True)))


def boxed(
    tree: Tree, nodes: list[Node], first: Points | Shape, second: Points | Shape
) -> Iterator[Meeting]:
    """Yield the places where a box and another surface may meet: those of the second's points with
    the first one, if that is a box, and of the first's with the second."""
    for box, other, places, exchanged in (
        (first, second, nodes, False),
        (second, first, nodes[::-1], True),
    ):
        if box.touching.halves:
            found = balls(tree, places[1], other)
            whole = [found] if other.touching.round else [[ball] for ball in found]
            for ends in whole:
                meeting = on_box(places[0], box, [end for end, _ in ends], ends[0][1])
                yield meeting.turned() if exchanged else meeting


def crossing(
    tree: Tree, nodes: list[Node], first: Points | Shape, second: Points | Shape
) -> Iterator[Meeting]:
    """Yield the places where the edges of two boxes go through the faces of the other: the second's
    before the first's."""
    for box, other, places, exchanged in (
        (first, second, nodes, False),
        (second, first, nodes[::-1], True),
    ):
        corners = [point for point, _ in balls(tree, places[1], other)]
        for i, j in EDGES:
            meeting = through_box(places[0], box, [corners[i], corners[j]])
            yield meeting.turned() if exchanged else meeting


def balls(tree: Tree, node: Node, surface: Surface) -> list[tuple[ca.SX, Number]]:
    """Return the middles of a surface's balls in the ground's axes, and their radius."""
    assert not isinstance(surface, Plane | HeightField)
    R, touching = frame_matrix(surface.frame), surface.touching
    position = vector(surface.frame.position)
    local = [position + product(R, vector(point)) for point in touching.points]
    return [(SX(tree.point(node, point)), touching.radius) for point in local]


def product(R: Vector, local: Vector) -> Vector:
    """Return R times a constant vector."""
    return ca.mtimes(SX(R), SX(local)) if isinstance(local, SX) or isinstance(R, SX) else R @ local


def on_flat(
    tree: Tree, node: Node, surface: Plane | HeightField, centre: ca.SX, radius: Number
) -> Meeting:
    """Return where a ball meets a flat surface of a node's body."""
    # The centre in the surface's frame.
    frame = surface.frame
    R = ca.mtimes(node.R.matrix, SX(frame_matrix(frame)))
    origin = node.O + offset(node, vector(frame.position))
    local = ca.mtimes(R.T, centre - origin)
    if isinstance(surface, Plane):
        gap, up = local[2] - radius, SX([0.0, 0.0, 1.0])
        return Meeting(gap, centre, R[:, 2], centre - (radius + gap / 2) * R[:, 2], R[:, 2])
    # Gap and slopes of a field at symbols, and then at the centre, with what belongs to its cell.
    c, u, P = SX.sym("c", 3), SX.sym("u", 2), SX.sym("P", 4, 4)
    cell, h = cell_at(surface, c[:2]), spline(P, u)
    slopes = ca.gradient(h, u) / SX(np.array(surface.spacing))
    h, slopes = ca.substitute([h, slopes], [u], [cell.t])
    # Those at an edge fade within a cell beyond it, so that what is made of them does not leap.
    slopes *= ca.fmax(1 - cell.beyond**2, 0) ** 2
    gap = c[2] - h - radius * ca.sqrt(1 + ca.sumsqr(slopes))
    tilted = ca.vertcat(-ca.gradient(h, c)[:2], 1)
    up = tilted / ca.norm_2(tilted)
    found = ca.substitute([gap, up, ca.gradient(gap, c)], [P], [cell.P])
    gap, up, along = ca.substitute(found, [c], [local])
    normal = ca.mtimes(R, up)
    return Meeting(gap, centre, ca.mtimes(R, along), centre - (radius + gap / 2) * normal, normal)


class Cell(NamedTuple):
    """Tell where a place (2), held within the edges of a field, is in its cell, how far beyond them
    it is, in cells, and the coefficients about that cell (4, 4)."""

    t: ca.SX
    beyond: ca.SX
    P: ca.SX


def cell_at(field: HeightField, c: ca.SX) -> Cell:
    """Return the cell of a field at a place (2)."""
    cells, counts = c / SX(np.array(field.spacing)), SX(np.shape(field.heights))
    inside = ca.fmin(ca.fmax(cells, 0), counts - 1)
    cell = ca.fmin(ca.floor(inside), counts - 2)
    z = vector([number for row in field.heights for number in row])
    table = ca.reshape(z if isinstance(z, SX) else ca.DM(z), *np.shape(field.heights)[::-1]).T
    across, along = (ca.DM(through(count)) for count in table.shape)
    rows = four(ca.mtimes([across, table, along.T]), cell[0])
    return Cell(inside - cell, cells - inside, four(rows.T, cell[1]).T)


def four(rows: ca.DM | ca.SX, start: ca.SX) -> ca.SX:
    """Return four rows from a start on. As that steps, derivatives do not go through all others."""
    for bit in reversed(range((rows.shape[0] - 4).bit_length())):
        step = 1 << bit
        count = min(step + 3, rows.shape[0] - step)
        chosen = ca.if_else(start >= step, rows[step : step + count, :], rows[:count, :])
        rows, start = ca.vertcat(chosen, rows[count : step + 3, :]), start - step * (start >= step)
    return SX(rows)


def spline(P: ca.SX, t: ca.SX) -> ca.SX:
    """Return h at t (2) in a cell."""
    across, along = (
        ca.vertcat((1 - x) ** 3, 3 * x**3 - 6 * x**2 + 4, 3 * (x + x**2 - x**3) + 1, x**3) / 6
        for x in (t[0], t[1])
    )
    return ca.mtimes([across.T, P, along])


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
        (first[0][1], second[0][1]),
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
