"""Drives as data, in mechanism files and studies: each a type and its numbers, as the drive itself
describes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from linkwork import control
from linkwork.control.records import described
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.refusal import suggestion

DRIVES: Mapping[str, type[control.Drive]] = {
    kind.type: kind for kind in control.DRIVES if kind.type
}


def drives_of(mechanism: Mechanism) -> dict[str, control.Drive]:
    """Return the drives that a mechanism describes, by actuator.

    Raises:
        MechanismError: a type or a number that no drive has, with its place.
    """
    return {name: drive(given, ("drives", name)) for name, given in mechanism.drives.items()}


def drive(given: Mapping[str, Any], where: tuple[str, ...]) -> control.Drive:
    """Return the drive that a mapping of its type and its numbers stands for
    (`linkwork.control`)."""
    numbers = dict(given)
    kind = numbers.pop("type", None)
    if kind not in DRIVES:
        fault = (
            "is missing"
            if kind is None
            else f"{kind!r} is not a type{suggestion(str(kind), DRIVES)}"
        )
        raise MechanismError(f"{fault}; the types are {', '.join(DRIVES)}", (*where, "type"))
    own = described(DRIVES[kind])
    needed = {field.name for field in fields(DRIVES[kind]) if field.default is MISSING}
    for name, value in numbers.items():
        if name not in own:
            near = suggestion(name, own)
            raise MechanismError(
                f"is not a known field{near}; the fields here are {', '.join(own)}", (*where, name)
            )
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MechanismError(f"{value!r} is not a number", (*where, name))
    for name in own:
        if name in needed and name not in numbers:
            raise MechanismError("is missing; expected a number", (*where, name))
    try:
        return DRIVES[kind](**{name: float(value) for name, value in numbers.items()})
    except ValueError as error:
        raise MechanismError(str(error), where) from None
