"""A robot's equations in closed form: what is printed, as SymPy expressions.

phi(q) = 0,   Phi q' = 0,   q' = L v,   q'' = L v' + b
M = L' H L,   C v = L' (h + H b),   G = L' w                 (paper, Eqs. (1), (2), (7)-(12))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError

QUANTITIES = ("phi", "Phi", "L", "M", "Cv", "G")


@dataclass(frozen=True)
class FormulaSection:
    """Hold equations that belong together, by the symbols that they define."""

    title: str
    equations: Mapping[sympy.Symbol, sympy.Expr]


@dataclass(frozen=True, eq=False)
class FormulaSheet:
    """Hold the equations of motion in closed form.

    name: the robot's
    coordinates, rates: symbols of q and q' by the names of their joints; independent: names of v,
        which are rates among them
    parameters: values of the symbols of dimensions, masses and gravity; meanings: what each is
    sections: sub-expressions by the symbols that name them, in the order in which they are to be
        evaluated
    phi, Phi, L, M, Cv, G: in these symbols, rows and columns in the order of `coordinates` and of
        `independent`
    rows: names of phi's rows; letters: LaTeX of the symbols; operations: how many there are in all
    """

    name: str
    coordinates: Mapping[str, sympy.Symbol]
    rates: Mapping[str, sympy.Symbol]
    independent: tuple[str, ...]
    parameters: Mapping[sympy.Symbol, float]
    meanings: Mapping[sympy.Symbol, str]
    sections: tuple[FormulaSection, ...]
    phi: sympy.Matrix
    Phi: sympy.Matrix
    L: sympy.Matrix
    M: sympy.Matrix
    Cv: sympy.Matrix
    G: sympy.Matrix
    rows: tuple[str, ...]
    letters: Mapping[sympy.Symbol, str]
    operations: int

    @property
    def definitions(self) -> dict[sympy.Symbol, sympy.Expr]:
        """All named sub-expressions, in the order in which they are to be evaluated."""
        return {name: value for part in self.sections for name, value in part.equations.items()}

    def written_out(self, expression: sympy.Expr | sympy.Matrix) -> Any:
        """Return an expression with all named sub-expressions put into it: in coordinates, rates v
        and parameters alone."""
        for name, value in reversed(self.definitions.items()):
            expression = expression.subs(name, value)
        return expression

    @cached_property
    def function(self) -> Callable[..., list[np.ndarray]]:
        """(q, v, parameters) -> phi, Phi, L, M, Cv, G, as NumPy evaluates them."""
        names = [
            *self.coordinates.values(),
            *(self.rates[name] for name in self.independent),
            *self.parameters,
        ]
        outputs = [getattr(self, name) for name in QUANTITIES]
        return sympy.lambdify(names, outputs, "numpy", cse=self.with_names)  # pyright: ignore

    def with_names(self, expressions: object) -> tuple[list[tuple[Any, Any]], object]:
        """Return the named sub-expressions beside expressions, as `sympy.cse` does."""
        return list(self.definitions.items()), expressions

    def evaluate(
        self,
        positions: ArrayLike,
        rates: ArrayLike,
        parameters: Mapping[str, float] | None = None,
    ) -> dict[str, np.ndarray]:
        """Return phi, Phi, L, M, Cv and G as numbers.

        Args:
            positions: q in the order of `coordinates` [m, rad].
            rates: v in the order of `independent` [m/s, rad/s].
            parameters: other values of symbols, by name.

        Raises:
            LinkworkError: wrong numbers of coordinates or rates; a symbol that there is not.
        """
        q = sized(positions, len(self.coordinates), "positions", [*self.coordinates])
        v = sized(rates, len(self.independent), "rates", self.independent)
        values = {symbol.name: value for symbol, value in self.parameters.items()}
        for name, value in (parameters or {}).items():
            if name not in values:
                raise LinkworkError(
                    f"there is no parameter {name!r}; the symbols are "
                    f"{', '.join(values) or 'none: all numbers are written out'}"
                )
            values[name] = checks.number(value, f"parameter {name!r}")
        found = self.function(*q, *v, *values.values())
        shaped = {
            name: np.array(value, float) for name, value in zip(QUANTITIES, found, strict=True)
        }
        return shaped | {name: shaped[name].ravel() for name in ("phi", "Cv", "G")}

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({self.name!r}: {len(self.definitions)} named sub-expressions, "
            f"{self.operations} operations)"
        )


def sized(values: ArrayLike, count: int, what: str, names: Sequence[str]) -> np.ndarray:
    """Return some finite numbers; refuse another number of them."""
    found = checks.finite(values, what)
    if found.shape != (count,):
        raise LinkworkError(
            f"{what} have the shape {found.shape}; give {count} numbers: {', '.join(names)}"
        )
    return found
