"""The commands and their options; what each does is in the module of its name, imported when it is
called.

Exit status: 0 done; 1 a run that ended early; 2 a refused input, in one sentence on stderr; 130
interrupted.
"""

import sys
import traceback
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from linkwork.cli.analyse import Floating, PackagePath, Reference, analyse
from linkwork.cli.caveats import STRICT, told
from linkwork.cli.source import Source
from linkwork.errors import LinkworkError

REFUSED = 2
DEBUG = "--debug"
MEANT = {
    **dict.fromkeys(("list", "ls", "catalogue", "catalog"), "robots"),
    **dict.fromkeys(("run", "sim"), "simulate"),
    **dict.fromkeys(("analyze", "analysis", "study"), "analyse"),
    **dict.fromkeys(("show", "open", "viewer"), "view"),
    **dict.fromkeys(("import", "load"), "convert"),
}


class CommandGroup(TyperGroup):
    """Turn refusals into one sentence, and let `--debug` and `--strict` stand anywhere."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        anywhere = [flag for flag in (DEBUG, STRICT) if flag in args]
        return super().parse_args(ctx, [*anywhere, *(arg for arg in args if arg not in anywhere)])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] in MEANT:
            raise LinkworkError(f"there is no command {args[0]!r}; use 'linkwork {MEANT[args[0]]}'")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with told(ctx.params["strict"]):
                return super().invoke(ctx)
        except BrokenPipeError:
            raise
        except (LinkworkError, OSError) as error:
            if ctx.params["debug"]:
                traceback.print_exc()
            else:
                print(f"linkwork: {sentence(error)}", file=sys.stderr)
            raise typer.Exit(REFUSED) from None


def sentence(error: Exception) -> str:
    """Return a refusal as one line."""
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return f"{place}{error.strerror.lower()}"
    return " ".join(str(error).split())


app = typer.Typer(
    cls=CommandGroup, no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False
)

app.add_typer(analyse, name="analyse")


class Interpolation(StrEnum):
    spline = "spline"
    linear = "linear"
    hold = "hold"


class OnSingular(StrEnum):
    stop = "stop"
    step_over = "step_over"


RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A robot of the catalogue (see 'linkwork robots') or a mechanism file.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]


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


@app.command()
def info(
    robot: RobotName,
    json: Annotated[bool, typer.Option("--json", help="Print the facts as JSON.")] = False,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
) -> None:
    """Show a robot: mobility, joints, loops, redundant rows, limits, springs, sizes of the compiled
    functions."""
    from linkwork.cli.info import show

    show(Source(robot, reference, floating, packages), json)


@app.command()
def robots() -> None:
    """List the robots of the catalogue."""
    from linkwork.cli.catalogue import show

    show()


@app.command()
def export(
    robot: RobotName,
    file: Annotated[Path, typer.Argument(metavar="FILE.yaml", help="The mechanism file to write.")],
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a robot as a mechanism file, to be changed and used as ROBOT."""
    from linkwork.cli.catalogue import export

    export(Source(robot, reference, floating, packages), file, overwrite)


@app.command()
def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="A",
            help="A model file (.xml or .mjcf, .urdf, .sdf, .yaml) or a robot of the catalogue.",
        ),
    ],
    target: Annotated[
        Path, typer.Argument(metavar="B", help="The file to write: .yaml, or .xml or .mjcf (MJCF).")
    ],
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    overwrite: Overwrite = False,
) -> None:
    """Turn a model file into another: MJCF, URDF or SDF into a mechanism file, that into MJCF.

    What the other format does not hold is said, sentence by sentence.
    """
    from linkwork.cli.convert import convert

    convert(Source(source, reference, floating, packages), target, overwrite)


