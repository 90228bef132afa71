"""Commands that move a robot: `simulate`, `follow`, `dynamics`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from linkwork.cli.options import (
    PLAIN,
    Forces,
    Json,
    Overwrite,
    ReadingOptions,
    RobotName,
    What,
    method_named,
    methods_like,
    sharing,
)
from linkwork.cli.source import Source


class Interpolation(StrEnum):
    spline = "spline"
    linear = "linear"
    hold = "hold"


class OnSingular(StrEnum):
    stop = "stop"
    step_over = "step_over"


@sharing
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
        Interpolation,
        typer.Option(
            metavar="KIND",
            help="How the forces of a file run between their times: spline, linear or hold.",
        ),
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
                "Start at 'slide_1=0.2' or 'crank=40deg,...', m or rad; with --tool they choose "
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
                " 'lqr position=1e4 force=1', 'task_computed_torque kp=400 kd=40' ..."
            ),
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            metavar="WORDS",
            help=(
                "Where it leads: 'pose tool=0.5,0.3,70deg', a path as for 'follow', or its table "
                "(.csv); left out, where the run starts."
            ),
        ),
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            parser=method_named,
            autocompletion=methods_like,
            help=(
                "Of integration, by the name that it has in Python: sharp_smart, rodas (for stiff "
                "systems), rk4 ...; left out, chosen by inputs and tolerance."
            ),
        ),
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
    reading: ReadingOptions = PLAIN,
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
    options |= {"method": method, "step": step}
    how = command.settings(duration, samples, **options)
    source = Source(robot, reading)
    if status := command.simulate(source, start, load, lead, how, target, json):
        raise typer.Exit(status)


@sharing
def follow(
    robot: RobotName,
    path: Annotated[
        str,
        typer.Option(
            metavar="PATH",
            help=(
                "'circle centre=0.45,0.29 radius=0.05 orientation=1.2', 'line start=... end=...', "
                "'through poses=...;...' (m and rad, or with units as in 'radius=5cm'), or a table "
                "of a motion (.csv)."
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
    reading: ReadingOptions = PLAIN,
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
    source = Source(robot, reading)
    follow(source, path, duration, samples, start, names(what), files, json)


@sharing
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
    reading: ReadingOptions = PLAIN,
    json: Json = False,
) -> None:
    """Show the equations of motion at one state: M, C v, G, f, and accelerations under --forces
    (none if left out), or the forces for --accelerations (inverse dynamics)."""
    from linkwork.cli.dynamics import dynamics
    from linkwork.cli.start import StartOptions

    source = Source(robot, reading)
    dynamics(source, StartOptions(tool, joints, rates), accelerations, forces, json)
