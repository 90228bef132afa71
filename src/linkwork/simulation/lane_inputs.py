"""The inputs of the members in the lanes: each follows its own signal, or one that all share.

Names as in `lanes`.
"""

from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED
from linkwork.simulation.lane_tables import BREAK, LIVE, PIECE, ROW, START, STEP, STOP, TIME
from linkwork.simulation.native_parts import ROUNDING
from linkwork.simulation.vectors import LANES


class Signals(NamedTuple):
    """The members' signals, one after the other, or one that all share.

    Signal i consists of the pieces from `pieces[i]` to `pieces[i + 1]`, which begin at `starts` and
    are polynomials of the `coefficients` (pieces, powers, inputs), and of the breaks from
    `breaking[i]` to `breaking[i + 1]`. `timed`: whether any varies over the run.
    """

    starts: Any
    coefficients: Any
    pieces: Any
    breaks: Any
    breaking: Any
    timed: bool


@njit(**INLINED)
def shared(i, rows):
    """Return row i of a table of which one row may serve all."""
    return i if rows > 1 else 0


@njit(**INLINED)
def signal_of(signals, row):
    """Return the signal of a row, which may be that of all."""
    return shared(row, signals.pieces.size - 1)


@njit(**INLINED)
def force(signals, i, t, from_left, x, n, lane, tally):
    """Evaluate signal i at t into x[n:] of the lane, and keep its piece, from which to look for the
    next."""
    starts, c, pieces = signals.starts, signals.coefficients, signals.pieces
    first, last = pieces[i], pieces[i + 1] - 1
    piece = max(tally[PIECE, lane], first)
    while piece < last and (t > starts[piece + 1] or (t == starts[piece + 1] and not from_left)):
        piece += 1
    while piece > first and (t < starts[piece] or (t == starts[piece] and from_left)):
        piece -= 1
    tally[PIECE, lane] = piece
    s = t - starts[piece]
    for j in range(c.shape[2]):
        value = c[piece, c.shape[1] - 1, j]
        for power in range(c.shape[1] - 2, -1, -1):
            value = c[piece, power, j] + s * value
        x[n + j, lane] = value


@njit(**INLINED)
def next_target(signals, i, t, lane, now, tally):
    """Return the next time at which a step of a lane has to end, by signal i."""
    breaks, end, stop = signals.breaks, signals.breaking[i + 1], now[STOP, lane]
    past = t + ROUNDING * (t - now[START, lane])
    while tally[BREAK, lane] < end and breaks[tally[BREAK, lane]] <= past:
        tally[BREAK, lane] += 1
    return min(stop, breaks[tally[BREAK, lane]]) if tally[BREAK, lane] < end else stop


@njit(**INLINED)
def set_forces(signals, theta, x, n, now, tally):
    """Evaluate the signals of all lanes at the times of a stage, t + theta h."""
    for lane in range(LANES):
        if now[LIVE, lane] > 0:
            time = now[TIME, lane] + theta * now[STEP, lane]
            force(signals, signal_of(signals, tally[ROW, lane]), time, True, x, n, lane, tally)
