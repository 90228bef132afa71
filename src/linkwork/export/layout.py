"""The arrays of an export: what each number is, its name, its unit, and its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkwork.equations import Equations
from linkwork.export.identifiers import identifiers
from linkwork.model.labels import POSES
from linkwork.robot import Robot


@dataclass(frozen=True)
class ArrayLayout:
    """Name the numbers of one kind of array.

    size: the macro of its length; about: what the array holds; numbers: (name, unit) in order
    shown: whether each place has a name in C; names that C cannot hold are mapped
    """

    size: str
    about: str
    numbers: tuple[tuple[str, str], ...]
    shown: bool = True

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def places(self) -> dict[str, str]:
        """The name of each place in C, behind the macro of the length, by the number's name."""
        return identifiers((name for name, _ in self.numbers), upper=True)


def layouts(robot: Robot, chart: Equations | None = None) -> Mapping[str, ArrayLayout]:
    """Return the arrays of a robot by their symbols; chart: whose independent rates are those of v,
    the robot's own if left out."""
    equations = chart or robot.equations
    force = {"m": "N", "rad": "N m"}

    def rates(names: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
        return tuple((name, f"{robot.unit(name)}/s") for name in names)

    # What equations and kernels take and give.
    rows = zip(equations.rows.names, equations.rows.units.tolist(), strict=True)
    found = [
        ArrayLayout(
            "Q",
            "coordinates of the joints of the spanning tree",
            tuple((name, robot.unit(name)) for name in equations.tree.coordinates),
        ),
        ArrayLayout("V", "independent rates", rates(equations.independent)),
        ArrayLayout(
            "U",
            "forces and torques of the actuators",
            tuple((name, force[robot.unit(name)]) for name in robot.actuators),
        ),
        ArrayLayout("W", "rates of the joints of the spanning tree", rates(equations.tree.rates)),
        ArrayLayout(
            "JOINTS",
            "coordinates of all joints",
            tuple((name, robot.unit(name)) for name in robot.coordinates),
        ),
        ArrayLayout(
            "PHI",
            "closure rows",
            tuple((name, _row_unit(name, unit)) for name, unit in rows),
            shown=False,
        ),
    ]
    # Coordinates that direct kinematics starts from, where each has a rate of its own.
    tree = equations.tree
    single = {tree.rates[k]: tree.coordinates[place] for place, k in tree.single}
    if all(name in single for name in equations.independent):
        given = tuple((single[name], robot.unit(name)) for name in equations.independent)
        found.append(ArrayLayout("A", "coordinates of the independent rates", given))
    # The tool's, where there is one.
    pose = POSES[robot.planar] if robot.mechanism.tools else ()
    units = tuple((name, "m" if name in ("x", "y", "z") else "rad") for name in pose)
    found.append(ArrayLayout("POSE", "pose of the tool", units))
    if robot.task:
        lengths = ("x", "y", "z", "distance")
        task = tuple((name, "m" if name in lengths else "rad") for name in robot.task)
        found.append(ArrayLayout("X", "task coordinates of the tool", task))
    return {layout.size: layout for layout in found}


def _row_unit(name: str, unit: float) -> str:
    """Return the unit of a closure row: lengths are divided by the mechanism's own elsewhere."""
    return "m" if "position" in name or "length" in name else "1" if unit == 1.0 else "m, rad"
