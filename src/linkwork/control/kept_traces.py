"""Kept traces: what acts on a robot is traced once where it is settled: where all that determines
it can be told by value.

Ready-made controllers, drives, events and wrenches are data (`linkwork.control.records`): they are
told apart by all of their numbers as they are now, Python functions by all that they read
(`captured`), and what was traced for equal ones is taken again. A function that reads what may
change unseen, and a class of the user's own, is traced in every run that it acts in.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any

import numpy as np

from linkwork.control.acting import Acting, act
from linkwork.control.captured import Open, told
from linkwork.control.controllers import Controller
from linkwork.control.drives import Drive
from linkwork.control.events import Event
from linkwork.control.observation import Names
from linkwork.control.records import ActingPart, of_package
from linkwork.control.sampler import Sampler
from linkwork.control.tracing import Law
from linkwork.control.wrenches import Wrench
from linkwork.simulation import Sampled, Signal

KEPT = 64  # traces
PLAIN = "builtins", "numpy"  # whose objects are numbers or text, where they have a hash


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
    try:
        key = names, *map(value, (law, drives, wrenches, events))
        hash(key)
    except (Open, TypeError):  # a part, or a goal, of the user's own that may change
        return act(*arguments)
    return _kept(ToTrace(key, arguments))


@lru_cache(maxsize=KEPT)
def _kept(given: ToTrace) -> Acting:
    return act(*given.arguments)


def value(part: Any) -> Any:
    """Return what determines a part: numbers by value; signals, states and robots, which are
    frozen, by themselves; functions that are traced by what they read.

    A controller is told apart from others with equal numbers, too: it keeps the signals that it
    made of its goal. So is a sampler, whose function may be called.

    Raises:
        Open: it may change unseen.
    """
    if isinstance(part, Mapping):
        return tuple((name, value(of)) for name, of in part.items())
    if isinstance(part, list | tuple):
        return tuple(map(value, part))
    if isinstance(part, ActingPart):
        return part_value(part)
    if isinstance(part, np.ndarray) or (callable(part) and not isinstance(part, Sampled | Signal)):
        return told(part)
    if not of_package(part) and type(part).__module__ not in PLAIN:
        raise Open
    return part


def part_value(part: ActingPart) -> Any:
    """Return what determines a part of what acts."""
    if not part.settled:
        raise Open
    if isinstance(part, Wrench | Event):
        return type(part), tuple(map(value, vars(part).values()))
    if isinstance(part, Sampler | Controller):
        called = ("function",) if isinstance(part, Sampler) and not part.compiled else ()
        names = (entry.name for entry in fields(part) if entry.init and entry.name not in called)
        return part, *(value(getattr(part, name)) for name in names)
    return part
