"""Members in the lanes of vector registers: what they are, and how they are taken out of the arrays
that hold them, computed, and put back. Compiled parts.

What the members are stands in arrays with a column for each, `stride` columns in a row; LANES of
them are computed at a time.

Tables, (rows, LANES) each: `y`, states at the starts of the steps; `x`, rows (y, u, p); `k`, rows
(y', pivot), stage after stage; `z`, rows (q, p); `z_next`, what the closure gives; `now`, numbers
of the members as in `lane_tables`; `own`, those that are named below.
"""

import math
from typing import Any, NamedTuple

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_tables import STEP
from linkwork.simulation.native_parts import ROUNDING, force, inputs_of
from linkwork.simulation.pointers import POINTER, pointer
from linkwork.simulation.structures import tuple_type
from linkwork.simulation.vectors import LANES, VECTOR, every, load, store

NUMBERS = 8  # rows of `numbers`
WHEN, NUMBER, LEFT, SLACK, WRITTEN, TURNED, LIMIT, ORIGIN = range(NUMBERS)
"""Of each member: the present time [s], the number of its last step, and how many are left; the
factor on the closure's tolerance, whether q was written since the last step, and whether any whole
turn may be counted; the bound of its pivots, and the time that its steps are counted from."""
SELDOM, CHANGED = SLACK, LIMIT
"""From and up to which row steps change them seldom; later ones never."""
LINE = 8  # numbers of a line of the cache


class Herd(NamedTuple):
    """Hold all members, a column each.

    y: states as the user sees them (n, stride); held: as they are moved on, angles without the
        whole `turns` (nq, stride); u: forces that are given (nu, stride); p: parameters
        (np, stride)
    numbers: rows named above; status (stride,)
    """

    y: Any
    held: Any
    turns: Any
    u: Any
    p: Any
    numbers: Any
    status: Any


class StepDemands(NamedTuple):
    """Say what is asked of all members: `turning` (2, nq), spans and wraps of `turns.Turning`; the
    length of a `step` [s]; the closure's tolerance; whether `redundant` rows ask that the end
    of every step is measured; the `first` column that the forces have among the inputs."""

    turning: Any
    step: float
    closure_tol: float
    redundant: bool
    first: int


class GivenInputs(NamedTuple):
    """Hold what is given over time: the `signal`, the `count` `breaks` where it jumps or has a
    kink, and whether it is `timed`, but for the forces."""

    signal: Any
    breaks: Any
    count: int
    timed: bool


class LaneBlock(NamedTuple):
    """Where LANES members are computed, as told above; `who`: their columns."""

    y: Any
    x: Any
    k: Any
    z: Any
    z_next: Any
    now: Any
    own: Any
    inputs: Any
    who: Any
    n: int
    nq: int


def _vector_at(typing_context, numbers, index):
    """Return the vector of LANES numbers from one on."""

    def generate(context, builder, signature, values):
        kind = ir.VectorType(ir.DoubleType(), LANES).as_pointer()
        return builder.load(builder.bitcast(builder.gep(values[0], [values[1]]), kind), align=8)

    return VECTOR(POINTER, types.intp), generate


def _put_vector(typing_context, numbers, index, vector):
    """Write LANES numbers from one on."""

    def generate(context, builder, signature, values):
        kind = ir.VectorType(ir.DoubleType(), LANES).as_pointer()
        place = builder.bitcast(builder.gep(values[0], [values[1]]), kind)
        builder.store(values[2], place, align=8)
        return context.get_dummy_value()

    return types.void(POINTER, types.intp, VECTOR), generate


def _expect(typing_context, numbers, index):
    """Fetch the LANES numbers from one on into the cache, where they are soon to be read."""

    def generate(context, builder, signature, values):
        word, byte = ir.IntType(32), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        for line in range(0, LANES, LINE):
            number = builder.add(values[1], ir.Constant(values[1].type, line))
            place = builder.bitcast(builder.gep(values[0], [number]), byte)
            builder.call(fetch, [place, *(ir.Constant(word, number) for number in (0, 3, 1))])
        return context.get_dummy_value()

    return types.void(POINTER, types.intp), generate


