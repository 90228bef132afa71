"""Links: the parts of a run that are differentiated one after the other, from its first state on.

    start -> steps -> call of a sampled controller -> steps -> change of chart -> ... -> end

The steps are those that the run took, their sizes held. Between them a change is (dy, dheld): of
q, v, z in the chart at hand, and of what a sampled controller holds. Where an event ends the run,
or a step, at a time t_e that depends on the state,

    dt_e = -(g_y dy + g_r dr + g_p dp) / (g_y y' + g_r r'),    dy+ = dy + (y'- - y'+) dt_e

with y'+ = 0 at the end. Source: Aizerman & Gantmacher 1958 (saltation).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from linkwork.gradients import native_sweeps
from linkwork.gradients.native_steps import (
    DerivativeKernels,
    StateSizes,
    StepsTaken,
    StiffKernels,
)


@dataclass(eq=False)
class HandedOn:
    """Hold what links hand on: of the state and the held inputs at hand, of what acts all along,
    and of the samples.

    y (..., n); held (..., nh); p (..., np) and signal (..., 4 pieces, columns): parameters, and
    coefficients of the inputs over time
    sample_y (S, ..., n), sample_held (S, ..., nh), sample_t (S, ...)
    """

    y: np.ndarray
    held: np.ndarray
    p: np.ndarray
    signal: np.ndarray
    sample_y: np.ndarray
    sample_held: np.ndarray
    sample_t: np.ndarray


class Changes(HandedOn):
    """Hold D changes (D, ...) on their way along a run; those of the samples are left by the
    links."""

    def read(self, numbers: np.ndarray) -> None:
        """Take samples of the present state."""
        self.sample_y[numbers], self.sample_held[numbers] = self.y, self.held


@dataclass(eq=False)
class LossSlopes(HandedOn):
    """Hold the derivatives of a loss on their way back along a run: with respect to what acts all
    along, so far. integral: of the cost."""

    integral: float = 0.0

    @property
    def grown(self) -> float:
        """How many times larger those of the state at hand are than those of the samples."""
        return np.abs(self.y).max(initial=0.0) / (np.abs(self.sample_y).max(initial=0.0) or 1.0)

    def add(
        self, numbers: np.ndarray | slice, y: np.ndarray, held: np.ndarray, t: np.ndarray
    ) -> None:
        """Add derivatives with respect to samples."""
        self.sample_y[numbers] += y
        self.sample_held[numbers] += held
        self.sample_t[numbers] += t

    def read(self, numbers: np.ndarray) -> None:
        """Add what samples of the present state tell."""
        if numbers.size:
            self.y = self.y + self.sample_y[numbers].sum(axis=0)
        if numbers.size and self.held.size:
            self.held = self.held + self.sample_held[numbers].sum(axis=0)


@dataclass(frozen=True, eq=False)
class InputsAt:
    """Tell how inputs over time depend on their coefficients at instants (K): piece (K), powers
    (K, 4) of the time since its knot, and the inputs' rates (K, columns)."""

    piece: np.ndarray
    powers: np.ndarray
    rates: np.ndarray

    def along(self, changes: Changes) -> np.ndarray:
        """Return the changes of signals (K, D, columns)."""
        places = 4 * self.piece[:, None] + np.arange(4)
        return np.einsum("km,dkmc->kdc", self.powers, changes.signal[:, places])

    def against(self, slopes: LossSlopes, bars: np.ndarray) -> None:
        """Add what derivatives with respect to the signals (K, columns) tell of coefficients."""
        shares = self.powers[:, :, None] * bars[:, None, :]
        if len(slopes.signal) == 4:
            slopes.signal += shares.sum(axis=0)
            return
        pieces = slopes.signal.reshape(len(slopes.signal) // 4, 4, bars.shape[1])
        np.add.at(pieces, self.piece, shares)


@dataclass(frozen=True, eq=False)
class Partials:
    """Hold Jacobians of something (K, rows) at K instants, in y, in r (signals, held inputs) and in
    p."""

    y: np.ndarray
    r: np.ndarray
    p: np.ndarray
    inputs: InputsAt

    @property
    def columns(self) -> int:
        """How many signals there are."""
        return self.inputs.rates.shape[1]

    def along(self, changes: Changes, dy: Any, held: Any, dt: Any = None) -> np.ndarray:
        """Return the changes (K, D, rows), for those of y (K, D, n), held inputs and times
        (K, D)."""
        r, held_r = self.r[:, :, : self.columns], self.r[:, :, self.columns :]
        signals = self.inputs.along(changes)
        if dt is not None:
            signals += dt[:, :, None] * self.inputs.rates[:, None]
        found = np.einsum("kri,kdi->kdr", self.y, dy) + np.einsum("kri,kdi->kdr", r, signals)
        found += np.einsum("kri,kdi->kdr", held_r, held)
        return found + np.einsum("kri,di->kdr", self.p, changes.p)

    def against(self, slopes: LossSlopes, bars: np.ndarray) -> tuple[np.ndarray, ...]:
        """Add what derivatives with respect to the rows (K, rows) tell of signals and p; return
        what they tell of y (K, n), held inputs (K, nh), and times (K)."""
        y, r, p = (np.einsum("kr,kri->ki", bars, part) for part in (self.y, self.r, self.p))
        return PulledBack(y, r, p.sum(axis=0), self.inputs).against(slopes)


class PulledBack(NamedTuple):
    """Hold derivatives of one number by y (K, n) and r (K, nr) at K instants, and by p (np);
    inputs: None where all by r are zero."""

    y: np.ndarray
    r: np.ndarray
    p: np.ndarray
    inputs: InputsAt | None

    def against(self, slopes: LossSlopes) -> tuple[np.ndarray, ...]:
        """Add what they tell of signals and p; return what they tell of y (K, n), held inputs
        (K, nh), and times (K)."""
        columns = slopes.signal.shape[1]
        signals, held = self.r[:, :columns], self.r[:, columns:]
        slopes.p += self.p
        if self.inputs is None:
            return self.y, held, np.zeros(len(self.y))
        self.inputs.against(slopes, signals)
        return self.y, held, (signals * self.inputs.rates).sum(axis=1)


class RunLink:
    """A part of a run: it leads changes along, and derivatives of a loss back."""

    def along(self, changes: Changes) -> None:
        """Lead changes through it."""
        raise NotImplementedError

    def against(self, slopes: LossSlopes) -> None:
        """Lead derivatives of a loss back through it."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Steps(RunLink):
    """Steps under the same held inputs.

    kernels, sizes, taken: as the sweeps take them
    rows, at_rows: of samples at ends of steps, with their numbers; numbers: of the samples within
        steps
    """

    kernels: DerivativeKernels
    stiff: StiffKernels | None
    sizes: StateSizes
    taken: StepsTaken
    rows: np.ndarray
    at_rows: np.ndarray
    numbers: np.ndarray

    @property
    def _sweeps(self) -> tuple[Callable[..., None], Callable[..., float]]:
        """What leads tangents along, and adjoints back; that of stiff steps is compiled when it is
        first asked for."""
        if self.stiff is None:
            return native_sweeps.tangent, native_sweeps.adjoint
        from linkwork.gradients import native_stiff_sweeps as stiff

        own = tuple(self.stiff)
        return partial(stiff.tangent, own), partial(stiff.adjoint, own)

    @property
    def _given(self) -> tuple[Any, ...]:
        return tuple(self.kernels), tuple(self.sizes), tuple(self.taken)

    def along(self, changes: Changes) -> None:
        count, n = changes.y.shape
        dy, held = np.array(changes.y, order="C"), np.ascontiguousarray(changes.held)
        ends = np.empty((len(self.taken.t), count, n))
        inner = np.empty((len(self.numbers), count, n))
        tangent, _ = self._sweeps
        tangent(*self._given, changes.p, changes.signal, held, dy, ends, inner)
        changes.y = dy
        changes.sample_y[self.at_rows], changes.sample_y[self.numbers] = ends[self.rows], inner
        changes.sample_held[self.at_rows] = changes.sample_held[self.numbers] = held

    def against(self, slopes: LossSlopes) -> None:
        ends, inner = np.zeros(self.taken.y.shape), slopes.sample_y[self.numbers]
        np.add.at(ends, self.rows, slopes.sample_y[self.at_rows])  # events are samples, too
        bar, held = slopes.y.copy(), slopes.held.copy()
        for numbers in (self.at_rows, self.numbers) if held.size else ():
            held += slopes.sample_held[numbers].sum(axis=0)
        signal = slopes.signal.reshape(-1)
        _, adjoint = self._sweeps
        slopes.integral += adjoint(*self._given, ends, inner, 1.0, bar, slopes.p, signal, held)
        slopes.y, slopes.held = bar, held


@dataclass(frozen=True, eq=False)
class ControllerCall(RunLink):
    """A call of a sampled controller; partials: of what is held then."""

    partials: Partials

    def along(self, changes: Changes) -> None:
        changes.held = self.partials.along(changes, changes.y[None], changes.held[None])[0]

    def against(self, slopes: LossSlopes) -> None:
        y, held, _ = self.partials.against(slopes, slopes.held[None])
        slopes.y, slopes.held = slopes.y + y[0], held[0]


@dataclass(frozen=True, eq=False)
class ChartChange(RunLink):
    """A change of chart: rates are told in others. Jacobian of the new ones (n) in q (n, nq), in
    the former ones (n, n) and in the mechanism's parameters (n, own)."""

    q: np.ndarray
    v: np.ndarray
    p: np.ndarray

    def along(self, changes: Changes) -> None:
        q, v, z = self._split(changes.y)
        v = q @ self.q.T + v @ self.v.T + changes.p[:, : self.p.shape[1]] @ self.p.T
        changes.y = np.concatenate([q, v, z], axis=1)

    def against(self, slopes: LossSlopes) -> None:
        q, v, z = self._split(slopes.y)
        slopes.p[: self.p.shape[1]] += v @ self.p
        slopes.y = np.concatenate([q + v @ self.q, v @ self.v, z])

    def _split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nq, end = self.q.shape[1], sum(self.q.shape)
        return y[..., :nq], y[..., nq:end], y[..., end:]


@dataclass(frozen=True, eq=False)
class Passing(RunLink):
    """An event that is passed, or that ends the run.

    moment: the Jacobian of its time t_e; jump (n), cost: y' and the cost before it less those
        behind it
    numbers: of samples of the end itself, which is at t_e
    """

    moment: Partials
    jump: np.ndarray
    cost: float
    numbers: np.ndarray

    def along(self, changes: Changes) -> None:
        dt = self.moment.along(changes, changes.y[None], changes.held[None])[0, :, 0]
        changes.y = changes.y + np.outer(dt, self.jump)
        changes.read(self.numbers)
        changes.sample_t[self.numbers] = dt

    def against(self, slopes: LossSlopes) -> None:
        slopes.read(self.numbers)
        bar = slopes.y @ self.jump + self.cost + slopes.sample_t[self.numbers].sum()
        y, held, _ = self.moment.against(slopes, np.array([[bar]]))
        slopes.y, slopes.held = slopes.y + y[0], slopes.held + held[0]


@dataclass(frozen=True, eq=False)
class ReadOff(RunLink):
    """Samples of the state between two other links; numbers: theirs."""

    numbers: np.ndarray

    def along(self, changes: Changes) -> None:
        changes.read(self.numbers)

    def against(self, slopes: LossSlopes) -> None:
        slopes.read(self.numbers)
