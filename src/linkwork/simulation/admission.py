"""Admission: what may be integrated; numbers, times and spans that make no run are refused."""

import math

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.simulation.signals import ROUNDING, Signal, require_increasing


def listed(what: str, values: ArrayLike) -> np.ndarray:
    """Return values (n,) as floats, or refuse what is no list."""
    vector = np.asarray(values, dtype=float)
    if vector.ndim != 1:
        raise LinkworkError(
            f"{what} must be a list of numbers, not an array of the shape {vector.shape}"
        )
    return vector


def numbers_of(what: str, values: ArrayLike) -> np.ndarray:
    """Return a contiguous copy (n,) as floats, or refuse what is no list of finite numbers."""
    vector = listed(what, values).copy()
    numbers = vector.tolist()
    if not all(map(math.isfinite, numbers)):
        i = next(i for i, number in enumerate(numbers) if not math.isfinite(number))
        raise LinkworkError(f"{what} must be finite: number {i} is {numbers[i]} (counted from 0)")
    return vector


def tolerances(rtol: ArrayLike, atol: ArrayLike, n: int) -> np.ndarray:
    """Return rtol and atol (2, n) for each of the n components."""
    table = np.empty((2, n))
    table[0], table[1] = _tolerance("rtol", rtol, n), _tolerance("atol", atol, n)
    return table


def _tolerance(name: str, value: ArrayLike, n: int) -> ArrayLike:
    """Return a tolerance, one for all of the n components or one for each."""
    if isinstance(value, float) and 0 < value < math.inf:
        return value
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (n,)):
        raise LinkworkError(
            f"{name} has the shape {given.shape}: give one number, or {n}, one for each of (q, v)"
        )
    for number in given.ravel().tolist():
        if not 0 < number < math.inf:
            raise LinkworkError(f"{name} must be positive and finite, not {number}")
    return given


def refuse_start(y: np.ndarray, nq: int, forces: Signal, start: float, stop: float) -> None:
    """Refuse a start from which no run goes: a time or a state that is not finite, or forces that
    are not known until the end."""
    if not 0 <= start < math.inf:
        raise LinkworkError(f"a run must start at a finite time from 0 s on, not at {start} s")
    require_cover("the forces are sampled", forces, start, stop)
    numbers_of("q", y[:nq])
    numbers_of("v", y[nq:])


def times_within(save_at: ArrayLike, start: float, stop: float) -> np.ndarray:
    """Return the times to save at, (K,); a last one that lies beyond the end by rounding only is
    the end."""
    times = numbers_of("save_at", save_at)
    require_increasing("the times in save_at", times)
    if not times.size:
        return times
    first, last = times.item(0), times.item(-1)
    if first < start or last > stop + ROUNDING * (stop - start):
        raise LinkworkError(
            f"the times in save_at run from {first:g} s to {last:g} s: give times within the run,"
            f" from {start:g} s to {stop:g} s"
        )
    return times if last <= stop else np.minimum(times, stop)


def require_run(duration: float, max_steps: int) -> None:
    """Refuse runs that have no end, or no step."""
    if not 0 < duration < math.inf:
        raise LinkworkError(f"the duration of a run must be positive and finite, not {duration} s")
    if max_steps < 1:
        raise LinkworkError(f"max_steps must be at least 1, not {max_steps}")


def require_cover(what: str, signal: Signal, start: float, stop: float) -> None:
    """Refuse a signal that is not known over the whole run; what: the sentence up to its times."""
    if not signal.covers(start, stop):
        first, last = signal.span
        raise LinkworkError(
            f"{what} from {first:g} s to {last:g} s, but the run goes from {start:g} s to "
            f"{stop:g} s; give samples for the whole run"
        )


def require_positive(name: str, value: float) -> None:
    if not value > 0:
        raise LinkworkError(f"{name} must be positive, not {value}")
