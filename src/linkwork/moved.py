"""Names that have moved: the former one leads to the new one, with a warning."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Container, Mapping
from importlib import import_module
from typing import Any


def leading_to(old: str, new: str, names: Container[str] | None = None) -> Callable[[str], Any]:
    """Return a `__getattr__` for the module `old` that takes names, all or these, from the module
    `new`."""

    def found(name: str) -> Any:
        if names is not None and name not in names:
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        value = getattr(import_module(new), name)
        warnings.warn(f"{old} is {new} now", DeprecationWarning, stacklevel=2)
        return value

    return found


def renamed(module: str, names: Mapping[str, tuple[str, str, str]]) -> Callable[[str], Any]:
    """Return a `__getattr__` for a module some names of which are others now.

    names: by the former name where the thing is, module and name, and what it is called now
    """

    def found(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, own, now = names[name]
        warn(f"{module}.{name}", now, stacklevel=3)
        return getattr(import_module(place), own)

    return found


def warn(former: str, now: str, stacklevel: int = 3) -> None:
    """Warn whoever uses a former name, so many levels above, of the present one."""
    warnings.warn(f"{former} is {now} now", DeprecationWarning, stacklevel)
