"""Reflections of sparse rows, and steps of least length, against dense decompositions."""

import tracemalloc

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import derive
from linkwork.equations.equations import smallest_singular
from linkwork.equations.reference import least_step
from linkwork.equations.reflections import least_singular, reflect
from linkwork.robots import bricard, n_four_bar, stewart


def sparse_rows(seed: int, rows: int, columns: int, dependent: int = 0) -> np.ndarray:
    """Return random rows of three numbers each; the last `dependent` ones are sums of two
    others."""
    random = np.random.default_rng(seed)
    A = np.zeros((rows, columns))
    for row in A:
        row[random.choice(columns, 3, replace=False)] = random.normal(size=3)
    for k in range(rows - dependent, rows):
        A[k] = A[random.choice(rows - dependent, 2, replace=False)].sum(axis=0)
    return A


@pytest.mark.parametrize(
    ("rows", "columns", "dependent"), [(6, 9, 0), (30, 40, 5), (20, 12, 0), (12, 12, 0)]
)
def test_independent_rows_and_null_space(rows, columns, dependent):
    for seed in range(5):
        A = sparse_rows(seed, rows, columns, dependent)
        found = reflect(A)
        rank = np.linalg.matrix_rank(A)
        assert len(found.rows) == np.linalg.matrix_rank(A[list(found.rows)]) == rank
        for k in set(range(rows)) - set(found.rows):  # a row left out depends on those before it
            assert np.linalg.matrix_rank(A[: k + 1]) == np.linalg.matrix_rank(A[:k])
        N = found.null_space
        assert N.shape == (columns, columns - rank)
        assert np.allclose(N.T @ N, np.eye(columns - rank), atol=1e-14)
        assert np.allclose(A @ N, 0, atol=1e-13)


@pytest.mark.parametrize(("rows", "columns", "dependent"), [(6, 9, 0), (30, 40, 5), (25, 15, 10)])
def test_the_least_singular_value(rows, columns, dependent):
    for seed in range(5):
        A = sparse_rows(seed, rows, columns, dependent)
        rank, values = np.linalg.matrix_rank(A), np.linalg.svd(A, compute_uv=False)
        assert np.isclose(least_singular(A, rank), values[rank - 1], rtol=1e-9, atol=0)
        assert least_singular(A, rank + 1) is None


@pytest.mark.long
def test_a_large_ladder_is_judged_by_its_least_singular_value():
    """Above 300 rows no dense decomposition is made; with a redundant row it is the same value."""
    equations = derive(n_four_bar(160))
    (Phi,) = equations.tree.evaluated("Phi", [equations.rows.Phi])(equations.reference)
    Phi = equations.scaled(np.array(Phi))
    assert len(Phi) == 320
    exact = np.linalg.svd(Phi, compute_uv=False)
    assert np.isclose(equations.smallest, exact[-1], rtol=1e-9, atol=0)
    more = np.vstack([Phi, Phi[3] + Phi[7]])
    again = np.linalg.svd(more, compute_uv=False)
    assert np.isclose(smallest_singular(more, 320), again[319], rtol=1e-9, atol=0)
    stack = smallest_singular(np.array([Phi, 2 * Phi]), 320)
    assert np.allclose(stack, exact[-1] * np.array([1, 2]), rtol=1e-9, atol=0)


def test_without_rows_all_is_free():
    assert np.array_equal(reflect(np.zeros((0, 3))).null_space, np.eye(3))
    assert reflect(np.zeros((2, 3))).rows == ()


def test_null_space_of_mechanisms():
    for mechanism in (stewart(), n_four_bar(20), bricard()):
        equations = derive(mechanism)
        Phi = np.array(
            equations.tree.evaluated("Phi", [equations.rows.Phi])(equations.reference)[0]
        )
        _, values, rows = np.linalg.svd(Phi)
        N, rank = reflect(Phi).null_space, int((values > 1e-9).sum())
        assert np.allclose(N @ N.T, rows[rank:].T @ rows[rank:], atol=1e-11)


def test_reflections_of_a_ladder_stay_small():
    """The work grows with the number of loops, not with its cube."""
    for loops in (10, 40):
        equations = derive(n_four_bar(loops))
        Phi = np.array(
            equations.tree.evaluated("Phi", [equations.rows.Phi])(equations.reference)[0]
        )
        assert max(len(columns) for columns, _ in reflect(Phi).reflections) <= 6


@pytest.mark.parametrize(("rows", "columns", "dependent"), [(6, 9, 0), (30, 40, 5), (20, 12, 0)])
def test_sparse_step_of_least_length(rows, columns, dependent):
    for seed in range(5):
        tolerance = 1e-3 if dependent else 1e-9  # rows that contradict each other cost digits
        A, b = (
            sparse_rows(seed, rows, columns, dependent),
            np.random.default_rng(seed).normal(size=rows),
        )
        expected = -np.linalg.lstsq(A, b, rcond=1e-9)[0]
        assert np.allclose(
            least_step(ca.sparsify(ca.DM(A)), b),
            expected,
            rtol=0,
            atol=tolerance * np.abs(expected).max(),
        )


def test_loops_that_are_singular_to_working_precision_are_refused_in_one_sentence():
    mechanism = lw.Robot("four_bar").mechanism
    far = (1e12, 0.0, 0.0)  # m
    bodies = {
        name: body.model_copy(update={"centre_of_mass": far})
        for name, body in mechanism.bodies.items()
    }
    with pytest.raises(lw.LinkworkError, match=r"singular to working precision.* an inertia, a ma"):
        lw.Robot(mechanism.model_copy(update={"bodies": bodies}))


def test_what_is_remembered_of_a_matrix_is_not_the_matrix():
    A = np.eye(600, 601) + np.eye(600, 601, 1)
    tracemalloc.start()
    found = reflect(A)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < A.nbytes / 2 and reflect(A.copy()) is found
    assert reflect(2 * A) is not found and reflect(np.empty((0, 3))).null_space.shape == (3, 3)
