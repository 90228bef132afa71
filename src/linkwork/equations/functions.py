"""The functions that are compiled: each a few expressions of `Equations` with named inputs and
outputs.

`q` are the tree's coordinates (nq), `v` the independent rates (n) of the chart, `u` the actuators'
forces. The last input of each is `p`, the free parameters (np, most often none).
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations import bearings, body_motion, dynamics, effects
from linkwork.equations import regressor as linear
from linkwork.equations.algebra import SX, dot, vector
from linkwork.equations.elimination import solve
from linkwork.equations.equations import Equations, conditions
from linkwork.equations.joint_map import derivative

LONG = 100_000  # instructions


def function(
    name: str, equations: Equations, outputs: dict[str, ca.SX], **inputs: ca.SX
) -> ca.Function:
    """Make a CasADi function of q, inputs and p, with dense outputs and no expression computed
    twice."""
    return of_inputs(name, {"q": equations.tree.q, **inputs, "p": equations.p}, outputs)


def of_inputs(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
    """Make the same of inputs alone. In a LONG one what is computed twice is left to kernels, which
    find it, too: to CasADi that takes as long as all expressions took."""
    given = name, [*inputs.values()], [*map(ca.densify, outputs.values())], [*inputs], [*outputs]
    made = ca.Function(*given)
    return made if made.n_instructions() > LONG else ca.Function(*given, {"cse": True})


def motion(equations: Equations) -> ca.Function:
    """Return (q, v, u) -> q', v' and the weakest relative pivot: the direct dynamics, Eq. (9)."""
    u = SX.sym("u", len(equations.mechanism.actuators))
    acceleration = bearings.accelerations(equations, ca.mtimes(equations.actuation.T, u), u)
    derivatives = equations.tree.derivatives(equations.rates)
    outputs = {
        "derivatives": derivatives,
        "accelerations": acceleration,
        "pivot": equations.elimination.pivot,
    }
    return function("motion", equations, outputs, v=equations.v, u=u)


def inverse_dynamics(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> the forces on the independent rates, M v' + C v + G - f, and the weakest
    relative pivot; bearings carry what they do under actuators there."""
    dv = SX.sym("dv", equations.mobility)
    forces = forces_needed(equations, dv, SX.zeros(len(equations.mechanism.actuators)))
    outputs = {"forces": forces, "pivot": equations.elimination.pivot}
    return function("inverse_dynamics", equations, outputs, v=equations.v, dv=dv)


def forces_needed(equations: Equations, dv: ca.SX, u: ca.SX) -> ca.SX:
    """Return M v' + C v + G - f (n), with the friction that bearings have under actuator forces
    u."""
    L, b, _ = equations.elimination
    h = equations.tree_forces(ca.mtimes(L, dv) + b, equations.gravity)
    needed = ca.mtimes(L.T, h)
    phi = bearings.friction(equations, dv, u)
    return needed if phi is None else needed - bearings.on_rates(equations, phi)


def inverse_dynamics_borne(equations: Equations) -> ca.Function:
    """Return (q, v, v', u) -> what `inverse_dynamics` gives where bearings carry what they do under
    actuator forces u."""
    dv, u = SX.sym("dv", equations.mobility), SX.sym("u", len(equations.mechanism.actuators))
    outputs = {"forces": forces_needed(equations, dv, u), "pivot": equations.elimination.pivot}
    return function("inverse_dynamics_borne", equations, outputs, v=equations.v, dv=dv, u=u)


def actuation(equations: Equations) -> ca.Function:
    """Return q -> S (actuators x n), the actuated rates S v, and the weakest relative pivot."""
    outputs = {"S": equations.actuation, "pivot": equations.elimination.pivot}
    return function("actuation", equations, outputs)


def terms(equations: Equations) -> ca.Function:
    """Return (q, v) -> M, C v, G, the forces f of springs and friction, and the weakest relative
    pivot, Eqs. (10)-(12)."""
    still = SX.zeros(3)
    velocity = equations.bias_forces(still, passive=False)
    at_rest = ca.substitute(
        equations.bias_forces(equations.gravity, passive=False),
        equations.v,
        SX.zeros(equations.mobility),
    )
    outputs = {
        "M": equations.inertia[0],
        "Cv": velocity,
        "G": at_rest,
        "f": velocity - equations.bias_forces(still),
        "pivot": equations.elimination.pivot,
    }
    return function("terms", equations, outputs, v=equations.v)


