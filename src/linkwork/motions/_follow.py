"""Following: a robot along a timed path of its joints or of its tool."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.model import limits
from linkwork.model.state import Motion, State, with_positions
from linkwork.model.task import asked_of, freedoms
from linkwork.motions._flat import flat_along, leads_links
from linkwork.motions.leaps import require_no_leap
from linkwork.motions.timed_paths import TimedPath, sample_count
from linkwork.robot import Robot

STRIDE = 1.0  # by which joints are led at a time [rad]
WORST = 1e8  # condition of the map from independent rates to those that are given


def follow(
    robot: Robot,
    timed: TimedPath,
    *,
    samples: int = 101,
    guess: State | None = None,
    keep_limits: bool = True,
    what: Sequence[str] | None = None,
) -> Motion:
    """Lead a robot along a timed path: positions, rates and accelerations of all joints.

    Of joints' coordinates x = A q, with A L the rows of the rate map that belong to them:

        v = (A L)^-1 x',    v' = (A L)^-1 (x'' - A L' v)

    Args:
        robot: of which the path has joint coordinates by name, as many as its mobility, or those of
            its tool (then as `Robot.follow`), or those of the links that motors drive through
            springs (then as `flat`).
        timed: the path and its duration.
        samples: number of equally spaced times from 0 to T.
        guess: a state on the wanted branch, near the first point; `home` if left out.
        keep_limits: refuse a motion that leaves the range of a joint, or moves one faster than its
            limit of speed.
        what: names of the coordinates of the tool that the path leads, as `Robot.follow` takes
            them; those of its `task`, or of its pose, if left out. A table that has columns of
            these names leads the tool, not joints: `follow(robot, read_csv(file, what),
            what=what)`.

    Returns:
        A `Motion`, for `robot.inverse_dynamics`, controllers, plots and tables.

    Raises:
        UnreachableError: a point out of reach, by its number, or the time and the points between
            which the path leaves the workspace.
        LinkworkError: joints that do not determine the motion, or go on beyond where they do, to
            another assembly mode; one that leaves its range, or is too fast.
    """
    if not isinstance(timed, TimedPath):
        raise LinkworkError(
            f"what is followed is {checks.shown(timed)}; give a timed path made by "
            "linkwork.motions, or lead the tool along other paths by robot.follow"
        )
    checks.needed(robot, Robot)
    checks.switch(keep_limits, "keep_limits")
    samples = sample_count(samples)
    if what is not None:
        timed, what = of_tool(timed, checks.names(what, "what"))
    require_vectors(robot, timed, what)
    if what is None:
        require_places(robot, timed)
    links = bool(timed.names) and leads_links(robot, timed.names)
    if not links:
        require_points(robot, timed, guess, what)
    if links:
        motion = flat_along(robot, timed, samples, guess)
    elif timed.names:
        motion = of_joints(robot, timed, samples, guess)
    else:
        motion = robot.follow(timed.path, timed.duration, samples=samples, guess=guess, what=what)
    told = motion.positions, motion.joint_rates, motion.time
    if keep_limits and (beyond := limits.passed(robot, *told)):
        cure = "give the path more time" if "limit of speed" in beyond[0] else "move the points"
        raise LinkworkError(f"{beyond[0]}; {cure}, or allow it by follow(..., keep_limits=False)")
    return motion


def of_tool(timed: TimedPath, what: tuple[str, ...]) -> tuple[TimedPath, tuple[str, ...]]:
    """Return a path of the tool's coordinates of these names, as a table of them is; refuse another
    number of them than the path has, and a path of joints."""
    if sorted(timed.names) == sorted(what) and timed.names != what:
        raise LinkworkError(
            f"the path leads {', '.join(timed.names)}, in this order; give "
            f"what={checks.shown(timed.names)}"
        )
    if timed.names and timed.names != what:
        raise LinkworkError(
            f"the path leads the joints {', '.join(timed.names)}; leave what={checks.shown(what)} "
            "out, or give a path of the tool"
        )
    if len(what) != (size := size_of(timed)):
        raise LinkworkError(
            f"what={checks.shown(what)} names {len(what)} coordinates, but the path leads {size}"
        )
    return replace(timed, names=()), what


def size_of(timed: TimedPath) -> int:
    """Return how many coordinates a path leads."""
    return timed.sample(np.zeros(1))[0].shape[1]


def require_vectors(robot: Robot, timed: TimedPath, what: Sequence[str] | None) -> None:
    """Refuse points that were led on by a whole turn for a tool that no rotation vector leads."""
    asked = asked_of(robot, 6, what) if timed.turned else None
    if asked and asked.rotation != [3, 4, 5]:
        raise LinkworkError(
            f"point {timed.turned[0]} was taken for a rotation vector and led on by a whole turn, "
            f"to the point before, but the tool is led in {', '.join(asked.labels)}; go there by "
            "points that are nearer to each other"
        )


def require_places(robot: Robot, timed: TimedPath) -> None:
    """Refuse a list of moves for a tool whose first coordinates are not its place."""
    if not (timed.places and robot.mechanism.tools):
        return
    size, place = size_of(timed), ["x", "y", "z"][: timed.places]
    led = asked_of(robot, size).labels
    if [*led[: len(place)]] != place:
        raise LinkworkError(
            f"the list of moves leads {', '.join(place)}, but the tool is led in "
            f"{', '.join(led)}; name by what= the {size} coordinates that it is to lead"
        )


def require_points(
    robot: Robot, timed: TimedPath, guess: State | None, what: Sequence[str] | None
) -> None:
    """Refuse points of the path that are out of reach, by their number, going from one to the
    next."""
    if timed.names:
        require_joints(robot, timed.names)
    if not timed.passed:
        return
    points = timed.sample(np.array(timed.passed))[0]
    for k, (time, point) in enumerate(zip(timed.passed, points, strict=True)):
        with checks.at(f"point {k} (t = {time:.6g} s): "):
            guess = placed(robot, timed.names, point, guess, what)


def require_joints(robot: Robot, names: tuple[str, ...]) -> None:
    """Refuse coordinates that are not led by themselves, and another number than the mobility."""
    checks.known(names, robot.coordinates, "joint")
    for name in names:
        if name not in robot.rates:
            raise LinkworkError(
                f"{name!r} is part of a quaternion and is not led alone; lead the tool's pose"
            )
    needed = freedoms(robot)
    if len(names) != needed:
        raise LinkworkError(
            f"{checks.amount_is(len(names), 'joint')} led, but {needed} determine the motion, for "
            "instance "
            f"{', '.join(name for name in robot.independent if name not in robot.spins)}"
        )


def placed(
    robot: Robot,
    names: tuple[str, ...],
    point: np.ndarray,
    guess: State | None,
    what: Sequence[str] | None = None,
) -> State:
    """Return the state at joint coordinates by name, or at a pose of the tool."""
    if not names:
        led = point if what is None else dict(zip(what, point.tolist(), strict=True))
        return robot.assemble(tool=led, guess=guess)
    return robot.assemble(dict(zip(names, point.tolist(), strict=True)), guess=guess)


def of_joints(robot: Robot, timed: TimedPath, samples: int, guess: State | None) -> Motion:
    """Return the motion that joint coordinates over time determine."""
    motion = sampled(robot, timed, np.linspace(0, timed.duration, samples), guess)
    require_no_leap(robot, motion, timed.names, partial(sampled, robot, timed))
    return motion


def sampled(robot: Robot, timed: TimedPath, time: np.ndarray, guess: State | None) -> Motion:
    """Return the motion at some times, each state led to from the one before."""
    values, rates, accelerations = (checks.finite(part, "the path") for part in timed.sample(time))
    # In strides where samples are so far apart that other joints may have taken a turn.
    angles = [robot.unit(name) == "rad" for name in timed.names]
    turned = np.abs(np.diff(values[:, angles], axis=0)).max(axis=1, initial=0.0)
    strides = [0, *np.floor(turned / STRIDE).astype(int)]
    states = []
    for k, point in enumerate(values):
        with checks.at(f"at t = {time[k]:.6g} s{between(timed, time[k])}: "):
            ahead = np.linspace(time[k - 1], time[k], strides[k] + 2)[1:-1] if strides[k] else None
            for led in (point,) if ahead is None else (*timed.sample(ahead)[0], point):
                guess = placed(robot, timed.names, led, guess)
        states.append(guess)
    still = joined(states)
    # Rates and accelerations from those of the joints that are led.
    rows = [robot.rates.index(name) for name in timed.names]
    A = robot.rate_map(still)[:, rows]
    require_determined(A, time, timed.names)
    inverse = np.linalg.pinv(A)
    v = (inverse @ rates[..., None])[..., 0]
    made = still.with_rates(v)
    bias = robot.joint_accelerations(made, np.zeros(robot.mobility))[:, rows]
    v_dot = (inverse @ (accelerations - bias)[..., None])[..., 0]
    tool = robot.tool_pose(made) if robot.mechanism.tools else np.zeros((time.size, 0))
    return Motion(
        time, made, v_dot, robot.joint_rates(made), robot.joint_accelerations(made, v_dot), tool
    )


def joined(states: list[State]) -> State:
    """Return single states as a stack."""
    first = states[0]
    zero = np.zeros((len(states), len(first.independent)))
    stack = State.known(
        np.empty(0), zero, np.array([s.q for s in states]), first.coordinates, first.independent
    )
    return with_positions(stack, np.array([s.positions for s in states]))


def require_determined(A: np.ndarray, time: np.ndarray, names: tuple[str, ...]) -> None:
    """Refuse times at which the joints that are led do not determine the others."""
    values = np.linalg.svd(A, compute_uv=False)
    weak = ~(values[:, -1] * WORST > values[:, 0])
    if weak.any():
        raise LinkworkError(
            f"at t = {time[np.argmax(weak)]:.6g} s: {', '.join(names)} do not determine the "
            "motion; lead other joints, or around this pose"
        )


def between(timed: TimedPath, time: float) -> str:
    """Say between which points of a path a time is."""
    if len(timed.passed) < 3:
        return ""
    k = min(max(bisect_right(timed.passed, time), 1), len(timed.passed) - 1)
    return f", between point {k - 1} and point {k}"
