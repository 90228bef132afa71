"""One step of many members at a time by an explicit pair: vector arithmetic, each lane a member
with its own step.

The arithmetic is that of `native` and `native_loop` in the same order, lane by lane. Tables: `y`
(n rows), `x`, rows (y, u, p), `k`, rows (y', pivot) stage after stage, `z`, rows (q, p), and `now`,
numbers of the members in the lanes, whose rows `lane_tables` names.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED
from linkwork.simulation.lane_tables import (
    ACCEPTS,
    ARRIVAL,
    BOUND,
    ERROR,
    GROWTH,
    IDEAL,
    LIVE,
    LONGEST,
    LOOSE,
    LOWEST,
    PIVOT,
    RESIDUAL,
    STEP,
    STEP_SIZE,
    TARGET,
    TIME,
    WANTED,
)
from linkwork.simulation.native_loop import ROUNDING
from linkwork.simulation.native_pace import (
    FADING,
    LARGEST_FACTOR,
    LEAP,
    SAFETY,
    SMALLEST_ERROR,
    SMALLEST_FACTOR,
    WARY,
)
from linkwork.simulation.native_parts import NEWTON_CALLS
from linkwork.simulation.vectors import (
    absolute,
    call_wide,
    choose,
    every,
    larger,
    load,
    root,
    smaller,
    some,
    splat,
    store,
)


@njit(**INLINED)
def move(source, row, target, count, kept):
    """Copy rows, from `row` on, to the head of the target, but for the lanes that are to be kept:
    seldom there are any.

    A choice for every lane would cost more, for it becomes a masked store, at which some processors
    are slow.
    """
    if some(kept):
        for m in range(count):
            store(target, m, choose(kept, load(target, m), load(source, row + m)))
    else:
        for m in range(count):
            store(target, m, load(source, row + m))


@njit(**INLINED)
def project(closure, nq, state, z, z_next, now, tolerance, reserve):
    """Project q, the head of the state, onto phi(q) = 0 by Newton's method in z, in the lanes where
    now[WANTED] > 0.

    As in `native_parts`: a lane's q is written only when its residual, left in now[RESIDUAL], is
    within the tolerance, times now[LOOSE];
    z is left with what was added to q. A step d with reserve d^2 <= tolerance is the last, its
    residual taken for 0 (if the residual before it is as small).
    """
    limit, residual = splat(tolerance) * load(now, LOOSE), splat(math.inf)
    done = load(now, WANTED) <= splat(0.0)
    for m in range(nq):
        store(z, m, load(state, m))
    for _ in range(NEWTON_CALLS):
        call_wide(closure, z, z_next, 0)
        residual = choose(done, residual, load(z_next, nq))
        done = done | (residual <= limit)
        if every(done):
            break
        longest = load(z_next, nq)
        for m in range(nq):
            longest = larger(absolute(load(z_next, m) - load(z, m)), longest)
        move(z_next, 0, z, nq, done)
        close = splat(reserve) * longest * longest <= limit
        residual = choose(done, residual, choose(close, splat(0.0), residual))
        done = done | close
        if every(done):
            break
    if not every(done):
        move(state, 0, z, nq, done)
    for m in range(nq):
        before, after = load(state, m), load(z, m)
        store(state, m, after)
        store(z, m, after - before)
    store(now, RESIDUAL, residual)


@njit(**INLINED)
def scaled(values, row, n, y, tolerance):
    """Return the root mean square of values / (atol + rtol |y|), the values from a row on."""
    total = splat(0.0)
    for m in range(n):
        ratio = load(values, row + m) / (
            load(tolerance, n + m) + load(tolerance, m) * absolute(load(y, m))
        )
        total = total + ratio * ratio
    return root(total / splat(float(n)))


@njit(**INLINED)
def choose_steps(now):
    """Let the steps land on their targets, or go half of the way rather than leave slivers; idle
    lanes stay."""
    t, h, target = load(now, TIME), load(now, STEP_SIZE), load(now, TARGET)
    gap = target - t
    half = gap * splat(0.5)
    lands = h * splat(1 + ROUNDING) >= gap
    step = choose(lands, gap, smaller(h, half))
    store(now, STEP, choose(load(now, LIVE) >= splat(1.0), step, splat(0.0)))
    store(now, ARRIVAL, choose(lands, target, t + step))


@njit(**INLINED)
def combine(weights, count, n, now, y, k, x):
    """x = y + h sum_(j < count) weights_j k_j, with the step h of each lane.

    Five components at a time stay in registers; the last five overlap those before, rather than go
    one by one.
    """
    h = load(now, STEP)
    for block in range(0, n if n >= 5 else 0, 5):
        m = min(block, n - 5)
        first = second = third = fourth = fifth = splat(0.0)
        for j in range(count):
            if weights[j] != 0.0:
                weight, row = splat(weights[j]), j * (n + 1) + m
                first = first + weight * load(k, row)
                second = second + weight * load(k, row + 1)
                third = third + weight * load(k, row + 2)
                fourth = fourth + weight * load(k, row + 3)
                fifth = fifth + weight * load(k, row + 4)
        store(x, m, load(y, m) + h * first)
        store(x, m + 1, load(y, m + 1) + h * second)
        store(x, m + 2, load(y, m + 2) + h * third)
        store(x, m + 3, load(y, m + 3) + h * fourth)
        store(x, m + 4, load(y, m + 4) + h * fifth)
    for m in range(n if n < 5 else 0):
        total = splat(0.0)
        for j in range(count):
            total = total + splat(weights[j]) * load(k, j * (n + 1) + m)
        store(x, m, load(y, m) + h * total)


@njit(**INLINED)
def error_norm(weights, solution, closed, tables):
    """Return the root mean square of (|h sum_i e_i k_i| + |moved by the projection|) / (atol + rtol
    |y|).

    The slope at the new state counts, whatever its weight: where it is no number, the error is
    none.
    """
    n, y, x, z, k = tables.n, tables.y, tables.x, tables.z, tables.k
    tolerance, defect, total = tables.scale, tables.sample, splat(0.0)
    combine(weights, solution + 1, n, tables.now, tables.zeros, k, defect)
    for m in range(n):
        error = absolute(load(defect, m) + splat(0.0) * load(k, solution * (n + 1) + m))
        if m < closed:
            error = error + absolute(load(z, m))
        size = larger(absolute(load(y, m)), absolute(load(x, m)))
        ratio = error / (load(tolerance, n + m) + load(tolerance, m) * size)
        total = total + ratio * ratio
    return root(total / splat(float(n)))


@njit(**INLINED)
def weigh_pivots(last, tables):
    """Leave the smallest pivots of the stages before the last in now[LOWEST], and in now[WANTED] in
    which lanes none is below its bound."""
    k, now, n = tables.k, tables.now, tables.n
    bound, lowest, healthy = load(now, BOUND), splat(math.inf), load(now, LIVE) >= splat(1.0)
    for i in range(1, last):
        pivot = load(k, i * (n + 1) + n)
        healthy = healthy & (pivot >= bound)
        lowest = choose(lowest <= pivot, lowest, pivot)
    store(now, LOWEST, lowest)
    store(now, WANTED, choose(healthy, splat(1.0), splat(0.0)))


@njit(**INLINED)
def judge(method, closed, closure_tol, tables):
    """Leave the errors of a trial step in now[ERROR], not a number where the equations fail, and
    the smallest pivots."""
    now, last, lowest = tables.now, method.solution, load(tables.now, LOWEST)
    pivot = load(tables.k, last * (tables.n + 1) + tables.n)
    closed_again = load(now, RESIDUAL) <= splat(closure_tol) * load(now, LOOSE)
    healthy = closed_again & (load(now, WANTED) >= splat(1.0)) & (pivot >= load(now, BOUND))
    error = error_norm(method.e, last, closed, tables)
    if method.estimates > 1:
        second = splat(0.1) * error_norm(method.e + method.stages, last, 0, tables)
        both = root(error * error + second * second)
        error = choose(both <= splat(0.0), error, error * (error / both))
    error = choose(load(now, IDEAL) <= splat(0.0), splat(WARY) * error, error)
    store(now, ERROR, choose(healthy, error, splat(math.nan)))
    store(now, LOWEST, choose(lowest <= pivot, lowest, pivot))


@njit(**INLINED)
def accept(sixteenths, max_step, now):
    """Go on to the ends of the accepted steps, and choose the lengths of the next ones as in
    `native_pace`."""
    kept, step, h = load(now, ACCEPTS) <= splat(0.0), load(now, STEP), load(now, STEP_SIZE)
    before, one, error = load(now, IDEAL), splat(1.0), load(now, ERROR)
    first, power = before <= splat(0.0), one
    error = larger(choose(first, error / splat(WARY), error), splat(SMALLEST_ERROR))
    sixteenth = root(root(root(root(error))))
    for _ in range(sixteenths):
        power = power * sixteenth
    reach = splat(LARGEST_FACTOR) * step
    ideal = smaller(smaller(step / power, splat(max_step)), reach)
    ratio = choose(first, one, ideal / before)
    ease = choose(ratio <= one, ratio, root(one / smaller(ratio, splat(LEAP))))
    factor = smaller(load(now, GROWTH), splat(SAFETY) / power * ease)
    proposal = smaller(splat(max_step), step * larger(splat(SMALLEST_FACTOR), factor))
    proposal = choose(h <= step, proposal, larger(h, proposal))
    store(now, STEP_SIZE, choose(kept, h, proposal))
    store(now, GROWTH, choose(kept, load(now, GROWTH), splat(LARGEST_FACTOR)))
    longest = load(now, LONGEST)
    store(now, LONGEST, choose(kept, longest, larger(step, splat(FADING) * longest)))
    store(now, IDEAL, choose(kept, before, ideal))
    store(now, TIME, choose(kept, load(now, TIME), load(now, ARRIVAL)))
    store(now, PIVOT, choose(kept, load(now, PIVOT), smaller(load(now, PIVOT), load(now, LOWEST))))
