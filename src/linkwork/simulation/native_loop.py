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

Names: those of `native_parts` and `native_memory`; `run`, the structure that holds all of a run.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numba.core.dispatcher import Dispatcher

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.native_between import ROUNDING, Schedule, act, due, resized, set_target
from linkwork.simulation.native_events import LOOKS, MOST, TINY
from linkwork.simulation.native_memory import RunCourse, furnish, integration_at, memory_for
from linkwork.simulation.native_occurrences import take_samples
from linkwork.simulation.native_pace import (
    LARGEST_FACTOR,
    SAFETY,
    SMALLEST_FACTOR,
    WARY,
    Rhythm,
    after_failure,
    after_retreat,
    after_success,
    first_step,
    shortest_step,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    SINGULAR,
    Kernels,
    StepLimits,
    Turns,
    acting_from,
    add_turns,
    copy,
    evaluate,
    first_fault,
    force,
    inputs_of,
    method_of,
    project,
    record,
    settle,
    stiffness,
)
from linkwork.simulation.native_watch import free_until, look_into, next_bend, unsure, watch_of
from linkwork.simulation.pointers import call, pointer
from linkwork.simulation.status import Status
from linkwork.simulation.structures import memory_of, numba_type

STEP_UNDERFLOW = int(Status.STEP_UNDERFLOW)
TOO_MANY_STEPS = int(Status.TOO_MANY_STEPS)
EVENT = int(Status.EVENT)
STIFF = int(Status.STIFF)

NEAR = 2.0  # a pivot this close to its bound, relative to it, is at it
FIRST_ROWS = 64
LOOK = 1024
"""Accepted steps from one look for stiffness to the next, and more than a stiff run ends with."""
VOTES = 15  # by which stiff steps are more than others, where the run is called stiff


class LoopOutcome(NamedTuple):
    """What came of a run, apart from the rows saved and the last state; `fault` is what was not
    finite, if anything, `since` and `votes` are as in `RunCourse`."""

    status: int
    evaluations: int
    accepted: int
    rejected: int
    projections: int
    fault: int
    next_sample: int
    since: int
    votes: int
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


_array, _table = (
    types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2)
)
_state = types.Array(types.float64, 1, "C")


def flat(group: type) -> Any:
    """Return Numba's type of a plain tuple: to look into a named one takes it two microseconds."""
    return types.BaseTuple.from_types(list(numba_type(group)))


SIGNATURE = (
    *(flat(Kernels), _array, _array, _table, _table),
    *(_array, _array, flat(RunCourse), _array),
    *(types.Array(types.float64, 2, "C"), _state, _state),
)


@njit(**OPTIONS)
def begin(kernels, p, plan, tolerance, conditions, signal, seen, given, save_at, counted, y):
    """Return a run at its start, the memory that holds it, and a table for its rows.

    p (np,); plan: `StepPlan.table`; tolerance (2, n): rtol, atol; conditions: a row (direction,
    terminal) for each event; signal, seen: the inputs and what is to be watched, as of
    `Signal.table`; save_at (K,); counted: (spans, wraps, turns) of q, a row each; y: the state, and
    behind it the held inputs. All of it is to be kept.
    """
    # The memory, as large as the numbers of states, inputs, parameters and events ask.
    nq, watched, n = counted.shape[1], conditions.shape[0], tolerance.shape[1]
    method, (inputs, breaks) = method_of(pointer(plan)), inputs_of(pointer(signal))
    all_inputs = inputs.columns + y.size - n
    memory = memory_for(n, nq, p.size, all_inputs, watched, method, kernels[2] != 0)
    run = integration_at(pointer(memory))
    run.room, run.scene = furnish(
        pointer(memory), n, nq, p.size, all_inputs, pointer(conditions), watched, method
    )
    # What stays as it is over the run.
    run.kernels, run.inputs, run.method = Kernels(*kernels), inputs, method
    course = run.course = RunCourse(*given)
    run.shortest = shortest_step(course.start, course.stop)
    run.limits = StepLimits(
        pointer(tolerance), pointer(tolerance) + n,
        course.pivot_bound, course.closure_tol, course.stability, course.max_step,
    )  # fmt: skip
    run.watch = watch_of(pointer(seen), course.strict)
    run.turns = Turns(pointer(counted), pointer(counted) + nq, pointer(counted) + 2 * nq)
    fixed = method.exponent == 0
    run.schedule = Schedule(breaks, int(signal[2]), course.step if fixed else 0.0)
    run.grid = int(course.start / course.step) if fixed else 0
    run.times, run.asked, run.held = pointer(save_at), save_at.size, pointer(y) + n
    run.columns = n + all_inputs + 3
    first_rows = FIRST_ROWS if course.every_step else save_at.size + MOST * watched
    rows = np.empty((first_rows, run.columns))
    # The state, and what kernels take behind it: x = (y, u, p), z = (q, p).
    copy(pointer(y), run.room.y, n)
    copy(run.held, run.room.x + n + inputs.columns, y.size - n)
    copy(pointer(p), run.room.x + n + all_inputs, p.size)
    copy(pointer(p), run.room.z + nq, p.size)
    start(run)
    return run, memory, rows


