"""Linear: derivatives of the equations of motion along the constraint manifold, exact by automatic
differentiation.

A configuration near q is reached by small shifts xi of the independent joints: dq = S xi, S = N L
(nq x n), whose columns are tangent to phi(q) = 0. With f(q, v, u) = v' the motion near a state and
force is

    xi' = Gamma xi + dv,     dv' = f_q S xi + f_v dv + f_u du,      Gamma = S^+ ((S v)_q S - S')

S^+ reads xi off dq, and S' = dS/dt along the motion. Gamma is zero where the independent rates are
rates of coordinates, and wherever the robot is at rest; it is not for the angular velocity of a
free body.
Source: Negrut & Ortiz, J. Comput. Nonlinear Dynam. 1 (2006) 230-239 (linearisation in the
independent coordinates).
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations import bearings, body_motion, functions
from linkwork.equations.algebra import SX, cross, vector
from linkwork.equations.bearing_loads import Wrench
from linkwork.equations.equations import Equations
from linkwork.equations.task import at_rest
from linkwork.equations.tree import offset
from linkwork.mechanism import GROUND, Tool
from linkwork.mechanism.task import TaskCoordinate


def derivatives(equations: Equations) -> ca.Function:
    """Return (q, v, u, p) -> Gamma, f_xi, f_v, f_u, accelerations, force, K, L, L_xi, T_tool,
    pivot; too rare to compile.

    force = S' u - C v - G + f (n) and K = -d force/d xi; L (m x n) gives the rates of all joints,
    L_xi (m x n) is d(L v)/d xi; T_tool (6 x n) gives the tool's twist.
    """
    tree, v = equations.tree, equations.v
    u = SX.sym("u", len(equations.mechanism.actuators))
    L, _, pivot = equations.elimination
    S = ca.mtimes(tree.derivative_map, L)
    applied = ca.mtimes(equations.actuation.T, u)
    force = applied - equations.bias_forces(equations.gravity)
    f = bearings.accelerations(equations, applied, u)
    joints = ca.mtimes(equations.joints.rate_rows(), L)
    along = [ca.jtimes(ca.mtimes(S, v), tree.q, S), shifted(S, tree.q, ca.mtimes(S, v))]
    T_tool = SX(0, equations.mobility)
    if equations.mechanism.tools:
        tool = equations.mechanism.first_tool
        T_tool = ca.mtimes(body_motion.tool_twist(tree, tool, SX.zeros(equations.nv))[0], L)
    outputs = {
        "Gamma": ca.mtimes(reading(equations), along[0] - along[1]),
        "f_xi": ca.jtimes(f, tree.q, S),
        "f_v": ca.jacobian(f, v),
        "f_u": ca.jacobian(f, u),
        "accelerations": f,
        "force": force,
        "K": -ca.jtimes(force, tree.q, S),
        "L": joints,
        "L_xi": ca.jtimes(ca.mtimes(joints, v), tree.q, S),
        "T_tool": T_tool,
        "pivot": pivot,
    }
    return functions.function("derivatives", equations, outputs, v=v, u=u)


def row_derivatives(equations: Equations, J: ca.SX) -> ca.Function:
    """Return (q, v, p) -> J L (k x n) and d(J L v)/d xi (k x n), for rows J (k x nv) of what moves
    by x' = J w."""
    L, v = equations.elimination.L, equations.v
    moved = ca.mtimes(J, L)
    along = ca.jtimes(
        ca.mtimes(moved, v), equations.tree.q, ca.mtimes(equations.tree.derivative_map, L)
    )
    outputs = {"J": moved, "J_xi": along}
    return functions.function("row_derivatives", equations, outputs, v=v)


def tool_responses(equations: Equations, task: tuple[TaskCoordinate, ...]) -> ca.Function:
    """Return (q, v, u, p) -> d v'/d f (n x k) for forces f that work on task coordinates x' = E
    [omega; v]: bearings carry them, too, and rub by that."""
    tool, u = equations.mechanism.first_tool, SX.sym("u", len(equations.mechanism.actuators))
    pose, f = body_motion.tool_pose(equations.tree, tool), SX.sym("f", len(task))
    _, E = at_rest(task, ca.vertcat(*pose))
    J, _ = body_motion.tool_twist(equations.tree, tool, SX.zeros(equations.nv))
    pushed, forces = ca.mtimes(ca.sparsify(E).T, f), ca.mtimes(equations.actuation.T, u)
    applied = forces + ca.mtimes(equations.elimination.L.T, ca.mtimes(J.T, pushed))
    dv = bearings.accelerations(equations, applied, u, on_bodies(equations, tool, pushed))
    response = ca.substitute(ca.jacobian(dv, f), f, SX.zeros(f.numel()))
    return functions.function("tool_responses", equations, {"F": response}, v=equations.v, u=u)


def on_bodies(equations: Equations, tool: Tool, wrench: ca.SX) -> tuple[Wrench, ...]:
    """Return what a wrench [moment; force] (6) on a tool, in the axes of its twist, is on its body,
    and its reaction on a body that it is relative to."""
    tree, found = equations.tree, []
    node, R = tree.node(tool.body), tree.node(tool.relative_to).R.matrix
    place = node.O + offset(node, vector(tool.frame.position))
    moment, force = ca.mtimes(R, wrench[:3]), ca.mtimes(R, wrench[3:])
    for name, sign in ((tool.body, 1), (tool.relative_to, -1)):
        if name != GROUND:
            own, centre = tree.node(name), equations.mechanism.bodies[name].centre_of_mass
            arm = place - own.O - offset(own, vector(centre))
            found.append((name, sign * ca.vertcat(moment + cross(arm, force), force)))
    return tuple(found)


def shifted(matrix: ca.SX, q: ca.SX, dq: ca.SX) -> ca.SX:
    """Return the derivative of a matrix of q along dq."""
    return ca.reshape(ca.jtimes(ca.vec(ca.densify(matrix)), q, dq), *matrix.shape)


def reading(equations: Equations) -> ca.SX:
    """Return S^+ (n x nq), the rows that read xi off dq: w = N^+ dq at the independent rates; N^+ =
    4 N' for quaternions."""
    tree = equations.tree
    inverse = SX(equations.nv, equations.nq)
    for place, k in tree.single:
        inverse[k, place] = 1
    for places, ks in tree.quaternions:
        inverse[list(ks), list(places)] = 4 * tree.derivative_map[list(places), list(ks)].T
    return inverse[list(equations.chart.independent), :]
