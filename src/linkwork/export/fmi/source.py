"""The sources of an FMU: the robot's equations as exported C with the model that stands on them, an
instance of it, and the functions of the standard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from sys import float_info

from linkwork.errors import LinkworkError
from linkwork.export.calls import CALLS, Call, needed_programs
from linkwork.export.fmi.balance import JointBalance
from linkwork.export.fmi.driven import Driven
from linkwork.export.fmi.programs import programs, stepping_programs
from linkwork.export.fmi.variables import FmuVariable, FmuVariables, fmu_layouts
from linkwork.export.header import STATUS, header_text, safe
from linkwork.export.identifiers import identifiers
from linkwork.export.source import listed, source_text, words
from linkwork.export.statements import Dialect
from linkwork.export.templates import filled
from linkwork.kernels.program import Program
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.mechanism.sticking import require_no_bristles
from linkwork.robot import Robot

DIALECT = Dialect()
TOKEN = "INSTANTIATION_TOKEN"
FIXED = ("LW_FILE_model.h", "LW_FILE_instance.h", "LW_FILE_instance.c")


@dataclass(frozen=True)
class Abilities:
    """Tell what the functions are that an FMU stands on, with their programs, and how a motion may
    begin.

    by_tree: from all coordinates of the tree, where the independent rates have no coordinates of
    their own, else from the independent ones; by_tool: from the tool's coordinates, too; notes:
    why not
    """

    by_tree: bool
    by_tool: bool
    calls: tuple[Call, ...]
    programs: dict[str, Program]
    notes: tuple[str, ...]


def abilities(driven: Driven) -> Abilities:
    """Return what an FMU of a robot can do; refuse what cannot move over time."""
    robot = driven.robot
    require_smooth_friction(robot)
    own, free = stepping_programs(driven), bool(robot.parameters)
    found = {name: part.program(robot, free) for name, part in own.items()}
    calls, notes = [], []
    for name in ("kinematics", "tool_to_joints", "project", "start", "step"):
        try:
            found |= needed_programs(robot, CALLS[name], free, found)
        except LinkworkError as error:
            if name not in ("kinematics", "tool_to_joints"):
                raise
            if name == "tool_to_joints":
                notes.append(f"no motion begins at a pose of the tool: {error}")
            continue
        calls.append(CALLS[name])
    names = {call.name for call in calls}
    return Abilities(
        "kinematics" not in names, "tool_to_joints" in names, tuple(calls), found, tuple(notes)
    )


def require_smooth_friction(robot: Robot) -> None:
    """Refuse friction that depends on what joints carry, or has states of its own."""
    require_no_bearings(
        robot.mechanism.joints,
        "an FMU leaves out",
        "export the robot without it, or write it as C and integrate motion, which has it",
    )
    require_no_bristles(robot.mechanism, "an FMU leaves out", "give it without a bristle")


def sources(
    driven: Driven, version: str, known: FmuVariables, can: Abilities, kinds: Sequence[str]
) -> dict[str, str]:
    """Return the sources by their names, with lw for the prefix; the token stands for itself.

    kinds: of outputs
    """
    # The programs of the model, and those of the balance of the joints.
    robot = driven.robot
    free, closed = bool(robot.parameters), robot.mobility < robot.equations.nv
    arrays, fields = fmu_layouts(driven), identifiers(robot.parameters)
    balance = JointBalance(driven) if "reactions" in kinds else None
    parts = {**programs(driven, kinds), **(balance.programs if balance else {})}
    own = {name: part.program(robot, free) for name, part in parts.items()}
    rows, columns = balance.places if balance else ([], [])
    # What stands in place of words in the pieces of C.
    numbers = [each for each in known.all if each.role != "switch"]
    given = words(robot, free, len(driven.states)) | {
        "WITHFREE": "" if free else "//",
        "BYTOOL": "" if can.by_tool else "//",
        "BYJOINTS": "//" if can.by_tree else "",
        "BYTREE": "" if can.by_tree else "//",
        "REACTING": "" if balance else "//",
        "BALANCE_ROWS": ", ".join(map(str, rows)),
        "BALANCE_COLUMNS": ", ".join(map(str, columns)),
        "PLACES": places(known, balance.size if balance else 0, len(rows)),
        "START_VALUES": listed([each.start or 0.0 for each in numbers], DIALECT),
        "LEAST_VALUES": listed([least(each) for each in numbers], DIALECT),
        "MEANINGS": ",\n".join(f'        "{says}"' for _, says in STATUS),
        "NAMES": ",\n".join(f'    "{safe(each.name)}"' for each in numbers),
    }
    # The files.
    pieces = ["fmu_opening.c", *["fmu_given.c"] * free, "fmu_choices.c"]
    pieces += ["fmu_other_charts.c"] * closed
    pieces += ["fmu_reactions.c"] * (balance is not None)
    model = "\n".join(filled(piece, DIALECT, given) for piece in (*pieces, "fmu_model.c"))
    equations = source_text(
        robot, DIALECT, arrays, can.calls, can.programs | own, fields, (), model
    )
    header = header_text(robot, arrays, can.calls, fields, (), DIALECT.precision)
    standard = f"fmi{version[0]}"
    fixed = {name: name.replace("LW_FILE", "fmu") for name in FIXED}
    fixed |= {name: name for name in (f"{standard}.h", f"{standard}.c")}
    found = {name: filled(piece, DIALECT, given) for name, piece in fixed.items()}
    return {"LW_FILE.h": header, "LW_FILE.c": equations, **found}


def least(each: FmuVariable) -> float:
    """Return the least value that a variable may have."""
    return -float_info.max if each.least is None else each.least


def places(known: FmuVariables, unknowns: int, filled_in: int) -> str:
    """Return where the groups of values begin, how many numbers those have that only an FMU has,
    and of the balance of reactions how many unknowns there are and numbers that may not be zero."""
    lines = [f"    LW_AT_{group} = {place}" for group, place in known.places.items()]
    lines += [f"    LW_{group} = {known.counts[group]}" for group in ("TOLD", "APART", "REACTIONS")]
    lines += [f"    LW_UNKNOWNS = {unknowns}", f"    LW_FILLED = {filled_in}"]
    total = sum(known.counts.values())
    return ",\n".join([*lines, f"    LW_VALUES = {total}", f"    LW_AT_START_AT_TOOL = {total}"])
