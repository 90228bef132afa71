"""Linear models: x' = A x + B u, y = C x + D u near a state of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import shown
from linkwork.equations.linear import row_derivatives, tool_responses
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.mechanism.task import is_length
from linkwork.model import checks, not_finite, task
from linkwork.model.asked_rows import task_rows
from linkwork.model.evaluation import own_units
from linkwork.model.linear import actuator_forces, evaluated, largest, linearised
from linkwork.model.reordering import ordered
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.model.model import Model

SHOWN = 8  # names in a repr
TOOL = "tool "  # before a task coordinate


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
        named = {"state": self.states, "input": self.inputs, "output": self.outputs}
        sizes = ", ".join(checks.amount(len(names), what) for what, names in named.items())
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
        reach = np.linalg.svd(B, compute_uv=False).max(initial=np.finfo(float).tiny)
        B = B * size / reach
        tests = (np.hstack([pole * np.eye(2 * n) - A, B]) for pole in np.linalg.eigvals(A))
        return bool(all(np.linalg.svd(test, compute_uv=False)[-1] > 1e-9 * size for test in tests))

    def response(self, frequencies: ArrayLike) -> np.ndarray:
        """Return the frequency response C (i omega - A)^-1 B + D (..., outputs, inputs).

        Args:
            frequencies: omega / 2 pi (...) [Hz].

        Raises:
            LinkworkError: the frequency of a mode without damping, at which it is infinite.
        """
        omega = 2 * np.pi * checks.finite(frequencies, "the frequencies")
        resolvent = 1j * omega[..., None, None] * np.eye(len(self.A)) - self.A
        given = np.broadcast_to(self.B, (*omega.shape, *self.B.shape))
        try:
            return self.C @ np.linalg.solve(resolvent, given) + self.D
        except np.linalg.LinAlgError:
            raise LinkworkError(
                "the response is infinite at one of the frequencies, that of a mode without "
                "damping; give others"
            ) from None

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
    robot: Model,
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
        robot: at the present values of its free numbers.
        state: one state, moving or at rest.
        forces: u of the actuators (actuators) [N, N m], or by name (others zero); zero if left out.
        outputs: names of joint coordinates and rates: "slide_1" for the coordinate, "slide_1 rate"
            for its rate; of the tool's task coordinates, "tool z" and "tool z rate" (of all of rx,
            ry, rz together turns and angular velocity); the independent coordinates and rates if
            left out.
        inputs: names of actuators, and "tool z" for the force that works on that task coordinate
            alone [N, N m] (where all of rx, ry, rz are among them moments); the actuators if left
            out.

    Raises:
        LinkworkError: a stack of states, unknown names, forces of wrong size, a singular
            configuration.
    """
    if not isinstance(getattr(robot, "mechanism", None), Mechanism):
        raise LinkworkError(f"the robot is {shown(robot)}; give a linkwork.Robot")
    u = actuator_forces(robot, forces)
    values, n = evaluated(robot, state, u), robot.mobility
    A, B = linearised(robot, values)
    if not (np.isfinite(A).all() and np.isfinite(B).all()):
        raise not_finite.refusal(robot.chart_of(state), state.q)
    names = (*state.independent, *(f"{name} rate" for name in state.independent))
    wanted = names if outputs is None else checks.names(outputs, "outputs")
    acting = robot.actuators if inputs is None else checks.names(inputs, "inputs")
    led = Led.of(robot, state, u, wanted, acting)
    C = np.zeros((len(wanted), 2 * n))
    for row, name in zip(C, wanted, strict=True):
        row[:n], row[n:] = output_row(robot, values, led, name)
    units = own_units(robot, state)
    own = np.tile(units.rates, 2), 1 / units.actuators
    if inputs is not None:
        columns = [input_column(robot, B, led, name) for name in acting]
        B = np.array(columns).reshape(-1, 2 * n).T
        driven = dict(zip(robot.actuators, own[1], strict=True))
        own = own[0], np.array([driven.get(name, led.unit(name)) for name in acting])
    return LinearModel(A, B, C, np.zeros((len(C), len(acting))), names, acting, wanted, own)


@dataclass(frozen=True, eq=False)
class Led:
    """Hold what task coordinates are at a state, by name: the rows J and d(J v)/d xi (k, n) of
    outputs, and the accelerations d v'/d f (k, n) that forces on inputs bring, with their units."""

    rows: dict[str, np.ndarray]
    pushed: dict[str, np.ndarray]
    units: dict[str, float]

    @classmethod
    def of(
        cls,
        robot: Model,
        state: State,
        u: np.ndarray,
        outputs: Sequence[str],
        inputs: Sequence[str],
    ) -> Led:
        """Return those that outputs and inputs speak of."""
        equations = ordered(robot, robot.chart_of(state), state.q).equations
        rows, pushed, units = {}, {}, {}
        named = tuple(name.removesuffix(" rate") for name in outputs)
        if names := led_by(robot, named):
            asked = task.known(robot, tuple(names.values()))
            function = row_derivatives(equations, task_rows(equations, asked))
            parts = np.array(function(state.q, state.rates, robot.p))
            rows = dict(zip(names, defined(parts, names).swapaxes(0, 1), strict=True))
        if names := led_by(robot, inputs):
            asked, length = task.known(robot, tuple(names.values())), robot.equations.tree.length
            response = tool_responses(equations, asked)(state.q, state.rates, u, robot.p)
            pushed = dict(zip(names, defined(np.array(response).T, names), strict=True))
            sizes = [1 / length if is_length(item) else 1.0 for item in asked]
            units = dict(zip(names, sizes, strict=True))
        return cls(rows, pushed, units)

    def unit(self, name: str) -> float:
        """Return the mechanism's own unit of a force on a task coordinate, but for mass and
        time."""
        return self.units.get(name, 1.0)


def led_by(robot: Model, names: Sequence[str]) -> dict[str, str]:
    """Return the task coordinates among outputs or inputs, by the names of these."""
    found = (name for name in names if name.startswith(TOOL) and name not in robot.rates)
    return {name: name.removeprefix(TOOL) for name in found}


def defined(values: np.ndarray, names: Mapping[str, str]) -> np.ndarray:
    """Return what task coordinates have at a pose; refuse those that have no rate there."""
    if not np.isfinite(values).all():
        raise LinkworkError(
            f"some of the tool's {', '.join(names.values())} have no rate at this pose; choose "
            "others"
        )
    return values


def input_column(robot: Model, B: np.ndarray, led: Led, name: str) -> np.ndarray:
    """Return the column of B (2 n) of an actuator's force, or of one on a task coordinate."""
    if name in led.pushed:
        return np.append(np.zeros(robot.mobility), led.pushed[name])
    checks.known((name,), (*robot.actuators, *led.pushed), "input")
    return B[:, robot.actuators.index(name)]


def output_row(
    robot: Model, values: Mapping[str, np.ndarray], led: Led, name: str
) -> tuple[ArrayLike, ArrayLike]:
    """Return the row of C of a coordinate or rate of a joint, or of the tool: its parts (n) for xi
    and for dv."""
    moved = name.removesuffix(" rate")
    if moved in led.rows:
        row, bent = led.rows[moved]
    else:
        if moved not in robot.rates:
            known = (*robot.rates, *(f"{rate} rate" for rate in robot.rates))
            checks.known((name,), known, "output")
        k = robot.rates.index(moved)
        row, bent = values["L"][k], values["L_xi"][k]
    return (row, 0.0) if name == moved else (bent, row)
