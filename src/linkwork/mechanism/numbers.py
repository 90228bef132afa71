"""The numbers of a description, by path: "platform.mass", "link_1.com.x",
"pivot_1.frames.0.position.y", "gravity.z".

A path names a body, joint, spring, transmission or tool and then fields as they stand in a
mechanism file; `com` is short for `centre_of_mass`, and the entries of a list are 0, 1, ... (x, y,
z in a vector). Where a body and a joint, say, share a name, the section goes before it:
"joints.platform.friction.viscous".

A named quantity is "let.rod", or "rod"; what follows from it by formulas moves with it, and has no
value of its own.

A number that enters the equations of motion may be free, that is, a symbol whose value is chosen
later. Frames turn by free numbers (`rotation`, `turn`); axes in them, which are of unit length,
stay: the two tilts of an axis and the offset of its zero are turns of the joint's frames. Nor may
limits, the reference and tasks of tools be free, which enter no equation, nor the shapes of bodies,
nor what decides the form of a force.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from linkwork.mechanism.formulas import names_in
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.places import SECTIONS as SECTIONS
from linkwork.mechanism.places import Where, contents, located, placed
from linkwork.mechanism.quantities import borne, reworked
from linkwork.mechanism.record import swapped
from linkwork.mechanism.refusal import MechanismError, shown

__all__ = [
    "SECTIONS",
    "Where",
    "contents",
    "edited",
    "free_numbers",
    "located",
    "places_of",
    "replaced",
]
DIRECTIONS = ("axis", "axes")
OUTSIDE = ("limits", "reference", "shapes", "task", "drives")
FORMS = ("exponent", "restitution")


def free_numbers(mechanism: Mechanism, paths: Iterable[str]) -> dict[str, float]:
    """Return the values of numbers that are to be free, by path as given.

    Raises:
        MechanismError: a path that leads to no number, to one that cannot be free, or to the same
            one as another.
    """
    places: dict[Where, str] = {}
    values = {}
    for path in paths:
        where, value = located(mechanism, path)
        refuse_following(mechanism, where, path)
        bearing = places_of(mechanism, path)
        for place in bearing:
            if fault := fault_of(place):
                by = "" if place == where else f" bears on {'.'.join(place)}, which"
                raise MechanismError(f"{shown(path)}{by} {fault}")
        if all(enters_nothing(place) for place in bearing):
            raise MechanismError(
                f"{shown(path)} enters no equation of motion and cannot be free; change the "
                "description"
            )
        if where in places:
            raise MechanismError(
                f"{shown(places[where])} and {shown(path)} are the same number; name it once"
            )
        places[where], values[path] = path, value
    return values


def places_of(mechanism: Mechanism, path: str) -> tuple[Where, ...]:
    """Return the places of the numbers that a path stands for: its own, or those that follow from a
    named quantity."""
    where = located(mechanism, path)[0]
    return tuple(borne(mechanism, where)) if where[0] == "let" else (where,)


def refuse_following(mechanism: Mechanism, where: Where, path: str) -> None:
    """Refuse the path of a number that follows from named quantities."""
    text = mechanism.formulas.get(".".join(where), "")
    if text and names_in(text):
        raise MechanismError(
            f"{shown(path)} follows from the formula {shown(text)} and has no value of its own; "
            "change or free the quantities that it names"
        )


def without(mechanism: Mechanism, where: Where) -> Mechanism:
    """Return a mechanism without the formula of a number, such as 30 deg, if it has one."""
    path = ".".join(where)
    if path not in mechanism.formulas:
        return mechanism
    kept = {other: text for other, text in mechanism.formulas.items() if other != path}
    return swapped(mechanism, formulas=kept)


def enters_nothing(where: Where) -> bool:
    """Tell whether a number enters no equation of motion."""
    return not {where[0], *where[2:]}.isdisjoint(OUTSIDE)


def fault_of(where: Where) -> str:
    """Return why a number of the equations of motion cannot be free; empty where it can."""
    fields = {where[0], *where[2:]}  # without the element's name
    if enters_nothing(where):
        return ""
    if not fields.isdisjoint(DIRECTIONS):
        return (
            "is part of a direction and cannot be free; free turns of the frames that it stands "
            "in, such as frames.0.turn.x"
        )
    if not fields.isdisjoint(FORMS):
        return (
            "decides the form of a force and cannot be free; free stiffness, dissipation or "
            "impact_rate"
        )
    if "radii" in fields:
        return (
            "decides how much fluid moves along and cannot be free; free fluid.density, "
            "fluid.viscosity or the drag's coefficients"
        )
    return ""


def replaced(mechanism: Mechanism, values: Mapping[str, Any]) -> Mechanism:
    """Return the description with other values at some paths, unchecked; what follows from named
    quantities follows.

    Raises:
        MechanismError: a number that follows from a formula, which is not given.
    """
    changed = set()
    for path, value in values.items():
        where, _ = located(mechanism, path)
        refuse_following(mechanism, where, path)
        mechanism = placed(without(mechanism, where), where, value)
        changed |= {where[1]} if where[0] == "let" else set()
    return reworked(mechanism, changed) if changed else mechanism


def edited(mechanism: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """Return the description with other numbers at some paths.

    Raises:
        MechanismError: numbers that a description may not hold: a negative mass, moments of inertia
            of no body.
    """
    result = replaced(mechanism, values)
    Mechanism(**result.model_dump())
    return result
