"""What every engine answers, and how it is asked: results, refusals, checks of the input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from linkwork.checks import amount
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism

ForceFunction = Callable[[float], np.ndarray]
Forces = ForceFunction | np.ndarray


class EngineError(LinkworkError):
    """Refuse what an engine cannot do, in one sentence."""


@dataclass(frozen=True)
class EngineRun:
    """Hold a motion computed by an engine.

    Attributes:
        time: instants, shape (k,) [s].
        positions: all joint coordinates in the order of `mechanism.coordinates`, shape (k, nq)
            [m, rad].
        rates, joint_accelerations: all joint rates in the order of `mechanism.rates` and their
            derivatives, shape (k, nv) [m, rad; /s, /s^2].
        accelerations: derivatives of the actuated rates, shape (k, n) [m/s^2, rad/s^2].
        body_poses: X_GB of the bodies in the order of `mechanism.bodies`, shape (k, r, 4, 4) [m].
        closure_error: largest distance between the two sides of any joint over the run [m].
        alignment_error: largest angle between directions that a joint keeps parallel, over the run
            [rad]; the misfit of a gear counts here, in its own unit.
        seconds: wall time of the integration alone [s].
    """

    time: np.ndarray
    positions: np.ndarray
    rates: np.ndarray
    joint_accelerations: np.ndarray
    accelerations: np.ndarray
    body_poses: np.ndarray
    closure_error: float
    alignment_error: float
    seconds: float

    @property
    def body_positions(self) -> np.ndarray:
        """Return the origins of the bodies in the ground's frame, shape (k, r, 3) [m]."""
        return self.body_poses[..., :3, 3]


class Engine(Protocol):
    """Answer for one mechanism: accelerations at a state, and the motion under given actuator
    forces."""

    name: str
    version: str
    mechanism: Mechanism

    def accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of the actuated rates, shape (n,) [m/s^2, rad/s^2].

        Args:
            positions: all joint coordinates in the order of `mechanism.coordinates`, shape (nq,)
                [m, rad].
            rates: all joint rates in the order of `mechanism.rates`, shape (nv,) [m/s, rad/s]. Both
                close the loops (an engine with a spanning tree reads the joints of its tree only).
            forces: of the actuators in the order of `mechanism.actuators`, shape (n,) [N, N m].
        """
        ...

    def joint_accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of all joint rates in the order of `mechanism.rates`, shape
        (nv,).

        positions: of all joints (m,) [m, rad]; rates: of all joints (nv,) [m/s, rad/s]; forces: of
        the actuators (n,) [N, N m].
        """
        ...

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion from a state with steps of `step` seconds up to `duration`.

        `forces` are constant, shape (n,), or a function of time that returns them.

        positions: of all joints (m,) [m, rad]; rates: of all joints (nv,) [m/s, rad/s]; duration,
        step: [s].
        """
        ...


def load_engine(module: str, title: str) -> Any:
    """Import an engine's module; a missing one is refused in one sentence."""
    try:
        return import_module(module)
    except ImportError as error:
        raise EngineError(
            f"{title} cannot be imported ({error}); try `pip install linkwork[engines]`"
        ) from None


def checked(
    mechanism: Mechanism, positions: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (nq,) and rates (nv,) of all joints as vectors; other shapes and non-numbers
    are refused."""
    for title, names, values in (
        ("positions", mechanism.coordinates, positions),
        ("rates", mechanism.rates, rates),
    ):
        if np.shape(values) != (len(names),) or not np.all(np.isfinite(values)):
            raise EngineError(
                f"{title}: give {len(names)} finite numbers, one for each of the joints', not "
                f"{values!r}"
            )
    return np.asarray(positions, dtype=float), np.asarray(rates, dtype=float)


def checked_forces(mechanism: Mechanism, forces: np.ndarray) -> np.ndarray:
    """Return actuator forces as a vector of shape (n,); another shape is refused."""
    if np.shape(forces) != (len(mechanism.actuators),):
        wanted = amount(len(mechanism.actuators), "number")
        raise EngineError(f"forces: give {wanted}, one per actuator, not {forces!r}")
    return np.asarray(forces, dtype=float)


def in_time(mechanism: Mechanism, forces: Forces) -> ForceFunction:
    """Return forces as a function of time; wrong shapes are refused now."""
    held = checked_forces(mechanism, forces(0.0) if callable(forces) else forces)
    return forces if callable(forces) else lambda _: held


def instants(duration: float, step: float) -> np.ndarray:
    """Divide [0, duration] into equal steps no longer than `step` [s]."""
    if not (0 < step < np.inf and 0 < duration < np.inf):
        raise EngineError(f"duration {duration!r} and step {step!r} must be positive and finite")
    return np.linspace(0.0, duration, int(np.ceil(duration / step - 1e-9)) + 1)
