"""Options and arguments that commands share, and how the shell completes them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

ROBOT_HELP = (
    "A robot of the catalogue (see 'linkwork robots'), a mechanism file (.yaml) or a model file "
    "(.xml, .urdf, .sdf)."
)


def robots_like(incomplete: str) -> list[str]:
    """Return the robots of the catalogue, and the model files and folders, that begin like what was
    typed."""
    from linkwork import formats, robots

    return [
        *(name for name in robots.__all__ if name.startswith(incomplete)),
        *files_like(incomplete, formats.READ),
    ]


def runs_like(incomplete: str) -> list[str]:
    """Return the saved runs, and folders, that begin like what was typed."""
    return files_like(incomplete, (".nc",))


def shown_like(incomplete: str) -> list[str]:
    """Return the robots and the saved runs that begin like what was typed."""
    return [*dict.fromkeys([*robots_like(incomplete), *runs_like(incomplete)])]


def files_like(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    """Return the files of some suffixes, and the folders, that begin like what was typed; a folder
    alone with what is in it, for shells put a space behind a word that is alone."""
    folder, _, begun = incomplete.rpartition("/")
    place = Path(folder or ("/" if incomplete.startswith("/") else "."))
    if not place.is_dir():
        return []
    found = []
    for file in sorted(place.iterdir()):
        if file.name.startswith(begun) and (begun or not file.name.startswith(".")):
            path = incomplete[: len(incomplete) - len(begun)] + file.name
            if file.is_dir():
                found.append(f"{path}/")
            elif file.suffix.lower() in suffixes:
                found.append(path)
    alone = len(found) == 1 and found[0].endswith("/")
    return found + files_like(found[0], suffixes) if alone else found


def methods_like(incomplete: str) -> list[str]:
    """Return the methods of integration that begin like what was typed."""
    from linkwork.simulation.methods import METHODS

    return [name for name in METHODS if name.startswith(incomplete)]


def method_named(text: str) -> str:
    """Return the name of a method of integration; refuse what is none. The list of them is not
    imported for help."""
    known = methods_like("")
    if text not in known:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(map(repr, known))}.")
    return text


RobotName = Annotated[
    str, typer.Argument(metavar="ROBOT", help=ROBOT_HELP, autocompletion=robots_like)
]
Over = Annotated[
    str | None,
    typer.Option(
        metavar="RUN",
        help="Another saved run of the robot, shown faintly at the same times.",
        autocompletion=runs_like,
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print plain data, as JSON: SI units, nothing rounded.")
]
ToolPose = Annotated[
    str | None,
    typer.Option(
        "--tool",
        metavar="POSE",
        help="The tool at 'x,y,angle' (in space 'x,y,z,rx,ry,rz'), at the numbers of its task, or "
        "by name, 'z=0.5,rx=0.1'; m and rad, or with units ('z=12cm,rx=30deg').",
    ),
]
What = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES",
        help="Coordinates that the tool is led in, 'x,y,z,rz'; left out, those of its task.",
    ),
]
Joints = Annotated[
    str | None,
    typer.Option(
        metavar="VALUES",
        help="Joint coordinates 'slide_1=0.2,...', m or rad or with units ('crank=40deg').",
    ),
]
Forces = Annotated[
    str | None,
    typer.Option(
        metavar="VALUES", help="Actuator forces, N or N m: '5,0,0' or 'slide_1=5' (others zero)."
    ),
]
Reference = Annotated[
    str | None,
    typer.Option(
        metavar="VALUES",
        help=(
            "Close the loops from 'slide_1=0.2,...', m or rad or with units ('crank=40deg'), "
            "or from a .yaml or .json file of them, in place of the model's own reference."
        ),
    ),
]
Floating = Annotated[
    bool,
    typer.Option("--floating", help="Let the root, which is fixed to ground, move freely."),
]
Merging = Annotated[
    bool,
    typer.Option(
        "--merging/--no-merging",
        help="Make one joint of hinges that nearly meet, where the file's convention does.",
    ),
]
IncludeRoot = Annotated[
    str | None,
    typer.Option(
        "--include-root",
        metavar="FOLDERS",
        help="Folders whose files an MJCF file may include beside those of its own, separated as "
        "in PATH.",
    ),
]
PackagePath = Annotated[
    str | None,
    typer.Option(
        "--package-path",
        metavar="FOLDERS",
        help="Where package:// and model:// are looked for, as in ROS_PACKAGE_PATH.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")]


@dataclass(frozen=True)
class ReadingOptions:
    """Say how a robot's file is read: the options of all commands that read one."""

    reference: Reference = None
    floating: Floating = False
    packages: PackagePath = None
    merging: Merging = True
    includes: IncludeRoot = None


PLAIN = ReadingOptions()
_SHARED = inspect.signature(ReadingOptions)


def sharing(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that has the options of `ReadingOptions`, one by one, in the place of its
    parameter `reading`."""

    @wraps(command)
    def given(**values: Any) -> None:
        shared = {name: values.pop(name) for name in _SHARED.parameters}
        command(**values, reading=ReadingOptions(**shared))

    types = get_type_hints(command, include_extras=True)
    types |= get_type_hints(ReadingOptions, include_extras=True)
    parts = []
    for name, parameter in inspect.signature(command).parameters.items():
        found = _SHARED.parameters.values() if name == "reading" else [parameter]
        parts += [part.replace(annotation=types[part.name]) for part in found]
    given.__signature__ = inspect.Signature(parts)  # pyright: ignore[reportAttributeAccessIssue]
    given.__annotations__ = types
    return given
