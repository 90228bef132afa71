"""Optimal motion: from state to state in the least time, or with the least effort, within what the
actuators give.

    min T    or    min integral of u'u dt,    (q, v)' = f(q, v, u),    |u| <= U, ...

by collocation (`collocation`) of what holds at its points (`motion_points`) and IPOPT
(`motion_search`). The loops are closed at each point: there are no multipliers. What is found is a
local optimum of the mesh, whose forces are then given to the robot: its integrator, which knows
nothing of the mesh, tells where it ends. Along a given way the law of the least time
is a convex problem, which `motions.fastest` solves as a whole; it is the guess here.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np

from linkwork import checks
from linkwork.design.limits_taken import shares
from linkwork.design.motion_points import determinant
from linkwork.design.motion_search import MotionSearch
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism.limits import undriven_speeds
from linkwork.model.state import State
from linkwork.motions import ActuatorLimits, AxisLimits, TimedPath, point_to_point
from linkwork.motions._fastest import least_time, require_limits
from linkwork.motions.pushed_cables import warn_of_pushing
from linkwork.patience import announced
from linkwork.robot import Robot
from linkwork.simulation import Run, Sampled

LEAST, MOST = 4, 1000  # intervals
MISSED = 1e-3  # in own units, by which the robot may end elsewhere
DRIFT = 1e-2  # in own units over the duration, by which its rates may be others there
SLOWEST = 4.0  # duration over that of a motion at the limits of force, of a guess without them
ROUNDING = 1e-9  # of a speed at its limit
PASSED = 0.01  # part of a limit by which the run may pass it without a warning


@dataclass(frozen=True, eq=False)
class OptimalMotion:
    """Hold a motion that is locally optimal.

    duration: T [s]; cost: T [s], or the integral of u'u [N^2 s, N^2 m^2 s]; minimised: which
    forces: of the actuators, constant in each interval
    run: of the robot under these forces, found by its own integrator; missed, missed_rates: by
        which it ends elsewhere, of each independent coordinate [m, rad] and rate [m/s, rad/s]
    used: largest part of each kind of limit that the run takes, between the points of the mesh, too
        (`limits_taken.shares`): of force, speed, acceleration and power, of the ranges of joints
        ("range") and of the distance from singular poses ("apart"); above 1 where it is passed
    steps: of IPOPT; stationarity: residual of the conditions of optimality over the largest
        multiplier; settled: whether it is none, or else the search ended when its time was up
    """

    duration: float
    cost: float
    minimised: str
    forces: Sampled
    run: Run
    missed: np.ndarray
    missed_rates: np.ndarray
    used: dict[str, float]
    steps: int
    stationarity: float
    settled: bool = True

    def __repr__(self) -> str:
        said = "least time" if self.minimised == "time" else f"least effort {self.cost:.6g}"
        used = ", ".join(f"{kind} {share:.1%}" for kind, share in self.used.items())
        reached = "locally optimal" if self.settled else "not optimal yet"
        return "\n".join(
            [
                f"Motion in {self.duration:.6g} s, {said}, {reached} on "
                f"{len(self.forces.times) - 1} intervals ({self.steps} steps)",
                f"  simulated with its forces it ends off by {np.abs(self.missed).max():.2g}, its "
                f"rates by {np.abs(self.missed_rates).max():.2g}",
                *([f"  of what is allowed the run takes: {used}"] if used else []),
            ]
        )


@announced("optimising the motion")
def optimal_motion(
    robot: Robot,
    start: State,
    end: State,
    limits: ActuatorLimits,
    *,
    minimise: Literal["time", "effort"] = "time",
    duration: float | None = None,
    intervals: int = 30,
    apart: float = 0.05,
    guess: TimedPath | None = None,
    search_time: float = 60.0,
) -> OptimalMotion:
    """Find how a robot goes from one state to another in the least time, or with the least effort.

    Args:
        robot: that moves; it may have fewer actuators than freedoms.
        start, end: states, whose rates are those there.
        limits: of its actuators; they hold at the points of the mesh, and with them the limits of
            speed of the description, as in `motions.fastest`.
        minimise: the "time"; or the "effort", the integral of u'u over a given duration, to which
            what motors lose is proportional.
        duration: T [s], of the least effort.
        intervals: in which forces are constant: more of them come nearer to the optimum.
        apart: from singular poses: the least determinant of the loops with the independent rates
            over that at the start, which is zero where the actuators cease to hold the robot.
        guess: a timed path of the independent coordinates; the fastest straight way of these if
            left out.
        search_time: of one processor [s], after which the search ends, and returns what keeps all
            limits and was the best so far as not settled, with a warning.

    Returns:
        An `OptimalMotion`, a local optimum on its mesh: other ways may be shorter.

    Raises:
        LinkworkError: states on two sides of a singular pose, or above a limit of speed; a rate
            without a coordinate; an actuator that nothing limits, for the least time; a duration
            below the least time that is found; no optimum found, and why; forces that lead the
            robot elsewhere, for the mesh is too coarse.

    Warns:
        ModelWarning: a motion that is not settled; a limit that is passed by more than 1 % between
            the points of the mesh; driven cables that push, for limits hold in both directions.
    """
    # One robot, two states in its own rates, and a cost.
    checks.needed(robot, Robot)
    require_limits(limits)
    if limits.jerk is not None:
        raise LinkworkError(
            "forces that are constant in intervals leap between them, and the jerk with them; "
            "leave its limit out, or give the way to motions.fastest, which limits it"
        )
    refuse_cost(robot, minimise, duration)
    ends = own_state(robot, start, "the start"), own_state(robot, end, "the end")
    count = checks.count(intervals, "the number of intervals")
    if not LEAST <= count <= MOST:
        raise LinkworkError(f"the number of intervals is {count}; give {LEAST} to {MOST}")
    refuse_apart(robot, ends, apart)
    refuse_speeds(robot, ends, limits)
    if minimise == "time":
        refuse_unlimited(robot, limits)
    seconds = checks.positive(search_time, "the search time", "s")
    # The programme from a guess, and the robot under the forces that are found.
    if not (guess is None or isinstance(guess, TimedPath)):
        raise LinkworkError(
            f"the guess is {checks.shown(guess)}; give a timed path made by linkwork.motions"
        )
    timed = straight(robot, ends, limits) if guess is None else guess
    search = MotionSearch(robot, ends, limits, timed, count, apart, seconds)
    found, own = search.quickest() if duration is None else search.gentlest(duration)
    if not found.settled:
        warnings.warn(
            f"the motion keeps all limits, but is not settled after {seconds:.3g} s (stationarity "
            f"{found.stationarity:.2g}); give more search_time, or fewer intervals",
            ModelWarning,
            stacklevel=3,
        )
    # What the robot does under the forces that were found.
    T, times = own.T, np.linspace(0.0, own.T, count + 1)
    forces = Sampled(times, np.vstack([own.u.T, own.u[:, -1]]), "hold")
    run, missed, missed_rates = simulated(robot, ends, forces, T)
    used = shares(robot, run, forces, limits, apart)
    if passed := [f"{kind} {part - 1:.1%}" for kind, part in used.items() if part > 1 + PASSED]:
        warnings.warn(
            f"between the points of the mesh the run passes limits by a part: {', '.join(passed)}; "
            "give more intervals, or closer limits",
            ModelWarning,
            stacklevel=3,
        )
    warn_of_pushing(robot, forces.values, 3)
    return OptimalMotion(
        T,
        T if minimise == "time" else float((own.u**2).sum() * T / count),
        minimise,
        forces,
        run,
        missed,
        missed_rates,
        used,
        found.steps,
        found.stationarity,
        found.settled,
    )


def straight(robot: Robot, ends: tuple[State, State], limits: ActuatorLimits) -> TimedPath:
    """Return the straight way of the independent coordinates, as fast as the actuators can; where
    they cannot hold the robot on it, by their force against inertia alone."""
    places = {name: [float(state[name]) for state in ends] for name in robot.independent}
    if all(first == last for first, last in places.values()):
        raise LinkworkError("the end is where the start is; give another one, or a guess")
    first, last = ({name: pair[k] for name, pair in places.items()} for k in (0, 1))
    path = point_to_point(first, last, AxisLimits(speed=1.0), law="quintic")
    try:
        return least_time(robot, path, limits)
    except LinkworkError:
        way = np.array([last[name] - first[name] for name in robot.independent])
        M, S = robot.mass_matrix(ends[0]), robot.actuation(ends[0])
        most = limits.of(robot.actuators)["force"]
        able = float(np.abs(S).T @ np.where(np.isfinite(most), most, 0.0) @ np.abs(way))
        time = SLOWEST * np.sqrt(float(way @ M @ way) / able) if able > 0 else 1.0
        return TimedPath(path.path, time, path.names)


def simulated(
    robot: Robot, ends: tuple[State, State], forces: Sampled, T: float
) -> tuple[Run, np.ndarray, np.ndarray]:
    """Return the robot's run under forces, and by how much it ends elsewhere and otherwise (n)."""
    start, end = ends
    run = robot.simulate(start, forces, duration=T)
    if not run.success:
        raise LinkworkError(
            f"the robot does not get to the end with the forces that are found ({run.message}); "
            "give more intervals, or keep farther apart from singular poses"
        )
    names = robot.independent
    missed = np.array([float(run.final[name]) - float(end[name]) for name in names])
    own = np.array([robot.equations.tree.length if robot.unit(n) == "m" else 1.0 for n in names])
    if not np.abs(missed / own).max() <= MISSED:
        raise LinkworkError(
            f"with the forces that are found the robot ends off by {np.abs(missed).max():.2g}, for "
            f"{len(forces.times) - 1} intervals are too coarse; give more"
        )
    rates = robot.in_chart(run.final, names).rates - end.rates
    if not np.abs(rates / own).max() * T <= DRIFT:
        raise LinkworkError(
            "with the forces that are found the robot ends at rates off by "
            f"{np.abs(rates).max():.2g}, for {len(forces.times) - 1} intervals are too coarse; "
            "give more"
        )
    return run, missed, rates


