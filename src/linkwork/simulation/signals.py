"""Forces over time in one representation that machine code evaluates: piecewise cubic polynomials.

    u(t) = c_0 + c_1 s + c_2 s^2 + c_3 s^3,     s = t - knot_i,     knot_i <= t < knot_(i+1).

Where a signal jumps or has a kink (`breaks`), the integrator ends a step exactly there: no step
ever straddles one, and the order of the method is kept.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import among, amount, labelled, reals
from linkwork.errors import LinkworkError
from linkwork.readonly import ReadOnlyArrays

Kind = Literal["spline", "linear", "hold"]
NO_BENDS = np.array([[np.inf, 0.0, np.inf]])
SMOOTH = 1e-9  # jump of a value or slope, relative to the largest one, that is rounding
FREE = 2  # bends of a signal (`bends`) that a step may pass without looking
ROUNDING = 1e-9
"""How far a time may lie beyond the end of a run, relative to the duration, and still count as the
end."""


@dataclass(frozen=True, eq=False)
class Sampled(ReadOnlyArrays):
    """Give a signal by its samples.

    `times` (N,) in s, strictly increasing, N >= 2; `values` (N, nu), or (N,) for a single input;
    `kind`: how to read between the samples: "spline" (the not-a-knot cubic, twice differentiable),
    "linear", or "hold" (each value acts from its own time to the next: a zero-order hold);
    `labels`: the names of the columns of a table, which are looked at where it is used.

    Raises `LinkworkError` for other shapes, times that do not increase, and values that are not
    finite.
    """

    times: np.ndarray
    values: np.ndarray
    kind: Kind = "spline"
    labels: tuple[str, ...] = field(default=(), init=False, repr=False)

    def __post_init__(self):
        object.__setattr__(self, "labels", labelled(self.values))
        times = _finite("sample times", self.times)
        values = _finite("sample values", self.values)
        if times.ndim != 1 or times.size < 2:
            raise LinkworkError(
                f"sample times have the shape {times.shape}: give a list of at least two times"
            )
        if values.ndim not in (1, 2) or len(values) != len(times):
            raise LinkworkError(
                f"sample values have the shape {values.shape}: give one row for each of the "
                f"{len(times)} sample times"
            )
        require_increasing("sample times", times)
        if not among(self.kind, get_args(Kind)):
            raise LinkworkError(
                f"the kind of sampled signal {self.kind!r} is none of {', '.join(get_args(Kind))}"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values.reshape(len(times), -1))
        super().__post_init__()

    def __repr__(self) -> str:
        count, width = self.values.shape
        span = f"{count:,} times from {self.times[0]:.6g} to {self.times[-1]:.6g} s"
        return f"Sampled({span}, {amount(width, 'value')} at each, kind={self.kind!r})"

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        """Return the samples (N, nu), so that NumPy's functions take the signal as they would its
        values."""
        return np.array(self.values, dtype=dtype, copy=True if copy is None else copy)

    @cached_property
    def signal(self) -> "Signal":
        """The signal as piecewise cubic polynomials."""
        return _INTERPOLANTS[self.kind](self)

    def __call__(self, t: Any) -> np.ndarray:
        """Evaluate as `Signal` does."""
        return self.signal(t)

    def derivative(self) -> "Signal":
        """Return the time derivative, as `Signal` does."""
        return self.signal.derivative()


@dataclass(frozen=True, eq=False)
class Signal(ReadOnlyArrays):
    """Hold nu inputs as piecewise cubic polynomials of time.

    `knots` (pieces + 1,) in s; `coefficients` (pieces, 4, nu), ascending powers of the time since
    the piece's knot; `breaks`: the knots onto which the integrator has to step.
    """

    knots: np.ndarray
    coefficients: np.ndarray
    breaks: np.ndarray

    def __repr__(self) -> str:
        pieces, _, width = self.coefficients.shape
        first, last = self.span
        span = f"{amount(pieces, 'piece')} from {first:.6g} to {last:.6g} s"
        return f"Signal({span}, {amount(width, 'value')} at each time)"

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time that it is known at, in s."""
        return self.knots.item(0), self.knots.item(-1)

    def covers(self, start: float, stop: float) -> bool:
        """Tell whether it is known from start to stop, in s; by rounding only it may end before."""
        first, last = self.span
        return start >= first and stop <= last + ROUNDING * (stop - start)

    def __call__(self, t: Any) -> np.ndarray:
        """Evaluate u at the times `t` (any shape, s), from the right at a jump; returns shape
        (*t.shape, nu).

        A symbolic time, with which a controller is traced, has its own way to refer to a signal:
        `t.reference(signal)`.
        """
        if hasattr(t, "reference"):
            return t.reference(self)
        t = np.asarray(t, dtype=float)
        piece, s = self._locate(t)
        c_0, c_1, c_2, c_3 = (self.coefficients[piece, power] for power in range(4))
        s = s[..., None]
        return c_0 + s * (c_1 + s * (c_2 + s * c_3))

    @property
    def bends(self) -> np.ndarray:
        """Where its third derivatives turn round, a row each as of `bends.bends`."""
        return NO_BENDS if len(self.coefficients) < 4 else self._bends

    @cached_property
    def _bends(self) -> np.ndarray:
        from linkwork.simulation.bends import bends

        return bends(self.knots, self.coefficients, FREE)

    @cached_property
    def table(self) -> np.ndarray:
        """All of it in one list, as compiled loops take it: the numbers of pieces, inputs, breaks
        and bends, then knots, coefficients, breaks and bends.
        """
        bends = self.bends
        counts = *self.coefficients.shape[::2], self.breaks.size, len(bends) - 1
        return np.concatenate(
            (counts, self.knots, self.coefficients.ravel(), self.breaks, bends.ravel())
        )

    @cached_property
    def _derivative(self) -> "Signal":
        factors = np.array([1.0, 2.0, 3.0])[:, None]
        slopes = np.concatenate(
            [self.coefficients[:, 1:] * factors, 0 * self.coefficients[:, :1]], axis=1
        )
        return Signal(self.knots, slopes, np.union1d(self.breaks, _kinks(self.knots, slopes)))

    def derivative(self) -> "Signal":
        """Return du/dt, the same object each time; where it has a kink it breaks, and jumps of u
        leave no trace in it."""
        return self._derivative

    def _locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        piece = np.clip(
            np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.coefficients) - 1
        )
        return piece, t - self.knots[piece]


