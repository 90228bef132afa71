"""Integrate many members at a time: the loop of `native_loop` for explicit pairs, with a member in
each lane.

Each lane has its own time, step size and end. When a member ends the next one is loaded into its
lane, so that the registers stay full. What a member goes through is what it goes through alone: the
same arithmetic in the same order, lane by lane, so that no member depends on its neighbours. The
kernels are C functions void(const double *in, double *out) for LANES states side by side:

    motion   in = (y, u, p)  out = (y', pivot)
    closure  in = (q, p)     out = (q after one Newton step on phi(q) = 0, max |phi(q)| before it)

Members start in blocks of LANES (`lane_starts`); `begun` keeps what comes of that, block after
block. Then all lanes go step by step: members that have stopped make room for those that wait
(`lane_members`), a step is tried (`lane_steps`), looked into (`lane_watch`, `lane_samples`), and
accepted or refused (`lane_refusals`).

Names: `x`, rows (y, u, p); `k`, rows (y', pivot), stage after stage; `z`, rows (q, p); all
(rows, LANES). `now` and `tally` hold numbers and counts of the members in the lanes, `numbers` and
`counts` those of all members, a row each, of which the first NUMBERS and COUNTS are the same. With
one signal, or one row of p, all members share it.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, types

from linkwork.simulation.compiled import INLINED, OPTIONS, compiled_once
from linkwork.simulation.lane_events import (
    BEHIND,
    OCCASIONS,
    SIGNALS,
    STARTING,
    STEPPING,
    event_tables,
    happen,
    rooms_for,
    run_alone,
)
from linkwork.simulation.lane_inputs import force, next_target, set_forces, signal_of
from linkwork.simulation.lane_members import Results, Roster, fill, leave, measure_closure, stopped
from linkwork.simulation.lane_refusals import diagnose, first_ailment, look_due, reject
from linkwork.simulation.lane_samples import extend, take_samples, want_samples
from linkwork.simulation.lane_starts import block_row, start_all
from linkwork.simulation.lane_steps import (
    accept,
    choose_steps,
    combine,
    judge,
    move,
    project,
    weigh_pivots,
)
from linkwork.simulation.lane_tables import (
    ACCEPTED,
    ACCEPTS,
    AILMENT,
    ERROR,
    EVALUATIONS,
    EXTENDED,
    HALTED,
    LEAST,
    LIVE,
    PIVOT,
    REACHED,
    REJECTED_PIVOT,
    RESIDUAL,
    ROW,
    SAVED,
    STATUS,
    STOP,
    TALLY,
    TARGET,
    TIME,
    WANTED,
    Sizes,
    furnish,
    room,
    rows_of,
)
from linkwork.simulation.lane_turns import large, settle
from linkwork.simulation.lane_watch import LaneSignals, inspect, mark_bent, mark_unsure
from linkwork.simulation.native_loop import FIRST_ROWS, LOOK
from linkwork.simulation.native_pace import sixteenths
from linkwork.simulation.native_parts import OK, RESERVE, Kernels, method_of
from linkwork.simulation.pointers import pointer, uncounted
from linkwork.simulation.structures import tuple_type
from linkwork.simulation.vectors import (
    LANES,
    as_table,
    call_wide,
    choose,
    every,
    load,
    some,
    splat,
    store,
)


class Demands(NamedTuple):
    """What is asked of all steps: the closure's residual; h |lambda| from which a step is stiff, 0
    where that does not matter; the longest step [s]; whether `redundant` rows of phi ask that the
    end of every step is measured."""

    closure_tol: float
    stability: float
    max_step: float
    redundant: bool


class Saving(NamedTuple):
    """Hold the times to save at (K,) [s], and the samples (M, K, n) that are saved."""

    times: Any
    samples: Any


@njit(**INLINED)
def attempt(kernels, method, signals, limits, tables):
    """Try a step in all lanes: leave its stages in k, the new states in x, and what is to be said
    of it in `now`."""
    n, nq, x, k, now = tables.n, tables.nq, tables.x, tables.k, tables.now
    choose_steps(now)
    for i in range(1, method.solution + 1):
        combine(method.a + i * method.stages, i, n, now, tables.y, k, x)
        # The last stage is evaluated at the new state, whose loops are closed: not where a pivot
        # tells already that the step will be refused.
        if i == method.solution:
            weigh_pivots(method.solution, tables)
            store(now, RESIDUAL, splat(0.0))
            if kernels.closure != 0:
                z, z_next, closure_tol = tables.z, tables.z_next, limits.closure_tol
                reserve = math.inf if limits.redundant else RESERVE
                project(kernels.closure, nq, x, z, z_next, now, closure_tol, reserve)
        if signals.timed:
            set_forces(signals, method.c[i], x, n, now, tables.tally)
        call_wide(kernels.motion, x, k, i * (n + 1))
    judge(method, nq if kernels.closure != 0 else 0, limits.closure_tol, tables)


@njit(**INLINED)
def decide(method, limits, tables):
    """Accept the steps whose errors are within the tolerance; find why the equations fail in
    others."""
    now, tally, error = tables.now, tables.tally, load(tables.now, ERROR)
    store(now, ACCEPTS, choose(error <= splat(1.0), load(now, LIVE), splat(0.0)))
    for lane in range(LANES):
        tally[AILMENT, lane], tally[REACHED, lane] = OK, tally[SAVED, lane]
        tally[EVALUATIONS, lane] += method.solution
    if not every(splat(0.0) * error >= splat(0.0)):
        for lane in range(LANES):
            if now[LIVE, lane] > 0 and not math.isfinite(now[ERROR, lane]):
                diagnose(lane, method.solution, limits.closure_tol, tables)


@njit(**OPTIONS)
def look_into(
    kernels, method, signals, watched, limits, saving, unsure, occasions, alone, found, tables,
    places,
):  # fmt: skip
    """Look at what the stages may not have seen within the accepted steps, and take the events and
    samples there; refuse steps in which something is wrong. Return the rows of events.

    unsure: whether the error of any lane may be small by accident
    """
    now, tally, bending, save_at = tables.now, tables.tally, watched.bending, saving.times
    store(now, LEAST, splat(0.0))
    for lane in range(LANES):
        tally[EXTENDED, lane] = 0
    # Which lanes need the dense output, and the stages that it needs beside the others.
    bent = bending[-1] > bending.size - 1 and mark_bent(watched, now, tally) > 0
    further = method.computed < method.stages
    inside = want_samples(save_at, now, tally)[1] if save_at.size > 0 and further else 0
    if further and (unsure or bent or inside > 0):
        extend(kernels.motion, method, signals, save_at, tables)
    # Steps that the dense output refuses give no samples.
    if unsure or bent:
        inspect(kernels.motion, method, signals, watched, unsure, bent, tables)
    if places.count > 0:
        found = happen(
            STEPPING, occasions, alone, method, signals, limits.closure_tol, found, tables, places
        )
    if save_at.size > 0:
        take_samples(kernels.closure, method, limits.closure_tol, save_at, saving.samples, tables)
    return found


@njit(**INLINED)
def book(exponent, tables):
    """Count the steps, accepted and refused, and shrink those that are refused."""
    n, now, tally = tables.n, tables.now, tables.tally
    for lane in range(LANES):
        accepted = now[ACCEPTS, lane] > 0
        tally[ACCEPTED, lane] += accepted
        tally[SAVED, lane] = tally[REACHED, lane] if accepted else tally[SAVED, lane]
    for lane in range(LANES):
        if now[LIVE, lane] > now[ACCEPTS, lane]:
            reject(lane, exponent, tables.k[n, lane], now, tally)


@njit(**INLINED)
def go_on(method, tables):
    """Go on from the ends of the accepted steps: their states, and their last slopes, are the next
    ones' first."""
    kept = load(tables.now, ACCEPTS) <= splat(0.0)
    move(tables.x, 0, tables.y, tables.n, kept)
    move(tables.k, method.solution * (tables.n + 1), tables.k, tables.n + 1, kept)


