"""Captured: all that a Python function reads beside its arguments, by value.

Its code reads by name: captured variables, globals, builtins, and attributes of modules, to which a
chain of names leads. Functions with equal code, defaults and values of these do the same. Read are
numbers, text, arrays and containers of them as they are now, functions of the user's own by what
they read in turn, and functions of `math`, NumPy and `linkwork.math` as such. All else may change
unseen: an object of the user's own, a random source, a file. Such a function is `Open`.
"""

from __future__ import annotations

import builtins
import dis
from collections.abc import Hashable, Iterator
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from itertools import takewhile
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from linkwork.simulation import Sampled, Signal

PACKAGE = __name__.partition(".")[0]
LARGE = 2**20  # bytes of an array from which on it is not compared
PLAIN = bool, int, float, complex, str, bytes, type(None), slice, range
LIBRARIES = "math", "cmath", "numpy", "numpy.linalg", "linkwork.math"
FILES = "load", "loadtxt", "genfromtxt", "fromfile", "fromregex", "memmap"
MEMORYLESS = {
    *(abs, all, any, bool, complex, dict, divmod, enumerate, filter, float, frozenset, int),
    *(isinstance, len, list, map, max, min, pow, range, reversed, round, set, slice, sorted),
    *(str, sum, tuple, zip),
}
FUNCTIONS = type, FunctionType, BuiltinFunctionType, type(np.dot)
GLOBAL, CELL = "LOAD_GLOBAL", "LOAD_DEREF"
FURTHER = "LOAD_ATTR", "LOAD_METHOD"
ELSEWHERE = {"IMPORT_NAME", "STORE_GLOBAL", "DELETE_GLOBAL", "LOAD_NAME", "LOAD_BUILD_CLASS"}
MISSING = object()

Chain = tuple[str, ...]


class Open(Exception):
    """What is read may change without being seen."""


def captured(function: FunctionType, within: tuple[FunctionType, ...] = ()) -> Hashable:
    """Return what tells a function from others that do something else.

    within: the functions that read it.

    Raises:
        Open: it reads what may change unseen.
    """
    if function in within:
        return within.index(function)
    within += (function,)
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    closure = {name: content(cell) for name, cell in cells}
    given = function.__defaults__, function.__kwdefaults__, vars(function)
    read = [
        told(reached(chain, closure if opcode == CELL else function.__globals__), within)
        for opcode, chain in chains(function.__code__)
    ]
    return function.__code__, told(given, within), *read


def content(cell: Any) -> Any:
    """Return what a captured variable holds."""
    try:
        return cell.cell_contents
    except ValueError:
        return MISSING


def reached(chain: Chain, names: dict[str, Any]) -> Any:
    """Return what a name leads to, with the attributes behind it as long as it is a module."""
    name, *others = chain
    found = names.get(name, getattr(builtins, name, MISSING))
    for other in others:
        if not isinstance(found, ModuleType):
            break
        found = getattr(found, other, MISSING)
    return found


@lru_cache(maxsize=1024)
def chains(code: CodeType) -> tuple[tuple[str, Chain], ...]:
    """Return what code reads by name, and functions that it makes: how, and the chain of names."""
    found = dict.fromkeys(read_in(code))
    if any(opcode in ELSEWHERE for opcode, _ in found):
        raise Open
    return tuple(found)


def read_in(code: CodeType) -> Iterator[tuple[str, Chain]]:
    """Yield what code reads by name, with the attributes that are read of it at once."""
    steps = list(dis.get_instructions(code))
    for place, step in enumerate(steps):
        if step.opname in ELSEWHERE:
            yield step.opname, ()
        if step.opname == GLOBAL or (step.opname == CELL and step.argval in code.co_freevars):
            behind = takewhile(lambda own: own.opname in FURTHER, steps[place + 1 :])
            yield step.opname, (step.argval, *(own.argval for own in behind))
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            for opcode, chain in read_in(inner):
                if opcode != CELL or chain[0] in code.co_freevars:
                    yield opcode, chain


def told(value: Any, within: tuple[FunctionType, ...] = ()) -> Hashable:
    """Return what tells a value from others; refuse one that may change unseen."""
    kind = type(value)
    if kind in PLAIN:
        return kind, repr(value)
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.hasobject or value.nbytes > LARGE or kind.__module__ != "numpy":
            raise Open
        return kind, value.shape, value.dtype.str, value.tobytes()
    if kind in (list, tuple):
        return kind, *(told(each, within) for each in value)
    if kind in (set, frozenset):
        return kind, frozenset(told(each, within) for each in value)
    if kind is dict:
        pairs = ((told(name, within), told(of, within)) for name, of in value.items())
        return kind, *pairs
    if isinstance(value, Sampled | Signal) or value is MISSING or memoryless(value):
        return value
    if kind is partial:
        return kind, told((value.func, value.args, value.keywords), within)
    if isinstance(value, FunctionType):
        return captured(value, within)
    if is_dataclass(kind) and kind.__module__.partition(".")[0] == PACKAGE:
        own = (getattr(value, field.name) for field in fields(value) if field.init)
        return value, *(told(each, within) for each in own)
    raise Open


def memoryless(value: Any) -> bool:
    """Tell whether a value is a function, or a type, that always does the same."""
    if isinstance(value, np.ufunc):
        return getattr(np, value.__name__, None) is value
    if isinstance(value, type | BuiltinFunctionType) and value in MEMORYLESS:
        return True
    if not isinstance(value, FUNCTIONS) or value.__module__ not in LIBRARIES:
        return False
    bound = getattr(value, "__self__", None)
    return value.__name__ not in FILES and (bound is None or isinstance(bound, ModuleType))
