"""A robot written to be used elsewhere: a mechanism file, C, an FMU, functions of CasADi,
equations to be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from linkwork import formats
from linkwork.checks import writing_to
from linkwork.cli.catalogue import built, find, refuse_existing, tell_written
from linkwork.cli.caveats import tell
from linkwork.cli.source import Source
from linkwork.cli.terminal import patience, show_json
from linkwork.errors import LinkworkError
from linkwork.robot import Robot

PLAIN = {
    "out": None,
    "functions": None,
    "precision": "double",
    "sines": "polynomial",
    "free": None,
    "name": None,
    "misra": False,
    "fmi": "3.0",
    "outputs": None,
    "platforms": None,
    "drives": False,
    "symbols": "free",
}
"""What the options of some targets are left out as."""


@dataclass(frozen=True)
class Export:
    """Hold what is asked for: a robot, the mechanism file to write, and the options of some
    targets by name."""

    source: Source
    file: Path | None
    chosen: Mapping[str, Any]
    overwrite: bool
    as_json: bool


@dataclass(frozen=True)
class ExportTarget:
    """Describe what is written: what it is called, how its files end, the options that it takes,
    and what writes it."""

    called: str
    ending: str
    options: frozenset[str]
    write: Callable[[Export], None]


def export(to: str, asked: Export) -> None:
    """Write a robot; refuse options of other targets."""
    for name, value in asked.chosen.items():
        if value != PLAIN[name] and name not in TARGETS[to].options:
            able = {key: target for key, target in TARGETS.items() if name in target.options}
            called = " and ".join(target.called for target in able.values())
            ask = f"--{name} is of {called}; give it with --to {' or '.join(able)}"
            if name == "out" and asked.file is None:
                ask += f"; name FILE{TARGETS[to].ending} behind the robot"
            raise LinkworkError(ask)
    TARGETS[to].write(asked)


def export_yaml(asked: Export) -> None:
    """Write a robot as a mechanism file."""
    if asked.file is None:
        raise LinkworkError("name the mechanism file to write, FILE.yaml, or give --to c --out DIR")
    ending = asked.file.suffix.lower()
    if ending not in formats.NATIVE:
        raise LinkworkError(
            f"{asked.file}: a mechanism file ends in .yaml, not {ending!r}{elsewhere(ending)}"
        )
    mechanism = find(asked.source)
    refuse_existing(asked.file, asked.overwrite)
    mechanism.save(asked.file)
    tell_written([asked.file], asked.as_json)


def elsewhere(ending: str) -> str:
    """Return what writes files of an ending that is no mechanism file's, as part of a sentence."""
    if ending in formats.READ:
        return "; 'linkwork convert' writes model files such as this"
    able = [name for name, target in TARGETS.items() if target.ending == ending]
    return f"; give --to {able[0]}{' --out DIR' if able == ['c'] else ''}" if able else ""


def export_c(asked: Export) -> None:
    """Write a robot as C, and say what was left out."""
    from linkwork.export import c

    chosen = asked.chosen
    if asked.file is not None or chosen["out"] is None:
        raise LinkworkError("C is written to a folder; give it as --out DIR")
    robot = freed(asked)
    with patience("writing C"):
        written = c(
            robot,
            split(chosen["functions"]),
            parameters="free" if robot.parameters else "fixed",
            **{each: chosen[each] for each in ("precision", "sines", "name", "misra")},
        )
    for name in written.files:
        refuse_existing(chosen["out"] / name, asked.overwrite)
    files = written.write(chosen["out"])
    if asked.as_json:
        show_json({"written": files, "functions": written.functions, "notes": written.notes})
        return
    tell(written.notes)
    tell_written(files, False)


