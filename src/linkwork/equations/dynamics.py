"""Inertia forces of the tree: composite inertias and Newton-Euler, with the moments regrouped by `tree`.

    H(q)            generalised inertia of the tree, by composite moments
    h(q, q', q'')   H q'' + velocity terms + weight, by one outward and one inward pass

H is K' Mtot K and h(q, q', 0) is K' (Mtot K' q' + Omega Mtot K q' - w_g) of the paper for the tree's coordinates,
organised so that neither K nor Mtot is ever formed. Both are written about the nodes' origins, in the ground's axes.
Source: Featherstone 2008, sec. 5.3 and 6.2; the paper, Eqs. (10)-(12).
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations.algebra import SX, cross, dot, spin, zero
from linkwork.equations.tree import Node, Tree, in_base


def base_moments(node: Node) -> tuple[float, ca.SX, ca.SX]:
    """Return m, h = R h_local, I = R I_local R' of a node in the ground's axes."""
    m, h, inertia = node.moments.m, node.moments.h, node.moments.I
    R = node.R.matrix
    I_base = ca.mtimes(ca.mtimes(R, SX(inertia)), R.T) if inertia.any() else SX(3, 3)
    return m, in_base(node.R, h), ca.densify(I_base)


def generalised_inertia(tree: Tree) -> ca.SX:
    """Return H (nq x nq).

    Outward to inward, composite moments (m, h, I) gather each node's own and its children's, shifted by r: h += m r,
    I += 2 (r.h) 1 - r h' - h r' + m (r.r 1 - r r')  with the child's h. A unit acceleration of a joint needs the
    wrench (N, F) about O:  turn  F = z x h, N = I z;  slide  F = m z, N = h x z;  H_ij projects it on the joints
    inward.
    """
    moments = [base_moments(node) for node in tree.nodes]
    H = SX.zeros(len(tree.coordinates), len(tree.coordinates))
    for node in reversed(tree.nodes):
        m, h, inertia = moments[node.index]
        if node.coordinate is not None:
            project_inward(tree, node, node.coordinate, m, h, inertia, H)
        if node.parent >= 0:
            m_p, h_p, I_p = moments[node.parent]
            r = node.r
            shift = 2 * dot(r, h) * SX.eye(3) - ca.mtimes(r, h.T) - ca.mtimes(h, r.T)
            if m:
                shift += m * (dot(r, r) * SX.eye(3) - ca.mtimes(r, r.T))
            moments[node.parent] = (m_p + m, h_p + h + m * r, I_p + inertia + shift)
    return H


def project_inward(tree: Tree, node: Node, i: int, m: float, h: ca.SX, inertia: ca.SX, H: ca.SX) -> None:
    """Fill row and column i of H, those of a node's coordinate."""
    z = node.z
    F, N = (cross(z, h), ca.mtimes(inertia, z)) if node.turns else (m * z, cross(h, z))
    H[i, i] = dot(z, N if node.turns else F)
    for inner in reversed(tree.path(node)[:-1]):
        N = N + cross(node.r, F)
        if inner.coordinate is not None:
            H[i, inner.coordinate] = H[inner.coordinate, i] = dot(inner.z, N if inner.turns else F)
        node = inner


def inertia_forces(tree: Tree, rates: ca.SX, accelerations: ca.SX, gravity: ca.SX) -> ca.SX:
    """Return h(q, q', q'') (nq x 1): the joint forces that the motion and the weight need.

    Ground is given the acceleration -g. With A = alpha x + omega x (omega x), inward:
    F = m a_O + A h,  N = I alpha + omega x (I omega) + h x a_O  about O.
    """
    omega = tree.angular_velocities(rates)
    alpha, a = tree.accelerations(omega, rates, accelerations, -gravity)
    forces, moments = [zero() for _ in tree.nodes], [zero() for _ in tree.nodes]
    h_tree = SX.zeros(len(tree.coordinates))
    for node in reversed(tree.nodes):
        i = node.index
        m, h, inertia = base_moments(node)
        w = omega[i]
        forces[i] += m * a[i] + cross(alpha[i], h) + spin(w, h)
        moments[i] += ca.mtimes(inertia, alpha[i]) + cross(w, ca.mtimes(inertia, w)) + cross(h, a[i])
        if node.coordinate is not None:
            h_tree[node.coordinate] = dot(node.z, moments[i] if node.turns else forces[i])
        if node.parent >= 0:
            forces[node.parent] += forces[i]
            moments[node.parent] += moments[i] + cross(node.r, forces[i])
    return h_tree
