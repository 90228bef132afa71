"""The commands and their options; what each does is in the module of its name, imported when it is
called.

Exit status: 0 done; 1 a run that ended early; 2 a refused input, in one sentence on stderr; 130
interrupted.
"""

import sys
from io import TextIOWrapper
from typing import Annotated

import typer

from linkwork.cli.analyse import analyse
from linkwork.cli.caveats import STRICT
from linkwork.cli.group import DEBUG, CommandGroup, reflow
from linkwork.cli.model_commands import convert, export, info, robots
from linkwork.cli.motion_commands import dynamics, follow, simulate
from linkwork.cli.result_commands import report, reproduce, sweep, view

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, pretty_exceptions_enable=False)

app.add_typer(analyse, name="analyse")


def print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"linkwork {version('linkwork')}")
        raise typer.Exit()


@app.callback()
def root(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=print_version, is_eager=True, help="Print the version and leave."
        ),
    ] = False,
    debug: Annotated[
        bool, typer.Option(DEBUG, help="Show the traceback of a refusal; may stand anywhere.")
    ] = False,
    strict: Annotated[
        bool,
        typer.Option(
            STRICT, help="Refuse a model file that is not read whole; may stand anywhere."
        ),
    ] = False,
) -> None:
    """Exact equations of motion of mechanisms with closed loops, compiled to machine code."""


for command in (
    info,
    robots,
    export,
    convert,
    simulate,
    follow,
    dynamics,
    reproduce,
    report,
    sweep,
    view,
):
    app.command()(command)
reflow(app, analyse)


def main() -> None:
    """Run the command line; letters that a stream does not hold are written as escapes."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    app(prog_name="linkwork")
