"""Reachability: the fastest law s(t) along a path under constraints that are linear in s'' and x =
s'^2.

    a s'' + b x <= c  at each point s_i of a grid,    x_(i+1) = x_i + 2 (s_(i+1) - s_i) s''_i

s'' is constant between two points and keeps the constraints of both. Backwards, the x_i are found
from which a next x_(i+1) is left that leads to the end, an interval each; forwards, the largest s''
that stays in them is taken. Each step asks for what is left of x when s'' is eliminated from a few
linear inequalities (Fourier-Motzkin), which is exact.

Source: Pham & Pham, A new approach to time-optimal path parameterization based on reachability
analysis, IEEE Trans. Robotics 34 (2018) 645.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.motions.profiles import Profile

ROUNDING = 1e-10
"""How far the ends of an interval of x may be exchanged, over their size, and be one point."""


class NoLawError(Exception):
    """Tell at which point of the grid no law keeps the constraints, or that nothing limits it."""

    def __init__(self, point: int, unbounded: bool = False) -> None:
        super().__init__(point, unbounded)
        self.point, self.unbounded = point, unbounded


@dataclass(frozen=True, eq=False)
class Constraints:
    """Hold rows a s'' + b x <= c (points, rows) at the points of a grid s (points,)."""

    s: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray

    def rows(self, i: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the rows a, b, c for s'' and x at a point i that the way to the next point has to
        keep, where x is between low and high."""
        step = 2 * (self.s[i + 1] - self.s[i])
        ahead = self.a[i + 1] + step * self.b[i + 1]
        return (
            np.concatenate([self.a[i], ahead, [step, -step]]),
            np.concatenate([self.b[i], self.b[i + 1], [1.0, -1.0]]),
            np.concatenate([self.c[i], self.c[i + 1], [high, -low]]),
        )


def fastest_squares(given: Constraints, still: tuple[bool, bool]) -> np.ndarray:
    """Return x = s'^2 (points,) of the fastest law.

    still: whether s' = 0 at the begin and at the end; free where the path itself rests there

    Raises:
        NoLawError: there is none, or it is infinitely fast.
    """
    ends = controllable(given, still[1])
    if still[0] and ends[0, 0] > 0:
        raise NoLawError(0)
    x = np.empty(len(given.s))
    x[0] = 0.0 if still[0] else ends[0, 1]
    for i in range(len(x) - 1):
        a, b, c = given.rows(i, *ends[i + 1])
        upward = a > 0
        most = ((c - b * x[i])[upward] / a[upward]).min()
        x[i + 1] = np.clip(x[i] + 2 * (given.s[i + 1] - given.s[i]) * most, *ends[i + 1])
    return x


def controllable(given: Constraints, still: bool) -> np.ndarray:
    """Return the least and the largest x (points, 2) from which the end is reached, at rest if it
    is asked for."""
    ends = np.empty((len(given.s), 2))
    last = given.b[-1], given.c[-1]
    ends[-1] = (0.0, 0.0) if still else interval(*last, len(ends) - 1)
    for i in reversed(range(len(ends) - 1)):
        ends[i] = left(*given.rows(i, *ends[i + 1]), i)
    return ends


def left(a: np.ndarray, b: np.ndarray, c: np.ndarray, point: int) -> tuple[float, float]:
    """Return the least and the largest x >= 0 for which some s'' keeps a s'' + b x <= c.

    Of each pair of rows that bound s'' from above and from below,  a_2 (c_1 - b_1 x) <= a_1 (c_2 -
    b_2 x)  with a_1 > 0 > a_2  stays.
    """
    above, below, none = a > 0, a < 0, a == 0
    a_1, b_1, c_1 = (part[above][:, None] for part in (a, b, c))
    a_2, b_2, c_2 = (part[below] for part in (a, b, c))
    slopes = a_1 * b_2 - a_2 * b_1
    bounds = a_1 * c_2 - a_2 * c_1
    return interval(
        np.concatenate([b[none], slopes.ravel()]), np.concatenate([c[none], bounds.ravel()]), point
    )


def interval(slopes: np.ndarray, bounds: np.ndarray, point: int) -> tuple[float, float]:
    """Return the least and the largest x >= 0 with slopes x <= bounds."""
    rising, falling, level = slopes > 0, slopes < 0, slopes == 0
    high = (bounds[rising] / slopes[rising]).min(initial=np.inf)
    low = (bounds[falling] / slopes[falling]).max(initial=0.0)
    if np.isinf(high):
        raise NoLawError(point, unbounded=True)
    if low > high + ROUNDING * abs(high) or (bounds[level] < 0).any() or high < 0:
        raise NoLawError(point)
    return min(low, high), high


def law_of_squares(s: np.ndarray, x: np.ndarray) -> Profile:
    """Return s(t) whose s'^2 is x (points,) at s, and linear in s between."""
    rate = np.sqrt(x)
    times = 2 * np.diff(s) / (rate[1:] + rate[:-1])
    rows = np.stack([s[:-1], rate[:-1], np.diff(x) / np.diff(s) / 4], axis=1)
    return Profile(np.concatenate([[0.0], np.cumsum(times)]), rows[:, :, None])
