"""Margins: whether a configuration leads to decisions that were met before, in compiled code.

A chart is chosen by comparisons (`equations.chart_choice`): which rows depend least on each other,
which rates determine the others well, which pivots are strong, how far each pivot is below its
usual size. Here they are made anew at each configuration, and held against those that led to a
known chart. What is nearer to turning out otherwise than rounding could explain is not decided
here; who asks chooses by `charts_at` then, so that the answer is the same with and without.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit, types

from linkwork.equations.chart import WEAK_PIVOT, Asked, Block, StageBegun, Tested
from linkwork.equations.chart_choice import FALL, LEAST, NOISE, WELL
from linkwork.equations.equations import DOUBTFUL
from linkwork.equations.independence import FAINT, TIED
from linkwork.simulation.compiled import INLINED, OPTIONS, compiled_once, is_kept
from linkwork.simulation.pointers import uncounted

MARGIN = 1e-11  # of a comparison that rounding cannot turn; below 1 - TIED
ROUNDED = 1e-12  # of a determinant, over the usual size of its rows and columns
UNKNOWN = -1
LOG_FALL = math.log(FALL)
ROW, COLUMN, STRONG, WEAK, BLOCK = range(5)  # what a step of an elimination tells

_INTEGERS, _TABLE = types.Array(types.int64, 1, "C"), types.Array(types.int64, 2, "C")
_NUMBERS, _STACK = types.Array(types.float64, 2, "C"), types.Array(types.float64, 3, "C")


def steps_of(asked: Asked) -> list[list[int]]:
    """Return what decided on an order as `same_order` takes it, in lines of eight numbers."""
    match asked:
        case StageBegun(rows, columns):
            lines = [[ROW, row] for row in rows] + [[COLUMN, 0, column] for column in columns]
        case Tested(row, column, strong):
            lines = [[STRONG if strong else WEAK, row, column]]
        case Block(rows, columns):
            filled = ([*part, *[0] * (3 - len(part))] for part in (rows, columns))
            lines = [[BLOCK, len(rows), *next(filled), *next(filled)]]
        case None:
            lines = []
    return [line + [0] * (8 - len(line)) for line in lines]


SIGNATURE = types.void(
    *(_STACK, _STACK, types.float64, _INTEGERS),
    *(_TABLE, _TABLE, _TABLE, _INTEGERS, _NUMBERS, _INTEGERS, _TABLE),
)


@njit(**OPTIONS)
def rank_kept(A, rank, bound, S):
    """Tell whether A (rows x nv) has `rank` singular values above a bound: 1, 0 or UNKNOWN.

    By the signs of the pivots of S = A A' - bound^2 (`equations.above`), room for which (rows x
    rows) is given.
    """
    rows, width = A.shape
    largest = 0.0
    for i in range(rows):
        for j in range(i + 1):
            total = 0.0
            for k in range(width):
                total += A[i, k] * A[j, k]
            S[i, j] = S[j, i] = total - bound * bound if i == j else total
            largest = max(largest, abs(S[i, j]))
    count, weakest = 0, np.inf
    for i in range(rows):
        pivot = S[i, i]
        weakest = min(weakest, abs(pivot))
        count += pivot > 0
        for j in range(i + 1, rows):
            factor = S[j, i] / pivot
            for k in range(i + 1, rows):
                S[j, k] -= factor * S[i, k]
    if rank == 0:
        return 1
    return int(count >= rank) if weakest > DOUBTFUL * largest else UNKNOWN


@njit(**OPTIONS)
def kept_rows(A, bases, kept, squares):
    """Mark the rows that `orthogonal_rows` takes, with orthonormal bases of them (rank x nv); tell
    whether that is sure.

    A (rows x nv) and squares (rows) are used up.
    """
    rows, width = A.shape
    every = len(bases) == rows
    longest, shortest = 0.0, np.inf
    for r in range(rows):
        kept[r] = 0
    for i in range(len(bases)):
        # The longest of what is left of the rows; the first of those that are as long.
        largest, taken = 0.0, -1
        for r in range(rows):
            if not kept[r]:
                square = 0.0
                for k in range(width):
                    square += A[r, k] * A[r, k]
                squares[r], largest = square, max(largest, square)
        for r in range(rows):
            if not kept[r]:
                if not every and abs(squares[r] - TIED * largest) <= MARGIN * largest:
                    return False
                if taken < 0 and squares[r] >= TIED * largest:
                    taken = r
        if taken < 0 or largest == 0.0:
            return False
        length = math.sqrt(squares[taken])
        longest, shortest = max(longest, length), min(shortest, length)
        # Its part goes out of the others.
        kept[taken] = 1
        for k in range(width):
            bases[i, k] = A[taken, k] / length
        for r in range(rows):
            if not kept[r]:
                part = 0.0
                for k in range(width):
                    part += A[r, k] * bases[i, k]
                if part != 0.0:
                    for k in range(width):
                        A[r, k] -= part * bases[i, k]
    return len(bases) == 0 or shortest > (1 + MARGIN) * FAINT * longest


@njit(**OPTIONS)
def independent_rates(bases, preferred, chosen, free, directions, left, least, roots):
    """Fill in the n rates that `choose_independents` takes; tell whether that is sure.

    bases: orthonormal, of what the constraints hold (rank x nv); free, directions (n x nv), left,
    least, roots (nv): room
    """
    rank, width = bases.shape
    n, count = width - rank, 0
    for k in range(width):
        rest = 1.0
        for i in range(rank):
            rest -= bases[i, k] * bases[i, k]
        left[k], free[k] = max(rest, 0.0), True
        least[k] = (WELL * max(math.sqrt(left[k]), WELL)) ** 2
    for step in range(len(preferred) + n if n > 0 else 0):
        # The next preferred rate, if enough of its motion is left; then those with the most left.
        taken = -1
        if step < len(preferred):
            taken = preferred[step]
            if abs(left[taken] - least[taken]) <= MARGIN:
                return False
            if left[taken] < least[taken] or not free[taken]:
                continue
        else:
            largest = 0.0
            for k in range(width):
                roots[k] = math.sqrt(left[k])
                if free[k]:
                    largest = max(largest, roots[k])
            for k in range(width):
                if free[k]:
                    if abs(roots[k] - TIED * largest) <= MARGIN * max(largest, FAINT):
                        return False
                    if taken < 0 and roots[k] >= TIED * largest:
                        taken = k
        if taken < 0 or left[taken] < FAINT:
            return False
        chosen[count], free[taken] = taken, False
        if count == n - 1:
            return True
        # What it takes of the motion of the others.
        length = math.sqrt(left[taken])
        for k in range(width):
            part = 1.0 if k == taken else 0.0
            for i in range(rank):
                part -= bases[i, taken] * bases[i, k]
            for i in range(count):
                part -= directions[i, taken] * directions[i, k]
            directions[count, k] = part / length
        for k in range(width):
            left[k] = max(left[k] - directions[count, k] ** 2, 0.0)
        count += 1
    return n == 0


@njit(**OPTIONS)
def determinant(A, step):
    """Return the determinant of a block of A (rows x nv): of one to three rows and columns."""
    size, r, s, t = step[1], step[2], step[3], step[4]
    c, d, e = step[5], step[6], step[7]
    if size == 1:
        return A[r, c]
    if size == 2:
        return A[r, c] * A[s, d] - A[r, d] * A[s, c]
    return (
        A[r, c] * (A[s, d] * A[t, e] - A[s, e] * A[t, d])
        - A[r, d] * (A[s, c] * A[t, e] - A[s, e] * A[t, c])
        + A[r, e] * (A[s, c] * A[t, d] - A[s, d] * A[t, c])
    )


@njit(**OPTIONS)
def same_order(A, steps, sizes, falls, in_rows, in_columns):
    """Tell whether the numbers A (rows x nv) lead to an order of elimination; fill in how its
    scales fall.

    Args:
        steps: what was found on the way, one a line: kind, then the entry, or the size of a block
            with its rows and columns.
        sizes: units of the blocks' determinants, and their usual sizes (2 x blocks).
        falls: twice the steps of FALL by which each scale is below its usual size, and 1 where the
            determinant is negative (blocks).
        in_rows, in_columns: room for which are left (rows, nv).
    """
    width, number = A.shape[1], 0
    in_rows[:], in_columns[:] = False, False
    for step in steps:
        kind, r, c = step[0], step[1], step[2]
        if kind == ROW:
            in_rows[r] = True
        elif kind == COLUMN:
            in_columns[c] = True
        elif kind == BLOCK:
            # How far the determinant is below its usual size.
            found = determinant(A, step) * sizes[0, number]
            usual = sizes[1, number]
            if not abs(found) > 2 * NOISE * usual:
                return False
            fall = math.log(LEAST * usual / abs(found)) / LOG_FALL
            if fall > -0.5 and abs(fall - round(fall)) <= MARGIN + ROUNDED * usual / abs(found):
                return False
            falls[number] = 2 * int(max(math.ceil(fall), 0.0)) + (found < 0)
            number += 1
            size = r
            for i in range(size):
                in_rows[step[2 + i]], in_columns[step[5 + i]] = False, False
            if size == 1:
                eliminate(A, step[2], step[5], in_rows, in_columns)
        else:
            # Whether an entry is strong in its row.
            largest = 1e-300
            for k in range(width):
                if in_columns[k]:
                    largest = max(largest, abs(A[r, k]))
            strength = abs(A[r, c]) / largest
            if abs(strength - WEAK_PIVOT) <= MARGIN or (strength > WEAK_PIVOT) != (kind == STRONG):
                return False
    return True


@njit(**INLINED)
def equal(a, b):
    """Tell whether two lists of integers are equal."""
    same = True
    for i in range(len(a)):
        same &= a[i] == b[i]
    return same


@njit(**INLINED)
def scaled_by(Phi, factors, A):
    """Fill A with the elements of Phi, each by its factor."""
    for r in range(Phi.shape[0]):
        for k in range(Phi.shape[1]):
            A[r, k] = Phi[r, k] * factors[r, k]


@njit(**OPTIONS)
def eliminate(A, pivot_row, column, in_rows, in_columns):
    """Eliminate a column from the rows that are left, by a row with a single pivot."""
    for r in range(len(A)):
        if in_rows[r] and A[r, column] != 0.0:
            factor = A[r, column] / A[pivot_row, column]
            for k in range(A.shape[1]):
                if in_columns[k]:
                    A[r, k] -= factor * A[pivot_row, k]


def were_compiled() -> bool:
    """Tell whether `decide` was compiled on this machine before."""
    return is_kept(decide)


@cache
def compiled() -> Callable[..., None]:
    """Return `decide`, compiled."""
    return compiled_once("the choice of charts", SIGNATURE)(decide)


def decide(
    Phi, factors, bound, preferred, kept, independent, steps, steps_at, sizes, sizes_at, found
):
    """Hold configurations against the decisions that led to known charts.

    Args:
        Phi: constraint Jacobians (G x rows x nv).
        factors: of its elements, for numbers free of units and for those in own units (2 x rows x
            nv).
        bound: singular value from which on a configuration is regular.
        preferred: rates that should be independent.
        kept, independent: which rows known orders keep (K x rows), and their rates (K x n).
        steps, sizes: their eliminations, as for `same_order`, one after the other; order k's begin
            at steps_at[k] and sizes_at[k], and end where the next begin.
        found: filled with (G x (2 + most blocks)): whether the configuration is regular, the
            number of the order, both UNKNOWN where that is not sure, and how its scales fall; the
            rest of a line tells nothing.
    """
    # The caller keeps all of this alive.
    Phi, factors, found = uncounted(Phi), uncounted(factors), uncounted(found)
    steps, sizes = uncounted(steps), uncounted(sizes)
    kept, independent = uncounted(kept), uncounted(independent)
    rows, width, n = Phi.shape[1], Phi.shape[2], independent.shape[1]
    # Room for all configurations.
    bases, own = np.empty((width - n, width)), np.empty(rows, np.int64)
    chosen, A = np.empty(n, np.int64), np.empty((rows, width))
    S, squares, directions = np.empty((rows, rows)), np.empty(rows), np.empty((n, width))
    left, least, roots = np.empty(width), np.empty(width), np.empty(width)
    in_rows, in_columns = np.empty(rows, np.bool_), np.empty(width, np.bool_)
    free = np.empty(width, np.bool_)
    for g in range(len(Phi)):
        scaled_by(Phi[g], factors[0], A)
        found[g, 0], found[g, 1] = rank_kept(A, width - n, bound, S), UNKNOWN
        sure = kept_rows(A, bases, own, squares) and independent_rates(
            bases, preferred, chosen, free, directions, left, least, roots
        )
        for k in range(len(kept) if sure else 0):
            if equal(own, kept[k]) and equal(chosen, independent[k]):
                scaled_by(Phi[g], factors[1], A)
                held = steps[steps_at[k] : steps_at[k + 1]]
                blocks = sizes[:, sizes_at[k] : sizes_at[k + 1]]
                for i in range(2, found.shape[1]):
                    found[g, i] = 0
                if same_order(A, held, blocks, found[g, 2:], in_rows, in_columns):
                    found[g, 1] = k
                    break
