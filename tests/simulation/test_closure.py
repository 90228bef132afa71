"""A bead on a circle in Cartesian coordinates: the loop stays closed, at no cost in accuracy or
evaluations."""

import math

import numpy as np
import pytest
from scipy.special import ellipj
from simulation_problems import GRAVITY, bead, bead_closure, free, gap, half_line, two_branches

from linkwork.simulation import Status, integrate

ANGLE = 1.2
START = (math.sin(ANGLE), -math.cos(ANGLE))
DURATION = 5.0
T = np.linspace(0, DURATION, 301)


def swing(closure=bead_closure, q=START, **options):
    lock = closure.address if closure else None
    return integrate(bead.address, lock, q, [0.0], [], **{"duration": DURATION} | options)


def test_motion_is_the_pendulum_s():
    k, w = math.sin(ANGLE / 2), math.sqrt(GRAVITY)
    _, cn, dn, _ = ellipj(w * T, k**2)
    angle = 2 * np.arcsin(k * cn / dn)
    run = swing(save_at=T, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(run.q, np.transpose([np.sin(angle), -np.cos(angle)]), atol=1e-9)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_loop_is_closed_to_rounding_whatever_the_tolerance(rtol):
    for run in swing(rtol=rtol, atol=rtol), swing(rtol=rtol, atol=rtol, save_at=T):
        assert np.abs(np.sum(run.q**2, axis=1) - 1).max() <= 1e-13
        np.testing.assert_allclose(run.residual, np.abs(np.sum(run.q**2, axis=1) - 1), atol=1e-15)
        assert run.residual.max() <= run.closure_error <= 1e-13


def test_without_projection_the_loop_drifts():
    run = swing(None, rtol=1e-6, atol=1e-6)
    assert np.abs(np.sum(run.q**2, axis=1) - 1).max() > 1e-8
    assert run.projections == run.closure_error == 0


def test_energy_is_kept_within_the_tolerance():
    run = swing(rtol=1e-11, atol=1e-12)
    x, y = run.q.T
    energy = run.v[:, 0] ** 2 * (1 + (x / y) ** 2) / 2 + GRAVITY * y
    assert np.ptp(energy) < 1e-8


def test_projection_costs_two_calls_a_step_and_no_evaluation():
    closed, open_ = swing(), swing(None)
    assert closed.nfev == pytest.approx(open_.nfev, rel=0.02)
    assert closed.projections <= 2.1 * (closed.steps + closed.rejected)


def test_start_is_closed_first():
    run = swing(q=(math.sin(ANGLE), -math.cos(ANGLE) * 1.01))
    np.testing.assert_allclose(run.q[0], [math.sin(ANGLE), -math.cos(ANGLE)], atol=1e-14)


def test_a_projection_onto_another_branch_is_an_error_like_any_other():
    """The motion itself is integrated exactly; only the way that the projection would go refuses
    the step."""
    run = integrate(free.address, two_branches.address, [0.0, 0.0], [1.0], [], duration=1.0)
    assert run.status is Status.STEP_UNDERFLOW
    assert run.end_time == pytest.approx(0.5, abs=1e-12)
    assert np.all(run.q[:, 1] == 0)


def test_a_sample_that_cannot_be_closed_refuses_the_step_that_leaps_over_it():
    options = {"duration": 1.0, "first_step": 1.0}
    assert (
        integrate(free.address, gap.address, [0, 0], [1], [], **options).status is Status.FINISHED
    )
    run = integrate(free.address, gap.address, [0, 0], [1], [], save_at=[0.1, 0.42, 0.9], **options)
    assert run.status is Status.CLOSURE_LOST
    np.testing.assert_array_equal(run.t, [0.1])


def test_samples_end_where_the_loop_cannot_be_closed():
    t = np.linspace(0, 1, 101)
    run = integrate(free.address, half_line.address, [0.0, 0.0], [1.0], [], duration=1.0, save_at=t)
    assert run.status is Status.CLOSURE_LOST
    np.testing.assert_array_equal(run.t, t[t <= run.end_time])
    assert run.end_time == pytest.approx(0.5, abs=1e-12)
    assert run.residual.max() == 0
