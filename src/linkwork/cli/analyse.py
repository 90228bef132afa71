"""`linkwork analyse ROBOT SUBJECT`: the subjects and their options; what each does is in
`studies`."""

from pathlib import Path
from typing import Annotated

import typer

from linkwork.cli.group import Subcommands
from linkwork.cli.options import (
    PLAIN,
    Forces,
    Joints,
    Json,
    Overwrite,
    ReadingOptions,
    RobotName,
    ToolPose,
    What,
    sharing,
)
from linkwork.cli.source import Source

analyse = typer.Typer(
    cls=Subcommands,
    no_args_is_help=True,
    help="Study a robot: branches, singularities, workspace, small motions, statics.",
)


@analyse.callback()
@sharing
def robot(
    context: typer.Context,
    robot: RobotName,
    reading: ReadingOptions = PLAIN,
) -> None:
    context.obj = Source(robot, reading)


@analyse.command()
def modes(
    context: typer.Context,
    joints: Joints = None,
    tool: ToolPose = None,
    starts: Annotated[int, typer.Option(help="Most random starts to try.")] = 400_000,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 0,
    json: Json = False,
) -> None:
    """Find all assembly modes (for --joints; the actuated ones at home if left out), or all working
    modes (for --tool)."""
    from linkwork.cli import studies

    studies.modes(context.obj, joints, tool, starts, seed, json)


@analyse.command()
def singularities(
    context: typer.Context,
    joints: Joints = None,
    tool: ToolPose = None,
    what: What = None,
    json: Json = False,
) -> None:
    """Tell of which kinds a configuration (home if left out) is singular, and how far it is from
    being so."""
    from linkwork.cli import studies

    studies.singularities(context.obj, joints, tool, what, json)


@analyse.command()
def workspace(
    context: typer.Context,
    grid: Annotated[
        str,
        typer.Option(
            metavar="AXES",
            help="Poses: 'x=0:1:101,y=0:1:101,angle=30deg' (from:to:count, or one number), m and "
            "rad or with units.",
        ),
    ],
    joints: Joints = None,
    tool: ToolPose = None,
    limits: Annotated[
        str | None,
        typer.Option(
            metavar="RANGES", help="Joint limits 'slide_1=0:0.5,...' beside the description's."
        ),
    ] = None,
    rates: Annotated[
        str | None,
        typer.Option(metavar="VALUES", help="Largest actuator rates, for the isotropic velocity."),
    ] = None,
    forces: Annotated[
        str | None,
        typer.Option(metavar="VALUES", help="Largest actuator forces, for the isotropic force."),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="What the picture shows: conditioning (if left out), det_A, det_B, "
            "isotropic_force ..., or reachable.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.nc", help="Write the map as NetCDF.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the map: .svg, .pdf or .png.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Map what the tool reaches, and how well, on the working mode of --tool or --joints
    (home if left out)."""
    from linkwork.cli import studies

    asked = studies.Map(grid, limits, rates, forces, quantity, out, picture, overwrite)
    studies.workspace(context.obj, joints, tool, asked, json)


@analyse.command()
def dexterity(
    context: typer.Context,
    joints: Joints = None,
    tool: ToolPose = None,
    what: What = None,
    json: Json = False,
) -> None:
    """Tell how well the actuators move the tool in a configuration (home if left out):
    conditioning, manipulability, transmission angles and indices."""
    from linkwork.cli import transmission

    transmission.dexterity(context.obj, joints, tool, what, json)


@analyse.command()
def linearise(
    context: typer.Context,
    joints: Joints = None,
    tool: ToolPose = None,
    forces: Forces = None,
    json: Json = False,
) -> None:
    """Show how the robot moves near a configuration at rest: poles, natural frequencies and shapes,
    controllability.

    Where --forces is left out, the actuators hold the configuration.
    """
    from linkwork.cli import studies

    studies.linearise(context.obj, joints, tool, forces, json)


@analyse.command()
def stiffness(
    context: typer.Context,
    joint_stiffness: Annotated[
        str,
        typer.Option(
            "--joint-stiffness",
            metavar="VALUES",
            help="Of each joint, N/m or N m/rad: 'slide_1=1e5,slide_2=1e5'.",
        ),
    ],
    joints: Joints = None,
    tool: ToolPose = None,
    json: Json = False,
) -> None:
    """Show the stiffness at the tool that the stiffnesses of joints give."""
    from linkwork.cli import studies

    studies.stiffness(context.obj, joints, tool, joint_stiffness, json)


@analyse.command()
def equilibrium(
    context: typer.Context,
    joints: Joints = None,
    tool: ToolPose = None,
    forces: Forces = None,
    every: Annotated[
        bool, typer.Option("--all", help="Look for all equilibria, from random configurations.")
    ] = False,
    json: Json = False,
) -> None:
    """Find where the robot rests under its weight, springs and constant actuator forces
    (none if left out)."""
    from linkwork.cli import studies

    studies.equilibrium(context.obj, joints, tool, forces, every, json)


@analyse.command()
def parameters(
    context: typer.Context,
    effects: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Joint effects beside masses: 'slide_1.friction.viscous,slide_1.rotor_inertia'.",
        ),
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN.nc",
            help="Identify them from this run; left out: show the described values.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List the base parameters: the combinations of masses and friction that motions can tell."""
    from linkwork.cli import studies

    studies.parameters(context.obj, effects, run, json)


@analyse.command()
def calibrate(
    context: typer.Context,
    poses: Annotated[
        Path,
        typer.Option(
            metavar="FILE.csv",
            help="A row for each sample: columns of the actuators' readings, of the tool's pose "
            "(x,y,angle or x,y,z,rx,ry,rz, or x,y,z) and of further joints' encoders.",
        ),
    ],
    free: Annotated[
        str,
        typer.Option(
            metavar="PATHS",
            help="Numbers to be found: 'rod_*.length,pivot_1.frames.0.position.x'.",
        ),
    ],
    joints: Joints = None,
    tool: ToolPose = None,
    position: Annotated[
        float | None, typer.Option(help="Deviation of measured positions, m.")
    ] = None,
    rotation: Annotated[
        float | None, typer.Option(help="Deviation of measured rotations, rad.")
    ] = None,
    encoders: Annotated[
        float | None, typer.Option(help="Deviation of further joints' readings, m or rad.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="Write the description with what was found."),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Find lengths, positions and directions from measured poses, on the branch of a configuration
    (--joints or --tool; home if left out)."""
    from linkwork.cli import calibration as command

    measured = command.MeasuredTable(poses, free, position, rotation, encoders, out, overwrite)
    command.calibrate(context.obj, joints, tool, measured, json)
