"""The integrator's loop, compiled to machine code; it calls the robot's kernels by their addresses.

The state y = (q, v) has n = nq + nv components. The kernels are C functions void(const double *in, double *out):

    motion     in = (q, v, u, p)    out = (q', v', pivot)
    closure    in = (q, p)          out = (q after one Newton step on phi(q) = 0, largest |phi(q)| before it)

One step:  stages 2 .. s-1 of the Runge-Kutta pair;  q of the new state projected onto phi(q) = 0;  stage s there, which is
stage 1 of the next step;  error norm;  the samples inside the step by dense output, projected too;  accept, or shrink.

The error of a component is |h sum_i e_i k_i| plus the distance by which the projection moved it: a projection that carries
the state away, to another assembly mode say, is an error like any other and is refused.

Step sizes: Hairer, Norsett & Wanner, Solving ODE I, sec. II.4 (first step, safety factors); Hairer & Wanner, Solving ODE II,
sec. IV.2 (the PI controller).

Names: `knots`, `coefficients`, `breaks` as in `signals`; `a`, `c`, `e`, `dense` as in `tableaus`; `x` = (q, v, u, p), the
motion kernel's input; `z` = (q, p), the closure kernel's; `k` (s, n + 1), a row (q', v', pivot) for each stage.
Arrays are passed one by one and whole, for Numba would count references to tuples of them and to slices at every step.
All compiled code is in this file, because Numba renews its cache when the file of a function changes.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.status import Status

OK = FINISHED = int(Status.FINISHED)
SINGULAR = int(Status.SINGULAR)
CLOSURE_LOST = int(Status.CLOSURE_LOST)
STEP_UNDERFLOW = int(Status.STEP_UNDERFLOW)
TOO_MANY_STEPS = int(Status.TOO_MANY_STEPS)
NON_FINITE = int(Status.NON_FINITE)

SAFETY = 0.9
SMALLEST_FACTOR, LARGEST_FACTOR = 0.2, 10.0
RETREAT = 0.25  # factor on the step where the equations themselves fail
NEAR = 1.25  # a pivot this close to its bound, relative to it, is at it
PI = 0.04  # exponent of the previous step's error in the controller
SMALLEST_LOG_ERROR = math.log(1e-10)
SMALLEST_PREVIOUS_LOG_ERROR = math.log(1e-4)
ROUNDING = 1e-9
SMALLEST_STEP = 16 * 2.0**-52  # relative to the time and to the duration
NEWTON_CALLS = 8
FIRST_ROWS = 64


class Trial(NamedTuple):
    """What came of a trial step: OK or why the equations failed, the scaled error, the smallest pivot, the cost."""

    ailment: int
    error: float
    pivot: float
    pivot_time: float
    residual: float
    evaluations: int
    projections: int


class Outcome(NamedTuple):
    """What came of a run; a row is (t, q, v, u, residual), the last state is left in y."""

    status: int
    rows: np.ndarray
    time: float
    step: float
    evaluations: int
    accepted: int
    rejected: int
    projections: int
    pivot: float
    pivot_time: float
    closure_error: float
    rejected_pivot: float
    rejected_residual: float


def _call(typing_context, address, x, out, offset):
    """Call the C function void(const double *x, double *out) at an address, its output from out[offset] on."""

    def generate(context, builder, signature, arguments):
        x, out = (context.make_array(signature.args[i])(context, builder, value=arguments[i]).data for i in (1, 2))
        kernel = ir.FunctionType(ir.VoidType(), [x.type, out.type])
        target = builder.gep(out, [arguments[3]])
        builder.call(builder.inttoptr(arguments[0], kernel.as_pointer()), [x, target])
        return context.get_dummy_value()

    return types.void(address, x, out, offset), generate


call: Callable[..., None] = intrinsic(_call)


@njit(forceinline=True, **OPTIONS)
def copy(source, target, count):
    """Copy the first `count` numbers."""
    for m in range(count):
        target[m] = source[m]


@njit(forceinline=True, **OPTIONS)
def combine(weights, i, stages, h, y, k, out):
    """out = y + h sum_(j < stages) weights_ij k_j."""
    for m in range(y.size):
        total = 0.0
        for j in range(stages):
            total += weights[i, j] * k[j, m]
        out[m] = y[m] + h * total


@njit(forceinline=True, **OPTIONS)
def force(knots, c, t, from_left, piece, out, offset):
    """Evaluate the signal at t into out[offset:], and return its piece; `piece` is where to start looking."""
    last = c.shape[0] - 1
    while piece < last and (t > knots[piece + 1] or (t == knots[piece + 1] and not from_left)):
        piece += 1
    while piece > 0 and (t < knots[piece] or (t == knots[piece] and from_left)):
        piece -= 1
    s = t - knots[piece]
    for i in range(c.shape[2]):
        out[offset + i] = c[piece, 0, i] + s * (c[piece, 1, i] + s * (c[piece, 2, i] + s * c[piece, 3, i]))
    return piece


@njit(forceinline=True, **OPTIONS)
def evaluate(motion, x, k, i, pivot_bound):
    """Evaluate k_i = (q', v', pivot) at x = (q, v, u, p); return what its pivot tells: OK, SINGULAR or NON_FINITE."""
    call(motion, x, k, i * k.shape[1])
    pivot = k[i, k.shape[1] - 1]
    if pivot >= pivot_bound:
        return OK
    return NON_FINITE if math.isnan(pivot) else SINGULAR


@njit(**OPTIONS)
def evaluate_first(motion, x, k, pivot_bound):
    """Evaluate k_0, from which no step can retreat, and look at all of its numbers."""
    ailment = evaluate(motion, x, k, 0, pivot_bound)
    for m in range(k.shape[1]):
        if ailment == OK and not math.isfinite(k[0, m]):
            ailment = NON_FINITE
    return ailment


@njit(**OPTIONS)
def project(closure, state, z, z_next, tolerance):
    """Project q, the head of the state, onto phi(q) = 0 by Newton's method in z; return the residual and the calls made.

    The state is written only when |phi(q)| <= tolerance is reached; z is left with what was added to q.
    """
    nq = z_next.size - 1
    residual = math.inf
    copy(state, z, nq)
    for count in range(NEWTON_CALLS):
        call(closure, z, z_next, 0)
        residual = z_next[nq]
        if residual <= tolerance:
            for m in range(nq):
                state[m], z[m] = z[m], z[m] - state[m]
            return residual, count + 1
        copy(z_next, z, nq)
    return residual, NEWTON_CALLS


@njit(**OPTIONS)
def scaled(values, y, rtol, atol):
    """Return the root mean square of values / (atol + rtol |y|)."""
    total = 0.0
    for m in range(y.size):
        total += (values[m] / (atol[m] + rtol[m] * abs(y[m]))) ** 2
    return math.sqrt(total / y.size)


@njit(**OPTIONS)
def first_step(motion, knots, coefficients, exponent, rtol, atol, pivot_bound, t, longest, y, x, k):
    """Guess a first step from the slope here, k_0, and one a little ahead, k_1."""
    size, steepness = scaled(y, y, rtol, atol), scaled(k[0], y, rtol, atol)
    ahead = min(longest, 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness)
    for m in range(y.size):
        x[m] = y[m] + ahead * k[0, m]
    force(knots, coefficients, t + ahead, True, 0, x, y.size)
    if evaluate(motion, x, k, 1, pivot_bound) != OK:
        return ahead
    steepest = max(steepness, scaled(k[1] - k[0], y, rtol, atol) / ahead)
    return min(100 * ahead, max(1e-6, 1e-3 * ahead) if steepest <= 1e-15 else (0.01 / steepest) ** exponent)


@njit(forceinline=True, **OPTIONS)
def attempt(
    motion, closure, knots, coefficients, a, c, e, rtol, atol, pivot_bound, closure_tol, t, h, piece, y, k, x, z, z_next
):
    """Try one step of size h from y at t; leave the new, projected state in x and the slopes in k."""
    n, stages = y.size, c.size
    closed = z_next.size - 1 if closure != 0 else 0
    pivot, pivot_time, residual, projections = math.inf, t, 0.0, 0
    for i in range(1, stages):
        combine(a, i, i, h, y, k, x)
        if closed > 0 and i == stages - 1:
            residual, projections = project(closure, x, z, z_next, closure_tol)
            if not residual <= closure_tol:
                return Trial(CLOSURE_LOST, math.inf, pivot, pivot_time, residual, i - 1, projections)
        time = t + c[i] * h
        piece = force(knots, coefficients, time, True, piece, x, n)
        ailment = evaluate(motion, x, k, i, pivot_bound)
        if k[i, n] < pivot:
            pivot, pivot_time = k[i, n], time
        if ailment != OK:
            return Trial(ailment, math.inf, pivot, pivot_time, residual, i, projections)
    total = 0.0
    for m in range(n):
        defect = 0.0
        for i in range(stages):
            defect += e[i] * k[i, m]
        defect = abs(h * defect) + (abs(z[m]) if m < closed else 0.0)
        total += (defect / (atol[m] + rtol[m] * max(abs(y[m]), abs(x[m])))) ** 2
    ailment = OK if math.isfinite(total) else NON_FINITE  # one number of k that is not finite spoils it: 0 * nan is nan
    return Trial(ailment, math.sqrt(total / n), pivot, pivot_time, residual, stages - 1, projections)


@njit(**OPTIONS)
def blend(dense, theta, weights):
    """weights_i = b_i(theta) = sum_m P_im theta^(m+1), by Horner's rule."""
    for i in range(dense.shape[0]):
        weight = 0.0
        for m in range(dense.shape[1] - 1, -1, -1):
            weight = theta * (weight + dense[i, m])
        weights[0, i] = weight


