"""Robots by name: the catalogue and mechanism files."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryFile

from linkwork import robots
from linkwork.cli.caveats import tell
from linkwork.cli.source import Source
from linkwork.cli.start import coordinates_given
from linkwork.cli.terminal import console, show_json, table
from linkwork.errors import LinkworkError
from linkwork.formats.models import warn
from linkwork.formats.named import named as find_named
from linkwork.formats.reading import PLAIN, Reading
from linkwork.formats.references import SUFFIXES, referred
from linkwork.mechanism import Mechanism
from linkwork.robot import Robot


def find(source: Source) -> Mechanism:
    """Return the mechanism that is meant, about the reference that is asked for.

    Raises:
        LinkworkError: there is none of that name, or the file or the reference is refused.
    """
    return about(named(source.name, source.reading), source)


def built(source: Source) -> Robot:
    """Return the robot that is meant; print what was decided about its reference."""
    robot = Robot(find(source))
    tell(note for note in robot.notes if note not in robot.equations.caveats)
    return robot


def about(mechanism: Mechanism, source: Source) -> Mechanism:
    """Return the mechanism with the joint coordinates that are asked for in its reference."""
    given = source.how.reference
    if given is None:
        return mechanism
    if "=" not in given and Path(given).suffix.lower() in SUFFIXES:
        return referred(mechanism, given)
    return mechanism.with_reference(coordinates_given(mechanism, given, "--reference"))


def named(name: str, reading: Reading = PLAIN) -> Mechanism:
    """Return the robot of the catalogue with that name, or the mechanism of that file; print the
    notes on the file.

    Raises:
        LinkworkError: there is neither, or the file is refused.
    """
    imported = find_named(name, reading)
    warn(imported.mechanism, stacklevel=2)
    tell(note for note in imported.notes if note not in imported.mechanism.caveats)
    return imported.mechanism


def show(as_json: bool) -> None:
    """Print the catalogue: each robot's name and what its function describes, by the first line of
    its docstring."""
    rows = [(name, subject(getattr(robots, name).__doc__)) for name in robots.__all__]
    if as_json:
        show_json([{"name": name, "description": text} for name, text in rows])
        return
    console().print(table(("robot", "description"), rows))


def subject(text: str | None) -> str:
    """Return the first paragraph in one line, without its "Describe": "Describe a planar four-bar."
    gives "A planar four-bar."."""
    first = (text or "").strip().partition("\n\n")[0]
    line = " ".join(first.split()).removeprefix("Describe ")
    return line[:1].upper() + line[1:]


def tell_written(files: Sequence[Path], as_json: bool) -> None:
    """Print which files were written."""
    if as_json:
        show_json({"written": files})
        return
    for file in files:
        console().print(f"{file} written", soft_wrap=True)


def refuse_existing(file: Path, overwrite: bool) -> None:
    """Refuse to replace a file without being asked to."""
    if file.exists() and not overwrite:
        raise LinkworkError(f"{file} exists; give another name, or --overwrite to replace it")


def refuse_unwritable(option: str, file: Path, overwrite: bool) -> None:
    """Refuse a file that cannot be written, or replaced without being asked to, before anything is
    computed."""
    if not file.parent.is_dir():
        raise LinkworkError(f"{option} {file}: there is no folder '{file.parent}'")
    if file.is_dir():
        raise LinkworkError(f"{option} {file}: is a folder; name a file in it")
    refuse_existing(file, overwrite)
    try:
        TemporaryFile(dir=file.parent).close()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise LinkworkError(
            f"{option} {file}: nothing can be written into '{file.parent}': {reason}"
        ) from None
