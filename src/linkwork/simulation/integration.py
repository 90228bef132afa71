"""Integrate the equations of motion: check what is asked, and run the compiled loop once."""

import math
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.simulation.admission import (
    listed,
    numbers_of,
    refuse_start,
    require_positive,
    require_run,
    times_within,
    tolerances,
)
from linkwork.simulation.events import ENDS, Control, Events, Pace, Watch
from linkwork.simulation.methods import Method
from linkwork.simulation.signals import ROUNDING, Sampled, Signal, as_signal
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import DORMAND_PRINCE
from linkwork.simulation.trajectory import Trajectory
from linkwork.simulation.turns import Turning

NO_CONDITIONS = np.empty((0, 2))
NOTHING = np.empty(0)
GUESSED = Pace(0.0, math.inf)  # the first step is guessed, and may grow at once
NEARLY = 0.25
"""Of the interval of stability: steps that the tolerance bounds stay below a fifth of it."""


def integrate(
    motion: int,
    closure: int | None,
    q: ArrayLike,
    v: ArrayLike,
    forces: Signal | Sampled | ArrayLike,
    parameters: ArrayLike = NOTHING,
    *,
    duration: float,
    start: float = 0.0,
    rtol: ArrayLike = 1e-8,
    atol: ArrayLike = 1e-10,
    save_at: ArrayLike | None = None,
    max_step: float = math.inf,
    first_step: float | Pace | None = None,
    max_steps: int = 1_000_000,
    pivot_bound: float = 1e-4,
    closure_tol: float = 1e-13,
    method: Method = DORMAND_PRINCE,
    jacobian: int | None = None,
    events: Events | None = None,
    control: Control | None = None,
    leave_stiff: bool = False,
    turning: Turning | None = None,
    turns: ArrayLike | None = None,
    watch: Watch | None = None,
    redundant: bool = False,
) -> Trajectory:
    """Integrate (q', v') = f(q, v, u(t), p) over time with q kept on phi(q) = 0.

    Arguments:
        motion: address of the kernel (q, v, u, p) -> (q', v', pivot), a C function void(const
            double *, double *).
        closure: address of the kernel (q, p) -> (q after one Newton step on phi = 0, max |phi(q)|);
            None or 0 if q has nothing to keep to.
        q, v: coordinates (nq,) and independent rates (nv,) at the start; q is closed first. What
            else is a state, of drives and controllers, follows the rates in v.
        forces: the inputs u (nu,) over time: numbers, `Sampled`, or a `Signal`; with a `control`,
            the inputs that it does not hold. nu and np are those of the kernels.
        parameters: p (np,), constant over the run.
        duration, start: s; the run goes from `start` >= 0 to `start + duration`.
        rtol, atol: a step's error in each component of (q, v) is held to atol + rtol |y| in the
            root mean square; one number, or one for each component; positive.
        save_at: increasing times (K,), s, at which to save, by dense output; None saves every step.
        max_step, first_step: s, not for methods of a fixed step; the first step is guessed where it
            is None. The `pace` of a run that stopped at max_steps, with its last state, time and
            control, continues it bit for bit.
        max_steps: accepted and rejected steps together.
        pivot_bound: the run stops as SINGULAR where the kernel's pivot falls below it
            (within a quarter of it). The errors of v enter the dependent rates multiplied by about
            1 / pivot, so that below 1e-4 a run at rtol = 1e-8 is worth four digits, and steps begin
            to reach across the singular pose unseen.
        closure_tol: the largest |phi| left after a projection, in the units of phi; it is to be
            above rounding, which is about 1e-16 times the largest length.
        method: an embedded Runge-Kutta pair (DORMAND_PRINCE, DOP853 for tight tolerances), RODAS
            for stiff systems, or a fixed step for real time, RK4(step) or SymplecticEuler(step),
            which takes no notice of rtol and atol.
        jacobian: address of the kernel (y, u, p) -> (df/dy (n n), df/du (n nu)), both column by
            column; RODAS needs it.
        events: functions of (y, u, p) whose zeros are located, and may end the run. control: a
            sampled controller.
        leave_stiff: end the run as STIFF where stability bounds the steps of an embedded pair and
            very many are to come.
        turning: how large coordinates may grow; turns (nq,): the whole turns of angles that are not
            in q.
        watch: signals of which no step passes over what its stages have not seen; None: the forces.
            Fixed steps do.
        redundant: whether phi has rows that depend on others, which Newton's steps leave out: the
            end of every step is measured then.

    Returns the `Trajectory`, whatever way the run ended: see its `status` and `message`.

    Raises `LinkworkError` for arguments that make no run: shapes, numbers that are not finite, a
    duration that is not positive, times to save outside the run, samples that do not cover the run.
    """
    # What may not be: runs without an end, numbers that are none, methods without what they need.
    require_run(duration, max_steps)
    signal = as_signal(forces)
    q, v = listed("q", q), listed("v", v)
    p = NOTHING if parameters is NOTHING else numbers_of("the parameters", parameters)
    require_positive("max_step", max_step)
    require_positive("pivot_bound", pivot_bound)
    require_positive("closure_tol", closure_tol)
    if method.stiff and not jacobian:
        raise LinkworkError(f"{method.name} needs the address of the Jacobian's kernel")
    y = np.concatenate((q, v))
    if not y.size:
        raise LinkworkError("there is nothing to integrate: q and v are both empty")
    # What does not change on the way, and the run itself.
    problem = Problem(
        motion,
        closure or 0,
        jacobian or 0,
        p,
        signal,
        watch,
        events,
        method,
        tolerances(rtol, atol, y.size),
        max_step,
        max_steps,
        closure_tol,
        leave_stiff,
        turning or Turning.none(q.size),
        redundant,
    )
    stop, going_on = start + duration, (first_step, control, turns)
    span = TimeSpan(q.size, start, stop, pivot_bound, max_steps, save_at, *going_on)
    return advanced(problem, y, span)


