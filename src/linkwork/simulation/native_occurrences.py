"""What a run keeps of a step, its events and samples, by dense output, projected: compiled parts of
the integrators' loop."""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.events import BORNE, CUTS, ENDS, MEETS
from linkwork.simulation.native_events import (
    LOOKS,
    NEVER,
    ROOT,
    TINY,
    earliest,
    locate,
    look,
    observe,
    quiet,
    state_within,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    REFUSED,
    SINGULAR,
    copy,
    extend,
    project,
    record,
)
from linkwork.simulation.native_watch import KEEN, defect_within

CLOSE = 2.0**-40
"""How near to an event a step ends at it, relative to the time and to the step."""

BEYOND = 4.0  # of the shortest step of a run: an event within that of a step's start is passed
FAINT = 1e-3  # of what a function comes to within a step, below which it is zero at its start


class EventPlaces(NamedTuple):
    """Where `count` event functions are looked at: their `conditions`, a row (direction, what it
    does) for each; `g`, a row for each of the places `thetas` and one more; `within`, their values
    at a place; `crossings`, where they change their signs.
    """

    conditions: Any
    count: int
    g: Any
    thetas: Any
    within: Any
    crossings: Any


@njit(**OPTIONS)
def cross(run, j):
    """Find where functions change their signs in interval j as their conditions ask; return how
    many do."""
    scene, due = run.scene, 0
    thetas, crossings, conditions = scene.thetas, scene.crossings, scene.conditions
    before, after = scene.g + j * scene.count, scene.g + (j + 1) * scene.count
    for i in range(scene.count):
        rises, falls = before[i] < 0 <= after[i], before[i] > 0 >= after[i]
        crossings[i] = NEVER
        if (rises and conditions[2 * i] >= 0) or (falls and conditions[2 * i] <= 0):
            crossings[i] = locate(run, i, thetas[j], before[i], thetas[j + 1], after[i])
            due += 1
    return due


@njit(**OPTIONS)
def record_events(run, due):
    """Record the events due in an interval, in order, up to the one that ends the run: the step
    ends there."""
    room, scene, crossings = run.room, run.scene, run.scene.crossings
    halted, last = False, NEVER
    while run.ailment == OK and due > 0:
        first = earliest(crossings, scene.count)
        theta = crossings[first]
        if halted and theta - last > 4 * ROOT * max(1.0, abs(run.t / run.step)):
            break
        crossings[first] = NEVER
        due -= 1
        # The state at the event, which is that at the end of the step for all of the instant that
        # ends the run.
        time, residual = run.arrival, run.residual
        if halted or theta == 1:
            copy(room.new, room.sample, room.n)
        else:
            time = run.t + theta * run.step
            residual = state_within(run, theta)
        if not residual <= run.loose:
            run.ailment, run.residual = CLOSURE_LOST, residual
        record(run, time, room.sample, residual, float(first))
        if scene.conditions[2 * first + 1] == ENDS and not halted:
            halted, last, run.arrival, run.residual = True, theta, time, residual
            copy(room.sample, room.new, room.n)
    return halted


@njit(**INLINED)
def touches(run, i):
    """Tell whether function i, of parts that meet, is as good as zero at the start of a step,
    beside what it comes to within it: its sign there is a matter of rounding, as of parts that are
    laid on each other."""
    scene, most = run.scene, 0.0
    for j in range(1, run.ends + 1):
        most = max(most, abs(scene.g[j * scene.count + i]))
    return scene.conditions[2 * i + 1] == MEETS and abs(scene.g[i]) <= FAINT * most


