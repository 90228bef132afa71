"""Many robots a step at a time, compiled: a member in each lane, by a method of a fixed step.

The arithmetic is that of `native` in the same order, lane by lane, so that no member depends on its
neighbours. LANES members are taken out at a time (`native_block`, whose tables these are), moved on
by all of their steps, and put back. A member whose step cannot be taken keeps its state, and is
told why by its status; the others go on. What is read of them is read while they are at hand.
"""

import math

import numpy as np
from numba import njit, types

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
    ROUNDING,
    SINGULAR,
    method_of,
    turns_in,
    whole,
    without,
)
from linkwork.simulation.pointers import pointer, uncounted
from linkwork.simulation.vectors import (
    LANES,
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
from linkwork.stepping.native_block import (
    CHANGED,
    LEFT,
    LIMIT,
    NUMBER,
    NUMBERS,
    ORIGIN,
    SELDOM,
    SIGNATURE,
    SLACK,
    TURNED,
    WHEN,
    WRITTEN,
    LaneBlock,
    choose_members,
    given_by,
    next_break,
    put,
    put_changed,
    put_rows,
    set_inputs,
    taken,
)
from linkwork.stepping.native_readings import READING_TABLES, tell


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
def advance(motion, closure, method, given, herd, asked, block):
    """Try a step in all lanes; leave the new states in x, and return where they may be
    accepted."""
    n, nq, y, x, k, now = block.n, block.nq, block.y, block.x, block.k, block.now
    for m in range(n):
        store(x, m, load(y, m))
    for i in range(method.solution):
        if i > 0:
            combine(method.a + i * method.stages, i, n, now, y, k, x)
        if given.timed:
            set_inputs(method.c[i], given, herd, asked, block)
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
def aim(given, asked, block):
    """Choose the steps of the lanes, to the next times that their steps end at, those of breaks
    among them; tell whether any lane goes on."""
    now, own, one, none = block.now, block.own, splat(1.0), splat(0.0)
    on = (load(now, LIVE) >= one) & (load(own, LEFT) >= one)
    goal = load(own, ORIGIN) + (load(own, NUMBER) + one) * splat(asked.step)
    store(now, ARRIVAL, goal)
    if given.timed and given.count > 0:
        for lane in range(LANES):
            ahead = next_break(given, own[WHEN, lane] + ROUNDING * asked.step)
            now[ARRIVAL, lane] = min(now[ARRIVAL, lane], ahead)
        goal = load(now, ARRIVAL)
    store(now, STEP, choose(on, goal - load(own, WHEN), none))
    store(now, LIVE, choose(on, one, none))
    return some(on)


@njit(**INLINED)
def book(computed, given, herd, asked, healthy, block):
    """Count the steps that were taken, those up to a break as parts of theirs, and end the members
    whose step could not be."""
    now, own, one, none = block.now, block.own, splat(1.0), splat(0.0)
    accepted = healthy & (load(now, LIVE) >= one)
    step = choose(accepted, one, none)
    store(now, WANTED, step)
    store(own, WHEN, choose(accepted, load(now, ARRIVAL), load(own, WHEN)))
    counted = step
    if given.timed and given.count > 0:
        goal = load(own, ORIGIN) + (load(own, NUMBER) + one) * splat(asked.step)
        whole_step = load(now, ARRIVAL) >= goal - splat(ROUNDING * asked.step)
        counted = choose(whole_step, step, none)
    store(own, NUMBER, load(own, NUMBER) + counted)
    store(own, LEFT, load(own, LEFT) - counted)
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
    for m in range(herd.p.shape[0]):
        store(block.z, nq + m, load(x, inputs + m))
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
    put_rows(own, 0, SELDOM, first, live, block, herd.numbers)
    put_changed(own, SELDOM, CHANGED, first, live, block, herd.numbers)
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


@njit(**INLINED)
def ended(herd, first, live, block):
    """Return how many of the members had to stop."""
    stopped = 0
    if first >= 0:
        for lane in range(LANES):
            stopped += herd.status[first + lane] != OK
    else:
        for lane in range(live):
            stopped += herd.status[block.who[lane]] != OK
    return stopped


@compiled_once("the stepper of many robots", (*SIGNATURE, types.intp, READING_TABLES))
def steps(motion, closure, plan, table, timed, herd, asked, members, reading, told):
    """Take the steps that are left of some members in one chart; return how many had to stop, and
    whether all that is read of them is finite.

    motion, closure: addresses of the kernels for states side by side, the latter 0 where there is
    none; plan: `StepPlan.table` of a fixed step; table: `Signal.table`, the inputs, of which
    columns are the forces; timed: whether others vary; members: columns, in their order; reading:
    the address of the kernel of what is read and `told`, 0 where nothing is.
    """
    # Where LANES members are computed.
    herd, asked, told = uncounted(herd), uncounted(asked), uncounted(told)
    members, lanes = uncounted(members), np.empty(LANES, np.intp)
    method, given = method_of(pointer(plan)), given_by(table, timed)
    n, nq, p = herd.y.shape[0], herd.turns.shape[0], herd.p.shape[0]
    count = told.rows.shape[1] + told.columns.shape[0]
    inputs = np.empty(given.signal.columns + 1)
    sizes = (
        *(n, n + given.signal.columns + p, method.stages * (n + 1), nq + p, nq + 1, NOW, NUMBERS),
        count,
    )
    ends = np.cumsum(np.array(sizes))
    space = room(ends[-1])
    who = uncounted(lanes)
    block = LaneBlock(
        as_table(space), as_table(space[ends[0] :]), as_table(space[ends[1] :]),
        as_table(space[ends[2] :]), as_table(space[ends[3] :]), as_table(space[ends[4] :]),
        as_table(space[ends[5] :]), pointer(inputs), who, n, nq,
    )  # fmt: skip
    found = as_table(space[ends[6] :])
    # What does not vary is the same for all.
    if not timed:
        set_inputs(0.0, given, herd, asked, block)
    stopped, shortest = 0, asked.turning[0].min() if nq > 0 else math.inf
    finite = True
    for begun in range(0, members.size, LANES):
        live = min(LANES, members.size - begun)
        first = choose_members(members, begun, live, who)
        begin(herd, asked, closure, given.signal, first, live, block)
        while aim(given, asked, block):
            healthy = advance(motion, closure, method, given, herd, asked, block)
            book(method.computed, given, herd, asked, healthy, block)
            move(block.x, 0, block.y, n, load(block.now, WANTED) <= splat(0.0))
            if large(shortest, block):
                settle(herd, asked, live, block)
        finish(herd, first, live, block)
        stopped += ended(herd, first, live, block)
        # What is read of the states as the user sees them.
        if reading != 0:
            for m in range(n):
                store(block.x, m, load(block.y, m))
            finite &= tell(reading, given, herd, asked, first, live, block, found, told)
    space[0, 0] = inputs[0] = lanes[0] = 0  # the memory of the block lives to the end
    return stopped, finite
