"""Closure: the rows that a cut joint's type brings, their Jacobian and their bias.

For a cut joint with frames F1, F2 the rows of its kind hold one frame's point and directions in the
other. They are written in the axes of the side whose chain is shorter ("this" side, the other is
"that"): there the last joints' columns are constants or near it, so that eliminating them costs
little and divides by lengths, not by sines.

    position row   phi = e . g                     Phi w = e . v
    direction row  phi = e . f                     Phi w = (f x e) . omega
    screw row      phi = h sin(e . g / h - angle)  Phi w = e . v - h e . omega
    distance row   phi = (g . g - l^2) / (2 l)     Phi w = g . (v_that - v_this) / l

    g = p_that - p_this,  v = v_that - v_this - omega_this x g,  omega = omega_that - omega_this

and with w' = 0 the second derivative of phi leaves the bias gamma, so that  Phi w' + gamma = 0.
Source: the paper, Eqs. (1), (2); Nikravesh 1988, ch. 6 (constraints by vectors).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from linkwork.equations.algebra import (
    SX,
    Number,
    Vector,
    constant,
    cross,
    dot,
    point_acceleration,
    snap,
    spin,
    vector,
    zero,
)
from linkwork.equations.frames import frame_matrix, turned_by
from linkwork.equations.joints import ElementaryMotion, Row, motions_of, rows_of, transversals
from linkwork.equations.orientation import Orientation, convert
from linkwork.equations.tree import Column, Node, Tree, in_axes, in_base
from linkwork.mechanism import Frame, PairJoint


@dataclass(frozen=True)
class Side:
    """Hold one side of a cut joint.

    node: the body's; arm, R_F: joint frame from the node's origin, constant in the body's axes; P,
    R: the same in the ground's.
    """

    node: Node
    arm: Vector
    R_F: Vector
    P: ca.SX
    R: Orientation


@dataclass(frozen=True)
class Cut:
    """Hold a cut joint between `this` side, in whose axes its rows are written, and `that` side.

    open: whether the joint lets the two origins part
    """

    joint: str
    sides: tuple[Side, Side]
    swapped: bool
    motions: tuple[ElementaryMotion, ...]
    rows: tuple[Row, ...]

    @property
    def this(self) -> Side:
        return self.sides[1] if self.swapped else self.sides[0]

    @property
    def that(self) -> Side:
        return self.sides[0] if self.swapped else self.sides[1]

    @property
    def open(self) -> bool:
        return any(motion.slides for motion in self.motions) or any(
            row.length is not None for row in self.rows
        )


def cut(tree: Tree, name: str, joint: PairJoint) -> Cut:
    """Set up a cut joint: its two sides, and its rows along directions that make them sparse."""
    sides = (
        side(tree, joint.connects[0], joint.frames[0]),
        side(tree, joint.connects[1], joint.frames[1]),
    )
    swapped = len(tree.path(sides[1].node)) < len(tree.path(sides[0].node))
    this = sides[1] if swapped else sides[0]
    rows = rows_of(joint, snap(tree.number(this.R_F.T @ tree.number(this.arm))))
    return Cut(
        name,
        sides,
        swapped,
        motions_of(joint),
        tuple(row.exchanged() for row in rows) if swapped else rows,
    )


def side(tree: Tree, body: str, frame: Frame) -> Side:
    node, position, R_F = tree.node(body), vector(frame.position), frame_matrix(frame)
    arm = snap(position - node.frame_origin, tree.length)
    return Side(node, arm, R_F, node.O + in_base(node.R, arm), turned_by(node.R, frame))


def residuals(cut: Cut) -> list[ca.SX]:
    """Return phi of each row [m for positions, 1 for directions]."""
    gap = cut.that.P - cut.this.P
    result = []
    for row in cut.rows:
        e = in_base(cut.this.R, row.e)
        if row.f is not None:
            result.append(dot(e, in_base(cut.that.R, row.f)))
        elif row.length is not None:
            result.append((dot(gap, gap) - row.length**2) / (2 * row.length))
        elif row.pitch is not None:
            advance, c, s = thread(cut, row, row.pitch, gap)
            result.append(row.pitch * (ca.sin(advance) * c - ca.cos(advance) * s))
        else:
            result.append(dot(e, gap))
    return result


def thread(cut: Cut, row: Row, pitch: Number, gap: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return how far a screw has advanced, over its pitch, and cosine and sine of how far it has
    turned."""
    e1, e2 = transversals(row.e, np.zeros(3))
    f1, advance = in_base(cut.that.R, e1), dot(in_base(cut.this.R, row.e), gap) / pitch
    return advance, dot(in_base(cut.this.R, e1), f1), dot(in_base(cut.this.R, e2), f1)


