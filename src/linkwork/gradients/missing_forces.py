"""Derivatives of the equations of motion, by the forces that are missing at a motion.

    F(q, v, v', u, p) = M v' + C v + G - f - S' u        (n)

At the accelerations a = L v' + b of the tree and the multipliers l of the kept rows, F = L' R with

    R = H a + h - f - J' u - Phi' l,      Phi_u' l = (H a + h - f - J' u)_u

so that R vanishes at the dependent rates, and L need not be differentiated:

    dF = L' (dR + H da),      Phi_u da_u = -d(Phi a + gamma)        at fixed a, l, v', u
    dF/dv' = M,     dF/du = -S',     dv' = -M^-1 dF        where F = 0.

The derivatives of R are those of the tree: sparse, and cheap. Where bearings rub by what they
carry, nothing of this is used (`compilation`).
Source: Carpentier & Mansard 2018 (forward dynamics by the derivatives of the inverse ones); Haug
1989, ch. 7 (multipliers).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.functions import forces_needed
from linkwork.equations.symmetric import solve_symmetric
from linkwork.gradients.differentiable import Slopes
from linkwork.gradients.tangent import Shift, Tangent


@dataclass(frozen=True)
class MissingForces:
    """Hold the forces F (n) that are missing at a motion; u are the symbols of the actuators'
    forces, or zeros."""

    tangent: Tangent
    u: ca.SX

    @property
    def equations(self) -> Equations:
        return self.tangent.equations

    @cached_property
    def a(self) -> ca.SX:
        """Symbols of the tree's accelerations (nv)."""
        return SX.sym("a", self.equations.nv)

    @cached_property
    def multipliers(self) -> ca.SX:
        """Symbols l of the rows."""
        return SX.sym("l", len(self.equations.rows.names))

    @cached_property
    def unheld(self) -> ca.SX:
        """H a + h - f - J' u (nv): what the rows have to hold."""
        free = self.tangent.free
        J = free.joints.rate_rows(free.mechanism.actuators)
        return free.tree_forces(self.a, free.gravity) - ca.mtimes(J.T, self.u)

    @cached_property
    def parts(self) -> ca.SX:
        """R (nv), then Phi a + gamma (rows)."""
        rows, w = self.equations.rows, self.tangent.w
        R = self.unheld - ca.mtimes(rows.Phi.T, self.multipliers)
        gamma = ca.substitute(rows.gamma, rows.rates, w)
        return ca.vertcat(R, ca.mtimes(rows.Phi, self.a) + gamma)

    def forward(self, step: Shift) -> ca.SX:
        """Return the derivatives (n x k) of F along steps, at fixed v' and u."""
        equations, found = self.equations, self.tangent.forward(self.parts, step)
        nv, dependent = equations.nv, list(equations.chart.dependent)
        forces = ca.mtimes(equations.elimination.L.T, found[:nv, :])
        if not dependent:
            return forces
        shifted = self.tangent.solved(found[nv:, :])[dependent, :]
        return forces - ca.mtimes(equations.inertia[1].T, shifted)

    def backward(self, weights: ca.SX) -> Shift:
        """Return the gradients (each x k) of weights (n x k) times F, at fixed v' and u."""
        equations = self.equations
        carried = SX(equations.nv, weights.shape[1])
        if dependent := list(equations.chart.dependent):
            carried[dependent, :] = ca.mtimes(equations.inertia[1], weights)
        along = ca.mtimes(equations.elimination.L, weights)
        given = ca.vertcat(along, -self.tangent.transposed(carried))
        return self.tangent.backward(self.parts, given)

    def at(self, accelerations: ca.SX, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Return expressions at the accelerations v' (n) and rates v."""
        held = self.tangent.transposed(self.unheld)
        L, b, _ = self.equations.elimination
        found = ca.substitute([*map(ca.densify, expressions)], [self.multipliers], [held])
        found = ca.substitute(found, [self.a], [ca.mtimes(L, accelerations) + b])
        return self.tangent.at_rates(found)


class ForwardDynamics:
    """Direct dynamics v'(q, v, u, p) and its derivatives, as expressions."""

    def __init__(self, equations: Equations):
        self.equations = equations
        self.given = SX.sym("u", len(equations.mechanism.actuators))
        self.tangent = Tangent(equations)
        self.missing = MissingForces(self.tangent, self.given)
        self.rows = equations.mobility
        self.value = equations.accelerations(ca.mtimes(equations.actuation.T, self.given))

    def answer(self, forces: ca.SX) -> ca.SX:
        """Return M^-1 forces (n x k)."""
        return solve_symmetric(self.equations.inertia[0], ca.densify(forces))

    def forward(self, step: Slopes) -> ca.SX:
        applied = ca.mtimes(self.equations.actuation.T, step.given)
        [found] = self.missing.at(
            self.value, [self.answer(applied - self.missing.forward(step.by))]
        )
        return found

    def backward(self, weights: ca.SX) -> Slopes:
        y = self.answer(weights)
        if weights.shape[1] < self.rows:
            found = self.missing.backward(-y)
        else:  # those of each force, which no weights make dense
            own = self.missing.backward(SX.eye(self.rows))
            found = [ca.mtimes(part, -y) for part in own]
        found = self.missing.at(self.value, found)
        return Slopes(Shift(*found), ca.mtimes(self.equations.actuation, y))


class NeededForces:
    """Inverse dynamics: the forces M v' + C v + G - f (n) on the independent rates, and their
    derivatives, as expressions."""

    def __init__(self, equations: Equations):
        self.equations = equations
        self.given = SX.sym("dv", equations.mobility)
        self.tangent = Tangent(equations)
        self.missing = MissingForces(self.tangent, SX.zeros(len(equations.mechanism.actuators)))
        self.rows = equations.mobility
        self.value = forces_needed(equations, self.given, self.missing.u)

    def forward(self, step: Slopes) -> ca.SX:
        [found] = self.missing.at(self.given, [self.missing.forward(step.by)])
        return found + ca.mtimes(self.equations.inertia[0], step.given)

    def backward(self, weights: ca.SX) -> Slopes:
        found = self.missing.at(self.given, self.missing.backward(weights))
        return Slopes(Shift(*found), ca.mtimes(self.equations.inertia[0], weights))
