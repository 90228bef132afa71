"""Profiles: coordinates over time as polynomials, piece by piece, with all their derivatives and
the exact extremes of these.

    x(t) = sum_k c_k s^k,    s = t - knot_i,    knot_i <= t <= knot_(i+1)

Before and after a profile its coordinates rest where they are at its ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.paths import Law, Triple


@dataclass(frozen=True, eq=False)
class Profile:
    """Hold d coordinates over time.

    knots: (pieces + 1,) [s], the first is 0; coefficients: (pieces, powers, d), ascending powers of
        the time since the piece's knot
    """

    knots: np.ndarray
    coefficients: np.ndarray

    @property
    def duration(self) -> float:
        """Return T [s]."""
        return float(self.knots[-1])

    @property
    def degree(self) -> int:
        """Return the largest power of the time."""
        return self.coefficients.shape[1] - 1

    def __call__(self, t: ArrayLike, order: int = 0) -> np.ndarray:
        """Return the derivative of an order, 0 of the coordinates themselves, at times t (K,) [s]:
        (K, d).

        At an inner knot it is that from the right, at the end that from the left.

        Raises:
            LinkworkError: times that are no numbers; an order that is no whole number from 0 on.
        """
        times, taken = checks.reals(t), self._derivative(order)
        if times is None:
            raise LinkworkError(f"the times are {checks.shown(t)}; give numbers [s]")
        within = np.clip(times, 0.0, self.duration)
        piece = np.clip(np.searchsorted(self.knots, within, side="right") - 1, 0, len(taken) - 1)
        s, rows = (within - self.knots[piece])[..., None], taken[piece]
        values = np.zeros((*times.shape, taken.shape[2]))
        for power in reversed(range(rows.shape[-2])):
            values = values * s + rows[..., power, :]
        return np.where((order > 0) & (times != within)[..., None], 0.0, values)

    @cached_property
    def derivatives(self) -> list[np.ndarray]:
        """Coefficients (pieces, powers, d) of the derivatives from order 0 on."""
        found = [self.coefficients]
        for _ in range(self.degree + 1):
            powers = np.arange(1, max(found[-1].shape[1], 2))[:, None]
            slopes = found[-1][:, 1:] if found[-1].shape[1] > 1 else 0 * found[-1]
            found.append(slopes * powers)
        return found

    def extremes(self, order: int) -> np.ndarray:
        """Return the largest absolute values (d,) of a derivative, 0 of the coordinates themselves.

        They are at the ends of a piece or where the next derivative vanishes inside it.

        order: of the derivative by time, a whole number from 0 on.
        """
        pieces = self._derivative(order)
        lengths = np.diff(self.knots)
        scaled = pieces * lengths[:, None, None] ** np.arange(pieces.shape[1])[:, None]
        largest = np.abs(scaled[:, 0]).max(axis=0)
        for piece in scaled:
            for axis, polynomial in enumerate(piece.T):
                values = np.polynomial.polynomial.polyval(turning(polynomial), polynomial)
                largest[axis] = max(largest[axis], np.abs(values).max())
        return largest

    def _derivative(self, order: int) -> np.ndarray:
        """Return the coefficients (pieces, powers, d) of the derivative of an order; zeros beyond
        the degree."""
        if not checks.whole(order):
            raise LinkworkError(
                f"the order is {checks.shown(order)}; give a whole number, 0 of the coordinates "
                "themselves, 1 of their rates"
            )
        return self.derivatives[order] if order <= self.degree else 0 * self.coefficients[:, :1]

    def slowed(self, factor: float) -> Profile:
        """Return the same motion in a duration larger by a factor."""
        factor = checks.positive(factor, "the factor")
        powers = factor ** np.arange(self.degree + 1.0)
        return Profile(self.knots * factor, self.coefficients / powers[:, None])

    def along(self, start: np.ndarray, change: np.ndarray) -> Profile:
        """Return d coordinates start + change x(t) of one, (d,) each.

        Raises:
            LinkworkError: what is not d finite numbers; a profile of several coordinates.
        """
        start, change = checks.finite(start, "start"), checks.finite(change, "change")
        if start.ndim != 1 or start.shape != change.shape:
            raise LinkworkError(
                f"start and change have the shapes {start.shape} and {change.shape}; give as many "
                "numbers of one as of the other"
            )
        if self.coefficients.shape[2] not in (1, start.size):
            raise LinkworkError(
                f"the profile is of {self.coefficients.shape[2]} coordinates; lead "
                f"{checks.amount(start.size, 'coordinate')} along a profile of one, or of as many"
            )
        coefficients = self.coefficients * change
        coefficients[:, 0] += start
        return Profile(self.knots, coefficients)

    @property
    def law(self) -> Law:
        """The motion law of the first coordinate, to give to a path: tau = t / T -> s, s', s'' with
        s from 0 to 1."""
        return self._law

    def _law(self, tau: np.ndarray) -> Triple:
        first, last = self(np.array([0.0, self.duration]))[:, 0]
        s, ds, dds = (value[..., 0] / (last - first) for value in self.curve(tau))
        return s - first / (last - first), ds, dds

    def curve(self, s: np.ndarray) -> Triple:
        """Return the coordinates and their first two derivatives by s = t / T."""
        t, T = np.asarray(s, float) * self.duration, self.duration
        return self(t), T * self(t, 1), T**2 * self(t, 2)


def turning(polynomial: np.ndarray) -> np.ndarray:
    """Return where a polynomial of s from 0 to 1 may have its extremes: the ends, and where its
    derivative vanishes."""
    slope = polynomial[1:] * np.arange(1, len(polynomial))
    roots = np.polynomial.polynomial.polyroots(np.trim_zeros(slope, "b")) if slope.any() else []
    inside = [root.real for root in np.atleast_1d(roots) if 0 < root.real < 1]
    return np.array([0.0, 1.0, *inside])


def pieces(
    durations: Sequence[float], added: Sequence[Sequence[float]], smooth: int = 1
) -> Profile:
    """Return one coordinate from rest at 0 in pieces that join on; those too short for their knots
    to differ are left out, but for what they lead to.

    Args:
        durations: of the pieces [s].
        added: coefficients of each piece beside what it joins on to.
        smooth: order of the last derivative that goes on from piece to piece.
    """
    knots, rows, total = [0.0], [], sum(durations)
    begun = np.zeros(smooth + 1)
    for h, own in zip(durations, added, strict=True):
        row = np.zeros(max(map(len, added)))
        row[: smooth + 1] = begun
        row[: len(own)] += own
        begun = taylor(row[None, :, None], np.array([h]))[0, : smooth + 1, 0]
        if h > 1e-15 * total:
            rows.append(row)
            knots.append(knots[-1] + h)
    return Profile(np.array(knots), np.array(rows)[:, :, None])


def side_by_side(profiles: Sequence[Profile]) -> Profile:
    """Return the coordinates of several profiles as those of one, until the last has ended."""
    shown = [np.eye(len(profiles))[k] for k in range(len(profiles))]
    return superposed(
        [
            profile.along(np.zeros(len(row)), row)
            for profile, row in zip(profiles, shown, strict=True)
        ],
        [0.0] * len(profiles),
    )


def superposed(profiles: Sequence[Profile], starts: Sequence[float]) -> Profile:
    """Return the sum of profiles of the same coordinates that start at times [s]; the first starts
    at 0, and each rests before and after.

    Each piece is moved to the common knots by Taylor's shift, c_j' = sum_i binomial(i, j) d^(i-j)
    c_i.
    """
    edges = np.concatenate(
        [profile.knots + start for profile, start in zip(profiles, starts, strict=True)]
    )
    knots = apart(np.unique(edges))
    middles, powers = (knots[1:] + knots[:-1]) / 2, max(p.degree for p in profiles) + 1
    total = np.zeros((len(middles), powers, profiles[0].coefficients.shape[2]))
    for profile, start in zip(profiles, starts, strict=True):
        resting = (middles < start) | (middles > start + profile.duration)
        piece = np.searchsorted(profile.knots, middles - start, side="right") - 1
        piece = np.clip(piece, 0, len(profile.coefficients) - 1)
        d = knots[:-1] - start - profile.knots[piece]
        shifted = taylor(profile.coefficients[piece], d)
        ends = profile(np.clip(middles - start, 0.0, profile.duration))
        shifted[resting] = 0
        shifted[resting, 0] = ends[resting]
        total[:, : shifted.shape[1]] += shifted
    return Profile(knots, total)


def taylor(coefficients: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return polynomials (pieces, powers, axes) told from points d (pieces,) further on."""
    shifted = np.zeros_like(coefficients)
    for i in range(coefficients.shape[1]):
        for j in range(i + 1):
            shifted[:, j] += comb(i, j) * (d ** (i - j))[:, None] * coefficients[:, i]
    return shifted


def apart(knots: np.ndarray) -> np.ndarray:
    """Return rising knots without those that rounding tells from the one before."""
    kept = np.diff(knots, prepend=-np.inf) > 1e-14 * knots[-1]
    return np.append(knots[kept][:-1], knots[-1]) if not kept[-1] else knots[kept]
