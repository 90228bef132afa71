"""A tool led along sampled poses: configurations, rates and accelerations, many samples at a time.

From a sample that is known, the next ones are guessed by its rates and accelerations,

    q(t + h) = q + N (w h + w' h^2 / 2)

and Newton's method leads all of them at once (`leading`); as many as it leads near their guess are
kept, then more or fewer are tried. Rates follow from the rows [Phi; J] of all that are kept. Where
no guess leads on, or rows do not determine the rates, the next sample is led alone.

Samples lie on one arc where the polynomials of their rates and accelerations lead from each to the
next one,

    q_2 - q_1 = h (w_1 + w_2) / 2 + h^2 (w'_1 - w'_2) / 12

but for a small part; elsewhere the path between them is gone along in smaller steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkwork.checks import at
from linkwork.equations.algebra import wrapped
from linkwork.equations.reference import unit
from linkwork.equations.tree import Tree
from linkwork.errors import LinkworkError
from linkwork.model.asked import ToolAsked
from linkwork.model.assembly import EPS, LEG_SINGULAR, Assembler, turning
from linkwork.model.closing import Least
from linkwork.model.leading import Leader

MOST = 64  # samples that are tried at a time
NEAR = 0.1  # how far from their guess they may come to, in own units
ROUGH, FLOOR = 0.1, 1e-7  # part of the way between two samples, and own units, by which they differ
PARTS, DEPTH = 16, 2  # smaller steps between two samples, and how often these are parted themselves
ANOTHER = (
    "the joints are on another branch than at the start, for the path passes a stretched or folded "
    "pose, or its samples are too far apart; take more samples, or lead the path around"
)
SAME = 1e-6  # distance of configurations that are one, in own units


@dataclass(frozen=True, eq=False)
class Prescribed:
    """Hold what is held of the tool's pose, and its first two derivatives, (samples, k) each, at
    equally spaced times (samples) [s]."""

    asked: ToolAsked
    time: np.ndarray
    y: np.ndarray
    dy: np.ndarray
    ddy: np.ndarray

    def part(self, some: slice) -> Prescribed:
        """Return some samples."""
        return Prescribed(self.asked, *(each[some] for each in (self.time, *self.values)))

    @property
    def values(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return y, y', y''."""
        return self.y, self.dy, self.ddy


Sampled = Callable[[np.ndarray], Prescribed]
"""What is held at equally spaced times of a path."""
Led = tuple[np.ndarray, np.ndarray, np.ndarray]
"""q (samples, nq), and the tree's rates w and w' (samples, nv)."""


def led_along(leader: Leader, assembler: Assembler, start: np.ndarray, way: Prescribed) -> Led:
    """Return the motion of a tool along samples, the first one reached from a start (nq) as any
    other pose.

    Raises:
        LinkworkError: what is out of reach or leg-singular, by its time.
    """
    count, step = len(way.time), way.time[1] - way.time[0]
    with at(f"at t = {way.time[0]:.6g} s: "):
        q, w = leader.lead(start, way.y[:1]), np.zeros(len(assembler.tree.rates))
    parts, k, portion = list[Led](), 0, 1
    while k < count:
        # Some samples at once, as far as they are led; at most twice as many the next time.
        if portion > 1:
            found = led_ahead(leader, assembler, parts[-1], step, way.part(slice(k, k + portion)))
            done = len(found[0])
            portion = min(2 * portion, MOST) if done == portion else max(done, 1)
            if done:
                parts, k = [*parts, found], k + done
                continue
        # One alone, from the one before as its rates lead.
        with at(f"at t = {way.time[k]:.6g} s: "):
            near = assembler.moved(parts[-1][0][-1], parts[-1][1][-1] * step) if parts else q[0]
            q, there = leader.approached(near[None], way.y[k : k + 1])
            if not there[0]:
                q = assembler.at(leader.least, way.y[k], near)[None]
            w, dw = assembler.rates(q[0], way.asked, *(each[k] for each in way.values))
        parts, k, portion = [*parts, (q, w[None], dw[None])], k + 1, 2
    q, w, dw = (np.concatenate(each) for each in zip(*parts, strict=True))
    return q, w, dw


def led_ahead(leader: Leader, assembler: Assembler, last: Led, step: float, way: Prescribed) -> Led:
    """Return the motion along samples as far as it is led at once from the last one before them."""
    q, w, dw = (each[-1] for each in last)
    h = step * np.arange(1, len(way.time) + 1)[:, None]
    ahead = assembler.still(q)["derivatives"] @ (w * h + dw * h**2 / 2).T
    guess = unit(assembler.tree, q + ahead.T)
    found, good = leader.approached(guess, way.y)
    good &= np.abs((found - guess) / assembler.tree.units).max(axis=1, initial=0.0) <= NEAR
    if not (count := first_not(good)):
        return found[:0], last[1][:0], last[2][:0]
    rates, accelerations, good = rates_along(leader.least, found[:count], way.part(slice(count)))
    count = first_not(good)
    return found[:count], rates[:count], accelerations[:count]


