"""Integrate many members at a time: the loop of `native_loop` for explicit pairs, with a member in
each lane.

Each lane has its own time, step size and end. When a member ends the next one is loaded into its
lane, so that the registers stay full. What a member goes through is what it goes through alone: the
same arithmetic in the same order, lane by lane, so that no member depends on its neighbours. The
kernels are C functions void(const double *in, double *out) for LANES states side by side:

    motion   in = (y, u, p)  out = (y', pivot)
    closure  in = (q, p)     out = (q after one Newton step on phi(q) = 0, largest |phi(q)| before it)

Members start in blocks of LANES (`start_block`): q is closed, the first slope evaluated, the first
step guessed; `begun` keeps that, block after block. Then all lanes go step by step: `choose_steps`,
`combine`, `project`, `judge`, `take_samples`, `reject`, `accept`, `restart`.

Names: `x`, rows (y, u, p); `k`, rows (y', pivot), stage after stage; `z`, rows (q, p); all
(rows, LANES). `now` and `tally` hold numbers and counts of the members in the lanes, `numbers` and
`counts` those of all members, a row each, of which the first NUMBERS and COUNTS are the same. With
one signal, or one row of p, all members share it.
"""

import math

import numpy as np
from numba import njit, types

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.lane_inputs import (
    Signals,
    force,
    next_target,
    set_forces,
    shared,
    signal_of,
)
from linkwork.simulation.lane_samples import extend, keep_sample, take_samples, want_samples
from linkwork.simulation.lane_steps import (
    accept,
    choose_steps,
    combine,
    falling,
    judge,
    move,
    project,
    scaled,
)
from linkwork.simulation.lane_tables import (
    ACCEPTED,
    ACCEPTS,
    AILMENT,
    ARRIVAL,
    BEND,
    BREAK,
    CAUSE,
    CLOSURE_ERROR,
    COUNTS,
    ERROR,
    EVALUATIONS,
    GROWTH,
    IDEAL,
    LEAST,
    LIVE,
    LONGEST,
    LOOSE,
    LOWEST,
    MEMBER,
    NOW,
    NUMBERS,
    PIECE,
    PIVOT,
    REACHED,
    REJECTED,
    REJECTED_PIVOT,
    REJECTED_RESIDUAL,
    RESIDUAL,
    SAVED,
    STATUS,
    STEP,
    STEP_SIZE,
    STIFFLY,
    TALLY,
    TARGET,
    TIME,
    WANTED,
    Tables,
)
from linkwork.simulation.lane_watch import LaneSignals, inspect, mark, mark_peaks
from linkwork.simulation.native_loop import (
    LOOK,
    NEAR,
    SMALLEST_STEP,
    STEP_UNDERFLOW,
    STIFF,
    TOO_MANY_STEPS,
    VOTES,
)
from linkwork.simulation.native_pace import (
    BOLDNESS,
    FARTHEST,
    LARGEST_FACTOR,
    RETREAT,
    SAFETY,
    SMALLEST_FACTOR,
    sixteenths,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    RESERVE,
    SINGULAR,
    method_of,
    turns_in,
    without,
)
from linkwork.simulation.status import Status
from linkwork.simulation.vectors import (
    LANES,
    absolute,
    as_table,
    call_wide,
    larger,
    load,
    some,
    splat,
    store,
)

CANCELLED = int(Status.CANCELLED)

ALIGNMENT = 64
LOOSER = math.nextafter(1.0, 2.0)