@njit(**OPTIONS)
def start(run):
    """Put a run at its start: counts at zero, no turns in q, and q closed."""
    course, room = run.course, run.room
    run.t, run.pivot_time, run.pivot, run.target = course.start, course.start, math.inf, course.stop
    growth = min(course.growth, LARGEST_FACTOR)
    run.rhythm = Rhythm(course.step, growth, course.longest, course.ideal)
    run.next_sample, run.arrived, run.stale = course.next_sample, True, True
    run.since, run.votes = course.since, course.votes
    run.status, run.cause, run.fault = OK, STEP_UNDERFLOW, -1
    run.loose = run.limits.closure_tol * settle(room.y, run.turns, room.nq)
    if run.kernels.closure != 0:
        run.residual = run.closure_error = run.rejected_residual = project(run, True, room.y)
        if not run.residual <= run.loose:
            run.status = CLOSURE_LOST


def attempting(advance: Dispatcher) -> Dispatcher:
    """Return what tries one step by a method's way to advance."""

    @njit(**INLINED)
    def attempt(run):
        """Try a step, and accept or refuse it; tell whether one may be tried."""
        if run.accepted + run.rejected == run.course.max_steps:
            run.status = TOO_MANY_STEPS
            return False
        if not aim(run):
            return False
        advance(run)
        examine(run)
        if passes(run):
            accept(run)
        else:
            refuse(run)
        return True

    return attempt


def following(advance: Dispatcher) -> Dispatcher:
    """Return the loop around a method's way to advance by one step."""
    attempt = attempting(advance)

    @njit(**INLINED)
    def follow(run, rows):
        """Go on step by step until the run ends; return the rows."""
        run.rows = pointer(rows)
        more = 1 + MOST * run.scene.count + run.asked  # rows that a step may add
        while run.arrived or run.status == OK:
            if run.arrived:
                if run.saved + more - run.taken > rows.shape[0]:
                    rows = resized(rows, 2 * run.saved + FIRST_ROWS - 1 + more)
                    run.rows = pointer(rows)
                if not between(run):
                    break
            if not attempt(run):
                break
        return rows

    return follow


@njit(**INLINED)
def passes(run):
    """Tell whether the trial step may be accepted."""
    return run.ailment == OK and (run.error <= 1 or run.method.exponent == 0)


