"""Time scaling: a path run through as fast as the actuators allow, by the inverse dynamics of the
robot.

Along a path q(s) the independent rates and their accelerations, v = v_s s' and v' = v_s s'' + v_ss
s'^2, make the forces of the actuators

    u = alpha(s) s'' + beta(s) s'^2 + gamma(s) + friction(s, s'),

linear in (s'', x = s'^2) but for friction that depends on rates. Power, |u r| s' <= P with the rate
r s' of the actuator, is not linear either. Both are replaced by their tangents at the x of the step
before, until x stays: the bound of a power is a convex function of x, above its tangent, so that
each step keeps it (convex-concave procedure).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.mechanism.limits import speed_limited
from linkwork.model.state import State
from linkwork.motions._flat import leads_links
from linkwork.motions._follow import follow, require_vectors
from linkwork.motions.driven_way import BETWEEN, CORNER, DrivenWay, refuse_leap, refuse_passing
from linkwork.motions.even_rates import evened
from linkwork.motions.jerk_limited import gentlest
from linkwork.motions.laws import Limit
from linkwork.motions.pushed_cables import warn_of_pushing_along
from linkwork.motions.reachability import Constraints, NoLawError, fastest_squares, law_of_squares
from linkwork.motions.reversals import reversals
from linkwork.motions.timed_paths import TimedPath, sample_count
from linkwork.paths import Path, uniform
from linkwork.patience import announced
from linkwork.robot import Robot

BOUNDS = ("force", "speed", "acceleration", "power", "jerk")
SETTLED, MOST_STEPS, SLOWINGS = 1e-9, 60, 20
PASSED, ROUNDS = 1e-9, 20  # part of a limit beyond it that is rounding; rounds of tightening
SPARE, UNSEEN = 1.4, 2.0
"""How much more limits are tightened than they were passed, and what is left of them for what may
be passed between verified points, over the square of the grid's width."""


