"""The robot that a study file names, and how its file is read: as the options of commands say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from linkwork import robots
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.refusal import shown, suggestion

FOLDERS = ("packages", "includes")
ROOT = "root"
ROOTS = {"fixed": False, "floating": True}
READING = (ROOT, *FOLDERS)  # keys that say how a model file is read


def require_known(fields: Iterable[str], own: tuple[str, ...]) -> None:
    """Refuse names that are neither a study's own fields nor say how its model file is read."""
    known = (*own, *READING)
    for name in fields:
        if name not in known:
            fix = f"{suggestion(name, known)}; the fields here are {', '.join(known)}"
            raise MechanismError(f"is not a known field{fix}", (name,))


def with_robot(fields: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return a study's fields with the mechanism in place of its name and of how it is read, and
    the reference in numbers; paths are from the study's folder."""
    found = {name: value for name, value in fields.items() if name not in READING}
    if "robot" not in fields:
        return dict(fields)
    reading = {name: fields[name] for name in READING if name in fields}
    for name in FOLDERS:
        if name in reading:
            reading[name] = _folders(reading[name], folder, name)
    if ROOT in reading:
        reading["floating"] = _floats(reading.pop(ROOT))
    if reading and found["robot"] in robots.__all__:
        raise MechanismError(
            f"is of files, but {found['robot']!r} is a robot of the catalogue; leave it out",
            (next(name for name in READING if name in fields),),
        )
    robot = found["robot"] = _robot(found["robot"], folder, reading)
    reference = found.get("reference")
    if isinstance(reference, str) or (
        isinstance(reference, Mapping) and any(isinstance(x, str) for x in reference.values())
    ):
        from linkwork.formats import references

        given = folder / reference if isinstance(reference, str) else reference
        try:
            found["reference"] = references.told(robot, given)
        except LinkworkError as error:
            raise MechanismError(str(error), ("reference",)) from None
    return found


def _floats(given: Any) -> bool:
    if not isinstance(given, str) or given not in ROOTS:
        raise MechanismError(f"is {shown(given)}; give {' or '.join(ROOTS)}", (ROOT,))
    return ROOTS[given]


def _folders(given: Any, folder: Path, name: str) -> list[Path]:
    """Return folders, one or many, from the study's own."""
    each = [given] if isinstance(given, str) else given
    if not (isinstance(each, list) and all(isinstance(path, str) for path in each)):
        raise MechanismError(f"{shown(given)} is no folder; give one, or a list of them", (name,))
    return [folder / path for path in each]


def _robot(name: Any, folder: Path, reading: Mapping[str, Any]) -> Mechanism:
    """Return a robot of the catalogue, or that of a mechanism or model file beside the study."""
    if not isinstance(name, str):
        raise MechanismError(
            f"{shown(name)} is no name; give a robot of the catalogue or a mechanism file",
            ("robot",),
        )
    if name in robots.__all__:
        return getattr(robots, name)()
    file = folder / name
    if not file.suffix:
        known: Iterable[str] = robots.__all__
        raise MechanismError(
            f"there is no robot {name!r}{suggestion(name, known)}; the catalogue has "
            f"{', '.join(known)}",
            ("robot",),
        )
    try:
        from linkwork import formats

        if file.suffix.lower() in formats.MODELS or reading:
            return formats.load(file, **reading).mechanism
        return Mechanism.load(file)
    except LinkworkError as error:
        raise MechanismError(str(error), ("robot",)) from None
