"""A function of arrays with its derivatives, each a compiled kernel of flat vectors.

    y = f(x_1, x_2, ...)                  value
    J = dy/dx                             slope, x: some of the inputs, one after the other
    dJ/dx . d                             bend, along a direction d of some inputs

The inputs are what they are: of q all numbers of the tree, closed or not, for the expressions of
the equations are smooth functions of all of them. So chains of such functions have the derivatives
that the chain rule gives, with nothing to be known of loops or quaternions.

Where y solves R(x, y) = 0 with a symmetric M = dR/dy, as accelerations do, the first derivative is

    dy/dx = -M^-1 dR/dx.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.symmetric import solve_symmetric
from linkwork.kernels import Kernel, compile_function

Wrt = tuple[int, ...]  # inputs by number, in their order


@dataclass(frozen=True, eq=False)
class ArrayFunction:
    """Hold a function with outputs y (m) and, where rates may fail to determine the motion, pivot
    (1); its derivatives are made when they are first asked for.

    inputs: (name, size) of each input
    outputs: (name, (rows, columns)) of what y holds one after the other, each column by column
    residual: (inputs, y) -> R, M, where y solves R = 0
    """

    name: str
    f: ca.Function
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, tuple[int, int]], ...]
    residual: ca.Function | None = None

    @classmethod
    def of(cls, f: ca.Function, residual: ca.Function | None = None) -> ArrayFunction:
        """Return a function of SX with named inputs and outputs, of which "pivot" is the weakest
        relative one.

        f: that function; residual: as of the class.
        """
        symbols = f.sx_in()
        found = dict(zip(f.name_out(), f.call(symbols), strict=True))
        pivot = [found.pop("pivot")] if "pivot" in found else []
        y = ca.vertcat(*[ca.vec(ca.densify(value)) for value in found.values()])
        inputs = tuple((name, f.numel_in(i)) for i, name in enumerate(f.name_in()))
        outputs = tuple((name, value.shape) for name, value in found.items())
        flat = _function(f.name(), symbols, [y, *pivot])
        return cls(f.name(), flat, inputs, outputs, residual)

    @property
    def size(self) -> int:
        """Number of numbers of y."""
        return self.f.numel_out(0)

    @property
    def weighed(self) -> bool:
        """Whether the last output is a pivot."""
        return self.f.n_out() > 1

    def width(self, wrt: Wrt) -> int:
        """Return how many numbers some of the inputs have.

        wrt: their numbers.
        """
        return sum(self.inputs[i][1] for i in wrt)

    @cached_property
    def value(self) -> Kernel:
        """Compiled x -> y (m), pivot."""
        return compile_function(self.f)

    @cached_property
    def slope(self) -> Callable[[Wrt], Kernel]:
        """Return compiled x -> dy/dx (m x k), column by column, and pivot, for some inputs."""
        return lru_cache(maxsize=None)(lambda wrt: compile_function(self._slope(wrt)))

    @cached_property
    def bend(self) -> Callable[[Wrt, Wrt], Kernel]:
        """Return compiled (x, d) -> the derivative of dy/dx (m x k), for some inputs, along a
        direction d of some inputs, and pivot."""
        return lru_cache(maxsize=None)(lambda wrt, along: compile_function(self._bend(wrt, along)))

    def _slope(self, wrt: Wrt) -> ca.Function:
        symbols = self.f.sx_in()
        y, *pivot = self.f.call(symbols)
        J = ca.jacobian(y, _joined(symbols, wrt)) if self.residual is None else self._solved(y, wrt)
        return _function(f"{self.name}_slope", symbols, [ca.vec(ca.densify(J)), *pivot])

    def _solved(self, y: ca.SX, wrt: Wrt) -> ca.SX:
        """Return dy/dx = -M^-1 dR/dx at y(x)."""
        assert self.residual is not None
        given = self.residual.sx_in()
        R, M = self.residual.call(given)
        slope = ca.Function("slope", given, [ca.jacobian(R, _joined(given, wrt)), M])
        dR, M = slope.call([*self.f.sx_in(), y])
        return -solve_symmetric(ca.densify(M), ca.densify(dR))

    def _bend(self, wrt: Wrt, along: Wrt) -> ca.Function:
        first = self._slope(wrt)
        symbols, d = first.sx_in(), SX.sym("d", self.width(along))
        J, *pivot = first.call(symbols)
        dJ = ca.jtimes(J, _joined(symbols, along), d)
        return _function(f"{self.name}_bend", [*symbols, d], [ca.densify(dJ), *pivot])


def _joined(symbols: Sequence[ca.SX], wrt: Wrt) -> ca.SX:
    return ca.vertcat(*[symbols[i] for i in wrt])


def _function(name: str, symbols: Sequence[ca.SX], found: Sequence[ca.SX]) -> ca.Function:
    return ca.Function(name, list(symbols), list(found), {"cse": True})