def as_signal(forces: "Signal | Sampled | ArrayLike") -> Signal:
    """Return forces as a `Signal`: samples by their kind, numbers (nu,) as a constant from t = 0
    on.

    Raises `LinkworkError` for numbers that are not finite or not a list.
    """
    if isinstance(forces, Signal):
        return forces
    if isinstance(forces, Sampled):
        return forces.signal
    constant = _finite("forces", forces)
    if constant.ndim != 1:
        raise LinkworkError(
            f"forces have the shape {constant.shape}: give one number per input, or sampled values"
        )
    return _from_zero([constant])


def clock() -> Signal:
    """Return the single input u(t) = t, which makes time itself known to the equations of
    motion."""
    return _from_zero([np.zeros(1), np.ones(1)])


def stack(*signals: Signal) -> Signal:
    """Join signals side by side into one, over the times that all of them cover.

    Each piece is moved to the common knots by Taylor's shift, c_j' = sum_i binomial(i, j) d^(i-j)
    c_i.
    """
    first = max(signal.knots[0] for signal in signals)
    last = min(signal.knots[-1] for signal in signals)
    if not first < last:
        raise LinkworkError(
            f"the signals share no time: one starts at {first:g} s, another ends at {last:g} s"
        )
    knots = np.unique(np.concatenate([signal.knots for signal in signals]))
    knots = knots[(knots >= first) & (knots <= last)]
    breaks = np.unique(np.concatenate([signal.breaks for signal in signals]))
    coefficients = np.concatenate([_shifted(signal, knots[:-1]) for signal in signals], axis=2)
    return Signal(knots, coefficients, breaks[(breaks >= first) & (breaks <= last)])


