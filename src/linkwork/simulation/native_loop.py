"""The integrators' loop, which all methods share; each method's module compiles it together with its own way to advance.

One turn: `advance` tries a step, q of the new state projected onto phi(q) = 0; the events within the step are located and
the samples taken by dense output, projected too; the step is accepted, or shrunk. Where the inputs may jump, at a break of
the signals or where a sampled controller acts, a step ends, and the slope there is evaluated anew.

The error of a component is |h sum_i e_i k_i| plus the distance by which the projection moved it: a projection that carries
the state away, to another assembly mode say, is an error like any other and is refused.

Step sizes: Hairer, Norsett & Wanner, Solving ODE I, sec. II.4 (first step, safety factors).
Roots of events: Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.

Names: those of `native_parts`; `a`, `c`, `e`, `dense`, `solution`, `computed` as in `tableaus`; `held`, the last inputs,
which a controller sets at the times k period; `conditions`, a row (direction, terminal) for each event.
"""

import math
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.core.dispatcher import Dispatcher

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    SINGULAR,
    blend,
    call,
    combine,
    copy,
    evaluate,
    first_fault,
    force,
    padded,
    project,
    resized,
    scaled,
)  # fmt: skip
from linkwork.simulation.status import Status

STEP_UNDERFLOW = int(Status.STEP_UNDERFLOW)
TOO_MANY_STEPS = int(Status.TOO_MANY_STEPS)
EVENT = int(Status.EVENT)

SAFETY = 0.9
SMALLEST_FACTOR, LARGEST_FACTOR = 0.2, 10.0
RETREAT = 0.25  # factor on the step where the equations themselves fail
NEAR = 1.25  # a pivot this close to its bound, relative to it, is at it
DAMPING = 0.85  # of the exponent with which the error of a step sets the next one: fewer steps fail
SMALLEST_ERROR = 1e-10
ROUNDING = 1e-9
SMALLEST_STEP = 16 * 2.0**-52  # relative to the time and to the duration
ROOT = 2.0**-50  # width of the last bracket around an event, relative to the time and to the step
ROOT_CALLS = 100
FIRST_ROWS = 64
NEVER = 2.0  # theta of an event that does not happen within the step


class Trial(NamedTuple):
    """What came of a trial step: OK or why the equations failed, the scaled error, the smallest pivot, the cost."""

    ailment: int
    error: float
    pivot: float
    pivot_time: float
    last_pivot: float
    residual: float
    evaluations: int
    projections: int


class Outcome(NamedTuple):
    """What came of a run, apart from the rows saved and the last state; `fault` is what was not finite, if anything."""

    status: int
    evaluations: int
    accepted: int
    rejected: int
    projections: int
    fault: int
    next_sample: int
    time: float
    step: float
    growth: float
    pivot: float
    pivot_time: float
    closure_error: float
    rejected_pivot: float
    rejected_residual: float


COUNTS = 7  # numbers of an outcome that count something


@njit(**OPTIONS)
def evaluate_first(motion, x, k, n, pivot_bound):
    """Evaluate k_0, from which no step can retreat, and look at all of its numbers."""
    ailment, pivot = evaluate(motion, x, k, 0, n, pivot_bound)
    if ailment == OK and first_fault(k, 1, n) < n:
        ailment = NON_FINITE
    return ailment, pivot


@njit(**OPTIONS)
def first_step(motion, knots, coefficients, exponent, tolerance, pivot_bound, t, longest, y, x, k):
    """Guess a first step from the slope here, k_0, and one a little ahead, k_1."""
    n = tolerance.shape[1]
    for m in range(n):
        k[1, m] = y[m]
    size, steepness = scaled(k, 1, y, tolerance), scaled(k, 0, y, tolerance)
    ahead = min(longest, 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness)
    for m in range(n):
        x[m] = y[m] + ahead * k[0, m]
    force(knots, coefficients, t + ahead, True, 0, x, n)
    ailment, _ = evaluate(motion, x, k, 1, n, pivot_bound)
    if ailment != OK:
        return ahead
    for m in range(n):
        k[1, m] -= k[0, m]
    steepest = max(steepness, scaled(k, 1, y, tolerance) / ahead)
    return min(100 * ahead, max(1e-6, 1e-3 * ahead) if steepest <= 1e-15 else (0.01 / steepest) ** exponent)


