"""Readings of many robots, compiled: what a kernel says of the states that members have come to.

A kernel for states side by side gives `count` numbers of each member. The first ones are written to
the member's row of `rows` (N, first), the others to its column of `columns` (count - first, N).
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from linkwork.kernels.machine import this_machine
from linkwork.simulation.compiled import INLINED, compiled_once
from linkwork.simulation.lane_tables import NOW, STEP, room
from linkwork.simulation.pointers import POINTER, pointer, uncounted
from linkwork.simulation.structures import tuple_type
from linkwork.simulation.vectors import (
    LANES,
    as_table,
    call_wide,
    every,
    load,
    splat,
    store,
)
from linkwork.stepping.native_block import (
    NUMBERS,
    SIGNATURE,
    WHEN,
    LaneBlock,
    choose_members,
    given_by,
    put_vector,
    set_inputs,
    taken,
)

SIDE = this_machine().lanes  # of squares that are transposed in registers


class ReadingTables(NamedTuple):
    """Say where readings are written to: `rows` (N, first) and `columns` (count - first, N)."""

    rows: Any
    columns: Any


_motion, _closure, _plan, _table, _timed, _herd, _asked, _members = SIGNATURE
_results = types.Array(types.float64, 2, "C")
READING_TABLES = tuple_type(ReadingTables, _results, _results)


def _put_square(typing_context, table, row, lane, numbers, place, stride):
    """Write SIDE rows of a table in SIDE lanes, from some on, to as many rows of numbers, each
    `stride` from the one before: what stands in a lane becomes a row."""

    def generate(context, builder, signature, values):
        table, row, lane, numbers, place, stride = values
        kind, word = ir.VectorType(ir.DoubleType(), SIDE), ir.IntType(32)
        size = [ir.Constant(row.type, i) for i in range(SIDE)]
        lanes = ir.Constant(row.type, LANES)
        source = builder.inttoptr(table, ir.DoubleType().as_pointer())
        square = []
        for m in size:
            start = builder.add(builder.mul(builder.add(row, m), lanes), lane)
            vector = builder.bitcast(builder.gep(source, [start]), kind.as_pointer())
            square.append(builder.load(vector, align=8))
        # Halves, quarters, ... of pairs of vectors are exchanged.
        distance = SIDE // 2
        while distance:
            orders = [
                [i - distance + SIDE if i & distance else i for i in range(SIDE)],
                [i + SIDE if i & distance else i + distance for i in range(SIDE)],
            ]
            masks = [ir.Constant(ir.VectorType(word, SIDE), order) for order in orders]
            for i in range(SIDE):
                if not i & distance:
                    pair = square[i], square[i + distance]
                    square[i], square[i + distance] = (
                        builder.shuffle_vector(*pair, mask) for mask in masks
                    )
            distance //= 2
        for number, vector in zip(size, square, strict=True):
            start = builder.add(place, builder.mul(number, stride))
            target = builder.bitcast(builder.gep(numbers, [start]), kind.as_pointer())
            builder.store(vector, target, align=8)
        return context.get_dummy_value()

    return types.void(table, *(types.intp,) * 2, POINTER, *(types.intp,) * 2), generate


put_square: Any = intrinsic(_put_square)


@njit(**INLINED)
def tell(kernel, given, herd, asked, first, live, block, found, told):
    """Write what a kernel gives for the members whose states stand in x, at their times; return
    whether all of it is finite."""
    rows, columns = pointer(told.rows), pointer(told.columns)
    width, others, stride = told.rows.shape[1], told.columns.shape[0], told.columns.shape[1]
    # What varies in time, and what the kernel says of it.
    if given.timed:
        store(block.now, STEP, splat(0.0))
        set_inputs(0.0, given, herd, asked, block)
    call_wide(kernel, block.x, found, 0)
    # Rows of members that stand one after the other are written in squares, of which the last one
    # overlaps those before.
    if first >= 0 and width >= SIDE:
        for begun in range(0, width, SIDE):
            m = min(begun, width - SIDE)
            for lane in range(0, LANES, SIDE):
                put_square(found, m, lane, rows, (first + lane) * width + m, width)
    else:
        for lane in range(live):
            row = block.who[lane] * width
            for m in range(width):
                rows[row + m] = found[m, lane]
    nothing = splat(0.0)
    for m in range(width + others):
        nothing = nothing + splat(0.0) * load(found, m)
    for m in range(others):
        if first >= 0:
            put_vector(columns, m * stride + first, load(found, width + m))
        else:
            for lane in range(live):
                columns[m * stride + block.who[lane]] = found[width + m, lane]
    return every(nothing >= splat(0.0))


@compiled_once(
    "readings of many robots", (_motion, _table, _timed, _herd, _asked, _members, READING_TABLES)
)
def readings(kernel, table, timed, herd, asked, members, told):
    """Write what a kernel for states side by side gives for members in one chart; return whether
    all of it is finite.

    kernel: its address; table, timed, asked: as of `native_many.steps`
    """
    # Where LANES members are computed.
    herd, asked, told = uncounted(herd), uncounted(asked), uncounted(told)
    members, lanes = uncounted(members), np.empty(LANES, np.intp)
    given = given_by(table, timed)
    n, forces, p = herd.y.shape[0], herd.u.shape[0], herd.p.shape[0]
    width, count = n + given.signal.columns + p, told.rows.shape[1] + told.columns.shape[0]
    space, inputs = room(width + count + NOW + NUMBERS), np.empty(given.signal.columns + 1)
    who = uncounted(lanes)
    x, found = as_table(space), as_table(space[width:])
    now, own = as_table(space[width + count :]), as_table(space[width + count + NOW :])
    block, finite = LaneBlock(x, x, x, x, x, now, own, pointer(inputs), who, n, 0), True
    for begun in range(0, members.size, LANES):
        live = min(LANES, members.size - begun)
        first = choose_members(members, begun, live, who)
        # States, forces and parameters as they are.
        taken(herd.y, n, first, block, x, 0)
        taken(herd.u, forces, first, block, x, n + asked.first)
        taken(herd.p, p, first, block, x, n + given.signal.columns)
        taken(herd.numbers, WHEN + 1, first, block, own, 0)
        finite &= tell(kernel, given, herd, asked, first, live, block, found, told)
    space[0, 0] = inputs[0] = lanes[0] = 0  # the memory of the block lives to the end
    return finite
