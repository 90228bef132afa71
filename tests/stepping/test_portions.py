"""Very many steps at once: Ctrl-C is heard between portions of them, which change no bit."""

import signal

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import four_bar

STEPS, PORTION = 2000, 300


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot(four_bar())


@pytest.fixture
def turning(robot) -> lw.State:
    """A crank that turns through several charts."""
    return robot.home.with_rates([9.0])


@pytest.mark.parametrize("many", [False, True], ids=["one", "many"])
def test_portions_change_no_bit_and_after_ctrl_c_the_next_step_goes_on(robot, turning, many):
    begun = (
        robot.state(np.tile(turning.positions, (3, 1)), {"crank_pivot": 9.0}) if many else turning
    )
    whole, parts = robot.stepper(begun, 1e-3), robot.stepper(begun, 1e-3)
    assert whole._portion > STEPS > PORTION
    parts._portion = PORTION
    expected = whole.step(steps=STEPS)

    own, taken = parts._take, []

    def take(*given) -> None:
        own(*given)
        taken.append(given[-1])
        if len(taken) == 2:
            signal.raise_signal(signal.SIGINT)

    parts._take = take
    with pytest.raises(KeyboardInterrupt):
        parts.step(steps=STEPS)
    assert taken == [PORTION] * 2
    np.testing.assert_allclose(parts.time, 2 * PORTION * 1e-3, rtol=1e-12)
    np.testing.assert_array_equal(parts.step(steps=STEPS - 2 * PORTION), expected)
    assert taken[2:] == [PORTION] * 4 + [STEPS - 6 * PORTION]
