"""Step by step: the integrators' loop of `native_loop`, entered anew for each step and left at its
end, so that somebody else may act in between. Compiled parts.

A `Stepping` holds where the steps are, and points to a run, which is that of the integrators: what
happens within a step (charts that weaken, sampled controllers, stops and contacts, shorter steps by
the error) happens as in a run. Steps end at  origin + k step,  k = 1, 2, ...: times do not drift.

What the user sees of the state, y with the whole turns of its angles, is compared with the run's at
the start of a step, and what was written is taken over. Where q was, its loops are closed by moving
the dependent coordinates.
"""

import math
from typing import Any

from numba import njit
from numba.core.dispatcher import Dispatcher

from linkwork.simulation.compiled import INLINED, OPTIONS, compiled_once
from linkwork.simulation.native_loop import (
    SIGNATURE,
    attempting,
    begin,
    between,
)
from linkwork.simulation.native_memory import INTEGRATION, RunCourse, integration_at
from linkwork.simulation.native_parts import (
    OK,
    ROUNDING,
    acting_from,
    add_turns,
    copy,
    force,
    project,
    settle,
    whole,
)
from linkwork.simulation.pointers import POINTER, pointer
from linkwork.simulation.structures import Structure, at

PAUSED, UNDEFINED, OPEN, UNCOVERED, UNFORCED = -1, -2, -3, -4, -5
"""Why steps are left, beside a `Status`: it is to be looked whether pivots have recovered; what was
written is not finite, or does not close; a signal ends; forces are not finite."""
STOP = INTEGRATION.place("course") + RunCourse._fields.index("stop")


class Stepping:
    """Where the steps of a `run` are: after step `number` from the `origin` [s], each of them
    `step` [s] long, `left` ones to go; signals are known up to the time `last`, and the bound of
    the pivot is lowered up to `until`. `y`: the state as the user sees it; `u`: `forces` numbers
    that the user gives; `written`: whether q was, since the last step.
    """

    run: Any
    y: Any
    u: Any
    forces: int
    origin: float
    step: float
    last: float
    until: float
    number: int
    left: int
    written: int
    count: int
    code: int
    well: float


STEPPING = Structure(Stepping)
stepping_at = at(STEPPING)
SHAPE = POINTER, POINTER


def onward(advance: Dispatcher) -> Dispatcher:
    """Return the loop around a method's way to advance, up to where the run has to stop."""
    attempt = attempting(advance)

    @njit(**INLINED)
    def go(run):
        """Go on until the run stops; nothing is saved."""
        # Behind an event that ended a run the events are looked at anew.
        run.accepted, run.halted = 0 if run.halted else min(run.accepted, 1), 0
        run.rejected, run.arrived, run.status = 0, True, OK
        while run.arrived or run.status == OK:
            if run.arrived:
                run.saved = run.saved if run.halted else 0
                if not between(run):
                    break
            if not attempt(run):
                break

    return go


def taking(advance: Dispatcher) -> Dispatcher:
    """Return what takes steps by a method's way to advance."""
    go = onward(advance)

    @njit(**INLINED)
    def take(forces, cells):
        """Take as many steps as the cells tell under forces; return OK, or why not all of them
        could be taken."""
        own = stepping_at(cells)
        run, own.left = integration_at(own.run), own.count
        code = take_over(own, run)
        for i in range(own.forces):
            own.u[i] = forces[i]
            if not math.isfinite(own.u[i]):
                code = UNFORCED
        while code == OK and own.left > 0:
            goal = own.origin + (own.number + 1) * own.step
            if goal > own.last + ROUNDING * own.step:
                code = UNCOVERED
                break
            own.run[STOP] = landing(run.schedule, run.next_break, goal)
            go(run)
            code = run.status
            if code == OK:
                own.number, own.left, own.written = own.number + 1, own.left - 1, 0
                if run.t >= own.until:
                    code = PAUSED
        if code != UNDEFINED and code != OPEN:
            copy(run.room.y, own.y, run.room.n)
            add_turns(own.y, run.turns, run.room.nq)
        own.code, own.well = code, 1.0 if code == OK else 0.0
        return code

    return take


@njit(**INLINED)
def landing(schedule, i, goal):
    """Return where a step up to a time ends: at the break, from number i on, that it misses by
    rounding alone, as a run's."""
    while i < schedule.count and schedule.breaks[i] < goal - ROUNDING * schedule.length:
        i += 1
    return min(goal, schedule.breaks[i]) if schedule.length > 0 and i < schedule.count else goal


@njit(**OPTIONS)
def take_over(own, run):
    """Take over what was written to the state, all of it or nothing; return OK, or why not."""
    room, turns, y = run.room, run.turns, own.y
    n, nq, counted = room.n, room.nq, turns.counted
    # Most often it is nothing.
    written = closed = n
    for m in range(n - 1, -1, -1):
        if not math.isfinite(y[m]):
            return UNDEFINED
        told = whole(room.y[m], counted[m]) if m < nq and counted[m] != 0.0 else room.y[m]
        if y[m] != told:
            written = m
    if written == n:
        return OK
    # What was there, to go back to.
    copy(room.y, room.new, n)
    copy(counted, room.sample, nq)
    for m in range(n):
        told = whole(room.y[m], counted[m]) if m < nq and counted[m] != 0.0 else room.y[m]
        if y[m] != told:
            room.y[m] = y[m]
            if m < nq:
                counted[m], closed = 0.0, 0
    run.accepted, run.stale = 0, True
    if closed == 0:
        own.written = 1
        run.loose = run.limits.closure_tol * settle(room.y, turns, nq)
        if run.kernels.closure != 0 and not project(run, True, room.y) <= run.loose:
            copy(room.new, room.y, n)
            copy(room.sample, counted, nq)
            return OPEN
    return OK


@compiled_once("the start of steppers", SIGNATURE[:-1])
def prepare(
    kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y
):  # fmt: skip
    """Return the memory of a run at its start, with the inputs of its time, its table of rows, and
    its status; the arguments are those of `native_loop.begin`, and all of it is to be kept."""
    run, memory, rows = begin(
        kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y
    )
    run.rows = pointer(rows)
    force(run.inputs, acting_from(run, run.t), False, 0, run.room.x + run.room.n)
    return memory, rows, run.status
