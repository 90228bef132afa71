"""Cables: the way from point to point, and round spheres and cylinders.

    l = sum over branches 1/divisor (sum of straight parts + sum of arcs)

A surface stands between two points x_0, x_1. In its own frame, in the plane through the centre and
both (a cylinder's: across its axis), the tangents from a point d touch the circle of radius r at

    t = (r^2 d +- r sqrt(d . d - r^2) d') / (d . d),    d' = d turned by 90 degrees

one of each sign: the way between them is r times the angle, and the shorter one is taken. On a
cylinder the way climbs in proportion to its length across the axis. Where the straight line misses
the circle the cable is straight.

Where it is led by a side, it never crosses the half-line from the centre away from the side: where
the straight line does not either, it goes round the shorter way if at all; where it does,
-s = a d_0 + b d_1 with a, b > 0, the cable always goes round the other way.

Where it is led inside, it is bent where the straight line misses the circle, and touches it in one
point, at equal angles to both parts: with A = r/|d_0|, B = r/|d_1|, and G between d_0 and d_1,

    2 a - asin(A sin a) - asin(B sin a) = G,   touched at the angle  a - asin(A sin a)  from d_0

The left side grows with a and is convex, so that Newton's steps from above lead there.

The rate of l is that of the straight parts alone, each between two points that are fixed in their
bodies at the moment: to the first order a taut cable does not change its length by where it
touches. So a unit force along l is a pair of forces at the ends of each straight part.

A cable has no memory of how it is wound. So its rate leaps, and by a side its length, where

    d_0 = -a d_1            the shorter way round is on the other side from there on
    d_i = -a s,  a > 0      by a side: an end passes the half-line behind the surface
    |d_i| = r               an end that the cable is bent next to goes into the surface

A leap of the length is one of what a spring stores, a leap of the rate one of what an inertia
moves. How far a cable is from there (`before_leap`) is the least of  1 + cos of the angle between,
and (|d_i|^2 / r^2 - 1)^2,  smooth and zero at the leap, less what NEAR leaves.

Source: the tangents and their choice are those of MuJoCo 4 (`mju_wrap`), the choice by a side as it
is observed there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from linkwork.equations.algebra import SX, cross, dot, vector
from linkwork.equations.frames import frame_matrix
from linkwork.mechanism import GROUND, Cable, OverCylinder, OverSphere, PulleyBlock, ViaPoint
from linkwork.mechanism.transmissions import acts

TINY = 1e-15  # of lengths and areas that have no direction, in MuJoCo's own units
GRAZING = 1e-6
"""Angle of an arc below zero that is rounding, where a cable hardly touches [rad]: an arc of nearly
a whole turn has tangents that cross."""
ROUNDING = 1e-12  # of the square of a distance: the end of a cable may lie on its drum
STEPS = 12  # of Newton's method inside a circle
NEAR = 1e-3
"""Angle [rad], and share of the radius, at which a cable is as good as where it leaps."""


Places = Callable[[str], tuple[ca.SX, ca.SX]]
"""Give the matrix R_0B (3 x 3) and the origin p_0B (3) of a body's frame by name."""


@dataclass(frozen=True)
class Straight:
    """Hold a straight part: bodies and points of its ends, in the ground's axes, and how much of
    its length counts."""

    bodies: tuple[str, str]
    ends: tuple[ca.SX, ca.SX]
    share: ca.SX

    @property
    def length(self) -> ca.SX:
        return ca.sqrt(ca.sumsqr(self.ends[1] - self.ends[0]) + TINY**2)


@dataclass(frozen=True)
class Way:
    """Hold the way of a cable: its straight parts, and the length of its arcs."""

    straight: tuple[Straight, ...]
    arcs: ca.SX

    @property
    def length(self) -> ca.SX:
        return sum((part.share * part.length for part in self.straight), self.arcs)

    def wrenches(self, place: Places) -> Iterator[tuple[str, ca.SX]]:
        """Yield the unit forces on bodies as wrenches about the origins of their frames."""
        for part in self.straight:
            force = part.share * (part.ends[1] - part.ends[0]) / part.length
            for sign, body, point in zip((-1, 1), part.bodies, part.ends, strict=True):
                if body != GROUND:
                    arm = point - place(body)[1]
                    yield body, ca.vertcat(cross(arm, sign * force), sign * force)


Point = tuple[str, ca.SX]
"""A body, and where a point of it is, in the ground's axes."""


class CableStretch(NamedTuple):
    """Hold a part of a cable between two points, the place in the path of the last one, the surface
    between them, if any, and how much of its length counts."""

    place: int
    ends: tuple[Point, Point]
    surface: OverSphere | OverCylinder | None
    share: float


