"""Linear: small motions about a state in numbers (`linkwork.equations.linear`), and the forces that
hold a pose."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from threading import Lock
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations.linear import derivatives
from linkwork.errors import LinkworkError
from linkwork.model import actuation, checks, evaluation, not_finite
from linkwork.model.charts import CompiledChart
from linkwork.model.reordering import ordered
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.model.model import Model

HELD = 1e-9  # force that may be missing at an equilibrium, relative


def linearised(robot: Model, values: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return A (2n x 2n) and B (2n x actuators) of x' = A x + B du, x = (xi, dv), from what
    `evaluated` gives."""
    n = robot.mobility
    A, B = np.eye(2 * n, k=n), np.zeros((2 * n, len(robot.actuators)))
    A[:n, :n], A[n:, :n], A[n:, n:] = values["Gamma"], values["f_xi"], values["f_v"]
    B[n:] = values["f_u"]
    return A, B


def evaluated(robot: Model, state: State, u: np.ndarray) -> dict[str, np.ndarray]:
    """Return the derivatives at one state and force, by name; refuse stacks, and where the
    accelerations are undefined."""
    q, v = one_state(robot, state)
    found = kept(ordered(robot, robot.chart_of(state), q))(q, v, u, robot.p)
    pivot = found.pop("pivot")
    if not abs(float(pivot[0, 0])) > checks.PIVOT_BOUND:
        raise checks.singular(state.independent, pivot[0])
    if not np.isfinite(found["accelerations"]).all():
        raise not_finite.refusal(robot.chart_of(state), state.q)
    return found


@lru_cache(maxsize=32)
def kept(chart: CompiledChart) -> InPlace:
    """Return the derivatives in a chart."""
    return InPlace(derivatives(chart.equations))


class InPlace:
    """Evaluate a function with dense outputs as CasADi does, between vectors that are kept."""

    def __init__(self, function: ca.Function):
        self._buffer, self._evaluate = function.buffer()
        self._given = [np.empty(function.nnz_in(i)) for i in range(function.n_in())]
        self._found = [np.empty(function.nnz_out(i)) for i in range(function.n_out())]
        for i, part in enumerate(self._given):
            self._buffer.set_arg(i, part.data)  # pyright: ignore[reportCallIssue]
        for i, part in enumerate(self._found):
            self._buffer.set_res(i, part.data)  # pyright: ignore[reportCallIssue]
        shapes = [function.size_out(i) for i in range(function.n_out())]
        self._shapes = dict(zip(function.name_out(), shapes, strict=True))
        self._lock = Lock()

    def __call__(self, *given: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs, matrices, by name."""
        with self._lock:
            for part, values in zip(self._given, given, strict=True):
                part[:] = values
            self._evaluate()
            outputs = zip(self._shapes.items(), self._found, strict=True)
            return {name: part.reshape(shape, order="F").copy() for (name, shape), part in outputs}


def holding_forces(robot: Model, state: State) -> np.ndarray:
    """Return the least actuator forces (actuators) that hold a pose at rest, none without
    actuators: S' u = G - f.

    Raises:
        LinkworkError: a stack of states; a pose that no forces of the actuators hold.
    """
    one_state(robot, state)
    if not robot.actuators:
        return np.zeros(0)
    still = at_rest(state)
    terms = evaluation.terms(robot, still)
    G, f = terms.G, terms.f
    if still.independent == robot.actuators:
        return G - f
    S = evaluation.actuation_map(robot, still)
    units = evaluation.own_units(robot, still)
    u = (
        actuation.least_forces(units.map(S), (G - f) * units.rates, 1 / units.actuators**2)
        / units.actuators
    )
    missed, own = np.abs(G - f - S.T @ u), units.rates
    if (missed * own).max(initial=0.0) > HELD * max(
        weight(robot), *map(largest, (G * own, f * own))
    ):
        raise LinkworkError(
            f"no forces of {', '.join(robot.actuators)} hold this pose: {missed.max():.3g} N or "
            "N m are missing; choose an equilibrium"
        )
    return u


def own_rates(robot: Model, state: State) -> np.ndarray:
    """Return the mechanism's own units of a state's independent rates (n) but for the time: its
    length, or 1 rad.

    Forces times these are energies.
    """
    return robot.chart_of(state).units[robot.equations.nq :]


def weight(robot: Model) -> float:
    """Return the energy [J] that raises all bodies by the mechanism's own length."""
    mass = sum(body.mass for body in robot.mechanism.bodies.values())
    return mass * float(np.linalg.norm(robot.mechanism.gravity)) * robot.equations.tree.length


def largest(values: np.ndarray) -> float:
    """Return the largest magnitude, 0 of none."""
    return float(np.abs(values).max(initial=0.0))


def at_rest(state: State) -> State:
    """Return the state at rest."""
    return state.with_rates(0 * state.rates)


def one_state(robot: Model, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return q and v of one state; refuse a stack."""
    if robot.own(state).batch:
        raise LinkworkError("this needs one state, not a stack; take one by state.at(index)")
    return state.q, state.rates


def actuator_forces(robot: Model, forces: ArrayLike | Mapping[str, float] | None) -> np.ndarray:
    """Return u (actuators) from numbers, by name (others zero), or zero."""
    if forces is None:
        return np.zeros(len(robot.actuators))
    u = checks.finite(checks.actuator_forces(forces, robot.actuators), "forces")
    if u.ndim != 1:
        raise LinkworkError(f"forces has the shape {u.shape}; give one number per actuator")
    return u
