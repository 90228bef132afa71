"""What a run of the integrators' loop holds in memory, and where it computes."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_between import Schedule
from linkwork.simulation.native_events import MOST
from linkwork.simulation.native_occurrences import EventPlaces
from linkwork.simulation.native_pace import Rhythm
from linkwork.simulation.native_parts import (
    Inputs,
    Kernels,
    Method,
    Room,
    StepLimits,
    Turns,
    padded,
)
from linkwork.simulation.native_watch import WatchedSignals
from linkwork.simulation.structures import Structure, at


class RunCourse(NamedTuple):
    """Say where a run goes: from `start` to `stop`, with a controller that acts each `period` (0:
    there is none), for the first time as its sample `next_sample`; in at most `max_steps`, of which
    the first and how it grows are those of a `Rhythm`, a `step` of 0 being guessed, and the others
    are as in `StepLimits`; whether `every_step` is saved, and how `strict` its signals are watched;
    how many steps it is `since` stiffness was due to be looked for, and the `votes` for it; whether
    `redundant` rows of phi ask that the end of every step is measured.
    """

    start: float
    stop: float
    period: float
    step: float
    growth: float
    longest: float
    ideal: float
    pivot_bound: float
    closure_tol: float
    stability: float
    max_step: float
    max_steps: int
    next_sample: int
    every_step: int
    strict: int
    since: int
    votes: int
    redundant: int


class Integration:
    """All that a run holds.

    Above, what stays as it is. Then where the run is: `t`, with the slope k_0 `stale` where the
    inputs may have jumped, in a `piece` of the signals; the `target` at which the next step ends at
    the latest, the numbers of the next break, multiple of the fixed length, sample and bend;
    `loose`, the closure's tolerance at the present size of q. The trial: a `step` to its `arrival`;
    what ails it, its `error`, its smallest pivot, its last one, the `residual` at its end, how many
    stages are `pending` for its dense output, how short it may `least` be tried again; what is
    recorded of it, up to `row`, with the largest residual `sampled`, of which so many are `wanted`
    samples; whether an event `halted` it, and in which row of g it `ends`. What has come of the
    run: counts and numbers of the `LoopOutcome`, and `cause`, why a step was last refused. The
    table of `rows`, `columns` wide, has `saved` ones, `taken` of them at the `times` asked for.
    """

    kernels: Kernels
    inputs: Inputs
    method: Method
    limits: StepLimits
    turns: Turns
    room: Room
    scene: EventPlaces
    watch: WatchedSignals
    schedule: Schedule
    course: RunCourse
    held: Any
    times: Any
    asked: int
    shortest: float

    t: float
    arrived: int
    stale: int
    piece: int
    rhythm: Rhythm
    target: float
    next_break: int
    grid: int
    next_sample: int
    bend: int
    loose: float

    step: float
    arrival: float
    ailment: int
    error: float
    lowest: float
    lowest_time: float
    last_pivot: float
    residual: float
    pending: int
    least: float
    row: int
    wanted: int
    sampled: float
    halted: int
    ends: int

    status: int
    cause: int
    fault: int
    since: int
    votes: int
    evaluations: int
    accepted: int
    rejected: int
    projections: int
    pivot: float
    pivot_time: float
    first_pivot: float
    closure_error: float
    rejected_pivot: float
    rejected_residual: float

    rows: Any
    columns: int
    saved: int
    taken: int


INTEGRATION = Structure(Integration)
WORDS = INTEGRATION.words
integration_at = at(INTEGRATION)


@njit(**OPTIONS)
def memory_for(n, nq, parameters, inputs, events, method, stiff):
    """Return zeros for an `Integration`, and behind it for all that `furnish` deals out."""
    stages, width = method.stages, padded(n + 1)
    states, places, ends = (
        (4 + stages) * width,
        (MOST + 4) * (events + 1),
        max(width, padded(stages)),
    )
    size = (
        states + places + n + inputs + 2 * parameters + 2 * nq + 1 + method.degree + stages + ends
    )
    return np.zeros(padded(WORDS) + size + (n * (2 * n + inputs + 2) if stiff else 0))


@njit(**OPTIONS)
def furnish(memory, n, nq, parameters, inputs, conditions, events, method):
    """Return where a run computes, and where its events are looked at, in the memory from a place
    on."""
    y, width, stages = memory + padded(WORDS), padded(n + 1), method.stages
    k = y + 3 * width
    g = k + (stages + 1) * width
    within, crossings = g + (MOST + 2) * events, g + (MOST + 3) * events
    thetas, x = g + (MOST + 4) * events, g + (MOST + 4) * (events + 1)
    z = x + n + inputs + parameters
    z_next = z + nq + parameters
    powers = z_next + nq + 1
    weights = powers + method.degree
    zeros = weights + stages
    work = zeros + max(width, padded(stages))
    new, sample = y + width, y + 2 * width
    room = Room(
        y, new, sample, k, x, z, z_next, powers, weights, zeros, work, n, nq, width, inputs
    )  # fmt: skip
    return room, EventPlaces(conditions, events, g, thetas, within, crossings)
