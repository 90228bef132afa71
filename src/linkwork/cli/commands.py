"""The commands and their options; what each does is in the module of its name, imported when it is
called.

Exit status: 0 done; 1 a run that ended early; 2 a refused input, in one sentence on stderr; 130
interrupted.
"""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from linkwork.cli.analyse import analyse
from linkwork.cli.caveats import STRICT
from linkwork.cli.group import DEBUG, CommandGroup, reflow
from linkwork.cli.options import (
    Floating,
    Forces,
    IncludeRoot,
    Json,
    Merging,
    Over,
    PackagePath,
    Reference,
    RobotName,
    What,
    runs_like,
    shown_like,
)
from linkwork.cli.source import Source

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, pretty_exceptions_enable=False)

app.add_typer(analyse, name="analyse")


class Interpolation(StrEnum):
    spline = "spline"
    linear = "linear"
    hold = "hold"


class MethodOption(StrEnum):
    """The methods of `linkwork.simulation.methods`, which need not be imported for help."""

    sharp_smart = "sharp_smart"
    dormand_prince = "dormand_prince"
    dop853 = "dop853"
    rodas = "rodas"
    rk4 = "rk4"
    symplectic_euler = "symplectic_euler"


class ExportFormat(StrEnum):
    """What `export` writes."""

    yaml = "yaml"
    c = "c"


class Precision(StrEnum):
    double = "double"
    float = "float"


class Sines(StrEnum):
    polynomial = "polynomial"
    libm = "libm"


class OnSingular(StrEnum):
    stop = "stop"
    step_over = "step_over"


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
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
    json: Json = False,
) -> None:
    """Show a robot: mobility, joints, loops, redundant rows, limits, springs, sizes of the compiled
    functions."""
    from linkwork.cli.info import show

    show(Source(robot, reference, floating, packages, merging, includes), json)


@app.command()
def robots(json: Json = False) -> None:
    """List the robots of the catalogue."""
    from linkwork.cli.catalogue import show

    show(json)


