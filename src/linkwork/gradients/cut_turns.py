"""Expressions in the elements of rotation matrices instead of in the quaternions of free turns, and
how these elements turn.

    dR = [dtheta x] R = R [R' dtheta x]

dtheta is a small turn in the first frame's axes, R' dtheta the same in the second one's. What R
turns changes by one cross product, and what R' turns, along the latter, by numbers that are known
already; derivatives by the four numbers of a quaternion take a dozen operations each.
Source: Murray, Li & Sastry 1994, sec. 2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from linkwork.equations.algebra import SX, quaternion_matrix
from linkwork.equations.tree import Tree


@dataclass(frozen=True)
class CutTurns:
    """Hold symbols for the rotation matrices R_12 of a tree's free turns, column by column."""

    tree: Tree

    @cached_property
    def symbols(self) -> ca.SX:
        """The elements (9 for each free turn)."""
        return SX.sym("R", 9 * len(self.tree.quaternions))

    @cached_property
    def matrices(self) -> list[ca.SX]:
        """The symbols as matrices (3 x 3)."""
        return [ca.reshape(part, 3, 3) for part in ca.vertsplit(self.symbols, 9)]

    @cached_property
    def values(self) -> ca.SX:
        """The elements as functions of the quaternions."""
        own = [quaternion_matrix(self.tree.q[list(p)]) for p, _ in self.tree.quaternions]
        return ca.vertcat(SX(0, 1), *map(ca.vec, own))

    @cached_property
    def turning(self) -> ca.SX:
        """The derivative of the elements (9 for each turn x nv, sparse) along the tree's rates."""
        return self._along_rates([ca.vertcat(*map(ca.skew, columns(-R))) for R in self.matrices])

    @cached_property
    def turning_near(self) -> ca.SX:
        """The same along rates of which the turns are in their second frames' axes:
        dR = R [R' dtheta x]."""
        return self._along_rates(
            [
                ca.horzcat(*[ca.vec(ca.mtimes(R, ca.skew(e))) for e in columns(SX.eye(3))])
                for R in self.matrices
            ]
        )

    @cached_property
    def near(self) -> ca.SX:
        """The map (nv x nv, sparse) from the tree's rates to those."""
        found = SX.eye(len(self.tree.rates))
        for R, (_, rates) in zip(self.matrices, self.tree.quaternions, strict=True):
            found[list(rates), list(rates)] = R.T
        return found

    def _along_rates(self, parts: list[ca.SX]) -> ca.SX:
        found = SX(self.symbols.numel(), len(self.tree.rates))
        for k, (part, (_, rates)) in enumerate(zip(parts, self.tree.quaternions, strict=True)):
            found[9 * k : 9 * k + 9, list(rates)] = ca.sparsify(part)
        return found

    def written(self, expression: ca.SX) -> ca.SX:
        """Return an expression in the symbols, as far as it depends on quaternions by R alone."""
        if not self.tree.quaternions:
            return expression
        given = ca.symvar(ca.veccat(self.values, expression))
        f = ca.Function("turned", given, [self.values, expression], {"cse": True})
        return replayed(f, ca.vertsplit(self.symbols))

    def back(self, expressions: list[ca.SX]) -> list[ca.SX]:
        """Return expressions with the symbols replaced by what they stand for."""
        if not self.tree.quaternions:
            return expressions
        return ca.substitute(expressions, [self.symbols], [self.values])


def columns(matrix: ca.SX) -> list[ca.SX]:
    return ca.horzsplit(matrix)


def replayed(f: ca.Function, instead: list[ca.SX]) -> ca.SX:
    """Return the second result of a function of single symbols, where the numbers of the first one
    are replaced by others as soon as they are known."""
    given, work = f.sx_in(), [SX(0)] * f.sz_w()
    found = SX(f.sparsity_out(1))
    values: list[ca.SX] = [SX(0)] * found.nnz()
    for k in range(f.n_instructions()):
        op, to, of = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if op == ca.OP_INPUT:
            work[to[0]] = given[of[0]]
        elif op == ca.OP_CONST:
            work[to[0]] = SX(f.instruction_constant(k))
        elif op != ca.OP_OUTPUT:
            args = [work[i] for i in of]
            work[to[0]] = SX.unary(op, *args) if len(args) == 1 else SX.binary(op, *args)
        elif to[0] == 0:
            work[of[0]] = instead[to[1]]
        else:
            values[to[1]] = work[of[0]]
    return SX(found.sparsity(), ca.vertcat(*values)) if values else found
