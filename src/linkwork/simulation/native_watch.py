"""What happens within a step, unseen by its stages: compiled parts of the integrators' loop.

Where an input bends more often than `bends` calls free within a step that would be accepted, the
dense output Y is looked at in two places: where the input is farthest from the line through its
values at the step's ends, which finds what is narrow, and from the cubic through its slopes there
as well, which finds what is small on a curved background. There

    h |f(Y(theta), u(t + theta h)) - dY/dt| / blur

in the norm of the errors is an error of the step like any other; `blur` is the method's own, as its
`StepPlan` tells. A refused step is tried again no shorter than to where bends are free.

Where the motion itself comes to a peak, as the fall of the steps tells (`native_pace`), the
estimate of a step's error may be small by accident, hundreds of times too small where a step
reaches across the peak. So it may be where the weakest pivot falls below WANING of what it was at
the step's start: towards where the independent rates determine nothing, and no farther, the Taylor
series of the motion in them converges. There the defect in the middle of the step counts, KEEN
times.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.native_pace import fallen
from linkwork.simulation.native_parts import (
    NON_FINITE,
    OK,
    REFUSED,
    copy,
    error_norm,
    evaluate,
    extend,
    force,
    inputs_of,
    interpolate,
    padded,
)
from linkwork.simulation.pointers import combine
from linkwork.simulation.signals import FREE

CLEARLY = (
    1 + 1e-6
)  # factor by which a bend is farther than another: of equals in a symmetric pulse the first counts
KEEN = 4.0  # factor on what a defect counts at a peak, where errors are larger than their estimates
WANING = 1 / 3  # of the pivot at a step's start, below which pivots in it have fallen far


class WatchedSignals(NamedTuple):
    """Signals to watch, as `Inputs`, and their `bends`, count + 1 rows of three numbers.

    The last `strict` of the columns are read by event functions: no step passes more bends of them
    than are free.
    """

    knots: Any
    coefficients: Any
    pieces: int
    columns: int
    bends: Any
    count: int
    strict: int


@njit(**INLINED)
def watch_of(table, strict):
    """Return what is to be watched of the signals that a `Signal.table` holds."""
    signals, behind = inputs_of(table)
    bends, count = behind + int(table[2]), int(table[3])
    return WatchedSignals(
        signals.knots, signals.coefficients, signals.pieces, signals.columns, bends, count, strict
    )


@njit(**INLINED)
def next_bend(watch, t, bend):
    """Return the number of the first bend after t; `bend` is one before it."""
    while bend < watch.count and watch.bends[3 * bend] <= t:
        bend += 1
    return bend


@njit(**INLINED)
def free_until(watch, bend):
    """Return the time up to which a step may go before `bend` without being looked into."""
    return watch.bends[3 * bend + 2]


@njit(**OPTIONS)
def piece_at(knots, pieces, t):
    """Return the piece of a signal that ends at or after t, and begins before."""
    low, high = 0, pieces - 1
    while low < high:
        middle = (low + high) // 2
        if knots[middle + 1] < t:
            low = middle + 1
        else:
            high = middle
    return low


@njit(**OPTIONS)
def value_at(watch, t, j):
    """Return a column of the watched signals at a time, and its slope."""
    piece = piece_at(watch.knots, watch.pieces, t)
    s, c, columns = (
        t - watch.knots[piece],
        watch.coefficients + 4 * watch.columns * piece + j,
        watch.columns,
    )
    value = c[0] + s * (c[columns] + s * (c[2 * columns] + s * c[3 * columns]))
    return value, c[columns] + s * (2 * c[2 * columns] + s * 3 * c[3 * columns])


@njit(**OPTIONS)
def farthest_bends(watch, j, bend, t, h):
    """Return how many bends of a column, from a bend on, lie within a step, and the thetas of two
    of them: where it is farthest from the line through its values at both ends, and from the cubic
    through its slopes as well.
    """
    before, slope_before = value_at(watch, t, j)
    after, slope_after = value_at(watch, t + h, j)
    count, by_line, by_cubic, farthest, farther = 0, 0.5, 0.5, 0.0, 0.0
    while bend < watch.count and watch.bends[3 * bend] < t + h:
        time = watch.bends[3 * bend]
        if watch.bends[3 * bend + 1] == j:
            a = (time - t) / h
            b = 1 - a
            value, line = value_at(watch, time, j)[0], b * before + a * after
            cubic = b * b * ((1 + 2 * a) * before + a * h * slope_before)
            cubic += a * a * ((1 + 2 * b) * after - b * h * slope_after)
            if abs(value - line) > CLEARLY * farthest:
                by_line, farthest = a, abs(value - line)
            if abs(value - cubic) > CLEARLY * farther:
                by_cubic, farther = a, abs(value - cubic)
            count += 1
        bend += 1
    return count, by_line, by_cubic


@njit(**OPTIONS)
def defect_within(run, theta):
    """Return how far the dense output is from a solution at t + theta h, as an error of the step,
    and what ails it there."""
    method, room, t, h = run.method, run.room, run.t, run.step
    interpolate(run, theta)
    copy(room.sample, room.x, room.n)
    force(run.inputs, t + theta * h, True, run.piece, room.x + room.n)
    ailment, _ = evaluate(run, method.stages)
    if ailment != OK:
        return 0.0, ailment
    # The slope of the dense output: d b_i / d theta = sum_m (m + 1) P_im theta^m.
    powers, weights, stages, power = room.powers, room.weights, method.stages, 1.0
    for m in range(method.degree):
        powers[m] = (m + 1) * power
        power *= theta
    combine(powers, method.degree, 1.0, room.zeros, method.dense, padded(stages), stages, weights)
    combine(weights, stages, 1.0, room.zeros, room.k, room.width, room.n, room.sample)
    slope, sample = room.k + stages * room.width, room.sample
    for m in range(room.n):
        sample[m] = slope[m] - sample[m]
    error = error_norm(run, sample, h, 0) / method.blur
    return error, OK if math.isfinite(error) else NON_FINITE


@njit(**OPTIONS)
def unseen(run):
    """Return the error of a step through what its stages may not have seen, and what ails it
    there."""
    watch, error, ailment = run.watch, 0.0, OK
    for j in range(watch.columns):
        count, by_line, by_cubic = farthest_bends(watch, j, run.bend, run.t, run.step)
        if count > FREE and j >= watch.columns - watch.strict:
            return REFUSED, OK
        for i in range(0 if count <= FREE else 1 if by_line == by_cubic else 2):
            if ailment == OK:
                defect, ailment = defect_within(run, by_line if i == 0 else by_cubic)
                error = max(error, defect)
    return error, ailment


@njit(**INLINED)
def unsure(run):
    """Tell whether the estimate of a trial step's error may be small by accident: where steps have
    fallen, or its pivots fall."""
    rhythm = run.rhythm
    waning = run.lowest < WANING * run.first_pivot
    return waning or fallen(rhythm.step, rhythm.longest, rhythm.ideal)


@njit(**OPTIONS)
def look_into(run):
    """Look into a step with a small error for what its stages may not have seen: in the middle,
    where that error is unsure, or at bends."""
    run.ailment = extend(run)
    if run.ailment == OK and unsure(run):
        defect, run.ailment = defect_within(run, 0.5)
        run.error = max(run.error, KEEN * defect)
    free = free_until(run.watch, run.bend)
    if run.ailment == OK and run.error <= 1 and free < run.arrival:
        defect, run.ailment = unseen(run)
        run.error, run.least = max(run.error, defect), free - run.t
