"""Tool paths: poses of the tool over a run, with exact first and second time derivatives.

A path gives the pose x(s), x'(s), x''(s) for s from 0 to 1, and a motion law s(t) says when it is
where. Poses have the tool's coordinates: those of its task, or (x, y) or (x, y, angle) in the
plane, (x, y, z) or (x, y, z, rx, ry, rz) in space (rotation vector) [m, rad].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError

Triple = tuple[np.ndarray, np.ndarray, np.ndarray]
Law = Callable[[np.ndarray], Triple]
Curve = Callable[[np.ndarray], Triple]
FLAT = 1e-9
"""Sine of the angle between the ways from one point to two others from which on they lie in a
line."""


def rest_to_rest(tau: np.ndarray) -> Triple:
    """Return s, s', s'' of the law s = 35 tau^4 - 84 tau^5 + 70 tau^6 - 20 tau^7.

    Rate, acceleration and jerk are zero at both ends; tau = t / duration.
    """
    s = tau**4 * (35 + tau * (-84 + tau * (70 - 20 * tau)))
    ds = 140 * tau**3 * (1 - tau) ** 3
    dds = 420 * tau**2 * (1 - tau) ** 2 * (1 - 2 * tau)
    return s, ds, dds


def uniform(tau: np.ndarray) -> Triple:
    """Return s, s', s'' of the law s = tau: constant speed from the first moment on."""
    return tau, np.ones_like(tau), np.zeros_like(tau)


@dataclass(frozen=True)
class Path:
    """Hold a curve s -> (x, x', x''), each (K, d), the law by which it is run through, and the s
    inside at which its third derivative leaps."""

    curve: Curve
    law: Law = rest_to_rest
    knots: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name, function in (("curve", self.curve), ("law", self.law)):
            if not callable(function):
                raise LinkworkError(
                    f"the {name} of a path is {checks.shown(function)}; give a function, such as "
                    "paths.uniform"
                )

    def sample(self, time: ArrayLike, duration: float) -> Triple:
        """Return poses, velocities and accelerations (K, d) at the times [s] of a run of a given
        duration [s].

        x' = x_s s',  x'' = x_ss s'^2 + x_s s''.
        """
        time = times_of(time)
        duration = checks.positive(duration, "the duration")
        checks.number(duration * duration, "the square of the duration")
        s, ds, dds = three(self.law(time / duration), "law")
        x, x_s, x_ss = three(self.curve(s), "curve")
        rate, acceleration = (ds / duration)[:, None], (dds / duration**2)[:, None]
        return x, x_s * rate, x_ss * rate**2 + x_s * acceleration


def times_of(values: ArrayLike) -> np.ndarray:
    """Return times [s] (K), one of a single number; refuse others."""
    found = np.atleast_1d(checks.finite(values, "the times"))
    if found.ndim > 1:
        raise LinkworkError(f"the times have the shape {found.shape}; give one, or a list of them")
    return found


def three(found: object, what: str) -> Triple:
    """Return what a law or a curve gave; refuse what is no value with two derivatives."""
    if not isinstance(found, Sequence | np.ndarray) or len(found) != 3:
        raise LinkworkError(
            f"the {what} of a path gave {checks.shown(found)}; let it return three arrays: the "
            "value and its first two derivatives"
        )
    value, slope, bend = found
    return value, slope, bend


def turning(turns: float, what: str) -> float:
    """Return the angle [rad] of a number of turns; refuse one whose square no double holds."""
    angle = 2 * np.pi * checks.number(turns, what)
    checks.number(angle * angle, f"the square of {what}")
    return angle


def circle(
    centre: Sequence[float],
    radius: float,
    orientation: float | Sequence[float] | None = None,
    *,
    start: float = 0.0,
    turns: float = 1.0,
    law: Law = rest_to_rest,
) -> Path:
    """Lead the tool around a circle parallel to the xy plane.

    Args:
        centre: (x, y) or (x, y, z) of the circle [m].
        radius: [m].
        orientation: constant angle, or rotation vector in space [rad]; of a tool whose task has
            fewer coordinates after x, y, z, these, such as the one rz; left out: not prescribed.
        start: angle of the first point, from x [rad].
        turns: number of turns, negative for clockwise.
        law: motion law.
    """
    middle = finite("the centre", centre, (2, 3))
    radius = checks.positive(radius, "the radius")
    start = checks.number(start, "the angle of the first point")
    fixed = np.concatenate([middle[2:], fixed_orientation(orientation, middle.size)])
    sweep = turning(turns, "the number of turns")

    return Path(partial(around, middle[:2], radius, fixed, start, sweep), law)