class Problem(NamedTuple):
    """Hold what does not change along a run in one chart: the numbers and objects that `integrate`
    takes, checked.

    closure, jacobian: addresses, 0 where there is none; tolerances (2, n): rtol and atol of each
    component of (q, v)
    """

    motion: int
    closure: int
    jacobian: int
    parameters: np.ndarray
    forces: Signal
    watch: Watch | None
    events: Events | None
    method: Method
    tolerances: np.ndarray
    max_step: float
    max_steps: int
    closure_tol: float
    leave_stiff: bool
    turning: Turning
    redundant: bool


class TimeSpan(NamedTuple):
    """Hold over which span of time a problem is integrated, and from what, as `integrate` takes
    it.

    start, stop: [s]; nq: how many of the state's numbers are coordinates; steps: at most
    """

    nq: int
    start: float
    stop: float
    pivot_bound: float
    steps: int
    save_at: ArrayLike | None
    first_step: float | Pace | None = None
    control: Control | None = None
    turns: ArrayLike | None = None


def advanced(problem: Problem, y: np.ndarray, span: TimeSpan) -> Trajectory:
    """Integrate a problem from the state y (q, v), as `integrate` does; y holds the last state
    then."""
    method, turning, closure_tol = problem.method, problem.turning, problem.closure_tol
    nq, control = span.nq, span.control
    native, loop = _compiled(method.stiff)
    given = entry(problem, y, span)
    conditions, counted, state = given[4], given[9], given[10]
    facts = np.empty(len(loop.LoopOutcome._fields))
    rows = native.integrate(*given, facts)
    outcome, found, event = loop.LoopOutcome._make(facts.tolist()), rows[:0], -1
    if len(conditions):
        happened = rows[:, -1] >= 0
        found, rows = rows[happened], rows[~happened]
        event = next((int(i) for i in found[:, -1] if conditions[int(i), 1] == ENDS), -1)
    if control is not None:
        y[:], held = state[: y.size], state[y.size :]
        control = replace(control, held=held, next_sample=int(outcome.next_sample))
    status = Status(outcome.status)
    if status is Status.CLOSURE_LOST:
        closure_tol *= turning.looser(y[:nq])
    bounds = {
        "pivot_bound": span.pivot_bound,
        "closure_tol": closure_tol,
        "max_steps": problem.max_steps,
        "event": event,
    }
    if method.stiff:
        bounds["remedy"] = "or look for what acts too suddenly"
    return Trajectory(rows, found, y, counted[2], nq, outcome, control, bounds, status)


