"""Jerk-limited time scaling: the law of the least time along a path under limits of jerk, too.

With p = s', a = s'' and c = s''' the rates r of the actuators have the jerk

    r'' = r_s c + 3 r_ss p a + r_sss p^3,

which makes the least time no convex problem. s(t) is cubic in each interval of a grid of s, whose
durations h are unknowns: p, a at its points and c, h in its intervals make

    s_(k+1) - s_k = p h + a h^2 / 2 + c h^3 / 6,    p' = p + a h + c h^2 / 2,    a' = a + c h

exact, all limits hold at both ends of each interval, and IPOPT finds the least sum of h. At an end
at rest s grows with t^3, so that the grid is crowded there; where the path rests by itself with an
acceleration, r = r_ss s^2 / 2, it is told by w = s^(2/3). What is found is verified by the inverse
dynamics at times between, and slowed until all limits hold there.

Source: of cubic laws with jerk in steps, Constantinescu & Croft, J. Robotic Systems 17 (2000) 233.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from scipy.special import beta, betainc, betaincinv

from linkwork.errors import LinkworkError
from linkwork.ipopt import Programme
from linkwork.model.state import Motion, State
from linkwork.motions._follow import follow
from linkwork.motions.driven_way import BETWEEN, CORNER, DrivenWay, refuse_leap, refuse_passing
from linkwork.motions.profiles import Profile
from linkwork.motions.reversals import reversals
from linkwork.motions.timed_paths import TimedPath
from linkwork.paths import Law, Path, Triple
from linkwork.robot import Robot

STEPS, BARRIER = 1000, 1e-3  # of IPOPT: most steps, and what its barrier weighs at first
ROUNDS, SETTLED = 12, 1e-4  # of friction's tangents; part of the duration by which they stay
FINER = 2  # as many times at which limits are verified as samples of the path
SLOWINGS, PASSED = 60, 1e-9  # until limits hold at all of them; part of one that is rounding
EVEN = 0.02  # part of the grid that is not crowded at ends at rest
FLAT = 1e-9  # rate or acceleration of a path at its ends, over its largest, that is none
CURVATURE = "the path changes its curvature in a leap, where only rest keeps a limit of the jerk"

Limits = Mapping[str, np.ndarray]


def gentlest(
    robot: Robot, timed: TimedPath, limits: Limits, points: int, guess: State | None
) -> TimedPath:
    """Return a path with the law of the least time under limits, those of jerk among them.

    limits: of the robot's actuators by kind; points: of the grid; guess: near the first point

    Raises:
        LinkworkError: a path with corners, or whose second derivative leaps; no law that is found.
    """
    # The path by w, at the points of a grid that is crowded where it begins and ends at rest, and
    # has points where the path has knots.
    orders = tuple(order_of_rest(timed.path, end) for end in (0.0, 1.0))
    rests = tuple(1.5 if order == 2 else 1.0 for order in orders)
    begin, end = (3.0 if order == 1 else 1.0 for order in orders)
    own, crowded = powers(*rests), powers(begin, end, EVEN)
    knots = betaincinv(*rests, np.array(timed.path.knots))
    grid = composed(crowded, through(knots, crowded, points - 1))
    shape = TimedPath(Path(timed.path.curve, composed(own, grid)), 1.0, timed.names)
    samples = BETWEEN * (points - 1) + 1
    motion = follow(robot, shape, samples=samples, guess=guess, keep_limits=False)
    way = DrivenWay(robot, told_by(motion, grid(motion.time)))
    s = own(way.motion.time)[0]
    size = float(np.abs(way.rates).max())
    refuse_leap(way.rates, s, size, CORNER)
    refuse_leap(way.bends[:, np.isfinite(limits["jerk"])], s, size, CURVATURE)
    refuse_passing(way, limits, s)
    refuse_unheld(way, limits, s)
    # Cubics between its points, the law of the path, and what holds between them.
    profile = settled(way, limits, (orders[0] == 1, orders[1] == 1)).profile
    path = replace(timed.path, law=composed(own, profile.law))
    return verified(robot, TimedPath(path, profile.duration, timed.names), limits, samples, guess)


def order_of_rest(path: Path, end: float) -> int:
    """Return the power of s by which a path leaves its end: 1, or more where it rests by itself."""
    ends = path.curve(np.array([end]))
    whole = path.curve(np.linspace(0, 1, 101))
    flat = [
        bool((np.abs(here) <= FLAT * np.abs(there).max(initial=0.0)).all())
        for here, there in zip(ends[1:], whole[1:], strict=True)
    ]
    return 1 if not flat[0] else 2 if not flat[1] else 3


def powers(first: float, last: float, even: float = 0.0) -> Law:
    """Return a law that begins as tau^first and ends as (1 - tau)^last, but for an even part: the
    incomplete beta function."""
    return partial(eased, first, last, even)


def eased(first: float, last: float, even: float, tau: np.ndarray) -> Triple:
    """Return the law of `powers`."""
    tau = np.asarray(tau, float)
    ds = tau ** (first - 1) * (1 - tau) ** (last - 1) / beta(first, last)
    inside = (tau > 0) & (tau < 1)
    t = np.where(inside, tau, 0.5)
    dds = np.where(inside, ds * ((first - 1) / t - (last - 1) / (1 - t)), 0.0)
    s = np.where(tau < 1, betainc(first, last, np.clip(tau, 0, 1)), 1.0)
    return (1 - even) * s + even * tau, (1 - even) * ds + even, (1 - even) * dds


def through(values: np.ndarray, law: Law, count: int) -> Law:
    """Return a law of straight pieces with which the other one has each of its values, as far as
    they are apart, at one of count equal steps."""
    at = np.array([brentq(lambda tau, w=w: law(tau)[0] - w, 0, 1, xtol=1e-15) for w in values])
    near = np.clip(np.round(at * count).astype(int), 1, count - 1)
    _, first = np.unique(near, return_index=True)
    ends = np.array([0, *near[first], count]) / count, np.array([0, *at[first], 1.0])

    def pieces(tau: np.ndarray) -> Triple:
        slopes = np.diff(ends[1]) / np.diff(ends[0])
        piece = np.clip(np.searchsorted(ends[0], tau, side="right") - 1, 0, len(slopes) - 1)
        return np.interp(tau, *ends), slopes[piece], 0 * tau

    return pieces


def composed(outer: Law, inner: Law) -> Law:
    """Return the law outer(inner(tau))."""
    return partial(chained, outer, inner)


def chained(outer: Law, inner: Law, tau: np.ndarray) -> Triple:
    """Return outer(inner(tau)) and its first two derivatives."""
    w, dw, ddw = inner(tau)
    s, ds, dds = outer(np.clip(w, 0.0, 1.0))
    return s, ds * dw, dds * dw**2 + ds * ddw


def told_by(motion: Motion, grid: Triple) -> Motion:
    """Return a motion with w for the time: w, w', w'' (samples,) are those along it."""
    w, slope, bend = grid[0], grid[1][:, None], grid[2][:, None]
    v, r = motion.rates / slope, motion.joint_rates / slope
    return replace(
        motion,
        time=w,
        state=motion.state.with_rates(v),
        accelerations=(motion.accelerations - v * bend) / slope**2,
        joint_rates=r,
        joint_accelerations=(motion.joint_accelerations - r * bend) / slope**2,
    )


