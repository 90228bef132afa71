"""Captured: all that a Python function reads beside its arguments, by value.

Its code reads by name: captured variables, globals, builtins, and attributes of modules, to which a
chain of names leads. Functions with equal code, defaults and values of these do the same. Read are
numbers, text, arrays and containers of them as they are now, functions of the user's own by what
they read in turn, and functions of `math`, NumPy and `linkwork.math` as such. All else may change
unseen: an object of the user's own, a random source, a file, the clock. Such a function is `Open`;
so is one that writes what it captured, and one that reads more than is worth comparing.
"""

from __future__ import annotations

import dis
import sys
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from functools import lru_cache, partial
from itertools import takewhile
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from linkwork.control.records import of_package

LARGE = 2**20  # bytes of all that is read, from which on it is not compared
ENTRY = 64  # bytes that a number among them counts, at least
PLAIN = bool, int, str, bytes, type(None)
BY_DIGITS = float, complex, range  # equal ones may differ: 0.0 and -0.0
LIBRARIES = "math", "cmath", "numpy", "numpy.linalg", "linkwork.math"
PACKAGES = {name.partition(".")[0] for name in LIBRARIES}
OUTSIDE = {
    *("load", "loadtxt", "genfromtxt", "fromfile", "fromregex", "memmap", "datetime64"),
    *("geterr", "seterr", "geterrcall", "seterrcall", "getbufsize", "setbufsize"),
    *("get_printoptions", "set_printoptions"),
}
MEMORYLESS = {
    *(abs, all, any, bool, complex, dict, divmod, enumerate, filter, float, frozenset, int),
    *(isinstance, len, list, map, max, min, pow, range, reversed, round, set, slice, sorted),
    *(str, sum, tuple, zip),
}
FUNCTIONS = type, FunctionType, BuiltinFunctionType, type(np.dot), np.ufunc
GLOBAL, CELL = "LOAD_GLOBAL", "LOAD_DEREF"
WRITTEN = "STORE_DEREF", "DELETE_DEREF"
FURTHER = "LOAD_ATTR", "LOAD_METHOD"
INSIDE = "__"  # begins names of what objects are made of, as __doc__ and __globals__
ELSEWHERE = {
    *("IMPORT_NAME", "STORE_GLOBAL", "DELETE_GLOBAL", "LOAD_NAME", "LOAD_BUILD_CLASS"),
    INSIDE,
}
MISSING = object()

Chain = tuple[str, ...]


class Open(Exception):
    """What is read may change without being seen."""


@dataclass
class Met:
    """What was met while reading: functions, by their places, and how many bytes of values."""

    functions: dict[FunctionType, int] = field(default_factory=dict)
    size: int = 0

    def count(self, size: int) -> None:
        """Count what is read; refuse too much."""
        self.size += max(size, ENTRY)
        if self.size > LARGE:
            raise Open


def told(value: Any) -> Hashable:
    """Return what tells a value from others.

    Raises:
        Open: it may change unseen, or is too large to compare.
    """
    try:
        return told_in(Met(), value)
    except RecursionError:  # a container of itself
        raise Open from None


def captured(met: Met, function: FunctionType) -> Hashable:
    """Return what tells a function from others that do something else: where it was met before, its
    place."""
    if function in met.functions:
        return met.functions[function]
    met.functions[function] = len(met.functions)
    if type(function.__globals__) is not dict:
        raise Open
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    closure = {name: content(cell) for name, cell in cells}
    scopes = function.__globals__, function.__builtins__
    given = function.__defaults__, function.__kwdefaults__, vars(function)
    read = [
        told_in(met, reached(chain, *((closure,) if opcode == CELL else scopes)))
        for opcode, chain in chains(function.__code__)
    ]
    return function.__code__, told_in(met, given), *read


def content(cell: Any) -> Any:
    """Return what a captured variable holds."""
    try:
        return cell.cell_contents
    except ValueError:
        return MISSING


