"""What happens between two steps, and where the next one has to end: compiled parts of the
integrators' loop."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.native_parts import ROUNDING, add_turns, copy
from linkwork.simulation.pointers import call, pointer


class Schedule(NamedTuple):
    """Say where steps have to end, beside the end of the run and where a controller acts: at the
    `count` `breaks` of the signals, and at the multiples of the `length` of fixed steps
    (0: there is none).
    """

    breaks: Any
    count: int
    length: float


@njit(**INLINED)
def set_target(run):
    """Find where a step from here has to end, and the numbers of the next break and of the next
    multiple of a fixed length."""
    course, (breaks, count, length) = run.course, run.schedule
    t, end, next_break, grid = run.t, course.stop, run.next_break, run.grid
    near = ROUNDING * (length if length > 0 else t - course.start)
    while next_break < count and breaks[next_break] <= t + near:
        next_break += 1
    while length > 0 and grid * length <= t + ROUNDING * length:
        grid += 1
    if next_break < count:
        end = min(end, breaks[next_break])
    if course.period > 0:
        end = min(end, run.next_sample * course.period)
    if length > 0:
        end = min(end, grid * length)
    run.target, run.next_break, run.grid = end, next_break, grid


@njit(**INLINED)
def due(run):
    """Tell whether a controller acts here."""
    period = run.course.period
    return period > 0 and run.next_sample * period <= run.t + ROUNDING * period


@njit(**OPTIONS)
def act(run):
    """Let a controller set the held inputs, in the state at x and in the row just written if that
    is of this time; return which of them is not finite, or -1.
    """
    room, signals, held = run.room, run.inputs.columns, run.held
    count, row = room.inputs - signals, run.rows + (run.saved - 1) * run.columns
    add_turns(room.x, run.turns, room.nq)
    call(run.kernels.control, room.x, held)
    copy(room.y, room.x, room.nq)
    copy(held, room.x + room.n + signals, count)
    if run.saved > 0 and row[0] == run.t:
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
