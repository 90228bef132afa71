"""What is read off a configuration: poses and twists of bodies and tools.

K maps the tree's rates to the bodies' twists t_i = [omega_i; v_i], v_i of the mass centre, in the
ground's axes (paper, Eqs. (3), (4)).
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, point_acceleration, vector, zero
from linkwork.equations.frames import turned_by
from linkwork.equations.jacobians import jacobian
from linkwork.equations.joint_map import derivative
from linkwork.equations.orientation import Orientation
from linkwork.equations.tree import Node, Tree, near_offset, offset
from linkwork.mechanism import GROUND, Mechanism, Tool


def body_jacobians(mechanism: Mechanism, tree: Tree) -> ca.SX:
    """Return K (6r x nv) of the bodies' mass centres, Eq. (4) for the tree's rates."""
    blocks = []
    for name, body in mechanism.bodies.items():
        node = tree.node(name)
        blocks.append(jacobian(tree, node, near_offset(node, vector(body.centre_of_mass))))
    return ca.vertcat(SX(0, len(tree.rates)), *blocks)


def body_poses(mechanism: Mechanism, tree: Tree) -> tuple[ca.SX, ca.SX]:
    """Return the origins p_0B (3r) [m] and the matrices R_0B, row by row (9r), of the bodies'
    frames."""
    nodes = [tree.node(name) for name in mechanism.bodies]
    origins = [node.O + offset(node, np.zeros(3)) for node in nodes]
    return ca.vertcat(*origins), ca.vertcat(*[ca.vec(node.R.matrix.T) for node in nodes])


def is_planar(tree: Tree, tool: Tool | None = None) -> bool:
    """Tell whether every body moves parallel to the ground's xy plane, by the directions of all
    joint axes, and a tool is seen from the ground or a body whose z axis is across that plane."""
    for node in tree.nodes:
        A = node.column_axes.matrix
        for column in node.columns:
            z, s = ca.mtimes(A, column.z), ca.mtimes(A, column.s)
            across = [z[0], z[1]] if node.turns else []
            across += [s[2]] if node.slides else []
            if not all(vanishes(component) for component in across):
                return False
    return tool is None or vanishes(tree.node(tool.relative_to).R.matrix[2, 2] ** 2 - 1)


def vanishes(expression: ca.SX) -> bool:
    return expression.is_constant() and abs(float(expression)) < 1e-12


class ToolPose(NamedTuple):
    """Hold a tool's position p_0T (3) [m], matrix R_0T row by row (9), and its angle about z [rad]
    where planar (else 0)."""

    position: ca.SX
    orientation: ca.SX
    angle: ca.SX


def tool_pose(tree: Tree, tool: Tool) -> ToolPose:
    """Return where a tool is, in the ground or in the frame of the body that it is relative to."""
    node, planar = tree.node(tool.body), is_planar(tree)
    p = node.O + offset(node, vector(tool.frame.position))
    R = turned_by(node.R, tool.frame)
    angle = planar_angle(R) if planar else SX(0)
    if tool.relative_to == GROUND:
        return ToolPose(p, ca.vec(R.matrix.T), angle)
    base = tree.node(tool.relative_to)
    p = ca.mtimes(base.R.matrix.T, p - base.O - offset(base, np.zeros(3)))
    angle = (angle - planar_angle(base.R)) * base.R.matrix[2, 2] if planar else angle
    return ToolPose(p, ca.vec(ca.mtimes(R.matrix.T, base.R.matrix)), angle)


def planar_angle(R: Orientation) -> ca.SX:
    """Return the angle about z at which a frame's x axis points in the plane, without a jump."""
    offset = float(np.arctan2(R.right[1, 0], R.right[0, 0]))
    if not R.axis.any():
        return SX(offset)
    return (R.angle if R.axis[2] > 0 else -R.angle) + offset


def pose_places(planar: bool) -> list[int]:
    """Return the places in a twist [omega; v] of the rates of a pose: x, y and angle, or x, y, z
    and three turns."""
    return [3, 4, 2] if planar else [3, 4, 5, 0, 1, 2]


def tool_twist(tree: Tree, tool: Tool, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return a tool's Jacobian J (6 x nv, [omega; v]) and J' w (6), its acceleration at w' = 0.

    Relative to a body B they are those of the pose in its frame: omega = R_B' (omega_T - omega_B),
    v = R_B' (v_T - v_B - omega_B x (p_T - p_B)).
    """
    node = tree.node(tool.body)
    d = near_offset(node, vector(tool.frame.position))
    if tool.relative_to != GROUND:
        J = relative_jacobian(tree, node, d, tree.node(tool.relative_to))
        return J, ca.mtimes(derivative(J, tree, rates), rates)
    omega = tree.angular_velocities(rates)
    alpha, a = tree.accelerations(omega, rates, None, zero())
    i, A = node.index, node.axes.matrix
    point = point_acceleration(a[i], omega[i], alpha[i], d)
    return jacobian(tree, node, d), ca.vertcat(ca.mtimes(A, alpha[i]), ca.mtimes(A, point))


def relative_jacobian(tree: Tree, node: Node, d: ca.SX, base: Node) -> ca.SX:
    """Return J (6 x nv) of a point of a node's body in the frame of another node's body."""
    J, J_B = jacobian(tree, node, d), jacobian(tree, base, near_offset(base, np.zeros(3)))
    aside = node.O + ca.mtimes(node.axes.matrix, d) - base.O - offset(base, np.zeros(3))
    v = J[3:, :] - J_B[3:, :] + ca.mtimes(ca.skew(aside), J_B[:3, :])
    turn = base.R.matrix.T
    return ca.vertcat(ca.mtimes(turn, J[:3, :] - J_B[:3, :]), ca.mtimes(turn, v))
