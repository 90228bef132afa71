"""Linear-quadratic control about a pose.

    x = (c - c_0, v),    x' = A x + B (u - u_0)
    u = u_0 - K x  minimises  integral of x' Q x + (u - u_0)' R (u - u_0)

in the independent coordinates c and rates v = c' of a robot; A and B are exact
(`linkwork.equations.linear`).
Source: Anderson & Moore, Optimal Control, ch. 2 and 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.linalg import norm
from numpy.typing import ArrayLike

from linkwork import checks, math
from linkwork.control.controllers import Controller, Form
from linkwork.control.observation import Observation
from linkwork.control.plant import Linearised, Posture, require_plant
from linkwork.control.records import Number
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Amount, Positive
from linkwork.mechanism.refusal import MechanismError

ROUNDING = 1e-12  # relative size below which a number may be rounding alone
SQUARE = "weight of its square"


@dataclass(frozen=True, eq=False)
class LQR(Controller):
    """Hold a robot at a pose by u = u_0 - K x; made by `LQR.about`.

    independent: names of the coordinates c; positions: c_0 (n); forces: u_0 (na); gains: K
    (na x 2n)
    """

    independent: tuple[str, ...]
    positions: np.ndarray
    forces: np.ndarray
    gains: np.ndarray

    forms: ClassVar = (
        Form(
            "lqr",
            "Hold a pose by u = u_0 - K x of least cost, Q = diag(position, rate), R = diag(force)",
            "LQR",
            ("model", "position", "rate", "force"),
            {"rate": 0.0},
        ),
    )
    still: ClassVar[bool] = True

    @classmethod
    def described_numbers(cls) -> Mapping[str, Number]:
        return {
            "position": Number(SQUARE, "1/m^2, 1/rad^2", Amount, "independent coordinate"),
            "rate": Number(SQUARE, "s^2/m^2, s^2/rad^2", Amount, "independent rate"),
            "force": Number(SQUARE, "1/N^2, 1/(N m)^2", Positive, "actuator"),
        }

    @classmethod
    def led(cls, goal, *, model: Linearised, position, rate, force) -> LQR:
        """Return the regulator about a goal, by weights that are diagonal.

        model: of the robot; position, rate: Q of independent coordinates and rates, force: R of
        actuators; one number for all, or by name.
        """
        c, u = model.independent, model.actuators
        Q = [*diagonal("position", position, c), *diagonal("rate", rate, c)]
        return cls.about(model, goal, Q, diagonal("force", force, u))

    @classmethod
    def about(cls, robot: Linearised, state: Posture, Q: ArrayLike, R: ArrayLike) -> LQR:
        """Return the controller for a state of equilibrium (rates are taken as zero).

        Args:
            robot: the robot.
            state: the pose to hold, in the robot's own independent rates.
            Q: weights of x, (2n) or (2n, 2n); R: weights of the forces, (na) or (na, na).

        Raises:
            LinkworkError: rates that are no coordinates' (free turns), weights of other shapes,
                poses that no forces hold or that cannot be stabilised.
        """
        from scipy.linalg import LinAlgError

        require_plant(robot)
        # x = (position - pose, rates) needs coordinates whose derivatives the rates are.
        if not robot.actuators:
            raise LinkworkError(
                "the robot has no actuators to hold a pose with; name some under 'actuators'"
            )
        for name in robot.own(state).independent:
            if name not in robot.coordinates:
                raise LinkworkError(
                    f"the independent rate {name!r} is not that of a coordinate; choose others "
                    "by robot.in_chart"
                )
        # x' = A x + B du about the pose held still.
        still, forces = state.with_rates(0 * state.rates), robot.holding_forces(state)
        model = robot.linearise(still, forces)
        A, B = model.A, model.B
        Q, R = (
            weights(value, size, name)
            for value, size, name in ((Q, len(A), "Q"), (R, B.shape[1], "R"))
        )
        sizes = np.linalg.eigvalsh(R + R.T)
        if not sizes.min() > ROUNDING * sizes.max():
            raise LinkworkError(
                "the weights R of the forces are not positive definite; give positive numbers"
            )
        # LQR only if it really stabilises.
        try:
            K = least_cost(A, B, Q, R, model.units[0])
        except (LinAlgError, ValueError):
            K = np.full(B.T.shape, np.nan)
        if not (np.isfinite(K).all() and stable(A - B @ K)):
            raise LinkworkError(
                "the pose cannot be stabilised with these weights; change Q, R or the pose"
            )
        # u = forces - K x.
        positions = np.array([still[name] for name in still.independent])
        return cls(still.independent, positions, forces, K)

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
        return math.array(
            [force - math.dot(row, x) for force, row in zip(self.forces, K, strict=True)]
        )


def least_cost(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return K = R^-1 B' P of the Riccati equation A' P + P A - P B R^-1 B' P + Q = 0.

    own: the mechanism's own units of x but for time. The equation is solved for x in these and in
    time over the quickest pace, forces by their weights, and a cost in which Q weighs as B does.
    """
    from scipy.linalg import solve_continuous_are

    n, U = len(A) // 2, 1 / np.sqrt(np.diag(R))
    A, B, Q = A * own / own[:, None], B * U / own[:, None], Q * own * own[:, None]
    # The pace w of x' = A x and of the least cost: w^4 by positions, w^2 by rates.
    push = norm(B)
    paces = [norm(A[n:, n:]), push * norm(Q[n:, n:]) ** 0.5]
    paces += [norm(A[n:, :n]) ** 0.5, (push * norm(Q[:n, :n]) ** 0.5) ** 0.5]
    pace = float(max(paces)) or 1.0
    D = np.repeat([1.0, pace], n)
    A, B, Q = A * D / D[:, None] / pace, B / D[:, None] / pace, Q * D * D[:, None]
    level = norm(Q) ** 0.5 / norm(B) if norm(Q) and norm(B) else 1.0
    R = R * U * U[:, None]
    P = solve_continuous_are(A, B * level**0.5, Q / level, R)
    return np.linalg.solve(R, B.T @ P) * level * U[:, None] / (own * D)


