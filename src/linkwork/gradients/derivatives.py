"""Derivatives at states, or stacks of them, refused where they are not defined: what the methods of
`Robot` give."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import among, amount, needed
from linkwork.errors import LinkworkError
from linkwork.gradients.compilation import (
    Form,
    compiled,
    compiled_opening,
    require,
)
from linkwork.gradients.records import (
    ClosureDerivatives,
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    MassMatrixDerivatives,
    ToolDerivatives,
)
from linkwork.kernels import Kernel
from linkwork.kernels.from_python import Arrays, Columns
from linkwork.model import checks, evaluation
from linkwork.model.charts import CompiledChart
from linkwork.model.directly import DirectCalls
from linkwork.model.model import Model
from linkwork.model.reordering import evaluated
from linkwork.model.state import State
from linkwork.threads import number_of

Parts = tuple[np.ndarray, ...]
"""A value (..., values) and its derivatives (..., rows, columns) by q, by v, by what is given
beside, if anything is, and by p."""
OPENED = 1e-6
"""How far a free number may move a row that is not held, over what it moves the rows by itself."""


@lru_cache(maxsize=256)
def jacobian(chart: CompiledChart, what: str) -> Kernel:
    return compiled(chart, what, "jacobian")


def direct_jacobians(robot: Model, what: str) -> DirectCalls:
    """Return the shortest calls of a Jacobian at one state: value, derivatives by q, v, what is
    given, if anything is, and p."""
    kernel = partial(jacobian, what=what)
    return DirectCalls(robot.coordinates, robot.charts, kernel, value_and_matrices)


def value_and_matrices(kernel: Kernel, n: int) -> tuple[int, Arrays]:
    """Return where the outputs of a Jacobian begin, and their shapes."""
    (_, value), *by, _ = kernel.outputs
    rows = by[0][1] // n
    return 0, ((value,), *(Columns((rows, size // rows)) for _, size in by))


def directly(
    robot: Model, what: str, state: State, given: object = None, threads: int | None = 1
) -> Parts | None:
    """Return a value and its derivatives at one state, if all is plain and they are sound, and no
    free number may open loops."""
    if robot.parameters and robot.redundant:
        return None
    return robot.once(direct_jacobians, what).at(state, given, threads)


def derivative_kernel(
    robot: Model, what: str, form: Form = "jacobian", state: State | None = None
) -> Kernel:
    """Return the kernel of a derivative, for one state and for many.

    It takes the tree's coordinates `state.q`, the rates v, what is given (u or v'), steps or
    weights, and p, the robot's if left out; it gives the value, the derivatives, each a matrix
    column by column, and the weakest relative pivot, which tells singular states.

    Args:
        what: forward_dynamics, inverse_dynamics (on the independent rates), mass_matrix, actuation,
            closure (of the tree), joints, tool (`linkwork.gradients.compilation`).
        form: "jacobian", "jvp" (along steps of q, v, what is given and p) or "vjp" (the gradient of
            weights times the value).
        state: in whose independent rates; those at home if left out.

    Raises:
        LinkworkError: another name or form; no tool.
    """
    needed(robot, Model, "linkwork.Robot")
    require(what, form)
    if what == "tool":
        robot.require_tool()
    return compiled(robot.chart if state is None else robot.chart_of(robot.own(state)), what, form)


def told(
    robot: Model,
    what: str,
    state: State,
    given: tuple[np.ndarray, ...] = (),
    named: str = "rates",
    threads: int | None = 1,
) -> Parts:
    """Return what a Jacobian of `compilation` tells at states; named: what is given."""
    chart, q, v = robot.chart_of(robot.own(state)), state.q, state.rates
    kernel, n, share = jacobian(chart, what), len(state.independent), number_of(threads)
    widths = (n, n, *(part.shape[-1] for part in given), len(robot.p))
    if robot.parameters:
        refuse_opened(robot, chart, state)
    # One state takes a short way up to where there is code for the shortest one.
    if q.ndim == 1 and all(part.ndim == 1 for part in given):
        y = kernel.flat(q, v, *given, robot.p)
        if abs(y.item(-1)) > checks.sure(chart.key) and isfinite(y.dot(y)):
            return parts_of(kernel, y, widths)
    # Stacks, weak orders of elimination, and what is to be refused.
    checks.together(state.batch, *(part.shape[:-1] for part in given))
    value, *by, pivot = evaluated(
        robot, chart, lambda other: jacobian(other, what), q, v, *given, threads=share
    )
    evaluation.require_regular(robot, state, pivot, value, given[0] if given else v, named)
    require_finite(what, value, by, len(given))
    rows = by[0].shape[-1] // n
    matrices = (matrix(part, rows, width) for part, width in zip(by, widths, strict=True))
    return value, *matrices


def parts_of(kernel: Kernel, y: np.ndarray, widths: tuple[int, ...]) -> Parts:
    """Return the outputs of one state (n_out) as a value and matrices."""
    at = kernel.outputs[0][1]
    value, by = y[:at], []
    rows = kernel.outputs[1][1] // widths[0]
    for width in widths:
        end = at + rows * width
        by.append(y[at:end].reshape(width, rows).T)
        at = end
    return value, *by


def matrix(flat: np.ndarray, rows: int, width: int) -> np.ndarray:
    """Return matrices (..., rows, width) of columns one after the other."""
    return np.swapaxes(flat.reshape(*flat.shape[:-1], width, rows), -1, -2)


def require_finite(what: str, value: np.ndarray, by: list[np.ndarray], given: int) -> None:
    """Refuse derivatives that are not finite where the value is."""
    names = ["q", "v", *["what is given"] * given, "the free numbers"]
    wrong = [name for name, part in zip(names, by, strict=True) if not np.isfinite(part).all()]
    if wrong:
        raise LinkworkError(
            f"the derivatives of {what.replace('_', ' ')} with respect to {wrong[0]} are not "
            "finite here, though the values are: something that acts has a corner or a root here, "
            "such as a force along a length of zero; move the state a little"
        )


def refuse_opened(robot: Model, chart: CompiledChart, state: State) -> None:
    """Refuse free numbers that open loops: they move closure rows that depend on the others and are
    not held, so that there is nothing near to differentiate along."""
    names, kept = chart.equations.rows.names, set(chart.equations.chart.rows)
    left = [name for index, name in enumerate(names) if index not in kept]
    if not left:
        return
    opened, size, _ = evaluated(robot, chart, compiled_opening, state.q)
    width = len(robot.parameters)
    moved = np.abs(matrix(opened, len(left), width))
    wrong = moved > OPENED * np.maximum(size, np.finfo(float).tiny)[..., None, :]
    if wrong.any():
        *_, row, column = np.argwhere(wrong)[0]
        raise LinkworkError(
            f"the free number {list(robot.parameters)[column]!r} opens the loops: "
            f"{left[row]} depends on other rows and stays closed at its value alone, so that there "
            "is no derivative; leave that number fixed"
        )


def chart_of(robot: Model, state: State) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the independent rates and of the free numbers."""
    return state.independent, tuple(robot.parameters)


