"""The integrators' loop, which all methods share; each method's module compiles it together with
its own way to advance.

One turn: `advance` tries a step, q of the new state projected onto phi(q) = 0; the events within
the step are located and the samples taken by dense output, projected too; the step is accepted, or
shrunk. Where the inputs may jump, at a break of the signals or where a sampled controller acts, a
step ends, and the slope there is evaluated anew.

The error of a component is |h sum_i e_i k_i| plus the distance by which the projection moved it: a
projection that carries the state away, to another assembly mode say, is an error like any other and
is refused.

Whole turns of large angles are counted apart after each step (`turns`); events, controllers and
rows take them with their turns.

Names: those of `native_parts`; `held`, the last inputs, which a controller sets at the times k
period; `conditions`, a row (direction, terminal) for each event; `loose`, the closure's tolerance
at the present size of q.
"""

import math
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.core.dispatcher import Dispatcher

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_between import ROUNDING, Schedule, act, due, next_end, resized
from linkwork.simulation.native_events import LOOKS, MOST
from linkwork.simulation.native_occurrences import EventPlaces, StepSpan, happenings, take_samples
from linkwork.simulation.native_pace import (
    LARGEST_FACTOR,
    SAFETY,
    SMALLEST_FACTOR,
    Rhythm,
    after_failure,
    after_retreat,
    after_success,
    fallen,
    first_step,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    SINGULAR,
    Kernels,
    Room,
    StepLimits,
    Turns,
    add_turns,
    copy,
    evaluate_first,
    first_fault,
    force,
    inputs_of,
    method_of,
    padded,
    project,
    record,
    settle,
    stiffness,
)
from linkwork.simulation.native_watch import free_until, look_into, next_bend, watch_of
from linkwork.simulation.pointers import call, pointer
from linkwork.simulation.status import Status

STEP_UNDERFLOW = int(Status.STEP_UNDERFLOW)
TOO_MANY_STEPS = int(Status.TOO_MANY_STEPS)
EVENT = int(Status.EVENT)
STIFF = int(Status.STIFF)

NEAR = 1.25  # a pivot this close to its bound, relative to it, is at it
SMALLEST_STEP = 16 * 2.0**-52  # relative to the time and to the duration
FIRST_ROWS = 64
LOOK = 1024
"""Accepted steps from one look for stiffness to the next, and more than a stiff run ends with."""
VOTES = 15  # by which stiff steps are more than others, where the run is called stiff


class Trial(NamedTuple):
    """What came of a trial step: OK or why the equations failed, the scaled error, the smallest
    pivot, the cost."""

    ailment: int
    error: float
    pivot: float
    pivot_time: float
    last_pivot: float
    residual: float
    evaluations: int
    projections: int


class LoopOutcome(NamedTuple):
    """What came of a run, apart from the rows saved and the last state; `fault` is what was not
    finite, if anything."""

    status: int
    evaluations: int
    accepted: int
    rejected: int
    projections: int
    fault: int
    next_sample: int
    time: float
    step: float
    growth: float
    longest: float
    ideal: float
    pivot: float
    pivot_time: float
    closure_error: float
    rejected_pivot: float
    rejected_residual: float


COUNTS = 7  # numbers of an outcome that count something


@njit(forceinline=True, **OPTIONS)
def memory_for(n, nq, parameters, inputs, events, stages, degree, stiff):
    """Return zeros for all that `furnish` deals out."""
    states, ends = (4 + stages) * padded(n + 1), max(padded(n + 1), padded(stages))
    size = (
        states
        + (MOST + 4) * (events + 1)
        + n
        + inputs
        + 2 * parameters
        + 2 * nq
        + 1
        + degree
        + stages
        + ends
    )
    return np.zeros(size + (n * (2 * n + inputs + 2) if stiff else 0))


