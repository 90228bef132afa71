"""Linearisation: how a robot moves near a state, exact along the constraint manifold.

A configuration near q is reached by small shifts xi of the independent joints: dq = S xi, S = N L (nq x n), whose columns
are tangent to phi(q) = 0. With f(q, v, u) = v' the motion near a state and force is

    xi' = Gamma xi + dv,     dv' = f_q S xi + f_v dv + f_u du,      Gamma = S^+ ((S v)_q S - S')

S^+ reads xi off dq, and S' = dS/dt along the motion. Gamma is zero where the independent rates are rates of coordinates,
and wherever the robot is at rest; it is not for the angular velocity of a free body. All derivatives are taken by
automatic differentiation of the equations themselves.

At rest, with v' = 0, the same derivatives give stiffness and natural modes:

    K = -d(S' u - G + f)/d xi        M phi omega^2 = K phi

Source: Negrut & Ortiz, J. Comput. Nonlinear Dynam. 1 (2006) 230-239 (linearisation in the independent coordinates);
Meirovitch 2001, Fundamentals of Vibrations, ch. 7 (natural modes).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations, functions, measures
from linkwork.equations.algebra import SX
from linkwork.equations.equations import solve_symmetric
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State, checks
from linkwork.robot.charts import CompiledChart

if TYPE_CHECKING:
    import xarray

AT_REST = 1e-9
BALANCED = 1e-6
INDIFFERENT = 1e-12


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Hold x' = A x + B u, y = C x + D u for deviations x = (xi, dv) from a state, u from a force.

    states: names of x: independent coordinates [m, rad], then their rates; inputs: the actuators; outputs: names of y
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def poles(self) -> np.ndarray:
        """Return the eigenvalues of A [1/s], by the size of their imaginary parts."""
        return np.array(sorted(np.linalg.eigvals(self.A), key=lambda pole: (abs(pole.imag), pole.real, pole.imag)))

    @property
    def controllable(self) -> bool:
        """Tell whether the actuators reach every mode: no left eigenvector of A is perpendicular to B (Hautus)."""
        n = len(self.A)
        size = max(float(np.linalg.norm(self.A, 2)), 1e-300)
        B = self.B * size / max(float(np.linalg.norm(self.B, 2)), 1e-300)
        tests = (np.hstack([pole * np.eye(n) - self.A, B]) for pole in np.linalg.eigvals(self.A))
        return bool(all(np.linalg.svd(test, compute_uv=False)[-1] > 1e-9 * size for test in tests))

    def to_control(self) -> Any:
        """Return a `control.StateSpace` (python-control, the extra `control`)."""
        try:
            import control  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise LinkworkError(
                "python-control is not installed; install linkwork[control], or use A, B, C, D"
            ) from None
        names = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        return control.StateSpace(self.A, self.B, self.C, self.D, **{key: list(value) for key, value in names.items()})


def linearise(
    robot: Robot,
    state: State,
    forces: ArrayLike | Mapping[str, float] | None = None,
    *,
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """Linearise the equations of motion about a state and actuator forces.

    The state need not be an equilibrium: deviations are then those from the motion through it, at this instant.

    Args:
        state: one state, moving or at rest.
        forces: u of the actuators (actuators) [N, N m], or by name (others zero); zero if left out.
        outputs: names of joint coordinates and rates: "slide_1" for the coordinate, "slide_1 rate" for its rate; the
            independent coordinates and rates if left out.

    Raises:
        LinkworkError: a stack of states, unknown names, forces of wrong size, a singular configuration.
    """
    u = actuator_forces(robot, forces)
    n = one_state(robot, state)[1].size
    values = evaluated(robot, state, u)
    A = np.block([[values["Gamma"], np.eye(n)], [values["f_xi"], values["f_v"]]])
    B = np.vstack([np.zeros((n, u.size)), values["f_u"]])
    names = (*state.independent, *(f"{name} rate" for name in state.independent))
    wanted = names if outputs is None else checks.names(outputs, "outputs")
    C = np.array([output_row(robot, values, name, n) for name in wanted]).reshape(-1, 2 * n)
    return LinearModel(A, B, C, np.zeros((len(C), u.size)), names, robot.actuators, wanted)


def output_row(robot: Robot, values: Mapping[str, np.ndarray], name: str, n: int) -> np.ndarray:
    """Return the row of C (2 n) of a joint coordinate or rate."""
    joint = name.removesuffix(" rate")
    known = (*robot.rates, *(f"{rate} rate" for rate in robot.rates))
    checks.known((name,), known, "output")
    k = robot.rates.index(joint)
    if name == joint:
        return np.append(values["L"][k], np.zeros(n))
    return np.append(values["L_xi"][k], values["L"][k])


@dataclass(frozen=True, eq=False)
class NaturalModes:
    """Hold the small undamped vibrations about an equilibrium.

    frequencies: omega / 2 pi [Hz], lowest first; imaginary parts of unstable directions are given as negative numbers
    shapes: (n, modes) of the independent coordinates, of unit modal mass, phi' M phi = 1
    joints: (m, modes) the same in the rates of all joints, in the order of `rates`
    M, K: inertia and stiffness in the independent coordinates
    independent, rates: names
    """

    frequencies: np.ndarray
    shapes: np.ndarray
    joints: np.ndarray
    M: np.ndarray
    K: np.ndarray
    independent: tuple[str, ...]
    rates: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Tell whether the potential energy has a minimum there."""
        return bool((self.frequencies > 0).all())

    @property
    def dataset(self) -> xarray.Dataset:
        """Return frequencies and shapes by name."""
        import xarray

        return xarray.Dataset(
            {
                "frequency": (("mode",), self.frequencies, {"units": "Hz"}),
                "shape": (("rate", "mode"), self.joints, {"long_name": "shape of unit modal mass"}),
            },
            {"mode": np.arange(1, len(self.frequencies) + 1), "rate": list(self.rates)},
        )


