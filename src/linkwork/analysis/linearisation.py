"""Linearisation: how a robot moves near a state, exact along the constraint manifold
(`linkwork.equations.linear`).

    xi' = Gamma xi + dv,     dv' = f_q S xi + f_v dv + f_u du

xi are small shifts of the independent joints. At rest, with v' = 0, the same derivatives give
stiffness and natural modes:

    K = -d(S' u - G + f)/d xi        M phi omega^2 = K phi

Source: Meirovitch 2001, Fundamentals of Vibrations, ch. 7 (natural modes).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations.linear import row_derivatives
from linkwork.errors import LinkworkError
from linkwork.mechanism.task import is_length
from linkwork.model import checks, task
from linkwork.model.asked import task_rows
from linkwork.model.evaluation import own_units
from linkwork.model.linear import (
    actuator_forces,
    at_rest,
    evaluated,
    holding,
    largest,
    linearised,
    own_rates,
)
from linkwork.model.reordering import ordered
from linkwork.robot import Robot, State

if TYPE_CHECKING:
    import xarray

SHOWN = 8  # names and numbers in a repr
TOOL = "tool "  # before a task coordinate
AT_REST = 1e-9  # rate, relative to those of the motions that weight and stiffness cause
BALANCED = 1e-6  # acceleration, relative to those of weight and stiffness
INDIFFERENT = 1e-12  # square of a frequency, relative to the largest, and to that of weight


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Hold x' = A x + B u, y = C x + D u for deviations x = (xi, dv) from a state, u from a force.

    states: names of x: independent coordinates [m, rad], then their rates; inputs: names of u, the
        actuators or forces on the tool; outputs: names of y
    units: the mechanism's own of x and of u, but for time and mass: its length or 1 rad of x, the
        reciprocal of u
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[np.ndarray, np.ndarray]

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"LinearModel({sizes}; inputs: {', '.join(self.inputs[:SHOWN]) or 'none'})"

    @property
    def poles(self) -> np.ndarray:
        """Return the eigenvalues of A [1/s], by the size of their imaginary parts."""
        return np.array(
            sorted(
                np.linalg.eigvals(self.A), key=lambda pole: (abs(pole.imag), pole.real, pole.imag)
            )
        )

    @property
    def controllable(self) -> bool:
        """Tell whether the actuators reach every mode: no left eigenvector of A is perpendicular to
        B (Hautus)."""
        x, u = self.units
        A, B, n = self.A * x / x[:, None], self.B * u / x[:, None], len(x) // 2
        pace = max(largest(A[:n, :n]), largest(A[n:, n:]), largest(A[n:, :n]) ** 0.5) or 1.0  # 1/s
        time = np.repeat([1.0, pace], n)
        A, B = A * time / time[:, None], B / time[:, None]
        size = float(np.linalg.norm(A, 2))
        B = B * size / max(float(np.linalg.norm(B, 2)), np.finfo(float).tiny)
        tests = (np.hstack([pole * np.eye(2 * n) - A, B]) for pole in np.linalg.eigvals(A))
        return bool(all(np.linalg.svd(test, compute_uv=False)[-1] > 1e-9 * size for test in tests))

    def response(self, frequencies: ArrayLike) -> np.ndarray:
        """Return the frequency response C (i omega - A)^-1 B + D (..., outputs, inputs).

        Args:
            frequencies: omega / 2 pi (...) [Hz].
        """
        omega = 2 * np.pi * checks.finite(frequencies, "the frequencies")
        resolvent = 1j * omega[..., None, None] * np.eye(len(self.A)) - self.A
        return (
            self.C
            @ np.linalg.solve(resolvent, np.broadcast_to(self.B, (*omega.shape, *self.B.shape)))
            + self.D
        )

    def to_control(self) -> Any:
        """Return a `control.StateSpace` (python-control, the extra `control`)."""
        try:
            import control  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise LinkworkError(
                "python-control is not installed; install linkwork[control], or use A, B, C, D"
            ) from None
        names = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        return control.StateSpace(
            self.A, self.B, self.C, self.D, **{key: list(value) for key, value in names.items()}
        )


def linearise(
    robot: Robot,
    state: State,
    forces: ArrayLike | Mapping[str, float] | None = None,
    *,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
) -> LinearModel:
    """Linearise the equations of motion about a state and actuator forces.

    The state need not be an equilibrium: deviations are then those from the motion through it, at
    this instant.

    Args:
        state: one state, moving or at rest.
        forces: u of the actuators (actuators) [N, N m], or by name (others zero); zero if left out.
        outputs: names of joint coordinates and rates: "slide_1" for the coordinate, "slide_1 rate"
            for its rate; of the tool's task coordinates, "tool z" and "tool z rate" (of all of rx,
            ry, rz together turns and angular velocity); the independent coordinates and rates if
            left out.
        inputs: names of actuators, and "tool z" for the force that works on that task coordinate
            alone [N, N m]; the actuators if left out.

    Raises:
        LinkworkError: a stack of states, unknown names, forces of wrong size, a singular
            configuration.
    """
    u = actuator_forces(robot, forces)
    values, n = evaluated(robot, state, u), robot.mobility
    A, B = linearised(robot, values)
    names = (*state.independent, *(f"{name} rate" for name in state.independent))
    wanted = names if outputs is None else checks.names(outputs, "outputs")
    acting = robot.actuators if inputs is None else checks.names(inputs, "inputs")
    led = Led.of(robot, state, (*wanted, *acting))
    C = np.array([output_row(robot, values, led, name, n) for name in wanted]).reshape(-1, 2 * n)
    units = own_units(robot, state)
    own = np.tile(units.rates, 2), 1 / units.actuators
    if inputs is not None:
        columns = [input_column(robot, state, B, led, name) for name in acting]
        B = np.array(columns).reshape(-1, 2 * n).T
        driven = dict(zip(robot.actuators, own[1], strict=True))
        own = own[0], np.array([driven.get(name, led.unit(name)) for name in acting])
    return LinearModel(A, B, C, np.zeros((len(C), len(acting))), names, acting, wanted, own)


@dataclass(frozen=True, eq=False)
class Led:
    """Hold the rows of task coordinates at a state: J and d(J v)/d xi (k, n), by name."""

    rows: dict[str, tuple[np.ndarray, np.ndarray]]
    units: dict[str, float]

    @classmethod
    def of(cls, robot: Robot, state: State, names: Sequence[str]) -> Led:
        """Return those that some names speak of."""
        found = (name.removesuffix(" rate") for name in names if name not in robot.rates)
        own = dict.fromkeys(name.removeprefix(TOOL) for name in found if name.startswith(TOOL))
        if not own:
            return cls({}, {})
        asked = task.known(robot, tuple(own))
        chart = ordered(robot, robot.chart_of(state), state.q)
        function = row_derivatives(chart.equations, task_rows(chart.equations, asked))
        J, J_xi = (np.array(part) for part in function(state.q, state.rates, robot.p))
        if not np.isfinite(J).all() or not np.isfinite(J_xi).all():
            raise LinkworkError(
                f"some of the tool's {', '.join(own)} have no rate at this pose; choose others"
            )
        length = robot.equations.tree.length
        sizes = [1 / length if is_length(item) else 1.0 for item in asked]
        named = [f"{TOOL}{name}" for name in own]
        return cls(
            dict(zip(named, zip(J, J_xi, strict=True), strict=True)),
            dict(zip(named, sizes, strict=True)),
        )

    def unit(self, name: str) -> float:
        """Return the mechanism's own unit of a force on a task coordinate, but for mass and
        time."""
        return self.units.get(name, 1.0)


def input_column(robot: Robot, state: State, B: np.ndarray, led: Led, name: str) -> np.ndarray:
    """Return the column of B (2 n) of an actuator's force, or of one on a task coordinate: M^-1
    J'."""
    if name in led.rows:
        force = np.linalg.solve(robot.mass_matrix(state), led.rows[name][0])
        return np.append(np.zeros(robot.mobility), force)
    checks.known((name,), (*robot.actuators, *led.rows), "input")
    return B[:, robot.actuators.index(name)]


