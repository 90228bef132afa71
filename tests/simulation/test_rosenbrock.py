"""The stiff method: its order conditions, stiff problems against SciPy's Radau, and inputs that
depend on time."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulation_problems import (
    oscillator,
    prothero_robinson,
    prothero_robinson_jacobian,
    robertson,
    robertson_jacobian,
    van_der_pol,
    van_der_pol_jacobian,
)  # fmt: skip

from linkwork.errors import LinkworkError
from linkwork.simulation import DORMAND_PRINCE, RODAS, clock, integrate


def weights(method):
    """Return alpha, beta = alpha + Gamma and b of Hairer & Wanner II, eq. (IV.7.4), from the
    transformed coefficients."""
    s = len(method.c)
    gamma = np.linalg.inv(np.eye(s) / method.gamma - method.C)
    return method.a @ gamma, method.a @ gamma + gamma, method.m @ gamma, gamma


def test_order_conditions():
    """Hairer & Wanner II, table IV.7.1, and order 5 for quadrature; the estimate is of order 4."""
    alpha, beta, b, gamma = weights(RODAS)
    c, beta_i = alpha.sum(1), beta.sum(1)
    np.testing.assert_allclose(c, RODAS.c, atol=1e-13)
    np.testing.assert_allclose(gamma.sum(1), RODAS.d, atol=1e-12)
    lower = b - np.eye(len(b))[-1] @ gamma
    for b_i in b, lower:
        assert b_i.sum() == pytest.approx(1, abs=1e-12)
        assert b_i @ beta_i == pytest.approx(1 / 2, abs=1e-12)
        assert b_i @ c**2 == pytest.approx(1 / 3, abs=1e-12)
        assert b_i @ beta @ beta_i == pytest.approx(1 / 6, abs=1e-12)
        assert b_i @ c**3 == pytest.approx(1 / 4, abs=1e-11)
        assert b_i @ (c * (alpha @ beta_i)) == pytest.approx(1 / 8, abs=1e-11)
        assert b_i @ beta @ c**2 == pytest.approx(1 / 12, abs=1e-11)
        assert b_i @ beta @ beta @ beta_i == pytest.approx(1 / 24, abs=1e-11)
    assert b @ c**4 == pytest.approx(1 / 5, abs=1e-11)
    assert abs(lower @ c**4 - 1 / 5) > 1e-4


def test_stiffly_accurate_and_stable_at_infinity():
    """The last row of beta is b, from which R(infinity) = 1 - b' beta^-1 1 = 0."""
    _, beta, b, _ = weights(RODAS)
    np.testing.assert_allclose(beta[-1], b, atol=1e-12)
    assert 1 - b @ np.linalg.solve(beta, np.ones(len(b))) == pytest.approx(0, abs=1e-10)


def test_dense_output_joins_both_ends():
    np.testing.assert_allclose(RODAS.dense.sum(axis=1), RODAS.m, atol=1e-12)


@pytest.mark.long
def test_van_der_pol_with_mu_1000():
    """Cheap on the slow parts, where an explicit method needs hundred thousands of steps."""
    t = np.array([100.0, 500.0, 806.0, 1000.0, 1500.0])
    run = integrate(
        van_der_pol.address, None, [2.0], [0.0], [], [1e3], duration=1500.0, save_at=t,
        rtol=1e-8, atol=1e-10, method=RODAS, jacobian=van_der_pol_jacobian.address,
    )  # fmt: skip
    reference = solve_ivp(
        lambda t, y: [y[1], 1e3 * (1 - y[0] ** 2) * y[1] - y[0]], (0, 1500), [2, 0], "Radau", t,
        rtol=1e-11, atol=1e-13,
        jac=lambda t, y: [[0, 1], [-2e3 * y[0] * y[1] - 1, 1e3 * (1 - y[0] ** 2)]],
    )  # fmt: skip
    np.testing.assert_allclose(run.q[:, 0], reference.y[0], rtol=2e-5)
    assert run.steps < 1500
    explicit = integrate(
        van_der_pol.address,
        None,
        [2.0],
        [0.0],
        [],
        [1e3],
        duration=5.0,
        rtol=1e-8,
        method=DORMAND_PRINCE,
    )
    assert explicit.steps > run.steps


def test_robertson_s_reaction():
    t = 10.0 ** np.arange(-1, 5)
    run = integrate(
        robertson.address, None, [1.0, 0.0, 0.0], [], [], duration=1e4, save_at=t,
        rtol=1e-8, atol=1e-12, method=RODAS, jacobian=robertson_jacobian.address,
    )  # fmt: skip
    reference = solve_ivp(
        lambda t, y: [1e4 * y[1] * y[2] - 0.04 * y[0],
                      0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2, 3e7 * y[1] ** 2],
        (0, 1e4), [1, 0, 0], "Radau", t, rtol=1e-11, atol=1e-15,
    )  # fmt: skip
    np.testing.assert_allclose(run.q, reference.y.T, rtol=2e-6)
    assert np.abs(run.q.sum(axis=1) - 1).max() < 1e-11
    assert run.steps < 400


@pytest.mark.parametrize("stiffness", [1.0, 1e3, 1e6])
def test_inputs_that_change_with_time_enter_with_their_derivative(stiffness):
    """Prothero and Robinson's problem, whose time is an input: without df/du u' the order falls to
    one."""
    t = np.linspace(0, 2, 21)
    run = integrate(
        prothero_robinson.address, None, [0.0], [], clock(), [stiffness], duration=2.0, save_at=t,
        rtol=1e-8, atol=1e-10, method=RODAS, jacobian=prothero_robinson_jacobian.address,
    )  # fmt: skip
    np.testing.assert_allclose(run.q[:, 0], np.sin(t), atol=5e-5 if stiffness > 1e3 else 1e-7)
    assert run.q_end[0] == pytest.approx(math.sin(2), abs=1e-7)
    assert run.steps < 100


def test_rows_are_interchanged_where_the_pivot_vanishes():
    """q'' = -q: the diagonal of the Jacobian is 0."""
    from simulation_problems import oscillator_jacobian

    run = integrate(
        oscillator.address,
        None,
        [1.0],
        [0.0],
        [],
        duration=10.0,
        method=RODAS,
        jacobian=oscillator_jacobian.address,
    )
    assert run.q_end[0] == pytest.approx(math.cos(10), abs=1e-7)


def test_without_a_jacobian_it_is_refused():
    with pytest.raises(LinkworkError, match="Rodas5P needs the address of the Jacobian's kernel"):
        integrate(oscillator.address, None, [1.0], [0.0], [], duration=1.0, method=RODAS)