def stretches(cable: Cable, place: Places) -> Iterator[CableStretch]:
    """Yield a cable's parts between two points."""
    share = 1.0
    before: Point | None = None
    surface: OverSphere | OverCylinder | None = None
    for k, part in enumerate(cable.path):
        if isinstance(part, PulleyBlock):
            before, share = None, 1 / part.divisor
        elif isinstance(part, ViaPoint):
            R, origin = place(part.body)
            here = part.body, origin + ca.mtimes(R, vector(part.point))
            if before is not None:
                yield CableStretch(k, (before, here), surface, share)
            before, surface = here, None
        else:
            surface = part


def way(cable: Cable, place: Places) -> Way:
    """Return the way of a cable."""
    straight: list[Straight] = []
    arcs = SX(0)
    for part in stretches(cable, place):
        if part.surface is None:
            (one, first), (two, last) = part.ends
            straight.append(Straight((one, two), (first, last), SX(part.share)))
        else:
            touched, arc = round_surface(part.surface, place, part.ends, part.share)
            straight += touched
            arcs += arc
    return Way(tuple(straight), arcs)


def round_surface(
    surface: OverSphere | OverCylinder,
    place: Places,
    ends: tuple[Point, Point],
    share: float,
) -> tuple[list[Straight], ca.SX]:
    """Return the straight parts between two points past a surface, and the length of the arc."""
    R, centre, p, axes, s = seen_from(surface, place, ends)
    d = [ca.mtimes(axes.T, point) for point in p]
    # Where it touches; on a cylinder it climbs as it goes.
    if surface.inside:
        t, arc, bent = within(d[0], d[1], surface.radius)
    elif s is None:
        t, arc, bent = circle(d[0], d[1], surface.radius)
    else:
        t, arc, bent = by_side(d[0], d[1], surface.radius, ca.mtimes(axes.T, s))
        if led_inside(surface):
            inner = within(d[0], d[1], surface.radius)
            near = ca.sumsqr(s) < surface.radius**2
            t = tuple(ca.if_else(near, a, b) for a, b in zip(inner[0], t, strict=True))
            arc, bent = (
                ca.if_else(near, a, b) for a, b in zip(inner[1:], (arc, bent), strict=True)
            )
    # The points where it touches, in ground's axes.
    touching = [ca.mtimes(axes, point) for point in t]
    if isinstance(surface, OverCylinder):
        across = [ca.sqrt(ca.sumsqr(a - b) + TINY**2) for a, b in zip(d, t, strict=True)]
        slope = (p[1][2] - p[0][2]) / (across[0] + arc + across[1])
        touching[0][2] = p[0][2] + slope * across[0]
        touching[1][2] = p[1][2] - slope * across[1]
        arc = arc * ca.sqrt(1 + slope**2)
    near, far = (centre + ca.mtimes(R, point) for point in touching)
    (one, first), (two, last) = ends
    # Two straight parts with the arc between them, or one past the surface.
    parts = [
        Straight((one, surface.body), (first, near), share * bent),
        Straight((surface.body, two), (far, last), share * bent),
        Straight((one, two), (first, last), share * (1 - bent)),
    ]
    return parts, share * bent * arc


class Seen(NamedTuple):
    """Hold a surface's axes R and centre in the ground's axes; two points p in its frame, the axes
    (3, 2) of the plane in which a cable between them is bent, and the point of its side."""

    R: ca.SX
    centre: ca.SX
    p: tuple[ca.SX, ca.SX]
    axes: ca.SX
    side: ca.SX | None


def seen_from(surface: OverSphere | OverCylinder, place: Places, ends: tuple[Point, Point]) -> Seen:
    """Return two points as a surface between them sees them."""
    R_body, origin = place(surface.body)
    R = ca.mtimes(R_body, SX(frame_matrix(surface.frame)))
    centre = origin + ca.mtimes(R_body, vector(surface.frame.position))
    first, last = (ca.mtimes(R.T, point - centre) for _, point in ends)
    axes = SX.eye(3)[:, :2] if isinstance(surface, OverCylinder) else bending_plane(first, last)
    if surface.side is None:
        return Seen(R, centre, (first, last), axes, None)
    R_side, p_side = place(surface.side.body)
    s = ca.mtimes(R.T, p_side + ca.mtimes(R_side, vector(surface.side.point)) - centre)
    return Seen(R, centre, (first, last), axes, s)


def led_inside(surface: OverSphere | OverCylinder) -> bool:
    """Whether a surface's side may come so near that it leads the cable inside."""
    return surface.side is not None and surface.side.body != surface.body


class SurfacePassing(NamedTuple):
    """Hold a surface in a cable's path, the points before and behind it, where these are in the
    plane in which the cable is bent, the side there, and that in space."""

    surface: OverSphere | OverCylinder
    ends: tuple[Point, Point]
    first: ca.SX
    last: ca.SX
    side: ca.SX | None
    s: ca.SX | None


