"""A robot's equations of motion as CasADi functions with named arguments."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca

from linkwork import checks
from linkwork.equations import Equations
from linkwork.errors import LinkworkError
from linkwork.export.layout import layouts
from linkwork.export.notes import drives_left_out
from linkwork.export.parts import PARTS, PIVOT, WHOLES
from linkwork.kernels.program import trace
from linkwork.mechanism.sticking import strains
from linkwork.model.state import State
from linkwork.patience import announced
from linkwork.robot import Robot

ARRAYS = {"q": "Q", "v": "V", "u": "U", "a": "A", "pose": "POSE", "x": "X"}
"""The symbols of arrays whose numbers have names, and what `layout` calls them."""
STICKS = (
    "friction that sticks by bristles ({}) has states of its own in runs; here it is that of "
    "steady sliding, smoothed"
)


class CasadiFunctions(Mapping[str, ca.Function]):
    """Hold the CasADi functions of a robot in one choice of independent rates, by name; each is
    made when it is first asked for.

    They are CasADi's own, with derivatives, `map`, `generate` and `serialize`, and need no Linkwork
    once they are made. Their inputs have names: q coordinates of the tree's joints, v independent
    rates, dv their accelerations, u actuator forces, a independent coordinates, and, where numbers
    are free, p. All are columns or dense matrices in SI units. The output `pivot` is the weakest
    relative pivot: near zero these rates do not determine the motion.

    Attributes:
        name: of the robot; independent: names of v
        arrays: (name, unit) of each number of q, v, u, a, pose and x, in order, and of each column
            of wrenches; parameters: values of the free numbers p by path, in order
        missing: the functions that the robot cannot have, and why
        notes: sentences on what acts otherwise than in a run
    """

    def __init__(self, robot: Robot, equations: Equations):
        sticking = [strain.of for strain in strains(robot.mechanism)]
        self.name, self.independent = robot.mechanism.name, equations.independent
        self.parameters = dict(robot.parameters)
        sticks = [STICKS.format(", ".join(sticking))] if sticking else []
        self.notes = (*sticks, *drives_left_out(robot, "the functions", "u"))
        self._of = robot, equations
        self._wholes: dict[str, ca.Function] = {}
        self._functions: dict[str, ca.Function] = {}

    def __getitem__(self, name: str) -> ca.Function:
        """Return a function by name.

        Raises:
            LinkworkError: there is none of that name; the robot cannot have it.
        """
        checks.known([name], tuple(PARTS), "function")
        if name not in self._functions:
            part = PARTS[name]
            part.refuse(*self._of)
            with announced(f"making {name} of {self.name} for CasADi"):
                if part.whole not in self._wholes:
                    self._wholes[part.whole] = WHOLES[part.whole](*self._of)
                self._functions[name] = part.of(name, self._wholes[part.whole])
        return self._functions[name]

    def get(self, name: str, default: Any = None) -> Any:
        """Return a function by name, or the default where the robot has none of that name."""
        return self[name] if name in self else default  # noqa: SIM401

    def __getattr__(self, name: str) -> ca.Function:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except LinkworkError as error:
            raise AttributeError(str(error)) from None

    def __contains__(self, name: object) -> bool:
        return name in PARTS and name not in self.missing

    def __iter__(self) -> Iterator[str]:
        return (name for name in PARTS if name not in self.missing)

    def __len__(self) -> int:
        return len(PARTS) - len(self.missing)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *PARTS]

    @cached_property
    def arrays(self) -> dict[str, tuple[tuple[str, str], ...]]:
        """The (name, unit) of each number of an array, or of each column of wrenches."""
        found = layouts(*self._of)
        numbers = {name: found[own].numbers for name, own in ARRAYS.items() if own in found}
        pairs = self._of[0].mechanism.pairs
        return numbers | {"wrenches": tuple((name, "N m, N") for name in pairs)}

    @cached_property
    def missing(self) -> dict[str, str]:
        """The functions that the robot cannot have, and why, in a sentence each."""
        found = {}
        with announced(f"finding which functions {self.name} has"):
            for name, part in PARTS.items():
                try:
                    part.refuse(*self._of)
                except LinkworkError as error:
                    found[name] = str(error)
        return found

    @property
    def operations(self) -> dict[str, int]:
        """The number of operations of each function, but of what is found by Newton's method or as
        the solution of linear equations."""
        functions = {name: self[name] for name in self}
        return {name: trace(f).operations for name, f in functions.items() if f.is_a("SXFunction")}

    def save(self, path: str | Path, names: Sequence[str] | None = None) -> Path:
        """Write functions to a file of CasADi's, which any CasADi reads: their list, and then a
        text in JSON with the robot's name, `arrays`, `parameters` and `notes`.

            file = casadi.FileDeserializer(path)
            functions = {f.name(): f for f in file.unpack()}
            told = json.loads(file.unpack())

        Args:
            path: of the file; names: of functions, all that there are if left out.

        Raises:
            LinkworkError: functions that there are not; a file that cannot be written.
        """
        place = checks.file_path(path, "the path to save to")
        wanted = [self[name] for name in (self if names is None else checks.names(names, "names"))]
        told = {each: getattr(self, each) for each in ("name", "arrays", "parameters", "notes")}
        with checks.writing_to(place, "path"):
            place.open("wb").close()
            file = ca.FileSerializer(str(place))
            file.pack(wanted)
            file.pack(json.dumps(told))
        return place

    def __repr__(self) -> str:
        sizes = {name: len(numbers) for name, numbers in self.arrays.items()}
        sizes = {name: size for name, size in sizes.items() if size}
        sizes |= {"p": len(self.parameters)} if self.parameters else {}
        lines = [
            f"CasADi functions of {self.name}, independent rates {', '.join(self.independent)}",
            ", ".join(f"{name} ({size})" for name, size in sizes.items()),
        ]
        for name in self:
            part = PARTS[name]
            given = [*part.inputs.split(), *(["p"] if self.parameters else [])]
            call = f"{name}({', '.join(given)})"
            gives = ", ".join(each for each in part.renamed if each != PIVOT)
            lines.append(f"  {call:<32} -> {gives:<20} {part.says}")
        lines.append("and pivot, the weakest relative one, where the rates determine the motion")
        lines += [f"without {', '.join(self.missing)} (`missing` says why)"] * bool(self.missing)
        return "\n".join([*lines, *self.notes])


def casadi(robot: Robot, chart: State | Sequence[str] | None = None) -> CasadiFunctions:
    """Return a robot's equations of motion as CasADi functions: `Robot.functions`.

    All that the description says acts in them: weight, springs, friction, stops, contacts, a fluid,
    transmissions. Drives, controllers and wrenches of runs do not: u are the actuators' forces.

    Args:
        robot: the robot.
        chart: names of the independent rates, which have to determine the motion at home; or a
            state, whose independent rates are taken, in an order of elimination that is good
            there (`Robot.in_chart`); those of the robot at home if left out.

    Returns:
        `CasadiFunctions`, by name: forward_dynamics, inverse_dynamics, mass_matrix, coriolis,
            gravity, rate_map, closure, closed, tool_pose, jacobian, energy ...

    Raises:
        LinkworkError: rates that there are not, or that do not determine the motion there.
    """
    checks.needed(robot, Robot)
    if chart is None:
        return CasadiFunctions(robot, robot.equations)
    state = chart if isinstance(chart, State) else robot.in_chart(robot.home, chart)
    return CasadiFunctions(robot, robot.chart_of(robot.own(state)).equations)