def own_state(robot: Robot, state: State, what: str) -> State:
    """Return one state in the robot's own independent rates."""
    if not isinstance(state, State):
        raise LinkworkError(
            f"{what} is {checks.shown(state)}; give a State, as robot.assemble does"
        )
    if robot.own(state).batch:
        raise LinkworkError(f"{what} is a stack of states; give one of them")
    return robot.in_chart(state, robot.independent)


def refuse_cost(robot: Robot, minimise: str, duration: float | None) -> None:
    """Refuse what is no cost, and an effort without a duration, or in two units."""
    if not checks.among(minimise, ("time", "effort")):
        raise LinkworkError(
            f"what is to be least is {checks.shown(minimise)}; give 'time' or 'effort'"
        )
    if (minimise == "effort") != (duration is not None):
        raise LinkworkError("give a duration for the least effort, and none for the least time")
    if duration is not None:
        checks.positive(duration, "the duration", "s")
        if len({robot.unit(name) for name in robot.actuators}) > 1:
            raise LinkworkError(
                "some actuators turn and others slide, whose forces have no common square; take "
                "the least time"
            )


def refuse_apart(robot: Robot, ends: tuple[State, State], apart: float) -> None:
    """Refuse ends between which lies a singular pose, or that are nearer to one than allowed."""
    if not 0 < checks.number(apart, "the distance from singular poses") < 1:
        raise LinkworkError(f"apart is {apart:g}; give a part of the determinant between 0 and 1")
    D = determinant(robot)
    if D is None:
        return
    here, there = (float(D(state.q, robot.p)) for state in ends)
    if not there / here > apart:
        raise LinkworkError(
            f"the determinant at the end is {there / here:.3g} of that at the start, so that a "
            f"singular pose of {', '.join(robot.independent)} lies "
            + ("between them" if there / here <= 0 else f"nearer than apart = {apart:g} allows")
            + "; give other states"
        )


