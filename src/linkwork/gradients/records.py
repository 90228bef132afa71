"""Derivatives at states, as what a user gets them.

All are with respect to

    q   the configuration, along the independent rates: n numbers, in the order of `independent`. Of
        a coordinate with a rate of its own it is the change [m, rad]; of a free turn the rotation
        vector in its first frame's axes [rad]. All loops stay closed.
    v   the independent rates [m/s, rad/s]
    u   the actuators' forces [N, N m]
    p   the free numbers of the description, in the order of `parameters`, SI. The loops close
        anew, while the independent coordinates are held.

A derivative (..., rows, columns) has the unit of its row over that of its column; the leading
dimensions are those of the states.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Hold derivatives, and the chart that they are written in.

    independent: names of the rates v, and so of the columns by q and by v
    parameters: paths of the free numbers p
    """

    independent: tuple[str, ...]
    parameters: tuple[str, ...]

    def __repr__(self) -> str:
        held = ((field.name, getattr(self, field.name)) for field in fields(self))
        shapes = [f"{name} {x.shape}" for name, x in held if isinstance(x, np.ndarray)]
        chart = ", ".join(self.independent)
        return f"{type(self).__name__}({', '.join(shapes)}; in the rates {chart})"


@dataclass(frozen=True, eq=False, repr=False)
class ForwardDynamicsDerivatives(Derivatives):
    """Hold v' (..., n) [m/s^2, rad/s^2] under forces u, and its derivatives.

    by_q, by_v: (..., n, n); by_u: (..., n, actuators), M^-1 S'; by_p: (..., n, np)
    actuators: names of u
    """

    accelerations: np.ndarray
    by_q: np.ndarray
    by_v: np.ndarray
    by_u: np.ndarray
    by_p: np.ndarray
    actuators: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class InverseDynamicsDerivatives(Derivatives):
    """Hold the forces [N, N m] that accelerations v' need, and their derivatives.

    forces: u of the actuators (..., rows), or on the independent rates
    by_q, by_v: (..., rows, n); by_accelerations: (..., rows, n); by_p: (..., rows, np)
    rows: names of the actuators, or of the rates
    """

    forces: np.ndarray
    by_q: np.ndarray
    by_v: np.ndarray
    by_accelerations: np.ndarray
    by_p: np.ndarray
    rows: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class MassMatrixDerivatives(Derivatives):
    """Hold M (..., n, n), and its derivatives: by_q (..., n, n, n), by_p (..., n, n, np)."""

    M: np.ndarray
    by_q: np.ndarray
    by_p: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class ClosureDerivatives(Derivatives):
    """Hold what the loops make of the coordinates and rates of all joints.

    positions_by_q (..., m, n), positions_by_p (..., m, np): of all joints' coordinates, in the
        order of `coordinates`
    rates_by_q (..., mr, n), rates_by_v (..., mr, n), rates_by_p (..., mr, np): of all joints' rates
        L v, in the order of `rates`; by v they are L
    coordinates, rates: names
    """

    positions_by_q: np.ndarray
    positions_by_p: np.ndarray
    rates_by_q: np.ndarray
    rates_by_v: np.ndarray
    rates_by_p: np.ndarray
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class ToolDerivatives(Derivatives):
    """Hold how the first tool's pose and twist change; in the axes of the ground, or of the body
    that the tool is relative to.

    pose_by_q (..., 6, n), pose_by_p (..., 6, np): [turn; shift of the origin] of the tool, the turn
        as a rotation vector, per unit of q and p [rad, m]
    twist: [omega; v of the origin] (..., 6); twist_by_q, twist_by_v (..., 6, n), twist_by_p
        (..., 6, np): by v the twist's derivative is that of the pose by q
    """

    pose_by_q: np.ndarray
    pose_by_p: np.ndarray
    twist: np.ndarray
    twist_by_q: np.ndarray
    twist_by_v: np.ndarray
    twist_by_p: np.ndarray
