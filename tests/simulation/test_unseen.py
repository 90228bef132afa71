"""No step passes over what its stages have not seen of its inputs: pulses of any width, on any
background, by any method."""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import linkwork as lw
from linkwork.simulation.signals import FREE, Sampled, as_signal

from tests.control.plants import cart

MASS, DURATION, PEAK, CENTRE = 2.0, 2.0, 5.0, 0.777
TIMES = np.linspace(0, DURATION, 2001)
BACKGROUNDS = {"nothing": 0 * TIMES, "1000 N": 1000 + 0 * TIMES, "a sine": 1000 * np.sin(6 * TIMES)}
ADAPTIVE = ("dormand_prince", "sharp_smart", "dop853", "rodas")


@cache
def plant():
    return cart(MASS)


def hump(width, centre=CENTRE):
    inside = np.abs(TIMES - centre) < width / 2
    return PEAK * inside * np.cos(np.pi * (TIMES - centre) / width) ** 2


def moved(values, at=DURATION):
    """Return the displacement and the rate that a spline of forces gives to a mass at rest:
    integrals of the spline."""
    spline = CubicSpline(TIMES, values)
    return np.array([spline.antiderivative(2)(at), spline.antiderivative()(at)]) / MASS


def run_under(values, method, **options):
    options = {"duration": DURATION, "save_at": [DURATION]} | options
    return plant().simulate(plant().home, Sampled(TIMES, values), method=method, **options)


def reached(run):
    return np.array(
        [run.variables[name].values[-1, 0] for name in ("joint_position", "joint_rate")]
    )


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("width", [0.1, 0.01, 0.002])
@pytest.mark.parametrize("background", BACKGROUNDS)
def test_a_pulse_is_not_passed_over(background, width, method):
    values = BACKGROUNDS[background] + hump(width)
    expected, size = moved(values), np.abs(moved(np.abs(BACKGROUNDS[background]))).max()
    run = run_under(values, method)
    assert run.success
    np.testing.assert_allclose(reached(run), expected, rtol=0, atol=3e-7 + 1e-6 * size)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_pulse_that_leaves_no_momentum_is_not_passed_over(method):
    values = hump(0.02, 0.9) - hump(0.02, 0.92)
    run = run_under(values, method, save_at=[0.91, DURATION])
    expected = moved(values)
    assert expected[0] > 4e-4
    np.testing.assert_allclose(reached(run), expected, rtol=0, atol=5e-7)
    assert run.variables["joint_rate"].values[0, 0] == pytest.approx(
        moved(values, 0.91)[1], rel=1e-5
    )


def test_a_burst_that_leaves_nothing_behind_shows_in_the_samples_within():
    values = PEAK * np.exp(-(((TIMES - 1.2) / 0.03) ** 2)) * np.sin(2 * np.pi * 80 * (TIMES - 1.2))
    within = np.linspace(1.15, 1.25, 21)
    run = run_under(values, None, save_at=within)
    expected = [moved(values, t)[1] for t in within]
    assert np.abs(expected).max() > 1e-3
    np.testing.assert_allclose(
        run.variables["joint_rate"].values[:, 0], expected, rtol=0, atol=5e-7
    )


def test_a_small_pulse_in_a_noisy_signal_is_found_at_a_loose_tolerance():
    values = 0.002 * np.random.default_rng(0).normal(size=TIMES.size) + hump(0.02)
    run = run_under(values, None, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(reached(run), moved(values), rtol=0, atol=5e-3)


def test_a_smooth_signal_costs_no_more_for_more_samples():
    counts = []
    for samples in (101, 1001):
        t = np.linspace(0, DURATION, samples)
        forces = Sampled(t, 3 * np.sin(6 * t))
        counts.append(plant().simulate(plant().home, forces, duration=DURATION).statistics.nfev)
    assert counts[1] <= 1.01 * counts[0]


def test_samples_and_a_rest_do_not_change_what_is_reached():
    forces, home, options = Sampled(TIMES, hump(0.01)), plant().home, {"duration": DURATION}
    whole = plant().simulate(home, forces, **options)
    sampled = plant().simulate(home, forces, **options, save_at=np.linspace(0, DURATION, 7))
    np.testing.assert_array_equal(reached(sampled), reached(whole))
    first = plant().simulate(home, forces, duration=0.5)
    rest = plant().resume(first, forces, duration=DURATION - 0.5)
    np.testing.assert_allclose(reached(rest), moved(hump(0.01)), rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ["dormand_prince", "sharp_smart"])
def test_members_of_an_ensemble_pass_over_no_more_than_runs_alone(method):
    robot = lw.Robot(lw.robots.prr3())
    forces = [Sampled(TIMES, np.roll(np.column_stack([hump(w, c), 0 * TIMES, 0 * TIMES]), i, 1))
              for i, (w, c) in enumerate([(0.1, 0.3), (0.05, 0.5), (0.02, 0.8), (0.01, 0.61),
                                          (0.002, 0.4)] * 4)]  # fmt: skip
    times = [0.45, 1.0]
    many = robot.ensemble(robot.home, forces, duration=1.0, save_at=times, method=method)
    for i, own in enumerate(forces[:5]):
        alone = robot.simulate(robot.home, own, duration=1.0, save_at=times, method=method)
        assert many.nfev[i] == pytest.approx(alone.statistics.nfev, rel=0.1)
        positions = many.dataset.joint_position.values[i]
        np.testing.assert_allclose(
            positions, alone.variables["joint_position"].values, rtol=0, atol=5e-7
        )
        still = (
            robot.simulate(robot.home, duration=1.0, save_at=times)
            .variables["joint_position"]
            .values[-1, :3]
        )
        assert np.abs(positions[-1, :3] - still).max() > 1e-4


@pytest.mark.parametrize(
    ("values", "few"),
    [
        (1000 + 0 * TIMES, True),
        (3 * TIMES - 7, True),
        (1000 * TIMES**3, True),
        (np.sin(6 * TIMES).astype(np.float32), None),
        (1000 * np.sin(6 * TIMES), True),
        (hump(0.1), False),
        (1000 * np.sin(6 * TIMES) + hump(0.1), False),
        (hump(0.002), False),
    ],
)
def test_a_signal_bends_where_it_does_what_a_polynomial_does_not(values, few):
    signal = as_signal(Sampled(TIMES, values))
    near = np.abs(signal.bends[:-1, 0] - CENTRE) < 0.06
    if few is not None:
        assert (near.sum() <= FREE) == few
    assert signal.bends[-1].tolist() == [np.inf, 0, np.inf]
    for time, column, free in signal.bends[:-1]:
        later = signal.bends[:-1][
            (signal.bends[:-1, 0] >= time) & (signal.bends[:-1, 1] == column), 0
        ]
        assert free == (later[FREE] if len(later) > FREE else np.inf)