def closure_step(equations: Equations) -> ca.Function:
    """Return q -> q after one Newton step of the dependent coordinates, and the largest |phi|
    before it in own units.

    Rows that are not held count as far as they are open beyond what rounded numbers explain.
    First quaternions take a step of their own (`Tree.normed`): where their lengths were off, phi
    would be closed for these. They count in the residual as they were.
    """
    tree, phi = equations.tree, equations.rows.phi
    step, _ = solve(equations.chart, equations.rows.Phi, -phi)
    step = equations.scatter(step, SX.zeros(equations.mobility, 1))
    q, residual = tree.normed(tree.q + tree.derivatives(step)), conditions(equations, tree.normed)
    return function("closure_step", equations, {"q_next": q, "residual": residual})


def unheld_gap(equations: Equations) -> ca.Function:
    """Return q -> the largest |phi| of the rows that are not held, in own units."""
    return function("unheld_gap", equations, {"gap": equations.rows.unheld_gap})


def tree_rates(equations: Equations) -> ca.Function:
    """Return (q, v) -> the rates w = L v of the whole tree, and the weakest relative pivot, Eq.
    (7)."""
    outputs = {"w": equations.rates, "pivot": equations.elimination.pivot}
    return function("tree_rates", equations, outputs, v=equations.v)


def motion_energy(equations: Equations) -> ca.Function:
    """Return (q, w) -> the kinetic energy w' H w / 2 [J] of rates w of the whole tree: the same in
    all charts."""
    tree, w = equations.tree, equations.rows.rates
    H = dynamics.generalised_inertia(tree) + effects.rotor_inertia(equations.freedoms, equations.nv)
    return function("motion_energy", equations, {"T": ca.mtimes(w.T, ca.mtimes(H, w)) / 2}, w=w)


def maps(equations: Equations) -> ca.Function:
    """Return q -> L for all joints' rates (m x n), T (6r x n) and the weakest relative pivot, Eqs.
    (6), (7)."""
    L, _, pivot = equations.elimination
    T = ca.mtimes(body_motion.body_jacobians(equations.mechanism, equations.tree), L)
    outputs = {"L": ca.mtimes(equations.joints.rate_rows(), L), "T": T, "pivot": pivot}
    return function("maps", equations, outputs)


def positions(equations: Equations) -> ca.Function:
    """Return q -> coordinates of all joints."""
    return function("positions", equations, {"positions": equations.joints.positions()})


