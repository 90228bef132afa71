"""The size of each kind of noise, as what least squares leave over tells it.

Of rows y = J x + e, J = U diag(s) V', there remains r = P e with P = 1 - U U'. Where the noise of
kind k has the deviation s_k, with P_gk the rows of kind g and columns of kind k,

    E |r_g|^2 = sum_k |P_gk|^2 s_k^2,    cov U'e = sum_k s_k^2 U_k'U_k

which is solved for s_k^2; what then is not positive, for there are few rows, is |r_g|^2 / f_g with
the freedoms f_g = rows less |U_g|^2, to which the other kinds add.
Source: Rao 1971, J. Multivariate Analysis 1, 257-275 (MINQUE).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

BARE = 1e-9  # freedoms over rows that are none


@dataclass(frozen=True, eq=False)
class NoiseShares:
    """Hold what remains of rows of several kinds.

    kinds: of the rows of a sample (rows); remains: r (N, rows); left: U (N rows, rank)
    """

    kinds: Sequence[str]
    remains: np.ndarray
    left: np.ndarray

    @cached_property
    def blocks(self) -> dict[str, np.ndarray]:
        """U_k'U_k by kind (rank x rank)."""
        of_rows = np.tile(self.kinds, len(self.remains))
        parts = {kind: self.left[of_rows == kind] for kind in dict.fromkeys(self.kinds)}
        return {kind: part.T @ part for kind, part in parts.items()}

    @cached_property
    def squares(self) -> dict[str, float]:
        """s_k^2 by kind; infinite where no row is left over to tell it."""
        blocks, own = [*self.blocks.values()], np.array(self.kinds)
        r = [self.remains[:, own == kind] for kind in self.blocks]
        rows = np.array([part.size for part in r])
        taken, sums = (np.array([f(x) for x in y]) for f, y in ((np.trace, blocks), (square, r)))
        freedoms = rows - taken
        if (freedoms < BARE * rows).any():
            return dict.fromkeys(self.blocks, np.inf)
        # |P_gk|^2, and squares that may come out below zero.
        weights = np.array([[np.sum(a * b) for b in blocks] for a in blocks])
        weights += np.diag(rows - 2 * taken)
        found = np.linalg.lstsq(weights, sums, rcond=None)[0]
        found = np.where(found > 0, found, sums / freedoms)
        return dict(zip(self.blocks, found.tolist(), strict=True))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of U'e (rank x rank)."""
        return np.sum([self.squares[kind] * B for kind, B in self.blocks.items()], axis=0)


def square(x: np.ndarray) -> float:
    """Return the sum of squares."""
    return float(np.sum(x**2))
