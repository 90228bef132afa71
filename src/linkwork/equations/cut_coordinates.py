"""Readings: the coordinates and rates of a joint that closes a loop, read off the poses of its two
sides.

With F1, F2 the joint's frames, g = p_2 - p_1, omega = omega_2 - omega_1 and v = v_2 - v_1 - omega_1
x g:

    slide along a      q = a . g                        w = a . v
    turn about a       q = angle of F2 in F1 about a    w = a . omega
    free turn          p = quaternion of R_12           w = omega in F1's axes

A universal joint turns about a in F1 and about b in F2: its first angle is that of b about a, its
second that of a about b, and its rates are a . omega and b . omega, for a and b are perpendicular.
A screw's angle is its advance over its pitch.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, dot, inner, matrix_quaternion, zero
from linkwork.equations.closure import Cut, Side, moving, reaches, universal
from linkwork.equations.joints import transversals
from linkwork.equations.tree import Tree, in_base


def jump(cut: Cut) -> bool:
    """Tell whether a coordinate is an angle read by the arc tangent, which forgets whole turns."""
    turns = [
        motion for motion in cut.motions if motion.turns and not motion.ball and not motion.slides
    ]
    return bool(turns) and (universal(cut) or cut.sides[1].R.angle_from(cut.sides[0].R) is None)


def positions(cut: Cut) -> list[ca.SX]:
    """Return a cut joint's coordinates [rad, m, 1]."""
    first, second = cut.sides
    gap = second.P - first.P
    result = []
    for motion in cut.motions:
        if motion.ball:
            result += ca.vertsplit(matrix_quaternion(ca.mtimes(first.R.matrix.T, second.R.matrix)))
        elif motion.slides:
            along = motion.slide / inner(motion.slide, motion.slide)
            result.append(dot(in_base(first.R, along), gap))
        elif universal(cut):
            a, b = (part.turn for part in cut.motions)
            result.append(
                angle(first, a, b, second, b)
                if motion.turn is a
                else -angle(second, b, a, first, a)
            )
        else:
            result.append(turned(first, second, motion.turn))
    return result


def turned(first: Side, second: Side, axis: np.ndarray) -> ca.SX:
    """Return the angle of F2 in F1 about an axis of both, without a jump where the two turn about
    one axis in space."""
    difference = second.R.angle_from(first.R)
    if difference is not None:
        along = float(np.dot(first.R.right @ axis, first.R.axis))
        return difference if along > 0 else -difference
    e1, _ = transversals(axis, np.zeros(3))
    return angle(first, axis, e1, second, e1)


def angle(side: Side, axis: np.ndarray, start: np.ndarray, other: Side, end: np.ndarray) -> ca.SX:
    """Return the angle about an axis of one side from a direction `start` of it to a direction
    `end` of the other."""
    f = in_base(other.R, end)
    return ca.atan2(dot(in_base(side.R, np.cross(axis, start)), f), dot(in_base(side.R, start), f))


def rate_rows(tree: Tree, cut: Cut) -> ca.SX:
    """Return the rows (rates of the joint x nv) that give a cut joint's rates from the tree's."""
    first, second = cut.sides
    gap = second.P - first.P
    directions = []
    for motion in cut.motions:
        if motion.ball:
            directions += [(in_base(first.R, e), True) for e in np.eye(3)]
        elif motion.turns:
            side = second if universal(cut) and motion.turn is not cut.motions[0].turn else first
            directions.append((in_base(side.R, motion.turn), True))
        else:
            directions.append((in_base(first.R, motion.slide), False))
    rows = SX(len(directions), len(tree.rates))
    offset = gap if cut.open and cut.swapped else zero()
    for sign, column, node, d in reaches(tree, cut):
        to_ground = node.column_axes.matrix
        d = d + ca.mtimes(to_ground.T, offset)
        for k, (axis, turns) in enumerate(directions):
            motion = (column.z if node.turns else zero()) if turns else moving(column, node, d)
            rows[k, column.rate] = (-sign if cut.swapped else sign) * dot(
                axis, ca.mtimes(to_ground, motion)
            )
    return rows
