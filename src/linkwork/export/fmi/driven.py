"""The drives of a robot as an FMU has them: commands come in, forces act on the joints, and the
states of drives are integrated beside those of the mechanism.

    F = F(c, x, w_x, z),    z' = f(c, x, w_x, z)        x, w_x: coordinate and rate of the actuator

Programs take  u = (c, z)  where others take the forces: those of actuators without a drive are
their commands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from linkwork import checks
from linkwork.control.acting import require_drives
from linkwork.control.drives import Drive
from linkwork.control.observation import Quantity, expression
from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.errors import LinkworkError
from linkwork.mechanism import Combination
from linkwork.robot import Robot


@dataclass(frozen=True)
class DriveState:
    """Describe a state of a drive: its name, "slide_1.current", its unit, its value at the
    start."""

    name: str
    unit: str
    initial: float


@dataclass(frozen=True, eq=False)
class Driven:
    """Hold a robot with its drives, by actuator."""

    robot: Robot
    drives: Mapping[str, Drive]

    @classmethod
    def of(cls, robot: Robot, drives: Mapping[str, Drive] | None) -> Driven:
        """Return a robot with drives.

        Raises:
            LinkworkError: a drive of what is no actuator, or that is none; one that reads an angle
                whose turns do not follow from the tree's coordinates.
        """
        drives = checks.by_name(drives, "drives", "{'slide_1': Lag(0.01)}")
        require_drives(robot.names, drives)
        driven = cls(robot, drives)
        driven.require_turns()
        return driven

    @cached_property
    def states(self) -> tuple[DriveState, ...]:
        """The states z of all drives."""
        return tuple(
            DriveState(f"{name}.{each.name}", self.unit(name, each.unit), each.initial)
            for name, drive in self.drives.items()
            for each in drive.extras
        )

    def unit(self, actuator: str, unit: str) -> str:
        """Return a unit of a drive; "N, N m" is that of the actuator's force."""
        force = "N m" if self.robot.unit(actuator) == "rad" else "N"
        return force if unit == "N, N m" else unit

    def symbol(self) -> ca.SX:
        """Return symbols of u = (c, z)."""
        return SX.sym("u", len(self.robot.actuators) + len(self.states))

    def acting(self, equations: Equations, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the forces of all actuators and z', as functions of q, v and u of a chart."""
        actuators = self.robot.actuators
        *forces, z = ca.vertsplit(u, [*range(len(actuators) + 1), u.numel()])
        z, changes = list(ca.vertsplit(z)) if self.states else [], []
        for name, drive in self.drives.items():
            own, z = z[: len(drive.extras)], z[len(drive.extras) :]
            x, rate = (expression(equations, Quantity(kind, name)) for kind in ("position", "rate"))
            place = actuators.index(name)
            forces[place], change = drive.equations(forces[place], x, rate, own)
            changes += change
        return ca.vertcat(SX(0, 1), *forces), ca.vertcat(SX(0, 1), *changes)

    def require_turns(self) -> None:
        """Refuse drives that read angles which are known within a turn."""
        x = SX.sym("x")
        for name, drive in self.drives.items():
            if not self.closes_by_angle(name):
                continue
            z = [SX.sym(each.name) for each in drive.extras]
            force, change = drive.equations(SX.sym("c"), x, SX.sym("w"), z)
            if ca.depends_on(ca.vertcat(force, *change), x):
                raise LinkworkError(
                    f"the drive of {name!r} reads an angle that an FMU knows within a turn, for "
                    "its joint closes a loop; leave the drives out, or let another joint of the "
                    "loop close it"
                )

    def closes_by_angle(self, actuator: str) -> bool:
        """Tell whether an actuator acts on an angle of a joint that closes a loop; what bodies show
        of each other follows from the tree's coordinates."""
        robot, line = self.robot, self.robot.mechanism.transmissions.get(actuator)
        summed = tuple(line.ratios) if isinstance(line, Combination) else ()
        labels = (actuator,) if line is None else summed
        tree = robot.equations.tree.coordinates
        return any(label not in tree and robot.unit(label) == "rad" for label in labels)
