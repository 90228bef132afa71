"""Functions to compile: every operation by itself, and random graphs with fixed seeds."""

import casadi as ca
import numpy as np

UNARY = {
    "neg": lambda x: -x,
    "inv": lambda x: 1 / x,
    "sq": lambda x: x * x,
    "twice": lambda x: 2 * x,
    "sqrt": ca.sqrt,
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "asin": ca.asin,
    "acos": ca.acos,
    "atan": ca.atan,
    "sinh": ca.sinh,
    "cosh": ca.cosh,
    "tanh": ca.tanh,
    "asinh": ca.asinh,
    "acosh": ca.acosh,
    "atanh": ca.atanh,
    "exp": ca.exp,
    "expm1": ca.expm1,
    "log": ca.log,
    "log1p": ca.log1p,
    "erf": ca.erf,
    "fabs": ca.fabs,
    "sign": ca.sign,
    "floor": ca.floor,
    "ceil": ca.ceil,
    "not": ca.logic_not,
    "constpow": lambda x: x**2.5,
    "whole power": lambda x: x**5,
    "division by 8": lambda x: x / 8,
    "division by 3": lambda x: x / 3,
}
BINARY = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "pow": lambda x, y: x**y,
    "atan2": ca.atan2,
    "hypot": ca.hypot,
    "fmin": ca.fmin,
    "fmax": ca.fmax,
    "fmod": ca.fmod,
    "remainder": ca.remainder,
    "copysign": ca.copysign,
    "lt": lambda x, y: x < y,
    "le": lambda x, y: x <= y,
    "eq": lambda x, y: x == y,
    "ne": lambda x, y: x != y,
    "and": ca.logic_and,
    "or": ca.logic_or,
    "if_else_zero": lambda x, y: ca.SX.binary(ca.OP_IF_ELSE_ZERO, x, y),
    "if_else": lambda x, y: ca.if_else(x < y, x, y),
}

# Continuous everywhere, with derivatives of order 1, so that rounding does not grow: these may be
# nested.
_GENTLE_UNARY = (
    ca.sin,
    ca.cos,
    ca.tanh,
    ca.atan,
    ca.erf,
    ca.fabs,
    lambda x: -x,
    lambda x: x / 3,
    lambda x: 0.5 * x,
    lambda x: ca.sqrt(1 + x * x),
    lambda x: ca.exp(-x * x),
    lambda x: ca.log(2 + ca.fabs(x)),
    lambda x: ca.asin(x / (1 + ca.fabs(x))),
    lambda x: ca.tan(x / (2 + ca.fabs(x))),
)
_GENTLE_BINARY = (
    lambda x, y: x + y,
    lambda x, y: x - y,
    lambda x, y: x * y / (1 + y * y),
    lambda x, y: x / (1 + y * y),
    lambda x, y: ca.hypot(x, y),
    lambda x, y: ca.atan2(x, 2 + ca.fabs(y)),
    lambda x, y: ca.fmax(x, y),
    lambda x, y: ca.if_else(x < y, x, y),
)


def random_function(seed: int, operations: int = 60) -> ca.Function:
    """Return a random function of three inputs (a vector, a sparse and a dense matrix) with two
    outputs, one of them sparse."""
    rng = np.random.default_rng(seed)
    a, b, c = ca.SX.sym("a", 4), ca.SX.sym("b", ca.Sparsity.lower(2)), ca.SX.sym("c", 2, 2)
    values = [*ca.vertsplit(a), *(b.nz[i] for i in range(3)), *(c.nz[i] for i in range(4))]
    for _ in range(operations):
        x, y = (values[-1 - rng.integers(min(20, len(values)))] for _ in range(2))
        if rng.random() < 0.4:
            value = _GENTLE_UNARY[rng.integers(len(_GENTLE_UNARY))](x)
        else:
            value = _GENTLE_BINARY[rng.integers(len(_GENTLE_BINARY))](x, y)
        values.append(value / (1 + 0.1 * value * value) if rng.random() < 0.5 else value)
    banded = ca.SX(ca.Sparsity.banded(4, 1), ca.vertcat(*values[-10:]))
    return ca.Function(
        f"random_{seed}", [a, b, c], [ca.vertcat(*values[-6:]), banded], ["a", "b", "c"], ["d", "e"]
    )


def evaluate(f: ca.Function, *arrays: np.ndarray) -> list[np.ndarray]:
    """Return CasADi's own evaluation of one state, as flat dense vectors."""
    arguments = [_matrix(array, f, i) for i, array in enumerate(arrays)]
    return [np.array(ca.densify(result)).ravel(order="F") for result in f.call(arguments)]


def _matrix(array: np.ndarray, f: ca.Function, i: int) -> ca.DM:
    """Return input i of f, whose structural zeros are not part of it."""
    return ca.project(ca.DM(np.reshape(array, f.size_in(i), order="F")), f.sparsity_in(i))
