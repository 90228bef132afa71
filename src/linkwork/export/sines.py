"""Sines and cosines in C: the polynomials of the kernels (`kernels.elementary`), for any number of
angles by one loop that compilers can make vectors of; or the C library's functions.

The quarter of the circle is told by numbers, without integers: from m = k - 4 round(k/4), which is
-2 ... 2, come  cos(k pi/2) = 1 - |m|  and  sin(k pi/2) = m (2 - |m|),  exactly.

Floats have polynomials of their own: minimax by Lawson's iteration, coefficients rounded, good to
1.3e-8 (sine) and 2e-10 (cosine) relative, and pi/2 in three floats, or in four of which three have
11 bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkwork.export.c_helpers import used
from linkwork.export.statements import TOGETHER, Dialect, Precision
from linkwork.export.templates import filled
from linkwork.kernels import elementary


@dataclass(frozen=True)
class Reduction:
    """Hold how sines and cosines are found in a precision: x = k pi/2 + r, then polynomials in r^2.

    bounds: largest |x| with and without products and sums of one rounding; whole: what a number is
    added to that it becomes a whole one; parts: of pi/2, with and without those
    """

    bounds: tuple[float, float]
    whole: float
    parts: tuple[Sequence[float], Sequence[float]]
    sine: Sequence[float]
    cosine: Sequence[float]


def _numbers(*texts: str) -> tuple[float, ...]:
    return tuple(map(float.fromhex, texts))


REDUCTIONS: dict[Precision, Reduction] = {
    "double": Reduction(
        (elementary.LARGEST_ANGLE, elementary.LARGEST_ANGLE_WITHOUT_FMA),
        elementary.ROUND,
        (elementary.HALF_PI, elementary.HALF_PI_SHORT),
        elementary.SINE,
        elementary.COSINE,
    ),
    "float": Reduction(
        (4096.0, 4096.0),
        1.5 * 2.0**23,
        (
            _numbers("0x1.921fb6p+0", "-0x1.777a5cp-25", "-0x1.ee59dap-50"),
            _numbers("0x1.92p+0", "0x1.fb4p-12", "0x1.444p-24", "0x1.68c234p-39"),
        ),
        _numbers("-0x1.555552p-3", "0x1.110bf8p-7", "-0x1.9aaf5p-13"),
        _numbers("-0x1p-1", "0x1.55554cp-5", "-0x1.6c0db0p-10", "0x1.9a52c8p-16"),
    ),
}


def turn_texts(dialect: Dialect, body: str) -> list[str]:
    """Return the static C functions that a body calls, and what they need:  turn(n, x, s, c),
    s = sin x, c = cos x for n angles, and  turn_one(x, s, c)  for one, without vectors."""
    if dialect.sines == "libm":
        return used([filled("turn_libm.c", dialect)], body)
    own = REDUCTIONS[dialect.precision]
    words = {
        "TOGETHER": str(TOGETHER),
        "BOUND_WITH_FMA": dialect.constant(own.bounds[0]),
        "BOUND_WITHOUT_FMA": dialect.constant(own.bounds[1]),
        "PER_QUARTER": dialect.constant(elementary.TWO_OVER_PI),
        "ROUND": dialect.constant(own.whole),
        "QUARTER": dialect.constant(0.25),
        "REDUCTION_WITH_FMA": _reduction(own.parts[0], dialect),
        "REDUCTION_WITHOUT_FMA": _reduction(own.parts[1], dialect),
        "SINE_POLYNOMIAL": _horner(own.sine, dialect),
        "COSINE_POLYNOMIAL": _horner(own.cosine, dialect),
    }
    turned = filled("turned.c", dialect, words).rstrip("\n")
    deeper = "\n".join(line if line[0] == "#" else 8 * " " + line for line in turned.splitlines())
    found = used(
        [
            filled("turn.c", dialect, {"TURNED": deeper}),
            filled("turn_one.c", dialect, {"TURNED": turned}),
        ],
        body,
    )
    return [filled("turn_seldom.c", dialect, words), *found] if found else []


def _reduction(parts: Sequence[float], dialect: Dialect) -> str:
    """Return the statements that subtract a multiple of pi/2 in parts."""
    lines, rest = [], "x[j]"
    for k, part in enumerate(parts):
        name = "r" if k == len(parts) - 1 else f"r{k}"
        less = f"LW_FMA(quarters, {dialect.constant(-part)}, {rest})"
        lines.append(f"    const lw_real {name} = {less};")
        rest = name
    return "\n".join(lines)


def _horner(coefficients: Sequence[float], dialect: Dialect) -> str:
    """Return the polynomial c_0 + c_1 z + c_2 z^2 + ... by Horner's rule."""
    *lower, highest = map(dialect.constant, coefficients)
    value = highest
    for coefficient in reversed(lower):
        value = f"LW_FMA(z, {value}, {coefficient})"
    return value
