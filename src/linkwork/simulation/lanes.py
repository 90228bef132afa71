"""Integrate many members at a time by Dormand-Prince 5(4): the loop of `native_loop`, with a member in each lane.

Each lane has its own time, step size and end. When a member ends the next one is loaded into its lane, so that the
registers stay full. What a member goes through is what it goes through alone: the same arithmetic in the same order,
lane by lane, so that no member depends on its neighbours. The kernels are C functions
void(int64 blocks, const double *in, double *out) for blocks of LANES states:

    motion     in = (y, u, p)    out = (y', pivot)
    closure    in = (q, p)       out = (q after one Newton step on phi(q) = 0, largest |phi(q)| before it)

Members start in blocks of LANES (`start_block`): q is closed, the first slope evaluated, the first step guessed. Then
all lanes go step by step together: `choose_steps`, `attempt`, `take_samples`, `accept` or `reject`, `restart`.

Names: `x`, rows (y, u, p); `k`, rows (y', pivot), stage after stage; `z`, rows (q, p); all (rows, LANES). `now` and `tally`
hold numbers and counts of the members in the lanes, `numbers` and `counts` those of all members, a row each, of which
the first NUMBERS and COUNTS are the same. The members' signals lie one after the other: signal i consists of the
pieces from `pieces[i]` to `pieces[i + 1]`, which begin at `starts`, and of the breaks from `breaking[i]` to
`breaking[i + 1]`; with one signal, or one row of p, all members share it.
"""

import math

import numpy as np
from numba import njit, types

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_loop import (
    DAMPING,
    LARGEST_FACTOR,
    NEAR,
    RETREAT,
    ROUNDING,
    SAFETY,
    SMALLEST_ERROR,
    SMALLEST_FACTOR,
    SMALLEST_STEP,
    STEP_UNDERFLOW,
    TOO_MANY_STEPS,
)  # fmt: skip
from linkwork.simulation.native_parts import CLOSURE_LOST, NEWTON_CALLS, NON_FINITE, OK, RESERVE, SINGULAR
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import DORMAND_PRINCE
from linkwork.simulation.vectors import (
    LANES,
    absolute,
    call_batch,
    choose,
    every,
    larger,
    load,
    root,
    smaller,
    splat,
    store,
)

CANCELLED = int(Status.CANCELLED)

# Rows of `now`; the first NUMBERS are columns of `numbers`, too.
TIME, STEP_SIZE, GROWTH, PIVOT, CLOSURE_ERROR, REJECTED_PIVOT, REJECTED_RESIDUAL = range(7)
NUMBERS = 7
STEP, ARRIVAL, TARGET, LIVE, ERROR, RESIDUAL, LOWEST, ACCEPTS, WANTED, THETA, POWER = range(7, 18)
NOW = 18

# Rows of `tally`; the first COUNTS are columns of `counts`, too.
STATUS, EVALUATIONS, ACCEPTED, REJECTED, SAVED, CAUSE, PIECE, BREAK = range(8)
COUNTS = 8
MEMBER, REACHED, AILMENT = range(8, 11)
TALLY = 11

ALIGNMENT = 64

# Constants to the compiler, which unrolls the sums over the stages.
A, C, E, DENSE = DORMAND_PRINCE.a, DORMAND_PRINCE.c, DORMAND_PRINCE.e, DORMAND_PRINCE.dense
STAGES, EXPONENT = len(C), 1 / (DORMAND_PRINCE.error_order + 1)


