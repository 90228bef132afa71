"""What a joint kind consists of: its motions and its closure rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from linkwork.equations.algebra import Number, Vector, cross_product, present


@dataclass(frozen=True)
class ElementaryMotion:
    """Describe an elementary motion: turn about and slide along constant axes, or turn freely
    (`ball`).

    A unit rate turns about `turn` (unit or zero) and slides by `slide`, both fixed in the inner and
    in the outer frame; that of a screw turns and slides by `pitch`. A ball has three rates, the
    angular velocity in the axes of the description's first frame, and four coordinates.
    """

    turn: np.ndarray = field(default_factory=lambda: np.zeros(3))
    slide: Vector = field(default_factory=lambda: np.zeros(3))
    ball: bool = False
    pitch: Number | None = None

    @property
    def what(self) -> Literal["turn", "slide", "screw", "ball"]:
        if self.ball:
            return "ball"
        return "screw" if self.pitch is not None else "turn" if self.turn.any() else "slide"

    @cached_property
    def turns(self) -> bool:
        return self.ball or bool(self.turn.any())

    @cached_property
    def slides(self) -> bool:
        return present(self.slide)

    @property
    def coordinates(self) -> int:
        return 4 if self.ball else 1

    @property
    def rates(self) -> int:
        return 3 if self.ball else 1

    def reversed(self) -> ElementaryMotion:
        """Return the motion of the inner frame seen from the outer one, for the same coordinate."""
        return self if self.ball else replace(self, turn=-self.turn, slide=-self.slide)


@dataclass(frozen=True)
class Row:
    """Describe one closure row; `name` says what it holds.

    position row   e . (p_2 - p_1)                where f is None
    direction row  e . f                          where f is given; f has the same components in F1
                                                  and F2 but for a `crossing` row, where e is fixed
                                                  in F1 alone and f in F2
    screw row      e . (p_2 - p_1) - pitch angle  where pitch is given; e is the axis
    distance row   (|p_2 - p_1|^2 - l^2) / (2 l)  where length is given; e is not used
    """

    name: str
    e: np.ndarray
    f: np.ndarray | None = None
    pitch: Number | None = None
    length: Number | None = None
    crossing: bool = False

    @cached_property
    def moment(self) -> np.ndarray:
        """Return f x e, the direction about which a direction row allows no turn (zero for the
        other rows)."""
        return np.zeros(3) if self.f is None else cross_product(self.f, self.e)

    def exchanged(self) -> Row:
        """Return the row with e in F2 and f in F1."""
        return replace(self, e=self.f, f=self.e) if self.crossing else self


@dataclass(frozen=True)
class Kind:
    """Describe a joint kind by functions of the joint's data.

    motions: from F1 to F2, in order
    rows: takes the joint and a preferred first direction
    in_plane: the freedoms that it leaves two bodies in a planar mechanism
    """

    motions: Callable[[Any], tuple[ElementaryMotion, ...]]
    rows: Callable[[Any, np.ndarray], tuple[Row, ...]]
    in_plane: int = 1


def screw(axis: object, pitch: Number) -> ElementaryMotion:
    return ElementaryMotion(turn=np.array(axis), slide=pitch * np.array(axis), pitch=pitch)


def turn(axis: object) -> ElementaryMotion:
    return ElementaryMotion(turn=np.array(axis, float))


def slide(axis: object) -> ElementaryMotion:
    return ElementaryMotion(slide=np.array(axis, float))


def coincident(preferred: np.ndarray) -> tuple[Row, ...]:
    """Return the three position rows of a common origin, along directions of which the first is
    preferred."""
    axis = np.eye(3)[int(np.argmin(np.abs(preferred)))]
    e1, e2 = transversals(axis, preferred)
    return tuple(Row(f"position {number}", e) for number, e in enumerate((e1, e2, axis), start=1))


def coaxial(axis: np.ndarray, preferred: np.ndarray) -> tuple[tuple[Row, Row], tuple[Row, Row]]:
    """Return the two position rows across a common axis, and the two direction rows of it, along
    directions of which the first is preferred."""
    e1, e2 = transversals(axis, preferred)
    positions = Row("position across the axis, 1", e1), Row("position across the axis, 2", e2)
    directions = (
        Row("direction of the axis, 1", e1, axis),
        Row("direction of the axis, 2", e2, axis),
    )
    return positions, directions


def transversals(axis: np.ndarray, preferred: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors e_1, e_2 with e_1 x e_2 = axis, e_1 as near as possible to a
    preferred direction."""
    for candidate in (preferred, *np.eye(3)):
        e1 = candidate - axis * (axis @ candidate)
        length = np.linalg.norm(e1)
        if length > 0.1 * np.linalg.norm(candidate):
            e1 = e1 / length
            return e1, cross_product(axis, e1)
    raise AssertionError("one of the three coordinate directions is always transversal")
