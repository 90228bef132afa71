"""The equations before a chart is chosen: what all charts have in common.

    Phi(q) w = 0,     H(q) w' + h(q, w) = S' u + f + Phi' lambda,     Phi w' + gamma(q, w) = 0

in the rates w of the whole tree. Which of these are independent, and the elimination of the others,
is left to whoever evaluates them (`simulation.partitioned`).
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.chart import Chart
from linkwork.equations.equations import Equations, conditions
from linkwork.equations.functions import function


def uncharted(equations: Equations) -> Equations:
    """Return equations in which every rate of the tree counts as independent."""
    return equations.in_chart(Chart(tuple(range(equations.nv)), (), (), ()))


def closure(equations: Equations) -> ca.Function:
    """Return q -> phi (rows), Phi (rows x nv), and the largest |phi| in own units."""
    outputs = {
        "phi": equations.rows.phi,
        "Phi": equations.rows.Phi,
        "residual": conditions(equations),
    }
    return function("closure", equations, outputs)


def forces(equations: Equations) -> ca.Function:
    """Return (q, w, u) -> q' (nq), H (nv x nv), the forces S' u + f - h (nv), and gamma (rows)."""
    free = uncharted(equations)
    u = SX.sym("u", len(equations.mechanism.actuators))
    outputs = {
        "derivatives": free.tree.derivatives(free.v),
        "H": free.inertia[0],
        "forces": ca.mtimes(free.actuation.T, u) - free.bias_forces(free.gravity),
        "gamma": ca.substitute(free.rows.gamma, free.rows.rates, free.v),
    }
    return function("forces", free, outputs, v=free.v, u=u)


def moved(equations: Equations) -> ca.Function:
    """Return (q, s) -> q after a step s of the tree's rates, quaternions a Newton step nearer to
    length 1."""
    tree, s = equations.tree, SX.sym("s", equations.nv)
    q = tree.normed(tree.q + tree.derivatives(s))
    return function("moved", equations, {"q_next": q}, s=s)