@njit(**OPTIONS)
def room(rows):
    """Return zeros (rows, LANES) that start at a multiple of ALIGNMENT bytes."""
    memory = np.zeros(rows * LANES + ALIGNMENT // 8)
    first = -memory.ctypes.data % ALIGNMENT // 8
    return memory[first : first + rows * LANES].reshape(rows, LANES)


@njit(forceinline=True, **OPTIONS)
def shared(i, rows):
    """Return the row of member i in a table of which one row may serve all."""
    return i if rows > 1 else 0


@njit(forceinline=True, **OPTIONS)
def force(starts, c, pieces, i, t, from_left, x, n, lane, tally):
    """Evaluate signal i at t into x[n:] of the lane, and keep its piece, from which to look for the next."""
    first, last = pieces[i], pieces[i + 1] - 1
    piece = max(tally[PIECE, lane], first)
    while piece < last and (t > starts[piece + 1] or (t == starts[piece + 1] and not from_left)):
        piece += 1
    while piece > first and (t < starts[piece] or (t == starts[piece] and from_left)):
        piece -= 1
    tally[PIECE, lane] = piece
    s = t - starts[piece]
    for j in range(c.shape[2]):
        x[n + j, lane] = c[piece, 0, j] + s * (c[piece, 1, j] + s * (c[piece, 2, j] + s * c[piece, 3, j]))


@njit(forceinline=True, **OPTIONS)
def next_target(breaks, breaking, i, tally, t, start, stop, lane):
    """Return the next time at which a step has to end."""
    while tally[BREAK, lane] < breaking[i + 1] and breaks[tally[BREAK, lane]] <= t + ROUNDING * (t - start):
        tally[BREAK, lane] += 1
    return min(stop, breaks[tally[BREAK, lane]]) if tally[BREAK, lane] < breaking[i + 1] else stop


@njit(**OPTIONS)
def project(closure, state, z, z_next, now, tolerance, reserve):
    """Project q, the head of the state, onto phi(q) = 0 by Newton's method in z, in the lanes where now[WANTED] > 0.

    As in `native_parts`: a lane's q is written only when its residual, left in now[RESIDUAL], is within the tolerance;
    z is left with what was added to q. A step d with reserve d^2 <= tolerance is the last, its residual taken for 0 (if
    the residual before it is as small).
    """
    nq = z_next.shape[0] - 1
    limit, residual = splat(tolerance), splat(math.inf)
    done = load(now, WANTED) <= splat(0.0)
    for m in range(nq):
        store(z, m, load(state, m))
    for _ in range(NEWTON_CALLS):
        call_batch(closure, z, z_next, 0)
        residual = choose(done, residual, load(z_next, nq))
        done = done | (residual <= limit)
        if every(done):
            break
        longest = load(z_next, nq)
        for m in range(nq):
            longest = larger(absolute(load(z_next, m) - load(z, m)), longest)
            overwrite(z, m, going, load(z_next, m))
        close = splat(reserve) * longest * longest <= limit
        residual = choose(done, residual, choose(close, splat(0.0), residual))
        done = done | close
        if every(done):
            break
    for m in range(nq):
        before, after = load(state, m), load(z, m)
        store(state, m, choose(done, after, before))
        store(z, m, after - before)
    store(now, RESIDUAL, residual)


@njit(**OPTIONS)
def scaled(values, row, y, tolerance):
    """Return the root mean square of values / (atol + rtol |y|), the values from a row on."""
    n = tolerance.shape[1]
    total = splat(0.0)
    for m in range(n):
        scale = splat(tolerance[1, m]) + splat(tolerance[0, m]) * absolute(load(y, m))
        ratio = load(values, row + m) / scale
        total = total + ratio * ratio
    return root(total / splat(float(n)))


@njit(**OPTIONS)
def combine(i, now, y, k, x):
    """x = y + h sum_(j < i) a_ij k_j, with the step h of each lane."""
    n, h = y.shape[0], load(now, STEP)
    for m in range(n):
        total = splat(0.0)
        for j in range(i):
            total = total + splat(A[i, j]) * load(k, j * (n + 1) + m)
        store(x, m, load(y, m) + h * total)


@njit(**OPTIONS)
def first_ailment(k, stage, n, lane, pivot_bound):
    """Return what a stage's numbers tell of a slope from which no step can retreat: OK, SINGULAR or NON_FINITE."""
    pivot = k[stage * (n + 1) + n, lane]
    if not pivot >= pivot_bound:
        return NON_FINITE if math.isnan(pivot) else SINGULAR
    for m in range(n):
        if not math.isfinite(k[stage * (n + 1) + m, lane]):
            return NON_FINITE
    return OK


@njit(**OPTIONS)
def start_block(
    motion, closure, parameters, starts, coefficients, pieces, breaks, breaking,
    tolerance, pivot_bound, closure_tol, start, stop, max_step, first, ys, slopes, numbers, counts,
    y, x, z, z_next, k, now, tally,
):  # fmt: skip
    """Close q, evaluate the first slope and guess the first step of the members from `first` on, one for each lane."""
    n, inputs, nq = ys.shape[1], coefficients.shape[2], z_next.shape[0] - 1
    members = ys.shape[0]
    for lane in range(LANES):
        i = min(first + lane, members - 1)
        signal, row = shared(i, pieces.size - 1), shared(i, parameters.shape[0])
        for m in range(n):
            y[m, lane] = ys[i, m]
        for m in range(parameters.shape[1]):
            x[n + inputs + m, lane] = z[nq + m, lane] = parameters[row, m]
        now[WANTED, lane] = 1.0
        tally[STATUS, lane], tally[EVALUATIONS, lane], tally[BREAK, lane] = OK, 0, breaking[signal]
        tally[PIECE, lane] = 0
        force(starts, coefficients, pieces, signal, start, False, x, n, lane, tally)
        now[TARGET, lane] = next_target(breaks, breaking, signal, tally, start, start, stop, lane)
        now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = now[STEP_SIZE, lane] = 0.0
    if closure != 0:
        project(closure, y, z, z_next, now, closure_tol, math.inf)
        for lane in range(LANES):
            now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = now[RESIDUAL, lane]
            if not now[RESIDUAL, lane] <= closure_tol:
                tally[STATUS, lane] = CLOSURE_LOST
    for m in range(n):
        store(x, m, load(y, m))
    call_batch(motion, x, k, 0)
    for lane in range(LANES):
        now[PIVOT, lane] = math.inf
        now[REJECTED_PIVOT, lane] = 0.0
        if tally[STATUS, lane] == OK:
            tally[STATUS, lane], tally[EVALUATIONS, lane] = first_ailment(k, 0, n, lane, pivot_bound), 1
            now[PIVOT, lane] = now[REJECTED_PIVOT, lane] = k[n, lane]

    # The first step, from the slope here, k_0, and one a little ahead, k_1.
    store(now, ERROR, scaled(y, 0, y, tolerance))
    store(now, LOWEST, scaled(k, 0, y, tolerance))
    for lane in range(LANES):
        size, steepness = now[ERROR, lane], now[LOWEST, lane]
        ahead = 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness
        now[STEP, lane] = min(now[TARGET, lane] - start, ahead)
        signal = shared(min(first + lane, members - 1), pieces.size - 1)
        force(starts, coefficients, pieces, signal, start + now[STEP, lane], True, x, n, lane, tally)
    for m in range(n):
        store(x, m, load(y, m) + load(now, STEP) * load(k, m))
    call_batch(motion, x, k, n + 1)
    store(now, RESIDUAL, load(k, 2 * n + 1))
    for m in range(n):
        store(k, n + 1 + m, load(k, n + 1 + m) - load(k, m))
    store(now, ERROR, scaled(k, n + 1, y, tolerance))
    for lane in range(LANES):
        if tally[STATUS, lane] == OK:
            ahead, steepness = now[STEP, lane], now[LOWEST, lane]
            h = ahead
            if now[RESIDUAL, lane] >= pivot_bound:
                steepest = max(steepness, now[ERROR, lane] / ahead)
                h = max(1e-6, 1e-3 * ahead) if steepest <= 1e-15 else (0.01 / steepest) ** EXPONENT
                h = min(100 * ahead, h)
            now[STEP_SIZE, lane] = min(h, max_step)
            tally[EVALUATIONS, lane] += 1

    for lane in range(min(LANES, members - first)):
        i = first + lane
        now[TIME, lane], now[GROWTH, lane] = start, LARGEST_FACTOR
        tally[ACCEPTED, lane] = tally[REJECTED, lane] = tally[SAVED, lane] = 0
        tally[CAUSE, lane] = STEP_UNDERFLOW
        for m in range(n):
            ys[i, m], slopes[i, m] = y[m, lane], k[m, lane]
        slopes[i, n] = k[n, lane]
        for m in range(NUMBERS):
            numbers[i, m] = now[m, lane]
        for m in range(COUNTS):
            counts[i, m] = tally[m, lane]


@njit(**OPTIONS)
def load_member(
    i, lane, parameters, starts, coefficients, pieces, breaks, breaking, start, stop, ys, slopes, numbers, counts,
    save_at, samples, y, x, z, k, now, tally,
):  # fmt: skip
    """Put a started member into a lane."""
    n, inputs, nq = ys.shape[1], coefficients.shape[2], z.shape[0] - parameters.shape[1]
    signal, row = shared(i, pieces.size - 1), shared(i, parameters.shape[0])
    for m in range(n):
        y[m, lane], k[m, lane] = ys[i, m], slopes[i, m]
    k[n, lane] = slopes[i, n]
    for m in range(parameters.shape[1]):
        x[n + inputs + m, lane] = z[nq + m, lane] = parameters[row, m]
    for m in range(NUMBERS):
        now[m, lane] = numbers[i, m]
    for m in range(COUNTS):
        tally[m, lane] = counts[i, m]
    tally[MEMBER, lane] = i
    force(starts, coefficients, pieces, signal, start, False, x, n, lane, tally)
    now[TARGET, lane] = next_target(breaks, breaking, signal, tally, start, start, stop, lane)
    if save_at.size > 0 and save_at[0] == start:
        for m in range(n):
            samples[i, 0, m] = ys[i, m]
        tally[SAVED, lane] = 1


@njit(**OPTIONS)
def store_member(lane, ys, numbers, counts, y, now, tally):
    """Keep what the member in a lane has come to."""
    i = tally[MEMBER, lane]
    for m in range(ys.shape[1]):
        ys[i, m] = y[m, lane]
    for m in range(NUMBERS):
        numbers[i, m] = now[m, lane]
    for m in range(COUNTS):
        counts[i, m] = tally[m, lane]


@njit(forceinline=True, **OPTIONS)
def ended(lane, now, tally, stop, smallest_step, max_steps):
    """Tell whether the member in a lane has ended, and note how."""
    if tally[STATUS, lane] != OK or now[TIME, lane] >= stop:
        return True
    if tally[ACCEPTED, lane] + tally[REJECTED, lane] >= max_steps:
        tally[STATUS, lane] = TOO_MANY_STEPS
        return True
    if now[STEP_SIZE, lane] < smallest_step:
        tally[STATUS, lane] = tally[CAUSE, lane]
        return True
    return False


@njit(**OPTIONS)
def choose_steps(now):
    """Let the steps land on their targets, or go half of the way rather than leave slivers; idle lanes stay."""
    t, h, target = load(now, TIME), load(now, STEP_SIZE), load(now, TARGET)
    gap = target - t
    half = gap * splat(0.5)
    lands = h * splat(1 + ROUNDING) >= gap
    step = choose(lands, gap, smaller(h, half))
    store(now, STEP, choose(load(now, LIVE) >= splat(1.0), step, splat(0.0)))
    store(now, ARRIVAL, choose(lands, target, t + step))


@njit(forceinline=True, **OPTIONS)
def set_forces(i, starts, coefficients, pieces, x, n, now, tally):
    """Evaluate the signals of all lanes at the time of stage i."""
    for lane in range(LANES):
        if now[LIVE, lane] > 0:
            signal, time = shared(tally[MEMBER, lane], pieces.size - 1), now[TIME, lane] + C[i] * now[STEP, lane]
            force(starts, coefficients, pieces, signal, time, True, x, n, lane, tally)


@njit(**OPTIONS)
def error_norm(closed, tolerance, now, y, x, z, k):
    """Return the root mean square of (|h sum_i e_i k_i| + |moved by the projection|) / (atol + rtol |y|)."""
    n, h = y.shape[0], load(now, STEP)
    total = splat(0.0)
    for m in range(n):
        defect = splat(0.0)
        for i in range(STAGES):
            defect = defect + splat(E[i]) * load(k, i * (n + 1) + m)
        error = absolute(h * defect)
        if m < closed:
            error = error + absolute(load(z, m))
        size = larger(absolute(load(y, m)), absolute(load(x, m)))
        ratio = error / (splat(tolerance[1, m]) + splat(tolerance[0, m]) * size)
        total = total + ratio * ratio
    return root(total / splat(float(n)))


@njit(**OPTIONS)
def attempt(
    motion, closure, starts, coefficients, pieces, timed, tolerance, pivot_bound, closure_tol,
    y, x, z, z_next, k, now, tally,
):  # fmt: skip
    """Try one step in every lane; leave the new, projected states in x, the slopes in k and the errors in now[ERROR].

    The error is not a number where the equations fail.
    """
    n, closed = y.shape[0], z_next.shape[0] - 1 if closure != 0 else 0
    for i in range(1, STAGES):
        # One call for each stage, so that each is compiled as one chain of products.
        if i == 1:
            combine(1, now, y, k, x)
        elif i == 2:
            combine(2, now, y, k, x)
        elif i == 3:
            combine(3, now, y, k, x)
        elif i == 4:
            combine(4, now, y, k, x)
        elif i == 5:
            combine(5, now, y, k, x)
        else:
            combine(6, now, y, k, x)
            store(now, RESIDUAL, splat(0.0))
            if closed > 0:
                project(closure, x, z, z_next, now, closure_tol, RESERVE)
        if timed:
            set_forces(i, starts, coefficients, pieces, x, n, now, tally)
        call_batch(motion, x, k, i * (n + 1))
    bound, lowest = splat(pivot_bound), splat(math.inf)
    healthy = load(now, RESIDUAL) <= splat(closure_tol)
    for i in range(1, STAGES):
        pivot = load(k, i * (n + 1) + n)
        healthy = healthy & (pivot >= bound)
        lowest = choose(lowest <= pivot, lowest, pivot)
    store(now, ERROR, choose(healthy, error_norm(closed, tolerance, now, y, x, z, k), splat(math.nan)))
    store(now, LOWEST, lowest)


@njit(**OPTIONS)
def diagnose(lane, k, n, pivot_bound, closure_tol, now, tally):
    """Find why the equations fail in a lane's trial step, in the order of the stages; count the evaluations up to it."""
    lowest = math.inf
    tally[AILMENT, lane], tally[EVALUATIONS, lane] = NON_FINITE, tally[EVALUATIONS, lane] + STAGES - 1
    for i in range(1, STAGES):
        if i == STAGES - 1 and not now[RESIDUAL, lane] <= closure_tol:
            tally[AILMENT, lane], now[REJECTED_RESIDUAL, lane] = CLOSURE_LOST, now[RESIDUAL, lane]
            tally[EVALUATIONS, lane] -= 1
            break
        pivot = k[i * (n + 1) + n, lane]
        lowest = min(lowest, pivot)
        if not pivot >= pivot_bound:
            tally[AILMENT, lane] = NON_FINITE if math.isnan(pivot) else SINGULAR
            tally[EVALUATIONS, lane] -= STAGES - 1 - i
            break
    now[REJECTED_PIVOT, lane] = lowest


@njit(**OPTIONS)
def take_samples(closure, closure_tol, save_at, samples, y, x, z, z_next, k, sample, weights, now, tally):
    """Take the samples within the accepted steps by dense output, projected; a step with one that cannot be is refused."""
    n = y.shape[0]
    while True:
        wanted = 0
        for lane in range(LANES):
            row = tally[REACHED, lane]
            wants = now[ACCEPTS, lane] > 0 and row < save_at.size and save_at[row] <= now[ARRIVAL, lane]
            now[WANTED, lane] = 1.0 if wants else 0.0
            now[THETA, lane] = (save_at[row] - now[TIME, lane]) / now[STEP, lane] if wants else 1.0
            wanted += wants
        if wanted == 0:
            break
        theta = load(now, THETA)
        for i in range(STAGES):
            weight = splat(0.0)
            for m in range(DENSE.shape[1] - 1, -1, -1):
                weight = theta * (weight + splat(DENSE[i, m]))
            store(weights, i, weight)
        h = load(now, STEP)
        for m in range(n):
            total = splat(0.0)
            for i in range(STAGES):
                total = total + load(weights, i) * load(k, i * (n + 1) + m)
            store(sample, m, load(y, m) + h * total)
        for lane in range(LANES):
            now[RESIDUAL, lane] = 0.0
            if now[WANTED, lane] > 0 and save_at[tally[REACHED, lane]] == now[ARRIVAL, lane]:
                for m in range(n):
                    sample[m, lane] = x[m, lane]
        if closure != 0:
            project(closure, sample, z, z_next, now, closure_tol, math.inf)
        for lane in range(LANES):
            if now[WANTED, lane] > 0:
                if now[RESIDUAL, lane] <= closure_tol:
                    for m in range(n):
                        samples[tally[MEMBER, lane], tally[REACHED, lane], m] = sample[m, lane]
                    tally[REACHED, lane] += 1
                    now[CLOSURE_ERROR, lane] = max(now[CLOSURE_ERROR, lane], now[RESIDUAL, lane])
                else:
                    now[ACCEPTS, lane], tally[AILMENT, lane] = 0.0, CLOSURE_LOST
                    now[REJECTED_RESIDUAL, lane], now[REJECTED_PIVOT, lane] = now[RESIDUAL, lane], now[LOWEST, lane]


@njit(**OPTIONS)
def accept(max_step, now, tally):
    """Go on to the ends of the accepted steps, and choose the lengths of the next ones."""
    for lane in range(LANES):
        accepts, error = now[ACCEPTS, lane] > 0, max(now[ERROR, lane], SMALLEST_ERROR)
        now[POWER, lane] = error ** (DAMPING * EXPONENT) if accepts else 1.0
        tally[ACCEPTED, lane] += accepts
        tally[SAVED, lane] = tally[REACHED, lane] if accepts else tally[SAVED, lane]
    accepted, step, h = load(now, ACCEPTS) >= splat(1.0), load(now, STEP), load(now, STEP_SIZE)
    factor = smaller(load(now, GROWTH), splat(SAFETY) / load(now, POWER))
    proposal = smaller(splat(max_step), step * larger(splat(SMALLEST_FACTOR), factor))
    proposal = choose(h <= step, proposal, larger(h, proposal))
    store(now, STEP_SIZE, choose(accepted, proposal, h))
    store(now, GROWTH, choose(accepted, splat(LARGEST_FACTOR), load(now, GROWTH)))
    store(now, TIME, choose(accepted, load(now, ARRIVAL), load(now, TIME)))
    store(now, PIVOT, choose(accepted, smaller(load(now, PIVOT), load(now, LOWEST)), load(now, PIVOT)))


@njit(forceinline=True, **OPTIONS)
def reject(lane, pivot_bound, first_pivot, now, tally):
    """Shrink the step of a lane."""
    tally[REJECTED, lane] += 1
    now[GROWTH, lane] = 1.0
    ailment, step = tally[AILMENT, lane], now[STEP, lane]
    if ailment == OK:
        tally[CAUSE, lane] = STEP_UNDERFLOW
        now[STEP_SIZE, lane] = step * max(SMALLEST_FACTOR, SAFETY / now[ERROR, lane] ** EXPONENT)
    else:
        tally[CAUSE, lane] = ailment
        now[STEP_SIZE, lane] = step * RETREAT
        if ailment == SINGULAR and first_pivot <= NEAR * pivot_bound:
            tally[STATUS, lane] = SINGULAR


@njit(**OPTIONS)
def restart(motion, starts, coefficients, pieces, breaks, breaking, pivot_bound, start, stop, y, x, k, now, tally):
    """Evaluate the slope anew, in place of the last stage's, in the lanes that have reached a break of their signal."""
    n, last, broken = y.shape[0], STAGES - 1, 0
    for lane in range(LANES):
        now[WANTED, lane] = 0.0
        if now[ACCEPTS, lane] > 0 and now[TIME, lane] == now[TARGET, lane] and now[TIME, lane] < stop:
            signal, time = shared(tally[MEMBER, lane], pieces.size - 1), now[TIME, lane]
            force(starts, coefficients, pieces, signal, time, False, x, n, lane, tally)
            now[TARGET, lane] = next_target(breaks, breaking, signal, tally, time, start, stop, lane)
            now[WANTED, lane] = 1.0
            broken += 1
    if broken == 0:
        return
    # All lanes are evaluated, at x; the last stages of those that go on smoothly come out as they were.
    call_batch(motion, x, k, last * (n + 1))
    for lane in range(LANES):
        if now[WANTED, lane] > 0:
            tally[EVALUATIONS, lane] += 1
            tally[STATUS, lane] = first_ailment(k, last, n, lane, pivot_bound)
            now[REJECTED_PIVOT, lane] = k[last * (n + 1) + n, lane]
            now[PIVOT, lane] = min(now[PIVOT, lane], now[REJECTED_PIVOT, lane])


@njit(**OPTIONS)
def measure_closure(closure, closure_tol, ys, numbers, parameters, z, z_next):
    """Keep the residuals of the last states reached."""
    nq, members = z_next.shape[0] - 1, ys.shape[0]
    for first in range(0, members, LANES):
        for lane in range(LANES):
            i = min(first + lane, members - 1)
            row = shared(i, parameters.shape[0])
            for m in range(nq):
                z[m, lane] = ys[i, m]
            for m in range(parameters.shape[1]):
                z[nq + m, lane] = parameters[row, m]
        call_batch(closure, z, z_next, 0)
        for lane in range(min(LANES, members - first)):
            numbers[first + lane, CLOSURE_ERROR] = max(numbers[first + lane, CLOSURE_ERROR], z_next[nq, lane])


_array, _table, _tables = (types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3))
_whole, _number = types.intp, types.float64
_wholes = types.Array(types.intp, 1, "C", readonly=True)
_SIGNATURE = (
    *(_whole, _whole, _table, _array, _tables, _wholes, _array, _wholes, types.boolean),
    *(_table, _number, _number),
    *(_whole, types.Array(types.float64, 2, "C"), _array, _number, _number, _number, _whole),
    *(types.Array(types.float64, 3, "C"), types.Array(types.float64, 2, "C"), types.Array(types.intp, 2, "C")),
    *(types.Array(types.intp, 1, "C"), types.Array(types.intp, 1, "C")),
)


