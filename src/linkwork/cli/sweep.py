"""A study from the command line: compute what is missing, print a table, write table and plots."""

from __future__ import annotations

from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from linkwork.checks import amount
from linkwork.cli.terminal import console, patience, show_json, table
from linkwork.errors import LinkworkError
from linkwork.simulation import Status

if TYPE_CHECKING:
    from linkwork.sweeps import Summary

FINISHED = Status.FINISHED.name  # how a member ends that reached its end
NEEDED = ("zarr", "distributed")
HEADER = ("output", "unit", "mean", "deviation", "least", "largest")


def sweep(
    file: Path, folder: Path | None, scheduler: str | None, threads: int | None, as_json: bool
) -> bool:
    """Carry out a study, print what it comes to and where the files are; return whether a member
    reached its end."""
    # What is asked for can be done, here and with this.
    for package in NEEDED if scheduler else NEEDED[:1]:
        if find_spec(package) is None:
            raise LinkworkError(f"sweeps need the package {package}; install linkwork[sweeps]")
    if threads is not None and threads < 1:
        raise LinkworkError(f"--threads {threads}: give at least 1")
    if threads is not None and scheduler is not None:
        raise LinkworkError(
            "--threads and --scheduler are both given; the workers of a cluster have their own "
            "threads"
        )
    # Faults of the study are told before a worker starts, and name its file.
    with patience("preparing the study"):
        from linkwork import sweeps
        from linkwork.sweeps.chunk import bench_of
        from linkwork.sweeps.study import in_file

        study = sweeps.Study.load(file)
        with in_file(file):
            bench_of(study)
        folder = folder or Path(file.stem)
        if folder.exists() and not folder.is_dir():
            raise LinkworkError(f"--out {folder}: is a file; name a folder")
    # The work itself, resumed where chunks are there already.
    with bar() as shown:
        task = shown.add_task("chunks", total=None)
        outcome = sweeps.sweep(
            study,
            folder,
            scheduler=scheduler,
            threads=threads,
            progress=lambda done, total: shown.update(task, completed=done, total=total),
        )
    # What came of it, on the terminal and beside the store.
    with patience("reading the results"):
        found = sweeps.summary(outcome.store)
        written = sweeps.write(outcome.store, found, folder)
    files, finished = [outcome.store.path, *written], FINISHED in found.statuses
    if as_json:
        told = {"before": outcome.before, "corrupted": outcome.corrupted, "written": files}
        rows = [asdict(row) for row in found.rows]
        show_json({"members": study.members, "statuses": found.statuses, "outputs": rows} | told)
        return finished
    show(study.name, study.members, outcome.before, outcome.corrupted, found)
    for path in files:
        console().print(str(path), soft_wrap=True)
    return finished


def bar() -> Progress:
    """Return a progress bar on stderr."""
    parts = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*parts, console=Console(stderr=True), transient=True)


def show(name: str, members: int, before: int, corrupted: int, found: Summary) -> None:
    """Print how members ended, and a table of the outputs for each controller."""
    out = console()
    endings = ", ".join(f"{count} {status.lower()}" for status, count in found.statuses.items())
    out.print(f"{name}: {amount(members, 'member')}; {endings}", soft_wrap=True)
    if before:
        out.print(f"finished before: {amount(before, 'chunk')}", soft_wrap=True)
    if corrupted:
        out.print(
            f"corrupted on disk and computed again: {amount(corrupted, 'chunk')}",
            soft_wrap=True,
        )
    for controller in dict.fromkeys(row.controller for row in found.rows):
        out.print(f"\n{controller}" if controller else "", soft_wrap=True)
        rows = [
            (
                row.output,
                row.unit,
                *(f"{value:.4g}" for value in (row.mean, row.deviation, row.least, row.largest)),
            )
            for row in found.rows
            if row.controller == controller
        ]
        out.print(table(HEADER, rows, numbers=range(2, 6)))
    out.print()
