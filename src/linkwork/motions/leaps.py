"""Leaps: where joints that are led go on beyond what they determine, the mechanism would leap to
another assembly mode.

Coordinates that are led past a fold of the direct kinematics have no configuration near the last
one; the loops close elsewhere, if at all. Between two samples of one motion, though, rates and
accelerations at both tell the way,

    q_2 - q_1 = h (q'_1 + q'_2) / 2 + h^2 (q''_1 - q''_2) / 12

but for a small part. Where they do not, the interval is led through in parts, and these again,
until they do or are so short that the way is a leap if it is longer than rates at its ends take.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from linkwork.equations.algebra import wrapped
from linkwork.errors import LinkworkError
from linkwork.model.led_path import SAME, untold, ways_told
from linkwork.model.state import Motion, State
from linkwork.robot import Robot

PARTS, DEPTH = 16, 3  # of an interval, and how often these are parted themselves
LEAP, SEEN = 4.0, 1e-4  # how much longer a leap is than the longest way that rates tell, own units

Led = Callable[[np.ndarray, State], Motion]
"""A motion at some times, from a state."""


def require_no_leap(
    robot: Robot, motion: Motion, names: Sequence[str], led: Led, depth: int = DEPTH
) -> None:
    """Refuse a motion of joints that leaves its assembly mode between two samples.

    names: of the coordinates that are led; led: the same motion at other times
    """
    off, told, longest = ways_between(robot, motion)
    for k in untold(off, told):
        begin, end = motion.time[k : k + 2].tolist()
        leaps = (off[k] > LEAP * longest[k] + SEEN).any()
        if depth:
            finer = led(np.linspace(begin, end, PARTS + 1), motion.state.at(k))
            require_no_leap(robot, finer, names, led, depth - 1)
            ahead = way(robot, finer.positions[-1], motion.positions[k + 1])
            leaps = np.abs(ahead).max(initial=0.0) > SAME
        if leaps:
            raise LinkworkError(
                f"at t = {end:.6g} s: led by {', '.join(names)} the mechanism would leap to "
                "another assembly mode, for the path goes beyond a pose where these do not "
                "determine the motion; lead other joints, or around this pose"
            )


def ways_between(robot: Robot, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how far ways between samples differ from what rates and accelerations tell, this way,
    and the longest that either rates tell (samples - 1, joints), in own units."""
    h, x = np.diff(motion.time)[:, None], motion.positions
    units, _, rates = own_rates(robot)
    v, a = motion.joint_rates[:, rates], motion.joint_accelerations[:, rates]
    told = ways_told(h, v, a) / units
    longest = h * np.maximum(np.abs(v[1:]), np.abs(v[:-1])) / units
    return np.abs(way(robot, x[:-1], x[1:]) - told), np.abs(told), longest


def way(robot: Robot, x: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the ways from coordinates of all joints (..., m) to others, of those that have a rate
    of their own, without whole turns, in own units."""
    units, places, _ = own_rates(robot)
    change = other[..., places] - x[..., places]
    angles = [robot.unit(robot.coordinates[place]) == "rad" for place in places]
    return np.where(angles, wrapped(change), change) / units


def own_rates(robot: Robot) -> tuple[np.ndarray, list[int], list[int]]:
    """Return the units of coordinates that have a rate of their own, their places, and those of
    their rates."""
    places = [k for k, name in enumerate(robot.coordinates) if name in robot.rates]
    names = [robot.coordinates[place] for place in places]
    lengths = [robot.unit(name) == "m" for name in names]
    units = np.where(lengths, robot.equations.tree.length, 1.0)
    return units, places, [robot.rates.index(name) for name in names]
