"""The report of a saved run from the command line."""

from __future__ import annotations

from pathlib import Path

from linkwork.cli.catalogue import refuse_existing, tell_written
from linkwork.cli.runs import read, robot_of
from linkwork.cli.source import Source
from linkwork.cli.terminal import patience
from linkwork.errors import LinkworkError


def report(
    file: str, out: Path, over: str | None, of: Source, overwrite: bool, as_json: bool
) -> None:
    """Write the report of a run as a page, and print where it is."""
    if out.suffix.lower() not in (".html", ".htm"):
        raise LinkworkError(f"--out {out}: a report is written as .html, not {out.suffix!r}")
    if not out.parent.is_dir():
        raise LinkworkError(f"--out {out}: there is no folder '{out.parent}'")
    refuse_existing(out, overwrite)
    run, other = read(file), None if over is None else read(over)
    with patience("preparing the robot"):
        robot = robot_of(run, file, of)
    with patience("drawing and writing"):
        from linkwork.views import write_report

        write_report(robot, run, out, over=other)
    tell_written([out], as_json)
