"""Reference configurations that are given beside a model file: joint coordinates by name, with
units where they are text, or a file of them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite, pi
from os import PathLike
from pathlib import Path
from typing import Any

from linkwork.errors import LinkworkError
from linkwork.formats import xml
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.document import read_document
from linkwork.mechanism.refusal import shown

Reference = Mapping[str, float | str] | str | PathLike[str]

ANGLES = {"rad": 1.0, "deg": pi / 180, "°": pi / 180, "turn": 2 * pi}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
AMOUNT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")
SUFFIXES = (".yaml", ".yml", ".json")
KEY = "reference"


def referred(mechanism: Mechanism, reference: Reference | None) -> Mechanism:
    """Return the mechanism about joint coordinates in place of those of its own reference.

    Args:
        reference: joint coordinates by name: numbers [m, rad], or text such as "40 deg" or "12 mm"
            (rad, deg, turn; m, cm, mm); or the path of a YAML or JSON file of them, which may also
            hold them under the key `reference`, as a mechanism file does.

    Raises:
        LinkworkError: what is no number, a unit of another kind, a name that is unknown, or a file
            that cannot be read.
    """
    return mechanism if reference is None else mechanism.with_reference(told(mechanism, reference))


def told(mechanism: Mechanism, reference: Reference) -> dict[str, Any]:
    """Return joint coordinates by name [m, rad], as `referred` takes them."""
    given, place = reference, "the reference"
    if isinstance(given, str | PathLike):
        place = str(Path(given))
        given = read_reference(Path(given))
    if not isinstance(given, Mapping):
        raise LinkworkError(
            f"{place} is {shown(given)}; give joint coordinates by name, such as "
            "{'crank': '40 deg'}, or a file of them"
        )
    angles, known = angles_of(mechanism), frozenset(mechanism.coordinates)
    values: dict[str, Any] = dict(given)
    for name, value in values.items():
        if isinstance(value, str) and name in known:
            values[name] = amount(value, name in angles, f"{place}: {name}")
    return values


def angles_of(mechanism: Mechanism) -> frozenset[str]:
    """Return the names of the joint coordinates that are angles."""
    return frozenset(
        label for name, joint in mechanism.joints.items() for label in joint.angles(name)
    )


def amount(text: str, angle: bool, place: str) -> float:
    """Return the number of a text such as "0.7", "40 deg" or "12mm" in m or rad; a refusal begins
    with its place."""
    match = AMOUNT.fullmatch(text)
    if match is None:
        raise LinkworkError(f"{place}: {text.strip()!r} is not a number")
    units = ANGLES if angle else LENGTHS
    if match[2] and match[2] not in units:
        kind = "an angle" if angle else "no angle"
        raise LinkworkError(
            f"{place}: {text.strip()!r}: the unit is not known; it is {kind}, in {', '.join(units)}"
        )
    value = float(match[1]) * units.get(match[2], 1.0)
    if not isfinite(value):
        raise LinkworkError(f"{place}: {text.strip()} is not a finite number")
    return value


def read_reference(path: Path) -> Any:
    """Return what a file of joint coordinates holds: by name, or by name under `reference`."""
    if path.suffix.lower() not in SUFFIXES:
        raise LinkworkError(
            f"{path}: a file of joint coordinates ends in {', '.join(SUFFIXES)}, not "
            f"{path.suffix!r}"
        )
    held = xml.contents(path)
    try:
        data = read_document(held.decode("utf-8")).data
    except UnicodeDecodeError:
        raise MechanismError(f"{path}: is not UTF-8 text") from None
    except MechanismError as error:
        raise MechanismError(error.what, error.where, f"{path}: {error.place}") from None
    return data[KEY] if isinstance(data, Mapping) and KEY in data else data
