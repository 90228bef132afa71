"""Controllers and goals in words: the records of study files, on one line of the command line.

    pd kp=400 kd=40             pid kp.slide_1=300 kp.slide_2=200 kd=30 ki=50
    circle centre=0.45,0.29 radius=0.05 orientation=1.2
    through poses=0.4,0.3,1.2;0.5,0.3,1.2;0.5,0.35,1.2;0.4,0.35,1.2

The first word is the type, others are fields: numbers, "," between those of a list and ";" between
lists; field.name gives a value by name. Lengths and angles of goals may have units
(`cli/measured_words.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from linkwork.checks import suggestion
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import MechanismError, Record

Kind = TypeVar("Kind", bound=Record)
Fields = dict[str, Any]  # texts by name, and by the part of a name
Reader = Callable[[Fields, str], dict[str, Any]]


def record_of(
    text: str,
    option: str,
    kinds: Mapping[str, type[Kind]],
    read: Reader | None = None,
    **given: Any,
) -> Kind:
    """Return the record that a text tells.

    kinds: records by the word for their type; read: what makes values of the fields' texts, plain
    ones if left out; given: fields beside those of the text

    Raises:
        LinkworkError: no such type, a field that the type has not or that lacks, another kind of
            value; the sentence begins with the option.
    """
    word, *pairs = text.split() or [""]
    if word not in kinds:
        raise LinkworkError(
            f"{option}: there is no {word!r}{suggestion(word, kinds)}; give one of "
            f"{', '.join(kinds)}, then name=value for each of its numbers"
        )
    try:
        return kinds[word](**(read or values)(fields(pairs, option), option), **given)
    except MechanismError as error:
        raise LinkworkError(f"{option}: {word}: {error}") from None


def fields(pairs: list[str], option: str) -> Fields:
    """Return the texts of the fields of "name=value" and "name.part=value"."""
    found: dict[str, Any] = {}
    for pair in pairs:
        path, equals, text = pair.partition("=")
        if not equals or not path:
            raise LinkworkError(f"{option}: {pair!r} has no name; write name=value")
        name, _, part = path.partition(".")
        within = found.setdefault(name, {}) if part else found
        if not isinstance(within, dict) or (part or name) in within:
            raise LinkworkError(f"{option}: {name!r} is given twice; keep one of them")
        within[part or name] = text
    return found


def values(fields: Fields, option: str) -> dict[str, Any]:
    """Return the values of texts by name, as they are."""
    return {
        name: values(text, option) if isinstance(text, dict) else value(text)
        for name, text in fields.items()
    }


def value(text: str) -> Any:
    """Return a number, a list of numbers, or of lists; other text as it is."""
    if ";" in text:
        return [[part] if isinstance(part, float) else part for part in map(value, text.split(";"))]
    if "," in text:
        return [value(part) for part in text.split(",")]
    try:
        return float(text)
    except ValueError:
        return text
