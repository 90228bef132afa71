"""Accelerations of an open tree by articulated inertias: two passes, whose length grows as the tree
does.

The articulated inertia of a node is what is felt of it, and of all that it carries, where the
joints outward of it are free to move. About the node's origin, for its accelerations:

    [N; F] = [A B; B' C] [alpha; a] + [N_0; F_0]

Inward, each rate with the motion S = [z; s] is solved for its own acceleration and taken out:

    U = [A B; B' C] S,   D = S . U + J,   [A B; B' C] -= U U' / D,   [N_0; F_0] += U (u / D),
    u = tau - S . [N_0; F_0]

and outward these are filled in:  w' = (u - U . [alpha; a]) / D.  The wrenches N_0, F_0 are those of
the motion with w' = 0 under weight and applied wrenches, J is a rotor's inertia. The D are the
pivots of the tree's generalised inertia, eliminated from the leaves inward.

Rounding, a part eps of H, hides of a pivot what the whole motion has that its rate leads: those
outward, free to move, follow by rates x_j. With B_i >= H_ii, but for a small factor,

    dD_k <= eps (B_k + sum_j B_j x_j^2),    x_j = -U_j . [z_k; s_k] / D_j

so that a rate may lead another, whose pivot is small but told, so far that its own is lost. As D is
at least the own body's inertia K, no pair of rates does with (B_j / K_j) (B_k / K_k) below 1 / eps.
Sources: Featherstone 2008, sec. 7.3; Higham 2002, sec. 10.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Number, cross, dot, present, zero
from linkwork.equations.dynamics import Wrenches, along, node_wrench
from linkwork.equations.moments import Moments
from linkwork.equations.orientation import Axes, convert
from linkwork.equations.tree import Column, Node, Tree
from linkwork.mechanism import Mechanism

SURE = 1e12  # product of two rates' B / K up to which rounding hides neither


@dataclass(frozen=True)
class Articulated:
    """Hold an articulated inertia A, B, C (3 x 3 each) and the wrench N_0, F_0 (3 each) about one
    origin, in some axes."""

    A: ca.SX
    B: ca.SX
    C: ca.SX
    N: ca.SX
    F: ca.SX

    def __add__(self, other: Articulated) -> Articulated:
        own, more = vars(self).values(), vars(other).values()
        return Articulated(*[x + y for x, y in zip(own, more, strict=True)])

    def converted(self, source: Axes, target: Axes) -> Articulated:
        """Return the same in other axes."""
        if source is target:
            return self

        def turned(X: ca.SX) -> ca.SX:
            return convert(convert(X, source, target).T, source, target).T

        N, F = (convert(x, source, target) for x in (self.N, self.F))
        return Articulated(
            symmetric(turned(self.A)), turned(self.B), symmetric(turned(self.C)), N, F
        )

    def shifted(self, r: ca.SX) -> Articulated:
        """Return the same about another origin, from which this one's is at r."""
        R = ca.skew(r)
        B = self.B + ca.mtimes(R, self.C)
        A = self.A + ca.mtimes(R, self.B.T).T + ca.mtimes(R, B.T)
        return Articulated(symmetric(A), B, self.C, self.N + cross(r, self.F), self.F)

    def without(
        self, node: Node, column: Column, rotor: Number, tau: ca.SX
    ) -> tuple[Articulated, Solved]:
        """Solve for the acceleration of one rate, and return what is felt inward of it."""
        z = column.z if node.turns else zero()
        s = column.s if node.slides else zero()
        U_N = ca.mtimes(self.A, z) + ca.mtimes(self.B, s)
        U_F = ca.mtimes(self.B.T, z) + ca.mtimes(self.C, s)
        D = dot(z, U_N) + dot(s, U_F) + rotor
        inverse = 1 / D
        V_N, V_F = U_N * inverse, U_F * inverse
        u = tau - along(node, column, self.N, self.F)
        A = symmetric(self.A - ca.mtimes(U_N, V_N.T))
        B, C = self.B - ca.mtimes(U_N, V_F.T), symmetric(self.C - ca.mtimes(U_F, V_F.T))
        # What the rate gives way to is felt by its rotor alone: exactly so along a unit vector.
        if (axis := unit_vector(z)) is not None and not present(s):
            k, J = axis[0], axis[1] * rotor
            A[k, :], A[:, k], B[k, :] = J * V_N.T, J * V_N, J * V_F.T
        elif (axis := unit_vector(s)) is not None and not present(z):
            k, J = axis[0], axis[1] * rotor
            C[k, :], C[:, k], B[:, k] = J * V_F.T, J * V_F, J * V_N
        N, F = self.N + V_N * u, self.F + V_F * u
        return Articulated(A, B, C, N, F), Solved(column.rate, z, s, V_N, V_F, D, u * inverse)


