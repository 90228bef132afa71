"""What functions of flat arrays take and give by name, for any framework's arrays: those that know
`reshape` and `swapaxes`."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import Any

from linkwork.autodiff.array_function import ArrayFunction
from linkwork.autodiff.offered import RANKS
from linkwork.errors import LinkworkError


def arguments(
    name: str, of: ArrayFunction, given: Sequence[Any], p: Any = None
) -> tuple[list[Any], Any]:
    """Return the arrays that a function was given but for p, and p, which may follow them.

    Raises:
        LinkworkError: more or fewer of them.
    """
    wanted = [each for each, _ in of.inputs if each != "p"]
    own = list(given)
    if len(own) == len(wanted) + 1 and p is None:
        p = own.pop()
    if len(own) != len(wanted):
        raise LinkworkError(
            f"{name} was given {len(given)} arrays; give {len(wanted)}: {', '.join(wanted)}"
        )
    return own, p


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
