"""Patterns of paths: "rod_*.length" stands for the lengths of all rods."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from typing import Any

from linkwork.errors import LinkworkError
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.numbers import SECTIONS, Where, contents, free_numbers, located
from linkwork.mechanism.record import MechanismError

WILD = "*?["
LONG, COM = ".centre_of_mass.", ".com."


def paths_of(mechanism: Mechanism, path: object) -> list[str]:
    """Return the paths that a path or a pattern stands for.

    Raises:
        LinkworkError: a pattern that matches no number which can be free.
    """
    return matching(mechanism, path) if is_pattern(path) else [path]  # pyright: ignore


def is_pattern(path: object) -> bool:
    """Tell whether a path stands for several."""
    return isinstance(path, str) and any(letter in path for letter in WILD)


def freed(mechanism: Mechanism, free: Sequence[str], paths: Sequence[str]) -> tuple[str, ...]:
    """Return the paths of numbers that are free and of those that are to be; one that is free stays
    so, and what a pattern matches is taken once."""
    found = [*free]
    for path in paths:
        own = [each for each in paths_of(mechanism, path) if each not in free]
        if is_pattern(path):
            taken = {located(mechanism, each)[0] for each in found}
            own = [each for each in own if located(mechanism, each)[0] not in taken]
        found += own
    return tuple(found)


@contextmanager
def together(paths: Sequence[str]) -> Iterator[None]:
    """Name the patterns of numbers each of which can be free, but not all of them at a time."""
    try:
        yield
    except MechanismError as error:
        if patterns := ", ".join(map(repr, filter(is_pattern, paths))):
            raise LinkworkError(
                f"what {patterns} matches cannot all be free at a time; give patterns of fewer "
                f"numbers, such as '*.mass': {error}"
            ) from None
        raise


def matching(mechanism: Mechanism, pattern: str) -> list[str]:
    """Return the paths of all numbers that can be free and match a pattern, with or without their
    section."""
    found = []
    for path in (".".join(where) for where in numbers(mechanism)):
        short = path.split(".", 1)[1] if path.split(".", 1)[0] in SECTIONS else path
        spelled = {path, short, *(name.replace(LONG, COM) for name in (path, short))}
        if pattern in spelled:  # no pattern: the name of an element holds such letters
            return [pattern]
        matches = any(fnmatchcase(name, pattern) for name in spelled)
        if matches and can_be_free(mechanism, [path]):
            found.append(short if unique(mechanism, short) else path)
    if not found:
        raise LinkworkError(
            f"{pattern!r} matches no number that can be free; give a path such as "
            "'rod_*.length' or 'pivot_*.frames.0.position.x'"
        )
    return found


def can_be_free(mechanism: Mechanism, paths: list[str]) -> bool:
    """Tell whether numbers can be free."""
    try:
        free_numbers(mechanism, paths)
    except LinkworkError:
        return False
    return True


def unique(mechanism: Mechanism, path: str) -> bool:
    """Tell whether a path leads to one number."""
    try:
        located(mechanism, path)
    except LinkworkError:
        return False
    return True


def numbers(item: Any, before: Where = ()) -> Iterator[Where]:
    """Yield where the numbers of a description are, the components of vectors by x, y, z."""
    inside, vector = contents(item), "powers" not in before[-2:]
    if vector and isinstance(item, tuple) and len(item) == 3 and isinstance(item[0], float):
        inside = dict(zip("xyz", item, strict=True))
    for key, part in inside.items():
        if isinstance(part, float):
            yield (*before, key)
        else:
            yield from numbers(part, (*before, key))
