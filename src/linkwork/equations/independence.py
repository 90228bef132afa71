"""Independence: which closure rows are kept, and which rates the others follow from.

The rows are the longest of what those before leave of them (QR with pivoting), and the independent
rates those that the kept rows leave; what is equal but for rounding is decided by the order.
Source: Golub & Van Loan, Matrix Computations, 4th ed., sec. 5.4.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkwork.equations.reflections import DEPENDENT_ROW, reflect

TIED = 1 - 1e-9  # lengths are equal from this ratio on: rounding decides nothing
SHARES = (0.05, 5e-3, 5e-4, 5e-5)  # what is left of a row that is kept, over the longest, at best
ROUNDING = 1e-15  # of a squared part that is left of 1, by length of the vectors
LITTLE = 0.01  # squared part that is left of 1, below which directions are made perpendicular again
FAINT = 1e-5  # of what rows leave of one, over the longest: rounding may tell where it points


def independent_rows(samples: Sequence[np.ndarray], count: int | None = None) -> tuple[int, ...]:
    """Return the rows of Phi to keep.

    Args:
        samples: Phi (rows x nv) at closed configurations, the reference configuration first.
        count: number of rows, if known: those that are least dependent at the first sample are
            taken; if not, those of the first sample at which the rank is largest.
    """
    if count is not None:
        every = count == len(samples[0])
        return tuple(range(count)) if every else tuple(sorted(largest_rows(samples[0], count)))
    kept: tuple[int, ...] = ()
    for Phi in samples:
        found = reflect(Phi).rows
        # Of rows that depend on each other none that is about to vanish, where another is not.
        if len(found) < len(Phi):
            others = (reflect(Phi, share).rows for share in SHARES)
            found = next((rows for rows in others if len(rows) == len(found)), found)
        kept = max(kept, found, key=len)
        if len(kept) == len(Phi):
            break
    return kept


def largest_rows(A: np.ndarray, count: int) -> list[int]:
    """Return `count` rows of A, each the longest of what the ones before it leave of the rows."""
    return orthogonal_rows(A[None], count)[0][0].tolist()


def orthogonal_rows(A: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `count` rows of matrices, and orthonormal bases of these.

    Each row is the longest of what the ones before it leave of the rows (QR with pivoting).

    Args:
        A: matrices (G x rows x columns).

    Returns:
        The rows in the order in which they are taken (G x count), and the bases (count x columns x
        G).
    """
    rest, every = np.moveaxis(A, 0, -1).copy(), np.arange(len(A))
    rows, bases = np.empty((len(A), count), int), np.empty((count, *rest.shape[1:]))
    lengths = np.empty((count, len(A)))
    taken = np.zeros((len(rest), len(A)), bool)
    for i in range(count):
        squares = np.where(taken, -1.0, (rest**2).sum(axis=1))
        row = np.argmax(squares >= TIED * squares.max(axis=0), axis=0)
        lengths[i] = np.sqrt(np.maximum(squares[row, every], 1e-300))
        bases[i] = rest[row, :, every].T / lengths[i]
        rest -= (rest * bases[i]).sum(axis=1, keepdims=True) * bases[i]
        rows[:, i], taken[row, every] = row, True
    shortest = lengths.min(axis=0, initial=np.inf)
    weak = np.flatnonzero(~(shortest > FAINT * lengths.max(axis=0, initial=0.0)))
    if weak.size:
        own = np.linalg.svd(np.take_along_axis(A[weak], rows[weak][:, :, None], axis=1))[2]
        bases[:, :, weak] = np.moveaxis(own[:, :count], 0, -1)
    return rows, bases


def choose_independent(
    Phi: np.ndarray, preferred: Sequence[int], share: float = DEPENDENT_ROW
) -> tuple[int, ...]:
    """Return n = nv - rank rates that determine the others: the preferred ones first, as far as
    they are independent.

    Args:
        Phi: kept rows of the constraint Jacobian (rows x nv), of full rank.
        preferred: rates in the order of preference.
        share: least part of a preferred rate's motion that is no motion of the rates taken before
            it.
    """
    held = reflect(Phi).row_space.T[:, :, None]
    return tuple(choose_independents(held, preferred, share)[0].tolist())


def choose_independents(
    held: np.ndarray, preferred: Sequence[int], share: float = DEPENDENT_ROW
) -> np.ndarray:
    """Return the n rates that `choose_independent` takes at each of G configurations (G x n).

    What the constraints and the rates taken before leave of the motion of rate k is the k-th unit
    vector without its parts along orthonormal directions d, |e_k|^2 - sum d_k^2 of it.

    Args:
        held: orthonormal bases of what the constraints hold (rank x nv x G).
        preferred, share: as for `choose_independent`.
    """
    rank, width, groups = held.shape
    directions, every, n = [*held], np.arange(groups), width - rank
    left = np.maximum(1 - (held**2).sum(axis=0), 0.0)
    # A rate that the constraints hold has no more than rounding left.
    least = np.maximum((share * np.maximum(np.sqrt(left), share)) ** 2, ROUNDING * width)
    chosen, count = np.full((groups, n), -1), np.zeros(groups, int)
    free, idle = np.ones((width, groups), bool), (held == 0).all(axis=(0, 2))

    def take(rates: np.ndarray | int, able: np.ndarray) -> None:
        at = (rates, slice(None)) if isinstance(rates, int) else (rates, every)
        if idle[rates].all():  # no other rate has to do with what no constraint holds any part of
            left[at] *= ~able
        else:
            direction = np.zeros((width, groups))
            direction[at] = 1.0
            for other in directions:
                direction -= other[at] * other
            # Once more where rounding is much of the little that is left.
            for other in directions if (able & (left[at] < LITTLE)).any() else ():
                direction -= (other * direction).sum(axis=0) * other
            direction *= able / np.maximum(np.sqrt((direction**2).sum(axis=0)), 1e-300)
            directions.append(direction)
            np.maximum(left - direction**2, 0.0, out=left)
        free[at] &= ~able
        chosen[every[able], count[able]] = np.broadcast_to(rates, groups)[able]
        count[able] += 1

    for k in dict.fromkeys(preferred):
        able = (count < n) & (left[k] > least[k])
        if able.any():
            take(k, able)
    while (count < n).any():
        lengths = np.where(free, np.sqrt(left), -1.0)
        take(np.argmax(lengths >= TIED * lengths.max(axis=0), axis=0), count < n)
    return chosen
