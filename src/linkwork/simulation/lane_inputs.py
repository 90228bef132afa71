"""The inputs of the members in the lanes: each follows its own signal, or one that all share.

Names as in `lanes`.
"""

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.lane_rows import BREAK, LIVE, MEMBER, PIECE, STEP, TIME
from linkwork.simulation.native_loop import ROUNDING
from linkwork.simulation.vectors import LANES


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


@njit(forceinline=True, **OPTIONS)
def set_forces(theta, starts, coefficients, pieces, x, n, now, tally):
    """Evaluate the signals of all lanes at the times of a stage, t + theta h."""
    for lane in range(LANES):
        if now[LIVE, lane] > 0:
            signal, time = shared(tally[MEMBER, lane], pieces.size - 1), now[TIME, lane] + theta * now[STEP, lane]
            force(starts, coefficients, pieces, signal, time, True, x, n, lane, tally)
