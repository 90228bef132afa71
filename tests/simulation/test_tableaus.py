"""The pairs against the order conditions and against SciPy's tables."""

import numpy as np
import pytest
from scipy.integrate import RK23, RK45

from linkwork.simulation import BOGACKI_SHAMPINE, DORMAND_PRINCE

PAIRS = pytest.mark.parametrize("pair", [DORMAND_PRINCE, BOGACKI_SHAMPINE], ids=lambda pair: pair.name)


def elementary_weights(weights, a, c):
    """Give (order, left side, right side) for all rooted trees to order 5 (Hairer et al., I, table II.2.2)."""
    ac, ac2, ac3, aac = a @ c, a @ c**2, a @ c**3, a @ (a @ c)
    return [
        (1, weights.sum(), 1),
        (2, weights @ c, 1 / 2),
        (3, weights @ c**2, 1 / 3),
        (3, weights @ ac, 1 / 6),
        (4, weights @ c**3, 1 / 4),
        (4, weights @ (c * ac), 1 / 8),
        (4, weights @ ac2, 1 / 12),
        (4, weights @ aac, 1 / 24),
        (5, weights @ c**4, 1 / 5),
        (5, weights @ (c**2 * ac), 1 / 10),
        (5, weights @ (c * ac2), 1 / 15),
        (5, weights @ (c * aac), 1 / 30),
        (5, weights @ ac**2, 1 / 20),
        (5, weights @ ac3, 1 / 20),
        (5, weights @ (a @ (c * ac)), 1 / 40),
        (5, weights @ (a @ ac2), 1 / 60),
        (5, weights @ (a @ aac), 1 / 120),
    ]


@PAIRS
def test_solution_and_error_estimate_meet_their_order_conditions(pair):
    b = pair.a[-1]
    for weights, order in (b, pair.order), (b - pair.e, pair.error_order):
        for tree_order, left, right in elementary_weights(weights, pair.a, pair.c):
            if tree_order <= order:
                assert left == pytest.approx(right, abs=2e-15)
    assert any(abs(left - right) > 1e-4 for _, left, right in elementary_weights(b - pair.e, pair.a, pair.c))


@PAIRS
@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0])
def test_dense_output_meets_the_conditions_of_one_order_less(pair, theta):
    weights = pair.dense @ theta ** np.arange(1, 5)
    for tree_order, left, right in elementary_weights(weights, pair.a, pair.c):
        if tree_order <= min(pair.order, 4):
            assert left == pytest.approx(right * theta**tree_order, abs=2e-15)


@PAIRS
def test_last_stage_is_the_first_of_the_next_step(pair):
    assert pair.c[-1] == 1
    assert np.all(np.triu(pair.a) == 0)


@pytest.mark.parametrize(("pair", "scipy"), [(DORMAND_PRINCE, RK45), (BOGACKI_SHAMPINE, RK23)])
def test_tables_agree_with_scipy(pair, scipy):
    np.testing.assert_allclose(pair.a[:-1, : scipy.A.shape[1]], scipy.A, atol=1e-15)
    np.testing.assert_allclose(pair.a[-1, :-1], scipy.B, atol=1e-15)
    np.testing.assert_allclose(np.abs(pair.e), np.abs(scipy.E), atol=1e-15)
    np.testing.assert_allclose(pair.dense[:, : scipy.P.shape[1]], scipy.P, atol=1e-14)


def test_tables_cannot_be_written():
    with pytest.raises(ValueError):
        DORMAND_PRINCE.a[0, 0] = 1
