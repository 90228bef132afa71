"""Path following: motions of a robot whose tool is led along a path.

Samples that are asked for may lie so far apart that they do not tell the way between them: whole
circles, whole turns of a joint. Then the path is led along in parts of each interval, halved until
the path's values half way are those that its values, rates and accelerations at both ends foretell,

    x(h/2) = (x_0 + x_1) / 2 + 5 h (x'_0 - x'_1) / 32 + h^2 (x''_0 + x''_1) / 64

but for a small part, and until no joint whose turns are counted turns far from one to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import needed, shown
from linkwork.errors import LinkworkError
from linkwork.model import checks, task
from linkwork.model.asked import ToolAsked
from linkwork.model.assembling import wound
from linkwork.model.led_path import (
    ANOTHER,
    FLOOR,
    ROUGH,
    Prescribed,
    Sampled,
    led_along,
    require_one_arc,
)
from linkwork.model.posing import start_of
from linkwork.model.state import Motion, State, with_positions
from linkwork.paths import Path

if TYPE_CHECKING:
    from linkwork.model.model import Model

MOST_SAMPLES = 10_000_000
MOST_PARTS = 65_536  # of all intervals between samples, unless these are more
NEAR = 1.0  # how far angles go in half a part, and joints in one [rad]


def follow(
    robot: Model,
    path: Path,
    duration: float,
    samples: int,
    guess: State | None,
    what: Sequence[str] | None,
) -> Motion:
    """Lead the tool along a path: `Robot.follow`."""
    # What is asked for is a motion along a path of whole poses.
    duration = checks.positive(duration, "the duration")
    if not isinstance(samples, int) or samples < 2:
        raise LinkworkError(
            f"a motion needs a whole number of samples, at least 2, not {shown(samples)}"
        )
    if samples > MOST_SAMPLES:
        raise LinkworkError(
            f"a motion of {samples} samples does not fit into memory; give at most {MOST_SAMPLES}"
        )
    needed(path, Path, "linkwork.paths")
    robot.require_tool()

    def moving(times: np.ndarray) -> list[np.ndarray]:
        return [checks.finite(part, "the path") for part in path.sample(times, duration)]

    time = np.linspace(0, duration, samples)
    poses = moving(time)[0]
    asked = require_full_pose(robot, poses.shape[1], what)

    def sampled(times: np.ndarray) -> Prescribed:
        return Prescribed(asked, times, *asked.given_motion(*moving(times)))

    # In parts of the intervals where the samples do not tell the way between them.
    parts, most = 1, MOST_PARTS // (samples - 1)
    while 2 * parts <= most and not tells_way(sampled, duration, parts * (samples - 1)):
        parts *= 2
    motion = led_in_parts(robot, sampled, duration, samples, parts, guess)
    while not (sure := turns_told(robot, motion)).all():
        if 2 * parts > most:
            raise LinkworkError(
                f"at t = {motion.time[np.argmin(sure)]:.6g} s: joints turn so fast that samples do "
                "not tell their whole turns; take more samples, or lead the path around"
            )
        parts *= 2
        motion = led_in_parts(robot, sampled, duration, samples, parts, guess)
    # The samples that were asked for.
    kept = slice(None, None, parts)
    return Motion(
        time,
        motion.state.at(kept),
        motion.accelerations[kept],
        motion.joint_rates[kept],
        motion.joint_accelerations[kept],
        poses,
        asked.labels,
    )


def led_in_parts(
    robot: Model, sampled: Sampled, duration: float, samples: int, parts: int, guess: State | None
) -> Motion:
    """Return the motion along a path at samples and between them."""
    time = np.linspace(0, duration, parts * (samples - 1) + 1)
    # The first pose as any other; the next ones from those before, moved on by their rates.
    way = sampled(time)
    leader = robot.leader_of_tool(way.asked, kept=True)
    led = led_along(leader, robot.assembler, start_of(robot, guess).q, way)
    v, v_dot = (robot.chart.from_tree(each) for each in led[1:])
    # One branch all the way.
    if not (kept := leader.keeps(led[0])).all():
        raise LinkworkError(f"at t = {time[np.argmin(kept)]:.6g} s: {ANOTHER}")
    along = require_one_arc(leader, robot.assembler, led, way, sampled)
    # Angles without jumps, ahead by the turns that the guess had.
    made = robot.make_state(along, v)
    positions, joint_rates, joint_accelerations, _ = robot.kernel("joints_motion")(
        made.q, made.rates, v_dot
    )
    positions = robot.labels.unwrapped(time, positions, joint_rates)
    first = wound(robot, made.at(0), robot.home if guess is None else guess)
    turns = robot.labels.windings(first.positions, positions[0])
    made = with_positions(made, robot.labels.turned(positions, turns))
    return Motion(time, made, v_dot, joint_rates, joint_accelerations, way.y, way.asked.labels)


def tells_way(sampled: Sampled, duration: float, intervals: int) -> bool:
    """Tell whether a path's values, rates and accelerations at the ends of its intervals foretell
    what it is half way, and its angles do not go far."""
    way = sampled(np.linspace(0, duration, 2 * intervals + 1))
    h, (y, dy, ddy) = duration / intervals, (each[::2] for each in way.values)
    foretold = (y[1:] + y[:-1]) / 2 - 5 * h / 32 * np.diff(dy, axis=0)
    off = np.abs(foretold + h**2 / 64 * (ddy[1:] + ddy[:-1]) - way.y[1::2])
    steps = np.abs(np.diff(way.y, axis=0))[:, ~way.asked.lengths]
    told = off <= ROUGH * np.ptp(way.y, axis=0) + FLOOR * way.asked.units
    return bool(told.all() and steps.max(initial=0.0) <= NEAR)


def turns_told(robot: Model, motion: Motion) -> np.ndarray:
    """Tell of intervals (K) whether the joints turn so little in them that no turn that is read
    with jumps goes unseen."""
    if not robot.labels.may_jump:
        return np.ones(len(motion.time) - 1, bool)
    fastest = np.abs(motion.joint_rates[:, robot.labels.turning]).max(axis=1)
    return np.diff(motion.time) * np.maximum(fastest[1:], fastest[:-1]) <= NEAR


def require_full_pose(robot: Model, size: int, what: Sequence[str] | None) -> ToolAsked:
    """Return what a path of so many coordinates asks for; refuse other than as many as freedoms."""
    asked, needed = task.asked_of(robot, size, what), task.freedoms(robot)
    if size != needed:
        besides = " besides spins of members about themselves" if robot.spins else ""
        most = 3 if robot.planar else 6
        besides += f", more than the {most} that lead a tool" if needed > most else ""
        raise LinkworkError(
            f"the path prescribes {size} coordinates of the tool, but the mobility is "
            f"{needed}{besides}; "
            + (f"prescribe {needed}" if needed <= most else "simulate it with a controller instead")
        )
    return asked
