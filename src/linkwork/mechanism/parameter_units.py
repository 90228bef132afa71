"""Units and least values of free parameters, as the descriptions of their fields state them."""

from __future__ import annotations

import re
from sys import float_info

from linkwork.errors import LinkworkError
from linkwork.mechanism import formulas as formula
from linkwork.mechanism.joints import SLIDES
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.places import Where, contents, located
from linkwork.mechanism.quantities import own_formulas
from linkwork.mechanism.refusal import MechanismError, shown

BRACKETS = re.compile(r"\[([^\]]*)\]")
FOR_SLIDES = " for a slide"


def unit_of_parameter(mechanism: Mechanism, path: str) -> str:
    """Return the unit of a number of a description by its path; empty where it has none, or is
    none of the description's."""
    try:
        where, _ = located(mechanism, path)
    except LinkworkError:
        return ""
    if where[0] == "let":
        return next(iter(units_of_quantity(mechanism, where[1])), "")
    return unit_at(mechanism, where)


def unit_at(mechanism: Mechanism, where: Where) -> str:
    """Return the unit of the number at a place, as its field states it."""
    item: object = mechanism
    told = ""
    for part in where:
        field = getattr(type(item), "model_fields", {}).get(part)
        if field is not None:
            found = BRACKETS.search(field.description or "")
            told = found[1] if found else ""
        item = contents(item)[part]
    return _chosen(told, _slides(mechanism, where))


def least_of_parameter(mechanism: Mechanism, path: str) -> float | None:
    """Return the least number that a description may hold at a path, 0 or the smallest above; None
    where negative ones are allowed, or are told only by what follows from the number."""
    item: object = mechanism
    found = None
    for part in located(mechanism, path)[0]:
        field = getattr(type(item), "model_fields", {}).get(part)
        if field is not None:
            zeros = [k for each in field.metadata for k in ("ge", "gt") if getattr(each, k, 1) == 0]
            found = float_info.min if "gt" in zeros else 0.0 if zeros else None
        item = contents(item)[part]
    return found


def units_of_quantity(mechanism: Mechanism, name: str) -> dict[str, str]:
    """Return the units that a named quantity has where a number is a sum of multiples of it, each
    with the path of such a number."""
    found: dict[str, str] = {}
    own = own_formulas(mechanism)
    if name in own and formula.is_angle(formula.parsed(own[name])):
        found["rad"] = f"let.{name}"
    for path, text in mechanism.formulas.items():
        if name in formula.multiples(formula.parsed(text)):
            section, _, other = path.partition(".")
            if section == "let":
                found = units_of_quantity(mechanism, other) | found
            elif unit := unit_at(mechanism, located(mechanism, path)[0]):
                found.setdefault(unit, path)
    return found


def refuse_units(mechanism: Mechanism) -> None:
    """Refuse formulas whose units do not fit their places, or each other.

    Raises:
        MechanismError: an angle in degrees where no angle stands, or a quantity that is a length in
            one place and a mass, say, in another.
    """
    for path, text in mechanism.formulas.items():
        where = located(mechanism, path)[0]
        unit = "" if where[0] == "let" else unit_at(mechanism, where)
        if formula.is_angle(formula.parsed(text)) and unit and "rad" not in unit.split(", "):
            raise MechanismError(
                f"{shown(text)} is an angle, and a number in {unit} stands here", where
            )
    for name in mechanism.let if mechanism.formulas else ():
        units = units_of_quantity(mechanism, name)
        if len(units) > 1:
            (one, first), (two, second), *_ = units.items()
            raise MechanismError(
                f"is in {one} in {first} and in {two} in {second}; name two quantities",
                ("let", name),
            )


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
