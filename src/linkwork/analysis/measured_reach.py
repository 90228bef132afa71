"""What is measured at the configurations that a tool reaches: where the actuators stand, how well
they move the tool, and what it does in every direction (`workspace`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linkwork.analysis._jacobians import Jacobians
from linkwork.analysis.grid_branches import actuated
from linkwork.analysis.newton import CHUNK, in_threads
from linkwork.analysis.singular_values import singular_values

MEANING = {
    "conditioning": ("1", "1 / cond K"),
    "det_A": ("1", "det A over that at the reference"),
    "det_B": ("1", "det B over that at the reference"),
    "isotropic_velocity": ("m/s", "velocity reached in every direction"),
    "isotropic_turn_rate": ("rad/s", "angular velocity reached about every axis"),
    "isotropic_force": ("N", "force borne in every direction"),
    "isotropic_moment": ("N m", "moment borne about every axis"),
}


def attributes(name: str, J: Jacobians) -> dict[str, str]:
    """Return the unit and the meaning of a quantity."""
    if name == "actuator_position":
        return {"units": ", ".join(J.robot.unit(label) for label in J.direct.what)}
    return {"units": MEANING[name][0], "long_name": MEANING[name][1]}


def measured(
    q: np.ndarray, at: Callable[[np.ndarray], dict[str, np.ndarray]]
) -> dict[str, np.ndarray]:
    """Return what is measured at configurations (N, nq), by name; at: what is at few of them."""
    parts = [slice(k, k + CHUNK) for k in range(0, max(len(q), 1), CHUNK)]
    made = in_threads(lambda part: at(q[part]), parts)
    return {name: np.concatenate([part[name] for part in made]) for name in made[0]}


def measured_at(
    J: Jacobians,
    q: np.ndarray,
    rates: np.ndarray | None,
    forces: np.ndarray | None,
    scale: float,
    side: float | None,
) -> dict[str, np.ndarray]:
    """Return what is measured at few configurations; side: the sign of det B there, where it is
    known."""
    turns = J.turning
    K, inverse, det_B, det_A = J(q, side)
    sigma = singular_values(J.homogeneous(K, scale))
    found = {
        "actuator_position": actuated(J, q),
        "conditioning": sigma[:, -1] / sigma[:, 0],
        "det_A": det_A,
        "det_B": det_B,
    }
    for own, velocity, force in ((~turns, "velocity", "force"), (turns, "turn_rate", "moment")):
        if rates is not None and own.any():
            found[f"isotropic_{velocity}"] = largest_ball(K[:, :, own], rates)
        if forces is not None and own.any():
            found[f"isotropic_{force}"] = largest_ball(
                np.swapaxes(inverse[:, own, :], -1, -2), forces
            )
    return found


def largest_ball(rows: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Return the radius of the largest ball in {x: |rows x|_i <= bound_i}: min_i bound_i / |row_i|.

    Args:
        rows: (..., actuators, k); bound: (actuators).
    """
    with np.errstate(divide="ignore"):
        return (bound / np.linalg.norm(rows, axis=-1)).min(axis=-1)
