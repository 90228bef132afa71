"""Integrate the equations of motion: check what is asked, and run the compiled loop once."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.simulation.events import Control, Events, Occurrences, Pace
from linkwork.simulation.rosenbrock import Rosenbrock
from linkwork.simulation.signals import Sampled, Signal, as_signal, require_increasing
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import DORMAND_PRINCE, RK4, SymplecticEuler, Tableau

Method = Tableau | Rosenbrock | RK4 | SymplecticEuler
ROUNDING = 1e-9  # how far a time may lie beyond the end of a run, relative to the duration, and still count as the end


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Hold what an integration computed, up to where it ended.

    At the K saved times: `t` (K,) in s, `q` (K, nq), `v` (K, nv), `u` (K, nu), and `residual` (K,), the largest |phi(q)|.
    `events`: the zeros of the event functions, as `Occurrences`.
    The last state reached: `end_time`, `q_end` (nq,), `v_end` (nv,). To go on from there: `pace`, the step size, and
    `control`, what a sampled controller holds.
    How it went: `status`, `message`; `nfev` evaluations of the motion kernel, `steps` accepted, `rejected`, and
    `projections`, evaluations of the closure kernel; `pivot`, the smallest pivot met, at `pivot_time`;
    `closure_error`, the largest residual at the start, at the end and of all rows saved.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    end_time: float
    q_end: np.ndarray
    v_end: np.ndarray
    pace: Pace
    control: Control | None
    events: Occurrences
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

    @property
    def next_step(self) -> float:
        """The step size to go on with, in s."""
        return self.pace.step


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
    first_step: float | Pace | None = None,
    max_steps: int = 1_000_000,
    pivot_bound: float = 1e-4,
    closure_tol: float = 1e-13,
    method: Method = DORMAND_PRINCE,
    jacobian: int | None = None,
    events: Events | None = None,
    control: Control | None = None,
) -> Trajectory:
    """Integrate (q', v') = f(q, v, u(t), p) over time with q kept on phi(q) = 0.

    Arguments:
        motion: address of the kernel (q, v, u, p) -> (q', v', pivot), a C function void(const double *, double *).
        closure: address of the kernel (q, p) -> (q after one Newton step on phi = 0, max |phi(q)|); None or 0 if q has
            nothing to keep to.
        q, v: coordinates (nq,) and independent rates (nv,) at the start; q is closed first. What else is a state, of drives
            and controllers, follows the rates in v.
        forces: the inputs u (nu,) over time: numbers, `Sampled`, or a `Signal`; with a `control`, the inputs that it does not
            hold. nu and np are those of the kernels.
        parameters: p (np,), constant over the run.
        duration, start: s; the run goes from `start` >= 0 to `start + duration`.
        rtol, atol: a step's error in each component of (q, v) is held to atol + rtol |y| in the root mean square; one
            number, or one for each component; positive.
        save_at: increasing times (K,), s, at which to save, by dense output; None saves every step.
        max_step, first_step: s, not for methods of a fixed step; the first step is guessed where it is None. The `pace` of a
            run that stopped at max_steps, with its last state, time and control, continues it bit for bit.
        max_steps: accepted and rejected steps together.
        pivot_bound: the run stops as SINGULAR where the kernel's pivot falls below it (within a quarter of it). The errors
            of v enter the dependent rates multiplied by about 1 / pivot, so that below 1e-4 a run at rtol = 1e-8 is worth
            four digits, and steps begin to reach across the singular pose unseen.
        closure_tol: the largest |phi| left after a projection, in the units of phi; it is to be above rounding, which is
            about 1e-16 times the largest length.
        method: an embedded Runge-Kutta pair (DORMAND_PRINCE, DOP853 for tight tolerances), RODAS for stiff systems, or
            a fixed step for real time, RK4(step) or SymplecticEuler(step), which takes no notice of rtol and atol.
        jacobian: address of the kernel (y, u, p) -> (df/dy (n n), df/du (n nu)), both column by column; RODAS needs it.
        events: functions of (y, u, p) whose zeros are located, and may end the run. control: a sampled controller.

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
    pace = _pace(first_step if method.step is None else method.step)
    for name, value in ("max_step", max_step), ("pivot_bound", pivot_bound), ("closure_tol", closure_tol):
        _require_positive(name, value)
    if max_steps < 1:
        raise LinkworkError(f"max_steps must be at least 1, not {max_steps}")

    from linkwork.simulation.native_loop import COUNTS, Outcome

    if isinstance(method, Rosenbrock):
        from linkwork.simulation.native_rosenbrock import integrate as run

        if not jacobian:
            raise LinkworkError(f"{method.name} needs the address of the Jacobian's kernel")
    else:
        from linkwork.simulation.native import integrate as run

    held, period, next_sample, acts = _sampling(control, start)
    conditions = np.array([(c.direction, c.terminal) for c in events.conditions] if events else [], float).reshape(
        -1, 2
    )
    facts = np.empty(len(Outcome._fields))
    rows = run(
        motion, closure or 0, jacobian or 0, events.address if len(conditions) and events else 0, acts,
        _vector("the parameters", parameters), signal.knots, signal.coefficients, signal.breaks,
        *method.plan,
        _tolerances(rtol, atol, y.size), pivot_bound, closure_tol,
        q.size, y, times, save_at is None, start, stop, max_step, pace.step, pace.growth, max_steps,
        held, period, next_sample, conditions, facts,
    )  # fmt: skip
    ending = Outcome(*[int(number) for number in facts[:COUNTS].tolist()], *facts[COUNTS:].tolist())
    n, found = y.size, rows[:0]
    if len(conditions):
        happened = rows[:, -1] >= 0
        found, rows = rows[happened], rows[~happened]
    message = Status(ending.status).sentence(
        time=ending.time,
        step=ending.step,
        rejected_pivot=ending.rejected_pivot,
        rejected_residual=ending.rejected_residual,
        pivot_bound=pivot_bound,
        closure_tol=closure_tol,
        max_steps=max_steps,
        culprit=_culprit(ending.fault, q.size, y.size, held.size),
        event=int(found[-1, -1]) if len(found) else -1,
    )
    return Trajectory(
        t=rows[:, 0],
        q=rows[:, 1 : 1 + q.size],
        v=rows[:, 1 + q.size : 1 + n],
        u=rows[:, 1 + n : -2],
        residual=rows[:, -2],
        end_time=ending.time,
        q_end=y[: q.size],
        v_end=y[q.size :],
        pace=Pace(ending.step, ending.growth),
        control=control and replace(control, held=held, next_sample=ending.next_sample),
        events=Occurrences(found[:, 0], found[:, -1].astype(int), found[:, 1 : 1 + n]),
        status=Status(ending.status),
        message=message,
        nfev=ending.evaluations,
        steps=ending.accepted,
        rejected=ending.rejected,
        projections=ending.projections,
        pivot=ending.pivot,
        pivot_time=ending.pivot_time,
        closure_error=ending.closure_error,
    )