@njit(**OPTIONS)
def cut(run):
    """Refuse a step past an event at which steps end, and aim at the first; tell whether it is
    refused.

    Behind the event the dense output is no guide. So steps are tried that end nearer and nearer to
    it, until what is left is CLOSE to rounding: then the event lies at the end of the step. One
    that no step is short enough to end at is passed. So is the first of parts that touch, which
    k_0 has not felt: there the dense output is held against the equations.
    """
    scene, close = run.scene, CLOSE * max(1.0, abs(run.t / run.step))
    reached, laid = max(close, BEYOND * run.shortest / run.step), False
    for j in range(run.ends):
        if cross(run, j) > 0:
            first = NEVER
            for i in range(scene.count):
                if scene.conditions[2 * i + 1] >= CUTS and scene.crossings[i] > reached:
                    if j == 0 and touches(run, i):
                        laid |= scene.crossings[i] != NEVER
                    else:
                        first = min(first, scene.crossings[i])
            if first != NEVER:
                if first >= 1 - close:
                    return False
                run.error, run.least = REFUSED, first * run.step
                run.target = run.t + run.least
                return True
    if laid:
        defect, run.ailment = defect_within(run, 0.5)
        run.error = max(run.error, KEEN * defect)
    return run.ailment != OK or run.error > 1


@njit(**INLINED)
def steps_alone(scene):
    """Tell whether nothing but steps may end at the events."""
    alone = True
    for i in range(scene.count):
        alone &= scene.conditions[2 * i + 1] >= CUTS
    return alone


@njit(**INLINED)
def straddles(run):
    """Tell whether an event at which steps end lies between the ends of a step."""
    scene, across = run.scene, False
    for i in range(scene.count):
        signs = scene.g[i] < 0, scene.g[LOOKS * scene.count + i] < 0
        across |= scene.conditions[2 * i + 1] >= CUTS and signs[0] != signs[1]
    return across


@njit(**OPTIONS)
def take_events(run):
    """Record the events within a step, in the order of their times; where one ends the run, the
    step ends there.

    A step of fixed length is what it is whether it is watched or not: a weak pivot at its end, and
    accelerations that are undefined there, with what bearings carry, are a matter of the next one.
    One of which hardly a shorter one can be told from none comes here whatever its error: over an
    event at which steps end what acts may jump, as bristles of parts that meet, and it is taken.
    """
    room, scene, fixed = run.room, run.scene, run.method.exponent == 0
    watched, g = scene.count, scene.g
    run.halted, run.ends = False, LOOKS
    observe(run, run.arrival, room.new, g + LOOKS * watched)
    if not fixed and run.step < TINY * run.shortest and straddles(run):
        run.error, run.target = 0.0, run.arrival  # behind it the slope is evaluated anew
    if run.error > 1 and not fixed:
        return
    if quiet(run):
        return
    # The dense output, by which the event functions are looked at.
    run.ailment = extend(run)
    defined = run.ailment == OK or run.ailment == SINGULAR
    if fixed and (defined or steps_alone(scene)):
        run.ailment = OK
    if run.ailment != OK or not defined:
        return
    run.ends = look(run)
    for i in range(run.ends * watched):
        borne = fixed and scene.conditions[2 * (i % watched) + 1] == BORNE
        if math.isnan(g[watched + i]) and not borne:
            run.ailment = NON_FINITE
            run.fault = room.n + 1 + room.inputs - run.inputs.columns + i % watched
            return
    # Where steps are to end, and what is recorded of the one that stays.
    if not fixed and cut(run):
        return
    halted = False
    for j in range(run.ends):
        if run.ailment == OK and not halted:
            halted = record_events(run, cross(run, j))
    run.halted, run.sampled = halted and run.ailment == OK, run.residual


@njit(**OPTIONS)
def take_samples(run):
    """Record the samples that are wanted within a step."""
    room = run.room
    for i in range(run.taken, run.taken + run.wanted):
        time, residual = run.times[i], 0.0
        if time == run.arrival:
            copy(room.new, room.sample, room.n)
            if run.kernels.closure != 0:
                residual = project(run, True, room.sample)
        else:
            run.ailment = extend(run)
            residual = state_within(run, (time - run.t) / run.step)
        if not residual <= run.loose:
            run.ailment, run.residual = CLOSURE_LOST, residual
        record(run, time, room.sample, residual, -1.0)
        run.sampled = max(run.sampled, residual)
        if run.ailment != OK:
            break
