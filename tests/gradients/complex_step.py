"""Derivatives by complex steps, exact to rounding: what functions tell of configurations that were
moved along the independent rates, or to other free numbers, by i h, and closed again.

    f(x + i h) = f(x) + i h f'(x) + O(h^2),      h = 1e-60

Functions are evaluated operation by operation in complex numbers, all steps side by side; nothing
that differentiates takes part. Source: Squire & Trapp, SIAM Review 40 (1998) 110-112.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations import Equations, functions
from linkwork.kernels.program import trace

H = 1e-60
NEWTON = 10
Value = Callable[..., np.ndarray]


def sized(x: np.ndarray) -> np.ndarray:
    """Return |x|, continued."""
    return np.where(x.real < 0, -x, x)


def angle(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return atan2(y, x) for small imaginary parts."""
    turned = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return np.arctan2(y.real, x.real) + 1j * turned


OPERATIONS: dict[str, Callable[..., np.ndarray]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan2": angle,
    "exp": np.exp,
    "log": np.log,
    "tanh": np.tanh,
    "pow": np.power,
    "fabs": sized,
    "sign": lambda x: np.sign(x.real) + 0j,
    "fmin": lambda x, y: np.where(x.real <= y.real, x, y),
    "fmax": lambda x, y: np.where(x.real >= y.real, x, y),
    "lt": lambda x, y: (x.real < y.real) + 0j,
    "le": lambda x, y: (x.real <= y.real) + 0j,
    "eq": lambda x, y: (x.real == y.real) + 0j,
    "ne": lambda x, y: (x.real != y.real) + 0j,
    "and": lambda x, y: ((x.real != 0) & (y.real != 0)) + 0j,
    "or": lambda x, y: ((x.real != 0) | (y.real != 0)) + 0j,
    "not": lambda x: (x.real == 0) + 0j,
    "if_else_zero": lambda c, x: np.where(c.real != 0, x, 0),
    "copysign": lambda x, y: sized(x) * np.copysign(1.0, y.real),
}


def in_complex_numbers(function: ca.Function) -> Value:
    """Return a function that is evaluated in complex numbers: inputs (size, K), outputs one below
    the other (n_out, K)."""
    program = trace(function)

    def evaluate(*given: np.ndarray) -> np.ndarray:
        x = np.concatenate(np.broadcast_arrays(np.zeros((0, given[0].shape[1])), subok=True))
        x = np.concatenate([x, *given]).astype(complex)
        values: list[np.ndarray] = []
        for node in program.nodes:
            if node.op == "input":
                values.append(x[int(node.value)])
            elif node.op == "const":
                values.append(np.full(x.shape[1], node.value + 0j))
            else:
                values.append(OPERATIONS[node.op](*(values[i] for i in node.args)))
        return np.array([values[i] for i in program.results]).reshape(-1, x.shape[1])

    return evaluate


class ComplexSteps:
    """Differentiate functions of equations by complex steps."""

    def __init__(self, equations: Equations):
        self.equations = equations

    @cached_property
    def closure_step(self) -> Value:
        return in_complex_numbers(functions.closure_step(self.equations))

    def closed(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return q (nq, K) with the dependent coordinates where the loops are closed."""
        for _ in range(NEWTON):
            q = self.closure_step(q, p)[: self.equations.nq]
        return q

    def moved(self, q: np.ndarray, steps: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return q (nq, K) after steps (n, K) along the independent rates: coordinates by them,
        quaternions turned by their rotation vector."""
        tree, q = self.equations.tree, q.astype(complex)
        along = np.zeros((self.equations.nv, steps.shape[1]), complex)
        along[list(self.equations.chart.independent)] = steps
        for place, own in tree.single:
            q[place] += along[own]
        for places, rates in tree.quaternions:
            q[list(places)] = turned(along[list(rates)], q[list(places)])
        return self.closed(q, p)

    def derivatives(
        self, value: Value, q: np.ndarray, v: np.ndarray, given: np.ndarray, p: np.ndarray
    ) -> list[np.ndarray]:
        """Return the derivatives (rows x n, n, given, np) of a value of (q, v, given, p)."""
        sizes = [v.size, v.size, given.size, p.size]
        steps = np.split(1j * H * np.eye(sum(sizes)), np.cumsum(sizes)[:-1])
        others = [x[:, None] + step for x, step in zip((v, given, p), steps[1:], strict=True)]
        places = np.repeat(q[:, None], sum(sizes), axis=1)
        found = value(self.moved(places, steps[0], others[2]), *others)
        return np.split(found.imag / H, np.cumsum(sizes)[:-1], axis=1)


def turned(turn: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return quaternions (4, K) after small turns (3, K) in the axes of the first frame."""
    size = np.sqrt((turn**2).sum(axis=0))
    part = np.where(size == 0, 0.5, np.sin(size / 2) / np.where(size == 0, 1, size))
    s, u = np.cos(size / 2), part * turn
    return np.array(
        [s * x[0] - (u * x[1:]).sum(axis=0), *(s * x[1:] + x[0] * u + crossed(u, x[1:]))]
    )


def crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.cross(a, b, axis=0)
