"""Linear-quadratic control about a pose.

    x = (c - c_0, v),    x' = A x + B (u - u_0),    u = u_0 - K x   minimises   integral of x' Q x + (u - u_0)' R (u - u_0)

in the independent coordinates c and rates v = c' of a robot. A and B are exact: the equations of motion are differentiated
along the closed loops, d/dc = d/dq N L.
Source: Anderson & Moore, Optimal Control, ch. 2 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import math
from linkwork.control.observation import Observation
from linkwork.equations import functions
from linkwork.errors import LinkworkError

if TYPE_CHECKING:
    from linkwork.robot import Robot, State

HELD = 1e-9  # force that may be missing at an equilibrium, relative


@dataclass(frozen=True, eq=False)
class LQR:
    """Hold a robot at a pose by u = u_0 - K x; made by `LQR.about`.

    independent: names of the coordinates c; positions: c_0 (n); forces: u_0 (na); gains: K (na x 2n)
    """

    independent: tuple[str, ...]
    positions: np.ndarray
    forces: np.ndarray
    gains: np.ndarray

    @classmethod
    def about(cls, robot: Robot, state: State, Q: ArrayLike, R: ArrayLike) -> LQR:
        """Return the controller for a state of equilibrium (rates are taken as zero).

        Args:
            robot: the robot.
            state: the pose to hold, in the robot's own independent rates.
            Q: weights of x, (2n) or (2n, 2n); R: weights of the forces, (na) or (na, na).

        Raises:
            LinkworkError: rates that are no coordinates' (free turns), weights of other shapes, poses that no forces hold
                or that cannot be stabilised.
        """
        from scipy.linalg import LinAlgError, solve_continuous_are

        still = state.with_rates(0 * state.rates)
        forces = holding(robot, still)
        A, B = linearised(robot, still, forces)
        Q, R = (weights(value, size, name) for value, size, name in ((Q, len(A), "Q"), (R, B.shape[1], "R")))
        try:
            P = solve_continuous_are(A, B, Q, R)
        except LinAlgError as error:
            raise LinkworkError(
                f"the pose cannot be stabilised with these weights ({error}); change Q, R or the pose"
            ) from None
        positions = np.array([still[name] for name in still.independent])
        return cls(still.independent, positions, forces, np.linalg.solve(R, B.T @ P))

    def __call__(self, t: Any, state: Observation) -> Any:
        """Return the forces of the actuators, in their order."""
        x = [state[name] - c for name, c in zip(self.independent, self.positions, strict=True)]
        x += [state.rate(name) for name in self.independent]
        labels = (*self.independent, *(f"{name} rate" for name in self.independent))
        actuators = state.names.actuators
        K = [
            [state.parameter(f"K.{u}.{c}", k) for c, k in zip(labels, row, strict=True)]
            for u, row in zip(actuators, self.gains, strict=True)
        ]
        return math.array([force - math.dot(row, x) for force, row in zip(self.forces, K, strict=True)])


def holding(robot: Robot, state: State) -> np.ndarray:
    """Return the least forces (na) that hold a state at rest; refuse one that none hold."""
    S, load = robot.actuation(state), robot.gravity(state) - robot.passive_forces(state)
    u = np.linalg.lstsq(S.T, load, rcond=None)[0]
    missed = load - S.T @ u
    if np.abs(missed).max(initial=0) > HELD * max(1.0, np.abs(load).max(initial=0)):
        raise LinkworkError(
            f"no forces of {', '.join(robot.actuators)} hold this pose: {np.abs(missed).max():.3g} N or N m are missing; "
            "choose an equilibrium"
        )
    return u


def linearised(robot: Robot, state: State, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A (2n x 2n) and B (2n x na) about a state at rest and forces."""
    equations, n = robot.chart_of(state).equations, len(state.independent)
    for name in state.independent:
        if name not in robot.coordinates:
            raise LinkworkError(
                f"the independent rate {name!r} is not that of a coordinate; choose others by robot.in_chart"
            )
    motion = functions.motion(equations)
    q, v, u = equations.tree.q, equations.v, ca.SX.sym("u", len(robot.actuators))
    dv = motion(q, v, u, equations.p)[1]
    along = ca.mtimes(equations.tree.derivative_map, equations.elimination[0])
    parts = [ca.mtimes(ca.jacobian(dv, q), along), ca.jacobian(dv, v), ca.jacobian(dv, u)]
    evaluate = ca.Function("linearised", [q, v, u, equations.p], parts)
    A_c, A_v, B_u = (np.array(part.full()) for part in evaluate(state.q, state.rates, forces, robot.p))
    return np.block([[np.zeros((n, n)), np.eye(n)], [A_c, A_v]]), np.vstack([np.zeros((n, B_u.shape[1])), B_u])


def weights(values: ArrayLike, size: int, name: str) -> np.ndarray:
    """Return a weight matrix from a matrix or its diagonal."""
    array = np.asarray(values, float)
    matrix = np.diag(array) if array.ndim == 1 else array
    if matrix.shape != (size, size):
        raise LinkworkError(f"the weights {name} have the shape {array.shape}; give {size} numbers, or {size} x {size}")
    return matrix
