"""Where a command begins: a state in words."""

from __future__ import annotations

from dataclasses import dataclass

from linkwork.cli.entries import by_name, of_tool
from linkwork.formats.references import angles_of
from linkwork.robot import Robot, State


def joints_given(robot: Robot, text: str) -> dict[str, float]:
    """Return joint coordinates by name [m, rad], which may be given with units."""
    return by_name(text, robot.coordinates, "--joints", angles_of(robot.mechanism))


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
            state = robot.assemble(tool=of_tool(self.tool, "--tool"), guess=state)
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
