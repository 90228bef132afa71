"""A motion is followed by a spline through its samples: where these are too few for it, this is
warned of, and otherwise it is the motion."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.control.goals import target
from linkwork.errors import ModelWarning

from tests.catalogue import built


def circle(turns: int, samples: int) -> lw.Motion:
    path = lw.paths.circle((0.5, 0.29), 0.03, 1.2, turns=turns)
    return built("prr3").follow(path, 5.0, samples=samples)


@pytest.mark.sample(4)
@pytest.mark.parametrize("turns", [1, 20])
@pytest.mark.parametrize("each", [5, 10, 20, 40])
def test_a_goal_is_the_motion_or_is_warned_of(turns, each):
    """Between the samples, where one of eight thousand tells what was meant."""
    robot, motion = built("prr3"), circle(turns, turns * each + 1)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ModelWarning)
        led = target(motion, robot.names)
    meant = circle(turns, 8001)
    places = [robot.coordinates.index(name) for name in robot.actuators]
    wanted = meant.positions[:, places]
    off = np.abs(led.positions(meant.time) - wanted).max() / np.ptp(wanted, axis=0).max()
    assert (off < 0.003) == (not told) == (each >= 20)


@pytest.mark.parametrize("law", [lw.control.ComputedTorque, lw.control.TaskComputedTorque])
def test_controllers_warn_of_few_samples(law):
    robot, motion = built("prr3"), circle(20, 101)
    follow = law(motion, kp=400.0, kd=40.0, model=robot)
    with pytest.warns(ModelWarning, match="the 101 samples of the motion are few"):
        robot.simulate(motion.state.at(0), follow, duration=0.01)


def test_samples_at_rest_of_a_spline_that_moves_are_few():
    """Two places that are left and come to at rest, of which a straight spline knows nothing."""
    robot, motion = built("prr3"), circle(1, 21)
    ends = motion.state.at(np.array([0, 5]))
    still = replace(motion, time=motion.time[[0, 5]], state=ends.with_rates(0 * ends.rates))
    with pytest.warns(ModelWarning, match="differ by 1 of the largest"):
        target(still, robot.names)
