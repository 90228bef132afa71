"""Pieces of C that are the same in all exports, with lw for the prefix."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources

from linkwork.export.statements import Dialect

_FUNCTIONS = r"\b(fabs|fma|sin|cos|pow)\("


def filled(name: str, dialect: Dialect, words: Mapping[str, str] | None = None) -> str:
    """Return a piece with the C library's functions in the precision that is wanted, and words in
    place of others."""
    text = resources.files("linkwork.export.templates").joinpath(name).read_text(encoding="utf-8")
    for word, other in (words or {}).items():
        text = re.sub(rf"\b{word}\b", lambda _, other=other: other, text)
    text = text.replace(" , ", ", ").replace(" )", ")").replace(" ,\n", ",\n")
    text = re.sub(r"^//.*\n", "", text, flags=re.MULTILINE)
    return re.sub(_FUNCTIONS, rf"\1{dialect.suffix}(", text)