def diagonal(what: str, given: float | Mapping[str, float], names: Sequence[str]) -> list[float]:
    """Return a weight for each name; refuse weights that are others'."""
    if not isinstance(given, Mapping):
        return [given] * len(names)
    for name in set(given) ^ set(names):
        fault = f"lacks {name!r}" if name in names else f"has {name!r}"
        raise MechanismError(
            f"{fault}; give one number, or one for each of {', '.join(names)}", (what,)
        )
    return [given[name] for name in names]


def stable(A: np.ndarray) -> bool:
    """Tell whether all poles of x' = A x lie left of the imaginary axis, and no rounding of A would
    bring one onto it.

    The distance of A to a matrix with the pole i omega is the smallest singular value of A - i
    omega 1 (Van Loan, How near is a stable matrix to an unstable matrix?, 1985); A is balanced
    first, for its rows have different units.
    """
    from scipy.linalg import matrix_balance

    A = matrix_balance(A, permute=False)[0]
    poles, nearest = np.linalg.eigvals(A), ROUNDING * np.linalg.norm(A, 2)
    apart = (
        np.linalg.svd(A - 1j * pole.imag * np.eye(len(A)), compute_uv=False)[-1] for pole in poles
    )
    return bool(poles.real.max() < 0 and all(distance > nearest for distance in apart))


def weights(values: ArrayLike, size: int, name: str) -> np.ndarray:
    """Return a weight matrix from a matrix or its diagonal."""
    array = checks.finite(values, name)
    matrix = np.diag(array) if array.ndim == 1 else array
    if matrix.shape != (size, size):
        raise LinkworkError(
            f"the weights {name} have the shape {array.shape}; give {size} numbers, or {size} x "
            f"{size}"
        )
    return matrix
