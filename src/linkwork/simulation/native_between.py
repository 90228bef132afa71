"""What happens between two steps, and where the next one has to end: compiled parts of the
integrators' loop."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_parts import add_turns, copy
from linkwork.simulation.pointers import call, pointer

ROUNDING = 1e-9


class Schedule(NamedTuple):
    """Say where steps have to end: at the `count` `breaks` of the signals, where a controller acts,
    each `period`, at the multiples of the `length` of fixed steps (0: there is none), and at
    `stop`.
    """

    start: float
    stop: float
    breaks: Any
    count: int
    period: float
    length: float


@njit(forceinline=True, **OPTIONS)
def next_end(schedule, t, next_break, grid, next_sample):
    """Return where a step from t has to end, the number of the next break and of the next multiple
    of the fixed length."""
    breaks, length, end = schedule.breaks, schedule.length, schedule.stop
    while next_break < schedule.count and breaks[next_break] <= t + ROUNDING * (t - schedule.start):
        next_break += 1
    while length > 0 and grid * length <= t + ROUNDING * length:
        grid += 1
    if next_break < schedule.count:
        end = min(end, breaks[next_break])
    if schedule.period > 0:
        end = min(end, next_sample * schedule.period)
    if length > 0:
        end = min(end, grid * length)
    return end, next_break, grid


@njit(forceinline=True, **OPTIONS)
def due(schedule, t, next_sample):
    """Tell whether a controller acts at t."""
    return schedule.period > 0 and next_sample * schedule.period <= t + ROUNDING * schedule.period


@njit(**OPTIONS)
def act(kernels, room, turns, signals, held, count, row, rewrites):
    """Let a controller set the held inputs, in the state at x and in the row just written if that
    `rewrites` what it says; return which of them is not finite, or -1.
    """
    add_turns(room.x, turns, room.nq)
    call(kernels.control, room.x, held)
    copy(room.y, room.x, room.nq)
    copy(held, room.x + room.n + signals, count)
    if rewrites:
        copy(held, row + 1 + room.n + signals, count)
    for i in range(count):
        if not math.isfinite(held[i]):
            return i
    return -1


@njit(**OPTIONS)
def resized(rows, size):
    """Return the rows in a table of another length."""
    table = np.empty((size, rows.shape[1]))
    copy(pointer(rows), pointer(table), rows.size)
    return table
