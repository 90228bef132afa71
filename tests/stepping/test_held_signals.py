"""Forces that jump at multiples of the step, or within it, which are never seen a step too late."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import five_bar

from tests.control.plants import cart

STEP = 0.01
TIMES = {"multiples": np.linspace(0, 1, 11), "within": np.linspace(0, 1, 13)}
"""Of the multiples 0.3 s and 0.6 s are a rounding error behind those of the step."""
FORCES = np.arange(13.0) ** 1.5


def held(times: np.ndarray) -> lw.Sampled:
    return lw.Sampled(times, FORCES[: times.size, None], kind="hold")


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_a_held_force_gives_its_impulse(method, times):
    """m v = sum of F dt, and dv / dF = dt / m; a jump a step too late is 1e-2 off."""
    robot, forces = cart(mass=2.0), held(times)
    loss = robot.gradient(
        lambda t, state: state.rate("slide"),
        robot.home,
        forces,
        duration=1.0,
        method=method,
        step=STEP,
    )
    spans = np.append(np.diff(times), 0.0)
    assert loss.value == pytest.approx(FORCES[: times.size] @ spans / 2.0, abs=1e-12)
    assert np.allclose(np.ravel(loss.samples), spans / 2.0, atol=1e-12)


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
@pytest.mark.parametrize("times", TIMES.values(), ids=TIMES)
def test_steppers_end_steps_where_a_run_does(method, times):
    robot, forces = cart(mass=2.0), held(times)
    run = robot.simulate(robot.home, forces, duration=0.9, method=method, step=STEP)
    states = robot.state([[0.0]] * 9)
    for stepper in (
        robot.stepper(robot.home, STEP, forces, method=method),
        robot.stepper(states, STEP, forces, method=method),
    ):
        stepper.step(steps=40)
        stepper.step(steps=50)
        y = np.atleast_2d(stepper.y)
        assert (y == [run.attrs["final_q"][0], run.attrs["final_v"][0]]).all()


def test_a_stepper_tells_the_forces_of_its_time_at_once():
    """Before its first step, and where it goes on in another chart after its last one."""
    robot = lw.Robot(five_bar())
    times = np.linspace(0, 1, 11)
    wave = lw.Sampled(times, 0.02 * np.column_stack([np.sin(6 * times), 1 - times]))
    run = robot.simulate(robot.home.with_rates([6.0, 2.0]), wave, duration=0.3)
    stepper, taken = robot.stepper(run, 1e-3, wave), []
    for _ in range(400):
        told = stepper.run["actuator_force"].values[0]
        assert np.allclose(told, wave(stepper.time), atol=1e-12)
        taken.append(stepper.independent)
        stepper.step()
    assert len(set(taken)) > 1
