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
from linkwork.mechanism.bearing import require_no_bearings


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


def opening(equations: Equations) -> ca.Function:
    """Return what `closure` does at quaternions a Newton step nearer to length 1."""
    rows, normed = equations.rows, equations.tree.normed
    outputs = {
        "phi": normed(rows.phi),
        "Phi": normed(rows.Phi),
        "residual": conditions(equations, normed),
    }
    return function("opening", equations, outputs)


def forces(equations: Equations) -> ca.Function:
    """Return (q, w, u) -> what `balance` gives, and 1: all of it is defined."""
    free = uncharted(equations)
    u = SX.sym("u", len(equations.mechanism.actuators))
    outputs = balance(free, ca.mtimes(free.actuation.T, u)) | {"defined": SX(1)}
    return function("forces", free, outputs, v=free.v, u=u)


def bias(equations: Equations) -> ca.Function:
    """Return (q, w) -> gamma (rows)."""
    gamma, w = equations.rows.gamma, equations.rows.rates
    return function("bias", equations, {"gamma": gamma}, w=w)


def turning(equations: Equations) -> ca.Function:
    """Return (q, w) -> d(Phi w)/dq (rows x nq)."""
    w = SX.sym("w", equations.nv)
    turned = ca.jacobian(ca.mtimes(equations.rows.Phi, w), equations.tree.q)
    return function("turning", equations, {"turned": turned}, w=w)


def unbalanced(free: Equations, applied: ca.SX, a: ca.SX, multipliers: ca.SX) -> dict[str, ca.SX]:
    """Return q' (nq), H a + h - f - applied - Phi' l (nv), and Phi a + gamma (rows), of equations
    in which every rate of the tree counts as independent, at any a and l.

    By the recursion of Newton and Euler; by H itself where there are quaternions, for in
    derivatives along their lengths, from which steps of integrators are never quite free, the two
    differ.
    """
    Phi, found = free.rows.Phi, balance(free, applied)
    forces = (
        ca.mtimes(found["H"], a) - found["forces"]
        if free.tree.quaternions
        else free.tree_forces(a, free.gravity) - applied
    )
    return {
        "derivatives": found["derivatives"],
        "forces": forces - ca.mtimes(Phi.T, multipliers),
        "gamma": ca.mtimes(Phi, a) + found["gamma"],
    }


def balance(free: Equations, applied: ca.SX) -> dict[str, ca.SX]:
    """Return q' (nq), H (nv x nv), the applied forces + f - h (nv), and gamma (rows) of equations
    in which every rate of the tree counts as independent; refuse bearings, whose friction depends
    on the accelerations that a chart gives."""
    require_no_bearings(
        free.mechanism.joints, "equations before a chart is chosen leave out", "choose a chart"
    )
    return {
        "derivatives": free.tree.derivatives(free.v),
        "H": free.inertia[0],
        "forces": applied - free.bias_forces(free.gravity),
        "gamma": ca.substitute(free.rows.gamma, free.rows.rates, free.v),
    }


def moved(equations: Equations) -> ca.Function:
    """Return (q, s) -> q after a step s of the tree's rates, from quaternions a Newton step nearer
    to length 1 on."""
    tree, s = equations.tree, SX.sym("s", equations.nv)
    q = tree.normed(tree.q + tree.derivatives(s))
    return function("moved", equations, {"q_next": q}, s=s)
