"""Numbers of a description as exact ones: decimals as they are written, and those that are a
rational times a square root as that."""

from __future__ import annotations

from fractions import Fraction
from math import pi, prod, sqrt

import numpy as np

from linkwork.export.symbolic.trig import (
    Matrix,
    Trig,
    Vector,
    rational,
    symbol,
)

ULPS = 8  # by how many units in the last place a rounded number may lie beside the exact one
LARGEST = 24  # denominator of a rational that is taken to be meant
WRITTEN = 10  # digits of a number that is taken to be meant as it is written
SURDS = (("sqrt3",), ("sqrt2",), ("sqrt2", "sqrt3"), ("sqrt5",))
VALUES = {"sqrt2": sqrt(2), "sqrt3": sqrt(3), "sqrt5": sqrt(5), "pi": pi}
VANISHING = 1e-15  # component of a unit vector, or part of a length, that is a rounding error


def meant(value: float) -> Fraction | None:
    """Return the rational with a small denominator that a number is rounded from, if there is
    one."""
    near = Fraction(value).limit_denominator(LARGEST)
    return near if abs(value - float(near)) <= ULPS * np.spacing(abs(value)) else None


def exact(value: float, scale: float = 1.0) -> Trig:
    """Return a number as it is meant: a short decimal, a rational times roots, or all its digits.

    scale: of the numbers beside it, against which a rounding error is zero
    """
    if abs(value) <= VANISHING * scale:
        return rational(0)
    written = Fraction(repr(float(value)))
    if digits(value) <= WRITTEN:
        return rational(written)
    if (found := meant(value)) is not None:
        return rational(found)
    for roots in SURDS:
        root = float(np.prod([VALUES[name] for name in roots]))
        if (found := meant(value / root)) is not None:
            return prod(map(symbol, roots), start=rational(found))
    return rational(written)


def digits(value: float) -> int:
    """Return how many significant digits the shortest decimal of a number has."""
    mantissa = repr(float(value)).lower().partition("e")[0].replace("-", "").replace(".", "")
    return len(mantissa.strip("0"))


def exact_angle(value: float) -> Trig:
    """Return an angle [rad] within a turn: a rational times pi, or its decimals."""
    value = (value + pi) % (2 * pi) - pi
    turns = Fraction(value / pi).limit_denominator(LARGEST)
    if abs(value - float(turns) * pi) <= 4 * ULPS * np.spacing(pi):
        return symbol("pi") * turns
    return exact(value)


def exact_vector(values: np.ndarray) -> Vector:
    """Return the components of a vector as exact numbers."""
    scale = float(np.abs(values).max(initial=0.0))
    x, y, z = (exact(float(value), scale) for value in values)
    return (x, y, z)


def exact_matrix(values: np.ndarray) -> Matrix:
    """Return the elements of a rotation as exact numbers."""
    first, second, third = (tuple(exact(float(x), 1.0) for x in row) for row in np.asarray(values))
    return (first, second, third)  # pyright: ignore[reportReturnType]
