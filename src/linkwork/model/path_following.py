"""Path following: motions of a robot whose tool is led along a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import shown
from linkwork.errors import LinkworkError
from linkwork.model import checks, task
from linkwork.model.asked import ToolAsked
from linkwork.model.assembling import wound
from linkwork.model.led_path import ANOTHER, Prescribed, led_along, require_one_arc
from linkwork.model.posing import start_of
from linkwork.model.state import Motion, State, with_positions
from linkwork.paths import Path

if TYPE_CHECKING:
    from linkwork.model.model import Model

MOST_SAMPLES = 10_000_000


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
    checks.positive(duration, "the duration")
    if not isinstance(samples, int) or samples < 2:
        raise LinkworkError(
            f"a motion needs a whole number of samples, at least 2, not {shown(samples)}"
        )
    if samples > MOST_SAMPLES:
        raise LinkworkError(
            f"a motion of {samples} samples does not fit into memory; give at most {MOST_SAMPLES}"
        )
    if not isinstance(path, Path):
        raise LinkworkError(f"the path is {shown(path)}; give one made by linkwork.paths")
    time = np.linspace(0, duration, samples)
    robot.require_tool()

    def moving(times: np.ndarray) -> list[np.ndarray]:
        return [checks.finite(part, "the path") for part in path.sample(times, duration)]

    poses, *derivatives = moving(time)
    asked = require_full_pose(robot, poses.shape[1], what)

    def sampled(times: np.ndarray) -> Prescribed:
        return Prescribed(asked, times, *asked.given_motion(*moving(times)))

    # The first pose as any other; the next ones from those before, moved on by their rates.
    way = Prescribed(asked, time, *asked.given_motion(poses, *derivatives))
    leader = robot.leader_of_tool(asked, kept=True)
    led = led_along(leader, robot.assembler, start_of(robot, guess), way)
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
    return Motion(time, made, v_dot, joint_rates, joint_accelerations, poses, asked.labels)


def require_full_pose(robot: Model, size: int, what: Sequence[str] | None) -> ToolAsked:
    """Return what a path of so many coordinates asks for; refuse other than as many as freedoms."""
    asked, needed = task.asked_of(robot, size, what), task.freedoms(robot)
    if size != needed:
        besides = " besides spins of members about themselves" if robot.spins else ""
        raise LinkworkError(
            f"the path prescribes {size} coordinates of the tool, but the mobility is "
            f"{needed}{besides}; prescribe {needed}"
        )
    return asked
