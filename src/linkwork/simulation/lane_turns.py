"""Whole turns of large angles of the members in the lanes, counted apart as in `turns`.

Names as in `lanes`.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_tables import LOOSE
from linkwork.simulation.native_parts import turns_in, without
from linkwork.simulation.vectors import LANES, absolute, larger, load, splat

LOOSER = math.nextafter(1.0, 2.0)


@njit(**INLINED)
def large(tables):
    """Tell in which lanes a coordinate may be large, beyond the shortest of all spans, or was."""
    largest = splat(0.0)
    for m in range(tables.nq):
        largest = larger(absolute(load(tables.y, m)), largest)
    return (largest >= splat(tables.shortest)) | (load(tables.now, LOOSE) >= splat(LOOSER))


@njit(**OPTIONS)
def settle(tables):
    """Count the whole turns of large angles apart, and loosen the closure where other coordinates
    are large; tell whether any turn was counted.
    """
    y, now, spans, counted = tables.y, tables.now, tables.spans, False
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


@njit(**INLINED)
def keep_turns(i, lane, turns, tables):
    """Keep the whole turns of a lane's angles for member i."""
    for m in range(tables.nq):
        turns[i, m] = tables.turned[m, lane]


@njit(**INLINED)
def any_turned(turns):
    """Tell whether any whole turn is counted."""
    count = 0
    for i in range(turns.shape[0]):
        for m in range(turns.shape[1]):
            count += turns[i, m] != 0.0
    return count > 0
