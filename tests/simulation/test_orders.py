"""Measured orders of convergence of every method and its dense output, free and on a closed
loop."""

import math

import numpy as np
import pytest
from scipy.special import ellipj
from simulation_problems import (
    GRAVITY,
    bead,
    bead_closure,
    bead_jacobian,
    oscillator,
    oscillator_jacobian,
    pendulum,
    pendulum_jacobian,
    point_mass,
)  # fmt: skip

from linkwork.errors import LinkworkError
from linkwork.simulation import (
    BOGACKI_SHAMPINE,
    DORMAND_PRINCE,
    RK4,
    RODAS,
    SHARP_SMART,
    SymplecticEuler,
    clock,
    dop853,
    integrate,
)

# method of a step h, order of the solution, order of the dense output, steps in which to measure
# the closed loop
METHODS = {
    "Bogacki-Shampine": (lambda h: BOGACKI_SHAMPINE, 3, 3, [64, 96, 128]),
    "Dormand-Prince": (lambda h: DORMAND_PRINCE, 5, 4, [24, 32, 48]),
    "Sharp-Smart": (lambda h: SHARP_SMART, 7, 6, [16, 24, 32]),
    "DOP853": (lambda h: dop853(), 8, 7, [8, 11, 16]),
    "Rodas5P": (lambda h: RODAS, 5, 4, [24, 32, 48]),
    "RK4": (RK4, 4, 3, [32, 48, 64]),
    "symplectic Euler": (SymplecticEuler, 1, 1, [400, 600, 800]),
}
ALL = pytest.mark.parametrize("name", METHODS)


def in_steps(name, count, duration, motion, closure, q, v, jacobian, **options):
    h = duration / count
    method = METHODS[name][0](h)
    chosen = {} if method.step else {"first_step": h, "max_step": h, "rtol": 1e6, "atol": 1e6}
    return integrate(
        motion,
        closure,
        q,
        v,
        [],
        duration=duration,
        method=method,
        jacobian=jacobian.address,
        **chosen,
        **options,
    )


def slope(counts, errors):
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0]


def swung(t, start):
    """The angle of a pendulum of length 1 that starts from rest: sin(angle / 2) = k cd(w t,
    k^2)."""
    k = math.sin(start / 2)
    _, cn, dn, _ = ellipj(math.sqrt(GRAVITY) * np.asarray(t), k**2)
    return 2 * np.arcsin(k * cn / dn)


@ALL
def test_error_at_the_end_falls_with_the_order(name):
    counts, errors = np.array(METHODS[name][3]), []
    for count in counts:
        run = in_steps(name, count, 1.3, pendulum.address, 0, [2.0], [0.0], pendulum_jacobian)
        assert run.success and run.steps == count and run.rejected == 0
        errors.append(abs(run.q_end[0] - swung(1.3, 2.0)))
    assert METHODS[name][1] - 0.25 < slope(counts, errors) < METHODS[name][1] + 1


@ALL
def test_error_on_a_closed_loop_falls_with_the_order(name):
    counts, duration = np.array(METHODS[name][3]), 1.5
    errors = []
    for count in counts:
        start = [math.sin(0.7), -math.cos(0.7)]
        run = in_steps(
            name, count, duration, bead.address, bead_closure.address, start, [0.0], bead_jacobian
        )
        angle = swung(duration, 0.7)
        assert run.success and run.closure_error <= 1e-13
        errors.append(np.hypot(*(run.q_end - [math.sin(angle), -math.cos(angle)])))
    assert slope(counts, errors) > METHODS[name][1] - 0.35


@ALL
def test_dense_output_has_its_order(name):
    counts = np.array(METHODS[name][3])
    t = np.linspace(0, 2, 201)
    errors = []
    for count in counts:
        run = in_steps(
            name, count, 2.0, oscillator.address, 0, [1.0], [0.0], oscillator_jacobian, save_at=t
        )
        np.testing.assert_array_equal(run.t, t)
        errors.append(np.abs(run.q[:, 0] - np.cos(t)).max())
    assert slope(counts, errors) > METHODS[name][2] - 0.25


@ALL
def test_dense_output_of_one_step_has_its_order(name):
    """One step of size h from the exact state: the error within it is of the order of the dense
    output plus one."""
    sizes = np.array([0.4, 0.3, 0.2, 0.15]) * (2 if METHODS[name][1] > 5 else 1)
    errors = []
    for h in sizes:
        t = np.linspace(0.1, 0.9, 9) * h
        run = in_steps(name, 1, h, pendulum.address, 0, [2.0], [0.0], pendulum_jacobian, save_at=t)
        errors.append(np.abs(run.q[:, 0] - swung(t, 2.0)).max())
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] > METHODS[name][2] + 1 - 0.5


def test_symplectic_euler_keeps_the_energy_of_a_long_swing():
    """Its energy oscillates within O(h), where that of the explicit method would grow."""
    run = integrate(
        oscillator.address, 0, [1.0], [0.0], [], duration=1000.0, method=SymplecticEuler(0.02)
    )
    assert np.ptp(run.q[:, 0] ** 2 + run.v[:, 0] ** 2) < 0.05
    assert run.nfev == 2 * run.steps


def test_rk4_takes_four_evaluations_a_step_on_the_clock():
    run = integrate(
        point_mass.address, 0, [0.0], [0.0], clock(), [1.0], duration=1.0, method=RK4(0.01)
    )
    np.testing.assert_array_equal(run.t, np.arange(101) * 0.01)
    assert (run.nfev, run.steps, run.rejected) == (400, 100, 0)
    assert run.q_end[0] == pytest.approx(1 / 6, abs=1e-14)


def test_a_last_step_is_shorter_where_the_duration_is_no_multiple():
    run = integrate(
        point_mass.address, 0, [0.0], [0.0], clock(), [1.0], duration=0.25, method=RK4(0.1)
    )
    np.testing.assert_allclose(run.t, [0, 0.1, 0.2, 0.25], atol=1e-16)


def test_dop853_reaches_rounding():
    run = integrate(
        oscillator.address,
        0,
        [1.0],
        [0.0],
        [],
        duration=10.0,
        method=dop853(),
        rtol=1e-13,
        atol=1e-13,
    )
    assert abs(run.q_end[0] - math.cos(10)) < 2e-13
    assert run.nfev < 1000


@pytest.mark.parametrize("step", [0.0, -1.0, math.inf, math.nan])
def test_steps_that_are_none_are_refused(step):
    for method in RK4, SymplecticEuler:
        with pytest.raises(LinkworkError, match="fixed step must be positive and finite"):
            method(step)
