"""Moments of mass of order 0, 1 and 2 about a node's origin, and their regrouping along a tree.

A body that turns on its parent acts on it through its mass only as a point mass at the joint, so
this mass is moved into the parent once and for all, and the recursions carry first and second
moments alone; a body fixed to its parent is moved into it whole.
Source: Khalil & Dombre 2002, ch. 9 (regrouping).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Number, Vector, inner, outer, present, vector
from linkwork.equations.orientation import Orientation
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


def turned_inertia(inertia: Vector, R: Orientation) -> ca.SX:
    """Return R I R' from the principal moments: I_b 1 + (I_a - I_b) a a' + (I_c - I_b) c c'.

    a, c are two principal axes in R's axes; where two moments are equal one of them is not needed.
    Where a number of I is free the product is formed as it stands.
    """
    if not present(inertia):
        return SX(3, 3)
    if isinstance(inertia, SX):
        return ca.densify(ca.mtimes([R.near, inertia, R.near.T]))
    if np.count_nonzero(inertia - np.diag(np.diagonal(inertia))) == 0:
        values, axes = np.diagonal(inertia), np.eye(3)
    else:
        values, axes = np.linalg.eigh(inertia)
    middle = int(np.argsort(values)[1])
    result = values[middle] * SX.eye(3)
    for value, axis in zip(values, axes.T, strict=True):
        if abs(value - values[middle]) > 1e-15 * np.max(np.abs(values)):
            a = R.turned(axis)
            result += (value - values[middle]) * ca.mtimes(a, a.T)
    return ca.densify(result)


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


Link = tuple[Moments, int, Vector | None, Vector | None]


def regrouped(links: Sequence[Link]) -> list[Moments]:
    """Move masses into parents: a turning link's as a point at the joint, a fixed link's moments
    whole.

    links: moments, index of the parent (-1: ground), position in the parent where constant,
    orientation where fixed
    """
    moments = [own for own, *_ in links]
    for index in reversed(range(len(links))):
        _, parent, arm, weld = links[index]
        if arm is None:
            continue
        own = moments[index]
        if weld is not None:
            passed, kept = own.moved(weld, arm), Moments.none()
        else:
            point = Moments(own.m, np.zeros(3), np.zeros((3, 3)))
            passed, kept = point.moved(np.eye(3), arm), Moments(0.0, own.h, own.I)
        moments[index] = kept
        if parent >= 0:
            moments[parent] = moments[parent] + passed
    return moments