@njit(**OPTIONS)
def record(knots, coefficients, n, time, piece, y, residual, row):
    """Write (t, q, v, u, residual) into the row."""
    row[0] = time
    copy(y, row[1 : n + 1], n)
    force(knots, coefficients, time, False, piece, row, n + 1)
    row[row.size - 1] = residual


@njit(**OPTIONS)
def resized(rows, size):
    """Return the rows in a table of another length."""
    table = np.empty((size, rows.shape[1]))
    for i in range(min(size, rows.shape[0])):
        copy(rows[i], table[i], rows.shape[1])
    return table


_array, _table, _tables = (types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3))
_state = types.Array(types.float64, 1, "C")
_number, _whole = types.float64, types.intp
_SIGNATURE = (
    *(_whole, _whole, _array, _array, _tables, _array),
    *(_table, _array, _array, _table, _number),
    *(_array, _array, _number, _number),
    *(_whole, _state, _array, types.boolean, _number, _number, _number, _number, _whole),
)


@compiled_once("the integrator", _SIGNATURE)
def integrate(
    motion, closure, p, knots, coefficients, breaks,
    a, c, e, dense, exponent,
    rtol, atol, pivot_bound, closure_tol,
    nq, y, save_at, every_step, start, stop, max_step, h, max_steps,
):  # fmt: skip
    """Integrate from y at start to stop, leaving the last state in y; h <= 0 asks for a guess of the first step.

    `exponent` = 1 / (order of the error estimate + 1); rtol and atol are arrays (n,).
    """
    n, stages = y.size, c.size
    x, z, z_next = np.zeros(n + coefficients.shape[2] + p.size), np.zeros(nq + p.size), np.zeros(nq + 1)
    copy(p, x[x.size - p.size :], p.size)
    copy(p, z[nq:], p.size)
    k, weights, sample = np.zeros((stages, n + 1)), np.empty((1, stages)), np.empty(n)
    rows = np.empty((FIRST_ROWS if every_step else save_at.size, n + coefficients.shape[2] + 2))
    saved = next_break = evaluations = accepted = rejected = projections = 0
    closure_error = rejected_residual = 0.0
    t, cause, growth, previous_log_error = start, STEP_UNDERFLOW, LARGEST_FACTOR, SMALLEST_PREVIOUS_LOG_ERROR
    smallest_step = SMALLEST_STEP * max(stop, stop - start)

    # The state at the start.
    status = OK
    if closure != 0:
        closure_error, projections = project(closure, y, z, z_next, closure_tol)
        rejected_residual = closure_error
        if not closure_error <= closure_tol:
            status = CLOSURE_LOST
    copy(y, x, n)
    piece = force(knots, coefficients, t, False, 0, x, n)
    if status == OK:
        status = evaluate_first(motion, x, k, pivot_bound)
        evaluations += 1
    pivot, pivot_time, rejected_pivot = k[0, n], t, k[0, n]
    if every_step or (save_at.size > 0 and save_at[0] == t):
        record(knots, coefficients, n, t, piece, y, closure_error, rows[0])
        saved = 1
    while next_break < breaks.size and breaks[next_break] <= t:
        next_break += 1
    target = min(stop, breaks[next_break]) if next_break < breaks.size else stop
    if status == OK and h <= 0:
        h = first_step(motion, knots, coefficients, exponent, rtol, atol, pivot_bound, t, target - t, y, x, k)
        evaluations += 1
    h = min(h, max_step)

    while status == OK and t < stop:
        if accepted + rejected == max_steps:
            status = TOO_MANY_STEPS
            break
        if h < smallest_step:
            status = cause
            break
        # A step lands on the target (short of it by rounding only counts), or goes half of the way rather than leave a sliver.
        gap = target - t
        step = gap if h * (1 + ROUNDING) >= gap else min(h, gap / 2)
        arrival = target if step == gap else t + step
        trial = attempt(
            motion, closure, knots, coefficients, a, c, e, rtol, atol, pivot_bound, closure_tol,
            t, step, piece, y, k, x, z, z_next,
        )  # fmt: skip
        evaluations += trial.evaluations
        projections += trial.projections
        ailment, residual = trial.ailment, trial.residual
        accepts = ailment == OK and trial.error <= 1

        # The samples that lie within the step; they count once the step is accepted.
        reached, sampled = saved, residual
        while accepts and reached < save_at.size and save_at[reached] <= arrival:
            time, row = save_at[reached], rows[reached]
            if time == arrival:
                record(knots, coefficients, n, time, piece, x, residual, row)
            else:
                blend(dense, (time - t) / step, weights)
                combine(weights, 0, stages, step, y, k, sample)
                remainder = 0.0
                if closure != 0:
                    remainder, calls = project(closure, sample, z, z_next, closure_tol)
                    projections += calls
                    if not remainder <= closure_tol:
                        accepts, ailment, residual = False, CLOSURE_LOST, remainder
                record(knots, coefficients, n, time, piece, sample, remainder, row)
                sampled = max(sampled, remainder)
            reached += 1

        if accepts:
            accepted += 1
            t, saved = arrival, reached
            copy(x, y, n)
            copy(k[stages - 1], k[0], n + 1)
            closure_error = max(closure_error, sampled)
            if trial.pivot < pivot:
                pivot, pivot_time = trial.pivot, trial.pivot_time
            piece = force(knots, coefficients, t, False, piece, x, n)
            if every_step:
                if saved == rows.shape[0]:
                    rows = resized(rows, 2 * saved)
                record(knots, coefficients, n, t, piece, y, residual, rows[saved])
                saved += 1
            # h_next / h = SAFETY error_previous^PI / error^(exponent - 0.75 PI)
            log_error = max(math.log(trial.error), SMALLEST_LOG_ERROR)
            factor = SAFETY * math.exp(PI * previous_log_error - (exponent - 0.75 * PI) * log_error)
            proposal = min(max_step, step * max(SMALLEST_FACTOR, min(growth, factor)))
            h = max(h, proposal) if step < h else proposal
            growth, previous_log_error = LARGEST_FACTOR, max(log_error, SMALLEST_PREVIOUS_LOG_ERROR)
            if t == target and t < stop:  # the forces may jump: the last slope is not the next step's first
                status, rejected_pivot = evaluate_first(motion, x, k, pivot_bound), k[0, n]
                evaluations += 1
                next_break += 1
                target = min(stop, breaks[next_break]) if next_break < breaks.size else stop
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
                if ailment == SINGULAR and k[0, n] <= NEAR * pivot_bound:
                    status = SINGULAR

    if every_step:
        rows = resized(rows, saved)
    return Outcome(
        status, rows[:saved], t, h, evaluations, accepted, rejected, projections,
        pivot, pivot_time, closure_error, rejected_pivot, rejected_residual,
    )  # fmt: skip