@app.command()
def export(
    robot: RobotName,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE.yaml", help="The mechanism file to write, with --to yaml."),
    ] = None,
    to: Annotated[ExportFormat, typer.Option(help="A mechanism file, or C99.")] = ExportFormat.yaml,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="C: the folder for its files.")
    ] = None,
    functions: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="C: the functions, 'motion,jacobian'; all if left out."),
    ] = None,
    precision: Annotated[Precision, typer.Option(help="C: of all numbers.")] = Precision.double,
    sines: Annotated[
        Sines, typer.Option(help="C: the kernels' polynomials, or the C library's.")
    ] = Sines.polynomial,
    free: Annotated[
        str | None,
        typer.Option(metavar="PATHS", help="C: numbers that stay free, 'platform.mass,gravity.z'."),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="C: what all names begin with; the robot's name if left out."),
    ] = None,
    misra: Annotated[
        bool, typer.Option("--misra", help="C: with a note on deviations from MISRA C:2012.")
    ] = False,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write a robot as a mechanism file, to be changed and used as ROBOT, or as C99 (--to c)."""
    from linkwork.cli.exported import export

    source = Source(robot, reference, floating, packages, merging, includes)
    chosen = {"precision": precision.value, "sines": sines.value, "free": free, "name": name}
    export(
        source,
        to.value,
        file,
        out,
        {"functions": functions, **chosen, "misra": misra},
        overwrite,
        json,
    )


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
    merging: Merging = True,
    includes: IncludeRoot = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Turn a model file into another: MJCF, URDF or SDF into a mechanism file, that into MJCF.

    What the other format does not hold is said, sentence by sentence.
    """
    from linkwork.cli.convert import convert

    convert(
        Source(source, reference, floating, packages, merging, includes), target, overwrite, json
    )


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
            help=(
                "Start with the tool at 'x,y,angle' (in space 'x,y,z,rx,ry,rz'), m and rad; or "
                "'x=0.3,rz=0.1' by name."
            ),
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
    drives: Annotated[
        bool,
        typer.Option("--drives", help="Take forces as commands of the description's own drives."),
    ] = False,
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="WORDS",
            help=(
                "A controller as in study files: 'pd kp=400 kd=40', 'computed_torque kp=400 kd=40',"
                " 'lqr position=1e4 force=1' ..."
            ),
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            metavar="WORDS",
            help=(
                "Where it leads: 'pose tool=0.5,0.3,1.2', a path as for 'follow', or its table "
                "(.csv); left out, where the run starts."
            ),
        ),
    ] = None,
    method: Annotated[
        MethodOption | None,
        typer.Option(help="Of integration; left out, chosen by inputs and tolerance."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(metavar="H", help="Of the methods with a fixed step (rk4 ...), s."),
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
    merging: Merging = True,
    includes: IncludeRoot = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the run to a .nc or .csv file.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Integrate the equations of motion from a pose under actuator forces or a controller.

    The run starts at the robot's reference pose, at rest, without forces, where nothing else is
    said; with a path as --goal it starts at the path's beginning.
    """
    from linkwork.cli import simulate as command

    # Where it starts, what acts, what is written, and how it is integrated.
    start = command.StartOptions(tool, joints, rates)
    load = command.Load(forces, forces_csv, kind.value, drives)
    lead = command.Lead(controller, goal)
    target = command.Target(out, overwrite)
    target.check()
    options = {"rtol": rtol, "atol": atol, "on_singular": on_singular.value}
    options |= {"method": method and method.value, "step": step}
    how = command.settings(duration, samples, **options)
    source = Source(robot, reference, floating, packages, merging, includes)
    if not command.simulate(source, start, load, lead, how, target, json):
        raise typer.Exit(1)


@app.command()
def follow(
    robot: RobotName,
    path: Annotated[
        str,
        typer.Option(
            metavar="PATH",
            help=(
                "'circle centre=0.45,0.29 radius=0.05 orientation=1.2', 'line start=... end=...', "
                "'through poses=...;...' (m and rad), or a table of a motion (.csv)."
            ),
        ),
    ],
    duration: Annotated[
        float | None,
        typer.Option(metavar="T", help="From rest to rest, s; a table has times of its own."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of equally spaced times.")] = 101,
    tool: Annotated[
        str | None, typer.Option(metavar="POSE", help="Look for the start near this tool pose.")
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(metavar="VALUES", help="Look near 'slide_1=0.2,...': they choose the branch."),
    ] = None,
    what: What = None,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Write the motion of all joints, and the forces."),
    ] = None,
    forces_out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv", help="Write the forces as 'simulate --forces-csv' reads them."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Lead the tool along a path: motion of all joints, and the forces that it takes (inverse
    dynamics)."""
    from linkwork.cli.entries import names
    from linkwork.cli.follow import Files, follow
    from linkwork.cli.start import StartOptions

    start, files = StartOptions(tool, joints, None), Files(out, forces_out, overwrite)
    source = Source(robot, reference, floating, packages, merging, includes)
    follow(source, path, duration, samples, start, names(what), files, json)


@app.command()
def dynamics(
    robot: RobotName,
    tool: Annotated[
        str | None,
        typer.Option(metavar="POSE", help="The tool at 'x,y,angle' (in space 'x,y,z,rx,ry,rz')."),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help="Joint coordinates 'slide_1=0.2,...'; with --tool they choose the branch.",
        ),
    ] = None,
    rates: Annotated[
        str | None,
        typer.Option(metavar="VALUES", help="Rates 'slide_1=0.1' (others zero), m/s or rad/s."),
    ] = None,
    accelerations: Annotated[
        str | None,
        typer.Option(
            metavar="VALUES",
            help="Tell the forces for 'slide_1=2' of independent rates (others zero).",
        ),
    ] = None,
    forces: Forces = None,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
    json: Json = False,
) -> None:
    """Show the equations of motion at one state: M, C v, G, f, and accelerations under --forces
    (none if left out), or the forces for --accelerations (inverse dynamics)."""
    from linkwork.cli.dynamics import dynamics
    from linkwork.cli.start import StartOptions

    source = Source(robot, reference, floating, packages, merging, includes)
    dynamics(source, StartOptions(tool, joints, rates), accelerations, forces, json)


@app.command()
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


@app.command()
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
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
    over: Over = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write the report of a run: one page with pictures, a film, peaks, energy and closure, that
    needs no network."""
    from linkwork.cli.report import report

    report(
        run,
        out,
        over,
        Source(of or "", reference, floating, packages, merging, includes),
        overwrite,
        json,
    )


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
    json: Json = False,
) -> None:
    """Simulate a robot over a design of parameters, starts and controllers: DIR/results.zarr,
    table.csv, plots.svg.

    Called again after an interruption of any kind, it goes on with what is not finished.
    """
    from linkwork.cli.sweep import sweep

    sweep(study, out, scheduler, threads, json)


@app.command()
def view(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|RUN",
            help="A robot of the catalogue, a mechanism file, or a saved run (.nc).",
            autocompletion=shown_like,
        ),
    ],
    of: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Whose a run is.")
    ] = None,
    over: Over = None,
    reference: Reference = None,
    floating: Floating = False,
    packages: PackagePath = None,
    merging: Merging = True,
    includes: IncludeRoot = None,
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

    view(
        Source(robot, reference, floating, packages, merging, includes),
        of,
        over,
        host,
        port,
        browser,
        json,
    )


reflow(app, analyse)


def main() -> None:
    """Run the command line."""
    app(prog_name="linkwork")
