"""Every way to end, reached by a problem made for it; what was computed so far is kept."""

import math

import numpy as np
import pytest
from simulation_problems import (
    bead,
    bead_closure,
    decay,
    drift,
    explosion,
    fading,
    free,
    half_line,
    oscillator,
)

from linkwork.simulation import Status, integrate


def test_finished():
    run = integrate(oscillator.address, None, [1.0], [0.0], [], duration=2.0)
    assert run.status is Status.FINISHED
    assert run.success
    assert run.message == "The run reached its end at t = 2 s."


def test_singular():
    """The pivot 1 - t meets its bound at t = 0.9, to within the bound."""
    run = integrate(fading.address, None, [0.0], [1.0], [], duration=2.0, pivot_bound=0.1)
    assert run.status is Status.SINGULAR
    assert 0.8 <= run.end_time <= 0.9
    assert run.pivot == pytest.approx(1 - run.pivot_time, abs=1e-12)
    assert "bound 0.1); the pose is singular" in run.message


def test_singular_chart_of_a_bead_that_swings_through_y_0():
    run = integrate(
        bead.address, bead_closure.address, [0.0, -1.0], [8.0], [], duration=1.0, pivot_bound=0.05
    )
    assert run.status is Status.SINGULAR
    assert -0.0625 <= run.q_end[1] <= -0.05
    assert run.nfev < 350


def test_singular_from_the_start():
    run = integrate(fading.address, None, [1.0], [1.0], [], duration=2.0)
    assert (run.status, run.end_time, run.steps, len(run.t)) == (Status.SINGULAR, 0, 0, 1)


def test_closure_lost():
    run = integrate(free.address, half_line.address, [0.0, 0.0], [1.0], [], duration=1.0)
    assert run.status is Status.CLOSURE_LOST
    assert run.q_end[0] == pytest.approx(0.5, abs=1e-12)
    assert (
        "the loops do not close any more (residual 1 after Newton's method, wanted 1e-13)"
        in run.message
    )


def test_closure_lost_from_the_start():
    run = integrate(free.address, half_line.address, [0.7, 0.0], [1.0], [], duration=1.0)
    assert (run.status, run.end_time, run.q_end[0], run.residual[0]) == (
        Status.CLOSURE_LOST,
        0,
        0.7,
        1,
    )


def test_step_underflow():
    run = integrate(explosion.address, None, [1.0], [], [], duration=2.0)
    assert run.status is Status.STEP_UNDERFLOW
    assert run.end_time == pytest.approx(1.0, abs=1e-6)
    assert "the error stays above the tolerance however small the step" in run.message


def test_stiff():
    """y' = -1e4 y with an explicit method: its steps come to the end of its interval of stability,
    where it is left."""
    run = integrate(decay.address, None, [1.0], [], [], duration=100.0, leave_stiff=True)
    assert run.status is Status.STIFF
    assert 1024 < run.steps < 1100
    assert run.end_time < 1.0
    assert "it is stiff there, stability bounds the steps" in run.message
    near = integrate(decay.address, None, [1.0], [], [], duration=0.5, leave_stiff=True)
    assert near.success  # what is left takes less steps than a look at it


def test_too_many_steps():
    run = integrate(oscillator.address, None, [1.0], [0.0], [], duration=100.0, max_steps=25)
    assert run.status is Status.TOO_MANY_STEPS
    assert run.steps + run.rejected == 25
    assert "used up max_steps = 25 steps" in run.message


def test_non_finite():
    run = integrate(drift.address, None, [0.0], [1.0], [], duration=1.0)
    assert run.status is Status.NON_FINITE
    assert run.q_end[0] == pytest.approx(0.5, abs=1e-12)
    assert "component 0 of v' (counted from 0) is infinite or undefined from here on" in run.message
    assert np.all(np.isfinite(run.q)) and np.all(np.isfinite(run.v))


def test_non_finite_from_the_start():
    run = integrate(drift.address, None, [0.7], [1.0], [], duration=1.0)
    assert (run.status, run.end_time, run.steps) == (Status.NON_FINITE, 0, 0)


def test_overflow_ends_as_non_finite_or_underflow_never_as_finished():
    run = integrate(explosion.address, None, [1e200], [], [], duration=1.0, atol=1e-3)
    assert run.status in (Status.NON_FINITE, Status.STEP_UNDERFLOW)


def test_what_was_computed_is_kept():
    t = np.linspace(0, 1, 21)
    run = integrate(drift.address, None, [0.0], [1.0], [], duration=1.0, save_at=t)
    np.testing.assert_array_equal(run.t, t[t <= run.end_time])
    np.testing.assert_allclose(run.q[:, 0], run.t, atol=1e-14)


@pytest.mark.parametrize("status", Status)
def test_every_status_has_a_sentence(status):
    facts = dict.fromkeys(
        ["time", "step", "rejected_pivot", "rejected_residual", "pivot_bound", "closure_tol"],
        math.pi,
    )
    sentence = status.sentence(**facts, max_steps=3, event=1, error="ValueError: no")
    assert "t = 3.14159265 s" in sentence
    assert sentence.endswith(".")
