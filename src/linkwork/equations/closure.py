"""Closure: the rows that a cut joint's type brings, their Jacobian and their bias.

For a cut joint with frames F1, F2 the rows of its kind hold one frame's point and directions in the other. They are
written in the axes of the side whose chain is shorter ("this" side, the other is "that"): there the last joints'
columns are constants or near it, so that eliminating them costs little and divides by lengths, not by sines.

    position row    phi = e . (p_that - p_this)     Phi q' = e . (v_that - v_this - omega_this x (p_that - p_this))
    direction row   phi = e . f                     Phi q' = (f x e) . (omega_that - omega_this)

and with q'' = 0 the second derivative of phi leaves the bias gamma, so that  Phi q'' + gamma = 0.
Source: the paper, Eqs. (1), (2); Nikravesh 1988, ch. 6 (constraints by vectors).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, cross, dot, rotation_matrix, snap, spin, zero
from linkwork.equations.joints import KINDS, Row, transversals
from linkwork.equations.orientation import Orientation
from linkwork.equations.tree import Node, Tree, in_base
from linkwork.mechanism import Frame, Mechanism


@dataclass(frozen=True)
class Side:
    """Hold one side of a cut joint.

    node: the body's; arm, R_F: joint frame from the node's origin, constant in the body's axes; P, R: the same in the
    ground's.
    """

    node: Node
    arm: np.ndarray
    R_F: np.ndarray
    P: ca.SX
    R: Orientation


@dataclass(frozen=True)
class Cut:
    """Hold a cut joint between `this` side, in whose axes its rows are written, and `that` side."""

    joint: str
    sides: tuple[Side, Side]
    swapped: bool
    rows: tuple[Row, ...]
    slides: bool

    @property
    def this(self) -> Side:
        return self.sides[1] if self.swapped else self.sides[0]

    @property
    def that(self) -> Side:
        return self.sides[0] if self.swapped else self.sides[1]


def cut(mechanism: Mechanism, tree: Tree, name: str) -> Cut:
    """Set up a cut joint: its two sides, and its rows along directions that make them sparse."""
    joint = mechanism.joints[name]
    sides = (side(tree, joint.connects[0], joint.frames[0]), side(tree, joint.connects[1], joint.frames[1]))
    swapped = len(tree.path(sides[1].node)) < len(tree.path(sides[0].node))
    this = sides[1] if swapped else sides[0]
    kind = KINDS[joint.type]
    rows = kind.rows(joint, snap(this.R_F.T @ this.arm))
    return Cut(name, sides, swapped, rows, any(not motion.turns for motion in kind.motions(joint)))


def side(tree: Tree, body: str, frame: Frame) -> Side:
    node, position, R_F = tree.node(body), np.array(frame.position), rotation_matrix(frame.rotation)
    arm = snap(position - node.frame_origin)
    return Side(node, arm, R_F, node.O + in_base(node.R, arm), node.R.then_constant(R_F))


def residuals(cut: Cut) -> list[ca.SX]:
    """Return phi of each row [m for positions, 1 for directions]."""
    gap = cut.that.P - cut.this.P
    return [dot(in_base(cut.this.R, row.e), gap if row.f is None else in_base(cut.that.R, row.f)) for row in cut.rows]


def shared(tree: Tree, cut: Cut) -> set[int]:
    """Return the coordinates inward of both sides: they move the loop as a whole and enter none of its rows."""
    chains = [{node.coordinate for node in tree.path(side.node)} for side in cut.sides]
    return {coordinate for coordinate in chains[0] & chains[1] if coordinate is not None}


def reaches(tree: Tree, cut: Cut) -> Iterator[tuple[int, int, Node, ca.SX]]:
    """Yield the moving nodes of the loop: sign of their side, coordinate, node, vector to the joint's point on that side.

    Where the joint slides both sides take the point of that side.
    """
    common = shared(tree, cut)
    slip = cut.that.P - cut.this.P if cut.slides else zero()
    for sign, side, extra in ((-1, cut.this, slip), (1, cut.that, zero())):
        for node, d in tree.reaches(side.node, in_base(side.node.R, side.arm) + extra):
            if node.coordinate is not None and node.coordinate not in common:
                yield sign, node.coordinate, node, d


def jacobian(tree: Tree, cut: Cut) -> ca.SX:
    """Return the rows of Phi (rows x nq)."""
    Phi = SX.zeros(len(cut.rows), len(tree.coordinates))
    for sign, coordinate, node, d in reaches(tree, cut):
        for k, row in enumerate(cut.rows):
            Phi[k, coordinate] = sign * column(cut, row, node, d)
    return Phi


def column(cut: Cut, row: Row, node: Node, d: ca.SX) -> ca.SX:
    """Return what a unit rate of one joint does to a row, up to the sign of the side it is on.

    For the last joint of this side everything is constant in the body's axes, and so is the result.
    """
    this = cut.this
    own = node.index == this.node.index and not (node.turns and cut.slides)
    z = SX(node.local_z) if own else node.z
    if row.f is not None:
        moment = SX(snap(this.R_F @ row.moment)) if own else in_base(this.R, row.moment)
        return dot(moment, z) if node.turns else SX(0)
    e = SX(snap(this.R_F @ row.e)) if own else in_base(this.R, row.e)
    return dot(e, cross(z, SX(this.arm) if own else d) if node.turns else z)


def biases(tree: Tree, cut: Cut, rates: ca.SX) -> list[ca.SX]:
    """Return gamma of each row: the second derivative of phi at q'' = 0, for rates q' that keep the loop closed.

    What moves the loop as a whole does not enter, and is held still here.
    """
    rates = SX(rates)
    for coordinate in shared(tree, cut):
        rates[coordinate] = 0
    omega = tree.angular_velocities(rates)
    alpha, a = tree.accelerations(omega, rates, SX.zeros(rates.numel()), zero())
    this, that = cut.this, cut.that
    i, j = this.node.index, that.node.index
    d = in_base(that.node.R, that.arm)
    a_that = a[j] + cross(alpha[j], d) + spin(omega[j], d)
    turning = alpha[j] - alpha[i] - cross(omega[i], omega[j])
    result = []
    for row in cut.rows:
        if row.f is not None:
            result.append(dot(in_base(this.R, row.moment), turning))
            continue
        e = in_base(this.R, row.e)
        if cut.slides:
            d_this = in_base(this.node.R, this.arm) + that.P - this.P
            v = tree.velocities(omega, rates)
            v_slide = v[j] + cross(omega[j], d) - v[i] - cross(omega[i], d_this)
            a_this = a[i] + cross(alpha[i], d_this) + spin(omega[i], d_this) + 2 * cross(omega[i], v_slide)
            result.append(dot(e, a_that - a_this))
        else:
            to_body = this.node.R.matrix.T
            local = cross(ca.mtimes(to_body, alpha[i]), SX(this.arm)) + spin(ca.mtimes(to_body, omega[i]), SX(this.arm))
            result.append(dot(e, a_that - a[i]) - dot(SX(snap(this.R_F @ row.e)), local))
    return result


def coordinate(cut: Cut, axis: np.ndarray, turns: bool) -> ca.SX:
    """Return a cut joint's coordinate [rad, m] from the pose of its second frame in its first."""
    first, second = cut.sides
    if not turns:
        return dot(in_base(first.R, axis), second.P - first.P)
    angle = second.R.angle_from(first.R)
    if angle is not None:
        along = float(np.dot(first.R.right @ axis, first.R.axis))
        return angle if along > 0 else -angle
    e1, e2 = transversals(axis, np.zeros(3))
    f1 = in_base(second.R, e1)
    return ca.atan2(dot(in_base(first.R, e2), f1), dot(in_base(first.R, e1), f1))


def rate_row(tree: Tree, cut: Cut, axis: np.ndarray, turns: bool) -> ca.SX:
    """Return the row (1 x nq) that gives a cut joint's rate from the tree's rates."""
    row = SX.zeros(1, len(tree.coordinates))
    z = in_base(cut.sides[0].R, axis)
    for sign, coordinate, node, d in reaches(tree, cut):
        turning, moving = (node.z, cross(node.z, d)) if node.turns else (zero(), node.z)
        row[coordinate] += (-sign if cut.swapped else sign) * dot(z, turning if turns else moving)
    return row


def alignment(cut: Cut) -> ca.SX:
    """Return a number that is positive where the two frames agree and negative where a direction is flipped by pi.

    Direction rows vanish for a flipped frame too, so Newton's method may end there; this tells the two apart.
    """
    agreeing = [row.f for row in cut.rows if row.f is not None]
    products = [dot(in_base(cut.this.R, f), in_base(cut.that.R, f)) for f in agreeing]
    return ca.mmin(ca.vertcat(*products)) if products else SX(1)