@dataclass(frozen=True)
class Solved:
    """Hold a rate's motion z, s, its acceleration, x - V_N . alpha - V_F . a, and its pivot D."""

    rate: int
    z: ca.SX
    s: ca.SX
    V_N: ca.SX
    V_F: ca.SX
    D: ca.SX
    x: ca.SX


@dataclass(frozen=True)
class Leading:
    """Hold what one rate gives a node's origin: it turns about z and slides along s."""

    rate: int
    z: ca.SX
    s: ca.SX

    def converted(self, source: Axes, target: Axes) -> Leading:
        """Return the same in other axes."""
        return Leading(self.rate, *(convert(x, source, target) for x in (self.z, self.s)))

    def carried(self, node: Node) -> Leading:
        """Return the same at the origin of a node outward, in its column axes."""
        s = self.s + cross(self.z, node.r)
        return Leading(self.rate, self.z, s).converted(node.before, node.column_axes)


def accelerations(
    tree: Tree,
    rates: ca.SX,
    forces: ca.SX,
    rotors: ca.SX,
    bounds: ca.SX,
    heavy: np.ndarray,
    gravity: ca.SX,
    applied: Wrenches,
) -> tuple[ca.SX, ca.SX]:
    """Return w' (nv), and what multiplies rounding in each pivot (nv), (B_k + B_j x_j^2) / D_k
    with the rates next outward, both in the order of the tree's rates.

    rates: w; forces: on the tree's rates, those of joints included; rotors: inertia that they add
    to each rate; applied: as of `inertia_forces`; bounds: B; heavy: B / K
    """
    # Wrenches that hold w' = 0.
    omega = tree.angular_velocities(rates)
    alpha, a = tree.accelerations(omega, rates, None, -gravity)
    felt = [own_inertia(node, omega, alpha, a, applied) for node in tree.nodes]
    # Inward: every rate is solved for, and taken out.
    solved: list[list[Solved]] = [[] for _ in tree.nodes]
    for node in reversed(tree.nodes):
        outer = felt[node.index].converted(node.axes, node.column_axes)
        for column in node.columns:
            outer, own = outer.without(node, column, rotors[column.rate], forces[column.rate])
            solved[node.index].append(own)
        if node.parent >= 0:
            felt[node.parent] += outer.converted(node.column_axes, node.before).shifted(node.r)
    # Outward: accelerations beside those of w' = 0, and what the rate next inward gives here.
    result, pivots, led = SX.zeros(rates.numel()), SX.ones(rates.numel()), SX(bounds)
    alpha, a = ([zero()] * (len(tree.nodes) + 1) for _ in range(2))
    leading: list[Leading | None] = [None] * (len(tree.nodes) + 1)
    # From body to body: what its parent does here, then rate by rate.
    for node in tree.nodes:
        p = node.parent
        carried = a[p] + cross(alpha[p], node.r)
        turn, slide = (convert(x, node.before, node.column_axes) for x in (alpha[p], carried))
        before = leading[p]
        inward = before and before.carried(node)
        for own in reversed(solved[node.index]):
            x = own.x - dot(own.V_N, turn) - dot(own.V_F, slide)
            turn, slide = turn + own.z * x, slide + own.s * x
            result[own.rate], pivots[own.rate] = x, own.D
            if inward and heavy[own.rate] * heavy[inward.rate] > SURE:
                followed = dot(own.V_N, inward.z) + dot(own.V_F, inward.s)
                led[inward.rate] += bounds[own.rate] * followed**2
            inward = Leading(own.rate, own.z, own.s)
        leading[node.index] = inward and inward.converted(node.column_axes, node.axes)
        alpha[node.index], a[node.index] = (
            convert(x, node.column_axes, node.axes) for x in (turn, slide)
        )
    return result, led / pivots


