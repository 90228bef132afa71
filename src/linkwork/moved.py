"""Names that have moved: the former one leads to the new one, with a warning."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Container
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