def require_increasing(what: str, times: np.ndarray) -> None:
    """Raise `LinkworkError` naming the first of the `times` that is not larger than the one
    before."""
    if times.size < 2:
        return
    increase = times[1:] > times[:-1]
    if not increase.all():
        i = int(increase.argmin())
        raise LinkworkError(
            f"{what} must increase: number {i + 1} is {times[i + 1]:g} s after {times[i]:g} s "
            "(counted from 0)"
        )


def _kinks(knots: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return the inner knots at which the value or the slope of a signal jumps."""
    c_0, c_1, c_2, c_3 = np.moveaxis(coefficients, 1, 0)
    s = np.diff(knots[:-1])[:, None]
    values = c_0[:-1] + s * (c_1[:-1] + s * (c_2[:-1] + s * c_3[:-1])) - c_0[1:]
    slopes = c_1[:-1] + s * (2 * c_2[:-1] + 3 * s * c_3[:-1]) - c_1[1:]
    jumps = np.abs(values) > SMOOTH * np.abs(c_0).max(initial=0)
    jumps |= np.abs(slopes) > SMOOTH * np.abs(c_1).max(initial=0)
    return knots[1:-1][jumps.any(axis=1)]


def _shifted(signal: Signal, knots: np.ndarray) -> np.ndarray:
    piece, d = signal._locate(knots)
    c_0, c_1, c_2, c_3 = np.moveaxis(signal.coefficients[piece], -2, 0)
    d = d[:, None]
    value, slope = c_0 + d * (c_1 + d * (c_2 + d * c_3)), c_1 + d * (2 * c_2 + d * 3 * c_3)
    return np.stack([value, slope, c_2 + 3 * d * c_3, c_3], axis=1)


def _from_zero(powers: list[np.ndarray]) -> Signal:
    coefficients = np.zeros((1, 4, len(powers[0])))
    coefficients[0, : len(powers)] = powers
    return Signal(np.array([0.0, np.inf]), coefficients, np.empty(0))


def _spline(samples: Sampled) -> Signal:
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(samples.times, samples.values, bc_type="not-a-knot")
    return Signal(spline.x, np.ascontiguousarray(np.moveaxis(spline.c, 0, 1)[:, ::-1]), np.empty(0))


def _linear(samples: Sampled) -> Signal:
    slopes = np.diff(samples.values, axis=0) / np.diff(samples.times)[:, None]
    return _broken(samples, [samples.values[:-1], slopes])


def _hold(samples: Sampled) -> Signal:
    return _broken(samples, [samples.values[:-1]])


def _broken(samples: Sampled, powers: list[np.ndarray]) -> Signal:
    coefficients = np.zeros((len(samples.times) - 1, 4, samples.values.shape[1]))
    for i, power in enumerate(powers):
        coefficients[:, i] = power
    return Signal(samples.times, coefficients, samples.times)


_INTERPOLANTS = {"spline": _spline, "linear": _linear, "hold": _hold}


def _finite(what: str, values: ArrayLike) -> np.ndarray:
    """Return a copy as floats; raise `LinkworkError` naming the first value that is no finite
    number."""
    array = reals(values)
    if array is None:
        raise LinkworkError(f"{what} must be numbers in a regular array, not {values!r}")
    finite = np.isfinite(array)
    if not finite.all():
        where = tuple(int(i) for i in np.argwhere(~finite)[0])
        raise LinkworkError(
            f"{what} must be finite: number {', '.join(map(str, where)) or 0} is {array[where]}"
        )
    return array