@njit(**OPTIONS)
def restart(motion, last, signals, tables):
    """Evaluate the slope anew, in place of the last stage's, in the lanes that have reached a break
    of their signal."""
    n, x, k, now, tally, broken = tables.n, tables.x, tables.k, tables.now, tables.tally, 0
    for lane in range(LANES):
        time = now[TIME, lane]
        breaks = time == now[TARGET, lane] and time < now[STOP, lane]
        breaks = breaks and tally[STATUS, lane] == OK and tally[HALTED, lane] == 0
        now[WANTED, lane] = 0.0
        if now[ACCEPTS, lane] > 0 and breaks:
            signal = signal_of(signals, tally[ROW, lane])
            force(signals, signal, time, False, x, n, lane, tally)
            now[TARGET, lane] = next_target(signals, signal, time, lane, now, tally)
            now[WANTED, lane] = 1.0
            broken += 1
    if broken == 0:
        return
    # All lanes are evaluated, at x; the last stages of those that go on smoothly come out as they
    # were.
    call_wide(motion, x, k, last * (n + 1))
    for lane in range(LANES):
        if now[WANTED, lane] > 0:
            tally[EVALUATIONS, lane] += 1
            tally[STATUS, lane] = first_ailment(k, last, n, lane, now)
            now[REJECTED_PIVOT, lane] = k[last * (n + 1) + n, lane]
            now[PIVOT, lane] = min(now[PIVOT, lane], now[REJECTED_PIVOT, lane])


