"""The numbers of a description, by path: "platform.mass", "link_1.com.x",
"pivot_1.frames.0.position.y", "gravity.z".

A path names a body, joint, spring, transmission or tool and then fields as they stand in a
mechanism file; `com` is short for `centre_of_mass`, and the entries of a list are 0, 1, ... (x, y,
z in a vector). Where a body and a joint, say, share a name, the section goes before it:
"joints.platform.friction.viscous".

A number that enters the equations of motion may be free, that is, a symbol whose value is chosen
later. Frames turn by free numbers (`rotation`, `turn`); axes in them, which are of unit length,
stay: the two tilts of an axis and the offset of its zero are turns of the joint's frames. Nor may
limits, the reference and tasks of tools be free, which enter no equation, nor the shapes of bodies,
nor what decides the form of a force.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from linkwork.mechanism.effects import Friction, Spring
from linkwork.mechanism.joints import ManyFreedoms
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.record import Record
from linkwork.mechanism.refusal import MechanismError, shown, suggestion

SECTIONS = ("bodies", "joints", "springs", "contacts", "lifts", "drags", "transmissions", "tools")
SHORT = {"com": "centre_of_mass"}
COMPONENTS = {"x": "0", "y": "1", "z": "2"}
DIRECTIONS = ("axis", "axes")
OUTSIDE = ("limits", "reference", "shapes", "task", "drives")
FORMS = ("exponent", "restitution")

Where = tuple[str, ...]


class NoNumberError(Exception):
    """Report that a path ends before it reaches a number; `depth`: how many of its parts lead
    somewhere."""

    def __init__(self, depth: int, what: str):
        self.depth = depth
        super().__init__(what)


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
        fields = {where[0], *where[2:]}  # without the element's name
        if not fields.isdisjoint(OUTSIDE):
            raise MechanismError(
                f"{shown(path)} enters no equation of motion and cannot be free; change the "
                "description"
            )
        if not fields.isdisjoint(DIRECTIONS):
            raise MechanismError(
                f"{shown(path)} is part of a direction and cannot be free; free turns of the "
                "frames that it stands in, such as frames.0.turn.x"
            )
        if not fields.isdisjoint(FORMS):
            raise MechanismError(
                f"{shown(path)} decides the form of a force and cannot be free; free stiffness, "
                "dissipation or impact_rate"
            )
        if "radii" in fields:
            raise MechanismError(
                f"{shown(path)} decides how much fluid moves along and cannot be free; free "
                "fluid.density, fluid.viscosity or the drag's coefficients"
            )
        if where in places:
            raise MechanismError(
                f"{shown(places[where])} and {shown(path)} are the same number; name it once"
            )
        places[where], values[path] = path, value
    return values


def replaced(mechanism: Mechanism, values: Mapping[str, Any]) -> Mechanism:
    """Return the description with other values at some paths, unchecked."""
    for path, value in values.items():
        mechanism = _replaced(mechanism, located(mechanism, path)[0], value)
    return mechanism


def edited(mechanism: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """Return the description with other numbers at some paths.

    Raises:
        MechanismError: numbers that a description may not hold: a negative mass, moments of inertia
            of no body.
    """
    result = replaced(mechanism, values)
    Mechanism(**result.model_dump())
    return result


def located(mechanism: Mechanism, path: str) -> tuple[Where, float]:
    """Return where in a mechanism a path leads to, field by field, and the number there."""
    if not isinstance(path, str):
        raise MechanismError(
            f"{shown(path)} is no path of a number; give one such as 'platform.mass'"
        )
    parts, found, dead_ends = tuple(path.split(".")), [], []
    for section in ((), *((name,) for name in SECTIONS)):
        try:
            found.append(_follow(mechanism, (*section, *parts), ()))
        except NoNumberError as error:
            dead_ends.append((error.depth - len(section), str(error)))
    if not found:
        raise MechanismError(
            f"{shown(path)} leads to no number: {max(dead_ends, key=lambda end: end[0])[1]}"
        )
    if len(found) > 1:
        spelled = " or ".join(repr(".".join(where)) for where, _ in found)
        raise MechanismError(f"{shown(path)} may mean several numbers; write {spelled}")
    return found[0]


def _follow(item: Any, parts: Where, before: Where) -> tuple[Where, float]:
    """Follow the parts of a path from an item of the description; before: the way that led to
    it."""
    inside = contents(item)
    if not parts:
        if isinstance(item, float):
            return before, item
        needs = f"go on with {', '.join(inside)}" if inside else "there is none"
        raise NoNumberError(len(before), f"{'.'.join(before)} is not one; {needs}")
    for count in range(1, len(parts) + 1):
        key = ".".join(parts[:count])
        key = SHORT.get(key, key) if isinstance(item, Record) else key
        key = COMPONENTS.get(key, key) if isinstance(item, tuple) else key
        if key in inside:
            return _follow(inside[key], parts[count:], (*before, key))
    holds = f"it holds {', '.join(inside)}" if inside else "it holds nothing"
    raise NoNumberError(
        len(before),
        (
            f"{'.'.join(before) or 'the mechanism'} has no "
            f"{parts[0]!r}{suggestion(parts[0], inside)}; {holds}"
        ),
    )


def contents(item: Any) -> dict[str, Any]:
    """Return what an item holds, by field, name or index; what a joint leaves out of its freedoms
    is zero."""
    if isinstance(item, Record):
        fields = {name: getattr(item, name) for name in type(item).model_fields}
        if isinstance(item, ManyFreedoms):
            for field, default in (
                ("friction", Friction()),
                ("spring", Spring()),
                ("rotor_inertia", 0.0),
            ):
                fields[field] = dict.fromkeys(item.freedoms, default) | fields[field]
        return fields
    if isinstance(item, Mapping):
        return dict(item)
    return {str(index): part for index, part in enumerate(item)} if isinstance(item, tuple) else {}


def _replaced(item: Any, where: Where, value: Any) -> Any:
    """Return an item with another value at a place in it."""
    if not where:
        return value
    inside = contents(item)
    part = _replaced(inside[where[0]], where[1:], value)
    if isinstance(item, Record):
        return item.model_copy(update={where[0]: part})
    inside[where[0]] = part
    return tuple(inside.values()) if isinstance(item, tuple) else inside
