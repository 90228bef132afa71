"""Cables that push: what limits that hold in both directions allow, and real cables do not."""

from __future__ import annotations

import warnings

import numpy as np

from linkwork.errors import ModelWarning
from linkwork.mechanism.transmissions import cables_among
from linkwork.model.state import State
from linkwork.motions._follow import follow
from linkwork.motions.timed_paths import TimedPath
from linkwork.robot import Robot

PUSHED = 1e-6  # of the largest force of the cables, which is none


def driven_cables(robot: Robot) -> list[int]:
    """Return the places of the cables among the actuators."""
    return cables_among(robot.mechanism.transmissions, robot.actuators)


def warn_of_pushing(robot: Robot, forces: np.ndarray, stacklevel: int) -> None:
    """Warn of driven cables that push in forces (K, actuators) of a motion."""
    if not (cables := driven_cables(robot)):
        return
    pushed = forces[:, cables].max(axis=0)
    k = int(np.argmax(pushed))
    if pushed[k] > PUSHED * np.abs(forces).max():
        warnings.warn(
            f"the cable {robot.actuators[cables[k]]!r} pushes with up to {pushed[k]:.4g} N in this "
            "motion, which real cables cannot; linkwork.analysis.tensions tells whether internal "
            "forces keep them taut",
            ModelWarning,
            stacklevel=stacklevel + 1,
        )


def warn_of_pushing_along(robot: Robot, path: TimedPath, samples: int, guess: State | None) -> None:
    """Warn of driven cables that push in the forces of least norm along a timed path."""
    if driven_cables(robot):
        motion = follow(robot, path, samples=samples, guess=guess, keep_limits=False)
        warn_of_pushing(robot, robot.inverse_dynamics(motion).values, 3)
