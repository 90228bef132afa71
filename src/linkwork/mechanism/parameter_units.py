"""Units of free parameters, as the descriptions of their fields state them."""

from __future__ import annotations

import re

from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import SLIDES
from linkwork.mechanism.numbers import contents, located

BRACKETS = re.compile(r"\[([^\]]*)\]")
FOR_SLIDES = " for a slide"


def unit_of_parameter(mechanism: Mechanism, path: str) -> str:
    """Return the unit of a number of a description by its path; empty where it has none, or is
    none of the description's."""
    try:
        where, _ = located(mechanism, path)
    except LinkworkError:
        return ""
    item: object = mechanism
    told = ""
    for part in where:
        field = getattr(type(item), "model_fields", {}).get(part)
        if field is not None:
            found = BRACKETS.search(field.description or "")
            told = found[1] if found else ""
        item = contents(item)[part]
    return _chosen(told, _slides(mechanism, where))


def with_unit(mechanism: Mechanism, path: str, text: str) -> str:
    """Return a text about a number with its unit behind it."""
    unit = unit_of_parameter(mechanism, path)
    return f"{text} {unit}" if unit else text


def _slides(mechanism: Mechanism, where: tuple[str, ...]) -> bool | None:
    """Tell whether what a number belongs to slides, or turns; None where that is not told."""
    if where[0] != "joints":
        return None
    freedoms = [part.name for part in mechanism.joints[where[1]].parts(where[1])]
    own = freedoms if len(freedoms) == 1 else [name for name in freedoms if name in where]
    return own[0] in SLIDES if own else None


def _chosen(told: str, slides: bool | None) -> str:
    """Return the unit out of those for lengths and for angles."""
    if told.endswith(FOR_SLIDES):
        turning, _, sliding = told.removesuffix(FOR_SLIDES).partition("; ")
        linear, angular = sliding, turning
    else:
        linear, _, angular = told.partition(", ")
    if slides is None or not angular:
        return told
    return linear if slides else angular
