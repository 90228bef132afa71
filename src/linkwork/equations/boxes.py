"""Where a box meets balls, capsules and corners: the gap to its surface and its gradient.

With d = |c| - h of a point c in the box's frame, h half its lengths, the distance from the box is

    |max(d, 0)| + min(max(d_x, d_y, d_z), 0),    gap  of a ball about c: that less its radius

A capsule's middle line p(s) = a + s b is nearest to a box where, with e(s) = p - clip(p, -h, h),

    F(s) = b . e(s) = 0,

half the slope of the squared distance. F never falls and is straight between the s at which p
passes a face: between the last of these with F <= 0 and the first with F >= 0 its zero is exact.
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations.algebra import SX, Number, dot, vector
from linkwork.equations.frames import frame_matrix
from linkwork.equations.meeting import PARALLEL, TINY, Meeting, share
from linkwork.equations.tree import Node, offset
from linkwork.mechanism.contact import Points
from linkwork.mechanism.shapes import Shape


def on_box(node: Node, box: Points | Shape, ends: list[ca.SX], radius: Number) -> Meeting:
    """Return where a ball about a point, or a capsule between two, meets a box of a node's body."""
    R = ca.mtimes(node.R.matrix, SX(frame_matrix(box.frame)))
    origin = node.O + offset(node, vector(box.frame.position))
    h = SX(vector(box.touching.halves))
    local = [ca.mtimes(R.T, end - origin) for end in ends]
    c = local[0] if len(local) == 1 else nearest_to_box(local[0], local[1] - local[0], h)
    centre = origin + ca.mtimes(R, c)
    # The gap and its gradient at a symbol, and then at the point.
    x = SX.sym("x", 3)
    gap = distance(x, h) - radius
    gap, along = ca.substitute([gap, ca.gradient(gap, x)], [x], [c])
    normal = ca.mtimes(R, along)
    return Meeting(gap, centre, normal, centre - (radius + gap / 2) * normal, normal)


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