def first_not(good: np.ndarray) -> int:
    """Return the number of the first that is not good, of all where each is."""
    return good.size if good.all() else int(np.argmin(good))


def rates_along(
    least: Least, q: np.ndarray, way: Prescribed
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return w, w' (K, nv) at configurations (K, nq), as `Assembler.rates`, and where the rows
    determine them (K)."""
    y, dy, ddy = (np.array(each) for each in way.values)
    if way.asked.rotation:
        turn = way.asked.rotation
        dy[:, turn], ddy[:, turn] = turning(y[:, turn], dy[:, turn], ddy[:, turn])
    out = least.outputs(q)
    A = least.matrix(out) * least.factors
    sure = np.asarray(np.isfinite(A).all(axis=(1, 2)))
    U, values, V = np.linalg.svd(np.where(sure[:, None, None], A, 0.0), full_matrices=False)
    if (width := A.shape[2]) <= A.shape[1]:
        sure &= values[:, width - 1] >= LEG_SINGULAR * values[:, 0]
    kept = values > max(A.shape[1:]) * EPS * values[:, :1]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=kept)

    def solved(right: np.ndarray) -> np.ndarray:
        along = inverse * np.einsum("kri,kr->ki", U, right / least.heights)
        return least.tree.rate_units * np.einsum("kin,ki->kn", V, along)

    w = solved(np.concatenate([0 * out["phi"], dy], axis=1))
    out = least.moving(q, w)
    bias = way.asked.bias(out, w)
    return w, solved(np.concatenate([-out["gamma"], ddy - bias], axis=1)), sure


def require_one_arc(
    leader: Leader,
    assembler: Assembler,
    motion: Led,
    way: Prescribed,
    sampled: Sampled,
    depth: int = DEPTH,
) -> np.ndarray:
    """Return q (samples, nq) with the whole turns that the path between samples takes; refuse a
    motion whose samples it does not join."""
    q, (places, rates) = motion[0].copy(), own_rates(assembler.tree)
    for k in rough(assembler.tree, motion, way.time[1] - way.time[0]):
        finer = sampled(np.linspace(way.time[k], way.time[k + 1], PARTS + 1))
        inner = led_along(leader, assembler, motion[0][k], finer)
        along = (leader, assembler, inner, finer, sampled, depth - 1)
        ahead = (require_one_arc(*along) if depth else inner[0])[-1] - motion[0][k + 1]
        if apart(assembler.tree, ahead).max(initial=0.0) > SAME:
            raise LinkworkError(f"at t = {way.time[k + 1]:.6g} s: {ANOTHER}")
        turns = np.where(assembler.tree.slides[rates], 0, np.round(ahead[places] / (2 * np.pi)))
        q[k + 1 :, places] += 2 * np.pi * turns
    return q


def rough(tree: Tree, motion: Led, step: float) -> list[int]:
    """Return the intervals between samples over which rates and accelerations do not tell the way
    of the coordinates that have a rate of their own."""
    places, rates = own_rates(tree)
    units = tree.rate_units[rates]
    q, w, dw = motion[0][:, places], motion[1][:, rates], motion[2][:, rates]
    told = ways_told(step, w, dw)
    return untold((np.diff(q, axis=0) - told) / units, told / units)


def ways_told(h: float | np.ndarray, w: np.ndarray, dw: np.ndarray) -> np.ndarray:
    """Return the ways between samples that rates and accelerations (K, k) tell (K - 1, k); h: times
    between these."""
    return h / 2 * (w[1:] + w[:-1]) - h**2 / 12 * np.diff(dw, axis=0)


def untold(off: np.ndarray, told: np.ndarray) -> list[int]:
    """Return the intervals whose ways are off by more than a small part of what is told of them
    (K - 1, k each), in own units."""
    most, whole = (np.abs(part).max(axis=1, initial=0.0) for part in (off, told))
    return np.flatnonzero(most > ROUGH * whole + FLOOR).tolist()


def apart(tree: Tree, difference: np.ndarray) -> np.ndarray:
    """Return sizes of differences of the coordinates that have a rate of their own, in own units,
    angles the short way round."""
    places, rates = own_rates(tree)
    own = difference[places]
    return np.abs(np.where(tree.slides[rates], own, wrapped(own)) / tree.rate_units[rates])


def own_rates(tree: Tree) -> tuple[list[int], list[int]]:
    """Return the places in q and in w of the coordinates that have a rate of their own."""
    return [place for place, _ in tree.single], [rate for _, rate in tree.single]