@njit(**OPTIONS)
def room(rows):
    """Return zeros (rows, LANES) that start at a multiple of ALIGNMENT bytes."""
    memory = np.zeros(rows * LANES + ALIGNMENT // 8)
    first = -memory.ctypes.data % ALIGNMENT // 8
    return memory[first : first + rows * LANES].reshape(rows, LANES)


@njit(forceinline=True, **OPTIONS)
def first_ailment(k, stage, n, lane, pivot_bound):
    """Return what a stage's numbers tell of a slope from which no step can retreat: OK, SINGULAR or
    NON_FINITE."""
    pivot = k[stage * (n + 1) + n, lane]
    if not pivot >= pivot_bound:
        return NON_FINITE if math.isnan(pivot) else SINGULAR
    for m in range(n):
        if not math.isfinite(k[stage * (n + 1) + m, lane]):
            return NON_FINITE
    return OK


@njit(forceinline=True, **OPTIONS)
def block_row(member, n):
    """Return the first row of a member's block in `begun`: the first NUMBERS rows of `now`, those
    of y, those of k_0."""
    return member // LANES * (NUMBERS + 2 * n + 1)


@njit(forceinline=True, **OPTIONS)
def large(shortest, now, tables):
    """Tell in which lanes a coordinate may be large, beyond the shortest of all spans, or was."""
    largest = splat(0.0)
    for m in range(tables.nq):
        largest = larger(absolute(load(tables.y, m)), largest)
    return (largest >= splat(shortest)) | (load(now, LOOSE) >= splat(LOOSER))


@njit(**OPTIONS)
def settle(now, tables):
    """Count the whole turns of large angles apart, and loosen the closure where other coordinates
    are large; tell whether any turn was counted.
    """
    y, spans, counted = tables.y, tables.spans, False
    for lane in range(LANES):
        now[LOOSE, lane] = 1.0
        for m in range(tables.nq):
            if abs(y[m, lane]) > spans[m, lane]:
                if tables.wraps[m, lane] > 0:
                    count = turns_in(y[m, lane])
                    y[m, lane] = without(y[m, lane], count)
                    tables.turned[m, lane] += count
                    counted = True
                else:
                    now[LOOSE, lane] = max(now[LOOSE, lane], abs(y[m, lane]) / spans[m, lane])
    return counted


@njit(forceinline=True, **OPTIONS)
def start_block(
    motion, closure, parameters, signals, exponent, pivot_bound, closure_tol, max_step, first, ys, begun, counts,
    turns, shortest, turned, tables,
):  # fmt: skip
    """Close q, evaluate the first slope and guess the first step of the members from `first` on,
    one for each lane.

    turned: whether any turn was counted before; return it as it is now.
    """
    y, x, k, z, now, tally, scale = (
        tables.y, tables.x, tables.k, tables.z, tables.now, tables.tally, tables.scale
    )  # fmt: skip
    (members, n), inputs, start = ys.shape, signals.coefficients.shape[2], signals.start
    for lane in range(LANES):
        i = min(first + lane, members - 1)
        signal, row = signal_of(signals, i), shared(i, parameters.shape[0])
        for m in range(n):
            y[m, lane] = ys[i, m]
        for m in range(tables.nq if turned else 0):
            tables.turned[m, lane] = 0.0
        for m in range(parameters.shape[1]):
            x[n + inputs + m, lane] = z[tables.nq + m, lane] = parameters[row, m]
        now[WANTED, lane] = 1.0
        tally[STATUS, lane], tally[EVALUATIONS, lane], tally[BREAK, lane] = (
            OK,
            0,
            signals.breaking[signal],
        )
        tally[PIECE, lane] = 0
        force(signals, signal, start, False, x, n, lane, tally)
        now[TARGET, lane] = next_target(signals, signal, tally, start, lane)
        now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = now[STEP_SIZE, lane] = 0.0
        now[LOOSE, lane] = 1.0
    if some(large(shortest, now, tables)):
        turned |= settle(now, tables)
    if closure != 0:
        project(closure, tables.nq, y, z, tables.z_next, now, closure_tol, math.inf)
        for lane in range(LANES):
            now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = now[RESIDUAL, lane]
            if not now[RESIDUAL, lane] <= closure_tol * now[LOOSE, lane]:
                tally[STATUS, lane] = CLOSURE_LOST
    for m in range(n):
        store(x, m, load(y, m))
    call_wide(motion, x, k, 0)
    for lane in range(LANES):
        now[PIVOT, lane] = math.inf
        now[REJECTED_PIVOT, lane] = 0.0
        if tally[STATUS, lane] == OK:
            tally[STATUS, lane], tally[EVALUATIONS, lane] = (
                first_ailment(k, 0, n, lane, pivot_bound),
                1,
            )
            now[PIVOT, lane] = now[REJECTED_PIVOT, lane] = k[n, lane]

    # The first step, from the slope here, k_0, and one a little ahead, k_1.
    store(now, ERROR, scaled(y, 0, n, y, scale))
    store(now, LOWEST, scaled(k, 0, n, y, scale))
    for lane in range(LANES):
        size, steepness = now[ERROR, lane], now[LOWEST, lane]
        ahead = 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness
        now[STEP, lane] = min(now[TARGET, lane] - start, ahead)
        if signals.timed:
            signal = signal_of(signals, min(first + lane, members - 1))
            force(signals, signal, start + now[STEP, lane], True, x, n, lane, tally)
    for m in range(n):
        store(x, m, load(y, m) + load(now, STEP) * load(k, m))
    call_wide(motion, x, k, n + 1)
    store(now, RESIDUAL, load(k, 2 * n + 1))
    for m in range(n):
        store(k, n + 1 + m, load(k, n + 1 + m) - load(k, m))
    store(now, ERROR, scaled(k, n + 1, n, y, scale))
    for lane in range(LANES):
        if tally[STATUS, lane] == OK:
            ahead, steepness = now[STEP, lane], now[LOWEST, lane]
            h = ahead
            if now[RESIDUAL, lane] >= pivot_bound:
                steepest = max(steepness, now[ERROR, lane] / ahead)
                h = (
                    max(1e-6, 1e-3 * ahead)
                    if steepest <= 1e-15
                    else BOLDNESS * (0.01 / steepest) ** exponent
                )
                h = min(FARTHEST * ahead, h)
            now[STEP_SIZE, lane] = min(h, max_step)
            tally[EVALUATIONS, lane] += 1

    store(now, TIME, splat(start))
    row = block_row(first, n)
    for m in range(NUMBERS):
        store(begun, row + m, load(now, m))
    for m in range(n):
        store(begun, row + NUMBERS + m, load(y, m))
    for m in range(n + 1):
        store(begun, row + NUMBERS + n + m, load(k, m))
    for lane in range(min(LANES, members - first)):
        i = first + lane
        counts[i, ACCEPTED] = counts[i, REJECTED] = counts[i, SAVED] = 0
        counts[i, STATUS], counts[i, EVALUATIONS] = tally[STATUS, lane], tally[EVALUATIONS, lane]
        if turned:
            keep_turns(i, lane, turns, tables)
    return turned


@njit(forceinline=True, **OPTIONS)
def keep_turns(i, lane, turns, tables):
    """Keep the whole turns of a lane's angles for member i; they are zero from the outset."""
    for m in range(tables.nq):
        if tables.turned[m, lane] != 0.0:
            turns[i, m] = tables.turned[m, lane]


@njit(forceinline=True, **OPTIONS)
def load_member(
    i, lane, parameters, signals, begun, counts, save_at, samples, turns, turned, tables
):
    """Put a started member into a lane; turned: whether any turn was counted before."""
    n, y, x, k, now, tally = tables.n, tables.y, tables.x, tables.k, tables.now, tables.tally
    inputs, place, begin = signals.coefficients.shape[2], i % LANES, block_row(i, n)
    signal, row, start = signal_of(signals, i), shared(i, parameters.shape[0]), signals.start
    for m in range(NUMBERS):
        now[m, lane] = begun[begin + m, place]
    for m in range(n):
        y[m, lane] = begun[begin + NUMBERS + m, place]
    for m in range(tables.nq if turned else 0):
        tables.turned[m, lane] = turns[i, m]
    for m in range(n + 1):
        k[m, lane] = begun[begin + NUMBERS + n + m, place]
    for m in range(parameters.shape[1]):
        x[n + inputs + m, lane] = tables.z[tables.nq + m, lane] = parameters[row, m]
    for m in range(COUNTS):
        tally[m, lane] = counts[i, m]
    now[GROWTH, lane], now[LONGEST, lane], now[IDEAL, lane] = LARGEST_FACTOR, 0.0, 0.0
    tally[MEMBER, lane], tally[CAUSE, lane] = i, STEP_UNDERFLOW
    tally[PIECE, lane], tally[BREAK, lane], tally[BEND, lane] = 0, signals.breaking[signal], 0
    tally[STIFFLY, lane] = 0
    force(signals, signal, start, False, x, n, lane, tally)
    now[TARGET, lane] = next_target(signals, signal, tally, start, lane)
    if save_at.size > 0 and save_at[0] == start:
        keep_sample(i, 0, lane, y, samples, tables)
        tally[SAVED, lane] = 1


@njit(forceinline=True, **OPTIONS)
def store_member(lane, ys, numbers, counts, turns, turned, tables):
    """Keep what the member in a lane has come to; turned: whether any turn was counted before."""
    y, now, tally = tables.y, tables.now, tables.tally
    i = tally[MEMBER, lane]
    for m in range(ys.shape[1]):
        ys[i, m] = y[m, lane]
    for m in range(NUMBERS):
        numbers[i, m] = now[m, lane]
    for m in range(COUNTS):
        counts[i, m] = tally[m, lane]
    if turned:
        keep_turns(i, lane, turns, tables)


@njit(**OPTIONS)
def look_due(method, n, stability, stop, tolerance, y, x, k, now, tally):
    """Look at the accepted steps that are due for it; return after how many steps of the lanes
    another one can be."""
    soonest = LOOK
    for lane in range(LANES):
        if now[ACCEPTS, lane] > 0 and (
            tally[STIFFLY, lane] > 0 or tally[ACCEPTED, lane] % LOOK == 0
        ):
            look(lane, method, n, stability, stop, tolerance, y, x, k, now, tally)
        soonest = min(
            soonest, 1 if tally[STIFFLY, lane] > 0 else LOOK - tally[ACCEPTED, lane] % LOOK
        )
    return soonest


@njit(**OPTIONS)
def look(lane, method, n, stability, stop, tolerance, y, x, k, now, tally):
    """Look whether an accepted step is stiff, and leave a run of which most are: see
    `native_loop.stiffness`."""
    last, h, above, below = method.solution, now[STEP, lane], 0.0, 0.0
    weights = method.a + (last - 1) * method.stages
    for m in range(n):
        total = 0.0
        for j in range(last - 1):
            total += weights[j] * k[j * (n + 1) + m, lane]
        scale = tolerance[1, m] + tolerance[0, m] * abs(x[m, lane])
        above += ((k[last * (n + 1) + m, lane] - k[(last - 1) * (n + 1) + m, lane]) / scale) ** 2
        below += ((x[m, lane] - (y[m, lane] + h * total)) / scale) ** 2
    stiff = below > 0 and h * math.sqrt(above / below) > stability
    tally[STIFFLY, lane] = max(0, tally[STIFFLY, lane] + (1 if stiff else -1))
    if tally[STIFFLY, lane] >= VOTES and stop - now[ARRIVAL, lane] > LOOK * h:
        tally[STATUS, lane] = STIFF


@njit(**OPTIONS)
def undefined(lane, k, rows):
    """Tell whether any number in the first rows of a lane's slopes is not finite."""
    count = 0
    for row in range(rows):
        count += not math.isfinite(k[row, lane])
    return count > 0


@njit(**OPTIONS)
def diagnose(lane, k, n, solution, pivot_bound, closure_tol, now, tally):
    """Find why the equations fail in a lane's trial step, in the order of the stages; count the
    evaluations up to it."""
    lowest = math.inf
    tally[AILMENT, lane], tally[EVALUATIONS, lane] = NON_FINITE, tally[EVALUATIONS, lane] + solution
    for i in range(1, solution + 1):
        if i == solution and not now[RESIDUAL, lane] <= closure_tol * now[LOOSE, lane]:
            tally[AILMENT, lane] = NON_FINITE if undefined(lane, k, i * (n + 1)) else CLOSURE_LOST
            now[REJECTED_RESIDUAL, lane] = now[RESIDUAL, lane]
            tally[EVALUATIONS, lane] -= 1
            break
        pivot = k[i * (n + 1) + n, lane]
        lowest = min(lowest, pivot)
        if not pivot >= pivot_bound:
            tally[AILMENT, lane] = NON_FINITE if math.isnan(pivot) else SINGULAR
            tally[EVALUATIONS, lane] -= solution - i
            break
    now[REJECTED_PIVOT, lane] = lowest


@njit(forceinline=True, **OPTIONS)
def reject(lane, exponent, pivot_bound, first_pivot, now, tally):
    """Shrink the step of a lane."""
    tally[REJECTED, lane] += 1
    now[GROWTH, lane] = 1.0
    ailment, step = tally[AILMENT, lane], now[STEP, lane]
    if ailment == OK:
        tally[CAUSE, lane] = STEP_UNDERFLOW
        shrunk = step * max(SMALLEST_FACTOR, SAFETY / now[ERROR, lane] ** exponent)
        now[STEP_SIZE, lane] = max(now[LEAST, lane], shrunk)
    else:
        tally[CAUSE, lane] = ailment
        now[STEP_SIZE, lane], now[LONGEST, lane] = RETREAT * step, RETREAT * now[LONGEST, lane]
        if ailment == SINGULAR and first_pivot <= NEAR * pivot_bound:
            tally[STATUS, lane] = SINGULAR


@njit(forceinline=True, **OPTIONS)
def restart(motion, last, signals, pivot_bound, tables):
    """Evaluate the slope anew, in place of the last stage's, in the lanes that have reached a break
    of their signal."""
    n, x, k, now, tally, broken = tables.n, tables.x, tables.k, tables.now, tables.tally, 0
    for lane in range(LANES):
        now[WANTED, lane] = 0.0
        if (
            now[ACCEPTS, lane] > 0
            and now[TIME, lane] == now[TARGET, lane]
            and now[TIME, lane] < signals.stop
        ):
            signal, time = signal_of(signals, tally[MEMBER, lane]), now[TIME, lane]
            force(signals, signal, time, False, x, n, lane, tally)
            now[TARGET, lane] = next_target(signals, signal, tally, time, lane)
            now[WANTED, lane] = 1.0
            broken += 1
    if broken == 0:
        return
    # All lanes are evaluated, at x; the last stages of those that go on smoothly come out as they
    # were.
    call_wide(motion, x, k, last * (n + 1))
    for lane in range(LANES):
        if now[WANTED, lane] > 0:
            tally[EVALUATIONS, lane] += 1
            tally[STATUS, lane] = first_ailment(k, last, n, lane, pivot_bound)
            now[REJECTED_PIVOT, lane] = k[last * (n + 1) + n, lane]
            now[PIVOT, lane] = min(now[PIVOT, lane], now[REJECTED_PIVOT, lane])


@njit(**OPTIONS)
def measure_closure(closure, nq, ys, numbers, parameters, z, z_next):
    """Keep the residuals of the last states reached."""
    members = ys.shape[0]
    for first in range(0, members, LANES):
        for lane in range(LANES):
            i = min(first + lane, members - 1)
            row = shared(i, parameters.shape[0])
            for m in range(nq):
                z[m, lane] = ys[i, m]
            for m in range(parameters.shape[1]):
                z[nq + m, lane] = parameters[row, m]
        call_wide(closure, z, z_next, 0)
        for lane in range(min(LANES, members - first)):
            numbers[first + lane, CLOSURE_ERROR] = max(
                numbers[first + lane, CLOSURE_ERROR], z_next[nq, lane]
            )


_array, _table, _tables = (
    types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3)
)
_whole, _number = types.intp, types.float64
_wholes = types.Array(types.intp, 1, "C", readonly=True)
_SIGNATURE = (
    *(_whole, _whole, _table, _array, _tables, _wholes, _array, _wholes, types.boolean),
    *(_array, _tables, _wholes, _table, _wholes),
    *(_array, _whole, _whole, _whole, _whole, _whole, _number, _number),
    *(_table, _number, _number, _number),
    *(_whole, types.Array(types.float64, 2, "C"), _array, _number, _number, _number, _whole),
    *(_array, _array, types.Array(types.float64, 3, "C"), types.Array(types.float64, 2, "C")),
    *(types.Array(types.intp, 2, "C"), types.Array(types.float64, 2, "C")),
    *(types.Array(types.intp, 1, "C"), types.Array(types.intp, 1, "C")),
)


