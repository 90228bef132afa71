"""Paths that begin or end without rate and acceleration by their own parameter, told anew by the
way along them.

A motion law that is run through leaves a path x(s) whose first two derivatives vanish at its ends:
there its parameter tells neither direction nor curvature, and no limit bounds s'. By the way

    sigma(s) = int g ds / l,   g = |W x_s|,   l = int_0^1 g ds,   W: one over the range of each x

it has the same places at one rate:

    x_sigma = l x_s / g,   x_sigma sigma = l^2 (x_ss / g^2 - x_s g_s / g^3)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.motions.timed_paths import TimedPath
from linkwork.paths import Curve, Path, Triple

STILL = 1e-9  # rate, and acceleration, over their largest on the path, that count as none
CELLS, NODES = 2000, 6  # parts of the path, and nodes in each of them, by which ways are summed
ROUNDS = 40  # of Newton's method, or halving, for the place at a way
BESIDE = 1e-3  # of s: where direction and curvature at the ends are told


def evened(timed: TimedPath) -> TimedPath:
    """Return a timed path by the way along it, where it begins or ends without rate and
    acceleration; else as it is.

    Raises:
        LinkworkError: one that rests between its ends, where it may have a corner.
    """
    s = np.linspace(0, 1, CELLS + 1)
    _, x_s, x_ss = timed.path.curve(s)
    flat = [np.abs(part[[0, -1]]).max(axis=1) <= STILL * np.abs(part).max() for part in (x_s, x_ss)]
    if not (flat[0] & flat[1]).any():
        return timed
    way = way_along(timed.path.curve, timed.path.knots)
    curve = EvenCurve(timed.path.curve, way)
    knots = tuple(way.at(np.array(timed.path.knots)).tolist())
    return replace(timed, path=Path(curve, timed.path.law, knots), profile=None)


@dataclass(frozen=True, eq=False)
class WayAlong:
    """Hold the way along a curve: at edges (E,) of s, the ways (E,) until there, from 0 to l.

    scale: (d,) of coordinates
    """

    curve: Curve
    scale: np.ndarray
    edges: np.ndarray
    ways: np.ndarray

    def rate(self, s: np.ndarray) -> np.ndarray:
        """Return g at s of any shape."""
        _, x_s, _ = self.curve(s.ravel())
        return np.linalg.norm(x_s * self.scale, axis=1).reshape(s.shape)

    def between(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Return the ways from some s to others (K,), within an edge each (Gauss)."""
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = (last - first) / 2
        at = first[:, None] + half[:, None] * (1 + nodes)
        return half * (self.rate(np.clip(at, 0.0, 1.0)) @ weights)

    def at(self, s: np.ndarray) -> np.ndarray:
        """Return the ways until s (K,), over the whole one."""
        k = np.clip(np.searchsorted(self.edges, s, side="right") - 1, 0, len(self.edges) - 2)
        return (self.ways[k] + self.between(self.edges[k], s)) / self.ways[-1]

    def place(self, sigma: np.ndarray) -> np.ndarray:
        """Return s (K,) at ways over the whole one, by Newton's method, and halves where it leads
        out."""
        wanted = np.clip(sigma, 0.0, 1.0) * self.ways[-1]
        k = np.clip(np.searchsorted(self.ways, wanted, side="right") - 1, 0, len(self.ways) - 2)
        first, low, high = self.edges[k], self.edges[k].copy(), self.edges[k + 1].copy()
        s = (low + high) / 2
        for _ in range(ROUNDS):
            over = self.ways[k] + self.between(first, s) - wanted
            low, high = np.where(over < 0, s, low), np.where(over < 0, high, s)
            rate = self.rate(s)
            step = np.divide(over, rate, out=np.full_like(s, np.inf), where=rate > 0)
            near = (s - step > low) & (s - step < high)
            moved = np.where(near, s - np.where(near, step, 0.0), (low + high) / 2)
            if np.array_equal(moved, s):
                break
            s = moved
        return s


@dataclass(frozen=True, eq=False)
class EvenCurve:
    """Tell a curve by the way along it."""

    curve: Curve
    way: WayAlong

    def __call__(self, sigma: np.ndarray) -> Triple:
        """Return the coordinates and their first two derivatives (K, d) at ways (K,), over the
        whole one."""
        sigma = np.asarray(sigma, float)
        s = self.way.place(sigma)
        s = np.where(sigma <= 0, 0.0, np.where(sigma >= 1, 1.0, s))
        x, _, _ = self.curve(s)
        _, x_s, x_ss = self.curve(np.clip(s, BESIDE, 1 - BESIDE))
        v, a = x_s * self.way.scale, x_ss * self.way.scale
        g = np.linalg.norm(v, axis=1)[:, None]
        g_s = (v * a).sum(axis=1, keepdims=True) / g
        whole = self.way.ways[-1]
        return x, whole * x_s / g, whole**2 * (x_ss - x_s * g_s / g) / g**2


def way_along(curve: Curve, knots: tuple[float, ...]) -> WayAlong:
    """Return the way along a curve with knots; refuse one that rests between its ends."""
    edges = np.unique(np.concatenate([np.linspace(0, 1, CELLS + 1), knots]))
    x, x_s, _ = curve(edges)
    range_of = np.ptp(x, axis=0)
    scale = np.divide(1.0, range_of, out=np.zeros_like(range_of), where=range_of > 0)
    rates = np.linalg.norm(x_s * scale, axis=1)
    resting = rates[1:-1] <= STILL * rates.max()
    if resting.any():
        raise LinkworkError(
            f"the path rests at s = {edges[1:-1][np.argmax(resting)]:.4g}; give its parts one by "
            "one, or blend its corners"
        )
    made = WayAlong(curve, scale, edges, np.zeros_like(edges))
    parts = made.between(edges[:-1], edges[1:])
    return replace(made, ways=np.concatenate([[0.0], np.cumsum(parts)]))