def passing(cable: Cable, at: int, place: Places) -> SurfacePassing:
    """Return how a cable passes the surface in a place of its path."""
    stretch = next(part for part in stretches(cable, place) if part.place == at + 1)
    assert stretch.surface is not None
    seen = seen_from(stretch.surface, place, stretch.ends)
    first, last = (ca.mtimes(seen.axes.T, point) for point in seen.p)
    side = None if seen.side is None else ca.mtimes(seen.axes.T, seen.side)
    return SurfacePassing(stretch.surface, stretch.ends, first, last, side, seen.side)


def lined_up(cable: Cable, at: int, place: Places) -> ca.SX:
    """Return a number that changes its sign where a cable's ends are in line with an axis."""
    passed = passing(cable, at, place)
    return turn(passed.first, passed.last)


def before_touching(cable: Cable, at: int, place: Places) -> ca.SX:
    """Return how far the straight way is from a surface that it may miss."""
    passed = passing(cable, at, place)
    first, last, side = passed.first, passed.last, passed.side
    missed = ca.sumsqr(next_to_origin(first, last)) / passed.surface.radius**2 - 1
    return missed if side is None else ca.if_else(is_behind(first, last, side), -1, missed)


def before_leap(cable: Cable, at: int, place: Places) -> ca.SX:
    """Return how far a cable is from where its energy leaps at the surface in a place of its path,
    negative where it is as good as there."""
    surface, ends, first, last, side, s = passing(cable, at, place)
    square = surface.radius**2
    # Where an end of a cable that is bent goes into the surface, or comes out of it.
    free = passes(first, last, surface.radius)
    moving = [d for d, (body, _) in zip((first, last), ends, strict=True) if body != surface.body]
    depth = ca.mmin(ca.vertcat(SX(1), *(entering(d, square) for d in moving)))
    if side is None:
        over = opposed(first, last) if acts(cable.inertia) else SX(1)
    else:
        over = ca.fmin(opposed(first, side), opposed(last, side))
        free = ca.logic_and(free, ca.logic_not(is_behind(first, last, side)))
    over = ca.if_else(outside(first, last, surface.radius), over, 1)
    found = ca.fmin(ca.if_else(free, 1, depth), over)
    if s is None or not led_inside(surface):
        return found
    # Where the side comes near enough to lead it inside.
    near = ca.sumsqr(s) < square
    return ca.fmin(ca.if_else(near, 1, found), entering(s, square))


