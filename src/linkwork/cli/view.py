"""The viewer from the command line: a robot of the catalogue, a mechanism file, or a saved run."""

from __future__ import annotations

import sys
import webbrowser
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import rich
from rich.console import Console

from linkwork.cli.catalogue import built
from linkwork.cli.runs import SUFFIX, read, robot_of
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, patience, show_json
from linkwork.errors import LinkworkError
from linkwork.simulation import Run

LOCAL = ("127.0.0.1", "::1", "localhost")


def view(
    source: Source,
    of: str | None,
    over: str | None,
    host: str,
    port: int | None,
    browser: bool,
    as_json: bool,
) -> None:
    """Serve a robot, or a run of one, until interrupted."""
    name = source.name
    run = Run.load(name) if Path(name).suffix.lower() == SUFFIX else None
    if run is None and of is not None:
        raise LinkworkError(
            f"--robot says whose a run is; {name!r} is no run (a file that ends in {SUFFIX})"
        )
    if run is None and over is not None:
        raise LinkworkError(
            f"--over lays a run over another one; {name!r} is no run (a file that ends in {SUFFIX})"
        )
    other = None if over is None else read(over)
    rich.reconfigure(stderr=True)  # for what viser tells
    with patience("preparing the robot"):
        from linkwork.viewer import Viewer

        robot = (
            built(source) if run is None else robot_of(run, name, replace(source, name=of or ""))
        )
        viewer = Viewer(robot, run, over=other, host=host, port=port)
    with viewer, suppress(KeyboardInterrupt):  # from the moment when the address is told
        tell(robot.mechanism.name, viewer.url, host, as_json)
        if browser:
            webbrowser.open(viewer.url)
        viewer.wait()


def tell(name: str, url: str, host: str, as_json: bool) -> None:
    """Print where a viewer is found, as plain data, too, if asked for."""
    if as_json:
        show_json({"robot": name, "url": url})
        sys.stdout.flush()
    out = Console(stderr=True, markup=False, highlight=False) if as_json else console()
    out.print(f"{name}: {url} (Ctrl-C ends it)", soft_wrap=True)
    if host not in LOCAL:
        out.print("everyone who is given this address can see and move the robot", soft_wrap=True)
