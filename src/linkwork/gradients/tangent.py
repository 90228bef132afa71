"""The tangent of all closed configurations, with the free parameters: how what is written in the
tree's coordinates q, its rates w and the parameters p changes with what may be chosen.

A step (dq, dv, dp) of the independent rates' coordinates, the independent rates and the parameters
moves

    phi(q, p) = 0:    dq_tree = N L dq + q_p dp,      q_p = -N Phi_u^-1 dphi/dp
    Phi w = 0:        dw = L dv + W (dq, dp),         W   = -Phi_u^-1 d(Phi w)

with zeros at the independent places of Phi_u^-1: they are held. dq are small shifts along the
independent rates, in the order of v: of a coordinate with a rate of its own its change, of a free
turn the rotation vector in its first frame's axes.

Derivatives of Phi, which is written for closed loops, are right along the tangent, which keeps them
closed. Solutions with Phi_u' are derivatives backwards of those with Phi_u.
Source: Negrut & Ortiz 2006 (tangent of the constraints); Griewank & Walther 2008, ch. 3 (forward
and reverse).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.elimination import solve
from linkwork.equations.uncharted import uncharted
from linkwork.gradients.cut_turns import CutTurns


class Shift(NamedTuple):
    """Hold what belongs to the independent coordinates, the independent rates and the parameters:
    steps, columns of derivatives, or gradients."""

    q: ca.SX
    v: ca.SX
    p: ca.SX


@dataclass(frozen=True)
class Tangent:
    """Hold the tangent of equations in a chart; expressions to be differentiated are written in the
    tree's q, `w` and p, or in v besides."""

    equations: Equations

    @cached_property
    def free(self) -> Equations:
        """The equations in which every rate of the tree counts as independent."""
        return uncharted(self.equations)

    @property
    def w(self) -> ca.SX:
        """Symbols of the tree's rates (nv)."""
        return self.free.v

    @cached_property
    def turns(self) -> CutTurns:
        """The free turns' rotation matrices, in which expressions are differentiated."""
        return CutTurns(self.equations.tree)

    @cached_property
    def places(self) -> ca.SX:
        """Symbols of the tree's coordinates, of the elements of rotation matrices, and of the
        parameters."""
        return ca.vertcat(self.equations.tree.q, self.turns.symbols, self.equations.p)

    @cached_property
    def placing(self) -> ca.SX:
        """The derivative of the `places` (sparse) along the tree's rates and the parameters."""
        moved = ca.vertcat(self.equations.tree.derivative_map, self.turns.turning)
        return ca.diagcat(moved, SX.eye(self.equations.p.numel()))

    @cached_property
    def near(self) -> ca.SX:
        """The map of steps of the tree's rates and the parameters to those of which turns are in
        their second frames' axes."""
        return ca.diagcat(self.turns.near, SX.eye(self.equations.p.numel()))

    @cached_property
    def moving(self) -> ca.SX:
        """Phi w (rows)."""
        return self.turns.written(ca.mtimes(self.equations.rows.Phi, self.w))

    @property
    def units(self) -> Shift:
        """Return the steps (each n, n or np x 2 n + np) of what may be chosen, one by one."""
        n, count = self.equations.mobility, self.equations.p.numel()
        parts = ca.vertsplit(SX.eye(2 * n + count), [0, n, 2 * n, 2 * n + count])
        return Shift(*parts)

    def solved(self, right: ca.SX) -> ca.SX:
        """Return X (nv x k) with Phi_u X = right (rows x k), zero at the independent rates."""
        equations = self.equations
        X, _ = solve(equations.chart, equations.rows.Phi, ca.densify(right))
        return equations.scatter(X, SX.zeros(equations.mobility, right.shape[1]))

    def transposed(self, right: ca.SX) -> ca.SX:
        """Return X (rows x k) with Phi_u' X = right (nv x k) at the dependent rates, zero at rows
        that the chart leaves out."""
        r = SX.sym("r", len(self.equations.rows.names))
        return ca.jtimes(self.solved(r), r, ca.densify(right), True)

    def steps(self, step: Shift) -> tuple[ca.SX, ca.SX]:
        """Return the steps along the tree's rates and the parameters (nv + np x k), and those of
        w, for those of what may be chosen."""
        equations = self.equations
        L = equations.elimination.L
        closing = self.solved(-forward(equations.rows.phi, equations.p, step.p))
        shift = ca.mtimes(L, step.q) + closing
        places = ca.vertcat(shift, step.p)
        turned = self.solved(-self.along(self.moving, places))
        return places, ca.mtimes(L, step.v) + turned

    def forward(self, expression: ca.SX, step: Shift) -> ca.SX:
        """Return the derivatives (rows x k) of an expression along steps (each x k)."""
        expression = self.turns.written(ca.densify(expression))
        places, w = self.steps(step)
        found = self.along(expression, places) + forward(expression, self.w, w)
        return found + forward(expression, self.equations.v, step.v)

    def backward(self, expression: ca.SX, weights: ca.SX) -> Shift:
        """Return the gradients (each x k) of weights (rows x k) times an expression."""
        equations, L = self.equations, self.equations.elimination.L
        expression = self.turns.written(ca.densify(expression))
        w = backward(expression, self.w, weights)
        # Through the dependent rates, then the dependent coordinates.
        turned = self.against(self.moving, self.transposed(w))
        places = self.against(expression, weights) - turned
        shift, p = ca.vertsplit(places, [0, equations.nv, places.shape[0]])
        closing = backward(equations.rows.phi, equations.p, self.transposed(shift))
        v = ca.mtimes(L.T, w) + backward(expression, equations.v, weights)
        return Shift(ca.mtimes(L.T, shift), v, p - closing)

    def slope(self, expression: ca.SX) -> ca.SX:
        """Return the Jacobian of an expression (rows x nv + np, sparse) along rates of which turns
        are in their second frames' axes, and the parameters."""
        tree = self.equations.tree
        found = ca.horzcat(
            ca.mtimes([ca.jacobian(expression, tree.q), tree.derivative_map, self.turns.near.T]),
            ca.jacobian(expression, self.equations.p),
        )
        if not tree.quaternions:
            return found
        turned = ca.jtimes(expression, self.turns.symbols, ca.densify(self.turns.turning_near))
        found[:, : len(tree.rates)] += ca.sparsify(turned)
        return found

    def along(self, expression: ca.SX, places: ca.SX) -> ca.SX:
        """Return the derivatives (rows x k) of an expression along steps of the tree's rates and
        the parameters (nv + np x k), at fixed w and v."""
        if places.shape[1] == 1:
            return forward(expression, self.places, ca.mtimes(self.placing, places))
        return ca.mtimes(self.slope(expression), ca.mtimes(self.near, places))

    def against(self, expression: ca.SX, weights: ca.SX) -> ca.SX:
        """Return the gradients (nv + np x k) of weights (rows x k) times an expression."""
        if weights.shape[1] == 1:
            return ca.mtimes(self.placing.T, backward(expression, self.places, weights))
        return ca.mtimes(self.near.T, ca.mtimes(self.slope(expression).T, weights))

    def at_rates(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Return expressions at the rates w = L v of the tree."""
        dense = [ca.densify(each) for each in expressions]
        return self.turns.back(ca.substitute(dense, [self.w], [self.equations.rates]))


def forward(expression: ca.SX, symbols: ca.SX, steps: ca.SX) -> ca.SX:
    """Return the derivatives (rows x k) of an expression along steps of symbols (each x k)."""
    if steps.shape[1] == 1:
        return ca.jtimes(expression, symbols, ca.densify(steps))
    return ca.mtimes(ca.jacobian(expression, symbols), steps)


def backward(expression: ca.SX, symbols: ca.SX, weights: ca.SX) -> ca.SX:
    """Return the gradients (symbols x k) of weights (rows x k) times an expression."""
    if weights.shape[1] == 1:
        return ca.jtimes(expression, symbols, ca.densify(weights), True)
    return ca.mtimes(ca.jacobian(expression, symbols).T, weights)
