"""Whole turns of joints that close loops, where what acts on a stepper reads them."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Sampler

TURN, DT = 2 * np.pi, 1e-3


@pytest.fixture(scope="module")
def bennett():
    """Opposite angles turn by as much, one of them against the other; hinge_3 is read by the arc
    tangent."""
    robot = lw.Robot(lw.robots.bennett())
    assert robot.labels.jumping == ["hinge_3"]
    return robot


def pull(t, state):
    """Return a torque that follows the turns of a hinge that closes the loop."""
    return [0.02 * state["hinge_3"]]


def opposite(robot: lw.Robot, turned: np.ndarray) -> None:
    """hinge_3 has turned as far as hinge_1, against it, some turns."""
    turned = turned - robot.home.positions
    assert abs(turned[..., 0]).min() > 2 * TURN
    np.testing.assert_allclose(turned[..., 2], -turned[..., 0], atol=1e-9)


@pytest.mark.parametrize("law", [pull, Sampler(pull, rate=200)])
def test_turns_that_act_are_told_and_go_on(bennett, law):
    """Asked for once, after all turns, and by who goes on from there: the motion is that of one
    run."""
    start, given = bennett.home.with_rates([20.0]), {"method": "rk4", "step": DT}
    whole = bennett.simulate(start, law, duration=2.0, **given)
    stepper = bennett.stepper(start, DT, law)
    stepper.step(steps=1000)
    then = stepper.run
    opposite(bennett, stepper.positions)
    rest = bennett.resume(then, law, duration=1.0, **given)
    opposite(bennett, rest.final.positions)
    assert rest.final.rates == pytest.approx(whole.final.rates, rel=1e-9)
    again = bennett.stepper(then, DT, law)
    again.step(steps=1000)
    assert again.v == pytest.approx(whole.final.rates, rel=1e-9)


def test_turns_of_each_that_act_are_told_and_go_on(bennett):
    states = bennett.state(np.tile(bennett.home.positions, (2, 1)), [[20.0], [-25.0]])
    many = bennett.stepper(states, DT, pull)
    many.step(steps=1000)
    opposite(bennett, many.alone(1).positions)
    opposite(bennett, many.states.positions)
    one = many.alone(0)
    many.step()
    np.testing.assert_allclose(one.step(), many.y[0], rtol=1e-10)


def test_turns_that_act_and_have_no_state_are_refused():
    """The tip of a five-bar is read without a jump: what begins turned has a state for it, what
    does not has none."""
    robot = lw.Robot("five_bar")
    at_tip = np.array([name == "tip" for name in robot.coordinates])
    turned = robot.state(robot.home.positions + TURN * at_tip)

    def law(t, state):
        return [0.02 * state["tip"], 0.0]

    stepper = robot.stepper(robot.home, DT, law)
    with pytest.raises(lw.LinkworkError, match="whole turns of tip, which what acts reads"):
        stepper.reset(turned)
    robots = robot.stepper(robot.state(np.tile(robot.home.positions, (2, 1))), DT, law)
    with pytest.raises(lw.LinkworkError, match="make a stepper of this state"):
        robots.reset(0, turned)
    made = robot.stepper(turned, DT, law)
    for state in (robot.home, turned):  # who has a state for it may begin anew anywhere
        made.reset(state)
        made.step(steps=100)
        run = robot.simulate(state, law, duration=0.1, method="rk4", step=DT)
        np.testing.assert_allclose(made.positions, run.final.positions, rtol=1e-12)