def forward_dynamics_derivatives(
    robot: Model,
    state: State,
    forces: ArrayLike | Mapping[str, ArrayLike],
    threads: int | None = 1,
) -> ForwardDynamicsDerivatives:
    """Return v' and its derivatives: `Robot.forward_dynamics_derivatives`."""
    found = directly(robot, "forward_dynamics", state, forces, threads)
    if found is None:
        u = checks.actuator_forces(forces, robot.actuators)
        found = told(robot, "forward_dynamics", state, (u,), "forces", threads)
    value, by_q, by_v, by_u, by_p = found
    return ForwardDynamicsDerivatives(
        *chart_of(robot, state), value, by_q, by_v, by_u, by_p, robot.actuators
    )


def inverse_dynamics_derivatives(
    robot: Model,
    state: State,
    accelerations: ArrayLike | Mapping[str, ArrayLike],
    of: Literal["actuators", "rates"] = "actuators",
    weights: ArrayLike | Mapping[str, float] | None = None,
    threads: int | None = 1,
) -> InverseDynamicsDerivatives:
    """Return forces and their derivatives: `Robot.inverse_dynamics_derivatives`."""
    if not among(of, ("actuators", "rates")):
        raise LinkworkError(f"of is {of!r}; give 'actuators' or 'rates'")
    if weights is not None:
        evaluation.of_actuators(robot, weights)
    if robot.rubs:
        raise LinkworkError(
            "inverse dynamics is not differentiated where bearings rub by what they carry, which "
            "depends on the forces that are asked for; take forward_dynamics_derivatives"
        )
    found = directly(robot, "inverse_dynamics", state, accelerations, threads)
    if found is None or (of == "actuators" and state.independent != robot.actuators):
        independent = robot.own(state).independent
        v_dot = checks.accelerations(accelerations, independent)
        if found is None:
            given = "inverse_dynamics", state, (v_dot,), "accelerations"
            found = told(robot, *given, threads)
        if of == "actuators" and independent != robot.actuators:
            found = of_actuators(robot, state, v_dot, found, weights)
    rows = robot.actuators if of == "actuators" else state.independent
    value, by_q, by_v, by_dv, by_p = found
    return InverseDynamicsDerivatives(*chart_of(robot, state), value, by_q, by_v, by_dv, by_p, rows)


