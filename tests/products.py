"""Cases of which a sample runs with all other tests, and every one where all are wanted."""

from collections.abc import Sequence
from itertools import product
from typing import Any

from tests.catalogue import WHOLE


def sampled(*axes: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Return cases of one value of each axis: as few as hold every value at least once, or all."""
    if WHOLE:
        return list(product(*axes))
    longest = max(map(len, axes))
    return [tuple(axis[k % len(axis)] for axis in axes) for k in range(longest)]


def first(few: int, values: Sequence[Any]) -> Sequence[Any]:
    """Return the first few of these values, or all."""
    return values if WHOLE else values[:few]