@njit(forceinline=True, **OPTIONS)
def furnish(y, n, nq, parameters, inputs, conditions, events, stages, degree):
    """Return where a run computes, and where its events are looked at, in the memory from y on."""
    width = padded(n + 1)
    k = y + 3 * width
    g = k + (stages + 1) * width
    x = g + (MOST + 4) * (events + 1)
    z = x + n + inputs + parameters
    z_next = z + nq + parameters
    powers = z_next + nq + 1
    weights = powers + degree
    zeros = weights + stages
    work = zeros + max(width, padded(stages))
    room = Room(
        y,
        y + width,
        y + 2 * width,
        k,
        x,
        z,
        z_next,
        powers,
        weights,
        zeros,
        work,
        n,
        nq,
        width,
        inputs,
    )
    thetas, within, crossings = (
        g + (MOST + 4) * events,
        g + (MOST + 2) * events,
        g + (MOST + 3) * events,
    )
    return room, EventPlaces(conditions, events, g, thetas, within, crossings)


def run(
    motion, closure, jacobian, events, control, p, signal, seen, strict,
    plan, stages, degree, estimates, solution, computed, exponent, blur,
    tolerance, pivot_bound, closure_tol, stability,
    nq, y_end, save_at, every_step, start, stop, max_step, pace, max_steps,
    held, period, next_sample, conditions, counted, facts,
):  # fmt: skip
    """Integrate from y_end at start to stop, leave the last state in y_end, its whole turns in the
    last row of counted (spans, wraps, turns) and the `LoopOutcome` in facts; return the rows, of angles
    with their turns.

    A row is (t, y, u, residual, event), with event = -1 where the row was asked for. signal, seen:
    the inputs and what is to be watched, as of `Signal.table`. pace (4,): the numbers of a
    `Rhythm`; a step <= 0 asks for a guess of the first. `exponent` = 1 / (order of the error
    estimate + 1), or 0: all steps have the length given there. tolerance (2, n): rtol, atol.
    `stability`: h |lambda| from which a step is taken for stiff, or 0: stiffness is not looked for.
    """
    n, watched = y_end.size, conditions.shape[0]
    inputs, breaks = inputs_of(pointer(signal))
    given, inputs_all = inputs.columns, inputs.columns + held.size
    memory = memory_for(n, nq, p.size, inputs_all, watched, stages, degree, jacobian != 0)
    kernels = Kernels(motion, closure, jacobian, events, control)
    method = method_of(plan, stages, degree, estimates, solution, computed, exponent, blur)
    turns = Turns(pointer(counted), pointer(counted) + nq, pointer(counted) + 2 * nq)
    room, scene = furnish(
        pointer(memory), n, nq, p.size, inputs_all, pointer(conditions), watched, stages, degree
    )  # fmt: skip
    watch = watch_of(pointer(seen), strict)
    y, x, new, sample = room.y, room.x, room.new, room.sample
    copy(pointer(y_end), y, n)
    loose = closure_tol * settle(y, turns, nq)
    limits = StepLimits(pointer(tolerance), pointer(tolerance) + n, pivot_bound, loose)
    copy(pointer(held), x + n + given, held.size)
    copy(pointer(p), x + n + inputs_all, p.size)
    copy(pointer(p), room.z + nq, p.size)
    columns = n + inputs_all + 3
    rows = np.empty((FIRST_ROWS if every_step else save_at.size + MOST * watched, columns))
    table = pointer(rows)
    saved = taken = bend = next_break = evaluations = accepted = rejected = projections = 0
    closure_error = rejected_residual = 0.0
    rhythm = Rhythm(pace[0], min(pace[1], LARGEST_FACTOR), pace[2], pace[3])
    fixed, fault = exponent == 0, -1
    length = rhythm.step if fixed else 0.0
    schedule = Schedule(
        start, stop, breaks, int(signal[2]), period if control != 0 else 0.0, length
    )
    grid = int(start / length) if fixed else 0
    t, cause, status = start, STEP_UNDERFLOW, OK
    smallest_step = SMALLEST_STEP * max(stop, stop - start)

    # The state at the start.
    if closure != 0:
        closure_error, projections = project(closure, loose, True, y, room)
        rejected_residual = closure_error
        if not closure_error <= loose:
            status = CLOSURE_LOST
    residual, arrived, piece, target = closure_error, True, 0, stop
    pivot, pivot_time, first_pivot, rejected_pivot = math.inf, t, 0.0, 0.0
    halted, stale, votes = False, True, 0

    while arrived or status == OK:
        if arrived:  # at the time t with the state y: what happens between two steps
            arrived = False
            if saved + 1 + MOST * watched + save_at.size - taken > rows.shape[0]:
                rows = resized(rows, 2 * saved + FIRST_ROWS + MOST * watched + save_at.size)
                table = pointer(rows)
            copy(y, x, n)
            piece = force(inputs, t, False, piece, x + n)
            goes_on = status == OK and t < stop and not halted and accepted + rejected < max_steps
            if goes_on and due(schedule, t, next_sample):
                row = table + (saved - 1) * columns
                unset = act(
                    kernels,
                    room,
                    turns,
                    given,
                    pointer(held),
                    held.size,
                    row,
                    saved > 0 and row[0] == t,
                )
                next_sample, stale = next_sample + 1, True
                if unset >= 0:
                    status, fault = NON_FINITE, n + 1 + unset
            if stale and (goes_on or accepted == 0) and status == OK:
                status, first_pivot = evaluate_first(kernels, limits, room)
                evaluations += 1
                rejected_pivot, stale = first_pivot, False
                if first_pivot < pivot:
                    pivot, pivot_time = first_pivot, t
                if status == NON_FINITE:
                    fault = first_fault(room, 1)
            if accepted == 0 and events != 0:
                add_turns(x, turns, nq)
                call(events, x, scene.g)
            if every_step or (accepted == 0 and save_at.size > 0 and save_at[0] == t):
                record(table + saved * columns, t, y, residual, -1.0, inputs, piece, room, turns)
                saved += 1
                taken += 0 if every_step else 1
            target, next_break, grid = next_end(schedule, t, next_break, grid, next_sample)
            if not goes_on or status != OK:
                if status == OK and halted:
                    status = EVENT
                elif status == OK and t < stop:
                    status = TOO_MANY_STEPS
                break
            h = rhythm.step
            if h <= 0:
                h = first_step(kernels, inputs, method, limits, room, t, target - t)
                evaluations += 1
            rhythm = Rhythm(min(h, max_step), rhythm.growth, rhythm.longest, rhythm.ideal)
        elif accepted + rejected == max_steps:
            status = TOO_MANY_STEPS
            break

        h = rhythm.step
        if h < smallest_step:
            status = cause
            break
        # A step lands on the target (short of it by rounding only counts), or goes half of the way
        # rather than leave a sliver.
        gap = target - t
        step = gap if fixed or h * (1 + ROUNDING) >= gap else min(h, gap / 2)
        arrival = target if step == gap else t + step
        trial = advance(  # noqa: F821  # pyright: ignore[reportUndefinedVariable]
            kernels, inputs, method, limits, room, every_step, t, step, piece
        )
        evaluations += trial.evaluations
        projections += trial.projections
        ailment, error, residual, least = trial.ailment, trial.error, trial.residual, 0.0
        accepts = ailment == OK and (fixed or error <= 1)
        if ailment == NON_FINITE:
            fault = first_fault(room, stages)
        row, sampled, ends, pending = saved, residual, LOOKS, stages - computed

        # What the stages may not have seen within the step, its events and its samples.
        bend = next_bend(watch, t, bend)
        if (
            accepts
            and not fixed
            and (free_until(watch, bend) < arrival or fallen(h, rhythm.longest))
        ):
            error, ailment, least, calls = look_into(
                kernels,
                inputs,
                watch,
                method,
                limits,
                room,
                rhythm,
                t,
                step,
                arrival,
                piece,
                bend,
                error,
            )
            evaluations, pending = evaluations + calls, 0
            accepts = ailment == OK and error <= 1
        if accepts and events != 0:
            span = StepSpan(t, step, arrival, piece)
            kept = happenings(
                kernels,
                inputs,
                method,
                limits,
                room,
                turns,
                scene,
                span,
                residual,
                pending,
                table + row * columns,
            )
            ailment, halted, arrival, residual, ends = (
                kept.ailment,
                kept.halted,
                kept.arrival,
                kept.residual,
                kept.ends,
            )
            fault = kept.fault if kept.fault >= 0 else fault
            sampled, row, accepts = residual, row + kept.rows, ailment == OK
            evaluations, projections = (
                evaluations + kept.evaluations,
                projections + kept.projections,
            )
            pending = 0 if kept.evaluations > 0 else pending
        wanted = 0
        while accepts and taken + wanted < save_at.size and save_at[taken + wanted] <= arrival:
            wanted += 1
        if wanted > 0:
            span = StepSpan(t, step, arrival, piece)
            kept = take_samples(
                kernels, inputs, method, limits, room, turns, span, residual, pointer(save_at) + taken, wanted, pending,
                table + row * columns,
            )  # fmt: skip
            ailment, residual, sampled = kept.ailment, kept.residual, max(sampled, kept.largest)
            row, accepts = row + wanted, ailment == OK
            evaluations, projections = (
                evaluations + kept.evaluations,
                projections + kept.projections,
            )

        if accepts:
            accepted += 1
            if stability > 0 and (votes > 0 or accepted % LOOK == 0) and not halted:
                votes = max(
                    0, votes + (1 if stiffness(method, limits, room, step) > stability else -1)
                )
                if votes >= VOTES and stop - arrival > LOOK * step:
                    status = STIFF
            # A slope is the next step's first unless the inputs may jump here.
            stale = fixed or arrival == target
            t, saved, arrived = arrival, row, True
            taken += wanted
            copy(new, y, n)
            copy(scene.g + ends * watched, scene.g, watched)
            loose = closure_tol * settle(y, turns, nq)
            limits = StepLimits(limits.rtol, limits.atol, pivot_bound, loose)
            closure_error = max(closure_error, sampled)
            if trial.pivot < pivot:
                pivot, pivot_time = trial.pivot, trial.pivot_time
            if not fixed:
                first_pivot = trial.last_pivot
                copy(room.k + solution * room.width, room.k, n)
                rhythm = after_success(rhythm, step, error, exponent, max_step)
        else:
            rejected += 1
            if ailment == OK:
                cause = STEP_UNDERFLOW
                shrunk = step * max(SMALLEST_FACTOR, SAFETY / error**exponent)
                rhythm = after_failure(rhythm, max(least, shrunk))
            else:
                cause = ailment
                rejected_pivot, rejected_residual = trial.pivot, residual
                rhythm = after_retreat(rhythm, step)
                if fixed or (ailment == SINGULAR and first_pivot <= NEAR * pivot_bound):
                    status = ailment

    if closure != 0 and accepted > 0:
        copy(y, sample, n)
        residual, calls = project(closure, loose, True, sample, room)
        closure_error, projections = max(closure_error, residual), projections + calls
    counts = (status, evaluations, accepted, rejected, projections, fault, next_sample)
    numbers = (
        t, rhythm.step, rhythm.growth, rhythm.longest, rhythm.ideal,
        pivot, pivot_time, closure_error, rejected_pivot, rejected_residual,
    )  # fmt: skip
    for i, count in enumerate(counts):
        facts[i] = count
    for i, number in enumerate(numbers):
        facts[len(counts) + i] = number
    for m in range(n):
        y_end[m] = memory[m]  # y, from the array itself, which so lives to the end
    return rows[:saved]


_array, _table = (
    types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2)
)
_state = types.Array(types.float64, 1, "C")
_number, _whole = types.float64, types.intp
_SIGNATURE = (
    *(_whole, _whole, _whole, _whole, _whole, _array, _array, _array, _whole),
    *(_array, _whole, _whole, _whole, _whole, _whole, _number, _number),
    *(_table, _number, _number, _number),
    *(_whole, _state, _array, types.boolean, _number, _number, _number, _array, _whole),
    *(_state, _number, _whole, _table, types.Array(types.float64, 2, "C"), _state),
)


def integrator(what: str, advance: Dispatcher) -> Dispatcher:
    """Return the loop `run` around a method's way to advance by one step, compiled once as part of
    the method's file."""
    source = advance.py_func.__code__.co_filename
    code = run.__code__.replace(co_filename=source, co_name="integrate", co_qualname="integrate")
    names = globals() | {"advance": advance, "__name__": advance.py_func.__module__}
    function = FunctionType(code, names, "integrate")
    return compiled_once(what, _SIGNATURE)(function)
