"""Episodes of many environments, compiled: actions that are taken over, numbers that are drawn, and
which of them are over."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.pointers import pointer, uncounted
from linkwork.simulation.structures import tuple_type
from linkwork.stepping.native_block import SIGNATURE
from linkwork.stepping.native_exchange import moved, place_type

_herd, _members = SIGNATURE[5], SIGNATURE[-1]
_numbers, _places = types.Array(types.float64, 1, "C"), types.Array(types.intp, 1, "C")
_rows = types.Array(types.float64, 2, "C")
_truths = types.Array(types.boolean, 1, "C")


class Drawing(NamedTuple):
    """Say what is drawn: `numbers` (N, EPISODES, count) for the episodes to come, of which the
    `next` one (N,) is that of each environment's next episode; where they are written to, rows of
    the `states`, -1 for none, or of `parameters`; from how many `starts` the last one chooses."""

    numbers: Any
    next: Any
    states: Any
    parameters: Any
    starts: int


_drawn = types.Array(types.float64, 3, "C")
_drawing = tuple_type(Drawing, _drawn, _places, _places, _places, types.intp)


@compiled_once("actions of many environments", (_rows, _rows, _herd, _members))
def act(actions, limits, herd, places):
    """Write actions (N, numbers), cut to their limits (numbers, 2), to rows of p; return how many
    numbers are not finite: if there are any nothing is written.

    places: the rows, one for each number
    """
    p, (N, count), wrong = uncounted(herd).p, actions.shape, 0
    actions, limits, places = uncounted(actions), uncounted(limits), uncounted(places)
    flat = pointer(actions)
    for k in range(N * count):
        wrong += not math.isfinite(flat[k])
    for j in range(count if wrong == 0 else 0):
        low, high, row = limits[j, 0], limits[j, 1], p[places[j]]
        for i in range(N):
            row[i] = min(max(actions[i, j], low), high)
    return wrong


@compiled_once(
    "beginnings of episodes",
    (place_type, _members, place_type, _members, _drawing, _places, _truths, _places),
)
def begin(here, members, there, numbers, drawing, steps, over, used):
    """Put members where prepared ones are, one that is drawn for each, and write what is drawn
    besides; none of their steps is taken, and they are not over.

    numbers: of the others' charts, here; used: members all of whose numbers are used up then are
    written to it

    Returns:
        Whether teams change (`moved`), and how many members are written to `used`.
    """
    # Where each begins.
    here, there, drawing = uncounted(here), uncounted(there), uncounted(drawing)
    members, numbers, drawn = uncounted(members), uncounted(numbers), drawing.numbers
    chosen, count, last = np.empty(members.size + 1, np.intp), 0, drawing.numbers.shape[2] - 1
    of, following = uncounted(chosen), drawing.next
    for k in range(members.size):
        i = members[k]
        of[k] = int(drawn[i, following[i], last] * drawing.starts)
    changed = moved(here, members, there, of, uncounted(numbers))
    # What is drawn besides.
    herd = here.herd
    for k in range(members.size):
        i = members[k]
        steps[i], over[i] = 0, False
        for j in range(drawing.states.size):
            number, row = drawn[i, following[i], j], drawing.states[j]
            if row >= 0:
                herd.y[row, i] = herd.held[row, i] = number
            else:
                herd.p[drawing.parameters[j], i] = number
        following[i] += 1
        if following[i] == drawn.shape[1]:
            used[count] = i
            count += 1
    chosen[0] = 0  # the memory of those chosen lives to the end
    return changed, count


@compiled_once(
    "ends of episodes",
    (_rows, _members, types.intp, _herd, _places, _numbers, _truths, _truths, _truths),
)
def conclude(told, begun, horizon, herd, steps, rewards, terminations, truncations, over):
    """Count a step of each environment, and write what came of it: its reward, and whether it is
    over; those that have begun with it took none. Return how many robots could not be stepped on.

    told: (2, N), rewards and terminations, not zero where the episode is over
    """
    status, failed = uncounted(herd).status, 0
    for i in range(steps.size):
        steps[i] += 1
        rewards[i], terminations[i] = told[0, i], told[1, i] != 0
        truncations[i] = steps[i] >= horizon or status[i] != 0
        failed += status[i] != 0
    for k in range(begun.size):
        i = begun[k]
        steps[i], rewards[i], terminations[i], truncations[i] = 0, 0.0, False, False
    for i in range(steps.size):
        over[i] = terminations[i] or truncations[i]
    return failed
