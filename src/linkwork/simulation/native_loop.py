"""The integrators' loop, which all methods share; each method's module compiles it together with its own way to advance.

One turn: `advance` tries a step, q of the new state projected onto phi(q) = 0; the events within the step are located and
the samples taken by dense output, projected too; the step is accepted, or shrunk. Where the inputs may jump, at a break of
the signals or where a sampled controller acts, a step ends, and the slope there is evaluated anew.

The error of a component is |h sum_i e_i k_i| plus the distance by which the projection moved it: a projection that carries
the state away, to another assembly mode say, is an error like any other and is refused.

Whole turns of large angles are counted apart after each step (`turns`); events, controllers and rows take them with their
turns.

Names: those of `native_parts`; `held`, the last inputs, which a controller sets at the times k period; `conditions`, a row
(direction, terminal) for each event; `loose`, the closure's tolerance at the present size of q.
"""

import math
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.core.dispatcher import Dispatcher

from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_events import (
    LOOKS,
    MOST,
    NEVER,
    ROOT,
    earliest,
    locate,
    look,
    quiet,
    state_within,
)  # fmt: skip
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
    Inputs,
    Kernels,
    Limits,
    Room,
    Turns,
    add_turns,
    copy,
    evaluate,
    first_fault,
    force,
    method_of,
    padded,
    project,
    record,
    settle,
    stiffness,
)
from linkwork.simulation.native_watch import Watch, free_until, next_bend, peaked, unseen
from linkwork.simulation.pointers import call, combine, pointer
from linkwork.simulation.status import Status

STEP_UNDERFLOW = int(Status.STEP_UNDERFLOW)
TOO_MANY_STEPS = int(Status.TOO_MANY_STEPS)
EVENT = int(Status.EVENT)
STIFF = int(Status.STIFF)

NEAR = 1.25  # a pivot this close to its bound, relative to it, is at it
ROUNDING = 1e-9
SMALLEST_STEP = 16 * 2.0**-52  # relative to the time and to the duration
FIRST_ROWS = 64
LOOK = 1024  # accepted steps from one look for stiffness to the next, and more than a stiff run ends with
VOTES = 15  # by which stiff steps are more than others, where the run is called stiff


class Trial(NamedTuple):
    """What came of a trial step: OK or why the equations failed, the scaled error, the smallest pivot, the cost."""

    ailment: int
    error: float
    pivot: float
    pivot_time: float
    last_pivot: float
    residual: float
    evaluations: int
    projections: int


class Outcome(NamedTuple):
    """What came of a run, apart from the rows saved and the last state; `fault` is what was not finite, if anything."""

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


@njit(**OPTIONS)
def evaluate_first(kernels, limits, room):
    """Evaluate k_0, from which no step can retreat, and look at all of its numbers."""
    ailment, pivot = evaluate(kernels.motion, room, 0, limits.pivot_bound)
    if ailment == OK and first_fault(room, 1) < room.n:
        ailment = NON_FINITE
    return ailment, pivot


@njit(**OPTIONS)
def extend(kernels, inputs, method, limits, room, t, step, piece):
    """Evaluate the stages that only the dense output needs; return OK or why the equations fail there."""
    for i in range(method.computed, method.stages):
        combine(method.a + i * method.stages, i, step, room.y, room.k, room.width, room.n, room.x)
        force(inputs, t + method.c[i] * step, True, piece, room.x + room.n)
        ailment, _ = evaluate(kernels.motion, room, i, limits.pivot_bound)
        if ailment != OK:
            return ailment
    return OK


@njit(**OPTIONS)
def resized(rows, size):
    """Return the rows in a table of another length."""
    table = np.empty((size, rows.shape[1]))
    table[: rows.shape[0]] = rows
    return table


