"""Sines and cosines in C: the polynomials of the kernels (`kernels.elementary`), for any number of
angles by one loop that compilers can make vectors of; or the C library's functions.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkwork.export.statements import Dialect
from linkwork.export.templates import filled
from linkwork.kernels import elementary


def turn_text(dialect: Dialect) -> str:
    """Return the static C function  turn(n, x, s, c):  s = sin x, c = cos x for n angles."""
    if dialect.sines == "libm":
        return filled("turn_libm.c", dialect)
    bounds = elementary.LARGEST_ANGLE, elementary.LARGEST_ANGLE_WITHOUT_FMA
    numbers = {
        "BOUND_WITH_FMA": bounds[0],
        "BOUND_WITHOUT_FMA": bounds[1],
        "PER_QUARTER": elementary.TWO_OVER_PI,
        "ROUND": elementary.ROUND,
    }
    words = {name: dialect.constant(value) for name, value in numbers.items()} | {
        "REDUCTION_WITH_FMA": _reduction(elementary.HALF_PI, dialect),
        "REDUCTION_WITHOUT_FMA": _reduction(elementary.HALF_PI_SHORT, dialect),
        "SINE_POLYNOMIAL": _horner(elementary.SINE, dialect),
        "COSINE_POLYNOMIAL": _horner(elementary.COSINE, dialect),
    }
    return filled("turn.c", dialect, words)


def _reduction(parts: Sequence[float], dialect: Dialect) -> str:
    """Return the statements that subtract a multiple of pi/2 in parts."""
    lines, rest = [], "near_x"
    for k, part in enumerate(parts):
        name = "r" if k == len(parts) - 1 else f"r{k}"
        lines.append(
            f"        const lw_real {name} = LW_FMA(quarters, {dialect.constant(-part)}, {rest});"
        )
        rest = name
    return "\n".join(lines)


def _horner(coefficients: Sequence[float], dialect: Dialect) -> str:
    """Return the polynomial c_0 + c_1 z + c_2 z^2 + ... by Horner's rule."""
    *lower, highest = map(dialect.constant, coefficients)
    value = highest
    for coefficient in reversed(lower):
        value = f"LW_FMA(z, {value}, {coefficient})"
    return value
