"""Commands that show a mechanism and write it: `info`, `robots`, `export`, `convert`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from linkwork.cli.options import PLAIN, Json, Overwrite, ReadingOptions, RobotName, sharing
from linkwork.cli.source import Source


class ExportFormat(StrEnum):
    """What `export` writes."""

    yaml = "yaml"
    c = "c"
    fmu = "fmu"
    casadi = "casadi"
    latex = "latex"
    sympy = "sympy"


class FmiVersion(StrEnum):
    three = "3.0"
    two = "2.0"


class LoopPlace(StrEnum):
    inside = "inside"
    beside = "beside"


class SymbolsOf(StrEnum):
    free = "free"
    all = "all"


class Precision(StrEnum):
    double = "double"
    float = "float"


class Sines(StrEnum):
    polynomial = "polynomial"
    libm = "libm"


@sharing
def info(
    robot: RobotName,
    reading: ReadingOptions = PLAIN,
    json: Json = False,
) -> None:
    """Show a robot: mobility, joints, loops, redundant rows, limits, springs, sizes of the compiled
    functions."""
    from linkwork.cli.info import show

    show(Source(robot, reading), json)


def robots(json: Json = False) -> None:
    """List the robots of the catalogue."""
    from linkwork.cli.catalogue import show

    show(json)


@sharing
def export(
    robot: RobotName,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="What to write: .yaml, .fmu with --to fmu, .casadi with --to casadi, .tex with "
            "--to latex, .py with --to sympy; of C a folder, --out.",
        ),
    ] = None,
    to: Annotated[
        ExportFormat,
        typer.Option(help="A mechanism file, C99, an FMU, functions of CasADi, or equations."),
    ] = ExportFormat.yaml,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="C: the folder for its files.")
    ] = None,
    functions: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="C, CasADi: the functions, 'motion,jacobian'; all if left out.",
        ),
    ] = None,
    precision: Annotated[Precision, typer.Option(help="C: of all numbers.")] = Precision.double,
    sines: Annotated[
        Sines, typer.Option(help="C: the kernels' polynomials, or the C library's.")
    ] = Sines.polynomial,
    free: Annotated[
        str | None,
        typer.Option(metavar="PATHS", help="Numbers that stay free, 'gravity.z,rod.mass'."),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            help="C: what all names begin with; FMU: its identifier; else the robot's name."
        ),
    ] = None,
    misra: Annotated[
        bool, typer.Option("--misra", help="C: with a note on deviations from MISRA C:2012.")
    ] = False,
    fmi: Annotated[FmiVersion, typer.Option(help="FMU: version of FMI.")] = FmiVersion.three,
    outputs: Annotated[
        str | None,
        typer.Option(
            metavar="KINDS",
            help="FMU: of positions, rates, accelerations, tool, twist, reactions, closure, as "
            "'rates,tool'; positions, rates, tool and closure if left out.",
        ),
    ] = None,
    platforms: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="FMU: binaries for x86_64-linux, aarch64-linux, x86_64-windows, separated by "
            "commas, or none; all that a compiler is found for if left out.",
        ),
    ] = None,
    drives: Annotated[
        bool,
        typer.Option("--drives", help="FMU: its inputs are commands of the description's drives."),
    ] = False,
    symbols: Annotated[
        SymbolsOf, typer.Option(help="Equations: symbols of free numbers, or of all.")
    ] = SymbolsOf.free,
    reading: ReadingOptions = PLAIN,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write a robot as a mechanism file, to be changed and used as ROBOT, as C99 (--to c), as a
    Functional Mock-up Unit (--to fmu), as functions of CasADi (--to casadi), or its equations in
    closed form (--to latex, --to sympy)."""
    from linkwork.cli.exported import Export, export

    source = Source(robot, reading)
    chosen = {"out": out, "functions": functions, "precision": precision.value, "free": free}
    chosen |= {"sines": sines.value, "name": name, "misra": misra, "symbols": symbols.value}
    chosen |= {"fmi": fmi.value, "outputs": outputs, "platforms": platforms, "drives": drives}
    export(to.value, Export(source, file, chosen, overwrite, json))


@sharing
def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="A",
            help="A model file (.xml or .mjcf, .urdf, .sdf, .yaml) or a robot of the catalogue.",
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(metavar="B", help="The file to write: .yaml, .xml or .mjcf, .urdf, .sdf."),
    ],
    reading: ReadingOptions = PLAIN,
    loops: Annotated[
        LoopPlace,
        typer.Option(help="URDF: loops inside it, or beside it in a .yaml as LAAS has them."),
    ] = LoopPlace.inside,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Turn a model file into another: MJCF, URDF or SDF into a mechanism file, that into one of
    them.

    What the other format does not hold is said, sentence by sentence.
    """
    from linkwork.cli.convert import convert

    given = Source(source, reading)
    convert(given, target, loops.value, overwrite, json)