def refuse_unheld(way: DrivenWay, limits: Limits, s: np.ndarray) -> None:
    """Refuse a path with a place at which the actuators cannot hold the robot."""
    if not np.isfinite(limits["force"]).any():
        return
    beyond = (np.abs(way.holding) >= limits["force"]).any(axis=1)
    for point in np.flatnonzero(beyond)[:1].tolist():
        raise LinkworkError(
            f"at s = {s[point]:.4g} of the path (of 1) {way.unheld(limits['force'], point)}"
        )


@dataclass(frozen=True, eq=False)
class CubicLaw:
    """Hold a law s(t) of cubics: s, p = s', a = s'' (points,), c = s''' and the durations h
    (intervals,)."""

    s: np.ndarray
    p: np.ndarray
    a: np.ndarray
    c: np.ndarray
    h: np.ndarray

    @property
    def duration(self) -> float:
        """Return T [s]."""
        return float(self.h.sum())

    @property
    def profile(self) -> Profile:
        """The same as polynomials of time."""
        rows = np.stack([self.s[:-1], self.p[:-1], self.a[:-1] / 2, self.c / 6], axis=1)
        return Profile(np.concatenate([[0.0], np.cumsum(self.h)]), rows[:, :, None])


@dataclass(frozen=True, eq=False)
class LawShares:
    """Hold the parts of their limits that actuators take along a grid, as functions of p, a and c;
    each row is a polynomial of the part of an interval that has been gone.

    speeds: of  A p;  steady: A, B, C of  A a + B p^2 + C;  powers: of  (A a + B p^2 + C) p;
        jerks: of  A c + 3 B p a + C p^3;  each (terms, rows, intervals, powers)
    """

    speeds: np.ndarray
    steady: np.ndarray
    powers: np.ndarray
    jerks: np.ndarray

    @classmethod
    def of(cls, way: DrivenWay, limits: Limits, x: np.ndarray | None = None) -> LawShares:
        """Return those of a driven way; x: p^2 (samples,) at which friction has its tangents."""
        r, bends, none = way.rates, way.bends, np.zeros((3, 0, len(way.rates)))
        speeds = np.concatenate([rows([np.abs(r)], limits["speed"])[0], way.passive.T**0.5])
        # Accelerations, forces, and forces times rates.
        steady, powers = rows([r, bends, 0 * r], limits["acceleration"]), none
        if way.forced(limits):
            forces = way.per_acceleration, *way.at_speed(x)
            steady = np.hstack([steady, rows(forces, limits["force"])])
            powers = rows([part * r for part in forces], limits["power"])
        # Polynomials through the samples of each interval; r_sss is the slope of that of r_ss.
        inside = np.arange(0, len(r) - 1, BETWEEN)[:, None] + np.arange(BETWEEN + 1)
        s = way.motion.time[inside]
        width = np.diff(s[:, [0, -1]])
        through = np.linalg.inv(((s - s[:, :1]) / width)[..., None] ** np.arange(BETWEEN + 1))

        def fitted(values: np.ndarray) -> np.ndarray:
            return np.einsum("ipj,trij->trip", through, values[..., inside])

        jerks = fitted(rows([r, bends, bends], limits["jerk"]))
        jerks[2] = np.roll(jerks[2] * np.arange(BETWEEN + 1), -1, axis=-1) / width
        return cls(fitted(speeds[None]), fitted(steady), fitted(powers), jerks)


