"""Motion laws: how one coordinate goes from rest to rest in the least time that limits of its
speed, acceleration and jerk allow, in closed form.

S-curve, phases of constant jerk +J, 0, -J, 0, -J, 0, +J of durations t_j, t_a, t_j, t_v, t_j, t_a,
t_j: the time-optimal motion under all three limits (Biagiotti & Melchiorri, Trajectory Planning for
Automatic Machines and Robots, 2008, sec. 3.4),

    t_j = min(A / J, (V / J)^(1/2), (D / 2 J)^(1/3)),
    t_a = min(V / A - t_j, (-3 t_j + (t_j^2 + 4 D / A)^(1/2)) / 2)  where  t_j = A / J, else 0,
    t_v = what is left of D, at the speed that is reached then.

Trapezoidal, of the speed: the same for J -> inf. The other laws have a fixed shape s(tau), tau =
t / T, with the peaks p_1, p_2, p_3 of its derivatives:

    T = max(p_1 D / V, (p_2 D / A)^(1/2), (p_3 D / J)^(1/3)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from math import comb, cos, factorial, inf, isfinite, pi, sin, sqrt

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.motions.profiles import Profile, pieces, taylor

Limit = float | Sequence[float] | Mapping[str, float] | None
MotionLaw = Callable[..., Profile]
KINDS = ("speed", "acceleration", "jerk")
SINE_PIECES, SINE_DEGREE = 8, 17
"""Of a cycloid: on each piece its Taylor polynomial is exact to rounding, (pi / 4)^18 / 18! =
2e-18."""


@dataclass(frozen=True)
class AxisLimits:
    """Limit the speed, acceleration and jerk of coordinates; None: no limit.

    Args:
        speed: V [m/s, rad/s]: one number for all, one for each coordinate in their order, or by
            name.
        acceleration: A [m/s^2, rad/s^2], jerk: J [m/s^3, rad/s^3], likewise.

    Raises:
        LinkworkError: a limit that is no positive finite number; no limit at all.
    """

    speed: Limit = None
    acceleration: Limit = None
    jerk: Limit = None

    def __post_init__(self) -> None:
        if all(getattr(self, kind) is None for kind in KINDS):
            raise LinkworkError(
                "no limit is given; a motion of least duration needs one of speed, acceleration "
                "or jerk"
            )
        for kind in KINDS:
            value = getattr(self, kind)
            if isinstance(value, Mapping):
                for name, part in value.items():
                    checks.positive(part, f"the {kind} limit of {name!r}")
            elif value is not None:
                many = np.ravel(checks.finite(value, f"the {kind} limit")).tolist()
                for k, part in enumerate(many):
                    place = f" of coordinate {k}" if np.ndim(value) else ""
                    checks.positive(part, f"the {kind} limit{place}")

    def of(self, names: Sequence[str], count: int) -> np.ndarray:
        """Return V, A, J (3, count) of coordinates, infinite where there is no limit.

        names: of the coordinates, none of a tool's pose.
        """
        return np.array([self._each(kind, names, count) for kind in KINDS])

    def _each(self, kind: str, names: Sequence[str], count: int) -> np.ndarray:
        value = getattr(self, kind)
        if value is None:
            return np.full(count, inf)
        if isinstance(value, Mapping):
            if not names:
                raise LinkworkError(
                    f"the {kind} limits of a tool's pose are given by name; give one number, or "
                    f"{count} in the order of its coordinates"
                )
            checks.known(value, names, "coordinate", f" with a {kind} limit")
            return np.array([float(value.get(name, inf)) for name in names])
        given = np.asarray(value, float)
        if given.shape not in ((), (count,)):
            raise LinkworkError(
                f"the {kind} limits are {checks.shown(value)}; give one number, or {count}"
            )
        return np.broadcast_to(given, (count,)).copy()


def s_curve(
    distance: float,
    *,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Profile:
    """Go a distance from rest to rest in the least time under limits of speed, acceleration and
    jerk.

    Args:
        distance: D > 0 [m, rad].
        speed: V; acceleration: A; jerk: J, which has to be given.

    Returns:
        s(t) from 0 to D, of pieces of constant jerk.

    Raises:
        LinkworkError: a distance or limit that is no positive number; no limit of the jerk.
    """
    D, (V, A, J) = given(distance, speed, acceleration, jerk)
    if not isfinite(J):
        raise LinkworkError("an S-curve has to have a limit of its jerk; or take 'trapezoidal'")
    shortest = (D / (2 * J)) ** (1 / 3)
    t_j = min(A / J, sqrt(V / J), shortest)
    t_a = t_v = 0.0
    if t_j == A / J:
        least = (-3 * t_j + sqrt(t_j**2 + 4 * D / A)) / 2
        t_a, at_speed = max(0.0, min(V / A - t_j, least)), V / A - t_j < least
    else:
        at_speed = t_j < shortest
    if at_speed:
        t_v = max(0.0, D / V - 2 * t_j - t_a)
    durations = [t_j, t_a, t_j, t_v, t_j, t_a, t_j]
    return pieces(durations, [[0.0, 0.0, 0.0, jerk / 6] for jerk in (J, 0, -J, 0, -J, 0, J)], 2)


def trapezoidal(
    distance: float,
    *,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Profile:
    """Go a distance from rest to rest in the least time under limits of speed and acceleration; the
    speed is a trapezoid, or a triangle.

    Args:
        distance: D > 0 [m, rad].
        speed: V; acceleration: A, which has to be given; jerk: none can be kept.

    Returns:
        s(t) from 0 to D, of pieces of constant acceleration.

    Raises:
        LinkworkError: a distance or limit that is no positive number; no limit of the acceleration,
            or one of the jerk.
    """
    D, (V, A, J) = given(distance, speed, acceleration, jerk)
    if not isfinite(A):
        raise LinkworkError("a trapezoidal law has to have a limit of its acceleration")
    if isfinite(J):
        raise LinkworkError("a trapezoidal law keeps no limit of the jerk; take 's_curve'")
    t_a = min(V / A, sqrt(D / A))
    t_v = max(0.0, D / V - t_a) if t_a < sqrt(D / A) else 0.0
    return pieces([t_a, t_v, t_a], [[0.0, 0.0, A / 2], [0.0], [0.0, 0.0, -A / 2]])


def polynomial(
    distance: float,
    *,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    degree: int = 5,
) -> Profile:
    """Go a distance from rest to rest by the polynomial of an odd degree whose derivatives vanish
    at both ends up to the order (degree - 1) / 2.

        s = D tau^(k+1) sum_j binomial(k + j, j) (1 - tau)^j,    j = 0 ... k = (degree - 1) / 2

    Args:
        distance: D > 0 [m, rad].
        speed, acceleration, jerk: limits, one at least.
        degree: 5, the quintic: no acceleration at the ends; 7, the septic: no jerk either.

    Returns:
        s(t) from 0 to D, of the least duration for this shape.

    Raises:
        LinkworkError: a distance or limit that is no positive number; no limit; another degree than
            3, 5 ... 15.
    """
    if not checks.among(degree, range(3, 16, 2)):
        raise LinkworkError(f"the degree is {checks.shown(degree)}; give 3, 5, 7 ... 15")
    return stretched(
        shape(degree), *given(distance, speed, acceleration, jerk), f"a law of degree {degree}"
    )


def cycloidal(
    distance: float,
    *,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
) -> Profile:
    """Go a distance from rest to rest by the cycloid  s = D (tau - sin(2 pi tau) / (2 pi)).

    Args:
        distance: D > 0 [m, rad].
        speed, acceleration, jerk: limits, one at least.

    Returns:
        s(t) from 0 to D, of the least duration for this shape.

    Raises:
        LinkworkError: a distance or limit that is no positive number; no limit.
    """
    return stretched(cycloid(), *given(distance, speed, acceleration, jerk), "a cycloid")


LAWS: Mapping[str, MotionLaw] = {
    "trapezoidal": trapezoidal,
    "s_curve": s_curve,
    "quintic": polynomial,
    "septic": partial(polynomial, degree=7),
    "cycloidal": cycloidal,
}
"""The motion laws by their names."""


def law_of(law: str | MotionLaw) -> MotionLaw:
    """Return a motion law by its name, or a function as those of this module."""
    if callable(law):
        return law
    if not checks.among(law, LAWS):
        raise LinkworkError(
            f"there is no motion law {checks.shown(law)}; there are {', '.join(LAWS)}"
        )
    return LAWS[law]


def given(distance: float, *limits: float | None) -> tuple[float, tuple[float, ...]]:
    """Return the distance and the limits, infinite where there is none."""
    return checks.positive(distance, "the distance"), tuple(
        inf if limit is None else checks.positive(limit, f"the {kind} limit")
        for kind, limit in zip(KINDS, limits, strict=True)
    )


def stretched(unit: Profile, distance: float, limits: tuple[float, ...], what: str) -> Profile:
    """Return a shape s(tau) from 0 to 1 over a distance, in the least duration that limits
    allow."""
    if min(limits) == inf:
        raise LinkworkError(f"{what} has to have a limit of its speed, acceleration or jerk")
    durations = [
        (float(unit.extremes(order)[0]) * distance / limit) ** (1 / order)
        for order, limit in enumerate(limits, 1)
    ]
    return unit.slowed(max(durations)).along(np.zeros(1), np.array([distance]))


@cache
def shape(degree: int) -> Profile:
    """Return the polynomial of an odd degree from 0 to 1, flat at both ends; each half is told from
    its own begin, for the sake of rounding."""
    k = (degree - 1) // 2
    coefficients = np.zeros(degree + 1)
    for j in range(k + 1):
        for i in range(j + 1):
            coefficients[k + 1 + i] += comb(k + j, j) * comb(j, i) * (-1) ** i
    halves = np.stack([coefficients, coefficients])[:, :, None]
    return Profile(np.array([0.0, 0.5, 1.0]), taylor(halves, np.array([0.0, 0.5])))


@cache
def cycloid() -> Profile:
    """Return tau - sin(2 pi tau) / (2 pi) as Taylor polynomials, exact to rounding."""
    knots = np.arange(SINE_PIECES + 1) / SINE_PIECES
    rows = np.zeros((SINE_PIECES, SINE_DEGREE + 1))
    for row, knot in zip(rows, knots, strict=False):
        turns = (sin(2 * pi * knot), cos(2 * pi * knot))
        for order in range(SINE_DEGREE + 1):
            sign = -1 if order % 4 > 1 else 1
            row[order] = -sign * turns[order % 2] * (2 * pi) ** (order - 1) / factorial(order)
        row[:2] += knot, 1.0
    return Profile(knots, rows[:, :, None])
