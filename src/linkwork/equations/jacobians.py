"""Jacobians of points of bodies: the twist [omega; v] that a unit of each of the tree's rates
gives a body at a point."""

from __future__ import annotations

import casadi as ca

from linkwork.equations.algebra import SX, zero
from linkwork.equations.closure import moving
from linkwork.equations.tree import Node, Tree


def jacobian(tree: Tree, node: Node, d: ca.SX) -> ca.SX:
    """Return the 6 x nv map from rates to [omega; v of a point of the node's body], in the ground's
    axes.

    d: the vector from the node's origin to the point, in the node's axes
    """
    J = SX(6, len(tree.rates))
    for inner, reach in tree.reaches(node, d):
        for column in inner.columns:
            A = inner.column_axes.matrix
            turn = ca.mtimes(A, column.z) if inner.turns else zero()
            J[:, column.rate] = ca.vertcat(turn, ca.mtimes(A, moving(column, inner, reach)))
    return J