def _pace(first_step: float | Pace | None) -> Pace:
    """Return the pace at the start: a step of 0 is guessed, and the first may grow at once."""
    from linkwork.simulation.native_loop import LARGEST_FACTOR

    if isinstance(first_step, Pace):
        return first_step
    if first_step is not None:
        _require_positive("first_step", first_step)
    return Pace(first_step or 0.0, LARGEST_FACTOR)


def _sampling(control: Control | None, start: float) -> tuple[np.ndarray, float, int, int]:
    """Return the held inputs, the period, the index of the first sample, and the address of the controller's kernel."""
    if control is None:
        return np.empty(0), 1.0, 0, 0
    first = math.ceil(start / control.period - ROUNDING) if control.next_sample is None else control.next_sample
    return _vector("the held inputs", control.held), control.period, first, control.address


def _culprit(fault: int, nq: int, n: int, held: int) -> str:
    """Name what is not finite by the number that the compiled loop gives it."""
    kinds = [("component {} of q'", nq), ("component {} of v'", n - nq), ("the pivot", 1), ("held input {}", held)]
    for kind, count in [*kinds, ("the function of event {}", math.inf)]:
        if fault < count:
            return kind.format(fault) + (" (counted from 0)" if "{}" in kind else "")
        fault -= int(count)
    raise AssertionError(fault)


def _vector(what: str, values: ArrayLike) -> np.ndarray:
    """Return a contiguous copy (n,) as floats, or refuse what is no list of finite numbers."""
    vector = np.array(values, dtype=float)
    if vector.ndim != 1:
        raise LinkworkError(f"{what} must be a list of numbers, not an array of the shape {vector.shape}")
    for i, number in enumerate(vector.tolist()):
        if not math.isfinite(number):
            raise LinkworkError(f"{what} must be finite: number {i} is {number} (counted from 0)")
    return vector


def _tolerances(rtol: ArrayLike, atol: ArrayLike, n: int) -> np.ndarray:
    """Return rtol and atol (2, n) for each of the n components."""
    table = np.empty((2, n))
    table[0], table[1] = _tolerance("rtol", rtol, n), _tolerance("atol", atol, n)
    return table


def _tolerance(name: str, value: ArrayLike, n: int) -> np.ndarray:
    """Return a tolerance, one for all of the n components or one for each."""
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (n,)):
        raise LinkworkError(f"{name} has the shape {given.shape}: give one number, or {n}, one for each of (q, v)")
    for number in given.ravel().tolist():
        if not 0 < number < math.inf:
            raise LinkworkError(f"{name} must be positive and finite, not {number}")
    return given


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
