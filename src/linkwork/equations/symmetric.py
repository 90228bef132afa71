"""Symmetric positive systems of equations, solved without a branch.

More than three unknowns are eliminated where that couples fewest of the others first (minimum
degree): of an inertia matrix the leaves before what carries them, so that what two branches have to
do with each other is not filled in. Where all are coupled they are taken in turn.
Source: Tinney & Walker 1967; Featherstone 2008, sec. 6.5 (branch-induced sparsity).
"""

from __future__ import annotations

import operator
from functools import reduce

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX
from linkwork.equations.chart import COFACTOR_SIZE

HIDDEN = 1e-13  # part of a product that rounding hides


def solve_symmetric(A: ca.SX, b: ca.SX) -> ca.SX:
    """Solve A x = b for a symmetric positive A, and right sides b (n x any number).

    Up to three unknowns by cofactors, A^-1 = adj A / det A: one division, and short chains of
    operations. More by A = U' D U without square roots, U unit upper triangular in the order of
    `leaves_first`. Where A is singular but for rounding x is not finite: by Hadamard's inequality
    det A <= prod A_ii, of which less than HIDDEN is left, and likewise 1 / D_i <= A_ii.
    """
    n = A.shape[0]
    if n <= COFACTOR_SIZE:
        adjugate = ca.densify(ca.adj(A))
        det = ca.mtimes(A[0, :], adjugate[:, 0])
        x = ca.mtimes(adjugate, b) / det
        x[0, :] += unless(det > HIDDEN * product(ca.diag(A))) if n > 1 else 0
        return x
    order = leaves_first(coupled(A))
    solved, inverses = eliminated(A[order, order], [b[i, :] for i in order])
    lost = sum(((A[i, i] * D) ** 2 for i, D in list(zip(order, inverses, strict=True))[1:]), SX(0))
    x = [SX(0)] * n
    for i, value in zip(order, solved, strict=True):
        x[i] = value
    x[0] = unless(lost < HIDDEN**-2) + x[0]
    return ca.vertcat(*x)


def coupled(A: ca.SX) -> np.ndarray:
    """Tell which elements of a matrix are not zero."""
    found = np.zeros(A.shape, bool)
    for i, j in zip(*A.sparsity().get_triplet(), strict=True):
        found[i, j] = not A[i, j].is_zero()
    return found


def leaves_first(pattern: np.ndarray) -> list[int]:
    """Return the unknowns of a symmetric pattern (n x n), each the first of those that are coupled
    with fewest others when those before it are eliminated."""
    near = [{*np.flatnonzero(row).tolist()} - {i} for i, row in enumerate(pattern)]
    left, order = list(range(len(near))), []
    while left:
        i = min(left, key=lambda k: len(near[k]))
        left.remove(i)
        order.append(i)
        for k in near[i]:
            near[k] = (near[k] | near[i]) - {i, k}
    return order


def eliminated(A: ca.SX, b: list[ca.SX]) -> tuple[list[ca.SX], list[ca.SX]]:
    """Return x of A x = b, and the inverses 1 / D of the pivots of A = U' D U: W = D U."""
    n, filled = A.shape[0], coupled(A)
    W: list[dict[int, ca.SX]] = [{} for _ in range(n)]
    U: list[dict[int, ca.SX]] = [{} for _ in range(n)]
    above: list[list[int]] = [[] for _ in range(n)]  # rows of U with an element in each column
    inverses: list[ca.SX] = []
    for i in range(n):
        places = (
            {i} | {j for j in range(i, n) if filled[i, j]} | {j for k in above[i] for j in U[k]}
        )
        for j in sorted(j for j in places if j >= i):
            W[i][j] = A[i, j] - sum(
                (W[k][i] * U[k][j] for k in above[i] if j in U[k] or j == i), SX(0)
            )
        inverses.append(1 / W[i][i])
        for j in [j for j in W[i] if j > i]:
            U[i][j] = W[i][j] * inverses[i]
            above[j].append(i)
    # Forward, through D, and back.
    x = list(b)
    for i in range(n):
        for k in above[i]:
            x[i] = x[i] - U[k][i] * x[k]
    x = [x[i] * inverses[i] for i in range(n)]
    for i in reversed(range(n)):
        for k in sorted(U[i]):
            x[i] = x[i] - U[i][k] * x[k]
    return x, inverses


def unless(condition: ca.SX) -> ca.SX:
    """Return 0 where a condition holds, else infinity."""
    return ca.if_else(condition, 0, ca.inf)


def product(factors: ca.SX) -> ca.SX:
    """Return the product of the elements of a column."""
    return reduce(operator.mul, ca.vertsplit(factors))
