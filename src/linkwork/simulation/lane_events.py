"""The events within the steps of the members in the lanes.

The event functions of all lanes are looked at together, at the ends of the steps and in the middle:
as in `native_events.quiet`, lane by lane. A lane in which something may happen is copied, number by
number, to where a single run computes, and what finds the events of that, `native_search`, finds
those of the lane. What is found waits behind the rows that are kept until the step is accepted,
which a sample may still refuse.

Names as in `lanes`; `alone`, the structure of a single run that serves all lanes in turn.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numba.core.imputils import impl_ret_new_ref
from numba.extending import intrinsic

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_inputs import Signals, force, next_target, signal_of
from linkwork.simulation.lane_tables import (
    ACCEPTS,
    AILMENT,
    ARRIVAL,
    BOUND,
    CLOSURE_ERROR,
    ERROR,
    EVALUATIONS,
    EXTENDED,
    HALTED,
    LEAST,
    LIVE,
    LOOSE,
    LOWEST,
    MEMBER,
    OBSERVED,
    PIECE,
    REJECTED_PIVOT,
    REJECTED_RESIDUAL,
    RESIDUAL,
    ROW,
    START,
    STATUS,
    STEP,
    STOP,
    TARGET,
    TIME,
    WANTED,
    Tables,
    room,
)
from linkwork.simulation.native_between import resized
from linkwork.simulation.native_events import LOOKS, MOST, TINY
from linkwork.simulation.native_memory import INTEGRATION, furnish, integration_at, memory_for
from linkwork.simulation.native_pace import shortest_step
from linkwork.simulation.native_parts import (
    OK,
    Inputs,
    Kernels,
    Method,
    StepLimits,
    Turns,
    add_turns,
    copy,
    whole,
)
from linkwork.simulation.pointers import call, pointer
from linkwork.simulation.status import Status
from linkwork.simulation.structures import memory_of, numba_type, tuple_type
from linkwork.simulation.vectors import (
    COUNT_TABLE,
    LANES,
    TABLE,
    absolute,
    as_table,
    call_wide,
    choose,
    load,
    smaller,
    splat,
    store,
)

EVENT = int(Status.EVENT)
STARTING, STEPPING, BEHIND = range(3)
"""Moments at which the lanes are about events: see `lane_happenings`."""


class Occasions(NamedTuple):
    """What is watched for: `kernels` of one state; `wide`, the address of the kernel of the event
    functions for states side by side; `conditions`, a row (direction, what it does) for each;
    `happen`, the address of what the lanes do about them."""

    kernels: Kernels
    wide: int
    conditions: Any
    happen: int


class EventTables(NamedTuple):
    """Where the lanes look for `count` events: `x`, rows (y, u, p), angles with their whole turns;
    the functions `before` the steps, `after` them and in their `middle`. `free`: number of
    parameters."""

    x: Any
    before: Any
    after: Any
    middle: Any
    count: int
    free: int


_whole, _number = types.intp, types.float64
_table = types.Array(_number, 2, "C", readonly=True)
_numbers, _rows, _cubes = (types.Array(_number, dimensions, "C") for dimensions in (1, 2, 3))
_wholes = types.Array(_whole, 1, "C")
OCCASIONS = tuple_type(
    Occasions, types.UniTuple(_whole, len(Kernels._fields)), _whole, _rows, _whole
)
SIGNALS = tuple_type(Signals, _numbers, _cubes, _wholes, _numbers, _wholes, types.boolean)
WHAT_HAPPENS = _rows(
    _whole, OCCASIONS, INTEGRATION, numba_type(Method), SIGNALS, _number, _rows,
    tuple_type(Tables, *[TABLE] * 14, COUNT_TABLE, _whole, _whole, _number),
    tuple_type(EventTables, *[TABLE] * 4, _whole, _whole),
)  # fmt: skip


def _happen(
    typing_context, moment, occasions, alone, method, signals, closure_tol, found, tables, places
):
    """Call what does something about events by its address: see `lane_happenings`."""

    def generate(context, builder, signature, values):
        calls, kinds, result = context.call_conv, signature.args, signature.return_type
        address = builder.extract_value(values[1], Occasions._fields.index("happen"))
        function = calls.get_function_type(result, kinds).as_pointer()
        function = builder.inttoptr(address, function)
        status, rows = calls.call_function(builder, function, result, kinds, values)
        with builder.if_then(status.is_error, likely=False):
            calls.return_status_propagate(builder, status)
        return impl_ret_new_ref(context, builder, result, rows)

    return WHAT_HAPPENS, generate


happen: Any = intrinsic(_happen)


@njit(**OPTIONS)
def rooms_for(occasions, n, inputs, free):
    """Return room for the `EventTables` of states of n numbers; free: number of parameters."""
    return room(n + inputs + free + 3 * occasions.conditions.shape[0])


@njit(**INLINED)
def event_tables(space, occasions, n, inputs, free, tally):
    """Return the tables, one after the other in some space, which has to be kept alive."""
    count, rows = occasions.conditions.shape[0], n + inputs + free
    for lane in range(LANES):
        tally[OBSERVED, lane] = -1
    return EventTables(
        as_table(space),
        as_table(space[rows:]),
        as_table(space[rows + count :]),
        as_table(space[rows + 2 * count :]),
        count,
        free,
    )


@njit(**OPTIONS)
def run_alone(occasions, method, n, nq, inputs, free, sizes):
    """Return the structure of a single run, the memory that holds it, and its whole turns."""
    events, counted = occasions.conditions.shape[0], np.zeros(nq)
    memory = memory_for(n, nq, free, inputs, events, method, False)
    alone = integration_at(pointer(memory))
    alone.room, alone.scene = furnish(
        pointer(memory), n, nq, free, inputs, pointer(occasions.conditions), events, method
    )
    alone.kernels, alone.method = Kernels(*occasions.kernels), method
    spans, tolerance = pointer(sizes.turning), pointer(sizes.tolerance)
    alone.turns = Turns(spans, spans + nq, pointer(counted))
    alone.limits = StepLimits(tolerance, tolerance + n, 0.0, 0.0, 0.0, math.inf)
    alone.columns = n + inputs + 4  # the last one is the member's number
    return alone, memory, counted


@njit(**INLINED)
def take_over(alone, lane, signals, tables, places):
    """Copy parameters, turns and inputs of a lane to where a single run computes."""
    room, tally, n, nq = alone.room, tables.tally, tables.n, tables.nq
    columns, free = signals.coefficients.shape[2], places.free
    for m in range(columns + free):
        room.x[n + m] = tables.x[n + m, lane]
    for m in range(free):
        room.z[nq + m] = tables.x[n + columns + m, lane]
    for m in range(nq):
        alone.turns.counted[m] = tables.turned[m, lane]
    signal = signal_of(signals, tally[ROW, lane])
    first, behind = signals.pieces[signal], signals.pieces[signal + 1]
    knots, coefficients = pointer(signals.starts), pointer(signals.coefficients)
    alone.inputs = Inputs(
        knots + first, coefficients + 4 * columns * first, behind - first, columns
    )
    alone.piece = max(tally[PIECE, lane] - first, 0)


@njit(**OPTIONS)
def observe_starts(alone, signals, tables, places):
    """Evaluate the event functions at the starts of members that have come into the lanes."""
    tally = tables.tally
    for lane in range(LANES):
        if tables.now[LIVE, lane] > 0 and tally[OBSERVED, lane] != tally[MEMBER, lane]:
            take_over(alone, lane, signals, tables, places)
            for m in range(tables.n):
                alone.room.x[m] = tables.y[m, lane]
            add_turns(alone.room.x, alone.turns, tables.nq)
            call(alone.kernels.events, alone.room.x, alone.scene.within)
            for i in range(places.count):
                places.before[i, lane] = alone.scene.within[i]
            tally[OBSERVED, lane] = tally[MEMBER, lane]


@njit(**OPTIONS)
def observe(occasions, signals, half, state, target, tables, places):
    """Evaluate the event functions of all lanes in states at the ends of their steps, or half of
    the way."""
    n, x, now, tally = tables.n, places.x, tables.now, tables.tally
    columns = signals.coefficients.shape[2]
    for m in range(n):
        store(x, m, load(state, m))
    for m in range(n, n + columns + places.free):
        store(x, m, load(tables.x, m))
    for lane in range(LANES):
        for m in range(tables.nq):
            if tables.turned[m, lane] != 0.0:
                x[m, lane] = whole(x[m, lane], tables.turned[m, lane])
        if signals.timed and now[LIVE, lane] > 0:
            time = now[TIME, lane] + 0.5 * now[STEP, lane] if half else now[ARRIVAL, lane]
            force(signals, signal_of(signals, tally[ROW, lane]), time, True, x, n, lane, tally)
    call_wide(occasions.wide, x, target, 0)


@njit(**OPTIONS)
def watch(occasions, method, signals, tables, places):
    """Leave in now[WANTED] in which lanes an event function may come near zero within the step."""
    n, y, x, k, sample, now = (
        tables.n, tables.y, tables.x, tables.k, tables.sample, tables.now
    )  # fmt: skip
    step, last = load(now, STEP), method.solution * (n + 1)
    observe(occasions, signals, False, x, places.after, tables, places)
    for m in range(n):
        middle = splat(0.5) * (load(y, m) + load(x, m))
        bent = splat(0.125) * step * (load(k, m) - load(k, last + m))
        store(sample, m, middle + bent)
    observe(occasions, signals, True, sample, places.middle, tables, places)
    none, one, quiet = splat(0.0), splat(1.0), splat(1.0)
    for i in range(places.count):
        before, middle, after = (
            load(places.before, i),
            load(places.middle, i),
            load(places.after, i),
        )
        side = choose(before <= none, splat(-1.0), one)
        nearest = smaller(side * before, smaller(side * middle, side * after))
        spare = nearest - absolute(before - splat(2.0) * middle + after)
        clear = choose(spare <= none, none, choose(spare >= none, one, none))
        still = absolute(before) + absolute(middle) + absolute(after) <= none
        quiet = quiet * choose(still, one, clear)
    store(now, WANTED, one - quiet)


@njit(**OPTIONS)
def take_occasions(occasions, alone, method, signals, closure_tol, found, tables, places):
    """Find the events within the accepted steps; refuse those that reach across one at which steps
    end, and end those that an event ends. Return the rows, of which `alone.row` are in use.
    """
    now, tally = tables.now, tables.tally
    alone.row = alone.saved
    watch(occasions, method, signals, tables, places)
    for lane in range(LANES):
        tally[HALTED, lane] = 0
        if wanted(lane, now, tally):
            if alone.row + MOST * places.count > found.shape[0]:
                found = resized(found, 2 * (alone.row + MOST * places.count))
                alone.rows = pointer(found)
            first = alone.row
            set_step(alone, lane, signals, closure_tol, tables, places)
            call(alone.kernels.search, memory_of(alone), alone.room.sample)
            keep_step(alone, lane, first, tables, places)
    return found


@njit(**INLINED)
def wanted(lane, now, tally):
    """Tell whether the events within the step of a lane are to be found: of one that is accepted,
    or too short to be refused once more."""
    near, fails = now[WANTED, lane] > 0, tally[AILMENT, lane] != OK
    if now[ACCEPTS, lane] > 0 or fails or not near:
        return near and now[ACCEPTS, lane] > 0
    shortest = shortest_step(now[START, lane], now[STOP, lane])
    return now[LIVE, lane] > 0 and now[STEP, lane] < TINY * shortest


@njit(**OPTIONS)
def set_step(alone, lane, signals, closure_tol, tables, places):
    """Copy the accepted step of a lane to where a single run computes."""
    room, method, now = alone.room, alone.method, tables.now
    take_over(alone, lane, signals, tables, places)
    for m in range(tables.n):
        room.y[m], room.new[m] = tables.y[m, lane], tables.x[m, lane]
    known = method.stages if tables.tally[EXTENDED, lane] > 0 else method.computed
    for i in range(known):
        for m in range(tables.n):
            room.k[i * room.width + m] = tables.k[i * (tables.n + 1) + m, lane]
    for i in range(places.count):
        alone.scene.g[i] = places.before[i, lane]
    rtol, atol = alone.limits.rtol, alone.limits.atol
    alone.limits = StepLimits(rtol, atol, now[BOUND, lane], closure_tol, 0.0, math.inf)
    alone.t, alone.step, alone.arrival = now[TIME, lane], now[STEP, lane], now[ARRIVAL, lane]
    alone.loose, alone.residual = closure_tol * now[LOOSE, lane], now[RESIDUAL, lane]
    alone.error = now[ERROR, lane]
    alone.pending, alone.evaluations = method.stages - known, 0
    alone.ailment, alone.least, alone.halted, alone.ends = OK, 0.0, 0, LOOKS
    alone.target = now[TARGET, lane]
    alone.shortest = shortest_step(now[START, lane], now[STOP, lane])


@njit(**OPTIONS)
def keep_step(alone, lane, first, tables, places):
    """Take back what a single run found of a lane's step; its rows begin with the first one."""
    now, tally, scene = tables.now, tables.tally, alone.scene
    tally[EVALUATIONS, lane] += alone.evaluations
    if alone.ailment != OK or alone.error > 1:
        alone.row = first
        now[ACCEPTS, lane], tally[AILMENT, lane] = 0.0, alone.ailment
        if alone.ailment == OK:
            now[ERROR, lane], now[LEAST, lane] = alone.error, alone.least
            now[TARGET, lane] = alone.target
        else:
            now[REJECTED_PIVOT, lane] = now[LOWEST, lane]
            now[REJECTED_RESIDUAL, lane] = alone.residual
        return
    now[ACCEPTS, lane], now[ERROR, lane], now[TARGET, lane] = 1.0, alone.error, alone.target
    for row in range(first, alone.row):
        alone.rows[(row + 1) * alone.columns - 1] = tally[MEMBER, lane]
    for i in range(scene.count):
        places.after[i, lane] = scene.g[alone.ends * scene.count + i]
    if alone.halted > 0:
        tally[HALTED, lane], now[ARRIVAL, lane] = 1, alone.arrival
        now[CLOSURE_ERROR, lane] = max(now[CLOSURE_ERROR, lane], alone.residual)
        for m in range(tables.n):
            tables.x[m, lane] = alone.room.new[m]


@njit(**OPTIONS)
def pass_occasions(alone, signals, tables, places):
    """Keep the rows of the steps that are accepted after all, and go on from their ends: with the
    event functions there, and to the targets behind."""
    now, tally = tables.now, tables.tally
    for row in range(alone.saved, alone.row):
        source = alone.rows + row * alone.columns
        for lane in range(LANES):
            own = tally[MEMBER, lane] == int(source[alone.columns - 1])
            if own and now[ACCEPTS, lane] > 0:
                copy(source, alone.rows + alone.saved * alone.columns, alone.columns)
                alone.saved += 1
    for lane in range(LANES):
        if now[ACCEPTS, lane] > 0:
            for i in range(places.count):
                places.before[i, lane] = places.after[i, lane]
            signal = signal_of(signals, tally[ROW, lane])
            now[TARGET, lane] = next_target(signals, signal, now[TIME, lane], lane, now, tally)
            if tally[HALTED, lane] > 0:
                tally[STATUS, lane] = EVENT
