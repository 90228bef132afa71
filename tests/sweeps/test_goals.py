"""Goals of studies: what controllers follow of them."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.simulation import Sampled
from linkwork.sweeps.goals import Circle

from tests.oracle.scaling import Scale


@pytest.mark.parametrize("L", [1e-6, 1.0, 1e4])
def test_the_spline_that_is_followed_is_the_path_at_any_size(L):
    robot = lw.Robot(Scale(lw.robots.prr3(), L).mechanism)
    x, y, angle = robot.tool_pose(robot.home)
    goal = Circle(centre=(float(x), float(y)), radius=0.002 * L, orientation=float(angle))
    told = goal.reached(robot, robot.home, 1.0, 9)
    finer = robot.follow(goal.path, 1.0, samples=401, guess=robot.home)
    led, found = (
        np.stack([each.state[name] for name in robot.actuators], axis=-1) for each in (told, finer)
    )
    off = np.abs(Sampled(told.time, led)(finer.time) - found)
    assert off.max() < 1e-5 * np.ptp(found, axis=0).min()
