"""The variables of an FMU: what each number is, its name, its unit, its start value and its place
among the values of the model, which is its value reference.

Names are structured: "joint.slide_1", "der(q.slide_1)"; parts that are no names of C stand in
quotes, and what quotes cannot hold is mapped.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.export.fmi.driven import Driven
from linkwork.export.identifiers import identifier
from linkwork.export.layout import ArrayLayout, layouts
from linkwork.mechanism.joints import TURN
from linkwork.mechanism.limits import meeting_name
from linkwork.mechanism.parameter_units import least_of_parameter, unit_of_parameter
from linkwork.model.checks import names
from linkwork.model.reactions import COMPONENTS
from linkwork.model.task import task_of, values
from linkwork.robot import Robot

KINDS: Mapping[str, str] = {
    "positions": "coordinates of all joints",
    "rates": "rates of all joints",
    "accelerations": "accelerations of all joints",
    "tool": "pose of the tool",
    "twist": "twist of the tool: angular velocity, then velocity of its origin, in ground's axes",
    "reactions": "wrenches [moment; force] that joints exert on their second bodies, in the "
    "ground's axes about the origins of the first frames",
    "apart": "how far what may meet is apart, negative where it presses",
    "closure": "largest gap of the loops, lengths over the mechanism's own",
}
"""What an FMU tells: "apart" is no output to ask for, but what events are found by."""
OFFERED = tuple(kind for kind in KINDS if kind != "apart")
USUAL = ("positions", "rates", "tool", "closure")
DIRECT = ("accelerations", "reactions")
"""What depends on the inputs at the same time."""
CONTACT = meeting_name("").removeprefix(": ")
QUOTED = re.compile(r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]+")


@dataclass(frozen=True)
class FmuVariable:
    """Describe a variable.

    role: "time", "input", "parameter" (a free number), "start", "switch", "state", "derivative",
        "output", "local"; of: the state whose derivative it is; start, least: where it has one
    direct: whether it depends on the inputs at the same time; kind: of an output
    """

    name: str
    role: str
    unit: str
    about: str
    start: float | None = None
    of: str | None = None
    direct: bool = False
    kind: str = ""
    least: float | None = None


Groups = dict[str, list[FmuVariable]]
"""Variables by the group's name in C."""


@dataclass(frozen=True)
class FmuVariables:
    """Hold the variables in the order of their value references, and where each group begins.

    places: first references by the group's name in C; counts: numbers of groups
    """

    all: tuple[FmuVariable, ...]
    places: Mapping[str, int]
    counts: Mapping[str, int]
    notes: tuple[str, ...]

    def of(self, role: str) -> list[tuple[int, FmuVariable]]:
        """Return references and variables of a role."""
        return [(k, each) for k, each in enumerate(self.all) if each.role == role]


def fmu_layouts(driven: Driven) -> Mapping[str, ArrayLayout]:
    """Return the arrays of a robot, with commands for the forces of actuators that are driven, and
    the states of drives."""
    robot = driven.robot
    arrays = dict(layouts(robot))
    if driven.drives:
        numbers = tuple(
            (name, driven.unit(name, driven.drives[name].unit) if name in driven.drives else unit)
            for name, unit in arrays["U"].numbers
        )
        arrays["U"] = ArrayLayout("U", "commands of drives, forces of other actuators", numbers)
    if driven.states:
        states = tuple((each.name, each.unit) for each in driven.states)
        arrays["Z"] = ArrayLayout("Z", "states of drives", states)
    return arrays


def variables(driven: Driven, kinds: Sequence[str], by_tree: bool, by_tool: bool) -> FmuVariables:
    """Return the variables of a robot.

    by_tree: whether it starts from all coordinates of the tree, else from the independent ones;
    by_tool: whether it can start from the tool's coordinates, too
    """
    arrays, own = fmu_layouts(driven), StructuredNames()
    begin = arrays["Q" if by_tree else "A"]
    groups = {"TIME": [FmuVariable("time", "time", "s", "time")]}
    groups |= given(driven, arrays["U"], own)
    groups |= begun(driven, begin, arrays, own, by_tool)
    groups |= moving(driven, arrays, own)
    groups |= outputs(driven.robot, arrays, own, kinds)
    # Their places.
    counts = {place: len(found) for place, found in groups.items()}
    places = dict(zip(groups, accumulate(counts.values(), initial=0), strict=False))
    everything = [each for found in groups.values() for each in found]
    if by_tool:
        about = "whether a motion begins at start_tool instead of start"
        everything.append(FmuVariable("start_at_tool", "switch", "", about))
    return FmuVariables(tuple(everything), places, counts, tuple(own.notes))


