"""The equations of motion of a mechanism, as expressions.

    M v' + C v + G = u,    M = L' H L,    C v + G = L' (h(q, q') + H b),    q' = L v,    q'' = L v' + b

in the rates v of the actuated joints; H and h are the tree's (`dynamics`), L and b the chart's (`chart`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations import dynamics
from linkwork.equations.algebra import SX
from linkwork.equations.chart import COFACTOR_SIZE, Chart, solve
from linkwork.equations.closure import Cut
from linkwork.equations.topology import Topology
from linkwork.equations.tree import Tree
from linkwork.mechanism import Mechanism


@dataclass(frozen=True)
class Rows:
    """Hold the closure rows that do not vanish symbolically.

    names: joint and what the row holds; phi: residuals (1); Phi: their Jacobian (2), rows x nq; gamma: bias for the rates q'
    alignment: positive where the frames of every cut joint agree, negative where a direction is flipped
    """

    names: tuple[str, ...]
    phi: ca.SX
    Phi: ca.SX
    rates: ca.SX
    gamma: ca.SX
    alignment: ca.SX


@dataclass(frozen=True)
class Equations:
    """Hold the derivation of a mechanism: its tree, closure rows and chart, and the expressions that follow from them.

    reference: closed reference configuration of the tree's coordinates (nq)
    redundant: names of the rows that depend on the others; they are left out of the elimination and watched
    """

    mechanism: Mechanism
    topology: Topology
    tree: Tree
    cuts: tuple[Cut, ...]
    rows: Rows
    reference: np.ndarray
    redundant: tuple[str, ...]
    chart: Chart

    @property
    def nq(self) -> int:
        """Number of the tree's coordinates."""
        return len(self.tree.coordinates)

    @property
    def mobility(self) -> int:
        """Number n of independent rates."""
        return len(self.chart.independent)

    @cached_property
    def v(self) -> ca.SX:
        """Independent rates (n) [m/s, rad/s]."""
        return SX.sym("v", self.mobility)

    @cached_property
    def elimination(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return L (nq x n), the bias b (nq) of q'' = L v' + b, and the smallest relative pivot."""
        Phi_a = self.rows.Phi[:, list(self.chart.independent)]
        X, _ = solve(self.chart, self.rows.Phi, -Phi_a)
        L = self.scatter(X, SX.eye(self.mobility))
        gamma = ca.substitute(self.rows.gamma, self.rows.rates, ca.mtimes(L, self.v))
        X, pivot = solve(self.chart, self.rows.Phi, ca.horzcat(-Phi_a, -gamma))
        full = self.scatter(X, ca.horzcat(SX.eye(self.mobility), SX.zeros(self.mobility)))
        return full[:, :-1], full[:, -1], pivot

    def scatter(self, dependent: dict[int, ca.SX], independent: ca.SX) -> ca.SX:
        """Arrange rows of dependent and independent coordinates in the tree's order."""
        rows = dict(zip(self.chart.independent, ca.vertsplit(independent), strict=True)) | dependent
        return ca.densify(ca.vertcat(*[rows[j] for j in range(self.nq)]))

    @property
    def rates(self) -> ca.SX:
        """Return q' = L v (nq), Eq. (7)."""
        return ca.mtimes(self.elimination[0], self.v)

    @cached_property
    def inertia(self) -> tuple[ca.SX, ca.SX]:
        """Return M = L' H L (n x n), Eq. (10), and H_d L (k x n), the rows of H L that belong to dependent coordinates.

        With L = [1; L_d]:  M = H_aa + H_ad L_d + L_d' (H_dd L_d + H_da).  M's lower triangle repeats the upper one.
        """
        L = self.elimination[0]
        H = dynamics.generalised_inertia(self.tree)
        a, d = list(self.chart.independent), list(self.chart.dependent)
        if not d:
            return ca.triu2symm(ca.triu(ca.densify(H[a, a]))), SX.zeros(0, self.mobility)
        L_d = L[d, :]
        coupling = ca.mtimes(H[d, d], L_d) + H[d, a]
        M = H[a, a] + ca.mtimes(H[a, d], L_d) + ca.mtimes(L_d.T, coupling)
        return ca.triu2symm(ca.triu(ca.densify(M))), coupling

    def bias_forces(self, gravity: ca.SX) -> ca.SX:
        """Return C v + G (n) under a given gravity, Eqs. (11), (12): L' (h(q, q') + H b), where b is zero but for b_d."""
        L, b, _ = self.elimination
        h = dynamics.inertia_forces(self.tree, self.rates, SX.zeros(self.nq), gravity)
        forces = ca.mtimes(L.T, h)
        dependent = list(self.chart.dependent)
        return forces + ca.mtimes(self.inertia[1].T, b[dependent]) if dependent else forces

    @property
    def gravity(self) -> ca.SX:
        return SX(np.array(self.mechanism.gravity))


def solve_symmetric(A: ca.SX, b: ca.SX) -> ca.SX:
    """Solve A x = b for a symmetric positive A.

    Up to three unknowns by cofactors, A^-1 = adj A / det A: one division, and short chains of operations. More by
    A = U' D U without square roots, U unit upper triangular.
    """
    n = A.shape[0]
    if n <= COFACTOR_SIZE:
        adjugate = ca.densify(ca.adj(A))
        return ca.mtimes(adjugate, b) / ca.mtimes(A[0, :], adjugate[:, 0])
    U, D = SX.eye(n), [SX(0)] * n
    W = SX.zeros(n, n)
    for i in range(n):
        for j in range(i, n):
            W[i, j] = A[i, j] - sum((W[k, i] * U[k, j] for k in range(i)), SX(0))
        D[i] = 1 / W[i, i]
        for j in range(i + 1, n):
            U[i, j] = W[i, j] * D[i]
    x = [b[i] for i in range(n)]
    for i in range(n):
        for k in range(i):
            x[i] = x[i] - U[k, i] * x[k]
    x = [x[i] * D[i] for i in range(n)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = x[i] - U[i, k] * x[k]
    return ca.vertcat(*x)
