"""Elementary functions for controllers: of numbers, of arrays, and of the symbols that a controller
is traced with.

A controller written with these is called with numbers or with symbols alike. Instead of branching
on a value, which a symbol does not have, it selects:  where(condition, a, b).
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

__all__ = [
    "abs",
    "acos",
    "array",
    "asin",
    "atan",
    "atan2",
    "ceil",
    "clip",
    "cos",
    "cosh",
    "cross",
    "dot",
    "exp",
    "floor",
    "hypot",
    "log",
    "log1p",
    "maximum",
    "minimum",
    "norm",
    "pi",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "sum",
    "tan",
    "tanh",
    "where",
]

pi = float(np.pi)


def symbolic(value: Any) -> bool:
    """Tell whether a value is a symbol, or holds one."""
    if isinstance(value, ca.SX):
        return True
    if isinstance(value, np.ndarray):
        return value.dtype == object and any(isinstance(x, ca.SX) for x in value.flat)
    return isinstance(value, list | tuple) and any(symbolic(x) for x in value)


def vector(symbols: ca.SX) -> np.ndarray:
    """Return the elements of a matrix of symbols, column by column, as a vector of single
    symbols."""
    elements = np.empty(symbols.numel(), dtype=object)
    elements[:] = ca.vertsplit(ca.densify(ca.vec(symbols)))
    return elements


def array(values: Any) -> np.ndarray:
    """Return an array of numbers, or of single symbols and numbers (dtype object), from nested
    sequences.

    values: numbers, symbols, or sequences of them.
    """
    if isinstance(values, ca.SX):
        return vector(values).reshape(shape(values), order="F")
    if not symbolic(values):
        return np.asarray(values, float)
    if isinstance(values, np.ndarray):
        return values
    parts = [array(value) for value in values]
    stacked = np.empty(
        (len(parts), *np.broadcast_shapes(*(part.shape for part in parts))), dtype=object
    )
    for i, part in enumerate(parts):
        stacked[i] = part[()]
    return stacked


def shape(symbols: ca.SX) -> tuple[int, ...]:
    """Return the shape of the array that a matrix of symbols stands for: a column is a vector."""
    if symbols.is_scalar():
        return ()
    return (symbols.numel(),) if symbols.is_column() else symbols.shape


def elementwise(
    of_symbols: Callable[..., Any], of_numbers: Callable[..., Any]
) -> Callable[..., Any]:
    """Return the function that takes numbers, arrays and symbols, element by element, broadcasting
    as NumPy does."""

    def function(*values: Any) -> Any:
        if not any(symbolic(value) for value in values):
            return of_numbers(*values)
        arrays = np.broadcast_arrays(*(np.asarray(array(value), object) for value in values))
        result = np.empty(arrays[0].shape, dtype=object)
        for index in np.ndindex(*result.shape):
            result[index] = of_symbols(*(part[index] for part in arrays))
        return result[()]

    function.__name__ = of_numbers.__name__
    function.__doc__ = (
        f"Return {of_numbers.__name__} of values: numbers, arrays or symbols, element by element."
    )
    return function


sin = elementwise(ca.sin, np.sin)
cos = elementwise(ca.cos, np.cos)
tan = elementwise(ca.tan, np.tan)
asin = elementwise(ca.asin, np.arcsin)
acos = elementwise(ca.acos, np.arccos)
atan = elementwise(ca.atan, np.arctan)
atan2 = elementwise(ca.atan2, np.arctan2)
sinh = elementwise(ca.sinh, np.sinh)
cosh = elementwise(ca.cosh, np.cosh)
tanh = elementwise(ca.tanh, np.tanh)
exp = elementwise(ca.exp, np.exp)
log = elementwise(ca.log, np.log)
log1p = elementwise(ca.log1p, np.log1p)
sqrt = elementwise(ca.sqrt, np.sqrt)
hypot = elementwise(ca.hypot, np.hypot)
sign = elementwise(ca.sign, np.sign)
floor = elementwise(ca.floor, np.floor)
ceil = elementwise(ca.ceil, np.ceil)
abs = elementwise(ca.fabs, np.abs)
minimum = elementwise(ca.fmin, np.minimum)
maximum = elementwise(ca.fmax, np.maximum)
where = elementwise(ca.if_else, np.where)


def clip(value: Any, lower: Any, upper: Any) -> Any:
    """Return the value, or the bound, `lower` or `upper`, that it lies beyond."""
    return minimum(maximum(value, lower), upper)


def sum(values: Sequence[Any] | np.ndarray) -> Any:
    """Return the sum of a list or vector.

    values: numbers or symbols.
    """
    return builtins.sum(array(values))


def dot(a: Any, b: Any) -> Any:
    """Return the sum of the products of two vectors' elements.

    a, b: of one length.
    """
    return sum(array(a) * array(b))


def norm(a: Any) -> Any:
    """Return the length of a vector."""
    return sqrt(dot(a, a))


def cross(a: Any, b: Any) -> np.ndarray:
    """Return the cross product of two vectors of three elements.

    a, b: (3) each.
    """
    (ax, ay, az), (bx, by, bz) = array(a), array(b)
    return array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
