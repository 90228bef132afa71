"""Dexterity: what the input-output Jacobians J (x' = J q') and K = J^-1 say of a pose, by the names
of the field.

    conditioning        1 / cond J                      1 alike in all directions, 0 singular
    manipulability      |det J|                         volume that unit rates of actuators reach
    transmissibility    1 / (|row i of K| |column i of J|)

Row i of K is the force on the tool that actuator i makes alone, column i of J the tool's velocity
where it moves alone: their cosine is the share of the force that gives power, its arc sine the
transmission angle (of a five-bar the angle between the distal links). J and K are between lengths
over time, turns times the characteristic length (`model.dexterity`).

Source: Yoshikawa, Int. J. Robotics Research 4 (1985) 3-9 (manipulability); Gosselin & Angeles, J.
Mech. Design 113 (1991) 220-226 (global conditioning index); Takeda & Funabashi, JSME Int. J. C 38
(1995) 749-755 (motion transmissibility, the cosine of the pressure angle).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.analysis._jacobians import jacobians
from linkwork.analysis.mapped_extent import content, integral
from linkwork.checks import names
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Dexterity:
    """Hold how well a robot works at states (...).

    what, actuators: names of the task coordinates and of the actuators (n); length: the
        characteristic one [m]
    singular_values: of J between lengths over time (..., n), largest first; infinite where the
        configuration is actuator-singular
    transmissibility: of each actuator (..., n), from 0 to 1
    """

    what: tuple[str, ...]
    actuators: tuple[str, ...]
    length: float
    singular_values: np.ndarray
    transmissibility: np.ndarray

    @property
    def conditioning(self) -> np.ndarray:
        """Return 1 / cond J (...): 1 alike in all directions, 0 singular."""
        largest, least = self.singular_values[..., 0], self.singular_values[..., -1]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(np.isfinite(largest) & (largest > 0), least / largest, 0.0)

    @property
    def manipulability(self) -> np.ndarray:
        """Return |det J| (...), the product of the singular values."""
        return np.prod(self.singular_values, axis=-1)

    @property
    def transmission_angle(self) -> np.ndarray:
        """Return the transmission angle of each actuator (..., n) [rad], from 0 to a quarter turn:
        the complement of the pressure angle."""
        return np.arcsin(np.minimum(self.transmissibility, 1.0))


def dexterity(
    robot: Robot,
    state: State,
    *,
    what: Sequence[str] | None = None,
    length: float | None = None,
) -> Dexterity:
    """Measure how well the actuators move the tool, and it them, at states.

    Args:
        robot: with as many actuators as freedoms, and a tool.
        state: closed configurations; their rates do not matter.
        what: names of task coordinates; those of the `task` if left out.
        length: characteristic length [m]; that of `Jacobians.characteristic_length` if left out.

    Raises:
        LinkworkError: as `jacobians`.
    """
    made = jacobians(robot, None if what is None else names(what, "what"))
    x, q = made.lengths(length)
    K, J, *_ = made(robot.own(state).q)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        K, J = K / x * q[:, None], J * x[:, None] / q
        shares = 1 / (np.linalg.norm(K, axis=-1) * np.linalg.norm(J, axis=-2))
        whole = np.isfinite(J.sum(axis=(-2, -1)))[..., None]
        direct = np.linalg.svd(np.nan_to_num(J), compute_uv=False)
        inverse = 1 / np.linalg.svd(np.nan_to_num(K), compute_uv=False)[..., ::-1]
    scale = made.characteristic_length if length is None else float(length)
    values = np.where(whole, direct, inverse)
    return Dexterity(made.what, made.direct.what, scale, values, np.nan_to_num(shares))


def global_conditioning(mapped: xarray.Dataset) -> float:
    """Return the global conditioning index of a workspace: the mean of the conditioning over all
    reached poses, to the accuracy of the grid.

    Args:
        mapped: as `workspace` returns it.

    Raises:
        LinkworkError: a workspace of which nothing is reached.
    """
    volume = content(mapped)
    if not volume > 0:
        raise LinkworkError("nothing of the workspace is reached; map another grid")
    return integral(mapped["conditioning"].where(mapped["reachable"], 0.0)) / volume
