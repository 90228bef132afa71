"""Integrate the equations of motion: check what is asked, and run the compiled loop once."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.simulation.signals import Sampled, Signal, as_signal, require_increasing
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import DORMAND_PRINCE, Tableau

ROUNDING = 1e-9  # how far a time may lie beyond the end of a run, relative to the duration, and still count as the end


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Hold what an integration computed, up to where it ended.

    At the K saved times: `t` (K,) in s, `q` (K, nq), `v` (K, nv), `u` (K, nu), and `residual` (K,), the largest |phi(q)|.
    The last state reached: `end_time`, `q_end` (nq,), `v_end` (nv,); `next_step`, the step size to go on with, in s.
    How it went: `status`, `message`; `nfev` evaluations of the motion kernel, `steps` accepted, `rejected`, and
    `projections`, evaluations of the closure kernel; `pivot`, the smallest pivot met, at `pivot_time`;
    `closure_error`, the largest residual of all accepted states and samples.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    end_time: float
    q_end: np.ndarray
    v_end: np.ndarray
    next_step: float
    status: Status
    message: str
    nfev: int
    steps: int
    rejected: int
    projections: int
    pivot: float
    pivot_time: float
    closure_error: float

    @property
    def success(self) -> bool:
        """Tell whether the run reached its end."""
        return self.status is Status.FINISHED


def integrate(
    motion: int,
    closure: int | None,
    q: ArrayLike,
    v: ArrayLike,
    forces: Signal | Sampled | ArrayLike,
    parameters: ArrayLike = (),
    *,
    duration: float,
    start: float = 0.0,
    rtol: ArrayLike = 1e-8,
    atol: ArrayLike = 1e-10,
    save_at: ArrayLike | None = None,
    max_step: float = math.inf,
    first_step: float | None = None,
    max_steps: int = 1_000_000,
    pivot_bound: float = 1e-4,
    closure_tol: float = 1e-13,
    method: Tableau = DORMAND_PRINCE,
) -> Trajectory:
    """Integrate (q', v') = f(q, v, u(t), p) over time with q kept on phi(q) = 0.

    Arguments:
        motion: address of the kernel (q, v, u, p) -> (q', v', pivot), a C function void(const double *, double *).
        closure: address of the kernel (q, p) -> (q after one Newton step on phi = 0, max |phi(q)|); None or 0 if q has
            nothing to keep to.
        q, v: coordinates (nq,) and independent rates (nv,) at the start; q is closed first.
        forces: the inputs u (nu,) over time: numbers, `Sampled`, or a `Signal`. nu and np are those of the kernels.
        parameters: p (np,), constant over the run.
        duration, start: s; the run goes from `start` >= 0 to `start + duration`.
        rtol, atol: a step's error in each component of (q, v) is held to atol + rtol |y| in the root mean square; one
            number, or one for each component; positive.
        save_at: increasing times (K,), s, at which to save, by dense output; None saves every step.
        max_step, first_step: s; the first step is guessed where it is None.
        max_steps: accepted and rejected steps together.
        pivot_bound: the run stops as SINGULAR where the kernel's pivot falls below it (within a quarter of it). The errors
            of v enter the dependent rates multiplied by about 1 / pivot, so that below 1e-4 a run at rtol = 1e-8 is worth
            four digits, and steps begin to reach across the singular pose unseen.
        closure_tol: the largest |phi| left after a projection, in the units of phi; it is to be above rounding, which is
            about 1e-16 times the largest length.
        method: an embedded Runge-Kutta pair.

    Returns the `Trajectory`, whatever way the run ended: see its `status` and `message`.

    Raises `LinkworkError` for arguments that make no run: shapes, numbers that are not finite, a duration that is not
    positive, times to save outside the run, samples that do not cover the run.
    """
    if not 0 < duration < math.inf:
        raise LinkworkError(f"the duration of a run must be positive and finite, not {duration} s")
    if not 0 <= start < math.inf:
        raise LinkworkError(f"a run must start at a finite time from 0 s on, not at {start} s")
    stop = start + duration
    signal = as_signal(forces)
    _require_cover(signal, start, stop)
    q, v = _vector("q", q), _vector("v", v)
    y = np.concatenate((q, v))
    if not y.size:
        raise LinkworkError("there is nothing to integrate: q and v are both empty")
    times = np.empty(0) if save_at is None else _times_within(save_at, start, stop)
    if first_step is not None:
        _require_positive("first_step", first_step)
    for name, value in ("max_step", max_step), ("pivot_bound", pivot_bound), ("closure_tol", closure_tol):
        _require_positive(name, value)
    if max_steps < 1:
        raise LinkworkError(f"max_steps must be at least 1, not {max_steps}")

    from linkwork.simulation import native

    outcome = native.integrate(
        motion, closure or 0, _vector("the parameters", parameters), signal.knots, signal.coefficients, signal.breaks,
        method.a, method.c, method.e, method.dense, 1 / (method.error_order + 1),
        _tolerance("rtol", rtol, y.size), _tolerance("atol", atol, y.size), pivot_bound, closure_tol,
        q.size, y, times, save_at is None, start, stop, max_step, first_step or 0.0, max_steps,
    )  # fmt: skip
    return _trajectory(outcome, y, q.size, pivot_bound, closure_tol, max_steps)


def _trajectory(outcome, y: np.ndarray, nq: int, pivot_bound: float, closure_tol: float, max_steps: int) -> Trajectory:
    status = Status(outcome.status)
    message = status.sentence(
        time=outcome.time,
        step=outcome.step,
        rejected_pivot=outcome.rejected_pivot,
        rejected_residual=outcome.rejected_residual,
        pivot_bound=pivot_bound,
        closure_tol=closure_tol,
        max_steps=max_steps,
    )
    rows, n = outcome.rows, y.size
    return Trajectory(
        t=rows[:, 0],
        q=rows[:, 1 : 1 + nq],
        v=rows[:, 1 + nq : 1 + n],
        u=rows[:, 1 + n : -1],
        residual=rows[:, -1],
        end_time=outcome.time,
        q_end=y[:nq],
        v_end=y[nq:],
        next_step=outcome.step,
        status=status,
        message=message,
        nfev=outcome.evaluations,
        steps=outcome.accepted,
        rejected=outcome.rejected,
        projections=outcome.projections,
        pivot=outcome.pivot,
        pivot_time=outcome.pivot_time,
        closure_error=outcome.closure_error,
    )


def _vector(what: str, values: ArrayLike) -> np.ndarray:
    """Return a contiguous copy (n,) as floats, or refuse what is no list of finite numbers."""
    vector = np.array(values, dtype=float)
    if vector.ndim != 1:
        raise LinkworkError(f"{what} must be a list of numbers, not an array of the shape {vector.shape}")
    for i, number in enumerate(vector.tolist()):
        if not math.isfinite(number):
            raise LinkworkError(f"{what} must be finite: number {i} is {number} (counted from 0)")
    return vector


def _tolerance(name: str, value: ArrayLike, n: int) -> np.ndarray:
    """Return a tolerance for each of the n components."""
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (n,)):
        raise LinkworkError(f"{name} has the shape {given.shape}: give one number, or {n}, one for each of (q, v)")
    tolerance = np.empty(n)
    tolerance[:] = given
    for number in tolerance.tolist():
        if not 0 < number < math.inf:
            raise LinkworkError(f"{name} must be positive and finite, not {number}")
    return tolerance


def _times_within(save_at: ArrayLike, start: float, stop: float) -> np.ndarray:
    """Return the times to save at, (K,); a last one that lies beyond the end by rounding only is the end."""
    times = _vector("save_at", save_at)
    require_increasing("the times in save_at", times)
    if times.size and (times[0] < start or times[-1] > stop + ROUNDING * (stop - start)):
        raise LinkworkError(
            f"the times in save_at run from {times[0]:g} s to {times[-1]:g} s: give times within the run,"
            f" from {start:g} s to {stop:g} s"
        )
    return np.minimum(times, stop)


def _require_cover(signal: Signal, start: float, stop: float) -> None:
    first, last = signal.knots[0], signal.knots[-1]
    if start < first or stop > last + ROUNDING * (stop - start):
        raise LinkworkError(
            f"the forces are sampled from {first:g} s to {last:g} s, but the run goes from {start:g} s to {stop:g} s:"
            " give samples for the whole run"
        )


def _require_positive(name: str, value: float) -> None:
    if not value > 0:
        raise LinkworkError(f"{name} must be positive, not {value}")
