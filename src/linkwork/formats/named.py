"""Mechanisms by what users give: a name of the catalogue, or a file of any format."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from linkwork import robots
from linkwork.checks import suggestion
from linkwork.errors import LinkworkError
from linkwork.formats.floating import floated
from linkwork.formats.models import FORMATS, MACROS, NATIVE, READ, Imported, read, warn
from linkwork.formats.notes import Notes
from linkwork.formats.reading import PLAIN, Reading
from linkwork.mechanism import Mechanism


def named(given: str | PathLike[str], reading: Reading = PLAIN) -> Imported:
    """Return the robot of the catalogue with that name, or the mechanism of that file, with notes
    on what it does not hold.

    Raises:
        LinkworkError: there is neither, with the nearest name if one is near, or the file is
            refused.
    """
    name, path = str(given), Path(given)
    if isinstance(given, str) and name in robots.__all__:
        return described(getattr(robots, name)(), name, reading)
    suffix = path.suffix.lower()
    if suffix in (*READ, MACROS):
        near = "" if path.exists() else nearest_file(path)
        if near:
            raise LinkworkError(f"{path}: cannot be read: no such file or directory{near}")
        return read(path, reading)
    if path.is_file():
        return described(Mechanism.load(path), path.name, reading)
    if path.is_dir() and name:
        raise LinkworkError(f"{name!r} is a folder; give the file of a mechanism in it")
    suffixes = (NATIVE[0], *(form.suffixes[0] for form in FORMATS))
    raise LinkworkError(
        f"there is no robot {name!r}{suggestion(path.stem.replace('-', '_'), robots.__all__)}; "
        f"name one of the catalogue ({', '.join(robots.__all__)}) or a mechanism file "
        f"({', '.join(suffixes)})"
    )


def described(mechanism: Mechanism, name: str, reading: Reading) -> Imported:
    """Return a mechanism of a name as it is to be read."""
    notes = Notes()
    found = floated(mechanism, name, notes) if reading.floating else mechanism
    return Imported(found, (*notes.sentences(), *found.caveats))


def nearest_file(path: Path) -> str:
    """Ask whether another model file beside one that is missing is meant, if its name is near."""
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    return suggestion(path.name, [file.name for file in beside if file.suffix.lower() in READ])


def mechanism_of(given: Mechanism | str | PathLike[str], stacklevel: int) -> Mechanism:
    """Return a mechanism as it is, or that of a name or file, whose caveats the caller so many
    levels above is warned of.

    Raises:
        LinkworkError: neither a mechanism nor a name; see `named`.
    """
    if isinstance(given, Mechanism):
        return given
    if not isinstance(given, str | PathLike):
        raise LinkworkError(
            f"a robot is made from a Mechanism, not from {given!r}; see linkwork.robots, or "
            "Robot.from_file"
        )
    mechanism = named(given).mechanism
    warn(mechanism, stacklevel + 1)
    return mechanism