def around(
    middle: np.ndarray,
    radius: float,
    fixed: np.ndarray,
    start: float,
    sweep: float,
    s: np.ndarray,
) -> Triple:
    """Return the curve of `circle`; fixed: what follows x and y."""
    phase = start + sweep * s
    c, n, rest = radius * np.cos(phase), radius * np.sin(phase), np.ones((s.size, 1)) * fixed
    return (
        np.column_stack([middle[0] + c, middle[1] + n, rest]),
        np.column_stack([-sweep * n, sweep * c, 0 * rest]),
        np.column_stack([-(sweep**2) * c, -(sweep**2) * n, 0 * rest]),
    )


def helix(
    centre: Sequence[float],
    radius: float,
    rise: float,
    orientation: float | Sequence[float] | None = None,
    *,
    start: float = 0.0,
    turns: float = 1.0,
    law: Law = rest_to_rest,
) -> Path:
    """Lead the tool up a helix about an axis along z.

    Args:
        centre: (x, y, z) of the axis at the height of the first point [m].
        radius: [m]; rise: along z over the whole path, negative for down [m].
        orientation: as of a circle.
        start: angle of the first point, from x [rad].
        turns: number of turns, negative for clockwise.
        law: motion law.
    """
    middle = finite("the centre", centre, (3,)).tolist()
    flat = circle(middle, radius, orientation, start=start, turns=turns)
    return Path(partial(risen, flat.curve, checks.number(rise, "the rise")), law)


def risen(flat: Curve, climb: float, s: np.ndarray) -> Triple:
    """Return a curve that climbs along z by so much besides."""
    x, x_s, x_ss = flat(s)
    x[:, 2] += climb * s
    x_s[:, 2] += climb
    return x, x_s, x_ss


def arc(
    start: Sequence[float],
    via: Sequence[float],
    end: Sequence[float],
    orientation: float | Sequence[float] | None = None,
    *,
    law: Law = rest_to_rest,
) -> Path:
    """Lead the tool along the arc of a circle from one point through another to a third.

        p(s) = c + cos(phi s) a + sin(phi s) b,    a = start - c,  b normal to it

    Args:
        start, via, end: (x, y) or (x, y, z) [m].
        orientation: constant angle, or rotation vector in space [rad]; of a tool whose task has
            fewer coordinates after x, y, z, these, such as the one rz; left out: not prescribed.
        law: motion law.

    Raises:
        LinkworkError: points that lie in a line.
    """
    first = finite("the start", start, (2, 3))
    size = first.size
    others = finite("the point between", via, (size,)), finite("the end", end, (size,))
    fixed = fixed_orientation(orientation, size)
    # The circle through three points.
    points = [np.append(point, np.zeros(3 - size)) for point in (first, *others)]
    u, w = points[1] - points[0], points[2] - points[0]
    normal = np.cross(u, w)
    area = np.linalg.norm(normal)
    if not area > FLAT * np.linalg.norm(u) * np.linalg.norm(w):
        raise LinkworkError("the points of an arc lie in a line; give others, or take paths.line")
    to_centre = np.cross((u @ u) * w - (w @ w) * u, normal) / (2 * area**2)
    centre, a = points[0] + to_centre, -to_centre
    b = np.cross(normal / area, a)
    reach = points[2] - centre
    sweep = np.arctan2(reach @ b, reach @ a) % (2 * np.pi)

    return Path(partial(bent, centre[:size], (a[:size], b[:size]), fixed, float(sweep)), law)


def bent(
    centre: np.ndarray,
    arms: tuple[np.ndarray, np.ndarray],
    fixed: np.ndarray,
    sweep: float,
    s: np.ndarray,
) -> Triple:
    """Return the curve of `arc`; arms: a and b; fixed: what follows the place."""
    phase, rest = (sweep * s)[:, None], np.ones((s.size, 1)) * fixed
    c, n, (a, b) = np.cos(phase), np.sin(phase), arms
    return (
        np.hstack([centre + c * a + n * b, rest]),
        np.hstack([sweep * (c * b - n * a), 0 * rest]),
        np.hstack([-(sweep**2) * (c * a + n * b), 0 * rest]),
    )


