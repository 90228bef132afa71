"""A robot written to be used elsewhere: as a mechanism file, or as C."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linkwork import formats
from linkwork.cli.catalogue import built, find, refuse_existing, tell_written
from linkwork.cli.caveats import tell
from linkwork.cli.source import Source
from linkwork.cli.terminal import patience, show_json
from linkwork.errors import LinkworkError

PLAIN = {
    "functions": None,
    "precision": "double",
    "sines": "polynomial",
    "free": None,
    "name": None,
    "misra": False,
}
"""What the options of C are left out as."""


def export(
    source: Source,
    to: str,
    file: Path | None,
    out: Path | None,
    chosen: Mapping[str, Any],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a robot; chosen: the options of C by name."""
    if to == "c":
        export_c(source, file, out, chosen, overwrite, as_json)
        return
    given = [f"--{name}" for name, value in chosen.items() if value != PLAIN[name]]
    given += ["--out"] * (out is not None)
    if given:
        raise LinkworkError(f"{given[0]} is of C; give it with --to c")
    if file is None:
        raise LinkworkError("name the mechanism file to write, FILE.yaml, or give --to c --out DIR")
    mechanism = find(source)
    if file.suffix.lower() not in formats.NATIVE:
        raise LinkworkError(f"{file}: a mechanism file ends in .yaml, not {file.suffix!r}")
    refuse_existing(file, overwrite)
    mechanism.save(file)
    tell_written([file], as_json)


def export_c(
    source: Source,
    file: Path | None,
    out: Path | None,
    chosen: Mapping[str, Any],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a robot as C, and say what was left out."""
    from linkwork.export import c

    if file is not None or out is None:
        raise LinkworkError("C is written to a folder; give it as --out DIR")
    robot = built(source)
    free = split(chosen["free"])
    if free:
        robot = robot.free(*free)
    with patience("writing C"):
        written = c(
            robot,
            split(chosen["functions"]),
            parameters="free" if free else "fixed",
            **{each: chosen[each] for each in ("precision", "sines", "name", "misra")},
        )
    for name in written.files:
        refuse_existing(out / name, overwrite)
    files = written.write(out)
    if as_json:
        show_json({"written": files, "functions": written.functions, "notes": written.notes})
        return
    tell(written.notes)
    tell_written(files, False)


def split(names: str | None) -> list[str] | None:
    """Return the names of a list that commas separate."""
    return None if names is None else [name.strip() for name in names.split(",")]
