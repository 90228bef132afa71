"""The tables in which the lanes compute, and names of the rows that tell what becomes of the
members in them."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.vectors import LANES, as_table

ALIGNMENT = 64


class Tables(NamedTuple):
    """Where the lanes compute; rows as in `lanes`.

    `y`: states at the starts of the steps; `x`: (y, u, p); `k`: (y', pivot), stage after stage;
    `z`: (q, p); `z_next`: what the closure gives; `sample`: a state within, or the defect;
    `weights`, one for each stage; `scale`: rtol, then atol; `zeros`, as many as a state has;
    `spans`, `wraps`, `turned`, of the angles' whole turns; `kept`: states set aside; `now`,
    `tally`: numbers and counts of the members. A state has n numbers, of which nq are q.
    `shortest`: of the spans.
    """

    y: Any
    x: Any
    k: Any
    z: Any
    z_next: Any
    sample: Any
    weights: Any
    scale: Any
    zeros: Any
    spans: Any
    wraps: Any
    turned: Any
    kept: Any
    now: Any
    tally: Any
    n: int
    nq: int
    shortest: float


class Sizes(NamedTuple):
    """What the size of a number of the state means: tolerance (2, n), rtol and atol; turning (2,
    nq), the spans and wraps of `turns.Turning`."""

    tolerance: Any
    turning: Any


# Rows of `now`, numbers; the first NUMBERS are kept of every member. A member goes from START to
# STOP [s], while its pivots are above BOUND.
TIME, STEP_SIZE, PIVOT, CLOSURE_ERROR, REJECTED_PIVOT, REJECTED_RESIDUAL, LOOSE = range(7)
START, STOP, BOUND = range(7, 10)
NUMBERS = 10
(
    GROWTH,
    LONGEST,
    IDEAL,
    STEP,
    ARRIVAL,
    TARGET,
    LIVE,
    ERROR,
    RESIDUAL,
    LOWEST,
    ACCEPTS,
    WANTED,
    THETA,
    LEAST,
    UNSURE,
) = range(10, 25)
NOW = 25

# Rows of `tally`, counts; the first COUNTS are kept of every member, too. ROW is that of its signal
# and of its parameters; it may take MOST steps, and saves its states at the times of `save_at` up
# to before LAST. MEMBER is its number.
STATUS, EVALUATIONS, ACCEPTED, REJECTED, SAVED, ROW, MOST, LAST = range(8)
COUNTS = 8
CAUSE, PIECE, BREAK, BEND, MEMBER, REACHED, AILMENT, STIFFLY = range(8, 16)
EXTENDED, HALTED, OBSERVED = range(16, 19)
TALLY = 19


@njit(**OPTIONS)
def room(rows):
    """Return zeros (rows, LANES) that start at a multiple of ALIGNMENT bytes."""
    memory = np.zeros(rows * LANES + ALIGNMENT // 8)
    first = -memory.ctypes.data % ALIGNMENT // 8
    return memory[first : first + rows * LANES].reshape(rows, LANES)


@njit(**INLINED)
def rows_of(n, nq, inputs, free, stages):
    """Return where the tables end that `furnish` deals out; free: number of parameters."""
    x, k, z = n + inputs + free, (stages + 1) * (n + 1), nq + free
    sizes = (n, x, k, z, nq + 1, n, stages, 2 * n, n, nq, nq, nq, n, NOW)  # as in `Tables`
    return np.cumsum(np.array(sizes))


@njit(**INLINED)
def furnish(space, counts, end, n, nq, sizes):
    """Return the tables, one after the other in some space, which has to be kept alive, with what
    all lanes share."""
    for m in range(n):
        space[end[6] + m], space[end[6] + n + m] = sizes.tolerance[0, m], sizes.tolerance[1, m]
    shortest = np.inf
    for m in range(nq):
        space[end[8] + m], space[end[9] + m] = sizes.turning[0, m], sizes.turning[1, m]
        shortest = min(shortest, sizes.turning[0, m])
    counts[MEMBER] = -1
    return Tables(
        as_table(space),
        as_table(space[end[0] :]),
        as_table(space[end[1] :]),
        as_table(space[end[2] :]),
        as_table(space[end[3] :]),
        as_table(space[end[4] :]),
        as_table(space[end[5] :]),
        as_table(space[end[6] :]),
        as_table(space[end[7] :]),
        as_table(space[end[8] :]),
        as_table(space[end[9] :]),
        as_table(space[end[10] :]),
        as_table(space[end[11] :]),
        as_table(space[end[12] :]),
        as_table(counts),
        n,
        nq,
        shortest,
    )
