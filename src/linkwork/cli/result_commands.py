"""Commands that show results, and those of many runs: `reproduce`, `report`, `sweep`, `view`."""

from pathlib import Path
from typing import Annotated

import typer

from linkwork.cli.options import (
    PLAIN,
    Json,
    Over,
    Overwrite,
    ReadingOptions,
    runs_like,
    sharing,
    shown_like,
)
from linkwork.cli.source import Source


def reproduce(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the report, its figures and its data.")
    ],
    json: Json = False,
) -> None:
    """Reproduce the paper's study of the 3-PRR robot, checked by independent engines.

    Writes DIR/report.html, DIR/reproduction.nc and the figures as DIR/*.svg, replacing those of an
    earlier call.
    """
    from linkwork.cli.reproduce import reproduce

    reproduce(out, json)


@sharing
def report(
    run: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="A saved run (.nc), of 'simulate --out' or Run.save.",
            autocompletion=runs_like,
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The page to write, ending in .html.")],
    of: Annotated[
        str | None,
        typer.Option(
            "--robot", metavar="ROBOT", help="Whose the run is, if it does not hold its mechanism."
        ),
    ] = None,
    reading: ReadingOptions = PLAIN,
    over: Over = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write the report of a run: one page with pictures, a film, peaks, energy and closure, that
    needs no network."""
    from linkwork.cli.report import report

    report(run, out, over, Source(of or "", reading), overwrite, json)


def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study file.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for the results; left out, one named after the study's file.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="A Dask scheduler, such as tcp://host:8786; left out, compute here.",
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Threads to use here; left out, all processors.")
    ] = None,
    json: Json = False,
) -> None:
    """Simulate a robot over a design of parameters, starts and controllers: DIR/results.zarr,
    table.csv, plots.svg.

    Called again after an interruption of any kind, it goes on with what is not finished. Exit
    status: 0, or 1 where no member reached its end.
    """
    from linkwork.cli.sweep import sweep

    if not sweep(study, out, scheduler, threads, json):
        raise typer.Exit(1)


@sharing
def view(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|RUN",
            help="A robot of the catalogue, a mechanism or model file, or a saved run (.nc).",
            autocompletion=shown_like,
        ),
    ],
    of: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Whose a run is.")
    ] = None,
    over: Over = None,
    reading: ReadingOptions = PLAIN,
    host: Annotated[
        str, typer.Option(help="Address to listen on; the default serves this computer alone.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(help="Port to listen on; left out, the first free one from 8080 on."),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    json: Json = False,
) -> None:
    """Show a robot in the browser: drag its tool, set its joints, play runs, start new ones."""
    from linkwork.cli.view import view

    view(Source(robot, reading), of, over, host, port, browser, json)
