"""The natural orthogonal complement L, and the bias b, in named closed forms, step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy

from linkwork.export.symbolic.elimination import Key, SolvedTogether, determinant, minor
from linkwork.export.symbolic.lettering import Letters
from linkwork.export.symbolic.trig import ZERO, Trig
from linkwork.export.symbolic.written import Writer

SHORT = 4  # terms of a polynomial that is written out, and not by its parts
Named = dict[sympy.Symbol, sympy.Expr]


@dataclass
class Complement:
    """Collect L by dependent rate and independent one, and b, and what they are made of.

    free: names of the independent rates; numbers: of all coordinates, by name; gammas: symbols of
        the rows' bias, by row
    shared, own_L, own_b: expressions by the symbols that name them
    """

    letters: Letters
    writer: Writer
    free: Sequence[str]
    numbers: Mapping[str, int]
    gammas: Mapping[int, sympy.Symbol]
    L: dict[tuple[str, str], sympy.Expr] = field(default_factory=dict)
    b: dict[str, sympy.Expr] = field(default_factory=dict)
    shared: Named = field(default_factory=dict)
    own_L: Named = field(default_factory=dict)
    own_b: Named = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.L.update({(label, label): sympy.Integer(1) for label in self.free})

    def add(self, step: SolvedTogether, count: int) -> None:
        """Solve a step's rates, by Cramer's rule: columns of independent rates, then the bias."""
        # The determinant, and what stands on the right, for all columns.
        det, size = determinant(step.A), len(step.unknowns)
        short = len(det.terms) <= SHORT or size == 1
        A = self.matrix(step, count, short)
        whole: Any = self.writer.expression(det) if short else A.det(method="berkowitz")
        if det.moves:
            whole = self.name("Delta", (count,), whole, self.shared)
        cofactors = [
            [minor(step.A, i, j) * (-1) ** (i + j) for j in range(size)] for i in range(size)
        ]
        right = [self.coefficients(row, count, i) for i, row in enumerate(step.right, start=1)]
        # Column by column: its numerators written out where they are short, else by parts.
        for k, column in enumerate((*self.free, None)):
            sides = [self.side(row, column) for row in right]
            if not any(sides):
                continue
            direct = self.numerators(step, column, cofactors) if short else None
            if direct is None and size > 1:
                into, place = (self.own_b, 0) if column is None else (self.own_L, k + 1)
                sides = [
                    self.name("r", (count, i, place), side, into)
                    for i, side in enumerate(sides, start=1)
                ]
            for j, unknown in enumerate(step.unknowns):
                if direct is not None:
                    above = self.writer.expression(direct[j])
                else:
                    above = sympy.Add(
                        *[
                            (self.writer.expression(cofactors[i][j]) if short else A.cofactor(i, j))
                            * side
                            for i, side in enumerate(sides)
                        ]
                    )
                self.keep(unknown, column, above / whole)

    def matrix(self, step: SolvedTogether, count: int, short: bool) -> sympy.Matrix:
        """Return A; its elements by names where the determinant is not written out."""
        rows = [[self.writer.expression(x) for x in row] for row in step.A]
        if short:
            return sympy.Matrix(rows)
        return sympy.Matrix(
            [
                [self.name("A", (count, i, j), x, self.shared) for j, x in enumerate(row, start=1)]
                for i, row in enumerate(rows, start=1)
            ]
        )

    def coefficients(
        self, row: Mapping[Key, Trig], count: int, place: int
    ) -> dict[Key, sympy.Expr]:
        """Return a right side; longer coefficients of rates that are known by names."""
        found = {}
        for key, c in row.items():
            value = self.writer.expression(c)
            if key[0] == "solved" and len(c.terms) > 1:
                indices = (count, place, self.numbers[key[1]])
                value = self.name("B", indices, value, self.shared)
            found[key] = value
        return found

    def side(self, right: Mapping[Key, sympy.Expr], column: str | None) -> sympy.Expr:
        """Return a right side for one independent rate; for the bias where there is none."""
        values = (c * self.known(key, column) for key, c in right.items())
        return sympy.Add(*values)

    def known(self, key: Key, column: str | None) -> sympy.Expr:
        """Return what a right side's coefficient stands before."""
        kind, name = key
        if kind == "solved":
            found = self.b.get(name) if column is None else self.L.get((name, column))
        elif kind == "gamma":
            found = self.gammas.get(int(name)) if column is None else None
        else:
            found = sympy.Integer(1) if name == column else None
        return sympy.Integer(0) if found is None else found

    def numerators(
        self, step: SolvedTogether, column: str | None, cofactors: Sequence[Sequence[Trig]]
    ) -> list[Trig] | None:
        """Return the numerators of Cramer's rule where they are short and hold no rates that were
        solved before."""
        solved = any(
            key[0] == "solved" and self.known(key, column) != 0 for row in step.right for key in row
        )
        if column is None or solved:
            return None
        own = [row.get(("rate", column), ZERO) for row in step.right]
        found = [
            sum((cofactors[i][j] * x for i, x in enumerate(own)), ZERO) for j in range(len(own))
        ]
        return found if all(len(each.terms) <= SHORT for each in found) else None

    def keep(self, unknown: str, column: str | None, value: sympy.Expr) -> None:
        """Keep an element of L, or of b, by its name."""
        if value == 0:
            return
        row = self.numbers[unknown]
        if column is None:
            self.b[unknown] = self.name("b", (row,), value, self.own_b)
        else:
            k = list(self.free).index(column) + 1
            self.L[unknown, column] = self.name("L", (row, k), value, self.own_L)

    def name(
        self, letter: str, places: tuple[int, ...], value: sympy.Expr, into: Named
    ) -> sympy.Expr:
        """Return a name for an expression, or the expression where it is a number or a name."""
        if value.is_number or value.is_Symbol or (-value).is_Symbol:
            return value
        latex = "\\Delta" if letter == "Delta" else None
        symbol = self.letters.numbered(letter, *places, latex=latex)
        into[symbol] = value
        return symbol
