"""Reversals: the places on a driven way at which a joint's rate changes its sign, and dry friction
with it, looked at more closely than a grid does.

Left and right of such a place friction is at its largest, within a part of an interval that falls
with the rate at which it is smoothed. What is not friction hardly changes there: the way is gone on
with from its samples by cubics,

    q(s) from q, q' at both ends,    v(s) from v, v',    v'(s) linear,

and looked at at distances from the place that fall by equal ratios.
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.reference import unit
from linkwork.model.state import Motion, with_positions
from linkwork.motions.driven_way import DrivenWay

LADDER = 0.5 ** np.concatenate([np.arange(-3.5, 3.0, 0.125), np.arange(3.0, 15.0)])
"""Distances, over that between two samples: closest where what is not friction changes as well."""
HALVINGS = 40  # of the interval in which a rate's zero is found


def reversals(way: DrivenWay) -> DrivenWay | None:
    """Return the way around the places where rates change their signs, and next to its ends, where
    the robot rests; None where no force but the bodies' inertia depends on rates."""
    if way.smooth:
        return None
    motion, last = way.motion, len(way.motion.time) - 1
    signs = np.sign(motion.joint_rates)
    k, joints = np.nonzero(signs[:-1] * signs[1:] < 0)
    # The rate's zero between two samples, in parts of their distance.
    h = np.diff(motion.time)[k]
    ends = [motion.joint_rates[rows, joints] for rows in (k, k + 1)]
    slopes = [motion.joint_accelerations[rows, joints] * h for rows in (k, k + 1)]
    low, high = np.zeros(k.size), np.ones(k.size)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        before = cubic(ends, slopes, middle) * ends[0] > 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    steps = np.concatenate([-LADDER[::-1], [0.0], LADDER])
    part = np.concatenate([k + low, [0.0, last]])[:, None] + steps
    return between(way, np.unique(part[(part > 0) & (part < last)]))


def between(way: DrivenWay, places: np.ndarray) -> DrivenWay:
    """Return the way at places (K,) between its samples, in their numbers."""
    robot, motion = way.robot, way.motion
    k = np.minimum(places.astype(int), len(motion.time) - 2)
    part, state = places - k, motion.state
    h = (motion.time[k + 1] - motion.time[k])[:, None]
    D = robot.least(robot.joints_asked(())).outputs(state.q)["derivatives"]
    q_dot = (D @ robot.chart.tree_rates(state.q, state.rates)[..., None])[..., 0]

    def along(values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        return cubic([values[k], values[k + 1]], [rates[k] * h, rates[k + 1] * h], part[:, None])

    def linear(values: np.ndarray) -> np.ndarray:
        return values[k] + part[:, None] * (values[k + 1] - values[k])

    q = unit(robot.equations.tree, along(state.q, q_dot))
    made = robot.make_state(q, along(state.rates, motion.accelerations))
    positions = robot.labels.nearest(made.positions, state.positions[k])
    led = Motion(
        motion.time[k] + part * h[:, 0],
        with_positions(made, positions),
        linear(motion.accelerations),
        along(motion.joint_rates, motion.joint_accelerations),
        linear(motion.joint_accelerations),
        linear(motion.tool),
    )
    return DrivenWay(robot, led)


def cubic(ends: list[np.ndarray], slopes: list[np.ndarray], part: np.ndarray) -> np.ndarray:
    """Return the cubics at a part of the way from one end to the other; slopes: over the way."""
    (a, b), (da, db), t = ends, slopes, part
    return a + t * (da + t * (3 * (b - a) - 2 * da - db + t * (2 * (a - b) + da + db)))
