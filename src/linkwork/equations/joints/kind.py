"""What a joint kind consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Motion:
    """Describe an elementary motion: a turn about (`turns`) or a slide along a constant unit axis."""

    turns: bool
    axis: np.ndarray

    def reversed(self) -> Motion:
        return Motion(self.turns, -self.axis)


@dataclass(frozen=True)
class Row:
    """Describe one closure row: e . (p_2 - p_1) = 0 where f is None, else e . f = 0; `name` says what it holds."""

    name: str
    e: np.ndarray
    f: np.ndarray | None = None

    @property
    def moment(self) -> np.ndarray:
        """Return f x e, the direction about which a direction row allows no turn (zero for a position row)."""
        return np.zeros(3) if self.f is None else np.cross(self.f, self.e)


@dataclass(frozen=True)
class Kind:
    """Describe a joint kind by functions of the joint's data.

    `rows` takes the joint and a preferred first direction; rows may be taken with F1 and F2 exchanged.
    """

    motions: Callable[[Any], tuple[Motion, ...]]
    rows: Callable[[Any, np.ndarray], tuple[Row, ...]]


def transversals(axis: np.ndarray, preferred: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors e_1, e_2 with e_1 x e_2 = axis, e_1 as near as possible to a preferred direction."""
    for candidate in (preferred, *np.eye(3)):
        e1 = candidate - axis * (axis @ candidate)
        length = np.linalg.norm(e1)
        if length > 0.1 * max(np.linalg.norm(candidate), 1e-9):
            e1 = e1 / length
            return e1, np.cross(axis, e1)
    raise AssertionError("one of the three coordinate directions is always transversal")
