"""What happens within a step, unseen by its stages: compiled parts of the integrators' loop.

Where an input bends more often than `bends` calls free within a step that would be accepted, the
dense output Y is looked at in two places: where the input is farthest from the line through its
values at the step's ends, which finds what is narrow, and from the cubic through its slopes there
as well, which finds what is small on a curved background. There

    h |f(Y(theta), u(t + theta h)) - dY/dt| / blur

in the norm of the errors is an error of the step like any other; `blur` is the method's own, as its
`Plan` tells. A refused step is tried again no shorter than to where bends are free.

Where the motion itself comes to a peak, as the fall of the steps tells (`native_pace`), the
estimate of a step's error may be small by accident, hundreds of times too small where a step
reaches across the peak. There the defect in the middle of the step counts, KEEN times.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_pace import fallen
from linkwork.simulation.native_parts import (
    NON_FINITE,
    OK,
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
REFUSED = 1e300  # error of a step that may not be, whatever its error


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


@njit(forceinline=True, **OPTIONS)
def watch_of(table, strict):
    """Return what is to be watched of the signals that a `Signal.table` holds."""
    signals, behind = inputs_of(table)
    bends, count = behind + int(table[2]), int(table[3])
    return WatchedSignals(
        signals.knots, signals.coefficients, signals.pieces, signals.columns, bends, count, strict
    )


@njit(forceinline=True, **OPTIONS)
def next_bend(watch, t, bend):
    """Return the number of the first bend after t; `bend` is one before it."""
    while bend < watch.count and watch.bends[3 * bend] <= t:
        bend += 1
    return bend


@njit(forceinline=True, **OPTIONS)
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
def defect_within(kernels, inputs, method, limits, room, t, h, piece, theta):
    """Return how far the dense output is from a solution at t + theta h, as an error of the step,
    and what ails it there."""
    interpolate(method, theta, h, room)
    copy(room.sample, room.x, room.n)
    force(inputs, t + theta * h, True, piece, room.x + room.n)
    ailment, _ = evaluate(kernels.motion, room, method.stages, limits.pivot_bound)
    if ailment != OK:
        return 0.0, ailment
    power = 1.0
    for m in range(method.degree):
        room.powers[m] = (m + 1) * power
        power *= theta
    combine(
        room.powers,
        method.degree,
        1.0,
        room.zeros,
        method.dense,
        padded(method.stages),
        method.stages,
        room.weights,
    )
    combine(room.weights, method.stages, 1.0, room.zeros, room.k, room.width, room.n, room.sample)
    slope = room.k + method.stages * room.width
    for m in range(room.n):
        room.sample[m] = slope[m] - room.sample[m]
    error = error_norm(room.sample, h, 0, limits, room) / method.blur
    return error, OK if math.isfinite(error) else NON_FINITE


@njit(**OPTIONS)
def peaked(kernels, inputs, method, limits, room, t, h, piece):
    """Return the error of a step at a peak of the motion, by its dense output in the middle, and
    what ails it there."""
    defect, ailment = defect_within(kernels, inputs, method, limits, room, t, h, piece, 0.5)
    return KEEN * defect, ailment


@njit(**OPTIONS)
def unseen(kernels, inputs, watch, method, limits, room, t, h, piece, bend):
    """Return the error of a step through what its stages may not have seen, what ails it there, and
    the evaluations made."""
    error, ailment, evaluations = 0.0, OK, 0
    for j in range(watch.columns):
        count, by_line, by_cubic = farthest_bends(watch, j, bend, t, h)
        if count > FREE and j >= watch.columns - watch.strict:
            return REFUSED, OK, evaluations
        for i in range(0 if count <= FREE else 1 if by_line == by_cubic else 2):
            if ailment == OK:
                theta = by_line if i == 0 else by_cubic
                defect, ailment = defect_within(
                    kernels, inputs, method, limits, room, t, h, piece, theta
                )
                error, evaluations = max(error, defect), evaluations + 1
    return error, ailment, evaluations


class Look(NamedTuple):
    """What a look into a step says: its error, what ails it, how short it may be tried again, and
    the evaluations made."""

    error: float
    ailment: int
    least: float
    evaluations: int


@njit(**OPTIONS)
def look_into(
    kernels, inputs, watch, method, limits, room, rhythm, t, step, arrival, piece, bend, error
):
    """Look into a step with a small error for what its stages may not have seen: at a peak, or at
    bends."""
    ailment, evaluations, least = (
        extend(kernels, inputs, method, limits, room, t, step, piece),
        0,
        0.0,
    )
    if ailment == OK and fallen(rhythm.step, rhythm.longest):
        hidden, ailment = peaked(kernels, inputs, method, limits, room, t, step, piece)
        error, evaluations = max(error, hidden), 1
    if ailment == OK and error <= 1 and free_until(watch, bend) < arrival:
        hidden, ailment, calls = unseen(
            kernels, inputs, watch, method, limits, room, t, step, piece, bend
        )
        error, least = max(error, hidden), free_until(watch, bend) - t
        evaluations += calls
    return Look(error, ailment, least, method.stages - method.computed + evaluations)
