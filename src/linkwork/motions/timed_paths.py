"""Timed paths: coordinates of joints, or of the tool, over time: point to point, through points,
with blended corners, and along any path.

The coordinates are joints' by name, or those of the tool's pose in their order; what is led along
them follows by `linkwork.motions.follow`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from itertools import pairwise
from math import inf
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.motions.laws import KINDS, AxisLimits, MotionLaw, law_of
from linkwork.motions.profiles import Profile, side_by_side, superposed
from linkwork.motions.spline_times import least_times, slowing, spline_through
from linkwork.paths import Path, Triple, straight, times_of, uniform
from linkwork.simulation import Sampled, Signal, as_signal

Point = State | Mapping[str, float] | Sequence[float] | np.ndarray
MOST_SAMPLES = 1_000_000
CLOSE, ROUNDING = 1e-6, 1e-12  # how far a signal may be off: of a range; [m, rad]
ASIDE = 0.37  # of an interval: where that is looked at, beside the symmetry of its middle
ALONG = 1e-9
"""How far the speed along a path of unit rate may vary, over itself, and still count as
constant."""


@dataclass(frozen=True, eq=False)
class TimedPath:
    """Hold a path and the time that it is run through in.

    path: of the tool's pose, or of joint coordinates; duration: T [s]
    names: of the joint coordinates in the path's order, none of the tool's pose
    passed: when the points that it was made of are passed, or passed by (points,) [s]
    profile: the same as polynomials of time, where it is made of these
    corners: s at which the path has a corner, where it rests
    turned: numbers of the points that were taken for rotation vectors and led on by a whole turn
    places: how many coordinates are the tool's place, as of a list of moves; 0 where none is known
    """

    path: Path
    duration: float
    names: tuple[str, ...] = ()
    passed: tuple[float, ...] = ()
    profile: Profile | None = None
    corners: tuple[float, ...] = ()
    turned: tuple[int, ...] = ()
    places: int = 0

    def __post_init__(self) -> None:
        checks.positive(self.duration, "the duration")
        checks.needed(self.path, Path, "linkwork.paths")

    @classmethod
    def of(
        cls,
        profile: Profile,
        names: tuple[str, ...],
        passed: Sequence[float],
        path: Path | None = None,
        turned: tuple[int, ...] = (),
    ) -> Self:
        """Return the timed path that polynomials of time are; path: the same as a curve with its
        law, which is the time itself if left out."""
        inner = profile.knots[1:-1] / profile.duration
        way = path or Path(profile.curve, uniform, tuple(inner.tolist()))
        return cls(way, profile.duration, names, tuple(passed), profile, turned=turned)

    def sample(self, time: ArrayLike) -> Triple:
        """Return the coordinates, their rates and their accelerations (K, d) at times [s]."""
        times = times_of(time)
        if self.profile is not None:
            return self.profile(times), self.profile(times, 1), self.profile(times, 2)
        return self.path.sample(times, self.duration)

    def extremes(self) -> np.ndarray:
        """Return the largest speed, acceleration and jerk (3, d) of the coordinates, from exact
        derivatives.

        Raises:
            LinkworkError: a path that is not made of polynomials of time.
        """
        if self.profile is None:
            raise LinkworkError(
                "the extremes of a motion along a curve are not known in closed form; sample it"
            )
        return np.array([self.profile.extremes(order) for order in (1, 2, 3)])

    def signal(self, names: Sequence[str] = (), *, samples: int = 1001) -> Signal:
        """Return the coordinates as a signal, for a controller to follow.

        Polynomials of degree 3 at most are told exactly, others by a spline through samples, which
        is the path but for 1e-6 of its range.

        Args:
            names: joints in the order that is wanted; that of the path if left out.
            samples: number of equally spaced times, of which twice as many are taken, and again,
                where these are too few.

        Raises:
            LinkworkError: names that the path does not have; a path that samples do not tell.
        """
        wanted = [*checks.names(names, "names")] or [*self.names]
        checks.known(wanted, self.names, "coordinate of the path")
        columns = [self.names.index(name) for name in wanted] or slice(None)
        if self.profile is not None and self.profile.degree <= 3:
            given = self.profile.coefficients[:, :, columns]
            rows = np.zeros((len(given), 4, given.shape[2]))
            rows[:, : given.shape[1]] = given
            return Signal(self.profile.knots, rows, np.empty(0))
        count = sample_count(samples)
        while count <= MOST_SAMPLES:
            times = np.linspace(0, self.duration, count)
            found = as_signal(Sampled(times, self.sample(times)[0][:, columns]))
            between = times[:-1] + ASIDE * np.diff(times)
            wanted = self.sample(between)[0][:, columns]
            if (np.abs(found(between) - wanted) <= CLOSE * np.ptp(wanted, axis=0) + ROUNDING).all():
                return found
            count = 2 * count - 1
        raise LinkworkError(
            f"{MOST_SAMPLES} samples do not tell the path between them; give it in parts"
        )

    def __repr__(self) -> str:
        what = ", ".join(self.names) or "tool's pose"
        return f"TimedPath({what}; {self.duration:.6g} s)"


def point_to_point(
    start: Point,
    end: Point,
    limits: AxisLimits,
    *,
    law: str | MotionLaw = "s_curve",
    synchronised: bool = True,
) -> TimedPath:
    """Go from one point to another, from rest to rest, in the least time that limits allow.

        x(t) = x_0 + (x_1 - x_0) s(t)

    Args:
        start: x_0: joint coordinates by name, a state (its actuated coordinates), or a pose of the
            tool [m, rad].
        end: x_1, alike; joints that are left out stay.
        limits: of each coordinate.
        law: "trapezoidal", "s_curve", "quintic", "septic", "cycloidal", or a function like these.
        synchronised: all coordinates move in proportion and arrive together; else each moves by
            itself in its own least time, and waits.

    Returns:
        A timed path of one law, which has one of its limits as its peak.

    Raises:
        LinkworkError: points of other coordinates, or equal ones; limits that the law cannot keep.
    """
    names, points, turned = points_of([start, end])
    change = points[1] - points[0]
    if not change.any():
        raise LinkworkError("the end is the start; give another point to go to")
    allowed, made = limits_of(limits).of(names, change.size), law_of(law)
    checks.switch(synchronised, "synchronised")
    if synchronised:
        profile = leg(change, allowed, made)
        way = Path(partial(straight, points[0], change), profile.law)
        passed = (0.0, profile.duration)
        led = profile.along(points[0], change)
        return TimedPath.of(led, names, passed, way, turned)
    moved = np.flatnonzero(change)
    each = [leg(change[[axis]], allowed[:, [axis]], made) for axis in moved]
    apart = side_by_side(each)
    spread = np.zeros((*apart.coefficients.shape[:2], change.size))
    spread[:, :, moved] = apart.coefficients
    profile = Profile(apart.knots, spread).along(points[0], change)
    return TimedPath.of(profile, names, (0.0, profile.duration), turned=turned)


def through(
    points: Sequence[Point],
    limits: AxisLimits,
    *,
    degree: int = 3,
    timing: Literal["straight", "least"] = "straight",
) -> TimedPath:
    """Go through points by one spline, from rest to rest, as fast as limits allow it.

    The times between points are in the proportion in which straight ways between them, at the
    limits, would take, or those of the least sum; their scale is the least that keeps all limits,
    of the exact extremes of the spline's derivatives.

    Args:
        points: three or more, each as for `point_to_point`; orientations of spatial poses by the
            rotation vectors nearest to each other.
        limits: of each coordinate.
        degree: 3: continuous accelerations; 5: continuous jerk, and no acceleration at the ends.
        timing: of the points: in the proportion of "straight" ways, or the "least" duration, found
            by descent from there (seconds for tens of points; a local minimum).

    Raises:
        LinkworkError: fewer than three points, points that follow each other and are equal, another
            degree or timing; a limit of the jerk for what is no limit of it.

    Source: of the least duration, Lin, Chang & Luh, IEEE Trans. Automatic Control 28 (1983) 1066.
    """
    names, values, turned = points_of(points, at_least=3)
    allowed = limits_of(limits).of(names, values.shape[1])
    if not checks.among(degree, (3, 5)):
        raise LinkworkError(f"the degree of the spline is {checks.shown(degree)}; give 3 or 5")
    if not checks.among(timing, ("straight", "least")):
        raise LinkworkError(f"the timing is {checks.shown(timing)}; give 'straight' or 'least'")
    # Times between points, in proportion.
    change = np.abs(np.diff(values, axis=0))
    require_moving(change)
    ways = [(change / limit) ** (1 / order) for order, limit in enumerate(allowed, 1)]
    times = np.max(ways, axis=(0, 2))
    if not times.all():
        raise LinkworkError(
            f"nothing limits the way from point {int(np.argmin(times))} to the next one; limit the "
            "coordinates that change there"
        )
    if timing == "least":
        times = least_times(times, values, allowed, degree)
    # The spline, and the least scale.
    profile = spline_through(times, values, degree)
    profile = profile.slowed(needed(profile, allowed))
    return TimedPath.of(profile, names, profile.knots.tolist(), turned=turned)


def blended(
    points: Sequence[Point],
    limits: AxisLimits,
    *,
    blend: float = 0.25,
    law: str | MotionLaw = "s_curve",
) -> TimedPath:
    """Go along straight legs from point to point and blend the corners: a leg begins before the one
    before it has ended.

        x(t) = x_0 + sum_k (x_k+1 - x_k) s_k(t - t_k)

    Corners are cut within the triangle of the parts of both legs that are run through at a time.
    Each leg takes its own least time; where the sum of two goes beyond a limit, the whole motion is
    slowed by the least factor that keeps all.

    Args:
        points: two or more, each as for `point_to_point`.
        limits: of each coordinate.
        blend: part of the time of the shorter of two legs in which both are run through, from 0
            (stop at each corner) to 0.5.
        law: of each leg.

    Raises:
        LinkworkError: fewer than two points, points that follow each other and are equal; a blend
            that is no such part.
    """
    names, values, turned = points_of(points)
    allowed, made = limits_of(limits).of(names, values.shape[1]), law_of(law)
    if not 0 <= checks.number(blend, "the blend") <= 0.5:
        raise LinkworkError(f"the blend is {blend:g}; give a part of the shorter leg from 0 to 0.5")
    changes = np.diff(values, axis=0)
    require_moving(changes)
    legs = [leg(change, allowed, made) for change in changes]
    # Two legs overlap by no more than half of each.
    starts = [0.0]
    for one, following in pairwise(legs):
        overlap = blend * min(one.duration, following.duration)
        starts.append(starts[-1] + one.duration - overlap)
    ends = [start + one.duration for start, one in zip(starts, legs, strict=True)]
    parts = [one.along(0 * change, change) for one, change in zip(legs, changes, strict=True)]
    profile = superposed(parts, starts)
    factor = max(1.0, needed(profile, allowed))
    profile = profile.slowed(factor).along(values[0], np.ones(values.shape[1]))
    middles = [(start + end) / 2 for start, end in zip(starts[1:], ends, strict=False)]
    passed = [0.0, *(factor * t for t in middles), profile.duration]
    return TimedPath.of(profile, names, passed, turned=turned)


def pick_and_place(
    pick: Point,
    place: Point,
    lift: Sequence[float] | Mapping[str, float],
    limits: AxisLimits,
    *,
    blend: float = 0.25,
    law: str | MotionLaw = "s_curve",
) -> TimedPath:
    """Lift off, go across and set down, with blended corners: `blended` through pick, pick + lift,
    place + lift, place.

    Args:
        pick, place: points, as for `point_to_point`.
        lift: what is added above both, in the same coordinates [m, rad].
        limits, blend, law: as for `blended`.

    Raises:
        LinkworkError: as `blended`; a lift of other coordinates.
    """
    names, (first, last), turned = points_of([pick, place])
    if isinstance(lift, Mapping):
        checks.known(lift, names, "coordinate of the points")
        lift = [lift.get(name, 0.0) for name in names]
    up = checks.finite(lift, "the lift")
    if up.shape != first.shape:
        raise LinkworkError(
            f"the lift is {checks.shown(lift)}; give {first.size} numbers, as the points have"
        )
    ways = [first, first + up, last + up, last]
    points: list[Any] = [dict(zip(names, way, strict=True)) for way in ways] if names else ways
    found = blended(points, limits, blend=blend, law=law)
    return replace(found, turned=(2, 3)) if turned else found


def along(
    path: Path,
    limits: AxisLimits,
    *,
    law: str | MotionLaw = "s_curve",
    position: int | None = None,
) -> TimedPath:
    """Run through a curve of constant rate, as lines, circles, arcs and helices are, with limits of
    the speed along it, and of that speed's derivatives.

    Args:
        path: of the tool.
        limits: of the way along the path [m]; across it, circles have the acceleration v^2 / r.
        law: as for `point_to_point`; the path's own law is not used.
        position: how many coordinates are the position, whose way it is; the first three, or both
            of two, if left out: give 2 for poses x, y, angle.

    Raises:
        LinkworkError: a path whose rate varies, or whose position stays.
    """
    length = length_of(path, position)
    profile = lawful(law_of(law), length, limits_of(limits).of((), 1)[:, 0])
    return TimedPath(Path(path.curve, profile.law), profile.duration, (), (0.0, profile.duration))


def length_of(path: Path, position: int | None = None) -> float:
    """Return the length [m] of a path of constant rate |dp / ds| of its position p."""
    checks.needed(path, Path, "linkwork.paths")
    if not checks.among(position, (None, 2, 3)):
        raise LinkworkError(f"position is {checks.shown(position)}; give 2 or 3")
    _, rate, _ = path.curve(np.linspace(0, 1, 101))
    speeds = np.linalg.norm(rate[:, : position or 3], axis=1)
    if not speeds.min() > 0 or np.ptp(speeds) > ALONG * speeds.max():
        raise LinkworkError(
            "the path's position stays, or does not move at one rate; give a line, a circle, an "
            "arc or a helix"
        )
    return float(speeds.mean())


def points_of(
    points: Any, at_least: int = 2
) -> tuple[tuple[str, ...], np.ndarray, tuple[int, ...]]:
    """Return the names of joint coordinates, none of poses, the points (points, d), and which of
    them were led on by a whole turn."""
    if isinstance(points, str | Mapping | State) or not hasattr(points, "__len__"):
        raise LinkworkError(f"the points are {checks.shown(points)}; give a list of them")
    if len(points) < at_least:
        raise LinkworkError(f"{len(points)} points are given; give at least {at_least}")
    first, *others = (named(point, k) for k, point in enumerate(points))
    if isinstance(first, Mapping):
        names, rows = tuple(first), [[*first.values()]]
        for k, other in enumerate(others, 1):
            if not isinstance(other, Mapping):
                raise LinkworkError(
                    f"point {k} is {checks.shown(other)}; give joint coordinates by name, as for "
                    "point 0"
                )
            checks.known(other, names, "coordinate", " of point 0")
            rows.append([other.get(name, rows[-1][i]) for i, name in enumerate(names)])
        return names, np.array(rows, float), ()
    rows = [first]
    for k, other in enumerate(others, 1):
        if isinstance(other, Mapping) or other.shape != first.shape:
            raise LinkworkError(
                f"point {k} is {checks.shown(other)}; give {first.size} numbers, as for point 0"
            )
        rows.append(other)
    led = continued(np.array(rows))
    return (), led, tuple(np.flatnonzero((led != rows).any(axis=1)).tolist())


def named(point: Point, place: int) -> dict[str, float] | np.ndarray:
    """Return a point as numbers by name, or as a list of them."""
    if isinstance(point, State):
        if point.batch:
            raise LinkworkError(f"point {place} is a stack of states; give one of them")
        strange = [name for name in point.independent if name not in point.coordinates]
        if strange:
            raise LinkworkError(
                f"point {place} is a state whose rate {strange[0]!r} is none of a coordinate; give "
                "coordinates by name"
            )
        return {name: float(point[name]) for name in point.independent}
    if isinstance(point, Mapping):
        if not point:
            raise LinkworkError(f"point {place} is empty; give joint coordinates by name")
        return {
            str(name): checks.number(value, f"{name} of point {place}")
            for name, value in point.items()
        }
    values = checks.finite(point, f"point {place}")
    if values.ndim != 1 or not values.size:
        raise LinkworkError(
            f"point {place} is {checks.shown(point)}; give joint coordinates by name, or the "
            "numbers of a pose"
        )
    return values


def continued(points: np.ndarray) -> np.ndarray:
    """Return spatial poses (K, 6) with the rotation vectors nearest to each other that turn the
    same way; other points as they are.

    r and r (1 + 2 pi k / |r|) are the same orientation, and so are 0 and 2 pi k about any axis.
    """
    if points.shape[1] != 6:
        return points
    led = points.copy()
    for k in range(1, len(led)):
        r, before = led[k, 3:], led[k - 1, 3:]
        angle, along = np.linalg.norm(r), r if r.any() else before
        if angle <= np.pi and along.any():
            axis = along / np.linalg.norm(along)
            whole = 2 * np.pi * np.round((axis @ before - angle) / (2 * np.pi))
            led[k, 3:] = r * (1 + whole / angle) if angle else whole * axis
    return led


def leg(change: np.ndarray, allowed: np.ndarray, law: MotionLaw) -> Profile:
    """Return the law s(t) from 0 to 1 along a straight way whose coordinates (d,) keep limits
    (3, d)."""
    with np.errstate(divide="ignore"):
        bounds = (allowed / np.abs(change)).min(axis=1)
    return lawful(law, 1.0, bounds)


def lawful(law: MotionLaw, distance: float, bounds: Sequence[float] | np.ndarray) -> Profile:
    """Return what a law makes of a distance and limits (3,), infinite where there is none; refuse
    what is no profile."""
    given = {kind: bound for kind, bound in zip(KINDS, bounds, strict=True) if bound < inf}
    try:
        signature(law).bind(distance, **given)
    except TypeError:
        raise LinkworkError(
            f"the law is {checks.shown(law)}; give a function of a distance and limits by name, "
            "speed, acceleration and jerk, as motions.s_curve is"
        ) from None
    profile = law(distance, **given)
    if not isinstance(profile, Profile):
        raise LinkworkError(
            f"the law returns {checks.shown(profile)}; give a function that returns a Profile, as "
            "motions.s_curve does"
        )
    return profile


def needed(profile: Profile, allowed: np.ndarray) -> float:
    """Return the least factor by which a motion slows to keep limits (3, d)."""
    return slowing([profile.extremes(order) / limit for order, limit in enumerate(allowed, 1)])


def sample_count(value: int, least: int = 2) -> int:
    """Return a number of samples; refuse fewer than two, and what does not fit into memory."""
    count = checks.count(value, "the number of samples")
    if not least <= count <= MOST_SAMPLES:
        raise LinkworkError(f"the number of samples is {count}; give {least} to {MOST_SAMPLES}")
    return count


def require_moving(changes: np.ndarray) -> None:
    """Refuse points that follow each other and are equal."""
    still = ~changes.any(axis=1)
    if still.any():
        k = int(np.argmax(still))
        raise LinkworkError(
            f"point {k + 1} is point {k}; leave one of them out, for a motion does not wait there"
        )


def limits_of(limits: AxisLimits) -> AxisLimits:
    """Refuse what are no limits."""
    if not isinstance(limits, AxisLimits):
        raise LinkworkError(
            f"the limits are {checks.shown(limits)}; give motions.AxisLimits(speed=..., "
            "acceleration=..., jerk=...)"
        )
    return limits