def rows(parts: Sequence[np.ndarray], limit: np.ndarray) -> np.ndarray:
    """Return parts (points, actuators) over the limits of those actuators that have one (parts,
    rows, points)."""
    kept = np.isfinite(limit)
    return np.array([(part[:, kept] / limit[kept]).T for part in parts])


def settled(way: DrivenWay, limits: Limits, still: tuple[bool, bool]) -> CubicLaw:
    """Return the law of the least time on the grid; the tangents of friction are renewed until the
    duration stays.

    still: whether the law rests at the begin and at the end
    """
    s = way.motion.time
    nodes = begun(LawShares.of(way, limits), s[::BETWEEN], still)
    for _ in range(ROUNDS):
        x = np.interp(s, nodes.s, nodes.p**2)
        following = solved(LawShares.of(way, limits, x), nodes, still)
        change, nodes = abs(following.duration / nodes.duration - 1), following
        if way.smooth or not way.forced(limits) or change < SETTLED:
            return nodes
    raise LinkworkError(
        f"the law of limited jerk does not settle within {ROUNDS} rounds under this friction; take "
        "another number of points"
    )


def begun(shares: LawShares, s: np.ndarray, still: tuple[bool, bool]) -> CubicLaw:
    """Return a smooth law, as quick as all limits allow."""
    begin, end = (3.0 if rest else 1.0 for rest in still)
    tau = betaincinv(begin, end, s)
    _, p, a = powers(begin, end)(tau)
    h = np.diff(tau)
    c = np.diff(a) / h
    # Each part of a limit falls with a power of the duration; at the begins of all intervals.
    p_0, a_0 = p[:-1], a[:-1]
    (V,), (A, B, C), (D, E, F), (G, H, J) = (
        part[..., 0] for part in (shares.speeds, shares.steady, shares.powers, shares.jerks)
    )
    falling = [
        (1, V * p_0),
        (2, (A * a_0 + B * p_0**2) / (1 - np.abs(C))),
        (3, 2 * (D * a_0 + E * p_0**2) * p_0),
        (1, 2 * F * p_0),
        (3, G * c + 3 * H * p_0 * a_0 + J * p_0**3),
    ]
    T = max(np.abs(part).max(initial=0.0) ** (1 / order) for order, part in falling)
    return CubicLaw(s, p / T, a / T**2, c / T**3, T * h)


