"""Rows of what is asked of a mechanism, in expressions: how far coordinates of joints or of a tool
are from the values asked for, and how rates change them.

    x(q) - y = 0,    x' = J w        turns the short way round
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import SX, matrix_quaternion
from linkwork.equations.effects import rotation_vector
from linkwork.equations.task import mapped_rows, whole_rotation
from linkwork.mechanism.task import ROTATION, TaskCoordinate, is_angle


class Rows(NamedTuple):
    """Hold rows of what is asked: J (rows x nv), the values y that are asked for, and how far x(q)
    is from them."""

    J: ca.SX
    target: ca.SX
    error: ca.SX


def joint_rows(equations: Equations, names: Sequence[str], angular: Sequence[bool]) -> Rows:
    """Return the rows of joint coordinates that have a rate of their own; angular: which are
    angles."""
    joints, y = equations.joints, SX.sym("y", len(names))
    differences = [joints.position(name) - y[k] for k, name in enumerate(names)]
    errors = [
        short_way(difference) if turns and name not in equations.tree.coordinates else difference
        for name, turns, difference in zip(names, angular, differences, strict=True)
    ]
    return Rows(joints.rate_rows(names), y, ca.vertcat(SX(0, 1), *errors))


def tool_rows(equations: Equations, task: Sequence[TaskCoordinate]) -> Rows:
    """Return the rows of task coordinates of the tool.

    Where all of the rotation vector is asked for, its rows are those of the turn from the wanted
    orientation.
    """
    tool = equations.mechanism.first_tool
    orientation, y = body_motion.tool_pose(equations.tree, tool).orientation, SX.sym("y", len(task))
    x, _ = mapped_rows(equations.tree, tool, task)
    errors = [
        short_way(x[k] - y[k]) if is_angle(item) else x[k] - y[k] for k, item in enumerate(task)
    ]
    if whole_rotation(task):
        places = [list(task).index(name) for name in ROTATION]
        R = ca.mtimes(ca.reshape(orientation, 3, 3).T, exponential(y[places]).T)
        error = rotation_vector(matrix_quaternion(R))
        for place, part in zip(places, ca.vertsplit(error), strict=True):
            errors[place] = part
    return Rows(task_rows(equations, task), y, ca.vertcat(*errors))


def task_rows(equations: Equations, task: Sequence[TaskCoordinate]) -> ca.SX:
    """Return the task Jacobian J (k x nv), x' = J w; of a whole rotation vector rows of omega."""
    return mapped_rows(equations.tree, equations.mechanism.first_tool, task)[1]


def straight_part(begin: ca.SX, y: ca.SX, part: ca.SX, wraps: np.ndarray) -> ca.SX:
    """Return values at a part of the straight way; wraps: which turn the short way (rows)."""
    error = begin - y
    turns = ca.floor((error + np.pi) / (2 * np.pi))
    return begin - part * (error - 2 * np.pi * ca.DM(wraps.astype(float)) * turns)


def short_way(angle: ca.SX) -> ca.SX:
    """Return an angle [rad] between -pi and pi."""
    return ca.atan2(ca.sin(angle), ca.cos(angle))


def vector_quaternion(r: ca.SX) -> ca.SX:
    """Return the unit quaternion (w, x, y, z) of a rotation vector."""
    t = ca.sqrt(ca.sumsqr(r) + 1e-300)
    return ca.vertcat(ca.cos(t / 2), ca.sin(t / 2) / t * r)


def quaternion_product(p: ca.SX, other: ca.SX) -> ca.SX:
    """Return the quaternion (w, x, y, z) of one turn after another."""
    w, u, v = p[0], p[1:], other[1:]
    turned = w * v + other[0] * u + ca.cross(u, v)
    return ca.vertcat(w * other[0] - ca.dot(u, v), turned)


def exponential(r: ca.SX) -> ca.SX:
    """Return R = exp([r x]) of a rotation vector."""
    square_length = ca.sumsqr(r)
    t = ca.sqrt(square_length + 1e-300)
    K = ca.skew(r)
    return SX.eye(3) + ca.sin(t) / t * K + 2 * (ca.sin(t / 2) / t) ** 2 * ca.mtimes(K, K)
