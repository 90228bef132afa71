"""The samples within the accepted steps of the members in the lanes, by dense output.

Names as in `lanes`.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_inputs import set_forces
from linkwork.simulation.lane_steps import combine, project
from linkwork.simulation.lane_tables import (
    ACCEPTS,
    AILMENT,
    ARRIVAL,
    BOUND,
    CLOSURE_ERROR,
    EVALUATIONS,
    EXTENDED,
    LAST,
    LEAST,
    LOOSE,
    LOWEST,
    MEMBER,
    REACHED,
    REJECTED_PIVOT,
    REJECTED_RESIDUAL,
    RESIDUAL,
    STEP,
    STOP,
    THETA,
    TIME,
    UNSURE,
    WANTED,
)
from linkwork.simulation.native_parts import CLOSURE_LOST, NON_FINITE, SINGULAR, padded, whole
from linkwork.simulation.vectors import LANES, call_wide, load, splat, store


@njit(**INLINED)
def due(lane, save_at, now, tally):
    """Return when a lane has to take its next sample: by the end of its run, to rounding, or
    never."""
    row = tally[REACHED, lane]
    return min(save_at[row], now[STOP, lane]) if row < tally[LAST, lane] else math.inf


@njit(**INLINED)
def within(lane, save_at, now, tally):
    """Tell whether a lane wants a sample inside its step, not at the end of it."""
    return now[WANTED, lane] > 0 and due(lane, save_at, now, tally) < now[ARRIVAL, lane]


@njit(**INLINED)
def extends(lane, save_at, now, tally):
    """Tell whether a lane needs the dense output: for a sample inside its step, or to look at what
    it may not have seen."""
    looks = now[LEAST, lane] > 0 or now[UNSURE, lane] > 0
    return (looks and now[ACCEPTS, lane] > 0) or within(lane, save_at, now, tally)


@njit(**INLINED)
def want_samples(save_at, now, tally):
    """Mark the lanes with a sample to take in their accepted steps, and where; return how many, and
    how many within."""
    wanted, inside = 0, 0
    for lane in range(LANES):
        time = due(lane, save_at, now, tally)
        wants = now[ACCEPTS, lane] > 0 and time <= now[ARRIVAL, lane]
        now[WANTED, lane] = 1.0 if wants else 0.0
        now[THETA, lane] = (time - now[TIME, lane]) / now[STEP, lane] if wants else 1.0
        wanted += wants
        inside += within(lane, save_at, now, tally)
    return wanted, inside


@njit(**OPTIONS)
def extend(motion, method, signals, save_at, tables):
    """Evaluate the stages that only the dense output needs; refuse the steps of lanes that need it
    in which they fail.

    x is left as it was: the new state, under the inputs at its end.
    """
    n, y, x, k, sample, now, tally = (
        tables.n, tables.y, tables.x, tables.k, tables.sample, tables.now, tables.tally
    )  # fmt: skip
    for m in range(n):
        store(sample, m, load(x, m))
    for lane in range(LANES):
        if extends(lane, save_at, now, tally):
            tally[EVALUATIONS, lane] += method.stages - method.computed
            tally[EXTENDED, lane] = 1
    for i in range(method.computed, method.stages):
        combine(method.a + i * method.stages, i, n, now, y, k, x)
        if signals.timed:
            set_forces(signals, method.c[i], x, n, now, tally)
        call_wide(motion, x, k, i * (n + 1))
        for lane in range(LANES):
            pivot, extended = k[i * (n + 1) + n, lane], tally[EXTENDED, lane] > 0
            if extended and now[ACCEPTS, lane] > 0 and not pivot >= now[BOUND, lane]:
                now[ACCEPTS, lane], now[WANTED, lane] = 0.0, 0.0
                tally[AILMENT, lane] = NON_FINITE if math.isnan(pivot) else SINGULAR
                now[REJECTED_PIVOT, lane] = now[LOWEST, lane]
    for m in range(n):
        store(x, m, load(sample, m))
    if signals.timed:
        set_forces(signals, method.c[method.solution], x, n, now, tally)


@njit(**INLINED)
def keep_sample(i, row, lane, state, samples, tables):
    """Write a lane's state, angles with their whole turns, as a sample of member i."""
    for m in range(tables.nq):
        turns = tables.turned[m, lane]
        samples[i, row, m] = whole(state[m, lane], turns) if turns != 0.0 else state[m, lane]
    for m in range(tables.nq, tables.n):
        samples[i, row, m] = state[m, lane]


@njit(**INLINED)
def interpolate(method, tables, state):
    """Leave the states of all lanes at the times t + theta h, with each lane's theta, in a
    table."""
    weigh_stages(method, False, tables)
    for m in range(tables.n):
        change = load(tables.now, STEP) * weighed(method.stages, m, tables)
        store(state, m, load(tables.y, m) + change)


@njit(**OPTIONS)
def weigh_stages(method, slope, tables):
    """Leave the weights of all stages in the dense output at each lane's theta, b_i, or in its
    slope, d b_i / d theta, in a table."""
    weights, theta, stages = tables.weights, load(tables.now, THETA), method.stages
    power = splat(1.0) if slope else theta
    for i in range(stages):
        store(weights, i, splat(0.0))
    for m in range(method.degree):
        share = splat(m + 1.0 if slope else 1.0) * power
        for i in range(stages):
            weight = splat(method.dense[m * padded(stages) + i])
            store(weights, i, load(weights, i) + share * weight)
        power = power * theta


@njit(**INLINED)
def weighed(stages, m, tables):
    """Return the sum of number m of all stages, each times its weight."""
    total = splat(0.0)
    for i in range(stages):
        total = total + load(tables.weights, i) * load(tables.k, i * (tables.n + 1) + m)
    return total


@njit(**INLINED)
def take_samples(closure, method, closure_tol, save_at, samples, tables):
    """Take the samples within the accepted steps by dense output, projected; a step with one that
    cannot be is refused."""
    n, x, sample, now, tally = tables.n, tables.x, tables.sample, tables.now, tables.tally
    while want_samples(save_at, now, tally)[0] > 0:
        interpolate(method, tables, sample)
        for lane in range(LANES):
            now[RESIDUAL, lane] = 0.0
            if now[WANTED, lane] > 0 and due(lane, save_at, now, tally) == now[ARRIVAL, lane]:
                for m in range(n):
                    sample[m, lane] = x[m, lane]
        if closure != 0:
            project(closure, tables.nq, sample, tables.z, tables.z_next, now, closure_tol, math.inf)
        for lane in range(LANES):
            if now[WANTED, lane] > 0:
                if now[RESIDUAL, lane] <= closure_tol * now[LOOSE, lane]:
                    keep_sample(
                        tally[MEMBER, lane], tally[REACHED, lane], lane, sample, samples, tables
                    )
                    tally[REACHED, lane] += 1
                    now[CLOSURE_ERROR, lane] = max(now[CLOSURE_ERROR, lane], now[RESIDUAL, lane])
                else:
                    now[ACCEPTS, lane], tally[AILMENT, lane] = 0.0, CLOSURE_LOST
                    now[REJECTED_RESIDUAL, lane], now[REJECTED_PIVOT, lane] = (
                        now[RESIDUAL, lane],
                        now[LOWEST, lane],
                    )
