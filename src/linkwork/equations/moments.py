"""Moments of mass of order 0, 1 and 2 about a node's origin."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations.algebra import Number, Vector, inner, outer, vector
from linkwork.equations.orientation import Orientation
from linkwork.equations.turned_inertia import turned_inertia
from linkwork.mechanism import Body, Inertia


@dataclass(frozen=True)
class Moments:
    """Hold mass m, first moment h = m c and inertia I about a node's origin, constant in the node's
    axes."""

    m: Number
    h: Vector
    I: Vector  # noqa: E741

    @classmethod
    def none(cls) -> Moments:
        return cls(0.0, np.zeros(3), np.zeros((3, 3)))

    @classmethod
    def of_body(cls, body: Body, origin: Vector) -> Moments:
        """Refer a body's inertia to a point of it (body's frame and axes): I_O = I_C + m
        (c.c 1 - c c')."""
        c = vector(body.centre_of_mass) - origin
        return cls(body.mass, body.mass * c, tensor(body.inertia) + body.mass * steiner(c))

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.m + other.m, self.h + other.h, self.I + other.I)

    def moved(self, R: Vector, r: Vector) -> Moments:
        """Refer to a frame in which this one's axes are R and its origin is at r, both constant."""
        h, inertia = R @ self.h, R @ self.I @ R.T
        cross_terms = 2 * inner(r, h) * np.eye(3) - outer(r, h) - outer(h, r)
        return Moments(self.m, h + self.m * r, inertia + cross_terms + self.m * steiner(r))

    def turned(self, R: Orientation) -> tuple[Number, ca.SX, ca.SX]:
        """Return m, h, I of this node in the axes in which R gives it."""
        return self.m, R.turned(self.h), turned_inertia(self.I, R)


def tensor(inertia: Inertia) -> Vector:
    """Return the 3 x 3 tensor; the elements that a planar body leaves out are zero."""
    xx, yy = (0.0 if moment is None else moment for moment in (inertia.xx, inertia.yy))
    rows = (
        (xx, inertia.xy, inertia.xz),
        (inertia.xy, yy, inertia.yz),
        (inertia.xz, inertia.yz, inertia.zz),
    )
    values = vector([element for row in rows for element in row])
    return values.reshape((3, 3))


def steiner(c: Vector) -> Vector:
    return inner(c, c) * np.eye(3) - outer(c, c)
