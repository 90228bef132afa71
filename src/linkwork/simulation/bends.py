"""Bends of a signal: where its third derivative turns round, by which a step tells whether it may
have passed something by.

A step sees its inputs at the times of its stages only. Over times in which u''' of no input bends
more than `signals.FREE` times u is as smooth as a polynomial of degree six or so: whatever it does,
the stages see. A pulse makes u''' bend three times at least, a burst or noise more often. Whoever
passes more bends than that has to look what happens at them (`native_watch`).

The test is of no scale: a pulse of 5 N is found on 0 N as on 1000 N, and of any width down to that
of a sample. Only bends within the rounding of the samples do not count.
"""

import numpy as np
from numba import types

from linkwork.simulation.compiled import compiled_once

SMALLEST = 2.0**-40  # differences of values that count, relative to the largest value
ROUNDING = 16 * 2.0**-52  # of times, relative to the last

_SIGNATURE = (
    types.Array(types.float64, 1, "C", readonly=True),
    types.Array(types.float64, 3, "C", readonly=True),
    types.int64,
)


@compiled_once("the search for bends of signals", _SIGNATURE)
def bends(knots, coefficients, most):
    """Return the bends of a signal in the order of their times, rows (time, number of the input,
    free), the last one infinite.

    free: the time before which no input bends more than `most` times from this bend on, itself
    included.

    knots (pieces + 1,), coefficients (pieces, 4, columns): as of a `Signal`; most: `signals.FREE`.
    """
    pieces, columns = coefficients.shape[0], coefficients.shape[2]
    # An input bends where its third derivative turns from rising to falling, by more than rounding.
    bent, count = np.zeros((pieces, columns), np.bool_), 0
    for j in range(columns):
        value = speed = 0.0
        for i in range(pieces):
            value = max(value, abs(coefficients[i, 0, j]))
            speed = max(speed, abs(coefficients[i, 1, j]))
        latest = max(abs(knots[0]), abs(knots[pieces])) if np.isfinite(knots[pieces]) else 0.0
        noise = SMALLEST * value + ROUNDING * speed * latest
        # The last extreme so far, on the side that it lies on, and the noise there.
        side, place, farthest, slack_there = 0.0, 0, 0.0, 0.0
        for i in range(pieces):
            length, third = knots[i + 1] - knots[i], coefficients[i, 3, j]
            # The third difference over a piece, without the jump that a knot may have.
            if i + 1 < pieces:
                third = (coefficients[i + 1, 2, j] - coefficients[i, 2, j]) / (3 * length)
            slack = noise / length**3
            if i == 0:
                farthest, slack_there = third, slack
            # It turned once it is behind the extreme by more than the noise of either.
            behind = side * (farthest - third)
            if side == 0 and abs(third - farthest) > max(slack, slack_there):
                side = 1.0 if third > farthest else -1.0
            elif side != 0 and behind > max(slack, slack_there):
                bent[place, j], side = True, -side
                count += 1
            elif behind > 0 or side == 0:
                continue
            place, farthest, slack_there = i, third, slack
    # From the last to the first, with the next `most` of each input at hand.
    table = np.full((count + 1, 3), np.inf)
    table[count, 1] = 0.0
    ahead = np.full((columns, most + 1), np.inf)
    for i in range(pieces - 1, -1, -1):
        for j in range(columns - 1, -1, -1):
            if bent[i, j]:
                count -= 1
                for m in range(most, 0, -1):
                    ahead[j, m] = ahead[j, m - 1]
                ahead[j, 0] = 0.5 * (knots[i] + knots[i + 1])
                table[count, 0], table[count, 1] = ahead[j, 0], j
                for other in range(columns):
                    table[count, 2] = min(table[count, 2], ahead[other, most])
    return table
