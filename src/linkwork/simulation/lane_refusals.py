"""Why steps of the members in the lanes are refused, and when a member is to stop.

Names as in `lanes`.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.lane_tables import (
    ACCEPTED,
    ACCEPTS,
    AILMENT,
    ARRIVAL,
    BOUND,
    CAUSE,
    ERROR,
    EVALUATIONS,
    GROWTH,
    IDEAL,
    LEAST,
    LONGEST,
    LOOSE,
    MOST,
    REJECTED,
    REJECTED_PIVOT,
    REJECTED_RESIDUAL,
    RESIDUAL,
    START,
    STATUS,
    STEP,
    STEP_SIZE,
    STIFFLY,
    STOP,
    TIME,
)
from linkwork.simulation.native_loop import (
    LOOK,
    NEAR,
    STEP_UNDERFLOW,
    STIFF,
    TOO_MANY_STEPS,
    VOTES,
)
from linkwork.simulation.native_pace import RETREAT, SAFETY, SMALLEST_FACTOR, shortest_step
from linkwork.simulation.native_parts import CLOSURE_LOST, NON_FINITE, OK, SINGULAR
from linkwork.simulation.vectors import LANES


@njit(**INLINED)
def goes_on(lane, now, tally):
    """Tell whether the member in a lane goes on; keep why not."""
    stop = now[STOP, lane]
    if tally[STATUS, lane] != OK or not now[TIME, lane] < stop:
        return False
    if tally[ACCEPTED, lane] + tally[REJECTED, lane] >= tally[MOST, lane]:
        tally[STATUS, lane] = TOO_MANY_STEPS
    elif now[STEP_SIZE, lane] < shortest_step(now[START, lane], stop):
        tally[STATUS, lane] = tally[CAUSE, lane]
    return tally[STATUS, lane] == OK


@njit(**INLINED)
def first_ailment(k, stage, n, lane, now):
    """Return what a stage's numbers tell of a slope from which no step can retreat: OK, SINGULAR or
    NON_FINITE."""
    pivot = k[stage * (n + 1) + n, lane]
    if not pivot >= now[BOUND, lane]:
        return NON_FINITE if math.isnan(pivot) else SINGULAR
    for m in range(n):
        if not math.isfinite(k[stage * (n + 1) + m, lane]):
            return NON_FINITE
    return OK


@njit(**OPTIONS)
def undefined(lane, k, rows):
    """Tell whether any number in the first rows of a lane's slopes is not finite."""
    count = 0
    for row in range(rows):
        count += not math.isfinite(k[row, lane])
    return count > 0


@njit(**OPTIONS)
def diagnose(lane, solution, closure_tol, tables):
    """Find why the equations fail in a lane's trial step, in the order of the stages; count the
    evaluations only up to it."""
    n, k, now, tally, lowest = tables.n, tables.k, tables.now, tables.tally, math.inf
    tally[AILMENT, lane] = NON_FINITE
    for i in range(1, solution + 1):
        # The loops of the new state are closed before its slope is evaluated.
        if i == solution and not now[RESIDUAL, lane] <= closure_tol * now[LOOSE, lane]:
            nowhere = math.isnan(now[RESIDUAL, lane]) and undefined(lane, k, i * (n + 1))
            tally[AILMENT, lane] = NON_FINITE if nowhere else CLOSURE_LOST
            now[REJECTED_RESIDUAL, lane] = now[RESIDUAL, lane]
            tally[EVALUATIONS, lane] -= 1
            break
        pivot = k[i * (n + 1) + n, lane]
        lowest = min(lowest, pivot)
        if not pivot >= now[BOUND, lane]:
            tally[AILMENT, lane] = NON_FINITE if math.isnan(pivot) else SINGULAR
            tally[EVALUATIONS, lane] -= solution - i
            break
    now[REJECTED_PIVOT, lane] = lowest


@njit(**INLINED)
def reject(lane, exponent, first_pivot, now, tally):
    """Shrink the step of a lane; stop where the pivot at its start, the first one, is at the bound
    already."""
    tally[REJECTED, lane] += 1
    now[GROWTH, lane] = 1.0
    ailment, step = tally[AILMENT, lane], now[STEP, lane]
    if ailment == OK:
        tally[CAUSE, lane] = STEP_UNDERFLOW
        shrunk = step * max(SMALLEST_FACTOR, SAFETY / now[ERROR, lane] ** exponent)
        now[STEP_SIZE, lane] = max(now[LEAST, lane], shrunk)
    else:
        tally[CAUSE, lane] = ailment
        now[STEP_SIZE, lane], now[LONGEST, lane] = RETREAT * step, RETREAT * now[LONGEST, lane]
        now[IDEAL, lane] *= RETREAT
        if ailment == SINGULAR and first_pivot <= NEAR * now[BOUND, lane]:
            tally[STATUS, lane] = SINGULAR


@njit(**OPTIONS)
def look_due(method, limits, tables):
    """Look at the accepted steps that are due for it; return after how many steps of the lanes
    another one can be."""
    now, tally, soonest = tables.now, tables.tally, LOOK
    for lane in range(LANES):
        votes, since = tally[STIFFLY, lane], tally[ACCEPTED, lane] % LOOK
        if now[ACCEPTS, lane] > 0 and (votes > 0 or since == 0):
            look(lane, method, limits, tables)
        soonest = min(soonest, 1 if tally[STIFFLY, lane] > 0 else LOOK - since)
    return soonest


@njit(**OPTIONS)
def look(lane, method, limits, tables):
    """Look whether an accepted step is stiff, and leave a run of which most are: see
    `native_parts.stiffness`."""
    n, y, x, k, now, tally = tables.n, tables.y, tables.x, tables.k, tables.now, tables.tally
    last, h, above, below = method.solution, now[STEP, lane], 0.0, 0.0
    weights, scales = method.a + (last - 1) * method.stages, tables.scale
    for m in range(n):
        total = 0.0
        for j in range(last - 1):
            total += weights[j] * k[j * (n + 1) + m, lane]
        scale = scales[n + m, lane] + scales[m, lane] * abs(x[m, lane])
        above += ((k[last * (n + 1) + m, lane] - k[(last - 1) * (n + 1) + m, lane]) / scale) ** 2
        below += ((x[m, lane] - (y[m, lane] + h * total)) / scale) ** 2
    stiff = below > 0 and h * math.sqrt(above / below) > limits.stability
    tally[STIFFLY, lane] = max(0, tally[STIFFLY, lane] + (1 if stiff else -1))
    if tally[STIFFLY, lane] >= VOTES and now[STOP, lane] - now[ARRIVAL, lane] > LOOK * h:
        tally[STATUS, lane] = STIFF
