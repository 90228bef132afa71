"""Small functions and constants of C, of which each file gets those that it uses."""

from __future__ import annotations

import re
from collections.abc import Sequence

OWN = (
    "static lw_real lw_least(lw_real a, lw_real b) { return a < b || b != b ? a : b; }\n",
    "static lw_real lw_most(lw_real a, lw_real b) { return a > b || b != b ? a : b; }\n",
    "static lw_real lw_sign(lw_real a)\n"
    "{\n    return a > 0 ? (lw_real)1 : a < 0 ? (lw_real)-1 : a;\n}\n",
)
"""Functions that the C library has in slow forms, or not at all."""


def used(definitions: Sequence[str], body: str) -> list[str]:
    """Return the definitions whose names stand in a body, or in one of them that is used later."""
    found: list[str] = []
    for text in reversed(definitions):
        if re.search(rf"\b{head(text)}\b", body):
            found.insert(0, text)
            body += text
    return found


def head(text: str) -> str:
    """Return the name that a definition gives."""
    return re.findall(r"#define (\w+)|(\blw_\w+)[\[(]", text)[0][text.startswith("static")]