def solved(shares: LawShares, start: CubicLaw, still: tuple[bool, bool]) -> CubicLaw:
    """Return the law of the least time on the grid, from a law to begin with; the unknowns are in
    units of its duration."""
    T, count, width = start.duration, len(start.h), ca.DM(np.diff(start.s)).T
    one = ca.MX.ones(1, count)
    p, a = (ca.MX.sym(name, 1, count + 1) for name in "pa")
    c, h = (ca.MX.sym(name, 1, count) for name in "ch")

    def gone(t: ca.MX) -> tuple[Any, Any, Any]:
        """s, p and a a time after the begins of the intervals."""
        p_0, a_0 = p[:-1], a[:-1]
        rate = p_0 + a_0 * t + c * t**2 / 2
        return p_0 * t + a_0 * t**2 / 2 + c * t**3 / 6, rate, a_0 + c * t

    # Cubics that join on; parts of limits at their begins, in their middles, and jerks at their
    # ends, which are not those of the next begins.
    t = h / count
    way, rate, bend = gone(t)
    joined = [count * (way - width), rate - p[1:], bend - a[1:]]
    middle, *moving = gone(t / 2)
    parts = [linear(shares.jerks, 1.0, T ** -np.array([3.0, 3, 3]), jerk_terms(c, p[1:], a[1:]))]
    for part, p_k, a_k in ((0.0, p[:-1], a[:-1]), (middle / width, *moving)):
        parts += [
            linear(shares.speeds, part, np.array([1 / T]), [p_k]),
            linear(shares.steady, part, np.array([T**-2, T**-2, 1]), [a_k, p_k**2, one]),
            linear(shares.powers, part, T ** -np.array([3.0, 3, 1]), [a_k * p_k, p_k**3, p_k]),
            linear(shares.jerks, part, T ** -np.array([3.0, 3, 3]), jerk_terms(c, p_k, a_k)),
        ]
    # The programme.
    rest = np.zeros(count + 1, bool)
    rest[[0, -1]] = still
    free, none = np.full(2 * count, inf), np.where(rest, 0.0, inf)
    lower = np.concatenate([np.zeros(count + 1), -none, -free[:count], np.zeros(count)])
    equal, kept = (ca.vertcat(*map(ca.vec, each)) for each in (joined, parts))
    zeros, ones = np.zeros(equal.numel()), np.ones(kept.numel())
    programme = Programme(
        ca.horzcat(p, a, c, h).T,
        ca.sum2(h) / count,
        ca.vertcat(equal, kept),
        np.concatenate([start.p * T, start.a * T**2, start.c * T**3, start.h * count / T]),
        (lower, np.concatenate([none, none, free])),
        (np.concatenate([zeros, -ones]), np.concatenate([zeros, ones])),
        barrier=BARRIER,
    )
    x = programme.solve("law of limited jerk", STEPS).x
    p, a, c, h = np.split(x, np.cumsum([count + 1, count + 1, count]))
    return CubicLaw(start.s, np.maximum(p, 0) / T, a / T**2, c / T**3, h * T / count)


def jerk_terms(c: ca.MX, p: ca.MX, a: ca.MX) -> list[ca.MX]:
    """Return what the rows of jerks are multiplied by."""
    return [c, 3 * p * a, p**3]


def linear(
    factors: np.ndarray, part: ca.MX | float, scales: np.ndarray, values: Sequence[ca.MX]
) -> ca.MX:
    """Return the sum of factors (terms, rows, intervals, powers) at a part of the intervals, times
    scales (terms,) and values (terms) of the intervals."""
    total = ca.MX(*factors.shape[1:3])
    for each, value in zip(factors * scales[:, None, None, None], values, strict=True):
        if isinstance(part, float):
            factor = ca.DM(each @ part ** np.arange(each.shape[-1]))
        else:
            powers = [ca.repmat(part**k, len(each), 1) for k in range(each.shape[-1])]
            factor = sum(ca.DM(each[..., k]) * power for k, power in enumerate(powers))
        total += factor * ca.repmat(value, len(each), 1)
    return total


def verified(
    robot: Robot, found: TimedPath, limits: Limits, samples: int, guess: State | None
) -> TimedPath:
    """Return a timed path slowed until all limits hold at equally spaced times, those of forces
    near reversals, too, by the inverse dynamics."""
    motion = follow(robot, found, samples=FINER * samples, guess=guess, keep_limits=False)
    way, factor = DrivenWay(robot, motion), 1.0
    near = reversals(way) or way
    for _ in range(SLOWINGS):
        beyond = max(used(way, limits, factor), *loads(near, limits, factor)) - 1
        if beyond <= PASSED:
            return replace(found, duration=factor * found.duration)
        factor *= 1 + max(beyond, PASSED)
    raise LinkworkError(
        "the limits do not come to hold between the points of the grid when the law of limited "
        "jerk is slowed; take more points"
    )


def used(way: DrivenWay, limits: Limits, factor: float) -> float:
    """Return the largest part of a limit that a motion takes when it is slowed by a factor."""
    rates = way.rates / factor
    bends = way.bends / factor**2
    jerks = np.diff(bends, axis=0) / (np.diff(way.motion.time)[:, None] * factor)
    shares = [
        np.abs(rates) / limits["speed"],
        way.passive**0.5 / factor,
        np.abs(bends) / limits["acceleration"],
        np.abs(jerks) / limits["jerk"],
    ]
    return max(*(float(each.max(initial=0.0)) for each in shares), *loads(way, limits, factor))


def loads(way: DrivenWay, limits: Limits, factor: float) -> tuple[float, float]:
    """Return the largest parts of the limits of forces and powers."""
    if not way.forced(limits):
        return 0.0, 0.0
    still = 0 * way.motion.time
    u = way.forces(1 / factor + still, still)
    power = np.abs(u * way.rates / factor) / limits["power"]
    return float((np.abs(u) / limits["force"]).max()), float(power.max())
