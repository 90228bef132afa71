"""Forces and events that are traced functions of time: no step passes over a pulse of theirs."""

import math

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Event, Wrench

from tests.control.plants import cart

MASS = 2.0
CENTRE, AREA = 0.777, math.sqrt(math.pi)


@pytest.fixture(scope="module")
def plant():
    return cart(MASS)


class Pulse:
    """A force A exp(-((t - centre) / width)^2): its momentum is A width sqrt(pi)."""

    def __init__(self, width, size=5.0):
        self.width, self.size = width, size

    def __call__(self, t, state):
        centre = state.parameter("centre", CENTRE)
        return [self.size * lw.math.exp(-(((t - centre) / self.width) ** 2))]

    @property
    def rate(self):
        return self.size * self.width * AREA / MASS


@pytest.mark.parametrize("method", ["dormand_prince", "sharp_smart", "dop853", "rodas"])
@pytest.mark.parametrize("width", [0.1, 0.01])
def test_a_traced_pulse_is_not_passed_over(plant, width, method):
    pulse = Pulse(width)
    run = plant.simulate(plant.home, pulse, duration=5.0, method=method, save_at=[5.0])
    assert run.variables["joint_rate"].values[-1, 0] == pytest.approx(pulse.rate, rel=1e-5)
    assert run.variables["joint_position"].values[-1, 0] == pytest.approx(
        pulse.rate * (5.0 - CENTRE), rel=1e-5
    )


def test_a_traced_pulse_of_a_wrench_is_not_passed_over(plant):
    pulse = Pulse(0.01)
    wrench = Wrench("cart", force=lambda t, state: [*pulse(t, state), 0, 0])
    run = plant.simulate(plant.home, duration=3.0, wrenches=[wrench], save_at=[3.0])
    assert run.variables["joint_rate"].values[-1, 0] == pytest.approx(pulse.rate, rel=1e-5)


def test_each_member_of_an_ensemble_finds_its_own_pulse(plant):
    pulse, centres = Pulse(0.01), np.linspace(0.2, 1.8, 9)
    many = plant.ensemble(plant.home, pulse, {"centre": centres}, duration=2.0)
    np.testing.assert_allclose(many.final.rates[:, 0], pulse.rate, rtol=1e-5)
    alone = plant.simulate(plant.home, pulse, parameters={"centre": centres[3]}, duration=2.0)
    assert alone.statistics.nfev == pytest.approx(many.nfev[3], rel=0.1)
    np.testing.assert_allclose(
        plant.ensemble(plant.home, pulse, duration=2.0).final.rates, pulse.rate, rtol=1e-5
    )


def test_zeros_of_functions_of_time_are_all_found(plant):
    wave = Event(lambda t, state: lw.math.sin(20 * math.pi * t + 0.1), name="wave")
    run = plant.simulate(plant.home, duration=1.0, events=[wave])
    expected = (np.arange(1, 21) - 0.1 / math.pi) / 20
    np.testing.assert_allclose(run.coords["event_time"].values, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("sampled", [False, True])
def test_a_pulse_of_an_event_function_is_not_passed_over(plant, sampled):
    times, late = np.linspace(0, 5, 5001), 0.01 * math.sqrt(math.log(2))
    signal = lw.Sampled(times, np.exp(-(((times - 3.3) / 0.01) ** 2)) - 0.5)

    def high(t, state):
        return signal(t)[0] if sampled else lw.math.exp(-(((t - 3.3) / 0.01) ** 2)) - 0.5

    run = plant.simulate(plant.home, duration=5.0, events=[Event(high)])
    np.testing.assert_allclose(
        run.coords["event_time"].values, [3.3 - late, 3.3 + late], rtol=0, atol=1e-6
    )


def test_what_depends_on_the_state_is_not_taken_for_a_function_of_time(plant):
    run = plant.simulate(
        plant.home, lambda t, state: [lw.math.cos(t) - state["slide"]], duration=2.0
    )
    assert run.success
    smooth = plant.simulate(
        plant.home, lambda t, state: [lw.math.sin(6 * t)], duration=2.0, save_at=[2.0]
    )
    assert smooth.variables["joint_rate"].values[-1, 0] == pytest.approx(
        (1 - math.cos(12)) / 6 / MASS, rel=1e-7
    )
