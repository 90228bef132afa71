"""The integrator against closed forms, published orbits, SciPy, and its own promises."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk
from simulation_problems import GRAVITY, arenstorf, oscillator, pendulum, point_mass, two_inputs

from linkwork.errors import LinkworkError
from linkwork.simulation import BOGACKI_SHAMPINE, DORMAND_PRINCE, Sampled, clock, integrate


def oscillate(duration=10.0, **options):
    """q = cos t."""
    return integrate(oscillator.address, None, [1.0], [0.0], [], duration=duration, **options)


def push(forces, mass=2.0, **options):
    return integrate(
        point_mass.address, 0, [0.0], [0.0], forces, [mass], **{"duration": 1.0} | options
    )


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


@pytest.mark.parametrize(("pair", "order"), [(DORMAND_PRINCE, 5), (BOGACKI_SHAMPINE, 3)])
def test_error_falls_with_the_order_of_the_pair(pair, order):
    steps = 1 / np.array([8, 12, 16, 24])
    runs = [
        oscillate(4.0, rtol=1e3, atol=1e3, max_step=h, first_step=h, method=pair) for h in steps
    ]
    assert [run.steps for run in runs] == [32, 48, 64, 96]
    errors = [abs(run.q_end[0] - math.cos(4)) for run in runs]
    assert slope(steps, errors) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize(("pair", "order"), [(DORMAND_PRINCE, 5), (BOGACKI_SHAMPINE, 3)])
def test_dense_output_keeps_the_order(pair, order):
    t, steps = np.linspace(0, 4, 401), 1 / np.array([4, 6, 8, 12])
    runs = [
        oscillate(4.0, rtol=1e3, atol=1e3, max_step=h, first_step=h, save_at=t, method=pair)
        for h in steps
    ]
    errors = [np.abs(run.q[:, 0] - np.cos(t)).max() for run in runs]
    assert slope(steps, errors) == pytest.approx(order, abs=0.35)


def test_error_follows_the_tolerance():
    tolerances = np.array([1e-4, 1e-6, 1e-8, 1e-10])
    errors = [abs(oscillate(rtol=tol, atol=tol).q_end[0] - math.cos(10)) for tol in tolerances]
    assert np.all(errors < 20 * tolerances)
    assert slope(tolerances, errors) == pytest.approx(1, abs=0.25)


def test_tolerances_by_component():
    loose = oscillate(rtol=1e-12, atol=[1e-2, 1e-2])
    mixed = oscillate(rtol=[1e-12, 1e-2], atol=[1e-10, 1e-2])
    assert loose.steps < mixed.steps
    assert abs(mixed.q_end[0] - math.cos(10)) < 1e-6


def test_arenstorf_orbit_closes():
    """Period and initial values: Hairer, Norsett & Wanner I, sec. II.0."""
    v = -2.00158510637908252240537862224
    period = 17.0652165601579625588917206249
    run = integrate(
        arenstorf.address, None, [0.994, 0.0], [0.0, v], [], duration=period, rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(run.q_end, [0.994, 0.0], atol=1e-5)
    assert run.success


def test_pendulum_follows_the_elliptic_functions():
    """sin(q / 2) = k cd(w t, k^2) from rest at q_0, with k = sin(q_0 / 2), w^2 = g."""
    q_0 = 2.5
    k, w = math.sin(q_0 / 2), math.sqrt(GRAVITY)
    t = np.linspace(0, 4 * ellipk(k**2) / w, 200)
    run = integrate(
        pendulum.address, None, [q_0], [0.0], [], duration=t[-1], save_at=t, rtol=1e-11, atol=1e-12
    )
    _, cn, dn, _ = ellipj(w * t, k**2)
    np.testing.assert_allclose(run.q[:, 0], 2 * np.arcsin(k * cn / dn), atol=1e-8)


@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_evaluations_and_values_are_those_of_scipy(rtol):
    run = oscillate(20.0, rtol=rtol, atol=rtol)
    reference = solve_ivp(lambda t, y: [y[1], -y[0]], (0, 20), [1, 0], rtol=rtol, atol=rtol)
    assert run.nfev == pytest.approx(reference.nfev, rel=0.12)
    assert abs(run.q_end[0] - reference.y[0, -1]) < 50 * rtol
    assert run.nfev == 2 + 6 * (run.steps + run.rejected)


def test_parameters_reach_the_kernel():
    assert push([6.0], mass=2.0).q_end[0] == pytest.approx(1.5, rel=1e-13)
    assert push([6.0], mass=3.0).q_end[0] == pytest.approx(1.0, rel=1e-13)


def test_held_samples_give_exact_parabolas_between_them():
    times, forces = np.array([0.0, 0.25, 0.6, 1.0]), np.array([1.0, -3.0, 2.0, 9.0])
    run = push(Sampled(times, forces, "hold"), mass=1.0)
    q = v = 0.0
    for dt, u in zip(np.diff(times), forces, strict=False):
        q, v = q + v * dt + u * dt**2 / 2, v + u * dt
    assert [run.q_end[0], run.v_end[0]] == pytest.approx([q, v], abs=1e-14)
    assert set(times) <= set(run.t)
    assert run.rejected == 0


def test_linear_samples_give_exact_cubics_between_them():
    times, forces = np.array([0.0, 0.25, 0.6, 1.0]), np.array([1.0, -3.0, 2.0, 9.0])
    run = push(Sampled(times, forces, "linear"), mass=1.0)
    v = np.sum(np.diff(times) * (forces[1:] + forces[:-1]) / 2)
    q = np.sum(np.diff(times) ** 2 * (2 * forces[:-1] + forces[1:]) / 6) + np.sum(
        np.diff(times)
        * np.concatenate([[0], np.cumsum(np.diff(times) * (forces[1:] + forces[:-1]) / 2)[:-1]])
    )
    assert [run.q_end[0], run.v_end[0]] == pytest.approx([q, v], abs=1e-14)
    assert run.rejected == 0


def test_spline_samples_are_crossed_without_stopping():
    times = np.linspace(0, 1, 201)
    run = push(Sampled(times, np.sin(3 * times)), mass=1.0, rtol=1e-10, atol=1e-12)
    assert run.q_end[0] == pytest.approx((3 - math.sin(3)) / 9, abs=1e-9)
    assert run.steps < 100


def test_jump_is_not_seen_before_its_time():
    """Until the jump, the motion is bit for bit the one without a jump."""
    save_at = np.linspace(0, 0.5, 11)
    with_jump = push(Sampled([0, 0.5, 1], [1, 1000, 0], "hold"), save_at=save_at)
    without = push(Sampled([0, 0.5, 1], [1, 1, 0], "hold"), save_at=save_at)
    np.testing.assert_array_equal(with_jump.q, without.q)
    assert [with_jump.u[-2, 0], with_jump.u[-1, 0]] == [1, 1000]


def test_inputs_are_told_apart_and_time_can_be_one():
    forces = Sampled([0, 1], [[0, 2], [1, 2]], "linear")
    run = integrate(two_inputs.address, None, [0, 0], [0, 0], forces, duration=1.0)
    assert run.q_end == pytest.approx([1 / 6, 1], abs=1e-14)
    assert push(clock(), mass=1.0).q_end[0] == pytest.approx(1 / 6, abs=1e-14)


def test_start_shifts_the_time_of_the_forces_only():
    run = push(clock(), mass=1.0, start=2.0, save_at=[2.0, 2.5, 3.0])
    np.testing.assert_array_equal(run.t, [2.0, 2.5, 3.0])
    assert run.q_end[0] == pytest.approx((3**3 - 2**3) / 6 - 2.0, abs=1e-13)
    assert run.end_time == 3.0


def test_going_on_from_the_end_gives_the_same_motion():
    first = oscillate(4.0)
    second = integrate(
        oscillator.address,
        0,
        first.q_end,
        first.v_end,
        [],
        start=4.0,
        duration=6.0,
        first_step=first.next_step,
    )
    assert second.q_end[0] == pytest.approx(math.cos(10), abs=1e-7)
    assert second.nfev == 1 + 6 * (second.steps + second.rejected)


def test_every_step_is_saved_by_default():
    run = oscillate(300.0)
    assert len(run.t) == run.steps + 1 > 1000
    assert run.t[0] == 0 and run.t[-1] == 300
    assert np.all(np.diff(run.t) > 0)
    np.testing.assert_allclose(run.q[:, 0], np.cos(run.t), atol=1e-5)
    assert (run.q[-1], run.v[-1]) == (run.q_end, run.v_end)


def test_save_at_gives_exactly_these_times_and_does_not_change_the_steps():
    t = np.linspace(0, 10, 1001)
    run = oscillate(save_at=t)
    np.testing.assert_array_equal(run.t, t)
    np.testing.assert_allclose(run.q[:, 0], np.cos(t), atol=1e-7)
    assert (run.nfev, run.q_end) == (oscillate().nfev, oscillate().q_end)


def test_save_at_may_leave_out_both_ends_or_everything():
    np.testing.assert_array_equal(oscillate(save_at=[1.0, 2.0]).t, [1.0, 2.0])
    assert oscillate(save_at=[]).q.shape == (0, 1)


def test_save_at_may_exceed_the_end_by_rounding():
    t = np.arange(0, 0.31, 0.1)
    assert t[-1] > 0.3
    assert oscillate(0.3, save_at=t).t[-1] == 0.3


def test_max_step_and_first_step_are_kept():
    run = oscillate(max_step=0.05, first_step=0.01)
    assert np.diff(run.t)[0] == pytest.approx(0.01)
    assert np.diff(run.t).max() <= 0.05 + 1e-12


def test_a_system_at_rest_takes_few_steps():
    run = integrate(oscillator.address, 0, [0.0], [0.0], [], duration=100.0)
    assert run.q_end[0] == 0
    assert run.steps < 20


def test_threads_give_the_same_results_as_one():
    speeds = np.linspace(0.5, 5, 16)

    def swing(v):
        return integrate(pendulum.address, 0, [0.0], [v], [], duration=20.0).q_end[0]

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(swing, speeds)) == [swing(v) for v in speeds]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"duration": 0.0}, "duration of a run must be positive and finite, not 0.0 s"),
        ({"duration": -1.0}, "not -1.0 s"),
        ({"duration": math.inf}, "not inf s"),
        ({"start": -1.0}, "from 0 s on, not at -1.0 s"),
        (
            {"save_at": [0.0, 0.5, 0.5]},
            "times in save_at must increase: number 2 is 0.5 s after 0.5 s",
        ),
        ({"save_at": [0.0, 1.5]}, "within the run, from 0 s to 1 s"),
        ({"save_at": 0.5}, "save_at must be a list of numbers"),
        ({"rtol": 0.0}, "rtol must be positive and finite, not 0.0"),
        (
            {"atol": [1e-6, 1e-6, 1e-6]},
            r"atol has the shape \(3,\): give one number, or 2, one for each of \(q, v\)",
        ),
        ({"max_step": 0.0}, "max_step must be positive, not 0.0"),
        ({"first_step": -1.0}, "first_step must be positive, not -1.0"),
        ({"max_steps": 0}, "max_steps must be at least 1, not 0"),
        ({"pivot_bound": math.nan}, "pivot_bound must be positive, not nan"),
        (
            {"forces": Sampled([0, 0.9], [1, 2])},
            "sampled from 0 s to 0.9 s, but the run goes from 0 s to 1 s",
        ),
        ({"forces": 1.0}, "one number per input"),
    ],
)
def test_what_makes_no_run_is_refused(options, sentence):
    with pytest.raises(LinkworkError, match=sentence):
        push(**{"forces": [1.0]} | options)


def test_states_that_are_no_states_are_refused():
    with pytest.raises(LinkworkError, match="v must be finite: number 0 is nan"):
        integrate(oscillator.address, None, [0.0], [math.nan], [], duration=1.0)
    with pytest.raises(LinkworkError, match="q must be a list of numbers"):
        integrate(oscillator.address, None, 0.0, [0.0], [], duration=1.0)
    with pytest.raises(LinkworkError, match="nothing to integrate"):
        integrate(oscillator.address, None, [], [], [], duration=1.0)
