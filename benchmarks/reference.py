"""The reference solution of the work-precision task, to 1e-14: extrapolation in extended precision.

The traced equations are walked in NumPy's long doubles (64 bits of mantissa on x86) instead of
being compiled, and integrated from knot to knot of the forces' spline, inside which everything is
analytic, by Gragg's modified midpoint rule with Aitken-Neville extrapolation in the squares of the
substeps (Hairer, Norsett & Wanner, Solving ODE I, sec. II.9). One order less, another integrator
and equations derived by hand are compared with it.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork.equations import functions
from linkwork.kernels.program import trace
from linkwork.simulation import Signal

from benchmarks import by_hand as hand
from benchmarks.tasks import Task

OPERATIONS: dict[str, Callable] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "fabs": abs,
    "fmin": min,
    "fmax": max,
    "copysign": np.copysign,
    "lt": operator.lt,
    "not": operator.not_,
    "if_else_zero": lambda condition, value: value if condition else type(value)(0),
}
Derivative = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Reference:
    """Hold the coordinates of slide_1..3 and pivot_1..3 at the end (6,) [m, rad] and what other
    ways differ by [m, rad].

    order: the same extrapolation with one column less; integrator: DOP853 on the compiled kernel in
        doubles;
    formulation: DOP853 on the equations derived by hand, in doubles.
    """

    end: np.ndarray
    order: float
    integrator: float
    formulation: float


def reference(robot: lw.Robot, task: Task) -> Reference:
    """Compute the end of the task, and how far other ways end from it."""
    joints = [
        robot.coordinates.index(f"{kind}_{i}") for kind in ("slide", "pivot") for i in (1, 2, 3)
    ]

    def ended(q: np.ndarray) -> np.ndarray:
        nothing = np.zeros(robot.mobility)
        return robot.kernel("joints_motion")(q.astype(float), nothing, nothing)[0][joints]

    end = ended(extrapolated(robot, task, columns=4))
    return Reference(
        end,
        order=gap(end, ended(extrapolated(robot, task, columns=3))),
        integrator=gap(end, ended(by_other_integrator(robot, task))),
        formulation=gap(end, by_hand(robot, task)),
    )


def gap(a: np.ndarray, b: np.ndarray) -> float:
    """Return the largest difference between joint coordinates."""
    return float(np.abs(a - b).max())


def extrapolated(robot: lw.Robot, task: Task, columns: int) -> np.ndarray:
    """Return the tree's coordinates at the end, in long doubles."""
    derivative, close = (
        walked(functions.motion(robot.equations)),
        walked(functions.closure_step(robot.equations)),
    )
    nq = robot.equations.nq
    q = task.start.q.astype(np.longdouble)
    for _ in range(3):
        q = close(q)[:nq]
    y = np.concatenate([q, task.start.rates.astype(np.longdouble)])

    def f(y: np.ndarray, u: np.ndarray) -> np.ndarray:
        return derivative(np.concatenate([y, u]))[: y.size]

    for begin, end, c in pieces(task.signal, task.duration):
        y = extrapolate(
            f, y, c.astype(np.longdouble), np.longdouble(end) - np.longdouble(begin), columns
        )
    return y[:nq]


def pieces(signal: Signal, duration: float) -> list[tuple[float, float, np.ndarray]]:
    """Return (begin, end, coefficients (4, n)) of the spline's pieces up to the end of the run."""
    ends = np.minimum(signal.knots[1:], duration)
    every = zip(signal.knots[:-1].tolist(), ends.tolist(), signal.coefficients, strict=True)
    return [piece for piece in every if piece[0] < piece[1]]


def extrapolate(
    f: Derivative, y: np.ndarray, c: np.ndarray, h: np.floating, columns: int
) -> np.ndarray:
    """Advance y over one piece of length h by extrapolation over 2, 4, 6 ... substeps: order 2 x
    columns."""
    row: list[np.ndarray] = []
    for k in range(columns):
        new = [midpoint_rule(f, y, c, h, 2 * (k + 1))]
        for j in range(k):
            ratio = (np.longdouble(k + 1) / np.longdouble(k - j)) ** 2
            new.append(new[j] + (new[j] - row[j]) / (ratio - 1))
        row = new
    return row[-1]


def midpoint_rule(
    f: Derivative, y: np.ndarray, c: np.ndarray, h: np.floating, substeps: int
) -> np.ndarray:
    """Return Gragg's modified midpoint rule over h, whose error is a series in the square of the
    substep."""
    step = h / substeps
    before, now = y, y + step * f(y, c[0])
    for k in range(1, substeps):
        before, now = now, before + 2 * step * f(now, polynomial(c, k * step))
    return (before + now + step * f(now, polynomial(c, h))) / 2


def polynomial(c: np.ndarray, s: float | np.floating) -> np.ndarray:
    """Return c_0 + c_1 s + c_2 s^2 + c_3 s^3."""
    return c[0] + s * (c[1] + s * (c[2] + s * c[3]))


def walked(function: ca.Function) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function x -> y that evaluates a CasADi function operation by operation in the
    numbers it is given."""
    program = trace(function)

    def evaluate(x: np.ndarray) -> np.ndarray:
        values: list = []
        for op, args, value in program.nodes:
            if op == "input":
                values.append(x[int(value)])
            elif op == "const":
                values.append(x.dtype.type(value))
            else:
                values.append(OPERATIONS[op](*[values[i] for i in args]))
        return np.array([values[i] for i in program.results], dtype=x.dtype)

    return evaluate


def by_other_integrator(robot: lw.Robot, task: Task) -> np.ndarray:
    """Return the tree's coordinates at the end by SciPy's DOP853 in doubles, piece by piece, on the
    compiled kernel."""
    kernel, nq = robot.kernel("motion"), robot.equations.nq
    y = np.concatenate([task.start.q, task.start.rates])
    for begin, end, c in pieces(task.signal, task.duration):

        def f(s: float, y: np.ndarray, c: np.ndarray = c) -> np.ndarray:
            rates, accelerations, _ = kernel(y[:nq], y[nq:], polynomial(c, s))
            return np.concatenate([rates, accelerations])

        y = solve_ivp(f, (0.0, end - begin), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return y[:nq]


def by_hand(robot: lw.Robot, task: Task) -> np.ndarray:
    """Return slide_1..3 and pivot_1..3 at the end by DOP853 on the equations derived by hand, piece
    by piece."""
    x = hand.from_joints(task.start.positions, robot.tool_pose(task.start))
    y = np.concatenate([x, task.start.rates])
    for begin, end, c in pieces(task.signal, task.duration):

        def f(s: float, y: np.ndarray, c: np.ndarray = c) -> np.ndarray:
            return np.concatenate(hand.derivative(y[:9], y[9:], polynomial(c, s)))

        y = solve_ivp(f, (0.0, end - begin), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return hand.sliding_and_pivoting(y)