def given(driven: Driven, u: ArrayLayout, own: StructuredNames) -> Groups:
    """Return what is given: forces and commands u, and free numbers."""
    forces = [
        FmuVariable(own.name(said, name), "input", unit, f"{about}: {name}", 0.0)
        for name, unit in u.numbers
        for said, about in [
            ("command", "command of the drive")
            if name in driven.drives
            else ("force", "forces and torques of the actuators")
        ]
    ]
    parameters = [
        FmuVariable(
            own.name("parameter", path),
            "parameter",
            unit_of_parameter(driven.robot.mechanism, path),
            f"free number of the description: {path}",
            value,
            least=least_of_parameter(driven.robot.mechanism, path),
        )
        for path, value in driven.robot.parameters.items()
    ]
    return {"U": forces, "P": parameters}


def begun(
    driven: Driven,
    begin: ArrayLayout,
    arrays: Mapping[str, ArrayLayout],
    own: StructuredNames,
    by_tool: bool,
) -> Groups:
    """Return where a motion begins; begin: the coordinates that tell it, those of the tool, too,
    where it may begin `by_tool`."""
    robot = driven.robot
    at = dict(zip(robot.equations.tree.coordinates, robot.home.q.tolist(), strict=True))
    coordinates = [
        FmuVariable(own.name("start", name), "start", unit, f"at the start: {name}", at[name])
        for name, unit in begin.numbers
    ]
    rates = of_layout("start", "start_rate", arrays["V"], own, start=0.0)
    drives = [
        FmuVariable(
            own.name("start", each.name),
            "start",
            each.unit,
            f"at the start: {each.name}",
            each.initial,
        )
        for each in driven.states
    ]
    tool: list[FmuVariable] = []
    if by_tool:
        there = values(robot, robot.home.q, task_of(robot)).tolist()
        tool = [
            FmuVariable(
                own.name("start_tool", name), "start", unit, f"tool at the start: {name}", x
            )
            for (name, unit), x in zip(arrays["X"].numbers, there, strict=True)
        ]
    return {"START": coordinates, "START_RATES": rates, "START_DRIVES": drives, "START_TOOL": tool}


def moving(driven: Driven, arrays: Mapping[str, ArrayLayout], own: StructuredNames) -> Groups:
    """Return the states and their derivatives."""
    symbols = {"Q": "q", "W": "w"} | ({"Z": "drive"} if driven.states else {})
    states = {
        place: of_layout("state", symbol, arrays[place], own) for place, symbol in symbols.items()
    }
    derivatives = {
        f"D{place}": [
            FmuVariable(
                f"der({state.name})",
                "derivative",
                per_second(state.unit),
                f"derivative of {state.name}",
                of=state.name,
                direct=place != "Q",
            )
            for state in found
        ]
        for place, found in states.items()
    }
    return states | derivatives


def of_layout(
    role: str, said: str, layout: ArrayLayout, own: StructuredNames, start: float | None = None
) -> list[FmuVariable]:
    """Return the numbers of an array in a role; said: the group in their names."""
    return [
        FmuVariable(own.name(said, name), role, unit, f"{layout.about}: {name}", start)
        for name, unit in layout.numbers
    ]


def outputs(
    robot: Robot, arrays: Mapping[str, ArrayLayout], own: StructuredNames, kinds: Sequence[str]
) -> Groups:
    """Return what is told; what events alone are found by, and what was not asked for, is local."""
    everything = list(told(robot, arrays, own, [kind for kind in kinds if kind != "closure"]))
    role = "output" if "closure" in kinds else "local"
    return {
        "TOLD": [each for each in everything if each.kind not in ("apart", "reactions")],
        "APART": [replace(each, role="local") for each in everything if each.kind == "apart"],
        "GAP": [FmuVariable("closure_error", role, "1", KINDS["closure"], kind="closure")],
        "REACTIONS": [each for each in everything if each.kind == "reactions"],
    }


