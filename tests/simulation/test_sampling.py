"""Sampled controllers with zero-order hold, against sampled-data theory, with every method."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from simulation_problems import (
    count_rate,
    counter_of_point,
    driven_point,
    failing_control,
    held_rate,
    servo,
)

from linkwork.errors import LinkworkError
from linkwork.simulation import DORMAND_PRINCE, RK4, Control, Status, clock, dop853, integrate

METHODS = pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, dop853(), RK4(0.0125)], ids=lambda method: method.name
)
PERIOD, GAIN = 0.05, 4.0


def sampled_data(count):
    """The states at the sample times of q'' = u, u = -GAIN (q - 1) - v / 2 held over a period."""
    A, b = np.array([[1, PERIOD], [0, 1]]), np.array([PERIOD**2 / 2, PERIOD])
    states = [np.zeros(2)]
    for _ in range(count):
        q, v = states[-1]
        states.append(A @ states[-1] + b * (-GAIN * (q - 1) - v / 2))
    return np.array(states)


def position(method=DORMAND_PRINCE, duration=2.0, held=(0.0,), **options):
    control = Control(servo.address, PERIOD, np.array(held))
    return integrate(
        driven_point.address, None, [0.0], [0.0], [1.0], [GAIN],
        **{"duration": duration, "method": method, "control": control} | options,
    )  # fmt: skip


@METHODS
def test_a_held_input_gives_the_discrete_motion_exactly(method):
    t = np.arange(41) * PERIOD
    run = position(method, save_at=t)
    np.testing.assert_allclose(np.hstack([run.q, run.v]), sampled_data(40), atol=1e-12)


def test_matrices_of_the_discrete_motion_are_right():
    M = expm(np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]]) * PERIOD)
    np.testing.assert_allclose(M[:2, 2], [PERIOD**2 / 2, PERIOD])


def test_saved_inputs_are_the_signal_and_the_held_one_that_acts_from_there_on():
    run = position(save_at=[0.0, 0.01, 0.05, 0.06, 0.1])
    q, v = sampled_data(2).T
    u = -GAIN * (q - 1) - v / 2
    np.testing.assert_allclose(run.u[:, 1], u[[0, 0, 1, 1, 2]], atol=1e-12)
    np.testing.assert_array_equal(run.u[:, 0], 1)


@METHODS
def test_samples_lie_at_exact_multiples_of_the_period(method):
    """A controller that counts its samples: q' = number of samples so far, 1000 Hz for 3 s."""
    control = Control(count_rate.address, 1e-3, np.zeros(1))
    run = integrate(
        held_rate.address,
        None,
        [0.0],
        [],
        [],
        duration=3.0,
        control=control,
        method=method,
        save_at=[1.5, 3.0],
    )
    assert run.control is not None
    assert run.control.held[0] == run.control.next_sample == 3000
    assert run.q[:, 0] == pytest.approx([1500 * 1501 / 2 * 1e-3, 3000 * 3001 / 2 * 1e-3], rel=1e-12)


def test_a_run_that_starts_between_two_samples_holds_what_it_is_given():
    run = position(start=0.02, duration=0.03, held=[6.0])
    assert run.v_end[0] == pytest.approx(6.0 * 0.03)
    assert run.control is not None and run.control.next_sample == 1


@METHODS
def test_a_run_continued_from_a_sample_time_samples_once(method):
    control = Control(count_rate.address, PERIOD, np.zeros(1))
    options = {"method": method, "duration": 0.5}
    whole = integrate(held_rate.address, None, [0.0], [], [], control=control, **options)
    part = integrate(
        held_rate.address, None, [0.0], [], [], control=control, max_steps=3, **options
    )
    assert part.status is Status.TOO_MANY_STEPS
    rest = integrate(
        held_rate.address, None, part.q_end, [], [], start=part.end_time, control=part.control,
        first_step=part.pace, **options | {"duration": 0.5 - part.end_time},
    )  # fmt: skip
    assert (rest.q_end, rest.control.held) == (whole.q_end, whole.control.held)


def test_samples_and_breaks_and_a_clock_go_together():
    """q'' = u_1, u_1 = samples so far; the signal is the clock, unused by the motion."""
    run = integrate(
        driven_point.address, None, [0.0], [0.0], clock(), [1.0], duration=0.3,
        control=Control(counter_of_point.address, 0.1, np.zeros(1)),
    )  # fmt: skip
    assert run.v_end[0] == pytest.approx(0.1 * (1 + 2 + 3), abs=1e-14)


@METHODS
def test_a_controller_that_fails_ends_the_run_at_its_sample(method):
    control = Control(failing_control.address, PERIOD, np.zeros(1))
    run = integrate(
        held_rate.address, None, [0.0], [], [], duration=1.0, control=control, method=method
    )
    assert run.status is Status.NON_FINITE
    assert run.end_time == pytest.approx(0.3, abs=PERIOD + 1e-9)
    assert "held input 0 (counted from 0) is infinite or undefined" in run.message
    assert np.isfinite(run.q).all()


@pytest.mark.parametrize("period", [0.0, -0.1, math.inf, math.nan])
def test_periods_that_are_none_are_refused(period):
    with pytest.raises(
        LinkworkError, match="period of a sampled controller must be positive and finite"
    ):
        Control(count_rate.address, period, np.zeros(1))