def refuse_speeds(robot: Robot, ends: tuple[State, State], limits: ActuatorLimits) -> None:
    """Refuse states whose rates are above the limits of speed."""
    most = limits.of_robot(robot)["speed"]
    for what, state in zip(("start", "end"), ends, strict=True):
        rates = np.abs(robot.actuation(state) @ state.rates)
        moving = [*zip(robot.actuators, rates.tolist(), most.tolist(), strict=True)]
        joints = robot.joint_rates(state)
        for labels, speed in undriven_speeds(robot.mechanism):
            rate = np.linalg.norm([joints[robot.rates.index(label)] for label in labels])
            moving.append((labels[0], float(rate), speed))
        for name, rate, speed in moving:
            if rate > speed * (1 + ROUNDING):
                raise LinkworkError(
                    f"at the {what} {name!r} moves at {rate:.6g}, above its limit of speed "
                    f"{speed:.6g}; give a slower {what}, or a higher limit"
                )


def refuse_unlimited(robot: Robot, limits: ActuatorLimits) -> None:
    """Refuse actuators that nothing limits, whose forces grow as intervals get shorter."""
    given = limits.of_robot(robot)
    for k, name in enumerate(robot.actuators):
        if not any(np.isfinite(given[kind][k]) for kind in given):
            raise LinkworkError(
                f"nothing limits the actuator {name!r}, which would push without bound for ever "
                "shorter times; limit its force, speed, acceleration or power, too"
            )