def joints_motion(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> positions, rates and accelerations of all joints, and the weakest
    relative pivot."""
    dv = SX.sym("dv", equations.mobility)
    L, b, pivot = equations.elimination
    J = equations.joints.rate_rows()
    turning = ca.mtimes(derivative(J, equations.tree, equations.rates), equations.rates)
    outputs = {
        "positions": equations.joints.positions(),
        "rates": ca.mtimes(J, equations.rates),
        "accelerations": ca.mtimes(J, ca.mtimes(L, dv) + b) + turning,
        "pivot": pivot,
    }
    return function("joints_motion", equations, outputs, v=equations.v, dv=dv)


def tool_motion(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> of the first tool the pose (`task.POSE`), the Jacobian T (6 x n) of its
    twist [omega; v], the twist and its derivative [alpha; a], and the weakest relative pivot."""
    dv = SX.sym("dv", equations.mobility)
    L, b, pivot = equations.elimination
    tool = equations.mechanism.first_tool
    J, bias = body_motion.tool_twist(equations.tree, tool, equations.rates)
    outputs = {
        "pose": ca.vertcat(*body_motion.tool_pose(equations.tree, tool)),
        "T": ca.mtimes(J, L),
        "twist": ca.mtimes(J, equations.rates),
        "acceleration": ca.mtimes(J, ca.mtimes(L, dv) + b) + bias,
        "pivot": pivot,
    }
    return function("tool_motion", equations, outputs, v=equations.v, dv=dv)


def bodies_motion(equations: Equations) -> ca.Function:
    """Return (q, v) -> origins (3r), orientations (9r, row by row), twists (6r) of the bodies in
    the ground's axes, and the weakest relative pivot.
    """
    origins, orientations = body_motion.body_poses(equations.mechanism, equations.tree)
    twists = ca.mtimes(
        body_motion.body_jacobians(equations.mechanism, equations.tree), equations.rates
    )
    outputs = {
        "origins": origins,
        "orientations": orientations,
        "twists": twists,
        "pivot": equations.elimination.pivot,
    }
    return function("bodies_motion", equations, outputs, v=equations.v)


def constraints(equations: Equations) -> ca.Function:
    """Return q -> phi and Phi."""
    outputs = {"phi": equations.rows.phi, "Phi": equations.rows.Phi}
    return function("constraints", equations, outputs)


def pivots(equations: Equations) -> ca.Function:
    """Return q -> the relative pivots of the elimination, block by block."""
    _, found = solve(equations.chart, equations.rows.Phi, SX(len(equations.rows.names), 0))
    return function("pivots", equations, {"pivots": ca.vertcat(SX(0, 1), *found)})


def assembly(equations: Equations) -> ca.Function:
    """Return (q, w) -> what closes and places the mechanism, with Jacobians in the rates and biases
    at w' = 0.

    Outputs: how far rows that are not held, if there are any, are open beyond what rounded numbers
    explain; phi, its derivative along the rates, gamma; alignment; the map from w to q';
    coordinates of all joints and the rows of their rates; the rows of the actuated rates, where
    there are transmissions; of the first tool the position (3), the orientation (9, row by row),
    the angle (where planar), the Jacobian (6 x nv) and the bias (6).
    """
    tree, rates = equations.tree, equations.rows.rates
    outputs = {"excess": equations.rows.excess} if equations.rows.unheld else {}
    outputs |= {
        "phi": equations.rows.phi,
        "Phi": equations.rows.open_Phi,
        "gamma": equations.rows.gamma,
        "alignment": equations.rows.alignment,
        "derivatives": tree.derivative_map,
        "coordinates": equations.joints.positions(),
        "J_coordinates": equations.joints.rate_rows(),
    }
    if equations.mechanism.transmissions:
        actuators = equations.mechanism.actuators
        outputs["J_actuated"] = equations.joints.rate_rows(actuators)
    if equations.mechanism.tools:
        tool = equations.mechanism.first_tool
        J, bias = body_motion.tool_twist(tree, tool, rates)
        outputs |= body_motion.tool_pose(tree, tool)._asdict() | {"J_tool": J, "bias_tool": bias}
    return function("assembly", equations, outputs, rates=rates)


def regressor(equations: Equations) -> ca.Function:
    """Return (q, v, v') -> Y (n x k), r (n) and the weakest relative pivot: M v' + C v + G - f = Y
    pi + r.

    pi: what `regressor.names` names; r: what springs take.
    """
    dv = SX.sym("dv", equations.mobility)
    Y, rest = linear.regressor(equations, dv)
    outputs = {"Y": Y, "rest": rest, "pivot": equations.elimination.pivot}
    return function("regressor", equations, outputs, v=equations.v, dv=dv)


def energy(equations: Equations) -> ca.Function:
    """Return (q, v) -> kinetic energy v' M v / 2, potential energy of weight and springs [J],
    weakest relative pivot."""
    tree, v, mechanism = equations.tree, equations.v, equations.mechanism
    kinetic = ca.mtimes(v.T, ca.mtimes(equations.inertia[0], v)) / 2
    potential = sum((freedom.potential for freedom in equations.freedoms), SX(0))
    potential += effects.stored(mechanism, tree)
    for name, body in mechanism.bodies.items():
        potential -= body.mass * dot(
            equations.gravity, tree.point(tree.node(name), vector(body.centre_of_mass))
        )
    outputs = {"kinetic": kinetic, "potential": potential, "pivot": equations.elimination.pivot}
    return function("energy", equations, outputs, v=v)
