"""The same mechanism in independent engines: Pinocchio, MuJoCo, Exudyn. Each is optional and
imported when asked for.

They check this package's equations and are what it is timed against; nothing here is needed to
simulate.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np

from linkwork import checks
from linkwork.lab.engines.interface import Engine, EngineError, EngineRun
from linkwork.mechanism import Mechanism

__all__ = ["Engine", "EngineError", "EngineRun", "available", "build", "versions"]

CLASSES = {"pinocchio": "PinocchioEngine", "mujoco": "MujocoEngine", "exudyn": "ExudynEngine"}
DISTRIBUTIONS = {"pinocchio": "pin", "mujoco": "mujoco", "exudyn": "exudyn"}


def available() -> tuple[str, ...]:
    """Return the names of the engines that are installed."""
    return tuple(name for name in CLASSES if find_spec(name) is not None)


def versions() -> dict[str, str]:
    """Return the version of each installed engine by its name."""
    return {name: version(DISTRIBUTIONS[name]) for name in available()}


def build(name: str, mechanism: Mechanism, guess: Mapping[str, np.ndarray] | None = None) -> Engine:
    """Return the mechanism in the engine of that name.

    Args:
        name: "pinocchio", "mujoco" or "exudyn".
        mechanism: any mechanism. MuJoCo holds all of it; Pinocchio has no gears; Exudyn has gears
            of two coordinates only, and no rotors on free turns.
        guess: approximate poses X_GB (4, 4) of bodies that nothing but rods reaches, whose pose no
            joint coordinate tells; the ground's frame where left out.

    Raises:
        EngineError: there is no such engine, it is not installed, or it cannot hold this mechanism.
    """
    if not checks.among(name, CLASSES):
        raise EngineError(
            f"there is no engine {checks.shown(name)}; the engines are {', '.join(CLASSES)}"
        )
    checks.needed(mechanism, Mechanism)
    checks.by_name(guess, "the poses of the guess", "{'platform': pose}")
    return getattr(import_module(f"linkwork.lab.engines.{name}"), CLASSES[name])(
        mechanism, guess=guess
    )