def natural_modes(robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None) -> NaturalModes:
    """Return natural frequencies and mode shapes about an equilibrium: K phi = omega^2 M phi, dampers left out.

    Args:
        state: one state at rest; forces: the actuator forces that hold it; the ones that do (`inverse_dynamics`) if left
            out and the robot has actuators that can.

    Raises:
        LinkworkError: a state that moves, or that the forces do not hold.
    """
    from scipy.linalg import eigh

    if np.abs(state.rates).max(initial=0.0) > AT_REST:
        raise LinkworkError("natural modes are those about an equilibrium, but the state moves; set its rates to zero")
    u = holding(robot, state) if forces is None else actuator_forces(robot, forces)
    residual = robot.forward_dynamics(state, u)
    scale = np.abs(np.linalg.solve(robot.mass_matrix(state), robot.gravity(state))).max(initial=1.0)
    if np.abs(residual).max(initial=0.0) > BALANCED * scale:
        raise LinkworkError(
            f"the state is no equilibrium under these forces: it accelerates by {np.abs(residual).max():.3g}; find one by "
            "analysis.equilibrium, or give the forces that hold it"
        )
    M, K = robot.mass_matrix(state), stiffness_matrix(robot, state, u)
    squares, shapes = eigh((K + K.T) / 2, M)
    squares = np.where(np.abs(squares) < INDIFFERENT * np.abs(squares).max(initial=0.0), 0.0, squares)
    frequencies = np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * np.pi)
    joints = robot.rate_map(state) @ shapes
    return NaturalModes(frequencies, shapes, joints, M, K, state.independent, robot.rates)


def stiffness_matrix(robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None) -> np.ndarray:
    """Return K (n x n) = -d(S' u - G + f)/d xi of a state at rest: springs, weight and constant actuator forces.

    It is symmetric where the forces are in equilibrium.
    """
    one_state(robot, state)
    return evaluated(robot, at_rest(state), actuator_forces(robot, forces))["K"]


