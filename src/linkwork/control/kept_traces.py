"""Kept traces: what acts on a robot is traced once where it is settled, made of numbers and of
ready parts alone.

A Python function is traced in every run that it acts in, for what it reads beside its arguments, a
captured value or a global, may have changed since. Ready-made controllers, drives and events, and
wrenches of numbers or signals, are data (`linkwork.control.records`): they are told apart by all of
their numbers as they are now, and what was traced for equal ones is taken again.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any

import numpy as np

from linkwork.control.acting import Acting, act
from linkwork.control.controllers import Controller
from linkwork.control.drives import Drive
from linkwork.control.events import Event
from linkwork.control.observation import Names
from linkwork.control.records import settled
from linkwork.control.sampler import Sampler
from linkwork.control.tracing import Law
from linkwork.control.wrenches import Wrench

KEPT = 64  # traces


@dataclass(frozen=True)
class ToTrace:
    """Hold the arguments of `act`, and what determines its result."""

    key: Hashable
    arguments: tuple[Any, ...] = field(compare=False)


def acting_once(
    names: Names,
    law: Law | Sampler | None,
    drives: Mapping[str, Drive],
    wrenches: Sequence[Wrench],
    events: Sequence[Event],
    span: tuple[float, float],
) -> Acting:
    """Return what `act` does, traced before where everything is settled."""
    arguments = (names, law, drives, wrenches, events, span)
    parts = law, drives, wrenches, events
    if settled(parts):
        key = names, *map(value, parts)
        try:
            hash(key)
        except TypeError:  # a goal of the user's own that is not settled
            return act(*arguments)
        return _kept(ToTrace(key, arguments))
    return act(*arguments)


@lru_cache(maxsize=KEPT)
def _kept(given: ToTrace) -> Acting:
    return act(*given.arguments)


def value(part: Any) -> Any:
    """Return what determines a part: numbers by value; signals, states and robots, which are
    frozen, by themselves.

    A controller is told apart from others with equal numbers, too: it keeps the signals that it
    made of its goal.
    """
    if isinstance(part, Mapping):
        return tuple((name, value(of)) for name, of in part.items())
    if isinstance(part, np.ndarray):
        return part.shape, part.dtype.str, part.tobytes()
    if isinstance(part, list | tuple):
        return tuple(map(value, part))
    if isinstance(part, Wrench | Event):
        return tuple(map(value, vars(part).values()))
    if isinstance(part, Sampler | Controller):
        return part, *(value(getattr(part, entry.name)) for entry in fields(part) if entry.init)
    return part
