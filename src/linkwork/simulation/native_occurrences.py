"""What a run keeps of a step, its events and samples, by dense output, projected: compiled parts of
the integrators' loop."""

import math
from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_events import (
    LOOKS,
    NEVER,
    ROOT,
    earliest,
    locate,
    look,
    quiet,
    state_within,
)
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    add_turns,
    copy,
    extend,
    force,
    project,
    record,
)
from linkwork.simulation.pointers import call


class EventPlaces(NamedTuple):
    """Where `count` event functions are looked at: their `conditions`, a row (direction, terminal)
    for each; `g`, a row for each of the places `thetas` and one more; `within`, their values at a
    place; `crossings`, where they change their signs.
    """

    conditions: Any
    count: int
    g: Any
    thetas: Any
    within: Any
    crossings: Any


class StepSpan(NamedTuple):
    """A step from `t` to `arrival`, of the length `step`, whose inputs begin in a `piece` of the
    signals."""

    t: float
    step: float
    arrival: float
    piece: int


class Kept(NamedTuple):
    """What was kept of a step: OK or why it may not be, and what is not finite; how many rows;
    whether the run ends within, and when; the residual at the end of the step, and the largest of
    the rows; the row of g there; the cost.
    """

    ailment: int
    fault: int
    rows: int
    halted: bool
    arrival: float
    residual: float
    largest: float
    ends: int
    evaluations: int
    projections: int


@njit(**OPTIONS)
def cross(kernels, inputs, method, limits, room, turns, scene, span, j):
    """Find where functions change their signs in interval j as their conditions ask; return how
    many do, and the calls made."""
    before, after, due, calls = scene.g + j * scene.count, scene.g + (j + 1) * scene.count, 0, 0
    for i in range(scene.count):
        rises, falls = before[i] < 0 <= after[i], before[i] > 0 >= after[i]
        scene.crossings[i] = NEVER
        if (rises and scene.conditions[2 * i] >= 0) or (falls and scene.conditions[2 * i] <= 0):
            scene.crossings[i], made = locate(
                kernels, inputs, method, limits, room, turns, span.t, span.step, span.piece, i,
                scene.thetas[j], before[i], scene.thetas[j + 1], after[i], scene.within,
            )  # fmt: skip
            due, calls = due + 1, calls + made
    return due, calls


@njit(**OPTIONS)
def record_events(kernels, inputs, method, limits, room, turns, scene, span, residual, due, rows):
    """Record the events due in an interval, in order, up to the one that ends the run and what
    happens at that instant."""
    t, step, arrival, piece = span
    ailment, count, halted, last, projections = OK, 0, False, NEVER, 0
    while ailment == OK and due > 0:
        first = earliest(scene.crossings, scene.count)
        theta = scene.crossings[first]
        if halted and theta - last > 4 * ROOT * max(1.0, abs(t / step)):
            break
        scene.crossings[first] = NEVER
        due -= 1
        time, remainder = arrival, residual
        if halted or theta == 1:
            copy(room.new, room.sample, room.n)
        else:
            time = t + theta * step
            remainder, calls = state_within(kernels, method, limits, room, theta, step)
            projections += calls
        if not remainder <= limits.closure_tol:
            ailment, residual = CLOSURE_LOST, remainder
        row = rows + count * (room.n + room.inputs + 3)
        record(row, time, room.sample, remainder, float(first), inputs, piece, room, turns)
        count += 1
        if scene.conditions[2 * first + 1] != 0 and not halted:
            halted, last, arrival, residual = True, theta, time, remainder
            copy(room.sample, room.new, room.n)
    return Kept(ailment, -1, count, halted, arrival, residual, residual, LOOKS, 0, projections)


@njit(**OPTIONS)
def happenings(kernels, inputs, method, limits, room, turns, scene, span, residual, pending, rows):
    """Record the events within a step, in the order of their times; where one ends the run, the
    step ends there.

    pending: how many stages the dense output still needs.
    """
    t, step, arrival, piece = span
    n, watched, g = room.n, scene.count, scene.g
    copy(room.new, room.x, n)
    add_turns(room.x, turns, room.nq)
    force(inputs, arrival, True, piece, room.x + n)
    call(kernels.events, room.x, g + LOOKS * watched)
    nothing = Kept(OK, -1, 0, False, arrival, residual, residual, LOOKS, 0, 0)
    if quiet(
        kernels, inputs, method, room, turns, t, step, piece, watched, g, g + LOOKS * watched, scene.within
    ):  # fmt: skip
        return nothing
    ailment = extend(kernels, inputs, method, limits, room, t, step, piece) if pending > 0 else OK
    if ailment != OK:
        return Kept(ailment, -1, 0, False, arrival, residual, residual, LOOKS, pending, 0)
    ends, projections = look(
        kernels, inputs, method, limits, room, turns, t, step, piece, watched, scene.thetas, g
    )  # fmt: skip
    for i in range(ends * watched):
        if math.isnan(g[watched + i]):
            fault = n + 1 + room.inputs - inputs.columns + i % watched
            return Kept(
                NON_FINITE, fault, 0, False, arrival, residual, residual, ends, pending, projections
            )
    count, found = 0, nothing
    for j in range(ends):
        if found.ailment == OK and not found.halted:
            due, calls = cross(kernels, inputs, method, limits, room, turns, scene, span, j)
            row = rows + count * (n + room.inputs + 3)
            found = record_events(
                kernels, inputs, method, limits, room, turns, scene, span, residual, due, row
            )  # fmt: skip
            count, projections = count + found.rows, projections + calls + found.projections
    return Kept(
        found.ailment, -1, count, found.halted and found.ailment == OK, found.arrival, found.residual, found.residual,
        ends, pending, projections,
    )  # fmt: skip


@njit(**OPTIONS)
def take_samples(
    kernels, inputs, method, limits, room, turns, span, residual, save_at, due, pending, rows
):
    """Record the samples that are due within a step; pending: how many stages the dense output
    still needs."""
    t, step, arrival, piece = span
    largest, ailment, evaluations, projections = residual, OK, 0, 0
    for i in range(due):
        time, remainder, calls = save_at[i], 0.0, 0
        if time == arrival:
            copy(room.new, room.sample, room.n)
            if kernels.closure != 0:
                remainder, calls = project(
                    kernels.closure, limits.closure_tol, True, room.sample, room
                )
        else:
            if evaluations < pending:
                evaluations, ailment = (
                    pending,
                    extend(kernels, inputs, method, limits, room, t, step, piece),
                )
            remainder, calls = state_within(kernels, method, limits, room, (time - t) / step, step)
        projections += calls
        if not remainder <= limits.closure_tol:
            ailment, residual = CLOSURE_LOST, remainder
        row = rows + i * (room.n + room.inputs + 3)
        record(row, time, room.sample, remainder, -1.0, inputs, piece, room, turns)
        largest = max(largest, remainder)
        if ailment != OK:
            break
    return Kept(
        ailment, -1, due, False, arrival, residual, largest, LOOKS, evaluations, projections
    )