@app.command()
def simulate(
    robot: RobotName,
    duration: Annotated[float, typer.Option(metavar="T", help="Length of the run, s.")],
    forces: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help="Constant actuator forces, N or N m: '5,0,0' or 'slide_1=5' (others zero).",
        ),
    ] = None,
    forces_csv: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Forces over time: a column 'time' (s) and one named after each actuator.",
        ),
    ] = None,
    kind: Annotated[
        Interpolation, typer.Option(help="How the forces of a file run between their times.")
    ] = Interpolation.spline,
    tool: Annotated[
        str | None,
        typer.Option(
            metavar="POSE",
            help="Start with the tool at 'x,y,angle' (in space 'x,y,z,rx,ry,rz'), m and rad.",
        ),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help=(
                "Start at 'slide_1=0.2,cylinder.angle=1,...', m or rad; with --tool they choose "
                "the branch."
            ),
        ),
    ] = None,
    rates: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help=(
                "Rates at the start, m/s or rad/s: 'slide_1=0.1' of independent ones (others "
                "zero), or as many of others."
            ),
        ),
    ] = None,
    rtol: Annotated[float, typer.Option(help="Relative tolerance of the local error.")] = 1e-8,
    atol: Annotated[
        float,
        typer.Option(
            help=(
                "Absolute tolerance of the local error: rad; of lengths parts of the robot's "
                "own length."
            )
        ),
    ] = 1e-10,
    samples: Annotated[int, typer.Option(help="Number of equally spaced times to save.")] = 101,
    on_singular: Annotated[
        OnSingular,
        typer.Option(help="At a bifurcation: stop, or step over to the smooth continuation."),
    ] = OnSingular.stop,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the run to a .nc or .csv file.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Integrate the equations of motion from a pose under actuator forces.

    The run starts at the robot's reference pose, at rest, without forces, where nothing else is
    said.
    """
    from linkwork.cli import simulate as command

    # Where it starts, what acts, what is written, and how it is integrated.
    start = command.StartOptions(tool, joints, rates)
    load = command.Load(forces, forces_csv, kind.value)
    target = command.Target(out, overwrite)
    target.check()
    how = command.settings(duration, rtol, atol, samples, on_singular.value)
    if not command.simulate(Source(robot, reference, floating, packages), start, load, how, target):
        raise typer.Exit(1)


@app.command()
def reproduce(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the report, its figures and its data.")
    ],
) -> None:
    """Reproduce the paper's study of the 3-PRR robot, checked by independent engines.

    Writes DIR/report.html, DIR/reproduction.nc and the figures as DIR/*.svg, replacing those of an
    earlier call.
    """
    from linkwork.cli.reproduce import reproduce

    reproduce(out)


@app.command()
def report(
    run: Annotated[
        str,
        typer.Argument(metavar="RUN", help="A saved run (.nc), of 'simulate --out' or Run.save."),
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The page to write, ending in .html.")],
    of: Annotated[
        str | None,
        typer.Option(
            "--robot", metavar="ROBOT", help="Whose the run is, if it does not hold its mechanism."
        ),
    ] = None,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the report of a run: one page with pictures, a film, peaks, energy and closure, that
    needs no network."""
    from linkwork.cli.report import report

    report(run, out, Source(of or "", reference, floating, packages), overwrite)


@app.command()
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
) -> None:
    """Simulate a robot over a design of parameters, starts and controllers: DIR/results.zarr,
    table.csv, plots.svg.

    Called again after an interruption of any kind, it goes on with what is not finished.
    """
    from linkwork.cli.sweep import sweep

    sweep(study, out, scheduler, threads)


@app.command()
def view(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|RUN",
            help="A robot of the catalogue, a mechanism file, or a saved run (.nc).",
        ),
    ],
    of: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Whose a run is.")
    ] = None,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; the default serves this computer alone.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(help="Port to listen on; left out, the first free one from 8080 on."),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Show a robot in the browser: drag its tool, set its joints, play runs, start new ones."""
    from linkwork.cli.view import view

    view(Source(robot, reference, floating, packages), of, host, port, browser)


def main() -> None:
    """Run the command line."""
    app(prog_name="linkwork")
