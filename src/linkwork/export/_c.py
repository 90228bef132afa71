"""A robot's equations of motion as C99: one header and one source, and what builds and tests
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.export.calls import CALLS, Call, needed_programs
from linkwork.export.header import header_text
from linkwork.export.identifiers import given_prefix, identifiers, named, prefix
from linkwork.export.layout import ArrayLayout, layouts
from linkwork.export.notes import drives_left_out
from linkwork.export.packaging import package_files
from linkwork.export.source import source_text
from linkwork.export.statements import Dialect, Precision, Sines
from linkwork.kernels.program import Program
from linkwork.model.checks import names
from linkwork.patience import announced
from linkwork.robot import Robot

FUNCTIONS = tuple(CALLS)
Parameters = Literal["fixed", "free"]


@dataclass(frozen=True)
class CExport:
    """Hold the files of an export.

    name: what all names in them begin with
    files: their texts, by their names in the folder
    functions: which functions they have
    notes: sentences on what was left out, and names that C cannot hold
    """

    name: str
    files: Mapping[str, str]
    functions: tuple[str, ...]
    notes: tuple[str, ...]

    def write(self, folder: str | Path) -> list[Path]:
        """Write the files into a folder, which is made where there is none; return their paths.

        Raises:
            LinkworkError: a folder that cannot be written.
        """
        place = checks.file_path(folder, "the folder")
        with checks.writing_to(place, "folder"):
            for name, text in self.files.items():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                (place / name).write_text(text, encoding="utf-8", newline="\n")
        return [place / name for name in self.files]

    def __repr__(self) -> str:
        return f"CExport({self.name!r}: {', '.join(self.functions)})"


def c(
    robot: Robot,
    functions: Sequence[str] | None = None,
    *,
    precision: Precision = "double",
    parameters: Parameters = "fixed",
    sines: Sines = "polynomial",
    name: str | None = None,
    misra: bool = False,
) -> CExport:
    """Write a robot's equations of motion as C99 that needs nothing but the C library's `math.h`.

    Args:
        robot: the robot; the functions are those of its own independent rates.
        functions: names of the functions that are wanted (`linkwork.export.FUNCTIONS`); all that
            this robot has if left out.
        precision: of all numbers, "double" or "float".
        parameters: "fixed": the description's numbers are folded in; "free": the free ones of the
            robot (`Robot.free`) are a structure that functions take.
        sines: "polynomial": those of the kernels, with which all numbers are the kernels'; "libm":
            the C library's.
        name: what all names begin with; made of the robot's name if left out.
        misra: whether a note on deviations from MISRA C:2012 goes with it.

    Returns:
        A `CExport`: its `files` by name (header, source, self-test, CMake, pkg-config, README),
            `write(folder)`, and `notes` on what was left out.

    Raises:
        LinkworkError: a function that this robot does not have, or another choice that there is
            not.
    """
    checks.needed(robot, Robot)
    choose("precision", precision, ("double", "float"))
    choose("parameters", parameters, ("fixed", "free"))
    choose("sines", sines, ("polynomial", "libm"))
    checks.switch(misra, "misra")
    free = parameters == "free"
    if free and not robot.parameters:
        raise LinkworkError(
            "no number of the robot is free; name those that are to be parameters by robot.free, "
            'or take parameters="fixed"'
        )
    with announced(f"writing {robot.mechanism.name} in C"):
        return written(robot, functions, free, Dialect(precision, sines), name, misra)


def choose(what: str, value: object, allowed: tuple[str, ...]) -> None:
    """Refuse a choice that there is not."""
    if not checks.among(value, allowed):
        named = " or ".join(map(repr, allowed))
        raise LinkworkError(f"{what} is {checks.shown(value)}; give {named}")


def written(
    robot: Robot,
    functions: Sequence[str] | None,
    free: bool,
    dialect: Dialect,
    name: str | None,
    misra: bool,
) -> CExport:
    """Return the export of what was checked."""
    # The functions that there are, and why others are not.
    wanted = FUNCTIONS if functions is None else names(functions, "functions")
    checks.known(wanted, FUNCTIONS, "function of an export")
    if not wanted:
        raise LinkworkError(f"functions names none; give some of {', '.join(FUNCTIONS)}")
    calls: list[Call] = []
    programs: dict[str, Program] = {}
    notes: list[str] = []
    for each in FUNCTIONS if wanted is FUNCTIONS else with_start(wanted):
        try:
            made = needed_programs(robot, CALLS[each], free, programs)
        except LinkworkError as error:
            if functions is not None:
                raise
            notes.append(f"{each} is left out: {error}")
            continue
        calls.append(CALLS[each])
        programs |= made
    notes += drives_left_out(robot, "the C", "u")
    # Names that C cannot hold.
    arrays = layouts(robot)
    own = prefix(robot.mechanism.name) if name is None else given_prefix(name)
    fields = identifiers(robot.parameters if free else ())
    notes += [*mapped_names(arrays), *(f"{path} is {c} in C" for path, c in fields.items())]
    # The files.
    header = header_text(robot, arrays, calls, fields, notes, dialect.precision)
    source = source_text(robot, dialect, arrays, calls, programs, fields, notes)
    package = package_files(robot, dialect, calls, free, notes, misra)
    files = {"LW_FILE.h": header, "LW_FILE.c": source, **package}
    files = {named(name, own): named(text, own) for name, text in files.items()}
    return CExport(own, files, tuple(call.name for call in calls), tuple(notes))


def with_start(wanted: Sequence[str]) -> list[str]:
    """Return the functions that are wanted, in their order, with what begins a motion where it goes
    on."""
    needed = {*wanted} | ({"start"} if {"step", "step_rk4"} & {*wanted} else set())
    return [each for each in FUNCTIONS if each in needed]


def mapped_names(arrays: Mapping[str, ArrayLayout]) -> list[str]:
    """Return sentences on names that are other ones in C but for their letters' case."""
    found = {
        name: place
        for layout in arrays.values()
        if layout.shown
        for name, place in layout.places.items()
        if place != name.upper() and place != name.upper().replace(".", "_")
    }
    return [f"{name!r} is {place} in C" for name, place in found.items()]
