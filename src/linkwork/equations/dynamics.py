"""Inertia forces of the tree: composite inertias and Newton-Euler, with the moments regrouped by
`regrouping`.

    H(q)          generalised inertia of the tree, by composite moments
    h(q, w, w')   H w' + velocity terms + weight - applied wrenches, by one outward and one inward
                  pass

H is K' Mtot K and h(q, w, 0) is K' (Mtot K' w + Omega Mtot K w - w_g) of the paper for the tree's
rates, organised so that neither K nor Mtot is ever formed. Both are written about the nodes'
origins, in the nodes' axes.
Source: Featherstone 2008, sec. 5.3 and 6.2; the paper, Eqs. (10)-(12).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca

from linkwork.equations.algebra import SX, Number, cross, dot, present, turning_matrix, zero
from linkwork.equations.orientation import convert
from linkwork.equations.tree import Column, Node, Tree
from linkwork.equations.turned_inertia import turning_moment

Elements = dict[tuple[int, int], ca.SX]  # of a matrix, by row and column
Wrenches = Mapping[int, tuple[ca.SX, ca.SX]]


def generalised_inertia(tree: Tree) -> ca.SX:
    """Return H (nv x nv, without the elements of rates of which none carries the other).

    Outward to inward, composite moments (m, h, I) gather each node's own and its children's,
    shifted by r: h += m r, I += 2 (r.h) 1 - r h' - h r' + m (r.r 1 - r r')  with the child's h. A
    unit acceleration of a rate needs the wrench  F = z x h + m s,  N = I z + h x s  about O; H_ij
    projects it on the columns inward.
    """
    moments = [node.near_moments for node in tree.nodes]
    H: Elements = {}
    for node in reversed(tree.nodes):
        m, h, inertia = moments[node.index]
        project_inward(tree, node, m, h, inertia, H)
        if node.parent >= 0:
            m_p, h_p, I_p = moments[node.parent]
            r, h = node.r, convert(h, node.axes, node.before)
            inertia = convert(convert(inertia, node.axes, node.before).T, node.axes, node.before)
            shift = 2 * dot(r, h) * SX.eye(3) - ca.mtimes(r, h.T) - ca.mtimes(h, r.T)
            if present(m):
                shift += m * (dot(r, r) * SX.eye(3) - ca.mtimes(r, r.T))
            moments[node.parent] = (m_p + m, h_p + h + m * r, I_p + inertia + shift)
    rows, columns, nv = [i for i, _ in H], [j for _, j in H], len(tree.rates)
    return SX.triplet(rows, columns, ca.vertcat(SX(0, 1), *H.values()), nv, nv)


def project_inward(
    tree: Tree, node: Node, m: Number, h: ca.SX, inertia: ca.SX, H: Elements
) -> None:
    """Fill rows and columns of H of a node's rates, up to the rates inward of it and those of its
    own."""
    axes = node.column_axes
    h = convert(h, node.axes, axes)
    inertia = convert(convert(inertia, node.axes, axes).T, node.axes, axes)
    for column in node.columns:
        F, N, i = zero(), zero(), column.rate
        if node.turns:
            F, N = cross(column.z, h), ca.mtimes(inertia, column.z)
        if node.slides:
            F, N = F + m * column.s, N + cross(h, column.s)
        own = axes
        for inner in reversed(tree.path(node)):
            if inner is not node:
                N = convert(N, own, inner.column_axes)
                F = convert(F, own, inner.column_axes)
                own = inner.column_axes
            for other in inner.columns:
                H[i, other.rate] = H[other.rate, i] = along(inner, other, N, F)
            N, F, own = (convert(N, own, inner.before), convert(F, own, inner.before), inner.before)
            N = N + cross(inner.r, F)


def along(node: Node, column: Column, N: ca.SX, F: ca.SX) -> ca.SX:
    """Return the force conjugate to a rate, z . N + s . F, of a wrench about the node's origin in
    its column axes."""
    turn = dot(column.z, N) if node.turns else SX(0)
    return turn + dot(column.s, F) if node.slides else turn


def inertia_forces(
    tree: Tree, rates: ca.SX, accelerations: ca.SX, gravity: ca.SX, applied: Wrenches | None = None
) -> ca.SX:
    """Return h(q, w, w') (nv x 1): the joint forces that the motion, the weight and applied
    wrenches need.

    applied: (moment about the node's origin, force) on nodes by index, in the nodes' axes. Ground
    is given the acceleration -g. With A r = alpha x r + omega x (omega x r), inward:
    F = m a_O + A h,  N = I alpha + omega x (I omega) + h x a_O  about O.
    """
    omega = tree.angular_velocities(rates)
    moved = None if accelerations.is_zero() else accelerations
    alpha, a = tree.accelerations(omega, rates, moved, -gravity)
    wrenches = {index: (-moment, -force) for index, (moment, force) in (applied or {}).items()}
    return carried_inward(tree, wrenches, lambda node: node_wrench(node, omega, alpha, a))


def carried_inward(
    tree: Tree, wrenches: Wrenches, own: Callable[[Node], tuple[ca.SX, ca.SX]] | None = None
) -> ca.SX:
    """Return the joint forces (nv x 1) of wrenches on nodes, added up from the tips inward.

    wrenches: (moment about the node's origin, force) by index, in the nodes' axes; own: gives those
    of each node that come on top
    """
    carried, h = dict(wrenches), SX.zeros(len(tree.rates))
    for node in reversed(tree.nodes):
        if own is not None:
            add(carried, node.index, *own(node))
        if node.index not in carried:
            continue
        wrench = carried[node.index]
        N, F = (convert(x, node.axes, node.column_axes) for x in wrench)
        for column in node.columns:
            h[column.rate] = along(node, column, N, F)
        if node.parent >= 0:
            N, F = (convert(x, node.axes, node.before) for x in wrench)
            add(carried, node.parent, N + cross(node.r, F), F)
    return h


def add(wrenches: dict[int, tuple[ca.SX, ca.SX]], index: int, moment: ca.SX, force: ca.SX) -> None:
    """Add moment and force to what acts on a node."""
    before = wrenches.get(index, (zero(), zero()))
    wrenches[index] = before[0] + moment, before[1] + force


def node_wrench(
    node: Node, omega: list[ca.SX], alpha: list[ca.SX], a: list[ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Return N about the origin and F that the motion of a node's own inertia needs."""
    m, h, inertia = node.near_moments
    w, turning, moving = omega[node.index], alpha[node.index], a[node.index]
    A = turning_matrix(w, turning)
    F = ca.mac(A, h, m * moving) if present(m) else ca.mtimes(A, h)
    N = turning_moment(inertia, w, turning, A) + cross(h, moving)
    return N, F
