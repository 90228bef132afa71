"""Members of many robots put where members of others are, compiled."""

from typing import Any, NamedTuple

from numba import njit, types

from linkwork.simulation.compiled import INLINED, compiled_once
from linkwork.simulation.native_parts import OK
from linkwork.simulation.pointers import uncounted
from linkwork.simulation.structures import tuple_type
from linkwork.stepping.native_block import SIGNATURE


class MemberPlaces(NamedTuple):
    """Where members are: the `herd`; coordinates of joints as they were `seen` last (N, m), and the
    numbers of their `charts` (N,)."""

    herd: Any
    seen: Any
    charts: Any


_herd, _members = SIGNATURE[5], SIGNATURE[-1]
_rows, _numbers = types.Array(types.float64, 2, "C"), types.Array(types.intp, 1, "C")
place_type = tuple_type(MemberPlaces, _herd, _rows, _numbers)


@njit(**INLINED)
def copied(target, members, source, of):
    """Copy columns: row after row, for each is far from the next one in memory."""
    for m in range(target.shape[0]):
        for i in range(members.size):
            target[m, members[i]] = source[m, of[i]]


@njit(**INLINED)
def moved(here, members, there, of, numbers):
    """Put members where members of others are; return whether any changes its chart, or goes on
    where it had ended, or the reverse; numbers: of the others' charts, here."""
    own, other, changed = here.herd, there.herd, False
    copied(own.y, members, other.y, of)
    copied(own.held, members, other.held, of)
    copied(own.turns, members, other.turns, of)
    copied(own.u, members, other.u, of)
    copied(own.p, members, other.p, of)
    copied(own.numbers, members, other.numbers, of)
    for k in range(members.size):
        i, j = members[k], of[k]
        chart = numbers[there.charts[j]]
        changed |= own.status[i] != OK or other.status[j] != OK or here.charts[i] != chart
        own.status[i], here.charts[i] = other.status[j], chart
        for m in range(here.seen.shape[1]):
            here.seen[i, m] = there.seen[j, m]
    return changed


PUT = place_type, _members, place_type, _members, _members


@compiled_once("members put where others are", PUT)
def transfer(here, members, there, of, numbers):
    """Put members where members of other steppers are, as `moved`."""
    here, there, numbers = uncounted(here), uncounted(there), uncounted(numbers)
    return moved(here, uncounted(members), there, uncounted(of), numbers)
