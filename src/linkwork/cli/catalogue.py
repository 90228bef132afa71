"""Robots by name: the catalogue and mechanism files."""

from pathlib import Path
from sys import modules

from linkwork import robots
from linkwork.cli.terminal import console, table
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism

SUFFIXES = (".yaml", ".yml")


def find(name: str) -> Mechanism:
    """Return the robot of the catalogue with that name, or the mechanism of that file.

    Raises:
        LinkworkError: there is neither, or the file is refused.
    """
    if name in robots.__all__:
        return getattr(robots, name)()
    if Path(name).suffix.lower() in SUFFIXES or Path(name).is_file():
        return Mechanism.load(name)
    raise LinkworkError(
        f"there is no robot {name!r}; name one of the catalogue ({', '.join(robots.__all__)}) or a mechanism file (.yaml)"
    )


def show() -> None:
    """Print the catalogue: each robot's name and the first line of its module."""
    rows = [(name, first_line(modules[getattr(robots, name).__module__].__doc__)) for name in robots.__all__]
    console().print(table(("robot", "description"), rows))


def first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]


def export(name: str, file: Path, overwrite: bool) -> None:
    """Write a robot as a mechanism file."""
    mechanism = find(name)
    if file.suffix.lower() not in SUFFIXES:
        raise LinkworkError(f"{file}: a mechanism file ends in .yaml, not {file.suffix!r}")
    refuse_existing(file, overwrite)
    mechanism.save(file)
    console().print(f"{file} written", soft_wrap=True)


def refuse_existing(file: Path, overwrite: bool) -> None:
    """Refuse to replace a file without being asked to."""
    if file.exists() and not overwrite:
        raise LinkworkError(f"{file} exists; give another name, or --overwrite to replace it")
