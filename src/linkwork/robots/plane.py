"""What planar robots are made of: triangles, thin rods, and the point where two links meet."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt

from linkwork.mechanism import Body, Inertia, MechanismError

Point = tuple[float, float]

AZIMUTHS = (7 * pi / 6, 11 * pi / 6, pi / 2)  # of a triangle's vertices, seen from its middle [rad]


def meet(p: Point, a: float, q: Point, b: float, side: int, what: str) -> Point:
    """Return the point at the distance a from p and b from q, left (side = 1) or right (-1) of the
    line from p to q.

    With d = |q - p| and its direction e, n = z x e:  p + u e + side sqrt(a^2 - u^2) n,  u =
    (d^2 + a^2 - b^2) / (2 d).

    Args:
        p, q: the two centres [m].
        a, b: the two distances [m].
        side: 1 or -1.
        what: names the two links in the refusal.

    Raises:
        MechanismError: the links cannot meet.
    """
    dx, dy = q[0] - p[0], q[1] - p[1]
    d = hypot(dx, dy)
    if not abs(a - b) < d < a + b:
        raise MechanismError(
            f"{what} of {a:.6g} m and {b:.6g} m do not meet over a distance of {d:.6g} m; "
            "it must lie between the difference and the sum of their lengths"
        )
    u = (d**2 + a**2 - b**2) / (2 * d)
    h = side * sqrt(a**2 - u**2)
    return p[0] + (u * dx - h * dy) / d, p[1] + (u * dy + h * dx) / d


def corners(base: float) -> tuple[Point, Point, Point]:
    """Return the corners of an equilateral triangle that stands on the x axis [m]."""
    return (0.0, 0.0), (base, 0.0), (base / 2, sqrt(3) / 2 * base)


def vertices(radius: float) -> tuple[Point, ...]:
    """Return the vertices of a triangle parallel to the base's, seen from its middle [m]."""
    return tuple((radius * cos(a), radius * sin(a)) for a in AZIMUTHS)


def uniform_rod(mass: float, length: float) -> Body:
    """Return a thin rod from the origin along x, for motion in the plane: m l^2 / 12 about its
    middle."""
    return Body(
        mass=mass, centre_of_mass=(length / 2, 0, 0), inertia=Inertia(zz=mass * length**2 / 12)
    )
