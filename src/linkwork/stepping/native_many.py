"""Many robots a step at a time, compiled: a member in each lane, by a method of a fixed step.

The arithmetic is that of `native` in the same order, lane by lane, so that no member depends on its
neighbours. What the members are stands in arrays with a column for each, `stride` columns in a row;
LANES of them are taken out at a time, moved on by all of their steps, and put back. A member whose
step cannot be taken keeps its state, and is told why by its status; the others go on.

Tables, (rows, LANES) each: `y`, states at the starts of the steps; `x`, rows (y, u, p); `k`, rows
(y', pivot), stage after stage; `z`, rows (q, p); `z_next`, what the closure gives; `now`, numbers
of the members as in `lane_tables`; `own`, those that are named below.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from linkwork.simulation.compiled import INLINED, OPTIONS, compiled_once
from linkwork.simulation.lane_steps import combine, move, project
from linkwork.simulation.lane_tables import (
    ARRIVAL,
    LIVE,
    LOOSE,
    NOW,
    RESIDUAL,
    STEP,
    WANTED,
    room,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    RESERVE,
    SINGULAR,
    force,
    inputs_of,
    method_of,
    turns_in,
    whole,
    without,
)
from linkwork.simulation.pointers import POINTER, pointer, uncounted
from linkwork.simulation.structures import tuple_type
from linkwork.simulation.vectors import (
    LANES,
    VECTOR,
    absolute,
    as_table,
    call_wide,
    choose,
    every,
    larger,
    load,
    some,
    splat,
    store,
)

NUMBERS = 8  # rows of `numbers`
ORIGIN, WHEN, LIMIT, SLACK, NUMBER, LEFT, WRITTEN, TURNED = range(NUMBERS)
"""Of each member: the time that its steps are counted from, the present time [s], the bound of its
pivots, and the factor on the closure's tolerance; the number of its last step, how many are left,
whether q was written since, and whether any whole turn may be counted."""


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
    """Fetch the vector of LANES numbers from one on into the cache, where it is soon to be read."""

    def generate(context, builder, signature, values):
        word, byte = ir.IntType(32), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        place = builder.bitcast(builder.gep(values[0], [values[1]]), byte)
        builder.call(fetch, [place, *(ir.Constant(word, number) for number in (0, 3, 1))])
        return context.get_dummy_value()

    return types.void(POINTER, types.intp), generate


vector_at: Any = intrinsic(_vector_at)
expect: Any = intrinsic(_expect)
put_vector: Any = intrinsic(_put_vector)


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
    numbers, stride = pointer(array), array.shape[1]
    for m in range(rows):
        if first >= 0:
            put_vector(numbers, m * stride + first, load(table, m))
        else:
            for lane in range(live):
                numbers[m * stride + block.who[lane]] = table[m, lane]


@njit(**OPTIONS)
def take_over(herd, asked, closure, live, block):
    """Take over what was written to the states of the members; end those of which it cannot be, and
    leave them where they were."""
    n, nq, now, before, moved = block.n, block.nq, block.now, block.k, 0
    for lane in range(live):
        i, now[WANTED, lane], code = block.who[lane], 0.0, OK
        for m in range(n):
            turns = herd.turns[m, i] if m < nq else 0.0
            told = whole(herd.held[m, i], turns) if turns != 0.0 else herd.held[m, i]
            if m < nq:
                before[m, lane] = turns
            if not math.isfinite(herd.y[m, i]):
                code = NON_FINITE
            elif herd.y[m, i] != told:
                block.y[m, lane] = herd.y[m, i]
                if m < nq:
                    now[WANTED, lane], herd.turns[m, i], moved = 1.0, 0.0, moved + 1
        if code != OK:
            leave(herd, code, lane, block)
    if moved == 0:
        return
    # The loops of those whose q was written are closed.
    settle(herd, asked, live, block)
    for lane in range(live):
        if now[WANTED, lane] > 0:
            block.own[WRITTEN, lane] = 1.0
    if closure != 0:
        project(closure, nq, block.y, block.z, block.z_next, now, asked.closure_tol, math.inf)
        for lane in range(live):
            closed = now[RESIDUAL, lane] <= asked.closure_tol * now[LOOSE, lane]
            if now[WANTED, lane] > 0 and not closed:
                leave(herd, CLOSURE_LOST, lane, block)


@njit(**OPTIONS)
def leave(herd, code, lane, block):
    """End a member where it was before anything was written to it."""
    i = block.who[lane]
    herd.status[i], block.now[LIVE, lane], block.now[WANTED, lane] = code, 0.0, 0.0
    for m in range(block.n):
        block.y[m, lane] = herd.held[m, i]
        if m < block.nq:
            herd.turns[m, i] = block.k[m, lane]


@njit(**OPTIONS)
def settle(herd, asked, live, block):
    """Count whole turns of large angles apart, and loosen the closure where other coordinates are
    large."""
    y, now, turning = block.y, block.now, asked.turning
    for lane in range(live):
        i, now[LOOSE, lane] = block.who[lane], 1.0
        for m in range(block.nq):
            if abs(y[m, lane]) > turning[0, m]:
                if turning[1, m] > 0:
                    count = turns_in(y[m, lane])
                    y[m, lane] = without(y[m, lane], count)
                    herd.turns[m, i] += count
                    block.own[TURNED, lane] = 1.0
                else:
                    now[LOOSE, lane] = max(now[LOOSE, lane], abs(y[m, lane]) / turning[0, m])


@njit(**OPTIONS)
def set_inputs(theta, signal, herd, asked, block):
    """Evaluate what is given over time at t + theta h in all lanes, but for the forces."""
    x, n, columns = block.x, block.n, signal.columns
    end = asked.first + herd.u.shape[0]
    for lane in range(LANES):
        time = block.own[WHEN, lane] + theta * block.now[STEP, lane]
        force(signal, time, theta > 0, 0, block.inputs)
        for j in range(columns):
            if j < asked.first or j >= end:
                x[n + j, lane] = block.inputs[j]


@njit(**OPTIONS)
def ailment(computed, asked, lane, block):
    """Return why a step could not be taken, in the order of the stages that were computed."""
    n, k, now = block.n, block.k, block.now
    for i in range(computed):
        pivot = k[i * (n + 1) + n, lane]
        if not pivot >= block.own[LIMIT, lane]:
            return NON_FINITE if math.isnan(pivot) else SINGULAR
        for m in range(n):
            if not math.isfinite(k[i * (n + 1) + m, lane]):
                return NON_FINITE
    lost = not now[RESIDUAL, lane] <= asked.closure_tol * now[LOOSE, lane]
    return CLOSURE_LOST if lost else NON_FINITE


@njit(**INLINED)
def advance(motion, closure, method, signal, timed, herd, asked, block):
    """Try a step in all lanes; leave the new states in x, and return where they may be
    accepted."""
    n, nq, y, x, k, now = block.n, block.nq, block.y, block.x, block.k, block.now
    for m in range(n):
        store(x, m, load(y, m))
    for i in range(method.solution):
        if i > 0:
            combine(method.a + i * method.stages, i, n, now, y, k, x)
        if timed:
            set_inputs(method.c[i], signal, herd, asked, block)
        call_wide(motion, x, k, i * (n + 1))
    last = method.solution
    # Symplectic: q' at the new v replaces that of k_1.
    if method.computed > last:
        combine(method.a + last * method.stages, 1, n, now, y, k, x)
        for m in range(nq):
            store(x, m, load(y, m))
        call_wide(motion, x, k, n + 1)
        for m in range(nq):
            store(k, m, load(k, n + 1 + m))
    combine(method.a + last * method.stages, last, n, now, y, k, x)
    store(now, RESIDUAL, splat(0.0))
    if closure != 0:
        store(now, WANTED, load(now, LIVE))
        reserve = math.inf if asked.redundant else RESERVE
        project(closure, nq, x, block.z, block.z_next, now, asked.closure_tol, reserve)
    # What may be accepted: pivots above their bound, loops closed, finite numbers.
    healthy = load(now, RESIDUAL) <= splat(asked.closure_tol) * load(now, LOOSE)
    for i in range(method.computed):
        healthy = healthy & (load(k, i * (n + 1) + n) >= load(block.own, LIMIT))
    nothing = splat(0.0)
    for m in range(n):
        nothing = nothing + splat(0.0) * load(x, m)
    return healthy & (nothing >= splat(0.0))


@njit(**INLINED)
def aim(asked, block):
    """Choose the steps of the lanes, to the next times that their steps end at; tell whether any
    lane goes on."""
    now, own, one, none = block.now, block.own, splat(1.0), splat(0.0)
    on = (load(now, LIVE) >= one) & (load(own, LEFT) >= one)
    goal = load(own, ORIGIN) + (load(own, NUMBER) + one) * splat(asked.step)
    store(now, ARRIVAL, goal)
    store(now, STEP, choose(on, goal - load(own, WHEN), none))
    store(now, LIVE, choose(on, one, none))
    return some(on)


@njit(**INLINED)
def book(computed, herd, asked, healthy, block):
    """Count the steps that were taken, and end the members whose step could not be."""
    now, own, one, none = block.now, block.own, splat(1.0), splat(0.0)
    accepted = healthy & (load(now, LIVE) >= one)
    step = choose(accepted, one, none)
    store(now, WANTED, step)
    store(own, WHEN, choose(accepted, load(now, ARRIVAL), load(own, WHEN)))
    store(own, NUMBER, load(own, NUMBER) + step)
    store(own, LEFT, load(own, LEFT) - step)
    store(own, WRITTEN, choose(accepted, none, load(own, WRITTEN)))
    if some(load(now, LIVE) - step >= one):
        for lane in range(LANES):
            if now[LIVE, lane] > now[WANTED, lane]:
                code = ailment(computed, asked, lane, block)
                herd.status[block.who[lane]], now[LIVE, lane] = code, 0.0


@njit(**INLINED)
def begin(herd, asked, closure, signal, first, live, block):
    """Take the members out, with what was written to them."""
    n, nq, x, y, now = block.n, block.nq, block.x, block.y, block.now
    forces, inputs = herd.u.shape[0], n + signal.columns
    taken(herd.numbers, NUMBERS, first, block, block.own, 0)
    taken(herd.held, n, first, block, y, 0)
    taken(herd.y, n, first, block, x, 0)
    taken(herd.u, forces, first, block, x, n + asked.first)
    taken(herd.p, herd.p.shape[0], first, block, x, inputs)
    taken(herd.p, herd.p.shape[0], first, block, block.z, nq)
    store(now, LOOSE, load(block.own, SLACK))
    store(now, LIVE, splat(1.0))
    for lane in range(live, LANES):
        now[LIVE, lane] = 0.0
    # Seldom anything was written; where turns are counted it is looked for lane by lane.
    nothing, same = splat(0.0), splat(0.0) <= splat(0.0)
    for m in range(n):
        told, held = load(x, m), load(y, m)
        same = same & (told <= held) & (held <= told)
    if not every(same):
        take_over(herd, asked, closure, live, block)
    # Forces that are no numbers end their member, whatever a drive would make of them.
    for j in range(forces):
        nothing = nothing + splat(0.0) * load(x, n + asked.first + j)
    if not every(nothing >= splat(0.0)):
        for lane in range(live):
            for j in range(forces):
                if not math.isfinite(x[n + asked.first + j, lane]):
                    herd.status[block.who[lane]], now[LIVE, lane] = NON_FINITE, 0.0


@njit(**INLINED)
def finish(herd, first, live, block):
    """Put the members back where they came to, with the whole turns of their angles for the
    user."""
    n, y, own = block.n, block.y, block.own
    store(own, SLACK, load(block.now, LOOSE))
    put(own, NUMBERS, first, live, block, herd.numbers)
    put(y, n, first, live, block, herd.held)
    if some(load(own, TURNED) >= splat(1.0)):
        for lane in range(live):
            for m in range(block.nq):
                turns = herd.turns[m, block.who[lane]]
                if turns != 0.0:
                    y[m, lane] = whole(y[m, lane], turns)
    put(y, n, first, live, block, herd.y)


@njit(**INLINED)
def large(shortest, block):
    """Tell whether a coordinate may be large in any lane, beyond the shortest of all spans, or
    was."""
    largest = splat(0.0)
    for m in range(block.nq):
        largest = larger(absolute(load(block.y, m)), largest)
    return some((largest >= splat(shortest)) | (load(block.now, LOOSE) >= splat(1.0 + 1e-15)))


_list = types.Array(types.float64, 1, "C", readonly=True)
_rows, _codes = types.Array(types.float64, 2, "C"), types.Array(types.intp, 1, "C")
_wholes = types.Array(types.intp, 1, "C", readonly=True)
SIGNATURE = (
    *(types.intp, types.intp, _list, _list, types.boolean),
    tuple_type(Herd, _rows, _rows, _rows, _rows, _rows, _rows, _codes),
    tuple_type(StepDemands, _rows, types.float64, types.float64, types.boolean, types.intp),
    _wholes,
)


@compiled_once("the stepper of many robots", SIGNATURE)
def steps(motion, closure, plan, table, timed, herd, asked, members):
    """Take the steps that are left of some members in one chart; return how many had to stop.

    motion, closure: addresses of the kernels for states side by side, the latter 0 where there is
    none; plan: `StepPlan.table` of a fixed step; table: `Signal.table`, the inputs, of which
    columns are the forces; timed: whether others vary; members: columns, in their order.
    """
    # Where LANES members are computed.
    herd, asked = uncounted(herd), uncounted(asked)
    method, (signal, _) = method_of(pointer(plan)), inputs_of(pointer(table))
    n, nq, p = herd.y.shape[0], herd.turns.shape[0], herd.p.shape[0]
    sizes = (n, n + signal.columns + p, method.stages * (n + 1), nq + p, nq + 1, NOW, NUMBERS)
    ends = np.cumsum(np.array(sizes))
    space, inputs = room(ends[-1]), np.empty(signal.columns + 1)
    who = np.empty(LANES, np.intp)
    block = LaneBlock(
        as_table(space), as_table(space[ends[0] :]), as_table(space[ends[1] :]),
        as_table(space[ends[2] :]), as_table(space[ends[3] :]), as_table(space[ends[4] :]),
        as_table(space[ends[5] :]), pointer(inputs), who, n, nq,
    )  # fmt: skip
    # What does not vary is the same for all.
    if not timed:
        set_inputs(0.0, signal, herd, asked, block)
    stopped, shortest = 0, asked.turning[0].min() if nq > 0 else math.inf
    for begun in range(0, members.size, LANES):
        live = min(LANES, members.size - begun)
        for lane in range(LANES):
            who[lane] = members[begun + min(lane, live - 1)]
        adjacent = live == LANES and who[LANES - 1] - who[0] == LANES - 1
        first = who[0] if adjacent else -1
        begin(herd, asked, closure, signal, first, live, block)
        while aim(asked, block):
            healthy = advance(motion, closure, method, signal, timed, herd, asked, block)
            book(method.computed, herd, asked, healthy, block)
            move(block.x, 0, block.y, n, load(block.now, WANTED) <= splat(0.0))
            if large(shortest, block):
                settle(herd, asked, live, block)
        finish(herd, first, live, block)
        for lane in range(live):
            stopped += herd.status[who[lane]] != OK
    space[0, 0] = inputs[0] = 0.0  # the memory of the block lives to the end
    return stopped