def told(
    robot: Robot, arrays: Mapping[str, ArrayLayout], own: StructuredNames, kinds: Sequence[str]
) -> Iterable[FmuVariable]:
    """Yield what is told, kind after kind."""
    rates = [(name, f"{robot.unit(name)}/s") for name in robot.mechanism.rates]
    twist = [(f"omega_{axis}", "rad/s") for axis in "xyz"] + [(f"v_{a}", "m/s") for a in "xyz"]
    found = {
        "positions": ("joint", arrays["JOINTS"].numbers),
        "rates": ("rate", rates),
        "accelerations": ("acceleration", [(name, per_second(unit)) for name, unit in rates]),
        "tool": ("tool", arrays["POSE"].numbers),
        "twist": ("twist", twist),
        "reactions": (
            "reaction",
            [
                (f"{joint}.{part}", "N m" if part.startswith("moment") else "N")
                for joint in robot.mechanism.pairs
                for part in COMPONENTS
            ],
        ),
        "apart": ("apart", [(name, gap_unit(robot, name)) for name in robot.equations.gaps]),
    }
    for kind in kinds:
        said, numbers = found[kind]
        for name, unit in numbers:
            about = f"{KINDS[kind]}: {name}"
            yield FmuVariable(
                own.name(said, name), "output", unit, about, direct=kind in DIRECT, kind=kind
            )


def gap_unit(robot: Robot, name: str) -> str:
    """Return the unit of how far what may meet is apart: of a stop that of its coordinate."""
    of, _, met = name.rpartition(": ")
    if met == CONTACT:
        return "m"
    return "rad" if of.endswith(f".{TURN}") else robot.unit(of)


def kinds_of(robot: Robot, asked: Sequence[str] | None) -> tuple[str, ...]:
    """Return the kinds of outputs that are wanted, in the order of `KINDS`; refuse what the robot
    cannot tell."""
    chosen = USUAL if asked is None else names(asked, "outputs")
    checks.known(chosen, OFFERED, "output", " of an FMU")
    wanted = [kind for kind in KINDS if kind in chosen or kind == "apart"]
    if not robot.mechanism.tools:
        lacking = [kind for kind in wanted if kind in ("tool", "twist")]
        if asked is not None and lacking:
            raise LinkworkError(
                f"the output {lacking[0]!r} needs a tool, and {robot.mechanism.name} has none; "
                "leave it out of the outputs, or describe a tool"
            )
        wanted = [kind for kind in wanted if kind not in lacking]
    return tuple(wanted)


def per_second(unit: str) -> str:
    """Return the unit of a derivative."""
    return {"m/s": "m/s2", "rad/s": "rad/s2"}.get(unit, f"{unit}/s")


class StructuredNames:
    """Make structured names, each once."""

    def __init__(self) -> None:
        self.taken: set[str] = set()
        self.notes: list[str] = []

    def name(self, group: str, name: str) -> str:
        """Return the name of a variable of a group, by its name in the description."""
        wanted = f"{group}.{'.'.join(map(quoted, name.split('.')))}"
        wanted = re.sub(r"\.'(\d+)'", r"[\1]", wanted)
        unique, count = wanted, 1
        while unique in self.taken:
            count += 1
            unique = f"{wanted}_{count}"
        self.taken.add(unique)
        plain = unique.replace("'", "")
        if plain not in (f"{group}.{name}", re.sub(r"\.(\d+)", r"[\1]", f"{group}.{name}")):
            self.notes.append(f"{name!r} is {unique}")
        return unique


def quoted(part: str) -> str:
    """Return a part of a name: as it is, in quotes, or mapped to what names can hold."""
    if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", part):
        return part
    return f"'{part}'" if QUOTED.fullmatch(part) else identifier(part)
