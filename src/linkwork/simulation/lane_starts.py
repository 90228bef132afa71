"""How members start, LANES at a time: q is closed, the first slope evaluated, the first step
guessed where none is given.

What comes of that is kept in `begun`, block after block of LANES members, so that a lane that
becomes free takes the next member up from there. Names as in `lanes`.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED
from linkwork.simulation.lane_inputs import force, next_target, shared, signal_of
from linkwork.simulation.lane_refusals import first_ailment
from linkwork.simulation.lane_steps import project, scaled
from linkwork.simulation.lane_tables import (
    ACCEPTED,
    BOUND,
    BREAK,
    CLOSURE_ERROR,
    COUNTS,
    ERROR,
    EVALUATIONS,
    LAST,
    LOOSE,
    LOWEST,
    MOST,
    NUMBERS,
    PIECE,
    PIVOT,
    REJECTED,
    REJECTED_PIVOT,
    REJECTED_RESIDUAL,
    RESIDUAL,
    ROW,
    SAVED,
    START,
    STATUS,
    STEP,
    STEP_SIZE,
    STOP,
    TARGET,
    TIME,
    WANTED,
)
from linkwork.simulation.lane_turns import any_turned, keep_turns, large, settle
from linkwork.simulation.native_pace import BOLDNESS, FARTHEST
from linkwork.simulation.native_parts import CLOSURE_LOST, OK
from linkwork.simulation.vectors import LANES, call_wide, load, some, store


@njit(**INLINED)
def block_row(member, n):
    """Return the first row of a member's block in `begun`: the first NUMBERS rows of `now`, those
    of y, those of k_0."""
    return member // LANES * (NUMBERS + 2 * n + 1)


@njit(**INLINED)
def start_all(kernels, method, signals, limits, members, parameters, begun, results, tables):
    """Start all members, block after block; return whether any turn is counted."""
    turned = any_turned(members.turns)
    for first in range(0, members.counts.shape[0], LANES):
        turned = start_block(
            kernels, method, signals, limits, members, first, parameters, begun, results, turned,
            tables,
        )  # fmt: skip
    return turned


@njit(**INLINED)
def start_block(
    kernels, method, signals, limits, members, first, parameters, begun, results, turned, tables
):
    """Start the members from `first` on, one in each lane; return whether any turn is counted now,
    `turned` if before."""
    set_out(members, first, signals, parameters, turned, tables)
    if some(large(tables)):
        turned |= settle(tables)
    close_starts(kernels, limits, tables)
    evaluate_starts(kernels, tables)
    choose_first_steps(kernels, method, signals, limits, tables)
    keep_starts(first, begun, members, results, turned, tables)
    return turned


@njit(**INLINED)
def set_out(members, first, signals, parameters, turned, tables):
    """Put the members from `first` on into the lanes, where and when they start; the last one into
    lanes that are left."""
    y, x, z, now, tally, n = tables.y, tables.x, tables.z, tables.now, tables.tally, tables.n
    states, turns, numbers, counts = members.y, members.turns, members.numbers, members.counts
    inputs = signals.coefficients.shape[2]
    for lane in range(LANES):
        # The state, whole turns, parameters.
        i = min(first + lane, counts.shape[0] - 1)
        signal, row = signal_of(signals, counts[i, 0]), shared(counts[i, 0], parameters.shape[0])
        for m in range(n):
            y[m, lane] = states[i, m]
        for m in range(tables.nq if turned else 0):
            tables.turned[m, lane] = turns[i, m]
        for m in range(parameters.shape[1]):
            x[n + inputs + m, lane] = z[tables.nq + m, lane] = parameters[row, m]
        # How far it may go, and when it has to end a step first.
        now[TIME, lane] = now[START, lane] = numbers[i, 0]
        now[STOP, lane], now[BOUND, lane] = numbers[i, 1], numbers[i, 2]
        tally[ROW, lane], tally[MOST, lane] = counts[i, 0], counts[i, 1]
        tally[SAVED, lane], tally[LAST, lane] = counts[i, 2], counts[i, 3]
        tally[PIECE, lane], tally[BREAK, lane] = 0, signals.breaking[signal]
        force(signals, signal, now[START, lane], False, x, n, lane, tally)
        now[TARGET, lane] = next_target(signals, signal, now[START, lane], lane, now, tally)
        # Nothing was done yet.
        tally[STATUS, lane], tally[EVALUATIONS, lane] = OK, 0
        tally[ACCEPTED, lane] = tally[REJECTED, lane] = 0
        now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = 0.0
        now[STEP_SIZE, lane] = numbers[i, 3]
        now[LOOSE, lane] = now[WANTED, lane] = 1.0


@njit(**INLINED)
def close_starts(kernels, limits, tables):
    """Close the loops of q."""
    now, closure_tol = tables.now, limits.closure_tol
    if kernels.closure == 0:
        return
    project(
        kernels.closure, tables.nq, tables.y, tables.z, tables.z_next, now, closure_tol, math.inf
    )
    for lane in range(LANES):
        now[CLOSURE_ERROR, lane] = now[REJECTED_RESIDUAL, lane] = now[RESIDUAL, lane]
        if not now[RESIDUAL, lane] <= closure_tol * now[LOOSE, lane]:
            tables.tally[STATUS, lane] = CLOSURE_LOST


@njit(**INLINED)
def evaluate_starts(kernels, tables):
    """Evaluate the first slope, k_0."""
    n, k, now, tally = tables.n, tables.k, tables.now, tables.tally
    for m in range(n):
        store(tables.x, m, load(tables.y, m))
    call_wide(kernels.motion, tables.x, k, 0)
    for lane in range(LANES):
        now[PIVOT, lane], now[REJECTED_PIVOT, lane] = math.inf, 0.0
        if tally[STATUS, lane] == OK:
            tally[STATUS, lane] = first_ailment(k, 0, n, lane, now)
            tally[EVALUATIONS, lane] = 1
            now[PIVOT, lane] = now[REJECTED_PIVOT, lane] = k[n, lane]


@njit(**INLINED)
def choose_first_steps(kernels, method, signals, limits, tables):
    """Take the first steps that are given; guess the others from the slope k_0 and one a little
    ahead, k_1: see `native_pace`."""
    now, tally, guessed = tables.now, tables.tally, 0
    for lane in range(LANES):
        guessed += now[STEP_SIZE, lane] == 0
    if guessed > 0:
        look_ahead(kernels, signals, tables)
    # How much the slope changes on the way tells how far the step may go.
    for lane in range(LANES):
        if tally[STATUS, lane] == OK:
            h = now[STEP_SIZE, lane]
            if h == 0:
                ahead, steepness = now[STEP, lane], now[LOWEST, lane]
                h = ahead
                if now[RESIDUAL, lane] >= now[BOUND, lane]:
                    steepest = max(steepness, now[ERROR, lane] / ahead)
                    h = (
                        max(1e-6, 1e-3 * ahead)
                        if steepest <= 1e-15
                        else BOLDNESS * (0.01 / steepest) ** method.exponent
                    )
                    h = min(FARTHEST * ahead, h)
                tally[EVALUATIONS, lane] += 1
            now[STEP_SIZE, lane] = min(h, limits.max_step)


@njit(**INLINED)
def look_ahead(kernels, signals, tables):
    """Evaluate a slope now[STEP] ahead: leave its pivot in now[RESIDUAL], how far it is from k_0 in
    now[ERROR], and how steep k_0 is in now[LOWEST]."""
    n, y, x, k, now, tally = tables.n, tables.y, tables.x, tables.k, tables.now, tables.tally
    store(now, ERROR, scaled(y, 0, n, y, tables.scale))
    store(now, LOWEST, scaled(k, 0, n, y, tables.scale))
    for lane in range(LANES):
        size, steepness = now[ERROR, lane], now[LOWEST, lane]
        ahead = 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness
        now[STEP, lane] = min(now[TARGET, lane] - now[START, lane], ahead)
        if signals.timed:
            signal, time = signal_of(signals, tally[ROW, lane]), now[START, lane] + now[STEP, lane]
            force(signals, signal, time, True, x, n, lane, tally)
    for m in range(n):
        store(x, m, load(y, m) + load(now, STEP) * load(k, m))
    call_wide(kernels.motion, x, k, n + 1)
    store(now, RESIDUAL, load(k, 2 * n + 1))
    for m in range(n):
        store(k, n + 1 + m, load(k, n + 1 + m) - load(k, m))
    store(now, ERROR, scaled(k, n + 1, n, y, tables.scale))


@njit(**INLINED)
def keep_starts(first, begun, members, results, turned, tables):
    """Keep what came of the starts."""
    n, row, tally = tables.n, block_row(first, tables.n), tables.tally
    counts, turns = results.counts, members.turns
    for m in range(NUMBERS):
        store(begun, row + m, load(tables.now, m))
    for m in range(n):
        store(begun, row + NUMBERS + m, load(tables.y, m))
    for m in range(n + 1):
        store(begun, row + NUMBERS + n + m, load(tables.k, m))
    for lane in range(min(LANES, counts.shape[0] - first)):
        for m in range(COUNTS):
            counts[first + lane, m] = tally[m, lane]
        if turned:
            keep_turns(first + lane, lane, turns, tables)