@njit(**OPTIONS)
def extend(motion, knots, coefficients, a, c, computed, n, pivot_bound, t, step, piece, y, k, x, sample):
    """Evaluate the stages that only the dense output needs; return OK or why the equations fail there."""
    for i in range(computed, a.shape[0]):
        combine(a, i, i, step, y, k, sample)
        copy(sample, x, n)
        force(knots, coefficients, t + c[i] * step, True, piece, x, n)
        ailment, _ = evaluate(motion, x, k, i, n, pivot_bound)
        if ailment != OK:
            return ailment
    return OK


@njit(**OPTIONS)
def state_within(closure, closure_tol, dense, theta, step, y, k, weights, sample, z, z_next):
    """Interpolate the state at t + theta step into the sample, and project it; return the residual and the calls made."""
    blend(dense, theta, weights)
    combine(weights, 0, dense.shape[0], step, y, k, sample)
    if closure == 0:
        return 0.0, 0
    return project(closure, sample, z, z_next, closure_tol, True)


@njit(**OPTIONS)
def locate(
    events, i, before, after, g, closure, closure_tol, knots, coefficients, n, piece, dense, t, step, y, k, weights,
    sample, z, z_next, x,
):  # fmt: skip
    """Return the theta at which g_i has just changed its sign from that of `before` (theta = 0) to that of `after`
    (theta = 1), and the calls of the closure kernel.
    """
    side = 1.0 if before < 0 else -1.0
    tolerance, calls = ROOT * max(1.0, abs(t / step)), 0
    theta_1, g_1, theta_2, g_2, guess = 1.0, after, 0.0, before, 0.5
    for _ in range(ROOT_CALLS):
        theta = theta_1 + guess * (theta_2 - theta_1)
        calls += state_within(closure, closure_tol, dense, theta, step, y, k, weights, sample, z, z_next)[1]
        copy(sample, x, n)
        force(knots, coefficients, t + theta * step, True, piece, x, n)
        call(events, x, g, 0)
        if (side * g[i] >= 0) == (side * g_1 >= 0):
            theta_3, g_3 = theta_1, g_1
        else:
            theta_3, g_3, theta_2, g_2 = theta_2, g_2, theta_1, g_1
        theta_1, g_1 = theta, g[i]
        smallest = tolerance / abs(theta_2 - theta_1)
        if smallest > 0.5:
            break
        fraction, ratio = (theta_1 - theta_2) / (theta_3 - theta_2), (g_1 - g_2) / (g_3 - g_2)
        guess = 0.5
        if ratio**2 < fraction and (1 - ratio) ** 2 < 1 - fraction:  # inverse quadratic interpolation
            guess = g_1 / (g_2 - g_1) * g_3 / (g_2 - g_3) + (theta_3 - theta_1) / (theta_2 - theta_1) * g_1 / (
                g_3 - g_1
            ) * g_2 / (g_3 - g_2)
        guess = min(max(guess, smallest), 1 - smallest)
    return (theta_1 if side * g_1 >= 0 else theta_2), calls


@njit(**OPTIONS)
def record(rows, row, time, y, n, residual, event, knots, coefficients, piece, x, inputs):
    """Write (t, y, u, residual, event) into a row of the table, which grows if it is full; return the table."""
    if row == rows.shape[0]:
        rows = resized(rows, 2 * row + FIRST_ROWS)
    force(knots, coefficients, time, False, piece, x, n)
    rows[row, 0] = time
    for m in range(n):
        rows[row, 1 + m] = y[m]
    for m in range(n, n + inputs):
        rows[row, 1 + m] = x[m]
    rows[row, 1 + n + inputs] = residual
    rows[row, 2 + n + inputs] = event
    return rows


