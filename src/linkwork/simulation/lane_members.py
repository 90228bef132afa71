"""The members that go through the lanes: each is loaded into a lane where it starts, and stored
when it stops.

Names as in `lanes`.
"""

from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_inputs import force, next_target, shared, signal_of
from linkwork.simulation.lane_refusals import goes_on
from linkwork.simulation.lane_samples import keep_sample
from linkwork.simulation.lane_starts import block_row
from linkwork.simulation.lane_tables import (
    BEND,
    BREAK,
    CAUSE,
    CLOSURE_ERROR,
    COUNTS,
    GROWTH,
    IDEAL,
    LAST,
    LIVE,
    LONGEST,
    MEMBER,
    NUMBERS,
    PIECE,
    ROW,
    SAVED,
    START,
    STATUS,
    STIFFLY,
    TARGET,
)
from linkwork.simulation.lane_turns import keep_turns
from linkwork.simulation.native_loop import STEP_UNDERFLOW, STIFF
from linkwork.simulation.native_pace import LARGEST_FACTOR
from linkwork.simulation.native_parts import SINGULAR
from linkwork.simulation.status import Status
from linkwork.simulation.vectors import LANES, call_wide

CANCELLED = int(Status.CANCELLED)


class Roster(NamedTuple):
    """The M members of a call, and where each starts: its last state and whole turns are left in
    `y` and `turns`.

    y (M, n), turns (M, nq)
    numbers (M, 4): when it starts and stops [s], the bound of its pivots, and its first step [s], 0
        where that is guessed
    counts (M, 4): its row of the tables of signals and parameters, which may serve all; the steps
        that it may take; its first time to save at, and the last one but before it
    """

    y: Any
    turns: Any
    numbers: Any
    counts: Any


class Results(NamedTuple):
    """What comes of the M members: samples (M, K, n); numbers (M, NUMBERS) and counts
    (M, COUNTS); ended (1,): how many have ended."""

    samples: Any
    numbers: Any
    counts: Any
    ended: Any


@njit(**INLINED)
def stopped(tables):
    """Tell whether any member in a lane has stopped."""
    count = 0
    for lane in range(LANES):
        count += tables.tally[MEMBER, lane] >= 0 and not goes_on(lane, tables.now, tables.tally)
    return count > 0


@njit(**INLINED)
def fill(waiting, members, signals, parameters, begun, save_at, results, turned, tables):
    """Store the members that have stopped, and load the ones that wait, from number `waiting` on,
    into their lanes.

    turned: whether any turn was counted before. Return how many lanes have a member that goes on,
    and who waits then.
    """
    now, tally, live, count = tables.now, tables.tally, 0, members.counts.shape[0]
    for lane in range(LANES):
        while True:  # until the lane has a member that goes on, or there are none left
            if tally[MEMBER, lane] >= 0:
                if goes_on(lane, now, tally):
                    break
                store_member(lane, members, results, turned, tables)
                results.ended[0] += tally[STATUS, lane] != SINGULAR and tally[STATUS, lane] != STIFF
                tally[MEMBER, lane] = -1
            if waiting == count:
                break
            load_member(
                waiting, lane, members, signals, parameters, begun, save_at, results, turned, tables
            )
            waiting += 1
        alive = tally[MEMBER, lane] >= 0
        now[LIVE, lane] = 1.0 if alive else 0.0
        live += alive
    return live, waiting


@njit(**INLINED)
def load_member(i, lane, members, signals, parameters, begun, save_at, results, turned, tables):
    """Put a started member into a lane; turned: whether any turn was counted before."""
    n, y, x, k, now, tally = tables.n, tables.y, tables.x, tables.k, tables.now, tables.tally
    inputs, place, begin = signals.coefficients.shape[2], i % LANES, block_row(i, n)
    # What came of its start.
    for m in range(COUNTS):
        tally[m, lane] = results.counts[i, m]
    for m in range(NUMBERS):
        now[m, lane] = begun[begin + m, place]
    for m in range(n):
        y[m, lane] = begun[begin + NUMBERS + m, place]
    for m in range(tables.nq if turned else 0):
        tables.turned[m, lane] = members.turns[i, m]
    for m in range(n + 1):
        k[m, lane] = begun[begin + NUMBERS + n + m, place]
    signal = signal_of(signals, tally[ROW, lane])
    row = shared(tally[ROW, lane], parameters.shape[0])
    for m in range(parameters.shape[1]):
        x[n + inputs + m, lane] = tables.z[tables.nq + m, lane] = parameters[row, m]
    # How it is to go on.
    now[GROWTH, lane], now[LONGEST, lane], now[IDEAL, lane] = LARGEST_FACTOR, 0.0, 0.0
    tally[MEMBER, lane], tally[CAUSE, lane], tally[STIFFLY, lane] = i, STEP_UNDERFLOW, 0
    tally[PIECE, lane], tally[BREAK, lane], tally[BEND, lane] = 0, signals.breaking[signal], 0
    start, first = now[START, lane], tally[SAVED, lane]
    force(signals, signal, start, False, x, n, lane, tally)
    now[TARGET, lane] = next_target(signals, signal, start, lane, now, tally)
    if first < tally[LAST, lane] and save_at[first] == start:
        keep_sample(i, first, lane, y, results.samples, tables)
        tally[SAVED, lane] = first + 1


@njit(**INLINED)
def store_member(lane, members, results, turned, tables):
    """Keep what the member in a lane has come to; turned: whether any turn was counted before."""
    y, now, tally = tables.y, tables.now, tables.tally
    i = tally[MEMBER, lane]
    for m in range(tables.n):
        members.y[i, m] = y[m, lane]
    for m in range(NUMBERS):
        results.numbers[i, m] = now[m, lane]
    for m in range(COUNTS):
        results.counts[i, m] = tally[m, lane]
    if turned:
        keep_turns(i, lane, members.turns, tables)


@njit(**OPTIONS)
def leave(waiting, members, begun, results, turned, tables):
    """Cancel the members that are in the lanes, where they are, and those that wait, from number
    `waiting` on."""
    n, tally = tables.n, tables.tally
    for lane in range(LANES):
        if tally[MEMBER, lane] >= 0:
            tally[STATUS, lane] = CANCELLED
            store_member(lane, members, results, turned, tables)
    for i in range(waiting, results.counts.shape[0]):
        results.counts[i, STATUS] = CANCELLED
        place, begin = i % LANES, block_row(i, n)
        for m in range(NUMBERS):
            results.numbers[i, m] = begun[begin + m, place]
        for m in range(n):
            members.y[i, m] = begun[begin + NUMBERS + m, place]


@njit(**OPTIONS)
def measure_closure(closure, members, numbers, parameters, tables):
    """Keep the residuals of the last states reached."""
    nq, z, z_next, states, counts = tables.nq, tables.z, tables.z_next, members.y, members.counts
    count = counts.shape[0]
    for first in range(0, count, LANES):
        for lane in range(LANES):
            i = min(first + lane, count - 1)
            row = shared(counts[i, 0], parameters.shape[0])
            for m in range(nq):
                z[m, lane] = states[i, m]
            for m in range(parameters.shape[1]):
                z[nq + m, lane] = parameters[row, m]
        call_wide(closure, z, z_next, 0)
        for lane in range(min(LANES, count - first)):
            worst = max(numbers[first + lane, CLOSURE_ERROR], z_next[nq, lane])
            numbers[first + lane, CLOSURE_ERROR] = worst