def entry(problem: Problem, y: np.ndarray, span: TimeSpan) -> tuple[Any, ...]:
    """Return the arguments of `native_loop.begin`, as `advanced` takes its own; what is to be kept
    alive is among them."""
    nq, start, stop, pivot_bound, steps, save_at, first_step, control, turns = span
    signal, method = problem.forces, problem.method
    known = 0 <= start < math.inf and signal.covers(start, stop)
    if not (known and all(map(math.isfinite, y.tolist()))):
        refuse_start(y, nq, signal, start, stop)
    counted = problem.turning.table.copy()
    if turns is not None:
        counted[2] = turns
    times = NOTHING if save_at is None else times_within(save_at, start, stop)
    pace = _pace(first_step if method.step is None else method.step)
    held, period, next_sample, acts = _sampling(control, start)
    events, watch = problem.events, problem.watch
    conditions = events.table if events else NO_CONDITIONS
    observed = events.address if len(conditions) and events else 0
    search = search_for_events() if observed else 0
    seen, strict = (watch.signal, watch.strict) if watch else (signal, 0)
    state = np.concatenate((y, held)) if control else y
    # Plain tuples of numbers, in the order of `Kernels` and `RunCourse`.
    return (
        (problem.motion, problem.closure, problem.jacobian, observed, acts, search),
        problem.parameters, method.plan.table, problem.tolerances, conditions,
        signal.table, seen.table,
        (
            float(start), float(stop), period,
            float(pace.step), float(pace.growth), float(pace.longest), float(pace.ideal),
            float(pivot_bound), float(problem.closure_tol),
            float(stability(method, problem.leave_stiff)), float(problem.max_step), int(steps),
            next_sample, int(save_at is None), strict,
            int(pace.since), int(pace.votes), int(problem.redundant),
        ),
        times, counted, state,
    )  # fmt: skip


@cache
def _compiled(stiff: bool) -> tuple[Any, Any]:
    """Return the module of a method's compiled loop, and that of what all loops share; importing
    them compiles them."""
    from linkwork.simulation import native_loop

    if stiff:
        from linkwork.simulation import native_rosenbrock as native
    else:
        from linkwork.simulation import native
    return native, native_loop


def search_for_events() -> int:
    """Return the address of the compiled search for events within a step, which the loops call;
    it is loaded, or compiled, when first asked for."""
    from linkwork.simulation import native_search

    return native_search.ADDRESS


def stability(method: Method, asked: bool) -> float:
    """Return h |lambda| at which stability bounds the steps of an embedded pair, 0 where that is
    not asked for."""
    return NEARLY * method.stability if asked else 0.0


def _pace(first_step: float | Pace | None) -> Pace:
    """Return the pace at the start: a step of 0 is guessed, and the first may grow at once."""
    if isinstance(first_step, Pace):
        return first_step
    if first_step is None:
        return GUESSED
    require_positive("first_step", first_step)
    return Pace(first_step, math.inf)


def _sampling(control: Control | None, start: float) -> tuple[np.ndarray, float, int, int]:
    """Return the held inputs, the period, the index of the first sample, and the address of the
    controller's kernel."""
    if control is None:
        return NOTHING, 0.0, 0, 0
    first, held = control.next_sample, numbers_of("the held inputs", control.held)
    if first is None:
        first = math.ceil(start / control.period - ROUNDING)
    return held, float(control.period), first, control.address
