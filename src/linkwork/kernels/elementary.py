"""Sine and cosine of one angle together, as straight-line code.

The angle is reduced by Cody and Waite's method and both functions of the rest come from
polynomials:

    x = k pi/2 + r,  |r| <= pi/4,    sin r = r + r z S(z),    cos r = 1 + z C(z),    z = r^2.

k is the integer nearest to x 2/pi. Adding 1.5 * 2^52 rounds to it and leaves it in the low bits of
the sum, where its parity says which of the two is the sine and its second bit the sign. pi/2 is
subtracted in parts, each step exact where digits cancel, so that r is right to the last place even
for the angles nearest to a multiple of pi/2. S and C are minimax polynomials (Remez exchange in 60
digits, coefficients rounded one after the other), good to 2^-57.9 and 2^-53.9 relative; the results
are within 2 units in the last place for |x| <= LARGEST_ANGLE, and within 2.5 on a machine without
fused multiply-add (tests/kernels/test_elementary.py measures them).

Cody and Waite, Software Manual for the Elementary Functions, 1980, ch. 8; Muller, Elementary
Functions, 2016, sec. 11.2.
"""

from collections.abc import Callable

from linkwork.kernels.lines import Lines

LARGEST_ANGLE = 2.0**30
LARGEST_ANGLE_WITHOUT_FMA = 2.0**20


def _doubles(*texts: str) -> tuple[float, ...]:
    return tuple(map(float.fromhex, texts))


_SIGN = -(2**63)
ROUND = 1.5 * 2.0**52
TWO_OVER_PI = float.fromhex("0x1.45f306dc9c883p-1")
HALF_PI = _doubles("0x1.921fb54442d18p+0", "0x1.1a62633145c07p-54", "-0x1.f1976b7ed8fbcp-110")
# Thirty bits each but the last: the products with k are exact without a fused multiply-add.
HALF_PI_SHORT = _doubles(
    "0x1.921fb54000000p+0",
    "0x1.10b4611800000p-30",
    "0x1.313198a000000p-61",
    "0x1.701b839a25205p-92",
)
SINE = _doubles(
    "-0x1.5555555555548p-3",
    "0x1.111111110f730p-7",
    "-0x1.a01a019be9210p-13",
    "0x1.71de35552a6a6p-19",
    "-0x1.ae5e4b82beca9p-26",
    "0x1.5d8b55206a4dbp-33",
)
COSINE = _doubles(
    "-0x1.fffffffffff96p-2",
    "0x1.555555554f057p-5",
    "-0x1.6c16c16405528p-10",
    "0x1.a019f817f8e62p-16",
    "-0x1.27df4424e382dp-22",
    "0x1.1b8b09f2747acp-29",
)

_ProductPlus = Callable[[Lines, str, str, str], str]  # appends a * b + c


def sine_and_cosine(lines: Lines, x: str, has_fma: bool) -> tuple[str, str]:
    """Append the code for sin x and cos x, x in radians, and return the names of the two values.

    Right for |x| <= LARGEST_ANGLE (LARGEST_ANGLE_WITHOUT_FMA where the machine has no fused
    multiply-add); NaN for inf and NaN; sin(-0) is 0.
    """
    plus = product_plus(has_fma)
    shifted = plus(lines, x, lines.constant(TWO_OVER_PI), lines.constant(ROUND))
    multiple = lines.op("fsub", shifted, lines.constant(ROUND))
    rest = x
    for part in HALF_PI if has_fma else HALF_PI_SHORT:
        rest = plus(lines, multiple, lines.constant(-part), rest)

    square = lines.op("fmul", rest, rest)
    cube = lines.op("fmul", square, rest)
    sine = plus(lines, cube, _polynomial(lines, square, SINE, plus), rest)
    cosine = plus(lines, square, _polynomial(lines, square, COSINE, plus), lines.constant(1.0))

    quadrant = lines.as_integer(shifted)
    odd = lines.bits("shl", quadrant, lines.whole(63))
    minus = lines.bits("and", lines.bits("shl", quadrant, lines.whole(62)), lines.whole(_SIGN))
    swap = lines.let(f"icmp slt {lines.integer} {odd}, {lines.whole(0)}")
    return (
        _flip(lines, lines.select(swap, cosine, sine), minus),
        _flip(lines, lines.select(swap, sine, cosine), lines.bits("xor", minus, odd)),
    )


def _polynomial(lines: Lines, z: str, coefficients: tuple[float, ...], plus: _ProductPlus) -> str:
    """Append the polynomial c_0 + c_1 z + c_2 z^2 + ... by Horner's rule."""
    *lower, highest = map(lines.constant, coefficients)
    value = highest
    for coefficient in reversed(lower):
        value = plus(lines, z, value, coefficient)
    return value


def product_plus(has_fma: bool) -> _ProductPlus:
    """Return what appends a b + c, rounded once where the machine does so."""
    return _fused if has_fma else _separate


def _fused(lines: Lines, a: str, b: str, c: str) -> str:
    return lines.call("fma", a, b, c)


def _separate(lines: Lines, a: str, b: str, c: str) -> str:
    return lines.op("fadd", lines.op("fmul", a, b), c)


def _flip(lines: Lines, x: str, sign_bit: str) -> str:
    """Append x with its sign changed where `sign_bit` is set."""
    return lines.as_number(lines.bits("xor", lines.as_integer(x), sign_bit))