def shared(tree: Tree, cut: Cut) -> set[int]:
    """Return the rates inward of both sides: they move the loop as a whole and enter none of its
    rows."""
    chains = [
        {column.rate for node in tree.path(side.node) for column in node.columns}
        for side in cut.sides
    ]
    return chains[0] & chains[1]


def reaches(
    tree: Tree, cut: Cut, parted: bool = False
) -> Iterator[tuple[int, Column, Node, ca.SX]]:
    """Yield what moves in the loop: sign of the side, column, its node, vector to the joint's point
    in its `column_axes`.

    Where the joint's origins part, or are `parted` in an open loop, both sides take the point of
    that side, as if they were one body's.
    """
    common = shared(tree, cut)
    slip = (
        ca.mtimes(cut.this.node.axes.matrix.T, cut.that.P - cut.this.P)
        if cut.open or parted
        else zero()
    )
    for sign, side, extra in ((-1, cut.this, slip), (1, cut.that, zero())):
        for node, d in tree.reaches(side.node, in_axes(side.node.R, side.arm) + extra):
            for column in node.columns:
                if column.rate not in common:
                    yield sign, column, node, d


def moving(column: Column, node: Node, d: ca.SX) -> ca.SX:
    """Return the velocity z x d + s of a point at d from the node's origin, for a unit rate, in its
    `column_axes`."""
    turn = cross(column.z, d) if node.turns else zero()
    return turn + column.s if node.slides else turn


def jacobian(tree: Tree, cut: Cut) -> ca.SX:
    """Return the rows of Phi (rows x nv, without elements that are zero)."""
    near, every, columns = turning_alike(tree, cut), range(len(cut.rows)), {}
    lines = ca.horzcat(SX(3, 0), *[line(cut, row) for row in cut.rows])
    for sign, column, node, d in reaches(tree, cut):
        own = near.get(node.index) if sign < 0 else None
        here = [k for k in every if own and near_enough(cut, cut.rows[k], column, node)]
        there = [k for k in every if k not in here]
        found = SX.zeros(len(every))
        if own and here:
            found[here] = near_effects(cut, here, column, node, *own)
        if there:
            velocity = moving(column, node, d)
            found[there] = effects(cut, cut.rows, there, lines, column, node, velocity)
        columns[column.rate] = -found if sign < 0 else found
    return arranged(columns, len(every), len(tree.rates))


def open_jacobian(tree: Tree, cut: Cut) -> ca.SX:
    """Return the derivative of phi along the rates (rows x nv, without elements that are zero) also
    where the joint is open (a thread's: to first order)."""
    rows = [replace(row, crossing=row.f is not None) for row in cut.rows]
    lines, columns = ca.horzcat(SX(3, 0), *[line(cut, row) for row in rows]), {}
    for sign, column, node, d in reaches(tree, cut, parted=True):
        velocity = moving(column, node, d)
        found = effects(cut, rows, range(len(rows)), lines, column, node, velocity)
        columns[column.rate] = -found if sign < 0 else found
    return arranged(columns, len(rows), len(tree.rates))


def arranged(columns: Mapping[int, ca.SX], rows: int, width: int) -> ca.SX:
    """Return a sparse matrix (rows x width) of some of its columns."""
    found = SX(rows, width)
    if columns:
        found[:, list(columns)] = ca.sparsify(ca.horzcat(*columns.values()))
    return found


