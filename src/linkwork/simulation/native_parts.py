"""Parts of the integrators' loop, compiled to machine code; kernels are called by their addresses.

The state y = (q, v, z) has n components, of which the first nq are q. The kernels are C functions
void(const double *in, double *out):

    motion    in = (y, u, p)  out = (y', pivot)
    closure   in = (q, p)     out = (q after one Newton step on phi(q) = 0, largest |phi(q)| before)
    jacobian  in = (y, u, p)  out = (df/dy by columns, n n;  df/du by columns, n nu)
    events    in = (y, u, p)  out = g, one number for each event
    control   in = (y, u, p)  out = the held inputs, the last columns of u
    search    in = `run`, of which it takes the events within a step: that of `native_search`

`run` is the structure `native_memory.Integration`: groups of pointers and numbers, and how far the
run has come. States and the rows of `k` are padded with zeros to whole vectors.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.pointers import call, combine
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import LANES
from linkwork.simulation.turns import HIGH, LOW, MIDDLE, TURN

OK = FINISHED = int(Status.FINISHED)
SINGULAR = int(Status.SINGULAR)
CLOSURE_LOST = int(Status.CLOSURE_LOST)
NON_FINITE = int(Status.NON_FINITE)

NEWTON_CALLS = 8
REFUSED = 1e300  # error of a step that may not be, whatever its error
ROUNDING = 1e-9  # of a step or a period, by which a time may miss another one
RESERVE = 100.0
"""A Newton step d leaves a residual of about d^2; below tolerance / RESERVE it need not be
measured."""


class Kernels(NamedTuple):
    """Addresses of the kernels, 0 where there is none."""

    motion: int
    closure: int
    jacobian: int
    events: int
    control: int
    search: int


class Inputs(NamedTuple):
    """Signals u over time as in `signals`: `knots` (pieces + 1,), `coefficients`
    (pieces, 4, columns)."""

    knots: Any
    coefficients: Any
    pieces: int
    columns: int


@njit(**INLINED)
def inputs_of(table):
    """Return the signals that a `Signal.table` holds, and what follows them there."""
    pieces, columns = int(table[0]), int(table[1])
    coefficients = table + pieces + 5
    return Inputs(table + 4, coefficients, pieces, columns), coefficients + 4 * pieces * columns


class Method(NamedTuple):
    """A method as in `tableaus.StepPlan`: `stages`, how many rows k has; `degree` of the dense
    output; `estimates`, rows of e."""

    a: Any
    c: Any
    e: Any
    dense: Any
    stages: int
    degree: int
    estimates: int
    solution: int
    computed: int
    exponent: float
    blur: float


@njit(**INLINED)
def method_of(table):
    """Return the `Method` that a `tableaus.StepPlan.table` holds."""
    stages, degree, estimates = int(table[0]), int(table[1]), int(table[2])
    a = table + 7
    c = a + stages * stages
    e = c + stages
    dense = e + estimates * stages
    solution, computed, exponent, blur = int(table[3]), int(table[4]), table[5], table[6]
    return Method(
        a, c, e, dense, stages, degree, estimates, solution, computed, exponent, blur
    )  # fmt: skip


class StepLimits(NamedTuple):
    """What is asked of steps: `rtol` and `atol` (n,), the bounds of the pivot, of the closure's
    residual at ordinary q, and of the length; `stability`: h |lambda| from which a step is taken
    for stiff, or 0: stiffness is not looked for."""

    rtol: Any
    atol: Any
    pivot_bound: float
    closure_tol: float
    stability: float
    max_step: float


class Turns(NamedTuple):
    """Whole turns of q as in `turns.Turning`: `spans`, `wraps` and what is counted so far (nq,)."""

    spans: Any
    wraps: Any
    counted: Any


class Room(NamedTuple):
    """Where the loop computes.

    `y`, `new`: states at the start of a step and at its end; `sample`: a state within, or the
    defect; `k`: a row y' for each stage, `width` numbers apart; `x` = (y, u, p), what most kernels
    take; `z` = (q, p), what the closure takes, and `z_next`, what it gives; `powers`, of theta, and
    `weights`, one for each stage; `zeros`: as many as a state or weights have; `work`: for stiff
    methods. `inputs`: how many u there are.
    """

    y: Any
    new: Any
    sample: Any
    k: Any
    x: Any
    z: Any
    z_next: Any
    powers: Any
    weights: Any
    zeros: Any
    work: Any
    n: int
    nq: int
    width: int
    inputs: int


@njit(**INLINED)
def padded(count):
    """Return the length of rows that hold `count` numbers in whole vectors."""
    return (count + LANES - 1) // LANES * LANES


@njit(**INLINED)
def copy(source, target, count):
    """Copy the first `count` numbers."""
    for m in range(count):
        target[m] = source[m]


@njit(**INLINED)
def turns_in(angle):
    """Return how many whole turns an angle has, to the nearest."""
    return math.floor(angle / TURN + 0.5)


@njit(**INLINED)
def without(angle, turns):
    """Return an angle less its whole turns."""
    return angle - turns * HIGH - turns * MIDDLE - turns * LOW


@njit(**INLINED)
def whole(angle, turns):
    """Return an angle with its whole turns."""
    return turns * HIGH + (angle + turns * MIDDLE + turns * LOW)


@njit(**OPTIONS)
def settle(state, turns, nq):
    """Count the whole turns of large angles apart; return the factor on the closure's tolerance
    that other coordinates ask."""
    looser = 1.0
    for m in range(nq):
        if abs(state[m]) > turns.spans[m]:
            if turns.wraps[m] > 0:
                count = turns_in(state[m])
                state[m] = without(state[m], count)
                turns.counted[m] += count
            else:
                looser = max(looser, abs(state[m]) / turns.spans[m])
    return looser


@njit(**OPTIONS)
def add_turns(state, turns, nq):
    """Give the angles at the head of a state their whole turns back."""
    for m in range(nq):
        if turns.counted[m] != 0.0:
            state[m] = whole(state[m], turns.counted[m])


@njit(**INLINED)
def force(inputs, t, from_left, piece, out):
    """Evaluate the signals at t into out, and return their piece; `piece` is where to start
    looking."""
    knots, columns, last = inputs.knots, inputs.columns, inputs.pieces - 1
    while piece < last and (t > knots[piece + 1] or (t == knots[piece + 1] and not from_left)):
        piece += 1
    while piece > 0 and (t < knots[piece] or (t == knots[piece] and from_left)):
        piece -= 1
    s, c = t - knots[piece], inputs.coefficients + 4 * columns * piece
    for i in range(columns):
        out[i] = c[i] + s * (c[columns + i] + s * (c[2 * columns + i] + s * c[3 * columns + i]))
    return piece


@njit(**INLINED)
def acting_from(run, t):
    """Return the time of which the inputs act from t on: that of a break which a fixed step has
    reached but for rounding."""
    (breaks, count, length), i = run.schedule, run.next_break
    while i < count and breaks[i] <= t + ROUNDING * length:
        i += 1
    return max(t, breaks[i - 1]) if length > 0 and i > 0 else t


@njit(**INLINED)
def evaluate(run, i):
    """Evaluate k_i = y' at x; return what the pivot tells, OK, SINGULAR or NON_FINITE, and the
    pivot."""
    room = run.room
    slope = room.k + i * room.width
    call(run.kernels.motion, room.x, slope)
    run.evaluations += 1
    pivot = slope[room.n]
    slope[room.n] = 0.0
    bound = run.limits.pivot_bound
    return (OK if pivot >= bound else NON_FINITE if math.isnan(pivot) else SINGULAR), pivot


@njit(**OPTIONS)
def first_fault(run, rows):
    """Return the first component of y' that is not finite in the first rows of k, or n, the pivot's
    place."""
    k, n, width = run.room.k, run.room.n, run.room.width
    for i in range(rows):
        for m in range(n):
            if not math.isfinite(k[i * width + m]):
                return m
    return n


@njit(**OPTIONS)
def unclosed(run, residual, rows):
    """Return why a state cannot be closed: the slopes that lead to it, the first rows of k, are not
    finite, or its loops."""
    undefined = math.isnan(residual) and first_fault(run, rows) < run.room.n
    return NON_FINITE if undefined else CLOSURE_LOST


@njit(**OPTIONS)
def project(run, measured, state):
    """Project q, the head of a state, onto phi(q) = 0 by Newton's method in z; return the residual.

    The state is written only when |phi(q)| is within the tolerance, run.loose; z is left with what
    was added to q. Unless the residual is `measured`, a step d with RESERVE d^2 <= run.loose is the
    last, and 0 is returned (if the residual before is as small: a step to nowhere is none).
    """
    closure, tolerance = run.kernels.closure, run.loose
    nq, z, z_next = run.room.nq, run.room.z, run.room.z_next
    residual = math.inf
    copy(state, z, nq)
    for _ in range(NEWTON_CALLS):
        call(closure, z, z_next)
        run.projections += 1
        residual = z_next[nq]
        if residual <= tolerance:
            for m in range(nq):
                state[m], z[m] = z[m], z[m] - state[m]
            return residual
        longest = residual
        for m in range(nq):
            longest = max(longest, abs(z_next[m] - z[m]))
        copy(z_next, z, nq)
        if not measured and RESERVE * longest * longest <= tolerance:
            for m in range(nq):
                state[m], z[m] = z[m], z[m] - state[m]
            return 0.0
    return residual


@njit(**OPTIONS)
def error_norm(run, defect, h, closed):
    """Return the root mean square of (|h defect| + |moved|) / (atol + rtol |y|), with |moved| that
    of the projection."""
    total, n, y, new, z = 0.0, run.room.n, run.room.y, run.room.new, run.room.z
    rtol, atol = run.limits.rtol, run.limits.atol
    for m in range(n):
        error = abs(h * defect[m]) + (abs(z[m]) if m < closed else 0.0)
        total += (error / (atol[m] + rtol[m] * max(abs(y[m]), abs(new[m])))) ** 2
    return math.sqrt(total / n)


@njit(**OPTIONS)
def scaled(run, values):
    """Return the root mean square of values / (atol + rtol |y|)."""
    total, n, y, rtol, atol = 0.0, run.room.n, run.room.y, run.limits.rtol, run.limits.atol
    for m in range(n):
        total += (values[m] / (atol[m] + rtol[m] * abs(y[m]))) ** 2
    return math.sqrt(total / n)


@njit(**OPTIONS)
def record(run, time, state, residual, event):
    """Write the next row (t, y, u, residual, event)."""
    room, inputs = run.room, run.inputs
    n, last, row = room.n, 1 + room.n + room.inputs, run.rows + run.row * run.columns
    row[0] = time
    copy(state, row + 1, n)
    add_turns(row + 1, run.turns, room.nq)
    force(inputs, acting_from(run, time), False, run.piece, row + 1 + n)
    for i in range(inputs.columns, room.inputs):
        row[1 + n + i] = room.x[n + i]
    row[last], row[last + 1] = residual, event
    run.row += 1


@njit(**OPTIONS)
def stiffness(run):
    """Return h |k_s - k_(s-1)| / |y_s - y_(s-1)|, about h times the largest |eigenvalue|, of the
    last two stages of a step, both at its end. Source: Hairer & Wanner, Solving ODE II, sec. IV.2.
    """
    room, method, h = run.room, run.method, run.step
    n, width, k, new, last = room.n, room.width, room.k, room.new, method.solution
    rtol, atol, sample = run.limits.rtol, run.limits.atol, room.sample
    combine(method.a + (last - 1) * method.stages, last - 1, h, room.y, k, width, n, sample)
    above = below = 0.0
    for m in range(n):
        scale = atol[m] + rtol[m] * abs(new[m])
        above += ((k[last * width + m] - k[(last - 1) * width + m]) / scale) ** 2
        below += ((new[m] - sample[m]) / scale) ** 2
    return h * math.sqrt(above / below) if below > 0 else 0.0


@njit(**OPTIONS)
def interpolate(run, theta):
    """Leave y + h sum_i b_i(theta) k_i in the sample, with b_i(theta) = sum_m P_im theta^(m+1)."""
    method, room, power = run.method, run.room, 1.0
    powers, weights, stages = room.powers, room.weights, method.stages
    for m in range(method.degree):
        power *= theta
        powers[m] = power
    combine(powers, method.degree, 1.0, room.zeros, method.dense, padded(stages), stages, weights)
    combine(weights, stages, run.step, room.y, room.k, room.width, room.n, room.sample)


@njit(**OPTIONS)
def extend(run):
    """Evaluate the stages that only the dense output needs, where they are pending; return OK or
    why the equations fail there.

    All of them are counted, whichever fails.
    """
    method, room, ailment, counted = run.method, run.room, OK, run.evaluations + run.pending
    for i in range(method.stages - run.pending, method.stages):
        combine(
            method.a + i * method.stages, i, run.step, room.y, room.k, room.width, room.n, room.x
        )
        force(run.inputs, run.t + method.c[i] * run.step, True, run.piece, room.x + room.n)
        ailment, _ = evaluate(run, i)
        if ailment != OK:
            break
    run.evaluations, run.pending = counted, 0
    return ailment
