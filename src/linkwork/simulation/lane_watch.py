"""What happens within the steps of the members in the lanes, unseen by their stages: as in
`native_watch`, lane by lane.

Names as in `lanes`.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_inputs import force, set_forces, signal_of
from linkwork.simulation.lane_samples import interpolate, weigh_stages, weighed
from linkwork.simulation.lane_tables import (
    ACCEPTS,
    AILMENT,
    ARRIVAL,
    BEND,
    BOUND,
    ERROR,
    EVALUATIONS,
    IDEAL,
    LEAST,
    LIVE,
    LONGEST,
    LOWEST,
    REJECTED_PIVOT,
    ROW,
    STEP,
    STEP_SIZE,
    THETA,
    TIME,
    UNSURE,
    WANTED,
)
from linkwork.simulation.native_pace import SHORT, STEEP
from linkwork.simulation.native_parts import NON_FINITE, OK, SINGULAR
from linkwork.simulation.native_watch import (
    KEEN,
    WANING,
    WatchedSignals,
    farthest_bends,
    free_until,
    next_bend,
)
from linkwork.simulation.pointers import pointer
from linkwork.simulation.signals import FREE
from linkwork.simulation.vectors import (
    LANES,
    absolute,
    call_wide,
    choose,
    larger,
    load,
    root,
    some,
    splat,
    store,
)


class LaneSignals(NamedTuple):
    """The signals to watch, one after the other as in `Signals`, or one for all; signal i has the
    `bends` from `bending[i]` to `bending[i + 1]`.
    """

    starts: Any
    coefficients: Any
    pieces: Any
    bends: Any
    bending: Any


@njit(**INLINED)
def watch_of(watched, row):
    """Return what is to be watched of a row, which may be that of all."""
    i, columns = signal_of(watched, row), watched.coefficients.shape[2]
    first, count = watched.pieces[i], watched.pieces[i + 1] - watched.pieces[i]
    bends, bend = watched.bending[i + 1] - watched.bending[i] - 1, watched.bending[i]
    return WatchedSignals(
        pointer(watched.starts) + first, pointer(watched.coefficients) + 4 * columns * first,
        count, columns,
        pointer(watched.bends) + 3 * bend, bends, 0,
    )  # fmt: skip


@njit(**OPTIONS)
def mark_bent(watched, now, tally):
    """Mark the lanes whose steps, though they would be accepted, pass more bends than are free;
    return how many."""
    count = 0
    for lane in range(LANES):
        now[LEAST, lane] = 0.0
        if now[ACCEPTS, lane] > 0:
            watch = watch_of(watched, tally[ROW, lane])
            tally[BEND, lane] = next_bend(watch, now[TIME, lane], tally[BEND, lane])
            free = free_until(watch, tally[BEND, lane])
            if free < now[ARRIVAL, lane]:
                now[LEAST, lane] = free - now[TIME, lane]
                count += 1
    return count


@njit(**INLINED)
def mark_unsure(tables):
    """Mark the lanes that have come to a peak of the motion, or whose pivots fall, with steps that
    would be accepted, as `native_watch.unsure` tells; tell whether there are any."""
    now, first_pivot = tables.now, load(tables.k, tables.n)
    h = load(now, STEP_SIZE)
    steady = (h >= splat(STEEP) * load(now, IDEAL)) & (h >= splat(SHORT) * load(now, LONGEST))
    steady = steady & (load(now, LOWEST) >= splat(WANING) * first_pivot)
    unsure = choose(steady, splat(0.0), load(now, ACCEPTS))
    store(now, UNSURE, unsure)
    return some(unsure >= splat(1.0))


@njit(**OPTIONS)
def inspect(motion, method, signals, watched, unsure, bent, tables):
    """Refuse the steps of the marked lanes in which the dense output is too far from a solution,
    where their errors are unsure or an input bends; unsure, bent: whether any lane is marked for
    that.

    x is left as it was: the new state, under the inputs at its end.
    """
    n, x, kept, now, tally = tables.n, tables.x, tables.kept, tables.now, tables.tally
    for m in range(n):
        store(kept, m, load(x, m))
    if unsure:
        store(now, WANTED, load(now, UNSURE) * load(now, ACCEPTS))
        store(now, THETA, splat(0.5))
        measure(motion, method, signals, KEEN, tables)
        refuse(now, 0.0)
    for place in range(2 * watched.coefficients.shape[2] if bent else 0):
        j, wanted = place // 2, 0
        for lane in range(LANES):
            now[WANTED, lane], now[THETA, lane] = 0.0, 1.0
            if now[LEAST, lane] > 0 and now[ACCEPTS, lane] > 0:
                watch = watch_of(watched, tally[ROW, lane])
                count, by_line, by_cubic = farthest_bends(
                    watch, j, tally[BEND, lane], now[TIME, lane], now[STEP, lane]
                )
                if count > FREE and (place % 2 == 0 or by_line != by_cubic):
                    now[WANTED, lane], now[THETA, lane] = (
                        1.0,
                        by_line if place % 2 == 0 else by_cubic,
                    )
                    wanted += 1
        if wanted > 0:
            measure(motion, method, signals, 1.0, tables)
    refuse(now, 1.0)
    for m in range(n):
        store(x, m, load(kept, m))
    if signals.timed:
        set_forces(signals, method.c[method.solution], x, n, now, tally)


@njit(**INLINED)
def refuse(now, bent):
    """Refuse the steps whose errors are too large; bent: 1 where bends refuse them, 0 where errors
    are unsure."""
    for lane in range(LANES):
        if now[ERROR, lane] > 1:
            now[ACCEPTS, lane] = 0.0
            now[LEAST, lane] *= bent


@njit(**OPTIONS)
def measure(motion, method, signals, factor, tables):
    """Take into the errors of the lanes that want it, times a factor, how far the dense output is
    from a solution at theta."""
    n, y, x, k, now, tally = tables.n, tables.y, tables.x, tables.k, tables.now, tables.tally
    stages, h, total = method.stages, load(now, STEP), splat(0.0)
    interpolate(method, tables, x)
    for lane in range(LANES if signals.timed else 0):
        if now[LIVE, lane] > 0:
            time = now[TIME, lane] + now[THETA, lane] * now[STEP, lane]
            force(signals, signal_of(signals, tally[ROW, lane]), time, True, x, n, lane, tally)
    call_wide(motion, x, k, stages * (n + 1))
    weigh_stages(method, True, tables)
    for m in range(n):
        slope = weighed(stages, m, tables)
        size = larger(absolute(load(y, m)), absolute(load(tables.kept, m)))
        scale = load(tables.scale, n + m) + load(tables.scale, m) * size
        ratio = absolute(h * (load(k, stages * (n + 1) + m) - slope)) / scale
        total = total + ratio * ratio
    store(tables.sample, 0, splat(factor) * (root(total / splat(float(n))) / splat(method.blur)))
    for lane in range(LANES):
        # The defect, in tolerances, of those that want it.
        if now[WANTED, lane] > 0:
            judge_defect(lane, stages * (n + 1) + n, tables)


@njit(**INLINED)
def judge_defect(lane, pivot_row, tables):
    """Take the defect of a lane into its error, or say what ails it."""
    now, tally, pivot, defect = (
        tables.now,
        tables.tally,
        tables.k[pivot_row, lane],
        tables.sample[0, lane],
    )
    tally[EVALUATIONS, lane] += 1
    ailment = OK if math.isfinite(defect) else NON_FINITE
    if not pivot >= now[BOUND, lane]:
        ailment = NON_FINITE if math.isnan(pivot) else SINGULAR
    if ailment == OK:
        now[ERROR, lane] = max(now[ERROR, lane], defect)
    else:
        now[ACCEPTS, lane], tally[AILMENT, lane] = 0.0, ailment
        now[REJECTED_PIVOT, lane] = now[LOWEST, lane]
