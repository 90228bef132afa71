"""Places of a description: the paths of its numbers, followed field by field, and what stands
there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from linkwork.mechanism.effects import Friction, Spring
from linkwork.mechanism.joints import ManyFreedoms
from linkwork.mechanism.record import Record, swapped
from linkwork.mechanism.refusal import MechanismError, shown, suggestion

SECTIONS = (
    *("bodies", "joints", "springs", "contacts", "lifts", "drags", "transmissions", "tools"),
    "let",
)
SHORT = {"com": "centre_of_mass"}
COMPONENTS = {"x": "0", "y": "1", "z": "2"}

Where = tuple[str, ...]


class NoNumberError(Exception):
    """Report that a path ends before it reaches a number; `depth`: how many of its parts lead
    somewhere."""

    def __init__(self, depth: int, what: str):
        self.depth = depth
        super().__init__(what)


def located(mechanism: Record, path: str) -> tuple[Where, float]:
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
    quantities = contents(mechanism).get("let")
    if not found and len(parts) == 1 and quantities:
        raise MechanismError(
            f"{shown(path)} leads to no number{suggestion(path, quantities)}: it is none of the "
            f"named quantities {', '.join(quantities)}, and no path such as 'platform.mass'"
        )
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


def placed(item: Any, where: Where, value: Any) -> Any:
    """Return an item with another value at a place in it."""
    if not where:
        return value
    inside = contents(item)
    part = placed(inside[where[0]], where[1:], value)
    if isinstance(item, Record):
        return swapped(item, **{where[0]: part})
    inside[where[0]] = part
    return tuple(inside.values()) if isinstance(item, tuple) else inside
