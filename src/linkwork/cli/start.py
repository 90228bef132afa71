"""Where a command begins: a state in words."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

from linkwork.cli.caveats import tell
from linkwork.cli.entries import by_name, number, pairs
from linkwork.formats.references import amount, angles_of
from linkwork.mechanism import Mechanism
from linkwork.mechanism.task import TaskCoordinate, is_length, unit
from linkwork.model.task import asked_of, known
from linkwork.robot import Robot, State

TOOL = "--tool"
FAR = 2 * tau  # beyond its limits, or from zero, an angle may be meant in degrees [rad]


def joints_given(robot: Robot, text: str) -> dict[str, float]:
    """Return joint coordinates by name [m, rad], which may be given with units."""
    return coordinates_given(robot.mechanism, text, "--joints")


def coordinates_given(mechanism: Mechanism, text: str, option: str) -> dict[str, float]:
    """Return joint coordinates by name [m, rad], which may be given with units; print which angles
    are so far away that degrees may be meant."""
    values = by_name(text, mechanism.coordinates, option, angles_of(mechanism))
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            label, limits = part.coordinates[0], part.effects.limits
            if label not in joint.angles(name) or label not in values:
                continue
            angle = values[label]
            if max(angle - (limits.upper or 0.0), (limits.lower or 0.0) - angle) > FAR:
                tell(
                    [
                        f"{option}: {label} is taken as {angle:g} rad, {angle / tau:.3g} turns; "
                        f"degrees are written {label}={angle:g}deg"
                    ]
                )
    return values


def tool_given(robot: Robot, text: str) -> list[float] | dict[str, float]:
    """Return the tool's coordinates [m, rad], "0.52,0.27,0.42", or by name, "z=12cm,rx=30deg";
    they may be given with units."""
    robot.require_tool()
    if "=" in text:
        given = dict(pairs(text, TOOL))
        task = known(robot, [*given])
        return {
            name: measured(value, of, f"{TOOL}: {name}")
            for (name, value), of in zip(given.items(), task, strict=True)
        }
    parts = text.split(",")
    task = asked_of(robot, len(parts)).what
    return [measured(part, of, TOOL) for part, of in zip(parts, task, strict=True)]


def measured(text: str, coordinate: TaskCoordinate, place: str) -> float:
    """Return the number of a task coordinate; lengths and angles may have a unit."""
    if unit(coordinate) == "1":
        return number(text, place)
    return amount(text, not is_length(coordinate), place)


@dataclass(frozen=True)
class StartOptions:
    """Say where a run starts: a tool pose, joint coordinates (the branch, where both are given),
    rates of joints."""

    tool: str | None
    joints: str | None
    rates: str | None

    @property
    def given(self) -> bool:
        """Whether a place is said."""
        return self.tool is not None or self.joints is not None

    def state(self, robot: Robot) -> State:
        """Return the state [m, rad, m/s, rad/s]; the robot's reference pose at rest where nothing
        is said."""
        state = robot.home
        if self.joints is not None:
            state = robot.assemble(joints_given(robot, self.joints))
        if self.tool is not None:
            state = robot.assemble(tool=tool_given(robot, self.tool), guess=state)
        if self.rates is not None:
            state = robot.state(state.positions, self.started(robot, self.rates))
        return state

    def started(self, robot: Robot, text: str) -> dict[str, float]:
        """Return rates by name: the independent ones, those left out at zero, or as many of other
        joints."""
        names = robot.rates if "=" in text else robot.independent
        rates = by_name(text, names, "--rates")
        rest = dict.fromkeys(robot.independent, 0.0)
        return rest | rates if set(rates) <= set(rest) else rates
