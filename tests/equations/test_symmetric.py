"""Symmetric systems: against NumPy, and how many operations sparse ones take."""

import casadi as ca
import numpy as np
import pytest

from linkwork.equations.symmetric import leaves_first, solve_symmetric


def branched(limbs: int, each: int, base: int = 6) -> np.ndarray:
    """Return the pattern of the inertia of chains that hang on a free base."""
    n = base + limbs * each
    pattern = np.zeros((n, n), bool)
    pattern[:base], pattern[:, :base] = True, True
    for limb in range(limbs):
        own = slice(base + limb * each, base + (limb + 1) * each)
        pattern[own, own] = True
    return pattern


def solver(pattern: np.ndarray) -> ca.Function:
    """Return (lower triangle, b) -> x for matrices of a pattern."""
    n = len(pattern)
    rows, columns = np.nonzero(np.tril(pattern))
    values, b, A = ca.SX.sym("A", len(rows)), ca.SX.sym("b", n), ca.SX.zeros(n, n)
    for k, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
        A[i, j] = A[j, i] = values[k]
    return ca.Function("solver", [values, b], [solve_symmetric(A, b)])


def positive(pattern: np.ndarray, seed: int) -> np.ndarray:
    """Return a random positive matrix of a pattern."""
    A = np.random.default_rng(seed).normal(size=pattern.shape) * pattern
    A = A + A.T
    return A + np.diag(1 + np.abs(A).sum(axis=1))


SCATTERED = np.random.default_rng(7).random((9, 9)) < 0.2
PATTERNS = {
    "all coupled": np.ones((7, 7), bool),
    "two limbs": branched(2, 4),
    "four limbs": branched(4, 3),
    "uncoupled": np.eye(5, dtype=bool),
    "scattered": SCATTERED | SCATTERED.T | np.eye(9, dtype=bool),
}


@pytest.mark.parametrize("name", PATTERNS)
def test_solutions_against_numpy(name: str):
    pattern = PATTERNS[name]
    solve = solver(pattern)
    for seed in range(4):
        A = positive(pattern, seed)
        b = np.random.default_rng(seed + 10).normal(size=len(A))
        x = np.array(solve(A[np.nonzero(np.tril(pattern))], b)).ravel()
        np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-12, atol=1e-13)


def test_what_is_coupled_with_all_is_taken_in_turn():
    assert leaves_first(np.ones((6, 6), bool)) == list(range(6))


def test_limbs_are_eliminated_before_what_carries_them():
    """The last limb and the base are coupled altogether, so that their order is of no matter."""
    assert leaves_first(branched(3, 4))[:8] == list(range(6, 14))


def test_operations_grow_with_the_number_of_limbs():
    """Limbs are not coupled by what carries them."""
    counts = [solver(branched(limbs, 5)).n_instructions() for limbs in (1, 2, 3, 6)]
    assert counts[2] - counts[1] <= 1.02 * (counts[1] - counts[0])
    assert counts[3] - counts[2] <= 3.06 * (counts[1] - counts[0])


@pytest.mark.parametrize("lost", [0, 3, 8, 13])
def test_a_singular_matrix_has_no_finite_solution(lost: int):
    """One unknown has no inertia but what the others' motion hides."""
    pattern = branched(2, 4)
    solve, A = solver(pattern), positive(pattern, 1)
    rest = np.delete(np.arange(len(A)), lost)
    A[lost, lost] = A[lost, rest] @ np.linalg.solve(A[np.ix_(rest, rest)], A[rest, lost])
    x = solve(A[np.nonzero(np.tril(pattern))], np.ones(len(A)))
    assert not np.isfinite(np.array(x)).all()