@compiled_once("the integrator of ensembles", _SIGNATURE)
def integrate(
    motion, closure, parameters, starts, coefficients, pieces, breaks, breaking, timed,
    tolerance, pivot_bound, closure_tol,
    nq, ys, save_at, start, stop, max_step, max_steps,
    samples, numbers, counts, cancel, progress,
):  # fmt: skip
    """Integrate the members ys (N, n) from start to stop, and leave their last states there.

    samples (N, K, n): the states at save_at; numbers (N, NUMBERS), counts (N, COUNTS): what came of each member.
    cancel (1,): the run ends where it is when another thread writes anything but 0; progress (1,): the members ended.
    """
    members, n = ys.shape[0], ys.shape[1]
    inputs, free = coefficients.shape[2], parameters.shape[1]
    end = np.cumsum(np.array([n, n + inputs + free, STAGES * (n + 1), nq + free, nq + 1, n, STAGES, NOW]))
    space = room(end[7])
    y, x, k = space[: end[0]], space[end[0] : end[1]], space[end[1] : end[2]]
    z, z_next, sample = space[end[2] : end[3]], space[end[3] : end[4]], space[end[4] : end[5]]
    weights, now = space[end[5] : end[6]], space[end[6] :]
    tally, slopes = np.zeros((TALLY, LANES), np.intp), np.empty((members, n + 1))
    smallest_step = SMALLEST_STEP * max(stop, stop - start)
    for first in range(0, members, LANES):
        start_block(
            motion, closure, parameters, starts, coefficients, pieces, breaks, breaking,
            tolerance, pivot_bound, closure_tol, start, stop, max_step, first, ys, slopes, numbers, counts,
            y, x, z, z_next, k, now, tally,
        )  # fmt: skip

    waiting = np.intp(0)
    tally[MEMBER] = -1
    while True:
        live = 0
        for lane in range(LANES):
            while tally[MEMBER, lane] < 0 or ended(lane, now, tally, stop, smallest_step, max_steps):
                if tally[MEMBER, lane] >= 0:
                    store_member(lane, ys, numbers, counts, y, now, tally)
                    progress[0] += 1
                tally[MEMBER, lane] = -1
                if waiting == members:
                    break
                load_member(
                    waiting, lane, parameters, starts, coefficients, pieces, breaks, breaking, start, stop,
                    ys, slopes, numbers, counts, save_at, samples, y, x, z, k, now, tally,
                )  # fmt: skip
                waiting += 1
            alive = tally[MEMBER, lane] >= 0
            now[LIVE, lane] = now[WANTED, lane] = 1.0 if alive else 0.0
            live += alive
        if live == 0 or cancel[0] != 0:
            break
        choose_steps(now)
        attempt(
            motion, closure, starts, coefficients, pieces, timed, tolerance, pivot_bound, closure_tol,
            y, x, z, z_next, k, now, tally,
        )  # fmt: skip
        for lane in range(LANES):
            tally[AILMENT, lane], tally[REACHED, lane] = OK, tally[SAVED, lane]
            now[ACCEPTS, lane] = 1.0 if now[LIVE, lane] > 0 and now[ERROR, lane] <= 1 else 0.0
            if math.isfinite(now[ERROR, lane]):
                tally[EVALUATIONS, lane] += STAGES - 1
            else:
                diagnose(lane, k, n, pivot_bound, closure_tol, now, tally)
        if save_at.size > 0:
            take_samples(closure, closure_tol, save_at, samples, y, x, z, z_next, k, sample, weights, now, tally)
        for lane in range(LANES):
            if now[LIVE, lane] > now[ACCEPTS, lane]:
                reject(lane, pivot_bound, k[n, lane], now, tally)
        accept(max_step, now, tally)
        if breaks.size > 0:
            restart(
                motion, starts, coefficients, pieces, breaks, breaking, pivot_bound, start, stop, y, x, k,
                now, tally,
            )  # fmt: skip
        accepted = load(now, ACCEPTS) >= splat(1.0)
        for m in range(n):
            store(y, m, choose(accepted, load(x, m), load(y, m)))
        for m in range(n + 1):
            store(k, m, choose(accepted, load(k, (STAGES - 1) * (n + 1) + m), load(k, m)))

    for lane in range(LANES):
        if tally[MEMBER, lane] >= 0:
            tally[STATUS, lane] = CANCELLED
            store_member(lane, ys, numbers, counts, y, now, tally)
    for i in range(waiting, members):
        counts[i, STATUS] = CANCELLED
    if closure != 0:
        measure_closure(closure, closure_tol, ys, numbers, parameters, z, z_next)
