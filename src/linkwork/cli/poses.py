"""Configurations of a robot as commands tell them: in words, or as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.cli.terminal import named, tidy
from linkwork.errors import LinkworkError
from linkwork.model.labels import POSES
from linkwork.robot import Robot, State

if TYPE_CHECKING:
    from linkwork import analysis

FEW = 6  # columns of joint coordinates that are shown


def pose_of(robot: Robot, state: State) -> str:
    """Return a configuration in words: the tool's pose where there is a tool, else joint
    coordinates."""
    labels: Sequence[str] = (
        POSES[robot.planar] if robot.mechanism.tools else robot.coordinates[:FEW]
    )
    values = (
        tidied(robot, robot.tool_pose(state))
        if robot.mechanism.tools
        else state.positions[: len(labels)]
    )
    return named(labels, values, 5)


def tidied(robot: Robot, values: np.ndarray) -> np.ndarray:
    """Return coordinates of joints or of the tool (..., k) without what is rounding of the robot's
    own length, or of a turn."""
    return tidy(values, max(robot.equations.tree.length, 1.0))


def joints_told(robot: Robot, state: State) -> dict[str, float]:
    """Return the joint coordinates of a state by name."""
    return dict(zip(robot.coordinates, state.positions.tolist(), strict=True))


def pose_told(robot: Robot, state: State) -> dict[str, float] | None:
    """Return the tool's pose at a state by name, if there is a tool."""
    if not robot.mechanism.tools:
        return None
    return dict(zip(POSES[robot.planar], robot.tool_pose(state).tolist(), strict=True))


def states_told(robot: Robot, states: State) -> list[dict[str, Any]]:
    """Return joints and tool of each state of a stack."""
    return [{"joints": joints_told(robot, one), "tool": pose_told(robot, one)} for one in states]


def equilibrium_told(robot: Robot, found: analysis.Equilibrium) -> dict[str, Any]:
    """Return an equilibrium by name."""
    energy = float(robot.energy(found.state)[1])
    told = {
        name: getattr(found, name) for name in ("stable", "indifferent", "stiffness", "residual")
    }
    along = list(found.state.independent)
    return {
        "joints": joints_told(robot, found.state),
        "independent": along,
        **told,
        "energy": energy,
    }


def modes_at(
    robot: Robot, state: State, forces: np.ndarray | dict[str, float]
) -> tuple[analysis.NaturalModes | None, str]:
    """Return the natural modes of a state under forces, if it stays at rest and has any, and what
    equilibrium it is in."""
    from linkwork import analysis
    from linkwork.analysis.linearisation import NoEquilibriumError

    try:
        modes = analysis.natural_modes(robot, state, forces)
    except NoEquilibriumError:
        return None, "no: it accelerates"
    except LinkworkError as refusal:
        return None, f"at rest, by the poles; {refusal}"
    return modes, "stable" if modes.stable else "not stable"