def line(start: Sequence[float], end: Sequence[float], *, law: Law = rest_to_rest) -> Path:
    """Lead the tool straight from one pose to another; all coordinates change in proportion."""
    first = finite("the start", start)
    last = finite("the end", end, (first.size,))
    return Path(partial(straight, first, last - first), law)


def straight(start: np.ndarray, change: np.ndarray, s: np.ndarray) -> Triple:
    """Return the straight way start + s change."""
    along = np.ones((s.size, 1)) * change
    return start + s[:, None] * along, along, 0 * along


def through(poses: Sequence[Sequence[float]], *, law: Law = rest_to_rest) -> Path:
    """Lead the tool through poses (K, d), K >= 4, by a cubic spline with continuous
    accelerations."""
    from scipy.interpolate import CubicSpline

    if not isinstance(poses, Sequence | np.ndarray) or isinstance(poses, str | bytes):
        raise LinkworkError(f"the poses are {checks.shown(poses)}; give a list of at least 4 poses")
    if len(poses) < 4:
        raise LinkworkError(f"a path through poses needs at least 4 of them, not {len(poses)}")
    first = finite("pose 0", poses[0])
    points = np.array([finite(f"pose {k}", pose, (first.size,)) for k, pose in enumerate(poses)])
    knots = np.linspace(0, 1, len(points))
    return Path(partial(derived, CubicSpline(knots, points)), law, tuple(knots[2:-2].tolist()))


def derived(of: Callable[..., np.ndarray], s: np.ndarray) -> Triple:
    """Return a function of (s, order) and its first two derivatives."""
    return of(s), of(s, 1), of(s, 2)


def together(*paths: Path) -> Path:
    """Prescribe several parts of the pose side by side, such as a circle (x, y) and a line of
    angles; the first law holds."""
    for path in paths:
        if not isinstance(path, Path):
            raise LinkworkError(
                f"one of the paths is {checks.shown(path)}; give paths made by linkwork.paths"
            )
    if not paths:
        raise LinkworkError("there is no path to prescribe; give one or more")
    knots = {knot for path in paths for knot in path.knots}
    curves = [path.curve for path in paths]
    return Path(partial(beside, curves), paths[0].law, tuple(sorted(knots)))


def beside(curves: Sequence[Curve], s: np.ndarray) -> Triple:
    """Return curves side by side."""
    x, x_s, x_ss = (np.hstack(parts) for parts in zip(*(each(s) for each in curves), strict=True))
    return x, x_s, x_ss


def swing(start: float, amplitude: float, *, swings: float = 1.0, law: Law = rest_to_rest) -> Path:
    """Vary one coordinate as start + amplitude sin(2 pi swings s)."""
    start, amplitude = checks.number(start, "the start"), checks.number(amplitude, "the amplitude")
    return Path(partial(swung, start, amplitude, turning(swings, "the number of swings")), law)


def swung(start: float, amplitude: float, rate: float, s: np.ndarray) -> Triple:
    """Return the curve of `swing`."""
    sine, cosine = np.sin(rate * s)[:, None], np.cos(rate * s)[:, None]
    return start + amplitude * sine, amplitude * rate * cosine, -amplitude * rate**2 * sine


def fixed_orientation(orientation: float | Sequence[float] | None, size: int) -> np.ndarray:
    """Return the fixed numbers that follow those of a place: none or an angle in the plane, up to
    three in space."""
    given = checks.finite(() if orientation is None else orientation, "the orientation")
    return finite("the orientation", np.atleast_1d(given).tolist(), tuple(range(2 * size - 2)))


def finite(what: str, values: Sequence[float], sizes: tuple[int, ...] = ()) -> np.ndarray:
    """Return finite numbers, as many as one of some sizes where there are any."""
    given = checks.reals(values)
    array = np.empty((0, 0)) if given is None else given
    fits = array.size in sizes if sizes else array.size > 0
    if array.ndim != 1 or not fits or not np.isfinite(array).all():
        *most, last = map(str, sizes or ("the tool's coordinates as",))
        counts = f"{', '.join(most)} or {last}" if most else last
        told = np.ravel(array).tolist() if array.size else values
        raise LinkworkError(f"{what} is {checks.shown(told)}; give {counts} finite numbers")
    return array