def line(cut: Cut, row: Row) -> ca.SX:
    """Return the direction in which a row allows no motion: f x e where it holds a direction, else
    e, in this side's axes."""
    if row.crossing:
        return crossed(cut, row)[2]
    return in_axes(cut.this.R, row.e if row.f is None else row.moment)


def effects(
    cut: Cut,
    rows: Sequence[Row],
    places: Sequence[int],
    lines: ca.SX,
    column: Column,
    node: Node,
    velocity: ca.SX,
) -> ca.SX:
    """Return what a unit rate does to the rows at some places, up to the sign of the side it is on.

    lines: of all rows (3 x rows); velocity: of the joint's point (`moving`)
    """
    this, axes, turns = cut.this, node.column_axes, node.turns
    e = convert(lines, this.node.axes, axes)
    moved = ca.mtimes(e.T, velocity)
    turned = ca.mtimes(e.T, column.z) if turns else SX.zeros(len(rows))
    found = moved if len(places) == len(rows) else moved[list(places)]
    for place, k in enumerate(places):
        row = rows[k]
        if row.length is not None:
            gap = ca.mtimes(axes.matrix.T, cut.that.P - this.P)
            found[place] = dot(gap, velocity) / row.length
        elif row.f is not None:
            found[place] = turned[k]
        elif row.pitch is not None and turns:
            found[place] -= row.pitch * turned[k]
    return found


def turning_alike(tree: Tree, cut: Cut) -> dict[int, tuple[Vector, ca.SX]]:
    """Return, for the last nodes of this side that differ by constant rotations and slides only, C
    and d by index.

    C: from the node's frame to that of this side's body; d: from the node's origin to the joint, in
    the latter.
    """
    this, found = cut.this.node, {}
    d, near_r = constant(cut.this.arm), zero()
    for node in reversed(tree.path(this)):
        if not node.R.turns_with(this.R):
            break
        C = snap(this.R.right.T @ node.R.right)
        d = d + ca.mtimes(constant(C), near_r)
        found[node.index] = C, d
        near_r = node.near_r
    return found


def near_enough(cut: Cut, row: Row, column: Column, node: Node) -> bool:
    """Tell whether a column's effect on a row can be written in the frame of this side's body."""
    plain = row.length is None and not row.crossing
    fixed = column.local_z is not None and isinstance(cut.this.R_F, np.ndarray)
    return plain and fixed and not (node.turns and cut.open)


def near_effects(
    cut: Cut, places: Sequence[int], column: Column, node: Node, C: Vector, d: ca.SX
) -> ca.SX:
    """Return `effects` in the frame of this side's body, where the rows' directions and the column
    are constant."""
    R_F, rows = cut.this.R_F, [cut.rows[k] for k in places]
    fixed = column.local_z, column.local_s
    z, s = (constant(snap(C @ part)) for part in fixed if part is not None)
    along = constant(np.array([snap(R_F @ row.e) for row in rows]))
    about = constant(np.array([snap(R_F @ row.moment) for row in rows]))
    turned = ca.mtimes(about, z) if node.turns else SX.zeros(len(rows))
    moved = ca.mtimes(along, cross(z, d)) if node.turns else SX.zeros(len(rows))
    if node.slides:
        moved += ca.mtimes(along, s)
    holding_turns = [place for place, row in enumerate(rows) if row.f is not None]
    if holding_turns:
        moved[holding_turns] = turned[holding_turns]
    return moved