def opposed(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return 1 + cos of the angle between two directions, less what it is NEAR half a turn."""
    sizes = ca.sqrt(ca.sumsqr(a) * ca.sumsqr(b) + TINY**2)
    return 1 + dot(a, b) / sizes - NEAR**2 / 2


def entering(point: ca.SX, square: float) -> ca.SX:
    """Return how far a point is from a circle or sphere, less what it is NEAR it."""
    return (ca.sumsqr(point) / square - 1) ** 2 - NEAR**2


def bending_plane(first: ca.SX, second: ca.SX) -> ca.SX:
    """Return the axes (3, 2) of the plane through the origin and two points, the first axis towards
    the first; where all are in line, of any such plane."""
    x = first / ca.sqrt(ca.sumsqr(first) + TINY**2)
    across = cross(first, second)
    least = ca.if_else(ca.fabs(x[0]) < 0.6, vector((1.0, 0, 0)), vector((0, 1.0, 0)))
    normal = ca.if_else(ca.sumsqr(across) < TINY**2, cross(x, least), across)
    y = cross(normal, x)
    return ca.horzcat(x, y / ca.sqrt(ca.sumsqr(y) + TINY**4))


def circle(first: ca.SX, last: ca.SX, radius: float) -> tuple[tuple[ca.SX, ca.SX], ca.SX, ca.SX]:
    """Return where a cable from one point of a plane to another touches a circle about the origin,
    the arc between, and whether it is bent (1 or 0)."""
    # The shorter of both ways round, bent where both points are outside and the straight way comes
    # too near.
    ways = [tangents(first, last, radius, sign) for sign in (1, -1)]
    t, arc = chosen(ways, turn(first, last) < 0, radius)
    free = passes(first, last, radius)
    return t, arc, ca.logic_and(outside(first, last, radius), ca.logic_not(free))


def by_side(
    first: ca.SX, last: ca.SX, radius: float, side: ca.SX
) -> tuple[tuple[ca.SX, ca.SX], ca.SX, ca.SX]:
    """Return what `circle` does for a cable that is led by a side of the circle."""
    turned, behind = turn(first, last), is_behind(first, last, side)
    left = ca.if_else(behind, turned, -turned) > 0
    ways = [tangents(first, last, radius, sign) for sign in (1, -1)]
    t, arc = chosen(ways, left, radius)
    free = ca.logic_and(passes(first, last, radius), ca.logic_not(behind))
    return t, arc, ca.logic_and(outside(first, last, radius), ca.logic_not(free))


def is_behind(first: ca.SX, last: ca.SX, side: ca.SX) -> ca.SX:
    """Tell whether the half-line away from a side lies between two points."""
    turned = turn(first, last)
    return ca.logic_and(turned * turn(last, side) > 0, turned * turn(side, first) > 0)


def chosen(
    ways: list[tuple[ca.SX, ca.SX]], left: ca.SX, radius: float
) -> tuple[tuple[ca.SX, ca.SX], ca.SX]:
    """Return the first or the other of both ways round, and its arc."""
    one, other = (ca.if_else(left, a, b) for a, b in zip(*ways, strict=True))
    return (one, other), radius * ca.if_else(left, angle(*ways[0], 1), angle(*ways[1], -1))


def outside(first: ca.SX, last: ca.SX, radius: float) -> ca.SX:
    """Tell whether two points are outside of a circle, or on it, to rounding."""
    least = radius**2 * (1 - ROUNDING)
    return ca.logic_and(ca.sumsqr(first) >= least, ca.sumsqr(last) >= least)


def passes(first: ca.SX, last: ca.SX, radius: float) -> ca.SX:
    """Tell whether the straight way misses a circle, or touches it, to rounding."""
    return ca.sumsqr(next_to_origin(first, last)) > radius**2 * (1 - ROUNDING)


def turn(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return |a| |b| sin of the angle from a to b."""
    return a[0] * b[1] - a[1] * b[0]


def next_to_origin(first: ca.SX, last: ca.SX) -> ca.SX:
    """Return the point next to the origin between two points."""
    gap = last - first
    return first + ca.fmin(ca.fmax(-dot(first, gap) / (ca.sumsqr(gap) + TINY), 0), 1) * gap


def within(first: ca.SX, last: ca.SX, radius: float) -> tuple[tuple[ca.SX, ca.SX], ca.SX, ca.SX]:
    """Return what `circle` does for a cable that is led through the circle."""
    lengths = [ca.sqrt(ca.sumsqr(point) + TINY**2) for point in (first, last)]
    A, B = (ca.fmin(radius / length, 1) for length in lengths)
    turned = turn(first, last)
    G = ca.atan2(ca.fabs(turned), dot(first, last))
    # Newton's steps from above, where the derivative is least at zero.
    a = ca.fmin(G / ca.fmax(2 - A - B, TINY), ca.pi / 2)
    for _ in range(STEPS):
        s, c = ca.sin(a), ca.cos(a)
        slope = sum(X * c / ca.sqrt(ca.fmax(1 - (X * s) ** 2, TINY)) for X in (A, B))
        excess = 2 * a - ca.asin(A * s) - ca.asin(B * s) - G
        a = ca.fmax(a - excess / ca.fmax(2 - slope, TINY), 0)
    # From the first point's direction towards the last one's.
    angle = ca.if_else(turned > 0, 1, -1) * (a - ca.asin(A * ca.sin(a)))
    x, y = (radius / lengths[0] * first[k] for k in range(2))
    touched = ca.vertcat(
        ca.cos(angle) * x - ca.sin(angle) * y, ca.sin(angle) * x + ca.cos(angle) * y
    )
    missed = passes(first, last, radius)
    opposite = ca.logic_and(ca.fabs(turned) < TINY, dot(first, last) < 0)
    bent = ca.logic_and(ca.logic_and(outside(first, last, radius), missed), ca.logic_not(opposite))
    return (touched, touched), SX(0), bent


def tangents(first: ca.SX, last: ca.SX, radius: float, sign: int) -> tuple[ca.SX, ca.SX]:
    """Return where the tangents from two points touch a circle, for one way round."""
    found = []
    for point, turn in ((first, sign), (last, -sign)):
        square = ca.sumsqr(point) + TINY**2
        reach = ca.sqrt(ca.fmax(square - radius**2, TINY**2))
        turned = ca.vertcat(point[1], -point[0])
        found.append((radius**2 * point + turn * radius * reach * turned) / square)
    return found[0], found[1]


def angle(first: ca.SX, last: ca.SX, sign: int) -> ca.SX:
    """Return the angle, from 0 to 2 pi, from one point of a circle to another one way round."""
    turned = sign * turn(first, last)
    found = ca.atan2(-turned, dot(first, last))
    return ca.if_else(found < -GRAZING, found + 2 * ca.pi, found)