def export_fmu(asked: Export) -> None:
    """Write a robot as an FMU, and say what was left out."""
    from linkwork.export import fmu

    chosen = asked.chosen
    if asked.file is None or asked.file.suffix.lower() != ".fmu":
        raise LinkworkError("an FMU is written to a file; name it behind the robot, FILE.fmu")
    refuse_existing(asked.file, asked.overwrite)
    robot = freed(asked)
    if chosen["drives"] and not robot.mechanism.drives:
        raise LinkworkError("--drives: the description gives no drives; leave the option out")
    platforms = [] if chosen["platforms"] == "none" else split(chosen["platforms"])
    with patience("writing the FMU"):
        written = fmu(
            robot,
            chosen["fmi"],
            outputs=split(chosen["outputs"]),
            platforms=platforms,
            drives=robot.drives if chosen["drives"] else None,
            name=chosen["name"],
        )
        file = written.write(asked.file)
    if asked.as_json:
        told = {"platforms": written.platforms, "variables": written.variables}
        show_json({"written": [file], **told, "notes": written.notes})
        return
    tell(written.notes)
    tell_written([file], False)


def export_casadi(asked: Export) -> None:
    """Write a robot's functions to a file of CasADi's, and say what was left out."""
    from linkwork.export import casadi

    if asked.file is None or asked.file.suffix.lower() != ".casadi":
        raise LinkworkError(
            "functions of CasADi are written to a file; name it behind the robot, FILE.casadi"
        )
    refuse_existing(asked.file, asked.overwrite)
    functions, wanted = casadi(freed(asked)), split(asked.chosen["functions"])
    with patience("making functions for CasADi"):
        file = functions.save(asked.file, wanted)
    notes = (
        [] if wanted else [f"{name} is left out: {why}" for name, why in functions.missing.items()]
    )
    notes += functions.notes
    if asked.as_json:
        show_json({"written": [file], "functions": wanted or [*functions], "notes": notes})
        return
    tell(notes)
    tell_written([file], False)


def export_equations(asked: Export, ending: str) -> None:
    """Write a robot's equations in closed form, as LaTeX (.tex) or as a SymPy module (.py)."""
    from linkwork.export import sympy

    if asked.file is None or asked.file.suffix != ending:
        raise LinkworkError(f"name the file to write, FILE{ending}")
    refuse_existing(asked.file, asked.overwrite)
    robot = freed(asked)
    with patience("deriving closed forms"):
        forms = sympy(robot, symbols=asked.chosen["symbols"])
    written(asked.file, forms.latex() if ending == ".tex" else forms.source())
    tell_written([asked.file], asked.as_json)


def written(file: Path, text: str) -> None:
    """Write a text file."""
    with writing_to(file, "name"):
        file.write_text(text, encoding="utf-8", newline="\n")


def freed(asked: Export) -> Robot:
    """Return the robot, with the numbers free that are asked to be."""
    robot, free = built(asked.source), split(asked.chosen["free"])
    return robot.free(*free) if free else robot


def split(names: str | None) -> list[str] | None:
    """Return the names of a list that commas separate."""
    return None if names is None else [name.strip() for name in names.split(",")]


TARGETS: Mapping[str, ExportTarget] = {
    "yaml": ExportTarget("a mechanism file", ".yaml", frozenset(), export_yaml),
    "c": ExportTarget(
        "C",
        ".c",
        frozenset({"out", "functions", "precision", "sines", "free", "name", "misra"}),
        export_c,
    ),
    "fmu": ExportTarget(
        "FMUs",
        ".fmu",
        frozenset({"free", "name", "fmi", "outputs", "platforms", "drives"}),
        export_fmu,
    ),
    "casadi": ExportTarget("CasADi", ".casadi", frozenset({"functions", "free"}), export_casadi),
    "latex": ExportTarget(
        "LaTeX",
        ".tex",
        frozenset({"free", "symbols"}),
        lambda asked: export_equations(asked, ".tex"),
    ),
    "sympy": ExportTarget(
        "SymPy", ".py", frozenset({"free", "symbols"}), lambda asked: export_equations(asked, ".py")
    ),
}
"""What a robot can be written as, by its name on the command line."""
