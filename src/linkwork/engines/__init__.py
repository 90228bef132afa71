"""The same mechanism in independent engines: Pinocchio, MuJoCo, Exudyn. Each is optional and imported when asked for.

They check this package's equations and are what it is timed against; nothing here is needed to simulate.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec

from linkwork.engines.common import Engine, EngineError, EngineRun
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


def build(name: str, mechanism: Mechanism) -> Engine:
    """Return the mechanism in the engine of that name.

    Args:
        name: "pinocchio", "mujoco" or "exudyn".
        mechanism: any mechanism of fixed, revolute and prismatic joints, with or without loops.

    Raises:
        EngineError: there is no such engine, it is not installed, or it cannot hold this mechanism.
    """
    if name not in CLASSES:
        raise EngineError(f"there is no engine {name!r}; the engines are {', '.join(CLASSES)}")
    return getattr(import_module(f"linkwork.engines.{name}"), CLASSES[name])(mechanism)