def own_inertia(
    node: Node, omega: list[ca.SX], alpha: list[ca.SX], a: list[ca.SX], applied: Wrenches
) -> Articulated:
    """Return a node's inertia, and the wrench of its motion less the one that is applied."""
    m, h, inertia = node.near_moments
    moment, force = applied.get(node.index, (zero(), zero()))
    N, F = node_wrench(node, omega, alpha, a)
    return Articulated(inertia, ca.skew(h), m * SX.eye(3), N - moment, F - force)


def largest(mechanism: Mechanism, tree: Tree) -> ca.SX:
    """Return bounds (nv) that no configuration of what is carried exceeds, of H_kk of each rate.

    With the mass m carried and k^2 the trace of its inertia about the node's origin, k_parent <= k
    + sqrt(2 m) |r|, and H_kk <= (k |z| + sqrt(m) |s|)^2: numbers where nothing slides.
    """
    masses, radii = [SX(0) for _ in tree.nodes], [SX(0) for _ in tree.nodes]
    found = SX.zeros(len(tree.rates))
    for node in reversed(tree.nodes):
        i = node.index
        if node.body is not None and (body := mechanism.bodies.get(node.body)) is not None:
            own = Moments.of_body(body, node.frame_origin)
            masses[i] += own.m
            radii[i] = ca.sqrt(radii[i] ** 2 + ca.trace(SX(own.I)))
        for column in node.columns:
            turn = ca.norm_2(column.z) if node.turns else 0
            slide = ca.norm_2(column.s) if node.slides else 0
            found[column.rate] = (radii[i] * turn + ca.sqrt(masses[i]) * slide) ** 2
        if (p := node.parent) >= 0:
            masses[p] += masses[i]
            reach = radii[i] + ca.sqrt(2 * masses[i]) * ca.norm_2(node.near_r)
            radii[p] = ca.sqrt(radii[p] ** 2 + reach**2)
    return found


def heaviness(mechanism: Mechanism, tree: Tree, bounds: ca.SX) -> np.ndarray:
    """Return B / K (nv), K the least inertia that a rate's own body has about any axis or along
    any direction; infinite where it is zero or no number."""
    found = np.full(len(tree.rates), np.inf)
    for node in tree.nodes:
        body = None if node.body is None else mechanism.bodies.get(node.body)
        if body is None or len(node.columns) != 1 or node.turns == node.slides:
            continue
        [column] = node.columns
        own = Moments.of_body(body, node.frame_origin)
        K, bound = SX(own.I if node.turns else own.m), bounds[column.rate]
        size = ca.sumsqr(column.z if node.turns else column.s)
        if K.is_constant() and bound.is_constant() and size.is_constant():
            least = np.linalg.eigvalsh(np.array(ca.DM(K)))[0] * float(size)
            found[column.rate] = float(bound) / least if least > 0 else np.inf
    return found


def symmetric(X: ca.SX) -> ca.SX:
    """Return a symmetric matrix with each pair of equal elements as one expression."""
    return ca.triu2symm(ca.triu(ca.densify(X)))


def unit_vector(x: ca.SX) -> tuple[int, float] | None:
    """Return along which axis a vector of length 1 lies, and its sign; None if along none."""
    if not x.is_constant():
        return None
    numbers = np.array(ca.DM(x)).ravel()
    k = int(np.abs(numbers).argmax())
    return (k, numbers.item(k)) if sorted(np.abs(numbers)) == [0.0, 0.0, 1.0] else None