def crossed(cut: Cut, row: Row) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return e, f and f x e of a crossing row in this side's axes: e is fixed in this side alone, f
    in that."""
    e, f_that = in_axes(cut.this.R, row.e), in_axes(cut.that.R, np.array(row.f))
    f = convert(f_that, cut.that.node.axes, cut.this.node.axes)
    return e, f, cross(f, e)


def biases(tree: Tree, cut: Cut, rates: ca.SX) -> list[ca.SX]:
    """Return gamma of each row: the second derivative of phi at w' = 0, for rates w that keep the
    loop closed.

    What moves the loop as a whole does not enter, and is held still here. All is written in this
    side's axes.
    """
    # Rates, angular velocities and accelerations on this loop alone, at w' = 0.
    this, that, common = cut.this, cut.that, shared(tree, cut)
    inward = {node.index for side in cut.sides for node in tree.path(side.node)}
    nodes = [tree.nodes[index] for index in sorted(inward)]
    inner = [column.rate for node in nodes for column in node.columns]
    own = {rate: SX(0) if rate in common else rates[rate] for rate in inner}
    omega = tree.angular_velocities(own, nodes)
    alpha, a = tree.accelerations(omega, own, None, zero(), nodes)
    i, j = this.node.index, that.node.index

    def here(x: ca.SX) -> ca.SX:
        return convert(x, that.node.axes, this.node.axes)

    # a = a_j + alpha x d + omega x (omega x d) of the point on that side; turns relative to this
    # side.
    d = in_axes(that.node.R, that.arm)
    a_that = here(point_acceleration(a[j], omega[j], alpha[j], d))
    omega_j, alpha_j = here(omega[j]), here(alpha[j])
    turning = alpha_j - alpha[i] - cross(omega[i], omega_j)
    result = []
    for row in cut.rows:
        # (f x e)' (omega_j - omega_i), differentiated.
        if row.crossing:
            e, f, moment = crossed(cut, row)
            rate = cross(cross(omega_j, f), e) + cross(f, cross(omega[i], e))
            result.append(dot(moment, alpha_j - alpha[i]) + dot(rate, omega_j - omega[i]))
        # Rows that hold a turn.
        elif row.f is not None:
            result.append(dot(in_axes(this.R, row.moment), turning))
        elif cut.open:
            v = tree.velocities(omega, own, nodes)
            v_that = here(v[j] + cross(omega[j], d))
            side = omega[i], alpha[i], v_that - v[i], a_that - a[i]
            result.append(open_bias(cut, row, *side, turning))
        else:
            # e' (a_that - a_this), the arm's part taken in the body, where it is constant.
            to_body, arm = this.node.R.near.T, SX(this.arm)
            local = cross(ca.mtimes(to_body, alpha[i]), arm) + spin(
                ca.mtimes(to_body, omega[i]), arm
            )
            result.append(
                dot(in_axes(this.R, row.e), a_that - a[i])
                - dot(constant(snap(this.R_F @ row.e)), local)
            )
    return result


def open_bias(
    cut: Cut, row: Row, omega: ca.SX, alpha: ca.SX, v: ca.SX, a: ca.SX, turning: ca.SX
) -> ca.SX:
    """Return gamma of a row of a joint whose origins part: omega, alpha of this side, v, a of that
    point less its node's."""
    this = cut.this
    gap = ca.mtimes(this.node.axes.matrix.T, cut.that.P - this.P)
    d = in_axes(this.node.R, this.arm)
    if row.length is not None:
        apart = v - cross(omega, d)
        return (dot(apart, apart) + dot(gap, a - cross(alpha, d) - spin(omega, d))) / row.length
    d, e = d + gap, in_axes(this.R, row.e)
    slide = v - cross(omega, d)
    bias = dot(e, a - cross(alpha, d) - spin(omega, d) - 2 * cross(omega, slide))
    return bias - row.pitch * dot(e, turning) if row.pitch is not None else bias


def alignment(cut: Cut) -> ca.SX:
    """Return a number that is positive where the two frames agree and negative where a direction is
    flipped by pi.

    Rows that hold a direction or a thread vanish for a flipped frame too, so Newton's method may
    end there; this tells the two apart.
    """
    products = [SX(1)]
    for row in cut.rows:
        if row.f is not None and not row.crossing:
            products.append(dot(in_base(cut.this.R, row.f), in_base(cut.that.R, row.f)))
        if row.pitch is not None:
            advance, c, s = thread(cut, row, row.pitch, cut.that.P - cut.this.P)
            products.append(ca.cos(advance) * c + ca.sin(advance) * s)
    return ca.mmin(ca.vertcat(*products))


def universal(cut: Cut) -> bool:
    """Tell whether the joint turns about two axes, so that none of its directions has to agree."""
    return sum(motion.turns for motion in cut.motions) == 2
