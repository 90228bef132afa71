"""The public names' docstrings tell each of their arguments, or those of their class do."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from typing import Any

import linkwork as lw

MOVED = {"engines", "textbook"}  # these lead to others, with a warning


def public() -> Iterator[Any]:
    """Yield the functions, and the methods of the classes, of all packages' public names."""
    names = {module.name for module in pkgutil.iter_modules(lw.__path__)} - MOVED
    found = [importlib.import_module(f"linkwork.{name}") for name in names if name[0] != "_"]
    for module in (lw, *found):
        for thing in (getattr(module, name) for name in getattr(module, "__all__", ())):
            if not inspect.isclass(thing):
                yield thing
                continue
            for kind in thing.__mro__:
                if kind.__module__.startswith("linkwork."):
                    own = {name: each for name, each in vars(kind).items() if name[0] != "_"}
                    yield from (getattr(each, "__func__", each) for each in own.values())


def untold(function: Any) -> list[str]:
    """Return the arguments that neither a function's docstring nor its class's names."""
    taken = inspect.signature(function).parameters.values()
    held = sys.modules[function.__module__]
    owner = getattr(held, function.__qualname__.partition(".")[0], None)
    kinds = owner.__mro__ if inspect.isclass(owner) else ()
    told = "\n".join(inspect.getdoc(each) or "" for each in (function, *kinds))
    several = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    names = [each.name for each in taken if each.kind not in several]
    known = {"self", "cls"}
    return [name for name in names if not (name in known or re.search(rf"\b{name}\b", told))]


def test_each_argument_of_a_public_name_is_told():
    functions = {
        f"{each.__module__}.{each.__qualname__}": each
        for each in public()
        if inspect.isfunction(each) and each.__module__.startswith("linkwork.")
    }
    assert len(functions) > 400
    assert {name: left for name, each in functions.items() if (left := untold(each))} == {}