def reached(chain: Chain, *scopes: dict[str, Any]) -> Any:
    """Return what a name leads to in the first scope that has it, with the attributes behind it as
    long as it is a module."""
    name, *others = chain
    found = next((scope[name] for scope in scopes if name in scope), MISSING)
    for other in others:
        if not isinstance(found, ModuleType):
            break
        found = getattr(found, other, MISSING)
    return found


@lru_cache(maxsize=1024)
def chains(code: CodeType) -> tuple[tuple[str, Chain], ...]:
    """Return what code reads by name, and functions that it makes: how, and the chain of names."""
    found = dict.fromkeys(read_in(code))
    if any(opcode in ELSEWHERE or opcode in WRITTEN for opcode, _ in found):
        raise Open
    return tuple(found)


def read_in(code: CodeType) -> Iterator[tuple[str, Chain]]:
    """Yield what code reads by name, with the attributes that are read of it at once."""
    steps = list(dis.get_instructions(code))
    for place, step in enumerate(steps):
        if step.opname in ELSEWHERE:
            yield step.opname, ()
        if step.opname in WRITTEN and step.argval in code.co_freevars:
            yield step.opname, (step.argval,)
        if step.opname == GLOBAL or (step.opname == CELL and step.argval in code.co_freevars):
            behind = takewhile(lambda own: own.opname in FURTHER, steps[place + 1 :])
            yield step.opname, (step.argval, *(own.argval for own in behind))
    if any(name.startswith(INSIDE) for name in code.co_names):
        yield INSIDE, ()
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            for opcode, chain in read_in(inner):
                if opcode not in (CELL, *WRITTEN) or chain[0] in code.co_freevars:
                    yield opcode, chain


def told_in(met: Met, value: Any) -> Hashable:
    """Return what tells a value from others, behind what was met."""
    kind = type(value)
    # Numbers, text and arrays as they are now.
    if kind in PLAIN or kind in BY_DIGITS:
        met.count(sys.getsizeof(value))
        return kind, repr(value) if kind in BY_DIGITS else value
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.hasobject or vars(np).get(kind.__name__) is not kind:
            raise Open
        met.count(value.nbytes)
        return kind, value.shape, value.strides, repr(value.dtype), value.tobytes()
    # What holds others.
    if kind in (list, tuple, set, frozenset):
        met.count(sys.getsizeof(value))
        return kind, *(told_in(met, each) for each in value)
    if kind is dict:
        return kind, told_in(met, list(value.items()))
    if kind is slice:
        return kind, told_in(met, (value.start, value.stop, value.step))
    if kind is partial:
        return kind, told_in(met, (value.func, value.args, value.keywords, vars(value)))
    # What does, and is, the same for ever.
    if value is MISSING or memoryless(value):
        return value
    if isinstance(value, FunctionType):
        return captured(met, value)
    if of_package(value) and frozen(kind):
        own = (getattr(value, field.name) for field in fields(value) if field.init)
        return value, *(told_in(met, each) for each in own)
    raise Open


def frozen(kind: Any) -> bool:
    """Tell whether a class is one of data that do not change."""
    return is_dataclass(kind) and kind.__dataclass_params__.frozen  # pyright: ignore


def memoryless(value: Any) -> bool:
    """Tell whether a value is a function, or a type, that always does the same."""
    if isinstance(value, type | BuiltinFunctionType) and value in MEMORYLESS:
        return True
    if not isinstance(value, FUNCTIONS) or value.__name__ in OUTSIDE:
        return False
    libraries = (sys.modules[name] for name in LIBRARIES if name in sys.modules)
    found = any(vars(library).get(value.__name__) is value for library in libraries)
    return found and written_there(value)


def written_there(value: Any) -> bool:
    """Tell whether a function of a library is its own, and none of the user's in its place."""
    if isinstance(value, FunctionType):  # its code's module: `functools.wraps` copies its own
        own = value.__globals__.get("__name__", "").partition(".")[0] in PACKAGES
        return own and not vars(value)
    return isinstance(value, np.ufunc) or value.__module__ in LIBRARIES
