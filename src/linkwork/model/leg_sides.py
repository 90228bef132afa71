"""Sides: on which side of its own stretched pose each leg is, where one determinant tells it of
several legs at once.

    [Phi; J] w = [0; x'],    w = 0 in some rates of all motions that the loops allow

Rates that always stand still (the turns of a platform that only shifts) couple the legs in the rows
of Phi, but in no motion. Without their columns, and without what vanishes on closed configurations,
[Phi; J] has smaller stages: determinants of single legs, where that of all has a sign that two
folded legs give back. Where such rates move, as a platform's that has turned over where the loops
let it go, the configuration is on another side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.equations.chart import triangular
from linkwork.equations.independence import independent_rows
from linkwork.model.modes import ModeStage, ModeStages, determinant, same

STILL = 1e-7  # part of the joints' motion that is none
MOVED = 1e-4  # part of it that is one where loops are closed by Newton's method
FAINT = 1e-9  # singular value, over the largest, of rows that depend on each other
NOTHING = 1e-9  # entry of [Phi; J], in own units, that vanishes on closed configurations


@dataclass(frozen=True)
class LegSides:
    """Hold the stages of single legs, and the signs (stages) of their determinants somewhere.

    closing, rank: rows of Phi, and how many of them are independent; still: rates that stand still
        in all motions that they allow
    """

    stages: ModeStages
    signs: np.ndarray
    closing: int
    rank: int
    still: tuple[int, ...]

    def keeps(self, A: np.ndarray) -> np.ndarray:
        """Tell which configurations (K) are on this side, by A = [Phi; J] (K, rows, nv) in own
        units: also what stands still does so there."""
        turned = motions(A, self.closing, self.rank)[:, :, self.still]
        moved = np.abs(turned).max(axis=(1, 2), initial=0.0)
        return same(self.stages.signs(A), self.signs) & (moved <= MOVED)


def side_of(A: np.ndarray, closing: int) -> LegSides | None:
    """Return the side of the first of some closed configurations near each other; None where the
    stages are not found.

    Args:
        A: [Phi; J] (K, rows, nv) there, in own units.
        closing: number of its rows that close loops, those of Phi.
    """
    # What moves at all, and the rows that determine it.
    loops = independent_rows(list(A[:, :closing]))
    moves = np.linalg.norm(motions(A, closing, len(loops)), axis=1).max(axis=0) > STILL
    moving, still = np.flatnonzero(moves), tuple(np.flatnonzero(~moves).tolist())
    order = [*loops, *range(closing, A.shape[1])]
    parts = A[:, order][:, :, moving]
    there = np.abs(parts).max(axis=0) > NOTHING
    kept = sparsest(parts[-1], there)
    if len(kept) != len(moving):
        return None
    # Its stages; those of one sign everywhere tell nothing, and do no harm.
    stages = []
    for rows, columns in triangular({k: np.flatnonzero(there[k]).tolist() for k in kept}):
        places = tuple(order[k] for k in rows), tuple(moving[sorted(columns)].tolist())
        size = float(np.abs(determinant(A, *places)).max())
        stages.append(ModeStage(*places, max(size, 1e-300)))
    found = ModeStages(tuple(stages))
    return LegSides(found, found.signs(A[0]), closing, len(loops), still)


def motions(A: np.ndarray, closing: int, rank: int) -> np.ndarray:
    """Return orthonormal motions (K, freedoms, nv) that the rows of Phi of a rank allow, of which
    those that were independent elsewhere may depend on each other here."""
    return np.linalg.svd(A[:, :closing])[2][:, rank:]


def sparsest(A: np.ndarray, there: np.ndarray) -> list[int]:
    """Return independent rows of a matrix, those with the fewest entries (where `there`) first."""
    kept: list[int] = []
    for k in np.argsort(there.sum(axis=1), kind="stable").tolist():
        if np.linalg.matrix_rank(A[[*kept, k]], rtol=FAINT) > len(kept):
            kept.append(k)
    return kept
