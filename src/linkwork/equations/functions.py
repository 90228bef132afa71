"""The functions that are compiled: each a few expressions of `Equations` with named inputs and outputs."""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import dynamics, measures
from linkwork.equations.algebra import SX, dot
from linkwork.equations.chart import solve
from linkwork.equations.equations import Equations, solve_symmetric
from linkwork.mechanism import Tool


def function(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
    """Make a CasADi function with dense outputs and no expression computed twice."""
    dense = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, list(inputs.values()), dense, list(inputs), list(outputs), {"cse": True})


def motion(equations: Equations) -> ca.Function:
    """Return (q, v, u) -> q', v' and the smallest relative pivot: the direct dynamics, Eq. (9)."""
    u = SX.sym("u", equations.mobility)
    acceleration = solve_symmetric(equations.inertia[0], u - equations.bias_forces(equations.gravity))
    inputs = {"q": equations.tree.q, "v": equations.v, "u": u}
    outputs = {"rates": equations.rates, "accelerations": acceleration, "pivot": equations.elimination[2]}
    return function("motion", inputs, outputs)


def inverse_dynamics(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> actuator forces u and the smallest relative pivot."""
    dv = SX.sym("dv", equations.mobility)
    L, b, pivot = equations.elimination
    h = dynamics.inertia_forces(equations.tree, equations.rates, ca.mtimes(L, dv) + b, equations.gravity)
    inputs = {"q": equations.tree.q, "v": equations.v, "dv": dv}
    return function("inverse_dynamics", inputs, {"forces": ca.mtimes(L.T, h), "pivot": pivot})


def terms(equations: Equations) -> ca.Function:
    """Return (q, v) -> M, C v, G and the smallest relative pivot, Eqs. (10)-(12)."""
    velocity = equations.bias_forces(SX.zeros(3))
    at_rest = ca.substitute(equations.bias_forces(equations.gravity), equations.v, SX.zeros(equations.mobility))
    outputs = {"M": equations.inertia[0], "Cv": velocity, "G": at_rest, "pivot": equations.elimination[2]}
    return function("terms", {"q": equations.tree.q, "v": equations.v}, outputs)


def closure_step(equations: Equations) -> ca.Function:
    """Return q -> q after one Newton step of the dependent coordinates, and the largest |phi| before it."""
    phi = equations.rows.phi
    step, _ = solve(equations.chart, equations.rows.Phi, -phi)
    full = equations.scatter(step, SX.zeros(equations.mobility, 1))
    largest = ca.mmax(ca.fabs(phi)) if equations.rows.names else SX(0)
    return function("closure_step", {"q": equations.tree.q}, {"q_next": equations.tree.q + full, "residual": largest})


def maps(equations: Equations) -> ca.Function:
    """Return q -> L for all joints (m x n), T (6r x n) and the smallest relative pivot, Eqs. (6), (7)."""
    L, _, pivot = equations.elimination
    joints = ca.mtimes(measures.joint_rates(equations.mechanism, equations.tree, equations.cuts), L)
    T = ca.mtimes(measures.body_jacobians(equations.mechanism, equations.tree), L)
    return function("maps", {"q": equations.tree.q}, {"L": joints, "T": T, "pivot": pivot})


def joints_motion(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> positions, rates and accelerations of all joints (m each)."""
    dv = SX.sym("dv", equations.mobility)
    L, b, _ = equations.elimination
    J = measures.joint_rates(equations.mechanism, equations.tree, equations.cuts)
    turning = ca.mtimes(measures.derivative(J, equations.tree.q, equations.rates), equations.rates)
    outputs = {
        "positions": measures.joint_positions(equations.mechanism, equations.tree, equations.cuts),
        "rates": ca.mtimes(J, equations.rates),
        "accelerations": ca.mtimes(J, ca.mtimes(L, dv) + b) + turning,
    }
    return function("joints_motion", {"q": equations.tree.q, "v": equations.v, "dv": dv}, outputs)


def bodies_motion(equations: Equations) -> ca.Function:
    """Return (q, v) -> origins (3r), orientations (9r, row by row) and twists (6r) of the bodies, in the ground's axes."""
    origins, orientations = measures.body_poses(equations.mechanism, equations.tree)
    twists = ca.mtimes(measures.body_jacobians(equations.mechanism, equations.tree), equations.rates)
    outputs = {"origins": origins, "orientations": orientations, "twists": twists}
    return function("bodies_motion", {"q": equations.tree.q, "v": equations.v}, outputs)


def assembly(equations: Equations, tool: Tool | None) -> ca.Function:
    """Return (q, q') -> what closes and places the mechanism, with Jacobians in q and biases at q'' = 0.

    Outputs: phi, its exact Jacobian, gamma; alignment; coordinates of all joints and their Jacobian; of the tool the
    position (3), the orientation (9, row by row), the angle (where planar), the Jacobian (6 x nq) and the bias (6).
    """
    q, rates = equations.tree.q, equations.rows.rates
    coordinates = measures.joint_positions(equations.mechanism, equations.tree, equations.cuts)
    outputs = {
        "phi": equations.rows.phi,
        "Phi": ca.jacobian(equations.rows.phi, q),
        "gamma": equations.rows.gamma,
        "alignment": equations.rows.alignment,
        "coordinates": coordinates,
        "J_coordinates": measures.joint_rates(equations.mechanism, equations.tree, equations.cuts),
    }
    if tool is not None:
        position, orientation, angle = measures.tool_pose(equations.tree, tool)
        J, bias = measures.tool_twist(equations.tree, tool, rates)
        outputs |= {"position": position, "orientation": orientation, "angle": angle, "J_tool": J, "bias_tool": bias}
    return function("assembly", {"q": q, "rates": rates}, outputs)


def energy(equations: Equations) -> ca.Function:
    """Return (q, v) -> kinetic energy v' M v / 2 and potential energy -sum m_i g . c_i [J]."""
    tree, v = equations.tree, equations.v
    kinetic = ca.mtimes(v.T, ca.mtimes(equations.inertia[0], v)) / 2
    potential = SX(0)
    for name, body in equations.mechanism.bodies.items():
        potential -= body.mass * dot(equations.gravity, tree.point(tree.node(name), np.array(body.centre_of_mass)))
    return function("energy", {"q": tree.q, "v": v}, {"kinetic": kinetic, "potential": potential})
