"""The paper's study from the command line."""

from __future__ import annotations

from pathlib import Path

from linkwork.cli.terminal import console, patience, show_json, table
from linkwork.errors import LinkworkError


def reproduce(folder: Path, as_json: bool) -> None:
    """Carry out the study, write it into a folder, print a summary and where the files are."""
    refuse_file(folder)
    with patience("loading"):
        from linkwork.lab import reproduction
    with patience("simulating the robot by Linkwork and by the installed engines"):
        comparison = reproduction.study()
    with patience("drawing and writing"):
        written = reproduction.write(comparison, folder)
    header, rows = reproduction.summary(comparison)
    if as_json:
        differences = [dict(zip(header, row, strict=True)) for row in rows]
        told = {"absent": reproduction.absent(comparison), "written": written}
        show_json({"differences": differences} | told)
        return
    out = console()
    out.print("Largest differences from Linkwork's forward dynamics over the run\n")
    out.print(table(header, rows, numbers=range(1, len(header))))
    out.print()
    for engine, reason in reproduction.absent(comparison).items():
        out.print(f"{engine} is not shown: {reason}")
    for path in written:
        out.print(str(path), soft_wrap=True)


def refuse_file(folder: Path) -> None:
    """Refuse a place that is no folder before anything is computed."""
    if folder.exists() and not folder.is_dir():
        raise LinkworkError(f"--out {folder}: is a file; name a folder")
