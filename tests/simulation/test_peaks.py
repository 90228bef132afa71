"""A light cart darts aside whenever the pole on it hangs down: peaks of a microsecond, which steps
have to see.

Truth: energy, and where the pole is level at rest, after times that a quadrature gives.
"""

import numpy as np
import pytest
from scipy.integrate import quad
from simulation_problems import GRAVITY, cart_pole, oscillator
from test_lanes import alone, many

from linkwork.simulation import DORMAND_PRINCE, SHARP_SMART, dop853, integrate

METHODS = pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, SHARP_SMART, dop853()], ids=lambda method: method.name
)
RTOL = 10.0 ** -np.arange(5, 9.1, 0.5)
LEVEL, REST = np.zeros(2), np.zeros(2)
SWINGS = 11


def swing(mass):
    """Return the time from level to level: the tip's energy is v^2 / 2 (1 - k sin^2) = g sin, with
    k = 1 / (1 + mass)."""

    def slowness(
        root,
    ):  # of the square root of the angle below the level, by which it is smooth at the level
        sine = np.sin(root**2)
        lightness = mass / (1 + mass) + np.cos(root**2) ** 2 / (1 + mass)
        return 2 * np.sqrt(lightness / (2 * GRAVITY) * (root**2 / sine if root > 0 else 1.0))

    bottom = np.sqrt(np.pi / 2)
    near = bottom - np.sqrt(mass) * 4.0 ** np.arange(-1, 4)
    return 2 * quad(slowness, 0, bottom, points=near, limit=500, epsabs=1e-13, epsrel=1e-13)[0]


def energy(run, mass):
    angle, speed, rate = run.q[:, 1], run.v[:, 0], run.v[:, 1]
    tip = (speed - np.sin(angle) * rate) ** 2 + (np.cos(angle) * rate) ** 2
    return mass * speed**2 / 2 + tip / 2 + GRAVITY * np.sin(angle)


def swings(mass, method, rtol, **options):
    duration = SWINGS * swing(mass)
    options = {"duration": duration, "rtol": rtol, "atol": rtol / 100, "method": method} | options
    return integrate(cart_pole.address, None, LEVEL, REST, [], [mass], **options)


@METHODS
@pytest.mark.parametrize("mass", [1e-6, 1.4e-6, 2e-6, 1e-5])
def test_no_step_leaps_over_a_peak(mass, method):
    for rtol in RTOL:
        run = swings(mass, method, rtol)
        assert run.success
        leaps = np.abs(np.diff(energy(run, mass))) / GRAVITY
        assert leaps.max() < 40 * rtol
        errors = np.abs(np.concatenate([run.q_end - [2 / (1 + mass), -np.pi], run.v_end]))
        assert errors.max() < 4000 * rtol


@METHODS
def test_peaks_cost_nothing_where_there_are_none(method):
    run = integrate(oscillator.address, None, [1.0], [0.0], [], duration=10.0, method=method)
    assert run.nfev == 2 + method.plan.solution * (run.steps + run.rejected)


@METHODS
def test_members_of_an_ensemble_see_peaks_as_runs_alone_do(method):
    masses = 1e-6 * 1.3 ** np.arange(6)
    options = {"duration": 2.0, "rtol": 1e-7, "atol": 1e-9, "method": method}
    times = np.linspace(0, 2.0, 5)
    y = np.zeros((6, 4))
    outcomes = many(cart_pole, y, np.empty(0), masses[:, None], nq=2, save_at=times, **options)
    runs = [
        alone(cart_pole, y[0], np.empty(0), [m], nq=2, save_at=times, **options) for m in masses
    ]
    assert outcomes.nfev == pytest.approx([run.nfev for run in runs], rel=0.01)
    states = [np.concatenate([run.q, run.v], axis=1) for run in runs]
    np.testing.assert_allclose(outcomes.samples, states, rtol=0, atol=1e-7)


@METHODS
@pytest.mark.parametrize("most", [70, 110])
def test_a_run_that_stopped_at_a_peak_goes_on_as_if_it_had_not(most, method):
    whole = swings(1e-6, method, 1e-7, duration=2.0)
    first = swings(1e-6, method, 1e-7, duration=2.0, max_steps=most)
    second = integrate(
        cart_pole.address, None, first.q_end, first.v_end, [], [1e-6], start=first.end_time,
        duration=2.0 - first.end_time, rtol=1e-7, atol=1e-9, method=method, first_step=first.pace,
    )  # fmt: skip
    assert first.steps + first.rejected == most
    assert (first.steps + second.steps, first.rejected + second.rejected) == (
        whole.steps,
        whole.rejected,
    )
    assert first.nfev + second.nfev == whole.nfev + 1
    np.testing.assert_allclose(second.q_end, whole.q_end, rtol=0, atol=1e-9)
