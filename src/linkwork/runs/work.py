"""Work: what has gone into a run since its start, and what its own steps and projections gained.

    balance(t) = E(t) - E(0) - W(t),    W' = power of actuators, friction, dampers and wrenches

vanishes for the exact motion. The run is gone through once more in its own steps, by the loop that
made it, and the power is integrated along their dense output: in each step from t to t + h it is
the polynomial through its values P_i at Gauss's nodes x_i, with weights w_i,

    W(t + (1 + x) h / 2) = W(t) + h/4 sum_l c_l (L_(l+1) - L_(l-1))(x)
    c_l = sum_i w_i L_l(x_i) P_i

with Legendre's polynomials L_l, and L_(-1) = -1. A sampled controller is not called again: from
each of its calls to the next the motion is integrated under the inputs that it held.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from linkwork.runs.passage import Segment
from linkwork.runs.saved_states import SavedStates

NODES = 8  # in a step
NARROW = 1e-13  # steps, relative to the time, in which no work is counted
BLOCK = 20_000  # steps that are looked at together
Kept = Sequence[tuple[Segment, np.ndarray]]
At = Callable[[np.ndarray, np.ndarray], SavedStates]  # states y under inputs u


class Work(NamedTuple):
    """Hold the work W (K,) [J] done up to the saved times, and the energy at the start [J]."""

    done: np.ndarray
    begun: float


class SegmentEnd(NamedTuple):
    """Hold when a segment ended [s], and the energy there [J]."""

    time: float
    energy: float


def work(kept: Kept, saved: Sequence[SavedStates], every: bool) -> Work:
    """Return the work of a run; over a singular pose that was stepped over its balance is taken to
    be kept.

    kept: segments, and their rows that are kept; saved: the states in these; every: whether all
    steps were saved
    """
    total, columns, begun, end = 0.0, [np.zeros(0)], 0.0, None
    for (segment, rows), states in zip(kept, saved, strict=True):
        if states.over is not None and end is not None:
            columns.append(total + states.over.through(states.over.nodes.energy) - end.energy)
            continue
        part, (start, q, v) = segment.trajectory, segment.start
        at = partial(SavedStates.of_run, states.robot, states.system, states.chart)
        y = np.block([[q, v], [part.q_end, part.v_end]])
        energy = at(y, part.u[:0]).energy.tolist()
        if end is None:
            begun = energy[0]
        elif start > end.time:
            total += energy[0] - end.energy
        t = np.concatenate([[start], part.t, [part.end_time]])
        W = total + gained(at, segment, t, every)
        columns.append(W[1:-1][rows])
        total, end = W[-1], SegmentEnd(part.end_time, energy[1])
    found = np.concatenate(columns)
    lost = np.flatnonzero(~np.isfinite(found))
    if lost.size:
        t = np.concatenate([segment.trajectory.t[rows] for segment, rows in kept])[lost[0]]
        warnings.warn(
            f"the work, and with it the energy balance, is not known (nan) from t = {t:.9g} s "
            "on: the powers are not finite there, or the run could not be gone through again",
            stacklevel=2,
        )
    return Work(found, begun)


def gained(at: At, segment: Segment, t: np.ndarray, every: bool) -> np.ndarray:
    """Return the work (K,) done in a segment from its start to each of the times up to its end."""
    part = segment.trajectory
    if part.control is None:
        return along(at, segment, t, -1, part.t if every else None)
    done = np.zeros(len(t))
    for i in np.flatnonzero(np.diff(t) > 0).tolist():
        done[i + 1] = along(at, segment, t[i : i + 2], i - 1, None)[-1]
    return np.cumsum(done)


def along(
    at: At, segment: Segment, t: np.ndarray, row: int, steps: np.ndarray | None
) -> np.ndarray:
    """Return the work (K,) done from the first of some times on to each of them.

    row: of the segment, at the first time; steps: their ends, found out if left out
    """
    assert segment.again is not None
    steps = segment.again(None, row).t if steps is None else steps
    edges = np.unique(np.concatenate([t[:1], steps[(steps > t[0]) & (steps < t[-1])], t[-1:]]))
    h, (x, parts) = np.diff(edges), nodes()
    power = np.zeros((len(h), NODES))
    wide = np.flatnonzero(h > NARROW * edges[-1])
    for block in np.array_split(wide, -(-wide.size // BLOCK) or 1):
        times = edges[block, None] + h[block, None] * x
        done = segment.again(times.ravel(), row)
        found = np.full(times.size, np.nan)
        found[: len(done.t)] = at(done.rows[:, 1 : 1 + done.y_end.size], done.u).power
        power[block] = found.reshape(times.shape)
    c = power @ parts
    ends = np.concatenate([[0.0], np.cumsum(h / 2 * c[:, 0])])
    if not h.size:
        return np.zeros(len(t))
    k = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, h.size - 1)
    return ends[k] + h[k] / 4 * np.einsum("kl,kl->k", c[k], integrals((t - edges[k]) / h[k]))


@cache
def nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss's nodes in a step from 0 to 1, and what makes c of values there."""
    x, weights = legendre.leggauss(NODES)
    return (1 + x) / 2, weights[:, None] * legendre.legvander(x, NODES - 1)


def integrals(theta: np.ndarray) -> np.ndarray:
    """Return (L_(l+1) - L_(l-1))(2 theta - 1) for all l (K, NODES)."""
    L = legendre.legvander(2 * theta - 1, NODES)
    return L[:, 1:] - np.column_stack([-L[:, 0], L[:, :-2]])
