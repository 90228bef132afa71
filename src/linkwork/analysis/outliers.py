"""Samples that stand out from the others in least squares, and noise that is larger than stated.

Of rows y = J x + e, J = U diag(s) V', there remains r, of f = rows - rank freedoms. With the m rows
r_k of sample k and its share of what J reaches, H_k = U_k U_k', the sum of squares without it is
less by  d_k = r_k' (1 - H_k)^-1 r_k, and

    F_k = (d_k / m) / ((|r|^2 - d_k) / (f - m))

is distributed as F(m, f - m) where it is one of them.
Source: Cook & Weisberg 1982, Residuals and Influence in Regression, ch. 2 (mean-shift outliers).
"""

from __future__ import annotations

import warnings

import numpy as np

from linkwork.errors import ModelWarning

RARE = 1e-9
"""Probability of so large a value among all, beyond which chance is no reason for it."""
HELD = 1e-9  # part of a sample's rows that is left, below which the fit goes through it


def standing_out(remains: np.ndarray, left: np.ndarray) -> int | None:
    """Return the sample that least fits in with the others, if chance is no reason for it.

    remains: r (N, m); left: U (N m, rank)
    """
    from scipy.stats import f as distribution

    count, m = remains.shape
    freedoms = remains.size - left.shape[1] - m
    if freedoms < 1:
        return None
    U = left.reshape(count, m, -1)
    # What no other sample tells is left out: there the fit goes through any value.
    values, axes = np.linalg.eigh(np.eye(m) - U @ U.transpose(0, 2, 1))
    own = np.einsum("kij,ki->kj", axes, remains) ** 2
    less = np.sum(np.divide(own, values, where=values > HELD, out=np.zeros_like(own)), axis=1)
    rest = np.maximum(np.sum(remains**2) - less, 0.0)
    worst = int(np.argmax(less))
    if not rest[worst] > 0:
        return None
    chance = distribution.sf(less[worst] / m / (rest[worst] / freedoms), m, freedoms)
    return worst if count * chance < RARE else None


def warned_of_sample(remains: np.ndarray, left: np.ndarray, stacklevel: int) -> bool:
    """Warn of a sample that stands out, and tell whether there is one; as `standing_out`.

    stacklevel: of the one who is warned, 1 being who calls this
    """
    worst = standing_out(remains, left)
    if worst is not None:
        warnings.warn(
            f"sample {worst} (from 0) does not fit in with the others, and draws all numbers with "
            "it; look at what was measured there, or leave it out",
            ModelWarning,
            stacklevel=stacklevel + 1,
        )
    return worst is not None


def warned_by_rates(remains: np.ndarray, left: np.ndarray, stacklevel: int) -> None:
    """Do as `warned_of_sample` with rows that go through all samples of one rate, then of the next;
    remains: r (m, N)."""
    left = np.swapaxes(left.reshape(*remains.shape, -1), 0, 1).reshape(left.shape)
    warned_of_sample(remains.T, left, stacklevel + 1)


def beyond_noise(chi_square: float, freedoms: int) -> bool:
    """Tell whether what remains, over the stated noise, is more than chance is a reason for."""
    from scipy.stats import chi2

    return freedoms > 0 and bool(chi2.sf(chi_square, freedoms) < RARE)
