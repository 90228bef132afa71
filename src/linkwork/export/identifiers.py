"""Names of a description as names that C can hold.

What is neither a letter of ASCII, a digit nor an underscore becomes an underscore; names that
become equal are numbered.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from linkwork.errors import LinkworkError

WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while and asm bool catch class delete explicit export false friend
mutable namespace new not operator or private protected public template this throw true try
typeid typename using virtual xor
"""
KEYWORDS = frozenset(WORDS.split())
"""Words that C or C++ keep for themselves."""
LONGEST = 40  # letters of a prefix


def identifier(name: str) -> str:
    """Return a name as C can hold it, where it stands behind a prefix."""
    found = re.sub(r"_{2,}", "_", re.sub(r"[^A-Za-z0-9_]", "_", name)).strip("_")
    return found or "unnamed"


def identifiers(names: Iterable[str], upper: bool = False) -> dict[str, str]:
    """Return different identifiers for names, upper: in capitals."""
    found: dict[str, str] = {}
    for name in names:
        wanted = identifier(name).upper() if upper else identifier(name)
        if wanted[0].isdigit() or wanted in KEYWORDS:
            wanted = f"_{wanted}" if upper else f"n_{wanted}"
        count, unique = 1, wanted
        while unique in found.values():
            count += 1
            unique = f"{wanted}_{count}"
        found[name] = unique
    return found


def prefix(name: str) -> str:
    """Return what all names of an export begin with, for a robot of that name."""
    own = identifier(name).lower()[:LONGEST].rstrip("_")
    return own if own[0].isalpha() and own not in KEYWORDS else f"robot_{own}"


def given_prefix(name: object) -> str:
    """Return a name that a user gives for all that begins with it; refuse what C cannot hold."""
    held = isinstance(name, str) and re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name)
    if isinstance(name, str) and held and name.lower() not in KEYWORDS:
        return name
    raise LinkworkError(
        f"the name {name!r} cannot begin names of C; give letters, digits and single underscores, "
        "a letter first"
    )


def named(text: str, own: str) -> str:
    """Return text with an export's own name in place of lw."""
    text = text.replace("LW_FILE", own)
    return re.sub(r"\blw_", f"{own}_", re.sub(r"\bLW_", f"{own.upper()}_", text))
