"""What controllers and goals ask of a robot: so much, and no more, of whatever it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations
from linkwork.errors import LinkworkError
from linkwork.mechanism.task import TaskCoordinate
from linkwork.paths import Path


class NamedCoordinates(Protocol):
    """Joint coordinates by name, of one state or many."""

    def __getitem__(self, coordinate: str) -> np.ndarray: ...


class TimedStates(Protocol):
    """A motion of a robot: states over time."""

    @property
    def time(self) -> np.ndarray: ...

    @property
    def state(self) -> NamedCoordinates: ...


class Posture(NamedCoordinates, Protocol):
    """A state of a robot: joint coordinates by name, and independent rates."""

    @property
    def rates(self) -> np.ndarray: ...

    @property
    def independent(self) -> tuple[str, ...]: ...

    def with_rates(self, rates: ArrayLike) -> Self: ...


@runtime_checkable
class Plant(Protocol):
    """A robot, as models in controllers and goals ask it."""

    @property
    def equations(self) -> Equations: ...

    @property
    def actuators(self) -> tuple[str, ...]: ...

    @property
    def parameters(self) -> Mapping[str, float]: ...

    def unit(self, name: str, /) -> str: ...

    def assemble(
        self, joints: Mapping[str, float] | None = None, *, tool: Any = None, guess: Any = None
    ) -> Posture: ...

    def follow(
        self, path: Path, duration: float, *, samples: int = 101, guess: Any = None
    ) -> TimedStates: ...


@runtime_checkable
class TaskPlant(Plant, Protocol):
    """A robot whose tool is led in task coordinates."""

    @property
    def mobility(self) -> int: ...

    @property
    def spins(self) -> tuple[str, ...]: ...

    def task_coordinates(self) -> tuple[TaskCoordinate, ...]: ...

    def task_values(self, state: Any, what: Sequence[str] | None = None) -> np.ndarray: ...

    def conditioning(self, state: Any) -> np.ndarray: ...


class StateSpace(Protocol):
    """Matrices of x' = A x + B u, and the mechanism's own units of x and u but for time and
    mass."""

    @property
    def A(self) -> np.ndarray: ...

    @property
    def B(self) -> np.ndarray: ...

    @property
    def units(self) -> tuple[np.ndarray, np.ndarray]: ...


class Linearised(Plant, Protocol):
    """A robot whose equations about a pose are asked for, too."""

    @property
    def coordinates(self) -> tuple[str, ...]: ...

    @property
    def independent(self) -> tuple[str, ...]: ...

    def own(self, state: Any) -> Posture: ...

    def holding_forces(self, state: Any) -> np.ndarray: ...

    def linearise(self, state: Any, forces: ArrayLike) -> StateSpace: ...


def require_plant(model: object) -> None:
    """Refuse what is no robot, as arguments that are swapped are."""
    if not isinstance(model, Plant):
        raise LinkworkError(
            f"the model of a controller is a {type(model).__name__}; give a linkwork.Robot"
        )