@dataclass(frozen=True)
class ActuatorLimits:
    """Limit what the actuators give; None: no limit, of the speed that of the robot's description.
    All hold in both directions.

    Args:
        force: U [N, N m]: one number for all, one for each actuator in their order, or by name.
        speed: V [m/s, rad/s], acceleration: A [m/s^2, rad/s^2], power: P = |u r'| [W], jerk: J
            [m/s^3, rad/s^3], likewise. Actuators that are given no speed keep to the one that the
            description limits.

    Raises:
        LinkworkError: a limit that is no positive finite number; no limit at all.
    """

    force: Limit = None
    speed: Limit = None
    acceleration: Limit = None
    power: Limit = None
    jerk: Limit = None

    def __post_init__(self) -> None:
        if all(getattr(self, kind) is None for kind in BOUNDS):
            raise LinkworkError("no limit is given; the fastest motion needs one of the force")
        for kind in BOUNDS:
            value = getattr(self, kind)
            given = value.values() if isinstance(value, Mapping) else np.ravel(value).tolist()
            for part in () if value is None else given:
                checks.positive(part, f"the {kind} limit")

    def of(self, actuators: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the limits of actuators by kind, infinite where there is none."""
        return {kind: self._each(kind, actuators) for kind in BOUNDS}

    def of_robot(self, robot: Robot) -> dict[str, np.ndarray]:
        """Return the limits of a robot's actuators by kind, infinite where neither these nor its
        description have one."""
        found = self.of(robot.actuators)
        described = {limit.rates: limit.speed for limit in speed_limited(robot.mechanism)}
        own = np.array([described.get((name,), inf) for name in robot.actuators])
        return {**found, "speed": np.where(np.isinf(found["speed"]), own, found["speed"])}

    def _each(self, kind: str, actuators: Sequence[str]) -> np.ndarray:
        value = getattr(self, kind)
        if isinstance(value, Mapping):
            checks.known(value, actuators, "actuator", f" with a {kind} limit")
            return np.array([float(value.get(name, inf)) for name in actuators])
        given = np.asarray(inf if value is None else value, float)
        if given.shape not in ((), (len(actuators),)):
            raise LinkworkError(
                f"the {kind} limits are {checks.shown(value)}; give one number, or one for each "
                f"of {', '.join(actuators)}"
            )
        return np.broadcast_to(given, (len(actuators),))


def fastest(
    robot: Robot,
    path: Path | TimedPath,
    limits: ActuatorLimits,
    *,
    points: int = 401,
    guess: State | None = None,
) -> TimedPath:
    """Run through a path from rest to rest in the least time that the actuators allow.

    Limits of speed that the description gives hold too: of an actuator where it is given none here,
    and of all other joints.

    Limits hold at the points of a grid along the path, on both sides of each, and are verified
    within its intervals, in quarters of them, between which they are told by parabolas, and closely
    where friction changes its sign or sets in: where one would be passed there, all are tightened
    until none is. The duration is above the least one by a part that falls with the number of
    points (some 0.1 % to 0.4 % of 401; 1 % where dry friction, which ceases at rest, takes much of
    the force, falling by its square root). With more actuators than freedoms the forces are those
    of least norm.

    Under a limit of the jerk the motion begins and ends without acceleration, s(t) is cubic between
    two points of the grid (`jerk_limited`), and the law is a local optimum, which is verified at 8
    times as many times as points and slowed by what is passed there (some 1e-5 to 1e-3 of the
    duration at 401 points). Where the jerk rises and falls within few points the grid costs more.

    Args:
        robot: that is led.
        path: of the tool (`linkwork.paths`), or a timed path of the tool or of joints, whose own
            law and duration are not used.
        limits: of its actuators.
        points: of the grid, equally spaced in s.
        guess: a state on the wanted branch, near the first point; `home` if left out.

    Returns:
        The same path with the law that takes the least time; s'' is constant between two points,
        s''' where the jerk is limited.

    Raises:
        LinkworkError: a path with corners, one that rests between its ends, or, where the jerk is
            limited, whose curvature leaps; a place on it that the actuators cannot keep, by its s;
            a path on which nothing limits the speed; actuators that do not drive all freedoms;
            joints with bearings; paths of links that motors drive through springs.

    Warns:
        ModelWarning: driven cables that push, for limits hold in both directions.

    Source: Pham & Pham, IEEE Trans. Robotics 34 (2018) 645; Verscheure et al., IEEE Trans.
    Automatic Control 54 (2009) 2318; of the jerk, Constantinescu & Croft, J. Robotic Systems 17
    (2000) 233.
    """
    found = least_time(robot, path, limits, points, guess)
    warn_of_pushing_along(robot, found, int(points), guess)
    return found


def require_limits(limits: object) -> None:
    """Refuse what are no limits of actuators."""
    if not isinstance(limits, ActuatorLimits):
        raise LinkworkError(
            f"the limits are {checks.shown(limits)}; give motions.ActuatorLimits(force=...)"
        )


@announced("finding the law of the least time")
def least_time(
    robot: Robot,
    path: Path | TimedPath,
    limits: ActuatorLimits,
    points: int = 401,
    guess: State | None = None,
) -> TimedPath:
    """Return what `fastest` does, without its warnings."""
    # What is asked fits the robot.
    checks.needed(robot, Robot)
    require_limits(limits)
    require_no_bearings(
        robot.mechanism.joints,
        "the law of the least time, for which forces are linear, leaves out",
        "find it for the robot without, with lower limits",
    )
    points = sample_count(points, least=3)
    timed = path if isinstance(path, TimedPath) else TimedPath(path, 1.0)
    if timed.corners:
        raise LinkworkError(
            f"the path has a corner at s = {timed.corners[0]:.4g}; give its smooth parts one by one"
        )
    if leads_links(robot, timed.names):
        raise LinkworkError(
            "under the law of the least time accelerations or jerks leap, for which the motors of "
            "elastic joints take torques without bound; find it for the robot with rigid joints, "
            "or the motion from state to state by design.optimal_motion"
        )
    require_vectors(robot, timed, None)
    own = limits.of_robot(robot)
    if np.isfinite(own["jerk"]).any():
        return gentlest(robot, timed, own, points, guess)
    # The robot along the path, at the points of a grid and between them.
    timed = evened(timed)
    shape = TimedPath(Path(timed.path.curve, uniform), 1.0, timed.names)
    samples = BETWEEN * (points - 1) + 1
    with checks.at("run through in 1 s, "):
        motion = follow(robot, shape, samples=samples, guess=guess, keep_limits=False)
    way = DrivenWay(robot, motion)
    refuse_leap(way.rates, motion.time, float(np.abs(way.rates).max()), CORNER)
    refuse_passing(way, own, motion.time)
    # The law that keeps the limits at all of these.
    x = verified(way, own, timed.path.knots)
    law = law_of_squares(motion.time[::BETWEEN], x[::BETWEEN])
    return TimedPath(replace(timed.path, law=law.law), law.duration, timed.names)


def verified(
    way: DrivenWay, limits: Mapping[str, np.ndarray], knots: tuple[float, ...]
) -> np.ndarray:
    """Return x (samples,) of the fastest law of the grid, linear between its points, that keeps the
    limits between them, too; knots: of the path."""
    spare, x, near = np.zeros(len(way.motion.time)), None, reversals(way)
    for _ in range(ROUNDS):
        x = settled(way, limits, spare, x)
        rows = way.constraints(limits, x)
        beyond = np.maximum(passed(rows, x), passed_at(rows, x, knots))
        beyond = np.maximum(beyond, passed_near(near, limits, rows.s, x)) if near else beyond
        if not (beyond > PASSED).any():
            return x
        # Both ends of an interval are tightened by what is passed within, all by a little.
        if not spare.any():
            spare += UNSEEN * (BETWEEN / (len(spare) - 1)) ** 2
        more = SPARE * np.maximum(beyond, 0.0)
        spare[:-1:BETWEEN] += more
        spare[BETWEEN::BETWEEN] = np.maximum(spare[BETWEEN::BETWEEN], spare[:-1:BETWEEN])
    raise LinkworkError(
        f"the limits do not come to hold between the points of the grid within {ROUNDS} rounds; "
        "take more points"
    )


def passed(rows: Constraints, x: np.ndarray) -> np.ndarray:
    """Return how far limits are passed within the intervals of the grid (points - 1,), over the
    limits."""
    starts = np.arange(0, len(x) - 1, BETWEEN)
    bend = np.diff(x[::BETWEEN]) / np.diff(rows.s[::BETWEEN]) / 2
    inside = starts[:, None] + np.arange(BETWEEN + 1)
    left_over = rows.a[inside] * bend[:, None, None] + rows.b[inside] * x[inside][..., None]
    return tops(left_over - rows.c[inside]).max(axis=(1, 2))


def tops(values: np.ndarray) -> np.ndarray:
    """Return the largest of what is smooth within intervals (M x samples x K) between each two of
    its samples (M x samples - 1 x K): of the parabola through both whose second difference is the
    one beside them that is bent down less, for beside a leap of friction only one is."""
    bends = np.diff(values, 2, axis=1)
    before = np.concatenate([bends[:, 1:2], bends], axis=1)
    behind = np.concatenate([bends, bends[:, -2:-1]], axis=1)
    bend = np.minimum(np.maximum(before, behind), 0.0)
    rise = np.diff(values, axis=1)
    slope = np.minimum(np.abs(rise) + bend / 2, 0.0)  # at the higher end, outward
    beyond = np.divide(slope**2, -2 * bend, out=np.zeros_like(bend), where=bend < 0)
    return np.maximum(values[:, :-1], values[:, 1:]) + beyond


def passed_at(rows: Constraints, x: np.ndarray, knots: tuple[float, ...]) -> np.ndarray:
    """Return how far limits are passed at the knots of the path in each interval of the grid
    (points - 1,), over the limits; -inf where there is none.

    There the third derivative leaps, and forces have corners, higher by the first power of the
    grid's width than at the verified points beside them: they are told by the lower one of the
    lines through two of these before, and through two behind.
    """
    beyond, last = np.full(len(x) // BETWEEN, -np.inf), len(x) - 1
    for knot in knots:
        k, part = divmod(knot * last, 1.0)
        first = int(k) // BETWEEN * BETWEEN
        if not 1 <= k < last - 1:
            continue
        # The interval's own s'' and x, gone on with beside it.
        beside = int(k) + np.arange(-1, 3)
        slope = (x[first + BETWEEN] - x[first]) / (rows.s[first + BETWEEN] - rows.s[first])
        own = x[first] + slope * (rows.s[beside] - rows.s[first])
        a, b, c = (each[beside] for each in (rows.a, rows.b, rows.c))
        over = a * (slope / 2) + b * own[:, None] - c
        before, behind = over[1] + part * (over[1] - over[0]), over[2]
        behind = behind + (1 - part) * (over[2] - over[3])
        place = first // BETWEEN
        beyond[place] = max(beyond[place], float(np.minimum(before, behind).max()))
    return beyond


def passed_near(
    near: DrivenWay, limits: Mapping[str, np.ndarray], s: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Return how far limits are passed near reversals in each interval of the grid (points - 1,),
    over the limits; -inf where there is none.

    near: the way there; s: of the samples
    """
    ends, at = s[::BETWEEN], near.motion.time
    own = np.interp(at, s, x)
    rows = near.constraints(limits, own)
    place = np.clip(np.searchsorted(ends, at, "right") - 1, 0, len(ends) - 2)
    bend = np.diff(x[::BETWEEN]) / np.diff(ends) / 2
    over = (rows.a * bend[place, None] + rows.b * own[:, None] - rows.c).max(axis=1)
    beyond = np.full(len(ends) - 1, -np.inf)
    np.maximum.at(beyond, place, over)
    return beyond


def settled(
    way: DrivenWay, limits: Mapping[str, np.ndarray], spare: np.ndarray, x: np.ndarray | None
) -> np.ndarray:
    """Return x (samples,) of the fastest law; tangents are renewed until it stays.

    spare: part of the limits that is left at each sample; x: near the law, none if it is not known
    """
    powered = bool(np.isfinite(limits["power"]).any())
    if powered and not any(np.isfinite(limits[kind]).any() for kind in BOUNDS[:3]):
        raise LinkworkError(
            "a power alone lets a robot at rest accelerate without limit; limit the force as well"
        )
    still = not way.rests[0], not way.rests[1]
    if x is None or (way.smooth and not powered):
        x = solved(way, limits, None, still, spare)
        if way.smooth and not powered:
            return x
        x = admitted(way, limits, x, still, spare)
    for k in range(MOST_STEPS):
        following = solved(way, limits, x, still, spare)
        change = np.abs(following - x).max() / following.max()
        # Tangents that lead to and fro are taken half way between.
        x = following if k < MOST_STEPS // 3 else (following + x) / 2
        if change < SETTLED:
            return x
    raise LinkworkError(
        f"the fastest law does not settle within {MOST_STEPS} steps under these limits of power "
        "and this friction; take another number of points"
    )


def admitted(
    way: DrivenWay,
    limits: Mapping[str, np.ndarray],
    x: np.ndarray,
    still: tuple[bool, bool],
    spare: np.ndarray,
) -> np.ndarray:
    """Return x slowed until its tangents leave a law; where a power limit holds the robot against
    its weight, those at high speeds do not."""
    for _ in range(SLOWINGS):
        try:
            solved(way, limits, x, still, spare)
            return x
        except LinkworkError:
            x = x / 4
    return x


def solved(
    way: DrivenWay,
    limits: Mapping[str, np.ndarray],
    x: np.ndarray | None,
    still: tuple[bool, bool],
    spare: np.ndarray,
) -> np.ndarray:
    """Return x of the fastest law of the grid under the tangents at x; refuse a path without
    one."""
    whole = way.constraints(limits, x)
    a, b, c = (part[::BETWEEN] for part in (whole.a, whole.b, whole.c - spare[:, None]))
    grid = Constraints(whole.s[::BETWEEN], a, b, c)
    try:
        return np.interp(whole.s, grid.s, fastest_squares(grid, still))
    except NoLawError as error:
        raise LinkworkError(
            f"at s = {grid.s[error.point]:.4g} of the path (of 1) nothing limits its speed; limit "
            "more of the actuators"
            if error.unbounded
            else f"at s = {grid.s[error.point]:.4g} of the path (of 1) "
            f"{refused(way, limits, BETWEEN * error.point)}"
        ) from None


def refused(way: DrivenWay, limits: Mapping[str, np.ndarray], point: int) -> str:
    """Say what cannot be kept at a point of the path."""
    return way.unheld(limits["force"], point) or (
        "no speed and acceleration keep all limits from rest to rest; give more force, another "
        "path, or, where it bends within a few points of the grid, more points"
    )
