"""Trigonometric polynomials in normal form, with exact rational coefficients.

    x = sum c * (products of symbols) * (products of cosines and sines of sums of angles)

Products of cosines and sines of angles about parallel axes, a group, are written as sums, those of
different groups stay products; then two polynomials that are equal have the same terms, and
cos^2 + sin^2 is 1 without being asked. Square roots are symbols whose squares are known.
Source: the product-to-sum identities.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import cos, prod, sin

Angle = tuple[int, str]  # group of parallel axes, coordinate
Wave = tuple[tuple[Angle, int], ...]  # a sum of angles of one group; the first has a positive sign
Factor = tuple[bool, Wave]  # whether a sine, of what
Powers = tuple[tuple[str, int], ...]
Term = tuple[tuple[Factor, ...], Powers]

ROOTS = {"sqrt2": 2, "sqrt3": 3, "sqrt5": 5}
HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Trig:
    """Hold a trigonometric polynomial: its coefficients by term; none is zero."""

    terms: Mapping[Term, Fraction] = field(default_factory=dict)

    def __add__(self, other: Trig) -> Trig:
        return gathered([*self.terms.items(), *other.terms.items()])

    def __sub__(self, other: Trig) -> Trig:
        return self + other * -1

    def __mul__(self, other: Trig | Fraction | int) -> Trig:
        if not isinstance(other, Trig):
            return Trig({key: c * other for key, c in self.terms.items()} if other else {})
        return gathered(
            (key, a * b * c)
            for one, a in self.terms.items()
            for two, b in other.terms.items()
            for key, c in term_product(one, two)
        )

    def __neg__(self) -> Trig:
        return self * -1

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def moves(self) -> bool:
        """Whether it depends on coordinates."""
        return bool(self.angles) or any(name.startswith("q:") for name in self.symbols)

    @property
    def angles(self) -> set[str]:
        """The coordinates whose sines or cosines it holds."""
        waves = (wave for factors, _ in self.terms for _, wave in factors)
        return {name for wave in waves for (_, name), _ in wave}

    @property
    def symbols(self) -> set[str]:
        """The symbols that it holds outside of sines and cosines."""
        return {name for _, powers in self.terms for name, _ in powers}

    @property
    def number(self) -> Fraction | None:
        """Its value where it is a rational number."""
        if not self.terms:
            return Fraction(0)
        return self.terms.get(((), ())) if len(self.terms) == 1 else None

    def value(self, symbols: Mapping[str, float], angles: Mapping[str, float]) -> float:
        """Return its value for those of its symbols, and of the angles by coordinate."""
        total = 0.0
        for (factors, powers), c in self.terms.items():
            x = float(c) * prod(symbols[name] ** power for name, power in powers)
            for odd, wave in factors:
                argument = sum(k * angles[name] for (_, name), k in wave)
                x *= sin(argument) if odd else cos(argument)
            total += x
        return total

    def by_symbol(self, name: str) -> Trig:
        """Return its derivative by a symbol outside of sines and cosines."""
        found = []
        for (factors, powers), c in self.terms.items():
            power = dict(powers).get(name, 0)
            if power:
                lower = {**dict(powers), name: power - 1}
                found.append(((factors, powers_of(lower)), c * power))
        return gathered(found)

    def by_angle(self, name: str) -> Trig:
        """Return its derivative by the angle of a coordinate."""
        found = []
        for (factors, powers), c in self.terms.items():
            for place, (sine, wave) in enumerate(factors):
                times = sum(k for (_, own), k in wave if own == name)
                if times:
                    turned = (*factors[:place], (not sine, wave), *factors[place + 1 :])
                    found.append(((turned, powers), c * times * (1 if sine else -1)))
        return gathered(found)


def gathered(terms: Iterable[tuple[Term, Fraction]]) -> Trig:
    """Return the sum of some terms."""
    found: dict[Term, Fraction] = {}
    for key, c in terms:
        found[key] = found.get(key, Fraction(0)) + c
    return Trig({key: c for key, c in found.items() if c})


def term_product(one: Term, two: Term) -> Iterator[tuple[Term, Fraction]]:
    """Yield the terms of the product of two."""
    powers, factor = dict(one[1]), Fraction(1)
    for name, power in two[1]:
        powers[name] = powers.get(name, 0) + power
    for name, square in ROOTS.items():
        if powers.get(name, 0) > 1:
            factor *= square ** (powers[name] // 2)
            powers[name] %= 2
    kept = powers_of(powers)
    mine, theirs = ({group_of(each): each for each in term[0]} for term in (one, two))
    apart = [
        each for group, each in {**mine, **theirs}.items() if not {group} <= {*mine} & {*theirs}
    ]
    choices: list[tuple[tuple[Factor, ...], Fraction]] = [(tuple(apart), factor)]
    for group in mine.keys() & theirs.keys():
        choices = [
            ((*own, *more), c * d)
            for own, c in choices
            for more, d in factor_product(mine[group], theirs[group])
        ]
    for factors, c in choices:
        yield (tuple(sorted(factors)), kept), c


def factor_product(one: Factor, two: Factor) -> Iterator[tuple[tuple[Factor, ...], Fraction]]:
    """Yield half the cosines or sines of difference and sum of two angles of a group."""
    (sine, a), (other, b) = one, two
    for sign in (-1, 1):
        if sine and other:
            c, odd = HALF * -sign, False
        elif sine or other:
            c, odd = HALF * (sign if other else 1), True
        else:
            c, odd = HALF, False
        yield from wave_of(odd, added(a, b, sign), c)


def added(a: Wave, b: Wave, sign: int) -> dict[Angle, int]:
    """Return a + b or a - b."""
    found = dict(a)
    for angle, k in b:
        found[angle] = found.get(angle, 0) + sign * k
    return found


def wave_of(
    sine: bool, multiples: Mapping[Angle, int], c: Fraction
) -> Iterator[tuple[tuple[Factor, ...], Fraction]]:
    """Yield a cosine or sine with its coefficient, its first angle positive; of zero: 1 or none."""
    wave = tuple(sorted((angle, k) for angle, k in multiples.items() if k))
    if not wave:
        if not sine:
            yield (), c
    elif wave[0][1] < 0:
        yield ((sine, tuple((angle, -k) for angle, k in wave)),), -c if sine else c
    else:
        yield ((sine, wave),), c


def group_of(factor: Factor) -> int:
    return factor[1][0][0][0]


def powers_of(powers: Mapping[str, int]) -> Powers:
    return tuple(sorted((name, power) for name, power in powers.items() if power))


# What polynomials are made of


def rational(value: Fraction | int) -> Trig:
    return Trig({((), ()): Fraction(value)} if value else {})


def symbol(name: str) -> Trig:
    return Trig({((), ((name, 1),)): Fraction(1)})


def cosine(angle: Angle) -> Trig:
    return Trig({(((False, ((angle, 1),)),), ()): Fraction(1)})


def sine(angle: Angle) -> Trig:
    return Trig({(((True, ((angle, 1),)),), ()): Fraction(1)})


ZERO, ONE = rational(0), rational(1)


# Vectors and matrices, as tuples


Vector = tuple[Trig, Trig, Trig]
Matrix = tuple[Vector, Vector, Vector]


def dot(a: Vector, b: Vector) -> Trig:
    return gathered(item for x, y in zip(a, b, strict=True) for item in (x * y).terms.items())


def cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def times(a: Vector, factor: Trig) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def transposed(A: Matrix) -> Matrix:
    return ((A[0][0], A[1][0], A[2][0]), (A[0][1], A[1][1], A[2][1]), (A[0][2], A[1][2], A[2][2]))


def applied(A: Matrix, b: Vector) -> Vector:
    return (dot(A[0], b), dot(A[1], b), dot(A[2], b))


def chained(A: Matrix, B: Matrix) -> Matrix:
    columns = transposed(B)
    return transposed((applied(A, columns[0]), applied(A, columns[1]), applied(A, columns[2])))
