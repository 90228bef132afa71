"""Instants of a run that are looked at: states and inputs there, and how the inputs depend on their
coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from linkwork.gradients.links import InputsAt
from linkwork.kernels import Kernel
from linkwork.runs.system import System
from linkwork.simulation import Signal, Trajectory

POWERS = np.arange(4.0)


class Sampling(NamedTuple):
    """Instants of a run that are read (S): the numbers of their segments, times [s], states
    (S, n) and inputs (S, nr)."""

    segment: np.ndarray
    t: np.ndarray
    y: np.ndarray
    u: np.ndarray

    def of(self, numbers: slice) -> Sampling:
        """Return some of the instants."""
        return Sampling(*(part[numbers] for part in self))


def sampled(
    system: System, segment: int, of: Trajectory, rows: np.ndarray, from_left: bool = False
) -> Sampling:
    """Return the instants that rows of a trajectory hold."""
    n, held = of.y_end.size, system.acting.held if system.acting else 0
    t, y, u = rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n : -2]
    pieces, _, columns = system.inputs.coefficients.shape
    if pieces > 1 or u.shape[1] != columns + held:  # rows tell one side of breaks, or fewer inputs
        held_inputs = u[:, u.shape[1] - held :]
        u = np.concatenate([values(system.inputs, t, from_left), held_inputs], axis=1)
    return Sampling(np.full(len(rows), segment), t, y, u)


def at_instants(kernel: Kernel, x: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
    """Return what a kernel of (q, v, z, r, p) gives (..., m) at states and inputs (..., n + nr)."""
    ends = np.cumsum([size for _, size in kernel.inputs])[:-2]
    found = kernel(*np.split(x.reshape(-1, x.shape[-1]), ends, axis=1), p)
    return [part.reshape(*x.shape[:-1], -1) for part in found]


def inputs_at(signal: Signal, t: np.ndarray, from_left: bool) -> InputsAt:
    """Return how a signal depends on its coefficients at times (K)."""
    piece, s = pieces(signal, t, from_left)
    c, s = signal.coefficients[piece], s[:, None]
    rates = c[:, 1] + s * (2 * c[:, 2] + 3 * s * c[:, 3])
    return InputsAt(piece, s**POWERS, rates)


def pieces(signal: Signal, t: np.ndarray, from_left: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces of a signal that times (K) are in, and the times since their knots."""
    last = len(signal.coefficients) - 1
    if not last:
        return np.zeros(t.shape, int), t - signal.knots[0]
    piece = np.searchsorted(signal.knots, t, side="left" if from_left else "right") - 1
    piece = np.minimum(np.maximum(piece, 0), last)
    return piece, t - signal.knots[piece]


def values(signal: Signal, t: np.ndarray, from_left: bool) -> np.ndarray:
    """Return the values of a signal at times (K, columns)."""
    piece, s = pieces(signal, t, from_left)
    powers = s[:, None] ** POWERS
    if len(signal.coefficients) == 1:
        return powers @ signal.coefficients[0]
    return np.einsum("km,kmc->kc", powers, signal.coefficients[piece])