def tool_stiffness(
    robot: Robot,
    state: State,
    stiffness: Mapping[str, float],
    *,
    forces: ArrayLike | Mapping[str, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness and the compliance at the tool that the stiffnesses of joints give.

        C_x = T (L' k L + K)^-1 T',     K_x = C_x^-1 where the tool can be moved in all its directions

    Args:
        stiffness: k of joint rates by name [N/m, N m/rad], of actuators or any other joints; the others are rigid only
            where the loops make them so.
        forces: actuator forces, to add what weight, springs and these forces themselves do (K); left out: K = 0.

    Returns:
        K_x and C_x (6 x 6), for (rotation, translation) of the tool and wrenches (moment, force) about it, in the ground's
        axes [N m/rad, N, N/m and their inverses]. K_x is the pseudo-inverse of C_x: stiffness in directions in which the
        tool cannot move is not told.

    Raises:
        LinkworkError: unknown joints, negative stiffness, joints that leave the robot loose.
    """
    checks.known(stiffness, robot.rates, "rate")
    for name, value in stiffness.items():
        if checks.number(value, f"the stiffness of {name!r}") < 0:
            raise LinkworkError(f"the stiffness of {name!r} is {value}; give a number not below zero")
    robot.require_tool()
    one_state(robot, state)
    values = evaluated(robot, at_rest(state), actuator_forces(robot, forces))
    rows = values["L"][[robot.rates.index(name) for name in stiffness]]
    K = rows.T @ (np.array([float(value) for value in stiffness.values()])[:, None] * rows)
    K = K + (values["K"] if forces is not None else 0)
    sigma = np.linalg.svd(K, compute_uv=False)
    if not sigma[-1] > 1e-12 * max(sigma[0], 1e-300):
        raise LinkworkError(f"the stiffnesses of {', '.join(stiffness) or 'no joint'} leave the robot loose; give more")
    T = values["T_tool"]
    compliance = T @ np.linalg.solve(K, T.T)
    return np.linalg.pinv(compliance, rcond=1e-12, hermitian=True), compliance


def holding(robot: Robot, state: State) -> np.ndarray:
    """Return the actuator forces that hold a state, zero where no actuator drives it."""
    if not robot.actuators:
        return np.zeros(0)
    return np.asarray(robot.inverse_dynamics(at_rest(state), 0 * state.rates))


def at_rest(state: State) -> State:
    """Return the state at rest."""
    return state.with_rates(np.zeros(len(state.independent)))


def one_state(robot: Robot, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return q and v of one state; refuse a stack."""
    if robot.own(state).batch:
        raise LinkworkError("this needs one state, not a stack; take one by state.at(index)")
    return state.q, state.rates


def actuator_forces(robot: Robot, forces: ArrayLike | Mapping[str, float] | None) -> np.ndarray:
    """Return u (actuators) from numbers, by name, or zero."""
    if forces is None:
        return np.zeros(len(robot.actuators))
    if isinstance(forces, Mapping):
        checks.known(forces, robot.actuators, "actuator")
        forces = [forces.get(name, 0.0) for name in robot.actuators]
    u = checks.finite(checks.vector(forces, "forces", robot.actuators), "forces")
    if u.ndim != 1:
        raise LinkworkError(f"forces has the shape {u.shape}; give one number per actuator")
    return u


def evaluated(robot: Robot, state: State, u: np.ndarray) -> dict[str, np.ndarray]:
    """Return the derivatives at a state and force, by name."""
    chart = robot.chart_of(state)
    function = derivatives(chart)
    values = function(state.q, state.rates, u, robot.p)
    found = dict(zip(function.name_out(), (np.array(value) for value in values), strict=True))
    pivot = found.pop("pivot")
    if not abs(float(pivot[0, 0])) > checks.PIVOT_BOUND:
        raise checks.singular(state.independent, pivot[0])
    return found


@lru_cache(maxsize=32)
def derivatives(chart: CompiledChart) -> ca.Function:
    """Return (q, v, u, p) -> Gamma, f_xi, f_v, f_u, force, K, L, L_xi, T_tool, pivot; asked too seldom to be compiled.

    force = S' u - C v - G + f (n) and K = -d force/d xi; L (m x n) gives the rates of all joints, L_xi (m x n) is
    d(L v)/d xi; T_tool (6 x n) gives the tool's twist.
    """
    equations = chart.equations
    tree, v = equations.tree, equations.v
    u = SX.sym("u", len(equations.mechanism.actuators))
    L, _, pivot = equations.elimination
    S = ca.mtimes(tree.derivative_map, L)
    force = ca.mtimes(equations.actuation.T, u) - equations.bias_forces(equations.gravity)
    f = solve_symmetric(equations.inertia[0], force)
    joints = ca.mtimes(equations.joints.rate_rows(), L)
    along = [ca.jtimes(ca.mtimes(S, v), tree.q, S), shifted(S, tree.q, ca.mtimes(S, v))]
    tool = next(iter(equations.mechanism.tools.values()), None)
    T_tool = SX(0, equations.mobility)
    if tool is not None:
        T_tool = ca.mtimes(measures.tool_twist(tree, tool, SX.zeros(equations.nv))[0], L)
    outputs = {
        "Gamma": ca.mtimes(reading(equations), along[0] - along[1]),
        "f_xi": ca.jtimes(f, tree.q, S),
        "f_v": ca.jacobian(f, v),
        "f_u": ca.jacobian(f, u),
        "force": force,
        "K": -ca.jtimes(force, tree.q, S),
        "L": joints,
        "L_xi": ca.jtimes(ca.mtimes(joints, v), tree.q, S),
        "T_tool": T_tool,
        "pivot": pivot,
    }
    return functions.function("derivatives", equations, {"q": tree.q, "v": v, "u": u}, outputs)


def shifted(matrix: ca.SX, q: ca.SX, dq: ca.SX) -> ca.SX:
    """Return the derivative of a matrix of q along dq."""
    return ca.reshape(ca.jtimes(ca.vec(ca.densify(matrix)), q, dq), *matrix.shape)


def reading(equations: Equations) -> ca.SX:
    """Return S^+ (n x nq), the rows that read xi off dq: w = N^+ dq at the independent rates; N^+ = 4 N' for quaternions."""
    tree = equations.tree
    inverse = SX(equations.nv, equations.nq)
    for place, k in tree.single:
        inverse[k, place] = 1
    for places, ks in tree.quaternions:
        inverse[list(ks), list(places)] = 4 * tree.derivative_map[list(places), list(ks)].T
    return inverse[list(equations.chart.independent), :]
