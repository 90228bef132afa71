"""Checks of what is given: numbers, names and parts of one kind, at the doors of every stage."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from importlib import import_module
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError

Kind = TypeVar("Kind")
LONGEST = 100  # characters of a value in a sentence
NUMBERS = frozenset({float, int})
DOUBLE = np.dtype(float)
MOST = 100_000_000  # of things that are held at a time: more do not fit into memory
LEAST = float(np.finfo(float).tiny)
FEW = 50  # numbers that Python sums sooner than NumPy is asked about them
AT_A_GLANCE = 6  # names of which nobody asks which one is the nearest


def shown(value: object) -> str:
    """Return a value as a sentence shows it: in one line, and not longer than a line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."


def suggestion(word: str, known: Iterable[str]) -> str:
    """Ask whether the nearest of the known words is meant, if one is near."""
    near = get_close_matches(word[:LONGEST].lower(), list(known), 1)
    return f" (did you mean {near[0]}?)" if near else ""


def amount(number: int, what: str) -> str:
    """Return a number of things with their name: "1 joint", "2 bodies"."""
    if number == 1:
        return f"1 {what}"
    return f"{number:,} {what[:-1]}ies" if what.endswith("dy") else f"{number:,} {what}s"


def amount_is(number: int, what: str) -> str:
    """Return a number of things as the subject of a sentence: "1 joint is", "2 bodies are"."""
    return f"{amount(number, what)} {'is' if number == 1 else 'are'}"


def listed(text: str, names: Iterable[str]) -> tuple[str, ...]:
    """Return the names that a text lists by ", ", which may be part of a name."""
    longest = sorted(map(re.escape, names), key=len, reverse=True)
    found = re.findall(f"(?:^|, )({'|'.join(longest)})(?=, |$)", text)
    return tuple(found if ", ".join(found) == text else text.split(", "))


def has_truth(values: object) -> bool:
    """Tell whether a truth value is among numbers: NumPy would take it for 0 or 1."""
    if isinstance(values, list | tuple):
        return not NUMBERS.issuperset(map(type, values)) and any(map(has_truth, values))
    if isinstance(values, np.ndarray | np.generic):
        return values.dtype.kind == "b" or (values.dtype.kind == "O" and has_truth(values.tolist()))
    return isinstance(values, bool)


def plain(value: object) -> object:
    """Return what stands for a number in a description; refuse a truth value, as a field does, and
    a complex number."""
    if has_truth(value):
        raise ValueError(f"{value} is a truth value; give a number")
    if isinstance(value, complex | np.complexfloating):
        raise ValueError(f"{value} is a complex number; give a real one")
    return value


def reals(values: object) -> np.ndarray | None:
    """Return a copy of values as floats, or None where they are no real numbers: texts, truth
    values, complex numbers, what a mask hides."""
    try:
        given = np.asarray(values)
        numeric = given.dtype.kind in "iufO" and not has_truth(values)
        if given.dtype.kind == "O" and any(value is None for value in given.flat):
            return None  # NumPy would take it for a number that is none
        return given.astype(float) if numeric and not np.ma.is_masked(values) else None
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return None


def labelled(values: object) -> tuple[str, ...]:
    """Return the names that a table, a series or a labelled array of pandas, Polars or xarray has
    for the numbers of its last axis; none where these are not texts."""
    known: Any = values
    if not hasattr(values, "to_numpy"):
        return getattr(values, "labels", ())
    if hasattr(values, "dims"):
        axes = [axis for axis in known.dims[-1:] if axis in known.coords]
        found = known.coords[axes[0]].values if axes else ()
    else:
        found = getattr(values, "columns", getattr(values, "index", ()))
    names = tuple(found)
    return names if all(isinstance(name, str) for name in names) else ()


def in_order(values: object, names: Sequence[str], what: str) -> None:
    """Refuse numbers that are labelled otherwise than by these names in this order."""
    found = labelled(values)
    if found and found != tuple(names):
        raise LinkworkError(
            f"{what} come labelled {', '.join(found)}; give {', '.join(names)}, in this order, or "
            "a mapping by name"
        )


def held(value: object) -> bool:
    """Tell whether something is a finite number that a double holds."""
    try:
        return isinstance(value, float | int) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        return False


def finite(values: ArrayLike, what: str) -> np.ndarray:
    """Return values as floats; refuse what is not a finite number."""
    if held(values):
        return np.array(values, float)
    array: np.ndarray | None
    if type(values) is np.ndarray and values.dtype is DOUBLE:
        array = np.array(values)
        if array.ndim == 1 and array.size < FEW and isfinite(sum(array.tolist())):
            return array
    else:
        array = reals(values)
    if array is None:
        raise LinkworkError(f"{what} is {shown(values)}; give numbers")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = f"{what}[{', '.join(map(str, index))}]" if index else what
        raise LinkworkError(f"{place} is {array[index]}; give finite numbers")
    return array


def number(value: object, what: str) -> float:
    """Return one number; refuse what is none, or not finite."""
    if held(value):
        return float(value)  # pyright: ignore[reportArgumentType]
    array = finite(value, what)  # pyright: ignore[reportArgumentType]
    if array.ndim:
        raise LinkworkError(f"{what} is {shown(value)}; give one number")
    return float(array)


def switch(value: object, what: str) -> None:
    """Refuse what is neither True nor False."""
    if not isinstance(value, bool | np.bool_):
        raise LinkworkError(f"{what} is {shown(value)}; give True or False")