def of_actuators(
    robot: Model,
    state: State,
    v_dot: np.ndarray,
    needed: Parts,
    weights: ArrayLike | Mapping[str, float] | None,
) -> Parts:
    """Return u of least weighted norm with S' u = f, and its derivatives, of f and those of it.

    With R = W^-1/2 S of full rank, x = W^1/2 u = R (R' R)^-1 f and y = R^+ x,

        dx = R^+' (df - dR' x) + (1 - R R^+) dR y
    """
    n, count = len(state.independent), len(robot.actuators)
    if count < n:
        raise LinkworkError(
            f"{amount(count, 'actuator')} cannot drive all {n} freedoms, so that motions nearby "
            "need forces that are not given; ask for of='rates', the forces on the independent "
            "rates"
        )
    u = evaluation.actuator_forces(robot, state, v_dot, weights)
    W = 1.0 if weights is None else evaluation.of_actuators(robot, weights)
    units = evaluation.own_units(robot, state)
    root = np.broadcast_to(np.sqrt(W), count) / units.actuators  # of the weights, in own units
    S, *by_S = told(robot, "actuation", state)
    R = units.map(matrix(S, count, n)) / root[:, None]
    x, inverse = root * units.actuators * u, np.linalg.pinv(R)
    across = np.eye(count) - R @ inverse
    y = (inverse @ x[..., None])[..., 0]
    found, turned = [], [by_S[0], by_S[1], np.zeros((*by_S[0].shape[:-1], n)), by_S[2]]
    for df, dS in zip(needed[1:], turned, strict=True):
        dS = dS.reshape(*dS.shape[:-2], n, count, dS.shape[-1])
        dR = np.moveaxis(dS, -1, -3) * (units.rates[:, None] / units.actuators / root)
        dx = np.swapaxes(df * units.rates[:, None], -1, -2)[..., None]
        dx = np.swapaxes(inverse, -1, -2)[..., None, :, :] @ (dx - dR @ x[..., None, :, None])
        dx = dx + across[..., None, :, :] @ (np.swapaxes(dR, -1, -2) @ y[..., None, :, None])
        found.append(np.swapaxes(dx[..., 0], -1, -2) / (root * units.actuators)[:, None])
    return u, *found


def mass_matrix_derivatives(
    robot: Model, state: State, threads: int | None = 1
) -> MassMatrixDerivatives:
    """Return M and its derivatives: `Robot.mass_matrix_derivatives`."""
    found = directly(robot, "mass_matrix", state, threads=threads) or told(
        robot, "mass_matrix", state, threads=threads
    )
    M, by_q, _, by_p = found
    n = len(state.independent)
    M, by_q, by_p = (
        part.reshape(*part.shape[: len(state.batch)], n, n, *part.shape[len(state.batch) + 1 :])
        for part in (M, by_q, by_p)
    )
    return MassMatrixDerivatives(*chart_of(robot, state), M, by_q, by_p)


def closure_derivatives(robot: Model, state: State, threads: int | None = 1) -> ClosureDerivatives:
    """Return how all joints follow the independent ones: `Robot.closure_derivatives`."""
    found = directly(robot, "joints", state, threads=threads) or told(
        robot, "joints", state, threads=threads
    )
    _, by_q, by_v, by_p = found
    m = len(robot.coordinates)
    return ClosureDerivatives(
        *chart_of(robot, state),
        by_q[..., :m, :],
        by_p[..., :m, :],
        by_q[..., m:, :],
        by_v[..., m:, :],
        by_p[..., m:, :],
        robot.coordinates,
        robot.rates,
    )


def tool_derivatives(robot: Model, state: State, threads: int | None = 1) -> ToolDerivatives:
    """Return how the first tool's pose and twist change: `Robot.tool_derivatives`."""
    robot.require_tool()
    found = directly(robot, "tool", state, threads=threads) or told(
        robot, "tool", state, threads=threads
    )
    value, by_q, by_v, by_p = found
    return ToolDerivatives(
        *chart_of(robot, state),
        by_q[..., :6, :],
        by_p[..., :6, :],
        value[..., -6:],
        by_q[..., 6:, :],
        by_v[..., 6:, :],
        by_p[..., 6:, :],
    )
