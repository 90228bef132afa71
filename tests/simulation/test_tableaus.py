"""The pairs against the order conditions and against SciPy's tables."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import RK23, RK45

from linkwork.simulation import BOGACKI_SHAMPINE, DORMAND_PRINCE, RODAS, SHARP_SMART, dop853

PAIRS = pytest.mark.parametrize(
    "pair", [DORMAND_PRINCE, BOGACKI_SHAMPINE], ids=lambda pair: pair.name
)


def elementary_weights(weights, a, c):
    """Give (order, left side, right side) for all rooted trees to order 5 (Hairer et al., I, table
    II.2.2)."""
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
    assert any(
        abs(left - right) > 1e-4
        for _, left, right in elementary_weights(b - pair.e, pair.a, pair.c)
    )


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


@cache
def trees(order):
    """Give all rooted trees with so many vertices, each as the sorted tuple of its branches."""
    found = {()} if order == 1 else set()

    def grow(left, largest, branches):
        if left == 0:
            found.add(tuple(sorted(branches)))
        for size in range(min(left, largest), 0, -1):
            for branch in trees(size):
                grow(left - size, size, (*branches, branch))

    if order > 1:
        grow(order - 1, order - 1, ())
    return sorted(found)


def vertices(tree):
    return 1 + sum(map(vertices, tree))


def density(tree):
    return vertices(tree) * math.prod(map(density, tree))


def elementary(tree, a):
    """Give the elementary weights of all stages."""
    return math.prod((a @ elementary(branch, a) for branch in tree), start=np.ones(len(a)))


def defects(weights, a, order):
    """Give how far weights are from the conditions of this order alone, for all rooted trees with
    so many vertices."""
    return [weights @ elementary(tree, a) - 1 / density(tree) for tree in trees(order)]


def test_there_are_as_many_rooted_trees_as_counted():
    assert [len(trees(order)) for order in range(1, 9)] == [
        1,
        1,
        2,
        4,
        9,
        20,
        48,
        115,
    ]  # Hairer et al., I, table II.2.3


@pytest.mark.parametrize(
    "pair", [DORMAND_PRINCE, SHARP_SMART, dop853()], ids=lambda pair: pair.name
)
def test_conditions_of_all_rooted_trees_are_met_up_to_the_order_and_no_further(pair):
    b, a = pair.a[-1], pair.a
    for weights, reached in (
        (b, pair.order),
        (b - pair.e, 5 if pair.second is not None else pair.error_order),
    ):
        assert (
            max(np.abs(defects(weights, a, order)).max() for order in range(1, reached + 1)) < 1e-13
        )
        assert np.abs(defects(weights, a, reached + 1)).max() > 1e-7


@pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, SHARP_SMART, dop853(), RODAS], ids=lambda method: method.name
)
def test_no_stage_is_beyond_the_step_and_the_new_state_is_at_its_end(method):
    """Exactly: beyond the end of a step forces may jump."""
    assert method.plan.c.min() >= 0 and method.plan.c.max() == 1
    assert method.plan.c[method.plan.solution] == 1


def test_dense_output_of_sharp_and_smart_is_of_order_6_and_smooth():
    a, P = SHARP_SMART.plan.a, SHARP_SMART.dense
    powers = np.arange(1, P.shape[1] + 1)
    for order in range(1, 7):
        for tree in trees(order):
            np.testing.assert_allclose(
                elementary(tree, a) @ P, (powers == order) / density(tree), atol=2e-12
            )
    ends = P[:, 0], P.sum(axis=1), P @ powers
    first, solution, last = np.eye(14)[0], np.append(SHARP_SMART.a[-1], [0, 0]), np.eye(14)[11]
    for found, exact in zip(ends, (first, solution, last), strict=True):
        np.testing.assert_allclose(found, exact, atol=2e-13)


@pytest.mark.parametrize(
    ("pair", "printed"),
    [(DORMAND_PRINCE, 3.31), (dop853(), 6.39), (SHARP_SMART, 3.9)],
    ids=lambda of: str(of)[:4],
)
def test_the_interval_of_stability_is_that_of_one_step_on_the_test_equation(pair, printed):
    """Hairer & Wanner II, sec. IV.2, take 3.25 and 6.1 for the first two, a little within."""
    s = pair.plan.solution

    def growth(z):
        return 1 + z * pair.a[-1, :-1] @ np.linalg.solve(
            np.eye(s) - z * pair.a[:-1, :-1], np.ones(s)
        )

    x = pair.stability
    assert x == pytest.approx(printed, abs=0.01)
    assert all(abs(growth(-part * x)) < 1 for part in np.linspace(0.01, 0.999, 200))
    assert abs(growth(-1.001 * x)) > 1
