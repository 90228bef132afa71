"""Between the steps of many robots, compiled: readings, and members put where others are."""

import numpy as np
from numba import types

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.lane_tables import NOW, STEP, room
from linkwork.simulation.native_parts import inputs_of
from linkwork.simulation.pointers import pointer, uncounted
from linkwork.simulation.vectors import LANES, as_table, call_wide
from linkwork.stepping.native_many import (
    NUMBERS,
    SIGNATURE,
    WHEN,
    LaneBlock,
    set_inputs,
    taken,
)

_motion, _closure, _plan, _table, _timed, _herd, _asked, _members = SIGNATURE
_results = types.Array(types.float64, 2, "C")


@compiled_once(
    "readings of many robots", (_motion, _table, _timed, _herd, _asked, _members, _results)
)
def readings(kernel, table, timed, herd, asked, members, out):
    """Write what a kernel for states side by side gives for members in one chart to their rows of
    `out` (N, numbers).

    kernel: its address; table, timed, asked: as of `native_many.steps`
    """
    # Where LANES members are computed.
    herd, asked = uncounted(herd), uncounted(asked)
    signal, _ = inputs_of(pointer(table))
    n, forces, p, count = herd.y.shape[0], herd.u.shape[0], herd.p.shape[0], out.shape[1]
    width = n + signal.columns + p
    space, inputs = room(width + count + NOW + NUMBERS), np.empty(signal.columns + 1)
    who = np.empty(LANES, np.intp)
    x, found = as_table(space), as_table(space[width:])
    now, own = as_table(space[width + count :]), as_table(space[width + count + NOW :])
    block = LaneBlock(x, x, found, x, x, now, own, pointer(inputs), who, n, 0)
    for begun in range(0, members.size, LANES):
        live = min(LANES, members.size - begun)
        for lane in range(LANES):
            who[lane] = members[begun + min(lane, live - 1)]
        first = who[0] if live == LANES and who[LANES - 1] - who[0] == LANES - 1 else -1
        # States, forces and parameters as they are, and what varies in time.
        taken(herd.y, n, first, block, x, 0)
        taken(herd.u, forces, first, block, x, n + asked.first)
        taken(herd.p, p, first, block, x, n + signal.columns)
        if timed:
            for lane in range(LANES):
                own[WHEN, lane], now[STEP, lane] = herd.numbers[WHEN, who[lane]], 0.0
            set_inputs(0.0, signal, herd, asked, block)
        call_wide(kernel, x, found, 0)
        for lane in range(live):
            for m in range(count):
                out[who[lane], m] = found[m, lane]
    space[0, 0] = inputs[0] = 0.0  # the memory of the block lives to the end


@compiled_once("members put where others are", (_herd, _members, _herd, _members))
def transfer(herd, members, other, of):
    """Put members where members of other steppers are."""
    for i in range(members.size):
        here, there = members[i], of[i]
        for m in range(herd.y.shape[0]):
            herd.y[m, here], herd.held[m, here] = other.y[m, there], other.held[m, there]
        for m in range(herd.turns.shape[0]):
            herd.turns[m, here] = other.turns[m, there]
        for m in range(herd.u.shape[0]):
            herd.u[m, here] = other.u[m, there]
        for m in range(herd.p.shape[0]):
            herd.p[m, here] = other.p[m, there]
        for m in range(NUMBERS):
            herd.numbers[m, here] = other.numbers[m, there]
        herd.status[here] = other.status[there]
