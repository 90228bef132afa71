"""Docstrings of classes name fields by lines "name: meaning" or "name, name: meaning"; the site
shows these as lists.

Controllers and drives describe their numbers themselves: their docstrings are taken as the running
classes have them.
"""

import inspect
import pydoc
import re
from typing import Any

import griffe

from linkwork.control.records import ActingPart

CONTROL = "linkwork.control."
FIELDS = re.compile(r"^(?!Sources?:|Note:)(`?\w+`?(?:, `?\w+`?)*): (?=\S)", re.M)


class Lists(griffe.Extension):
    """Turn lines that name fields into list items; lines that go on are part of their item."""

    def on_class(self, *, cls: griffe.Class, **kwargs: Any) -> None:
        if cls.docstring:
            kind = pydoc.locate(cls.path) if cls.path.startswith(CONTROL) else None
            if isinstance(kind, type) and issubclass(kind, ActingPart):
                cls.docstring.value = inspect.cleandoc(kind.__doc__ or "")
            cls.docstring.value = listed(cls.docstring.value)


def listed(text: str) -> str:
    """Return a docstring whose named fields are a list, each name as code."""

    def item(match: re.Match) -> str:
        names = (f"`{name.strip('`')}`" for name in match[1].split(", "))
        return f"- {', '.join(names)}: "

    lines = FIELDS.sub(item, text).split("\n")
    spaced = [
        f"\n{line}" if line.startswith("- ") and before and not before.startswith("- ") else line
        for before, line in zip(["", *lines], lines, strict=False)
    ]
    return "\n".join(spaced)