@compiled_once("the integrator of ensembles", _SIGNATURE)
def integrate(
    motion, closure, parameters, starts, coefficients, pieces, breaks, breaking, timed,
    watched_starts, watched_coefficients, watched_pieces, bends, bending,
    plan, stages, degree, estimates, solution, computed, exponent, blur,
    tolerance, pivot_bound, closure_tol, stability,
    nq, ys, save_at, start, stop, max_step, max_steps,
    spans, wraps, samples, numbers, counts, turns, cancel, progress,
):  # fmt: skip
    """Integrate the members ys (N, n) from start to stop, and leave their last states there.

    plan, ..., blur: the arguments of the `Plan` of an explicit pair.
    samples (N, K, n): the states at save_at; numbers (N, NUMBERS), counts (N, COUNTS): what came of
    each member. spans, wraps (nq,): as in `turns.Turning`; turns (N, nq): zero, the whole turns
    that are not in ys are left there. cancel (1,): the run ends where it is when another thread
    writes anything but 0; progress (1,): the members ended.
    """
    members, n = ys.shape[0], ys.shape[1]
    inputs, free = coefficients.shape[2], parameters.shape[1]
    closed = nq if closure != 0 else 0
    method = method_of(plan, stages, degree, estimates, solution, computed, exponent, blur)
    end = np.cumsum(
        np.array(
            [
                n,
                n + inputs + free,
                (stages + 1) * (n + 1),
                nq + free,
                nq + 1,
                n,
                stages,
                NOW,
                2 * n,
                n,
                3 * nq,
                n,
            ]
        )
    )
    space = room(end[11])
    y, x, k = as_table(space), as_table(space[end[0] :]), as_table(space[end[1] :])
    z, z_next, sample = (
        as_table(space[end[2] :]),
        as_table(space[end[3] :]),
        as_table(space[end[4] :]),
    )
    weights, now = as_table(space[end[5] :]), as_table(space[end[6] :])
    scale, zeros, kept = (
        as_table(space[end[7] :]),
        as_table(space[end[8] :]),
        as_table(space[end[10] :]),
    )
    spread, at_most, counted = (
        as_table(space[end[9] :]),
        as_table(space[end[9] + nq :]),
        as_table(space[end[9] + 2 * nq :]),
    )
    for m in range(n):
        space[end[7] + m], space[end[7] + n + m] = tolerance[0, m], tolerance[1, m]
    for m in range(nq):
        space[end[9] + m], space[end[9] + nq + m] = spans[m], wraps[m]
    tally, blocks = np.zeros((TALLY, LANES), np.intp), room(block_row(members + LANES - 1, n))
    begun = as_table(blocks)
    signals = Signals(starts, coefficients, pieces, breaks, breaking, timed, start, stop)
    tables = Tables(
        y,
        x,
        k,
        z,
        z_next,
        sample,
        weights,
        scale,
        zeros,
        spread,
        at_most,
        counted,
        kept,
        now,
        tally,
        n,
        nq,
    )
    watched = LaneSignals(watched_starts, watched_coefficients, watched_pieces, bends, bending)
    smallest_step = SMALLEST_STEP * max(stop, stop - start)
    shortest, turned, trips, due = math.inf, False, 0, LOOK
    for m in range(nq):
        shortest = min(shortest, spans[m])
    for first in range(0, members, LANES):
        turned = start_block(
            motion, closure, parameters, signals, exponent, pivot_bound, closure_tol, max_step, first, ys, begun, counts,
            turns, shortest, turned, tables,
        )  # fmt: skip

    waiting = np.intp(0)
    tally[MEMBER] = -1
    while True:
        live = 0
        for lane in range(LANES):
            while True:  # until the lane has a member that goes on, or there are none left
                if tally[MEMBER, lane] >= 0:
                    if tally[STATUS, lane] == OK and now[TIME, lane] < stop:
                        if tally[ACCEPTED, lane] + tally[REJECTED, lane] >= max_steps:
                            tally[STATUS, lane] = TOO_MANY_STEPS
                        elif now[STEP_SIZE, lane] < smallest_step:
                            tally[STATUS, lane] = tally[CAUSE, lane]
                        else:
                            break
                    store_member(lane, ys, numbers, counts, turns, turned, tables)
                    progress[0] += 1
                    tally[MEMBER, lane] = -1
                if waiting == members:
                    break
                load_member(
                    waiting,
                    lane,
                    parameters,
                    signals,
                    begun,
                    counts,
                    save_at,
                    samples,
                    turns,
                    turned,
                    tables,
                )
                waiting += 1
            alive = tally[MEMBER, lane] >= 0
            now[LIVE, lane] = now[WANTED, lane] = 1.0 if alive else 0.0
            live += alive
        if live == 0 or cancel[0] != 0:
            break
        choose_steps(now)
        for i in range(1, solution + 1):
            combine(method.a + i * stages, i, n, now, y, k, x)
            if i == solution:
                store(now, RESIDUAL, splat(0.0))
                if closure != 0:
                    project(closure, nq, x, z, z_next, now, closure_tol, RESERVE)
            if timed:
                set_forces(signals, method.c[i], x, n, now, tally)
            call_wide(motion, x, k, i * (n + 1))
        judge(method, n, closed, scale, pivot_bound, closure_tol, y, x, z, k, zeros, sample, now)
        for lane in range(LANES):
            tally[AILMENT, lane], tally[REACHED, lane] = OK, tally[SAVED, lane]
            now[ACCEPTS, lane] = 1.0 if now[LIVE, lane] > 0 and now[ERROR, lane] <= 1 else 0.0
            if math.isfinite(now[ERROR, lane]):
                tally[EVALUATIONS, lane] += solution
            else:
                diagnose(lane, k, n, solution, pivot_bound, closure_tol, now, tally)
        marked = mark(watched, now, tally) if bending[-1] > bending.size - 1 else 0
        peaks = some(falling(now))
        if peaks:
            marked += mark_peaks(now)
        inside = (
            want_samples(save_at, now, tally)[1] if save_at.size > 0 and computed < stages else 0
        )
        if computed < stages and marked + inside > 0:
            extend(motion, method, signals, pivot_bound, save_at, tables)
        if marked > 0:
            inspect(motion, method, signals, watched, pivot_bound, peaks, tables)
        if save_at.size > 0:
            take_samples(closure, method, closure_tol, save_at, samples, tables)
        for lane in range(LANES):
            if now[ACCEPTS, lane] > 0:
                tally[ACCEPTED, lane] += 1
                tally[SAVED, lane] = tally[REACHED, lane]
            elif now[LIVE, lane] > 0:
                reject(lane, exponent, pivot_bound, k[n, lane], now, tally)
        trips += 1
        if stability > 0 and trips == due:
            due = trips + look_due(method, n, stability, stop, tolerance, y, x, k, now, tally)
        accept(sixteenths(exponent), max_step, now)
        if breaks.size > 0:
            restart(motion, solution, signals, pivot_bound, tables)
        kept = load(now, ACCEPTS) <= splat(0.0)
        move(x, 0, y, n, kept)
        move(k, solution * (n + 1), k, n + 1, kept)
        if some(large(shortest, now, tables)):
            turned |= settle(now, tables)

    for lane in range(LANES):
        if tally[MEMBER, lane] >= 0:
            tally[STATUS, lane] = CANCELLED
            store_member(lane, ys, numbers, counts, turns, turned, tables)
    for i in range(waiting, members):
        counts[i, STATUS] = CANCELLED
        place, begin = i % LANES, block_row(i, n)
        for m in range(NUMBERS):
            numbers[i, m] = begun[begin + m, place]
        for m in range(n):
            ys[i, m] = begun[begin + NUMBERS + m, place]
    if closure != 0:
        measure_closure(closure, nq, ys, numbers, parameters, z, z_next)
    space[0, 0] = blocks[0, 0] = 0.0  # the memory of the tables lives to the end
