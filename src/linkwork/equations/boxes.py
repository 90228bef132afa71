"""Where a box meets balls, capsules and corners: the gap to its surface and its gradient.

With d = |c| - h of a point c in the box's frame, h half its lengths, the distance from the box is

    |max(d, 0)| + min(max(d_x, d_y, d_z), 0),    gap  of a ball about c: that less its radius

A capsule's middle line p(s) = a + s b is nearest to a box where, with e(s) = p - clip(p, -h, h),

    F(s) = b . e(s) = 0,

half the slope of the squared distance. F never falls and is straight between the s at which p
passes a face: between the last of these with F <= 0 and the first with F >= 0 its zero is exact.

An edge has the depth of the middle c of its part within the box, of the distances d_f to its faces

    1 / sqrt(sum_f 1 / d_f^2)

which is d_f where one face is near, and half the distance of both lines, for any directions, where
the edge comes in by one of two faces and leaves by the other, so crosses the edge between these:
with the slopes b_1, b_2 against their normals and the part's length t, d_f = b_f t / 2 at c, and
the lines are b_1 b_2 t / sqrt(b_1^2 + b_2^2) apart. It has no leap, as c has none: not where edges
are parallel, nor where one lies in a face. What it depends on are both ends of the edge, so that
the force has a moment about c.
"""

from __future__ import annotations

from itertools import permutations

import casadi as ca

from linkwork.equations.algebra import SX, Number, cross, dot, vector
from linkwork.equations.frames import frame_matrix
from linkwork.equations.meeting import PARALLEL, TINY, Meeting, share
from linkwork.equations.tree import Node, offset
from linkwork.mechanism.contact import Points
from linkwork.mechanism.shapes import Shape


def on_box(node: Node, box: Points | Shape, ends: list[ca.SX], radius: Number) -> Meeting:
    """Return where a ball about a point, or a capsule between two, meets a box of a node's body."""
    R, origin, h = seat(node, box)
    local = [ca.mtimes(R.T, end - origin) for end in ends]
    c = local[0] if len(local) == 1 else nearest_to_box(local[0], local[1] - local[0], h)
    centre = origin + ca.mtimes(R, c)
    # The gap and its gradient at a symbol, and then at the point.
    x = SX.sym("x", 3)
    gap = distance(x, h) - radius
    gap, along = ca.substitute([gap, ca.gradient(gap, x)], [x], [c])
    normal = ca.mtimes(R, along)
    return Meeting(gap, centre, normal, centre - (radius + gap / 2) * normal, normal)


def through_box(node: Node, box: Points | Shape, ends: list[ca.SX]) -> Meeting:
    """Return where the edge between two points goes through a box of a node's body."""
    R, origin, h = seat(node, box)
    a, end = (ca.mtimes(R.T, end - origin) for end in ends)
    b = end - a
    # Where it enters and leaves, the faces by their normals over the slope of b against them.
    ahead = ca.copysign(1, b)
    steep = ca.fmax(ca.fabs(b), ca.sqrt(PARALLEL * dot(b, b)))
    slope, behind, before = 1 / steep, h + ahead * a, h - ahead * a
    enters, leaves = -behind * slope, before * slope
    low, high = ca.mmax(enters), ca.mmin(leaves)
    faces = []
    for found, face in ((enters, low), (leaves, high)):
        passed = ca.logic_and(found == face, ca.logic_and(found > 0, found < 1))
        faces.append(passed * slope * ahead / ca.fmax(ca.sum1(passed), 1))
    low, high = share(low), share(high)
    # The middle; how deep it is there, with the slope of that.
    c = a + (low + high) / 2 * b
    deep, uphill = depth(c, h)
    # It moves with the box's faces: forces at the middle and at both ends of the part within.
    half = dot(uphill, b) / 2
    gradient = ca.mtimes(R, half * (faces[0] + faces[1]) - uphill)
    couple = ca.mtimes(R, (high - low) / 2 * half * cross(b, faces[1] - faces[0]))
    centre = origin + ca.mtimes(R, c)
    normal = gradient / ca.sqrt(ca.sumsqr(gradient) + TINY)
    gap = apart(behind, before, steep) - deep
    return Meeting(gap, centre, gradient, centre, normal, couple)


def seat(node: Node, box: Points | Shape) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return a box's axes and middle in the ground's, and half its lengths."""
    R = ca.mtimes(node.R.matrix, SX(frame_matrix(box.frame)))
    origin = node.O + offset(node, vector(box.frame.position))
    return R, origin, SX(vector(box.touching.halves))


def apart(behind: ca.SX, before: ca.SX, steep: ca.SX) -> ca.SX:
    """Return by how much, at least, the points of a line s from 0 to 1 are beyond a face of a box;
    0 where it meets the box.

    They are behind + steep s before the faces where it enters and before - steep s before those
    where it leaves: of the greatest of the least the two that bound it tell it.
    """
    bounds = [behind + steep, before]
    for i, j in permutations(range(3), 2):
        crossing = behind[i] * steep[j] + before[j] * steep[i]
        bounds.append(crossing / (steep[i] + steep[j]))
    return ca.fmax(-ca.mmin(ca.vertcat(*bounds)), 0)


def depth(c: ca.SX, h: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return 1 / sqrt(sum of 1 / d^2) of the distances d of a point within a box from its faces,
    hardly anything without, and the gradient."""
    square = ca.fmin(c**2, h**2)
    both = 1 / ca.fmax(h**2 - square, PARALLEL * h**2)  # 1 / (h - c) (h + c)
    found = 1 / ca.sqrt(ca.sum1(2 * (h**2 + square) * both**2))
    return found, -2 * found**3 * c * (3 * h**2 + square) * both**3


def distance(c: ca.SX, h: ca.SX) -> ca.SX:
    """Return how far a point is from a box, negative within."""
    d = ca.fabs(c) - h
    beyond = ca.fmax(d, 0)
    within = ca.fmin(ca.fmax(d[0], ca.fmax(d[1], d[2])), 0)
    return ca.sqrt(ca.sumsqr(beyond) + TINY) + within


def nearest_to_box(a: ca.SX, b: ca.SX, h: ca.SX) -> ca.SX:
    """Return the point of the line a + s b, s from 0 to 1, that is nearest to a box; the middle of
    those that are equally near."""

    def slope(s: Number) -> ca.SX:
        p = a + s * b
        return dot(b, p - ca.fmin(ca.fmax(p, -h), h))

    size, low, high = dot(b, b), SX(0), SX(1)
    for i in range(3):
        along = ca.if_else(ca.fabs(b[i]) <= PARALLEL * ca.sqrt(size), 1, b[i])
        for face in (-h[i], h[i]):
            s = share((face - a[i]) / along)
            F = slope(s)
            low = ca.fmax(low, ca.if_else(F <= 0, s, 0))
            high = ca.fmin(high, ca.if_else(F >= 0, s, 1))
    low = ca.fmax(low, ca.if_else(slope(1) <= 0, 1, 0))
    high = ca.fmin(high, ca.if_else(slope(0) >= 0, 0, 1))
    before, after, least = slope(low), slope(high), PARALLEL * size
    s = low + share((least - before) / (after - before + 2 * least)) * (high - low)
    return a + s * b
