"""Measuring: quantities of an ensemble's members at the times that were asked for, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from linkwork.runs.members import Members
from linkwork.runs.quantities import SavedQuantity, axes_of
from linkwork.runs.saved_rows import SavedRows, blended
from linkwork.runs.saved_states import Aim, Over, SavedStates
from linkwork.threads import usable_processors

BLOCK = 16384  # saved states that are looked at at a time


def measured(
    batch: Members,
    parts: Sequence[SavedRows],
    times: int,
    wanted: Iterable[SavedQuantity],
    *,
    aim: Aim | None = None,
    threads: int | None = None,
) -> dict[str, np.ndarray]:
    """Return quantities (N, times, ...) of all members by name; nan at times that a member did not
    reach.

    Args:
        parts: the members' states; times: how many were asked for.
        aim: where a controller leads to; threads: all processors if left out.
    """
    wanted, axes = list(dict.fromkeys(wanted)), axes_of(batch.robot, batch.system.extras)
    shapes = {each: [len(axes[axis].names) for axis in each.axes] for each in wanted}
    found = {each.name: np.full((len(batch), times, *shapes[each]), np.nan) for each in wanted}
    first, *others = [block for rows in parts for block in blocks(rows)] or [None]

    def put(rows: SavedRows | None) -> None:
        if rows is not None:
            states = saved_states(batch, rows, aim)
            for each in wanted:
                found[each.name][rows.members, rows.times] = each.values(states)

    put(first)  # compiles what is needed
    if others:
        with ThreadPoolExecutor(threads or usable_processors()) as pool:
            list(pool.map(put, others))
    return found


def blocks(rows: SavedRows) -> Iterator[SavedRows]:
    """Yield states some at a time, which fit the processor's cache and are shared by threads."""
    for first in range(0, len(rows.members), BLOCK):
        yield rows[first : first + BLOCK]


def saved_states(batch: Members, rows: SavedRows, aim: Aim | None = None) -> SavedStates:
    """Return the states of rows with what follows from them."""
    over = None
    if rows.nodes is not None:
        weights = rows.nodes.weights
        over = Over(saved_states(batch, rows.at_nodes, aim), partial(blended, weights))
    return SavedStates(
        batch.robot,
        batch.system,
        rows.chart,
        rows.y,
        partial(batch.inputs_at, rows.members, rows.t, rows.held),
        batch.p[rows.members] if len(batch.p) > 1 else batch.p,
        t=rows.t,
        places=rows.times,
        aim=aim,
        over=over,
    )
