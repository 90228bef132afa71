"""What is read off a configuration: coordinates of all joints, poses and twists of bodies and tools.

Joints of the tree carry their coordinates themselves; those of cut joints follow from the poses of their two sides. K
maps the tree's rates to the bodies' twists t_i = [omega_i; v_i], v_i of the mass centre, in the ground's axes (paper,
Eqs. (3), (4)).
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import closure
from linkwork.equations.algebra import SX, cross, rotation_matrix, spin, zero
from linkwork.equations.joints import KINDS
from linkwork.equations.orientation import Orientation
from linkwork.equations.tree import Node, Tree, offset
from linkwork.mechanism import Mechanism, Tool


def joint_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the joints that have coordinates, in the order of the description, a name for each coordinate."""
    return tuple(name for name, joint in mechanism.joints.items() for _ in KINDS[joint.type].motions(joint))


def joint_positions(mechanism: Mechanism, tree: Tree, cuts: tuple[closure.Cut, ...]) -> ca.SX:
    """Return the coordinates of all joints (m) [rad, m]."""
    values = {name: tree.q[index] for index, name in enumerate(tree.coordinates)}
    for cut in cuts:
        for motion in KINDS[mechanism.joints[cut.joint].type].motions(mechanism.joints[cut.joint]):
            values[cut.joint] = closure.coordinate(cut, motion.axis, motion.turns)
    return ca.vertcat(*[values[name] for name in joint_names(mechanism)])


def joint_rates(mechanism: Mechanism, tree: Tree, cuts: tuple[closure.Cut, ...]) -> ca.SX:
    """Return the matrix (m x nq) that gives all joints' rates from the tree's."""
    identity = SX.eye(len(tree.coordinates))
    rows = {name: identity[index, :] for index, name in enumerate(tree.coordinates)}
    for cut in cuts:
        for motion in KINDS[mechanism.joints[cut.joint].type].motions(mechanism.joints[cut.joint]):
            rows[cut.joint] = closure.rate_row(tree, cut, motion.axis, motion.turns)
    return ca.densify(ca.vertcat(*[rows[name] for name in joint_names(mechanism)]))


def jacobian(tree: Tree, node: Node, d: ca.SX) -> ca.SX:
    """Return the 6 x nq map from rates to [omega; v of a point of the node's body], d the vector from its origin to it."""
    J = SX.zeros(6, len(tree.coordinates))
    for inner, reach in tree.reaches(node, d):
        if inner.coordinate is not None:
            turn = ca.vertcat(inner.z, cross(inner.z, reach)) if inner.turns else ca.vertcat(zero(), inner.z)
            J[:, inner.coordinate] = turn
    return J


def body_jacobians(mechanism: Mechanism, tree: Tree) -> ca.SX:
    """Return K (6r x nq) of the bodies' mass centres, Eq. (4) for the tree's rates."""
    blocks = []
    for name, body in mechanism.bodies.items():
        node = tree.node(name)
        blocks.append(jacobian(tree, node, offset(node, np.array(body.centre_of_mass))))
    return ca.vertcat(*blocks)


def body_poses(mechanism: Mechanism, tree: Tree) -> tuple[ca.SX, ca.SX]:
    """Return the origins p_0B (3r) [m] and the matrices R_0B, row by row (9r), of the bodies' frames."""
    nodes = [tree.node(name) for name in mechanism.bodies]
    origins = [node.O + offset(node, np.zeros(3)) for node in nodes]
    return ca.vertcat(*origins), ca.vertcat(*[ca.vec(node.R.matrix.T) for node in nodes])


def is_planar(tree: Tree) -> bool:
    """Tell whether every body moves parallel to the ground's xy plane, by the directions of all joint axes."""
    for node in tree.nodes:
        across = (node.z[0], node.z[1]) if node.turns else (node.z[2],)
        if node.coordinate is not None and not all(vanishes(component) for component in across):
            return False
    return True


def vanishes(expression: ca.SX) -> bool:
    return expression.is_constant() and abs(float(expression)) < 1e-12


def tool_pose(tree: Tree, tool: Tool) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return a tool's position p_0T (3) [m], matrix R_0T row by row (9), and its angle about z [rad] where planar (else 0)."""
    node = tree.node(tool.body)
    p = node.O + offset(node, np.array(tool.frame.position))
    R = node.R.then_constant(rotation_matrix(tool.frame.rotation))
    return p, ca.vec(R.matrix.T), planar_angle(R) if is_planar(tree) else SX(0)


def planar_angle(R: Orientation) -> ca.SX:
    """Return the angle about z at which a frame's x axis points in the plane, without a jump."""
    offset = float(np.arctan2(R.right[1, 0], R.right[0, 0]))
    if not R.axis.any():
        return SX(offset)
    return (R.angle if R.axis[2] > 0 else -R.angle) + offset


def tool_twist(tree: Tree, tool: Tool, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return a tool's Jacobian J (6 x nq, [omega; v]) and J' q' (6), its acceleration at q'' = 0."""
    node = tree.node(tool.body)
    d = offset(node, np.array(tool.frame.position))
    omega = tree.angular_velocities(rates)
    alpha, a = tree.accelerations(omega, rates, SX.zeros(rates.numel()), zero())
    i = node.index
    return jacobian(tree, node, d), ca.vertcat(alpha[i], a[i] + cross(alpha[i], d) + spin(omega[i], d))


def derivative(matrix: ca.SX, q: ca.SX, rates: ca.SX) -> ca.SX:
    """Return the time derivative of a matrix of q, entry by entry."""
    return ca.reshape(ca.jtimes(ca.vec(matrix), q, rates), *matrix.shape)