@njit(**INLINED)
def between(run):
    """Do what happens between two steps, at the time t with the state y; tell whether the run goes
    on."""
    course, room, t, first = run.course, run.room, run.t, run.accepted == 0
    run.arrived = False
    # The inputs that act from here on, of signals and of a controller whose time has come.
    copy(room.y, room.x, room.n)
    run.piece = force(run.inputs, acting_from(run, t), False, run.piece, room.x + room.n)
    lasts = t < course.stop and not run.halted
    goes_on = run.status == OK and lasts and run.accepted + run.rejected < course.max_steps
    if goes_on and due(run):
        unset = act(run)
        run.next_sample, run.stale = run.next_sample + 1, True
        if unset >= 0:
            run.status, run.fault = NON_FINITE, room.n + 1 + unset
    # The slope, and the event functions at the start of the run.
    if run.stale and (goes_on or first) and run.status == OK:
        evaluate_first(run)
    if first and run.kernels.events != 0:
        add_turns(room.x, run.turns, room.nq)
        call(run.kernels.events, room.x, run.scene.g)
    # The row of this state: only here its inputs are known.
    if course.every_step and not first and run.kernels.closure != 0:
        copy(room.y, room.sample, room.n)
        run.residual = project(run, True, room.sample)
        run.closure_error = max(run.closure_error, run.residual)
    if course.every_step or (first and run.asked > 0 and run.times[0] == t):
        run.row = run.saved
        record(run, t, room.y, run.residual, -1.0)
        run.saved = run.row
        run.taken += 0 if course.every_step else 1
    # Where the run goes from here.
    set_target(run)
    if not goes_on or run.status != OK:
        if run.status == OK and run.halted:
            run.status = EVENT
        elif run.status == OK and t < course.stop:
            run.status = TOO_MANY_STEPS
        return False
    rhythm = run.rhythm
    h = rhythm.step if rhythm.step > 0 else first_step(run)
    run.rhythm = Rhythm(min(h, run.limits.max_step), rhythm.growth, rhythm.longest, rhythm.ideal)
    return True


@njit(**OPTIONS)
def evaluate_first(run):
    """Evaluate k_0, from which no step can retreat, and look at all of its numbers."""
    run.status, pivot = evaluate(run, 0)
    fault = first_fault(run, 1)
    if run.status == OK and fault < run.room.n:
        run.status = NON_FINITE
    if run.status == NON_FINITE:
        run.fault = fault
    run.first_pivot, run.rejected_pivot, run.stale = pivot, pivot, False
    if pivot < run.pivot:
        run.pivot, run.pivot_time = pivot, run.t


@njit(**INLINED)
def aim(run):
    """Choose the trial step; tell whether it is long enough to be one."""
    h, fixed = run.rhythm.step, run.method.exponent == 0
    if h < run.shortest:
        run.status = run.cause
        return False
    # A step lands on the target (short of it by rounding only counts), or goes half of the way
    # rather than leave a sliver.
    gap = run.target - run.t
    step = gap if fixed or h * (1 + ROUNDING) >= gap else min(h, gap / 2)
    run.step, run.arrival = step, run.target if step == gap else run.t + step
    run.ailment, run.error, run.residual, run.least = OK, 0.0, 0.0, 0.0
    run.lowest, run.last_pivot, run.lowest_time = math.inf, math.inf, run.t
    return True


@njit(**INLINED)
def examine(run):
    """Look at the trial for what its stages may not have seen, its events and its samples; record
    these."""
    if run.rhythm.ideal == 0:
        run.error *= WARY
    if run.ailment == NON_FINITE:
        run.fault = first_fault(run, run.method.stages)
    run.row, run.wanted, run.sampled, run.ends = run.saved, 0, run.residual, LOOKS
    run.pending = run.method.stages - run.method.computed
    run.bend = next_bend(run.watch, run.t, run.bend)
    # An error is an estimate only where the stages have seen all that acts within the step.
    adapts = run.method.exponent != 0
    if passes(run) and adapts and (unsure(run) or free_until(run.watch, run.bend) < run.arrival):
        look_into(run)
    tiny = run.ailment == OK and run.step < TINY * run.shortest
    if (passes(run) or tiny) and run.kernels.events != 0:
        call(run.kernels.search, memory_of(run), run.room.sample)
    # The samples up to the end of the step, which an event may have brought forward.
    if passes(run):
        while (
            run.taken + run.wanted < run.asked and run.times[run.taken + run.wanted] <= run.arrival
        ):
            run.wanted += 1
        if run.wanted > 0:
            take_samples(run)


