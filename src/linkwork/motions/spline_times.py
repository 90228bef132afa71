"""Splines through points, and the times between these that take the least sum.

    min sum_k h_k   where   |x_i^(j)(t)| <= limit_ij   on every piece

is solved by sequential quadratic programming; derivatives are looked at on a grid of each piece.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from linkwork.motions.profiles import Profile

GRID = np.linspace(0.0, 1.0, 17)  # of each piece, its ends included
STEEPEST = 20.0  # factor by which a time may leave the one that it began from
CLOSE = 1e-8  # of the duration, to end the descent


def spline_through(times: np.ndarray, values: np.ndarray, degree: int) -> Profile:
    """Return the spline of degree 3 or 5 from rest to rest through values (K, d), with times
    (K - 1,) between them [s]; of degree 5 also without acceleration at its ends."""
    from scipy.interpolate import make_interp_spline

    knots = np.concatenate([[0.0], np.cumsum(times)])
    still = [(order, np.zeros(values.shape[1])) for order in range(1, (degree + 1) // 2)]
    spline = make_interp_spline(knots, values, k=degree, bc_type=(still, still))
    rows = [spline(knots[:-1], order) / factorial(order) for order in range(degree + 1)]
    return Profile(knots, np.stack(rows, axis=1))


def least_times(
    times: np.ndarray, values: np.ndarray, allowed: np.ndarray, degree: int
) -> np.ndarray:
    """Return times (K - 1,) of the least sum that is found from given ones, both scaled to keep
    limits (3, d), infinite where there is none."""
    from scipy.optimize import minimize

    first = times * slowing(taken(times, values, allowed, degree))
    weights = first / first.sum()
    found = minimize(
        lambda x: x @ weights,
        np.ones(len(first)),
        jac=lambda x: weights,
        bounds=[(1 / STEEPEST, STEEPEST)] * len(first),
        constraints={
            "type": "ineq",
            "fun": lambda x: 1.0 - np.concatenate(taken(x * first, values, allowed, degree), None),
        },
        method="SLSQP",
        options={"ftol": CLOSE, "maxiter": 200},
    )
    if not np.isfinite(found.x).all():
        return first
    last = found.x * first
    return min((first, last * slowing(taken(last, values, allowed, degree))), key=np.sum)


def taken(
    times: np.ndarray, values: np.ndarray, allowed: np.ndarray, degree: int
) -> list[np.ndarray]:
    """Return the largest part of each limit (3, d) that the spline takes on each piece (K - 1, d),
    order by order."""
    profile = spline_through(times, values, degree)
    return [on_grid(profile, order) / limit for order, limit in enumerate(allowed, 1)]


def slowing(parts: list[np.ndarray]) -> float:
    """Return the least factor of the duration by which all limits are kept, from the parts of them
    that are taken: of speeds, accelerations and jerks."""
    return max(float(part.max()) ** (1 / order) for order, part in enumerate(parts, 1))


def on_grid(profile: Profile, order: int) -> np.ndarray:
    """Return the largest size of a derivative (pieces, d) on a grid of each piece."""
    rows, lengths = profile.derivatives[order], np.diff(profile.knots)
    s = lengths[:, None, None] * GRID[:, None]
    values = np.zeros((len(rows), len(GRID), rows.shape[2]))
    for power in reversed(range(rows.shape[1])):
        values = values * s + rows[:, None, power]
    return np.abs(values).max(axis=1)