def run(
    motion, closure, jacobian, events, control, p, knots, coefficients, breaks,
    a, c, e, dense, solution, computed, exponent,
    tolerance, pivot_bound, closure_tol,
    nq, y_end, save_at, every_step, start, stop, max_step, h, growth, max_steps,
    held, period, next_sample, conditions, facts,
):  # fmt: skip
    """Integrate from y_end at start to stop, leave the last state in y_end and the `Outcome` in facts; return the rows.

    A row is (t, y, u, residual, event), with event = -1 where the row was asked for. h <= 0 asks for a guess of the first
    step. `exponent` = 1 / (order of the error estimate + 1), or 0: all steps have the length h. tolerance (2, n): rtol, atol.
    """
    n, signals, width = y_end.size, coefficients.shape[2], padded(y_end.size + 1)
    inputs = signals + held.size
    stages, watched = max(2, dense.shape[0]), conditions.shape[0]
    room = np.zeros((3 + stages) * width + 4 * watched + n + inputs + 2 * p.size + 2 * nq + 1)  # one allocation for all
    y, new, sample = room[:width], room[width : 2 * width], room[2 * width : 3 * width]
    k, rest = room[3 * width : (3 + stages) * width].reshape((stages, width)), room[(3 + stages) * width :]
    g, g_new, g_within = rest[:watched], rest[watched : 2 * watched], rest[2 * watched : 3 * watched]
    crossings, rest = rest[3 * watched : 4 * watched], rest[4 * watched :]
    x, rest = rest[: n + inputs + p.size], rest[n + inputs + p.size :]
    z, z_next = rest[: nq + p.size], rest[nq + p.size :]
    copy(held, x[n + signals :], held.size)
    copy(p, x[n + inputs :], p.size)
    copy(p, z[nq:], p.size)
    work = np.zeros(width + (n * (2 * n + inputs + 1) if jacobian != 0 else 0))
    weights = np.empty((1, dense.shape[0]))
    copy(y_end, y, n)
    rows = np.empty((FIRST_ROWS if every_step else save_at.size, n + inputs + 3))
    saved = taken = next_break = evaluations = accepted = rejected = projections = 0
    closure_error = rejected_residual = 0.0
    fixed, length, fault = exponent == 0, h, -1
    grid = int(start / length) if fixed else 0
    t, cause, status = start, STEP_UNDERFLOW, OK
    smallest_step = SMALLEST_STEP * max(stop, stop - start)

    # The state at the start.
    if closure != 0:
        closure_error, projections = project(closure, y, z, z_next, closure_tol, True)
        rejected_residual = closure_error
        if not closure_error <= closure_tol:
            status = CLOSURE_LOST
    residual, arrived, piece = closure_error, True, 0
    pivot, pivot_time, first_pivot, rejected_pivot = math.inf, t, 0.0, 0.0
    halted, stale = False, True

    while arrived or status == OK:
        if arrived:  # at the time t with the state y: what happens between two steps
            arrived = False
            copy(y, x, n)
            piece = force(knots, coefficients, t, False, piece, x, n)
            goes_on = status == OK and t < stop and not halted and accepted + rejected < max_steps
            if control != 0 and goes_on and next_sample * period <= t + ROUNDING * period:
                call(control, x, held, 0)
                copy(held, x[n + signals :], held.size)
                next_sample, stale = next_sample + 1, True
                for i in range(held.size):
                    if saved > 0 and rows[saved - 1, 0] == t:
                        rows[saved - 1, 1 + n + signals + i] = held[i]
                    if not math.isfinite(held[i]) and status == OK:
                        status, fault = NON_FINITE, n + 1 + i
            if stale and (goes_on or accepted == 0) and status == OK:
                status, first_pivot = evaluate_first(motion, x, k, n, pivot_bound)
                evaluations += 1
                rejected_pivot, stale = first_pivot, False
                if first_pivot < pivot:
                    pivot, pivot_time = first_pivot, t
                if status == NON_FINITE:
                    fault = first_fault(k, 1, n)
            if accepted == 0 and events != 0:
                call(events, x, g, 0)
            if every_step or (accepted == 0 and save_at.size > 0 and save_at[0] == t):
                rows = record(rows, saved, t, y, n, residual, -1.0, knots, coefficients, piece, x, inputs)
                saved += 1
                if not every_step:
                    taken += 1
            while next_break < breaks.size and breaks[next_break] <= t + ROUNDING * (t - start):
                next_break += 1
            while fixed and grid * length <= t + ROUNDING * length:
                grid += 1
            target = stop
            if next_break < breaks.size:
                target = min(target, breaks[next_break])
            if control != 0:
                target = min(target, next_sample * period)
            if fixed:
                target = min(target, grid * length)
            if not goes_on or status != OK:
                if status == OK and halted:
                    status = EVENT
                elif status == OK and t < stop:
                    status = TOO_MANY_STEPS
                break
            if h <= 0:
                h = first_step(motion, knots, coefficients, exponent, tolerance, pivot_bound, t, target - t, y, x, k)
                evaluations += 1
            h = min(h, max_step)
        elif accepted + rejected == max_steps:
            status = TOO_MANY_STEPS
            break

        if h < smallest_step:
            status = cause
            break
        # A step lands on the target (short of it by rounding only counts), or goes half of the way rather than leave a sliver.
        gap = target - t
        step = gap if fixed or h * (1 + ROUNDING) >= gap else min(h, gap / 2)
        arrival = target if step == gap else t + step
        trial = advance(  # noqa: F821  # pyright: ignore[reportUndefinedVariable]
            work, motion, closure, jacobian, knots, coefficients, a, c, e, solution, computed, tolerance, pivot_bound,
            closure_tol, nq, every_step, t, step, piece, y, k, new, x, z, z_next, sample,
        )  # fmt: skip
        evaluations += trial.evaluations
        projections += trial.projections
        ailment, residual = trial.ailment, trial.residual
        accepts = ailment == OK and (fixed or trial.error <= 1)
        if ailment == NON_FINITE:
            fault = first_fault(k, k.shape[0], n)
        extended = computed == dense.shape[0]
        row, reached, sampled = saved, taken, residual

        # The events within the step, in the order of their times, up to the first that ends the run.
        if accepts and events != 0:
            copy(new, x, n)
            force(knots, coefficients, arrival, True, piece, x, n)
            call(events, x, g_new, 0)
            due = 0
            for i in range(g.size):
                rises, falls = g[i] < 0 <= g_new[i], g[i] > 0 >= g_new[i]
                crossings[i] = NEVER
                if math.isnan(g_new[i]):
                    accepts, ailment, fault = False, NON_FINITE, n + 1 + held.size + i
                elif (rises and conditions[i, 0] >= 0) or (falls and conditions[i, 0] <= 0):
                    if not extended:
                        ailment = extend(
                            motion, knots, coefficients, a, c, computed, n, pivot_bound, t, step, piece, y, k, x, sample
                        )  # fmt: skip
                        evaluations += dense.shape[0] - computed
                        extended, accepts = True, ailment == OK
                    crossings[i], calls = locate(
                        events, i, g[i], g_new[i], g_within, closure, closure_tol, knots, coefficients, n, piece,
                        dense, t, step, y, k, weights, sample, z, z_next, x,
                    )  # fmt: skip
                    projections += calls
                    due += 1
            while accepts and due > 0 and not halted:
                first = np.argmin(crossings)
                theta, crossings[first] = crossings[first], NEVER
                due -= 1
                time = arrival if theta == 1 else t + theta * step
                remainder, calls = residual, 0
                if theta == 1:
                    copy(new, sample, n)
                else:
                    remainder, calls = state_within(
                        closure, closure_tol, dense, theta, step, y, k, weights, sample, z, z_next
                    )
                projections += calls
                if not remainder <= closure_tol:
                    accepts, ailment, residual = False, CLOSURE_LOST, remainder
                rows = record(
                    rows, row, time, sample, n, remainder, float(first), knots, coefficients, piece, x, inputs
                )
                row += 1
                if conditions[first, 1] != 0:
                    halted, arrival, residual = True, time, remainder
                    copy(sample, new, n)
            halted = halted and accepts

        # The samples that lie within the step; they count once the step is accepted.
        while accepts and reached < save_at.size and save_at[reached] <= arrival:
            time, remainder, calls = save_at[reached], 0.0, 0
            if time == arrival:
                copy(new, sample, n)
                if closure != 0:
                    remainder, calls = project(closure, sample, z, z_next, closure_tol, True)
            else:
                if not extended:
                    ailment = extend(
                        motion, knots, coefficients, a, c, computed, n, pivot_bound, t, step, piece, y, k, x, sample
                    )  # fmt: skip
                    evaluations += dense.shape[0] - computed
                    extended, accepts = True, ailment == OK
                theta = (time - t) / step
                remainder, calls = state_within(
                    closure, closure_tol, dense, theta, step, y, k, weights, sample, z, z_next
                )
            projections += calls
            if not remainder <= closure_tol:
                accepts, ailment, residual = False, CLOSURE_LOST, remainder
            rows = record(rows, row, time, sample, n, remainder, -1.0, knots, coefficients, piece, x, inputs)
            sampled = max(sampled, remainder)
            row, reached = row + 1, reached + 1

        if accepts:
            accepted += 1
            # A slope is the next step's first unless the inputs may jump here.
            stale = fixed or arrival == target
            t, saved, taken, arrived = arrival, row, reached, True
            copy(new, y, n)
            copy(g_new, g, g.size)
            closure_error = max(closure_error, sampled)
            if trial.pivot < pivot:
                pivot, pivot_time = trial.pivot, trial.pivot_time
            if not fixed:
                first_pivot = trial.last_pivot
                for m in range(n):
                    k[0, m] = k[solution, m]
                factor = SAFETY / max(trial.error, SMALLEST_ERROR) ** (DAMPING * exponent)
                proposal = min(max_step, step * max(SMALLEST_FACTOR, min(growth, factor)))
                h = max(h, proposal) if step < h else proposal
                growth = LARGEST_FACTOR
        else:
            rejected += 1
            growth = 1.0
            if ailment == OK:
                cause = STEP_UNDERFLOW
                h = step * max(SMALLEST_FACTOR, SAFETY / trial.error**exponent)
            else:
                cause = ailment
                rejected_pivot, rejected_residual = trial.pivot, residual
                h = step * RETREAT
                if fixed or (ailment == SINGULAR and first_pivot <= NEAR * pivot_bound):
                    status = ailment

    if closure != 0 and accepted > 0:
        copy(y, sample, n)
        residual, calls = project(closure, sample, z, z_next, closure_tol, True)
        closure_error, projections = max(closure_error, residual), projections + calls
    copy(y, y_end, n)
    counts = (status, evaluations, accepted, rejected, projections, fault, next_sample)
    numbers = (
        t, h, growth, pivot, pivot_time, closure_error, rejected_pivot, rejected_residual,
    )  # fmt: skip
    for i, count in enumerate(counts):
        facts[i] = count
    for i, number in enumerate(numbers):
        facts[len(counts) + i] = number
    return rows[:saved]


_array, _table, _tables = (types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3))
_state = types.Array(types.float64, 1, "C")
_number, _whole = types.float64, types.intp
_SIGNATURE = (
    *(_whole, _whole, _whole, _whole, _whole, _array, _array, _tables, _array),
    *(_table, _array, _table, _table, _whole, _whole, _number),
    *(_table, _number, _number),
    *(_whole, _state, _array, types.boolean, _number, _number, _number, _number, _number, _whole),
    *(_state, _number, _whole, _table, _state),
)


def integrator(what: str, advance: Dispatcher) -> Dispatcher:
    """Return the loop `run` around a method's way to advance by one step, compiled once as part of the method's file."""
    source = advance.py_func.__code__.co_filename
    code = run.__code__.replace(co_filename=source, co_name="integrate", co_qualname="integrate")
    names = globals() | {"advance": advance, "__name__": advance.py_func.__module__}
    function = FunctionType(code, names, "integrate")
    return compiled_once(what, _SIGNATURE)(function)