def output_row(
    robot: Robot, values: Mapping[str, np.ndarray], led: Led, name: str, n: int
) -> np.ndarray:
    """Return the row of C (2 n) of a coordinate or rate of a joint, or of the tool."""
    moved = name.removesuffix(" rate")
    if moved in led.rows:
        row, bent = led.rows[moved]
    else:
        known = (*robot.rates, *(f"{rate} rate" for rate in robot.rates))
        checks.known((name,), known, "output")
        row, bent = (values[part][robot.rates.index(moved)] for part in ("L", "L_xi"))
    return np.append(row, np.zeros(n)) if name == moved else np.append(bent, row)


@dataclass(frozen=True, eq=False)
class NaturalModes:
    """Hold the small undamped vibrations about an equilibrium.

    frequencies: omega / 2 pi [Hz], lowest first; imaginary parts of unstable directions are given
        as negative numbers
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

    def __repr__(self) -> str:
        lowest = ", ".join(f"{value:.5g}" for value in self.frequencies[:SHOWN])
        more = " ..." * (len(self.frequencies) > SHOWN)
        return f"NaturalModes({len(self.frequencies)} modes: {lowest} Hz{more})"

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


def natural_modes(
    robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None
) -> NaturalModes:
    """Return natural frequencies and mode shapes about an equilibrium: K phi = omega^2 M phi,
    dampers left out.

    Args:
        state: one state at rest; forces: the actuator forces that hold it; the least ones that do
            if left out, none without actuators.

    Raises:
        LinkworkError: a state that moves, or that the forces do not hold.
    """
    from scipy.linalg import eigh

    u = holding(robot, state) if forces is None else actuator_forces(robot, forces)
    M, K = robot.mass_matrix(state), stiffness_matrix(robot, state, u)
    squares, shapes = eigh((K + K.T) / 2, M)
    units = own_rates(robot, state)
    parts = (
        np.linalg.solve(M, np.stack([robot.gravity(state), robot.passive_forces(state)], axis=1))
        / units[:, None]
    )
    fall = float(np.linalg.norm(robot.mechanism.gravity)) / robot.equations.tree.length
    usual = max(fall, largest(parts), largest(squares))
    if largest(state.rates / units) > AT_REST * np.sqrt(usual):
        raise LinkworkError(
            "natural modes are those about an equilibrium, but the state moves; set its rates "
            "to zero"
        )
    residual = robot.forward_dynamics(state, u)
    if largest(residual / units) > BALANCED * usual:
        raise LinkworkError(
            "the state is no equilibrium under these forces: it accelerates by "
            f"{largest(residual):.3g}; find one by analysis.equilibrium, or give the forces that "
            "hold it"
        )
    squares = np.where(np.abs(squares) < INDIFFERENT * max(fall, largest(squares)), 0.0, squares)
    frequencies = np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * np.pi)
    joints = robot.rate_map(state) @ shapes
    return NaturalModes(frequencies, shapes, joints, M, K, state.independent, robot.rates)


def stiffness_matrix(
    robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None
) -> np.ndarray:
    """Return K (n x n) = -d(S' u - G + f)/d xi of a state at rest: springs, weight and constant
    actuator forces.

    It is symmetric where the forces are in equilibrium.
    """
    return evaluated(robot, at_rest(state), actuator_forces(robot, forces))["K"]


def tool_stiffness(
    robot: Robot,
    state: State,
    stiffness: Mapping[str, float],
    *,
    forces: ArrayLike | Mapping[str, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness and the compliance at the tool that the stiffnesses of joints give.

        C_x = T (L' k L + K)^-1 T',   K_x = C_x^-1 where the tool can be moved in all its directions

    Args:
        stiffness: k of joint rates by name [N/m, N m/rad], of actuators or any other joints; the
            others are rigid only where the loops make them so.
        forces: actuator forces, to add what weight, springs and these forces themselves do (K);
            left out: K = 0.

    Returns:
        K_x and C_x (6 x 6), for (rotation, translation) of the tool and wrenches (moment, force)
        about it, in the ground's axes [N m/rad, N, N/m and their inverses]. K_x is the
        pseudo-inverse of C_x in the mechanism's own length: stiffness in directions in which the
        tool cannot move is not told.

    Raises:
        LinkworkError: unknown joints, negative stiffness, joints that leave the robot loose.
    """
    checks.known(stiffness, robot.rates, "rate")
    for name, value in stiffness.items():
        if checks.number(value, f"the stiffness of {name!r}") < 0:
            raise LinkworkError(
                f"the stiffness of {name!r} is {value}; give a number not below zero"
            )
    robot.require_tool()
    values = evaluated(robot, at_rest(state), actuator_forces(robot, forces))
    rows = values["L"][[robot.rates.index(name) for name in stiffness]]
    K = rows.T @ (np.array([float(value) for value in stiffness.values()])[:, None] * rows)
    K = K + (values["K"] if forces is not None else 0)
    units = own_rates(robot, state)
    sigma = np.linalg.svd(K * units * units[:, None], compute_uv=False)
    if not sigma[-1] > 1e-12 * max(sigma[0], 1e-300):
        raise LinkworkError(
            f"the stiffnesses of {', '.join(stiffness) or 'no joint'} leave the robot loose; "
            "give more"
        )
    T = values["T_tool"]
    compliance = T @ np.linalg.solve(K, T.T)
    own = np.repeat([1.0, robot.equations.tree.length], 3)
    own = own * own[:, None]
    return np.linalg.pinv(compliance / own, rcond=1e-12, hermitian=True) / own, compliance