@njit(**INLINED)
def accept(run):
    """Go on to the end of the trial step."""
    room, method, scene, limits = run.room, run.method, run.scene, run.limits
    fixed = method.exponent == 0
    run.accepted += 1
    # The run is stiff where stability, not accuracy, has bounded most steps for long and very many
    # are to come.
    if limits.stability > 0:
        run.since = (run.since + 1) % LOOK
    if limits.stability > 0 and (run.votes > 0 or run.since == 0) and not run.halted:
        run.votes = max(0, run.votes + (1 if stiffness(run) > limits.stability else -1))
        if run.votes >= VOTES and run.course.stop - run.arrival > LOOK * run.step:
            run.status = STIFF
    # A slope is the next step's first unless the inputs may jump here.
    run.stale = fixed or run.arrival == run.target
    run.t, run.saved, run.arrived = run.arrival, run.row, True
    run.taken += run.wanted
    copy(room.new, room.y, room.n)
    copy(scene.g + run.ends * scene.count, scene.g, scene.count)
    run.loose = limits.closure_tol * settle(room.y, run.turns, room.nq)
    run.closure_error = max(run.closure_error, run.sampled)
    if run.lowest < run.pivot:
        run.pivot, run.pivot_time = run.lowest, run.lowest_time
    if not fixed:
        run.first_pivot = run.last_pivot
        copy(room.k + method.solution * room.width, room.k, room.n)
        run.rhythm = after_success(
            run.rhythm, run.step, run.error, method.exponent, limits.max_step
        )


@njit(**INLINED)
def refuse(run):
    """Try a shorter step next, or end the run where none can help."""
    exponent, bound = run.method.exponent, run.limits.pivot_bound
    run.rejected += 1
    if run.ailment == OK:
        run.cause = STEP_UNDERFLOW
        shrunk = run.step * max(SMALLEST_FACTOR, SAFETY / run.error**exponent)
        run.rhythm = after_failure(run.rhythm, max(run.least, shrunk))
    else:
        run.cause = run.ailment
        run.rejected_pivot, run.rejected_residual = run.lowest, run.residual
        run.rhythm = after_retreat(run.rhythm, run.step)
        at_bound = run.ailment == SINGULAR and run.first_pivot <= NEAR * bound
        if exponent == 0 or at_bound:
            run.status = run.ailment


@njit(**OPTIONS)
def end(run, memory, rows, y, facts):
    """Leave the last state in y and the `LoopOutcome` in facts; return the rows that were saved.

    A row is (t, y, u, residual, event), angles with their turns, with event = -1 where the row was
    asked for.
    """
    room, rhythm = run.room, run.rhythm
    if run.kernels.closure != 0 and run.accepted > 0:
        copy(room.y, room.sample, room.n)
        run.closure_error = max(run.closure_error, project(run, True, room.sample))
    counts = (
        run.status, run.evaluations, run.accepted, run.rejected, run.projections,
        run.fault, run.next_sample, run.since, run.votes,
    )  # fmt: skip
    numbers = (
        run.t, rhythm.step, rhythm.growth, rhythm.longest, rhythm.ideal,
        run.pivot, run.pivot_time, run.closure_error, run.rejected_pivot, run.rejected_residual,
    )  # fmt: skip
    for i, count in enumerate(counts):
        facts[i] = count
    for i, number in enumerate(numbers):
        facts[len(counts) + i] = number
    copy(room.y, pointer(y), room.n)
    saved = run.saved
    memory[0] = 0.0  # the memory of the run lives to its end
    return rows[:saved]