def run(
    motion, closure, jacobian, events, control, p, knots, coefficients, breaks,
    watched_knots, watched_coefficients, bends, strict,
    plan, stages, degree, estimates, solution, computed, exponent, blur,
    tolerance, pivot_bound, closure_tol, stability,
    nq, y_end, save_at, every_step, start, stop, max_step, pace, max_steps,
    held, period, next_sample, conditions, counted, facts,
):  # fmt: skip
    """Integrate from y_end at start to stop, leave the last state in y_end, its whole turns in the last row of counted
    (spans, wraps, turns) and the `Outcome` in facts; return the rows, of angles with their turns.

    A row is (t, y, u, residual, event), with event = -1 where the row was asked for. pace (4,): the numbers of a `Rhythm`;
    a step <= 0 asks for a guess of the first. `exponent` = 1 / (order of the error estimate + 1), or 0: all steps have the
    length given there. tolerance (2, n): rtol, atol.
    `stability`: h |lambda| from which a step is taken for stiff, or 0: stiffness is not looked for.
    """
    n, signals, width = y_end.size, coefficients.shape[2], padded(y_end.size + 1)
    inputs_all, watched, most = signals + held.size, conditions.shape[0], max(width, padded(stages))
    stiff = n * (2 * n + inputs_all + 2) if jacobian != 0 else 0
    sizes = (
        (4 + stages) * width + (MOST + 4) * (watched + 1) + n + inputs_all + 2 * p.size + 2 * nq + 1 + degree + stages
    )
    memory = np.zeros(sizes + most + stiff)
    y = pointer(memory)
    k = y + 3 * width
    g = k + (stages + 1) * width
    x = g + (MOST + 4) * (watched + 1)
    z = x + n + inputs_all + p.size
    z_next = z + nq + p.size
    powers = z_next + nq + 1
    weights = powers + degree
    zeros = weights + stages
    kernels = Kernels(motion, closure, jacobian, events, control)
    inputs = Inputs(pointer(knots), pointer(coefficients), coefficients.shape[0], signals)
    method = method_of(plan, stages, degree, estimates, solution, computed, exponent, blur)
    turns = Turns(pointer(counted), pointer(counted) + nq, pointer(counted) + 2 * nq)
    room = Room(
        y, y + width, y + 2 * width, k, x, z, z_next, powers, weights, zeros, zeros + most,
        n, nq, width, inputs_all,
    )  # fmt: skip
    watch = Watch(
        pointer(watched_knots), pointer(watched_coefficients), watched_coefficients.shape[0], watched_coefficients.shape[2],
        pointer(bends), bends.shape[0] - 1, strict,
    )  # fmt: skip
    new, sample, g_within, crossings = room.new, room.sample, g + (MOST + 2) * watched, g + (MOST + 3) * watched
    thetas = g + (MOST + 4) * watched
    copy(pointer(y_end), y, n)
    loose = closure_tol * settle(y, turns, nq)
    limits = Limits(pointer(tolerance), pointer(tolerance) + n, pivot_bound, loose)
    copy(pointer(held), x + n + signals, held.size)
    copy(pointer(p), x + n + inputs_all, p.size)
    copy(pointer(p), z + nq, p.size)
    columns = n + inputs_all + 3
    rows = np.empty((FIRST_ROWS if every_step else save_at.size + MOST * watched, columns))
    table = pointer(rows)
    saved = taken = bend = next_break = evaluations = accepted = rejected = projections = 0
    closure_error = rejected_residual = 0.0
    rhythm = Rhythm(pace[0], min(pace[1], LARGEST_FACTOR), pace[2], pace[3])
    fixed, length, fault = exponent == 0, rhythm.step, -1
    grid = int(start / length) if fixed else 0
    t, cause, status = start, STEP_UNDERFLOW, OK
    smallest_step = SMALLEST_STEP * max(stop, stop - start)

    # The state at the start.
    if closure != 0:
        closure_error, projections = project(closure, loose, True, y, room)
        rejected_residual = closure_error
        if not closure_error <= loose:
            status = CLOSURE_LOST
    residual, arrived, piece = closure_error, True, 0
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
            if control != 0 and goes_on and next_sample * period <= t + ROUNDING * period:
                add_turns(x, turns, nq)
                call(control, x, pointer(held))
                copy(y, x, nq)
                copy(pointer(held), x + n + signals, held.size)
                next_sample, stale = next_sample + 1, True
                for i in range(held.size):
                    if saved > 0 and table[(saved - 1) * columns] == t:
                        table[(saved - 1) * columns + 1 + n + signals + i] = held[i]
                    if not math.isfinite(held[i]) and status == OK:
                        status, fault = NON_FINITE, n + 1 + i
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
                call(events, x, g)
            if every_step or (accepted == 0 and save_at.size > 0 and save_at[0] == t):
                record(table + saved * columns, t, y, residual, -1.0, inputs, piece, room, turns)
                saved += 1
                if not every_step:
                    taken += 1
            while next_break < breaks.size and breaks[next_break] <= t + ROUNDING * (t - start):
                next_break += 1
            while fixed and grid * length <= t + ROUNDING * length:
                grid += 1
            target = stop
            if next_break < breaks.size:
                target = min(target, breaks[next_break])
            if control != 0:
                target = min(target, next_sample * period)
            if fixed:
                target = min(target, grid * length)
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
        # A step lands on the target (short of it by rounding only counts), or goes half of the way rather than leave a sliver.
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
        extended = computed == stages
        row, reached, sampled = saved, taken, residual

        # What varies within the step, and its stages may not have seen.
        bend = next_bend(watch, t, bend)
        bends_within, peaks = free_until(watch, bend) < arrival, fallen(h, rhythm.longest)
        if accepts and not fixed and (bends_within or peaks):
            if not extended:
                ailment = extend(kernels, inputs, method, limits, room, t, step, piece)
                evaluations += stages - computed
                extended = True
            if ailment == OK and peaks:
                hidden, ailment = peaked(kernels, inputs, method, limits, room, t, step, piece)
                error, evaluations = max(error, hidden), evaluations + 1
            if ailment == OK and bends_within and error <= 1:
                hidden, ailment, calls = unseen(kernels, inputs, watch, method, limits, room, t, step, piece, bend)
                evaluations += calls
                error, least = max(error, hidden), free_until(watch, bend) - t
            accepts = ailment == OK and error <= 1

        # The events within the step, in the order of their times, up to the first that ends the run.
        ends = LOOKS
        if accepts and events != 0:
            copy(new, x, n)
            add_turns(x, turns, nq)
            force(inputs, arrival, True, piece, x + n)
            call(events, x, g + ends * watched)
            if not quiet(
                kernels, inputs, method, room, turns, t, step, piece, watched, g, g + ends * watched, g_within
            ):
                if not extended:
                    ailment = extend(kernels, inputs, method, limits, room, t, step, piece)
                    evaluations += stages - computed
                    extended, accepts = True, ailment == OK
                if accepts:
                    ends, calls = look(kernels, inputs, method, limits, room, turns, t, step, piece, watched, thetas, g)
                    projections += calls
                for i in range(ends * watched if accepts else 0):
                    if math.isnan(g[watched + i]):
                        accepts, ailment, fault = False, NON_FINITE, n + 1 + held.size + i % watched
                j = 0
                while accepts and not halted and j < ends:
                    before, after, due = g + j * watched, g + (j + 1) * watched, 0
                    for i in range(watched):
                        rises, falls = before[i] < 0 <= after[i], before[i] > 0 >= after[i]
                        crossings[i] = NEVER
                        if (rises and conditions[i, 0] >= 0) or (falls and conditions[i, 0] <= 0):
                            crossings[i], calls = locate(
                                kernels, inputs, method, limits, room, turns, t, step, piece, i,
                                thetas[j], before[i], thetas[j + 1], after[i], g_within,
                            )  # fmt: skip
                            projections += calls
                            due += 1
                    last, j = NEVER, j + 1
                    while accepts and due > 0:
                        first = earliest(crossings, watched)
                        theta = crossings[first]
                        if halted and theta - last > 4 * ROOT * max(1.0, abs(t / step)):
                            break
                        crossings[first] = NEVER
                        due -= 1
                        time, remainder, calls = arrival, residual, 0
                        if (
                            halted or theta == 1
                        ):  # at the end of the step, or at the instant of the event that ends the run
                            copy(new, sample, n)
                        else:
                            time = t + theta * step
                            remainder, calls = state_within(kernels, method, limits, room, theta, step)
                        projections += calls
                        if not remainder <= loose:
                            accepts, ailment, residual = False, CLOSURE_LOST, remainder
                        record(table + row * columns, time, sample, remainder, float(first), inputs, piece, room, turns)
                        row += 1
                        if conditions[first, 1] != 0 and not halted:
                            halted, last, arrival, residual = True, theta, time, remainder
                            copy(sample, new, n)
                halted = halted and accepts

        # The samples that lie within the step; they count once the step is accepted.
        while accepts and reached < save_at.size and save_at[reached] <= arrival:
            time, remainder, calls = save_at[reached], 0.0, 0
            if time == arrival:
                copy(new, sample, n)
                if closure != 0:
                    remainder, calls = project(closure, loose, True, sample, room)
            else:
                if not extended:
                    ailment = extend(kernels, inputs, method, limits, room, t, step, piece)
                    evaluations += stages - computed
                    extended, accepts = True, ailment == OK
                theta = (time - t) / step
                remainder, calls = state_within(kernels, method, limits, room, theta, step)
            projections += calls
            if not remainder <= loose:
                accepts, ailment, residual = False, CLOSURE_LOST, remainder
            record(table + row * columns, time, sample, remainder, -1.0, inputs, piece, room, turns)
            sampled = max(sampled, remainder)
            row, reached = row + 1, reached + 1

        if accepts:
            accepted += 1
            if stability > 0 and (votes > 0 or accepted % LOOK == 0) and not halted:
                votes = max(0, votes + (1 if stiffness(method, limits, room, step) > stability else -1))
                if votes >= VOTES and stop - arrival > LOOK * step:
                    status = STIFF
            # A slope is the next step's first unless the inputs may jump here.
            stale = fixed or arrival == target
            t, saved, taken, arrived = arrival, row, reached, True
            copy(new, y, n)
            copy(g + ends * watched, g, watched)
            loose = closure_tol * settle(y, turns, nq)
            limits = Limits(limits.rtol, limits.atol, pivot_bound, loose)
            closure_error = max(closure_error, sampled)
            if trial.pivot < pivot:
                pivot, pivot_time = trial.pivot, trial.pivot_time
            if not fixed:
                first_pivot = trial.last_pivot
                copy(k + solution * width, k, n)
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


_array, _table, _tables = (types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3))
_state = types.Array(types.float64, 1, "C")
_number, _whole = types.float64, types.intp
_SIGNATURE = (
    *(_whole, _whole, _whole, _whole, _whole, _array, _array, _tables, _array),
    *(_array, _tables, _table, _whole),
    *(_array, _whole, _whole, _whole, _whole, _whole, _number, _number),
    *(_table, _number, _number, _number),
    *(_whole, _state, _array, types.boolean, _number, _number, _number, _array, _whole),
    *(_state, _number, _whole, _table, types.Array(types.float64, 2, "C"), _state),
)


def integrator(what: str, advance: Dispatcher) -> Dispatcher:
    """Return the loop `run` around a method's way to advance by one step, compiled once as part of the method's file."""
    source = advance.py_func.__code__.co_filename
    code = run.__code__.replace(co_filename=source, co_name="integrate", co_qualname="integrate")
    names = globals() | {"advance": advance, "__name__": advance.py_func.__module__}
    function = FunctionType(code, names, "integrate")
    return compiled_once(what, _SIGNATURE)(function)
