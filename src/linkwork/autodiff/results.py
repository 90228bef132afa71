"""What functions of flat arrays take and give by name, for any framework's arrays: those that know
`reshape` and `swapaxes`."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from linkwork.autodiff.array_function import ArrayFunction
from linkwork.autodiff.offered import RANKS
from linkwork.checks import known
from linkwork.errors import LinkworkError


def arguments(
    name: str, of: ArrayFunction, given: Sequence[Any], named: Mapping[str, Any]
) -> tuple[list[Any], Any]:
    """Return the arrays that a function was given, in their order or by name, but for p, and p,
    which may follow them.

    Raises:
        LinkworkError: more or fewer of them, a name that it does not take, one given twice.
    """
    wanted = [each for each, _ in of.inputs if each != "p"]
    known([each for each in named if each != "p"], wanted, "array", f" of {name}")
    found = dict(zip((*wanted, "p"), given, strict=False))
    twice = next((each for each in named if each in found), None)
    if twice is not None:
        raise LinkworkError(f"{name} was given {twice} twice: in its place, and by name")
    found |= named
    p = found.pop("p", None)
    if len(given) > len(wanted) + 1 or len(found) != len(wanted):
        count = max(len(found), len(given))
        raise LinkworkError(
            f"{name} was given {count} arrays; give {len(wanted)}: {', '.join(wanted)}"
        )
    return [found[each] for each in wanted], p


def results(name: str, of: ArrayFunction) -> Callable[[Any], Any]:
    """Return what gives the results that y (..., m) holds their shapes: of one it, of several a
    named tuple."""
    kind = namedtuple(name, [each for each, _ in of.outputs])

    def told(y: Any) -> Any:
        found, start = [], 0
        for each, (rows, columns) in of.outputs:
            flat = y[..., start : start + rows * columns]
            start += rows * columns
            rank = RANKS.get(each, 1)
            if rank == 2:
                flat = flat.reshape(*y.shape[:-1], columns, rows).swapaxes(-1, -2)
            found.append(flat[..., 0] if rank == 0 else flat)
        return found[0] if len(found) == 1 else kind(*found)

    return told
