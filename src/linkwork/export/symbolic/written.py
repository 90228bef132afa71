"""Trigonometric polynomials as SymPy expressions, in the symbols of the notation.

A cosine and a sine of one angle whose coefficients are those of a known phase become one cosine or
sine:  A cos x + B sin x = R cos(x - d)  for d of sixths and quarters of pi.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from linkwork.export.symbolic.exact import LARGEST
from linkwork.export.symbolic.trig import (
    ROOTS,
    Angle,
    Factor,
    Trig,
    Wave,
    gathered,
    rational,
    symbol,
)

HALF = rational(Fraction(1, 2))
SIXTH = symbol("sqrt3") * Fraction(1, 2)
EIGHTH = symbol("sqrt2") * Fraction(1, 2)
PHASES = (
    (sympy.pi / 6, SIXTH, HALF),
    (sympy.pi / 4, EIGHTH, EIGHTH),
    (sympy.pi / 3, HALF, SIXTH),
    (-sympy.pi / 6, SIXTH, -HALF),
    (-sympy.pi / 4, EIGHTH, -EIGHTH),
    (-sympy.pi / 3, HALF, -SIXTH),
)
"""Phases d with their cosines and sines."""
CONSTANTS = {name: sympy.sqrt(square) for name, square in ROOTS.items()} | {"pi": sympy.pi}


@dataclass(frozen=True)
class Writer:
    """Write polynomials; symbols: by their keys; angles: what is added to coordinates.

    fractions: whether numbers that end as decimals are fractions all the same
    """

    symbols: Mapping[str, sympy.Symbol]
    angles: Mapping[str, tuple[Angle, Trig]]
    fractions: bool

    def expression(self, polynomial: Trig) -> sympy.Expr:
        """Return a polynomial as an expression, what belongs to one cosine or sine together."""
        return self.decimals(tidied(self.plain(polynomial)))

    def plain(self, polynomial: Trig) -> sympy.Expr:
        """Return a polynomial term by term."""
        parts: dict[tuple[tuple[Factor, ...], tuple], dict] = {}
        for (factors, powers), c in polynomial.terms.items():
            roots = tuple(each for each in powers if each[0] in ROOTS)
            kept = tuple(each for each in powers if each[0] not in ROOTS)
            waves = tuple((False, wave) for _, wave in factors) if len(factors) == 1 else factors
            odd = len(factors) == 1 and factors[0][0]
            parts.setdefault((waves, kept), {False: [], True: []})[odd].append((((), roots), c))
        found = []
        for (factors, powers), both in parts.items():
            A, B = gathered(both[False]), gathered(both[True])
            power = sympy.Mul(*[self.symbol(name) ** k for name, k in powers])
            if len(factors) == 1:
                found.append(power * self.shifted(A, B, factors[0][1]))
            else:
                found.append(power * self.number(A) * sympy.Mul(*map(self.factor, factors)))
        return sympy.Add(*found)

    def shifted(self, A: Trig, B: Trig, wave: Wave) -> sympy.Expr:
        """Return A cos x + B sin x, as one of them where a phase is known."""
        for phase, c, s in PHASES if A and B else ():
            if not A * s - B * c:
                R = self.number(A * c + B * s)
                constant = sum((k * self.phase(name) for (_, name), k in wave), -phase)
                if not (2 * constant / sympy.pi).is_integer:
                    return R * sympy.cos(self.argument(wave) - phase)
                plain = [k * self.symbols[f"q:{name}"] for (_, name), k in wave]
                return R * sympy.cos(sympy.Add(*plain) + constant)
        x = self.argument(wave)
        return self.number(A) * sympy.cos(x) + self.number(B) * sympy.sin(x)

    def phase(self, name: str) -> sympy.Expr:
        """Return what is added to the angle of a coordinate."""
        return self.plain(self.angles[name][1])

    def factor(self, factor: Factor) -> sympy.Expr:
        odd, wave = factor
        return (sympy.sin if odd else sympy.cos)(self.argument(wave))

    def argument(self, wave: Wave) -> sympy.Expr:
        """Return a sum of angles."""
        return sympy.Add(*[k * self.angle(name) for (_, name), k in wave])

    def angle(self, name: str) -> sympy.Expr:
        return self.symbols[f"theta:{name}" if self.angles[name][1] else f"q:{name}"]

    def number(self, constant: Trig) -> sympy.Expr:
        """Return a constant of rationals and roots."""
        return sympy.Add(
            *[
                sympy.Rational(c.numerator, c.denominator)
                * sympy.Mul(*[self.symbol(name) ** k for name, k in powers])
                for (_, powers), c in constant.terms.items()
            ]
        )

    def decimals(self, expression: sympy.Expr) -> Any:
        """Return an expression with decimals for rationals that are no short fractions."""
        rationals = expression.atoms(sympy.Rational)
        long = [each for each in rationals if not short(each) or self.ends(each)]
        return expression.xreplace({each: sympy.Float(repr(float(each))) for each in long})

    def ends(self, value: sympy.Rational) -> bool:
        """Tell whether a rational is written as the decimal that it is."""
        rest = value.q
        for prime in (2, 5):
            while rest % prime == 0:
                rest //= prime
        return not self.fractions and rest == 1 and value.q > 1

    def symbol(self, name: str) -> sympy.Expr:
        return CONSTANTS[name] if name in CONSTANTS else self.symbols[name]


def short(value: sympy.Rational) -> bool:
    """Tell whether a rational has few digits."""
    return bool(value.q <= LARGEST and abs(value.p) < 1000)


def tidied(expression: sympy.Expr) -> sympy.Expr:
    """Return a sum with the factors of each cosine and sine taken together."""
    waves = sorted(expression.atoms(sympy.sin, sympy.cos), key=sympy.default_sort_key)
    parts = sympy.collect(sympy.expand(expression), waves, evaluate=False)
    if not all(wave == 1 or wave in waves for wave in parts):
        return expression
    return sympy.Add(*[c if wave == 1 else wave * factored(c) for wave, c in parts.items()])


def factored(c: sympy.Expr) -> sympy.Expr:
    """Return a coefficient as a product where its numbers, over the first, are short fractions."""
    if not isinstance(c, sympy.Add):
        return c
    lead = c.args[0].as_coeff_Mul()[0]
    over = sympy.expand(c / lead)
    numbers = [each.as_coeff_Mul()[0] for each in over.args]
    return lead * sympy.factor(over) if all(map(short, numbers)) else c
