"""Angles that turn alone: once more, with all bodies where they are."""

from __future__ import annotations

import numpy as np

from linkwork.robot import Robot

ALIKE = 1e-9  # in own units, by which poses may differ that are one


def turns_alone(robot: Robot, label: str) -> bool:
    """Tell whether a joint coordinate is an angle that may turn once more with all bodies where
    they are, as that of a thread may not."""
    if robot.unit(label) != "rad" or not robot.joints_asked((label,)).wraps[0]:
        return False
    tree, q, still = robot.equations.tree, robot.home.q, np.zeros(robot.mobility)
    turned = np.array(q)
    turned[[tree.places[label]] if label in tree.places else []] += 2 * np.pi
    (p, R, *_), (p_turned, R_turned, *_) = (
        robot.kernel("bodies_motion")(each, still) for each in (q, turned)
    )
    away = np.abs(p_turned - p).max() / tree.length, np.abs(R_turned - R).max()
    return max(away) < ALIKE