_array, _table = (
    types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2)
)
_numbers, _rows, _tables = (types.Array(types.float64, dimensions, "C") for dimensions in (1, 2, 3))
_wholes, _counts = (types.Array(types.intp, dimensions, "C") for dimensions in (1, 2))
_whole, _number = types.intp, types.float64
_SIGNATURE = (
    tuple_type(Kernels, *[_whole] * len(Kernels._fields)),
    _array,
    tuple_type(Demands, _number, _number, _number, types.boolean),
    tuple_type(Sizes, _rows, _rows),
    _table,
    SIGNALS,
    tuple_type(LaneSignals, _numbers, _tables, _wholes, _rows, _wholes),
    OCCASIONS,
    tuple_type(Roster, _rows, _rows, _rows, _counts),
    _array,
    tuple_type(Results, _tables, _rows, _counts, _wholes),
    _wholes,
)


@compiled_once("the integrator of ensembles", _SIGNATURE)
def integrate(
    kernels, plan, limits, sizes, parameters, signals, watched, occasions, members, save_at,
    results, cancel,
):  # fmt: skip
    """Integrate members from their starts to their ends, and leave their last states there.

    plan: the `StepPlan.table` of an explicit pair.
    parameters (N, np) or (1, np), signals, watched: of which each member has a row; save_at (K,):
    times [s].
    occasions: the events to watch for.
    cancel (1,): the run ends where it is when another thread writes anything but 0.
    Return the rows of the events, (t, y, u, residual, event, member).
    """
    # The caller keeps all of this alive.
    members, results, parameters = uncounted(members), uncounted(results), uncounted(parameters)
    signals, watched, save_at = uncounted(signals), uncounted(watched), uncounted(save_at)
    occasions = uncounted(occasions)
    n, nq, inputs = members.y.shape[1], sizes.turning.shape[1], signals.coefficients.shape[2]
    method, count, free = method_of(pointer(plan)), members.counts.shape[0], parameters.shape[1]
    end = rows_of(n, nq, inputs, free, method.stages)
    space, blocks = room(end[-1]), room(block_row(count + LANES - 1, n))
    counts = np.zeros((TALLY, LANES), np.intp)
    tables, begun = furnish(space, counts, end, n, nq, sizes), as_table(blocks)
    # The events are looked for, and kept.
    alone, memory, turns = run_alone(occasions, method, n, nq, inputs, free, sizes)
    observed, found = rooms_for(occasions, n, inputs, free), np.empty((FIRST_ROWS, n + inputs + 4))
    places = event_tables(observed, occasions, n, inputs, free, tables.tally)
    watching, alone.rows, closure_tol = places.count > 0, pointer(found), limits.closure_tol
    breaks = signals.breaks.size > 0 or watching
    looks = save_at.size > 0 or watched.bending[-1] > watched.bending.size - 1 or watching

    saving = Saving(save_at, results.samples)
    # All members start; then all lanes go step by step, until no member is left.
    turned = start_all(
        kernels, method, signals, limits, members, parameters, begun, results, tables
    )  # fmt: skip
    live, waiting, trips, due = 0, np.intp(0), 0, LOOK
    while True:
        if live == 0 or stopped(tables):
            live, waiting = fill(
                waiting, members, signals, parameters, begun, save_at, results, turned, tables
            )
            if watching:
                found = happen(
                    STARTING, occasions, alone, method, signals, closure_tol, found, tables, places
                )
        if live == 0 or cancel[0] != 0:
            break
        # A step is tried, judged, and looked into.
        attempt(kernels, method, signals, limits, tables)
        decide(method, limits, tables)
        unsure = mark_unsure(tables)
        if looks or unsure:
            found = look_into(
                kernels, method, signals, watched, limits, saving, unsure, occasions, alone, found,
                tables, places,
            )  # fmt: skip
        book(method.exponent, tables)
        # Where it is accepted the lane goes on from its end.
        trips += 1
        if limits.stability > 0 and trips == due:
            due = trips + look_due(method, limits, tables)
        accept(sixteenths(method.exponent), limits.max_step, tables.now)
        if breaks:
            restart(kernels.motion, method.solution, signals, tables)
        if watching:
            found = happen(
                BEHIND, occasions, alone, method, signals, closure_tol, found, tables, places
            )
        go_on(method, tables)
        if some(large(tables)):
            turned |= settle(tables)

    leave(waiting, members, begun, results, turned, tables)
    if kernels.closure != 0:
        measure_closure(kernels.closure, members, results.numbers, parameters, tables)
    space[0, 0] = blocks[0, 0] = counts[0, 0] = 0  # the memory of the tables lives to the end
    observed[0, 0] = memory[0] = 0.0
    saved, turns[:] = alone.saved, 0.0
    return found[:saved]