def positive(value: object, what: str, unit: str = "") -> float:
    """Return one positive number; refuse what is none."""
    if not (result := number(value, what)) > 0:
        raise LinkworkError(
            f"{what} is {shown(value)}; give a positive number{unit and f' [{unit}]'}"
        )
    if result < LEAST:
        raise LinkworkError(
            f"{what} is {result:g}, nearer to zero than any number that a computer holds in full, "
            f"about 2e-308; check its unit{unit and f' [{unit}]'}"
        )
    return result


def fraction(value: object, what: str) -> float:
    """Return one positive number below 1; refuse what is none."""
    if (result := positive(value, what)) >= 1:
        raise LinkworkError(f"{what} is {shown(value)}; give a positive number below 1")
    return result


def amount_of(value: object, what: str) -> float:
    """Return one number, not below zero; refuse what is none."""
    if (result := number(value, what)) < 0:
        raise LinkworkError(f"{what} is {shown(value)}; give a number, not below zero")
    return result


def count(value: object, what: str, most: int | None = None) -> int:
    """Return a whole number, at least 1; refuse what is none, or more than the most."""
    result = number(value, what)
    if result < 1 or result % 1:
        raise LinkworkError(f"{what} is {shown(value)}; give a whole number, at least 1")
    if most is not None and result > most:
        raise LinkworkError(f"{what} is {shown(value)}; give at most {most:,}")
    return int(result)


def among(value: object, allowed: Iterable[object]) -> bool:
    """Tell whether a value is one of some names or numbers; what is compared part by part is
    none."""
    return isinstance(value, str | float | int | np.generic | None) and value in tuple(allowed)


def whole(value: object) -> bool:
    """Tell whether something is a whole number, not below zero; a truth value is none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= 0)


def random_numbers(seed: object) -> np.random.Generator:
    """Return what makes random numbers, the same for the same seed; refuse what is no seed."""
    if seed is not None and not whole(seed):
        raise LinkworkError(f"seed is {shown(seed)}; give a whole number, not below zero")
    return np.random.default_rng(seed)  # pyright: ignore[reportArgumentType, reportCallIssue]


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Refuse in one sentence where a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise LinkworkError(
            f"'{path}' cannot be written: {(error.strerror or str(error)).lower()}"
        ) from None


@contextmanager
def writing_to(place: Path, other: str) -> Iterator[None]:
    """Refuse where a file or folder that was asked for by name cannot be written; other: what to
    give in its place."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        why = getattr(error, "strerror", None) or error
        raise LinkworkError(f"{place} cannot be written ({why}); give another {other}") from None


def imported(module: str, missing: str) -> Any:
    """Return a module that may not be installed; refuse in this sentence where it is missing."""
    try:
        return import_module(module)
    except ImportError:
        raise LinkworkError(missing) from None


def file_path(value: object, what: str) -> Path:
    """Return the path of a file; refuse what is none."""
    if not isinstance(value, str | PathLike):
        raise LinkworkError(f"{what} is {shown(value)}; give the path of a file")
    return Path(value)


def folder_path(value: object, what: str) -> Path:
    """Return the path of a folder; refuse what is none."""
    if not isinstance(value, str | PathLike):
        raise LinkworkError(f"{what} is {shown(value)}; give the path of a folder")
    return Path(value)


def needed(value: object, kind: type, makers: str = "") -> None:
    """Refuse what is of another kind, as arguments that are swapped are; makers: the module whose
    functions make it, if users do not by its class."""
    if not isinstance(value, kind):
        name = kind.__name__
        right = f"one made by {makers}" if makers else f"a linkwork.{name}"
        raise LinkworkError(f"the {name.lower()} is {shown(value)}; give {right}")


def by_name(values: Any, what: str, example: str) -> Mapping[str, Any]:
    """Return things by name, none for None; refuse what is no mapping."""
    if values is not None and not isinstance(values, Mapping):
        raise LinkworkError(f"{what} are {shown(values)}; give them by name, such as {example}")
    return values or {}


def several(values: Any, kind: type[Kind], what: str) -> tuple[Kind, ...]:
    """Return a list of things of one kind; refuse one that is not in a list, and what is of another
    kind."""
    if isinstance(values, tuple) and not values:
        return ()
    if not isinstance(values, Iterable) or isinstance(values, str | Mapping):
        raise LinkworkError(f"{what} are {shown(values)}; give a list")
    found = tuple(values)
    for value in found:
        if not isinstance(value, kind):
            raise LinkworkError(
                f"one of {what} is {shown(value)}; give linkwork.control.{kind.__name__}(...)"
            )
    return found


def known(names: Iterable[object], allowed: Sequence[str], kind: str, use: str = "") -> None:
    """Refuse a name that is not among those allowed, and show these, and of many the nearest.

    kind: what they are the names of; use: what they are asked for, if that is part of the sentence
    """
    for name in names:
        if not isinstance(name, str) or name not in allowed:
            there = ", ".join(allowed) or "none"
            if isinstance(name, str) and len(allowed) > AT_A_GLANCE:
                there += suggestion(name, allowed)
            raise LinkworkError(f"there is no {kind} {shown(name)}{use}; there are {there}")


@contextmanager
def at(place: str) -> Iterator[None]:
    """Prefix the sentence of a refusal with the place where it happened."""
    try:
        yield
    except LinkworkError as error:
        raise type(error)(f"{place}{error}") from None


def names(values: object, what: str) -> tuple[str, ...]:
    """Return a sequence of names; refuse what is none."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise LinkworkError(f"{what} is {shown(values)}; give a list of names")
    found = tuple(values)
    if not all(isinstance(value, str) for value in found):
        raise LinkworkError(f"{what} is {shown(values)}; give a list of names")
    return found
