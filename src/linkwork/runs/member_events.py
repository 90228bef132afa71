"""What happened in the runs of members: events, and singular poses that were stepped over, side by
side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkwork.runs.endings import singular_times
from linkwork.runs.members import Members
from linkwork.runs.one_by_one import SingleRun
from linkwork.runs.side_by_side import Leg


class Happened(NamedTuple):
    """Hold the events of all runs side by side, member by member: whose, which and when [s]."""

    members: np.ndarray
    names: np.ndarray
    times: np.ndarray


def happened(batch: Members, legs: Sequence[Leg], singles: Sequence[SingleRun]) -> Happened:
    """Return the events of all runs: of those by themselves, and of all others in the lanes."""
    names = np.array([event.name for event in batch.system.events], dtype=object)
    if not names.size:
        return Happened(np.empty(0, int), names, np.empty(0))
    found = [np.empty((0, 3))]
    for one in singles:
        for part in one.segments:
            events = part.trajectory.events
            whose = np.full(len(events), float(one.member))
            found.append(np.column_stack([whose, events.index, events.times]))
    alone = [one.member for one in singles]
    for leg in legs:
        rows = leg.outcomes.events
        whose = leg.members[rows[:, -1].astype(int)]
        table = np.column_stack([whose, rows[:, -2], rows[:, 0]])
        found.append(table[~np.isin(whose, alone)])
    table = np.concatenate(found)
    table = table[np.lexsort((table[:, 2], table[:, 0]))]
    whose, index, times = table[:, 0].astype(int), table[:, 1].astype(int), table[:, 2].copy()
    return Happened(whose, names[index], times)


def passed(singles: Sequence[SingleRun]) -> Happened:
    """Return the singular poses that all runs stepped over."""
    found = [
        (one.member, singular_times(one.segments))
        for one in sorted(singles, key=lambda one: one.member)
    ]
    whose = np.array([member for member, times in found for _ in times], int)
    return Happened(
        whose,
        np.full(whose.size, "singular pose", object),
        np.array([t for _, of in found for t in of], float),
    )
