"""Measures of a configuration, by the names of the field: how well the actuators move the tool
there, and it them.

They are those of `model.dexterity`, `analysis.dexterity` and `analysis.transmission_indices`. What
is told of each actuator is that of the worst one. A share from 0, singular, to 1 gives the colour:
the measure itself, of an angle its sine, of the manipulability its part of that at the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.model.dexterity import conditioning
from linkwork.robot import Robot, State

CONDITIONING = "conditioning"


@dataclass(frozen=True)
class PoseMeasure:
    """Hold what a measure tells of a configuration: its name, its value in words, and its share
    from 0 to 1, nan where none is defined."""

    name: str
    told: str
    share: float


def measured(robot: Robot, state: State, name: str) -> PoseMeasure:
    """Return what one of `MEASURES` tells of a state; that it is not defined there, if so."""
    try:
        return PoseMeasure(name, *MEASURES[name](robot, state))
    except LinkworkError:
        return PoseMeasure(name, "not defined here", np.nan)


def require_measure(robot: Robot, name: str) -> None:
    """Refuse what is not defined for a robot."""
    MEASURES[name](robot, robot.home)


def _conditioning(robot: Robot, state: State) -> tuple[str, float]:
    value = float(conditioning(robot, state.q[None])[0])
    return f"{value:.3f}", value


def _manipulability(robot: Robot, state: State) -> tuple[str, float]:
    value, at_home = volume(robot, state), robot.once(volume, robot.home)
    if not (np.isfinite(value) and np.isfinite(at_home) and at_home > 0):
        return f"{value:.3g}", np.nan
    return f"{value:.3g}, {value / at_home:.3g} times that at the reference", value / at_home


def volume(robot: Robot, state: State) -> float:
    """Return the manipulability at a state."""
    from linkwork.analysis import dexterity

    return float(dexterity(robot, state).manipulability)


def _transmission_angle(robot: Robot, state: State) -> tuple[str, float]:
    from linkwork.analysis import dexterity

    told = dexterity(robot, state)
    worst = int(np.argmin(told.transmissibility))
    angle = told.transmission_angle[worst]
    return f"{angle:.3f} rad ({told.actuators[worst]})", float(np.sin(angle))


def _transmission_index(robot: Robot, state: State) -> tuple[str, float]:
    from linkwork.analysis import transmission_indices

    value = float(transmission_indices(robot, state).local)
    return f"{value:.3f}", value


MEASURES: dict[str, Callable[[Robot, State], tuple[str, float]]] = {
    CONDITIONING: _conditioning,
    "manipulability": _manipulability,
    "transmission angle": _transmission_angle,
    "local transmission index": _transmission_index,
}
"""What is told and coloured: (robot, state) -> the value in words, and its share."""
