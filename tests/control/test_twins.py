"""One name and one order for each thing: former ones lead there, with a warning."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, PID, ComputedTorque, PDWithGravity, SlidingMode

from tests.catalogue import built

FORMER = {
    "behind the goal": lambda r: (
        ComputedTorque(r.home, r, 40.0, 8.0),
        ComputedTorque(r.home, 40.0, 8.0, r),
        "ComputedTorque(goal, kp, kd, model)",
    ),
    "with names": lambda r: (
        ComputedTorque(r.home, r, kp=40.0, kd=8.0),
        ComputedTorque(r.home, kp=40.0, kd=8.0, model=r),
        "ComputedTorque(goal, kp, kd, model)",
    ),
    "sliding": lambda r: (
        SlidingMode(r.home, r, 4.0, 9.0, 0.1),
        SlidingMode(r.home, 4.0, 9.0, 0.1, r),
        "SlidingMode(goal, slope, gain, boundary, model)",
    ),
    "gravity": lambda r: (
        PD(r.home, 40.0, 8.0, r),
        PDWithGravity(r.home, 40.0, 8.0, r),
        "PDWithGravity(goal, kp, kd, model)",
    ),
}


@pytest.mark.parametrize("case", FORMER)
def test_former_orders_mean_the_same_and_warn(case):
    robot = built("double_pendulum")
    start = robot.state([0.2, -0.1])
    with pytest.warns(DeprecationWarning) as told:
        former, present, now = FORMER[case](robot)
    (one,) = told
    assert str(one.message).endswith(f" is {now} now") and one.filename == __file__
    seen = robot.observe(start)
    assert np.array_equal(former(0.0, seen), present(0.0, seen)) and present.settled
    assert np.abs(present(0.0, seen)).max() > 0.1


@pytest.mark.filterwarnings("error")
def test_present_orders_do_not_warn():
    robot = built("double_pendulum")
    gains = dict.fromkeys(robot.actuators, 4.0)
    PD(robot.home, gains, np.float64(1.0))
    PID(robot.home, 1.0, 1.0, robot, ki=1.0)
    ComputedTorque(robot.home, gains, gains, robot)
    ComputedTorque(goal=robot.home, model=robot, kp=np.float64(1.0), kd=1)
    with pytest.raises(TypeError, match="model"):
        PDWithGravity(robot.home, 1.0, 1.0)  # pyright: ignore[reportCallIssue]
    assert lw.control.LAWS[1] is PDWithGravity