vector_at: Any = intrinsic(_vector_at)
expect: Any = intrinsic(_expect)
put_vector: Any = intrinsic(_put_vector)


@njit(**INLINED)
def choose_members(members, begun, live, who):
    """Let members from one on be those of the lanes, the last live one those of all that are left;
    return the column of the first where they stand one after the other, else -1."""
    for lane in range(LANES):
        who[lane] = members[begun + min(lane, live - 1)]
    return who[0] if live == LANES and who[LANES - 1] - who[0] == LANES - 1 else -1


@njit(**INLINED)
def taken(array, rows, first, block, table, row):
    """Take rows of the members out of an array, from a row of a table on; `first`: the column of
    the first where they stand one after the other, most often followed by those of the next block,
    else -1."""
    numbers, stride = pointer(array), array.shape[1]
    for m in range(rows):
        if first >= 0:
            store(table, row + m, vector_at(numbers, m * stride + first))
            expect(numbers, m * stride + first + LANES)
        else:
            for lane in range(LANES):
                table[row + m, lane] = numbers[m * stride + block.who[lane]]


@njit(**INLINED)
def put(table, rows, first, live, block, array):
    """Put rows of the members back into an array: all lanes where they stand one after the other,
    else those that are live."""
    put_rows(table, 0, rows, first, live, block, array)


@njit(**INLINED)
def put_rows(table, begin, end, first, live, block, array):
    """Put the rows from `begin` up to before `end` back, as `put`."""
    numbers, stride = pointer(array), array.shape[1]
    for m in range(begin, end):
        if first >= 0:
            put_vector(numbers, m * stride + first, load(table, m))
        else:
            for lane in range(live):
                numbers[m * stride + block.who[lane]] = table[m, lane]


@njit(**INLINED)
def put_changed(table, begin, end, first, live, block, array):
    """Put those rows back of which some number is another one than in the array."""
    numbers, stride = pointer(array), array.shape[1]
    for m in range(begin, end):
        if first >= 0:
            there, here = vector_at(numbers, m * stride + first), load(table, m)
            if every((there <= here) & (here <= there)):
                continue
        put_rows(table, m, m + 1, first, live, block, array)


@njit(**INLINED)
def given_by(table, timed):
    """Read what is given over time out of a `Signal.table`."""
    signal, breaks = inputs_of(pointer(table))
    return GivenInputs(signal, breaks, int(table[2]), timed)


@njit(**OPTIONS)
def next_break(given, t):
    """Return the first time after t at which what is given over time jumps or has a kink, infinity
    behind the last."""
    for i in range(given.count):
        if given.breaks[i] > t:
            return given.breaks[i]
    return math.inf


@njit(**OPTIONS)
def set_inputs(theta, given, herd, asked, block):
    """Evaluate what is given over time at t + theta h in all lanes, but for the forces; at a start,
    within rounding of a break, behind it."""
    x, n, columns = block.x, block.n, given.signal.columns
    end, near = asked.first + herd.u.shape[0], ROUNDING * asked.step
    for lane in range(LANES):
        time = block.own[WHEN, lane] + theta * block.now[STEP, lane]
        if theta == 0 and given.count > 0:
            ahead = next_break(given, time)
            time = ahead if ahead <= time + near else time
        force(given.signal, time, theta > 0, 0, block.inputs)
        for j in range(columns):
            if j < asked.first or j >= end:
                x[n + j, lane] = block.inputs[j]


_list = types.Array(types.float64, 1, "C", readonly=True)
_rows, _codes = types.Array(types.float64, 2, "C"), types.Array(types.intp, 1, "C")
_wholes = types.Array(types.intp, 1, "C", readonly=True)
SIGNATURE = (
    *(types.intp, types.intp, _list, _list, types.boolean),
    tuple_type(Herd, _rows, _rows, _rows, _rows, _rows, _rows, _codes),
    tuple_type(StepDemands, _rows, types.float64, types.float64, types.boolean, types.intp),
    _wholes,
)
