"""Errors in task coordinates: how far a tool is from its goal, and how that depends on what drives
it.

Of coordinates x with the goal x_d, angles the short way round:

    e = x_d - x,    e' = x_d' - A v,    e'' = x_d'' - beta - A v',        x'' = A v' + beta

Of a whole orientation R with the goal R_d, e is the rotation vector of R_e = R_d R', in the axes of
the ground, of length at most pi; with e' = B(e) w_e as in `equations.task`:

    w_e = w_d - R_e w,    e'' = B (a_d - w_e x R_e w - R_e a) + B' w_e

Both have the form  e'' = r - A_e v',  so that  A_e v' = r + Kd e' + Kp e  gives  e'' + Kd e' + Kp e
= 0  in the task's own coordinates, turns of any size about any axis included. Forces A_e' (Kp e +
Kd e') are those of springs with the potential e' Kp e / 2 and of dampers in these coordinates.

Source: Khatib, IEEE J. Robotics and Automation 3 (1987) 43-53 (operational space); Bullo & Murray,
Automatica 35 (1999) 17-34 (errors on the rotation group).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from linkwork.control.task_goals import Task
from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import SX, matrix_quaternion, quaternion_map, quaternion_matrix
from linkwork.equations.effects import rotation_vector
from linkwork.equations.task import held_task, pointing_of, task_map, turn_rates, whole_rotation
from linkwork.mechanism.task import ROTATION, is_angle

NEAR_ZERO = 1e-2  # square of an angle below which series are taken
COSINE = (1.0, -1 / 8, 1 / 384, -1 / 46080, 1 / 10321920, -1 / 3715891200)
SINE = (1 / 2, -1 / 48, 1 / 3840, -1 / 645120, 1 / 185794560, -1 / 81749606400)


@dataclass(frozen=True, eq=False)
class TaskError:
    """Hold e, e', A_e (k x n) and r (k) of e'' = r - A_e v'."""

    error: ca.SX
    rates: ca.SX
    A: ca.SX
    rest: ca.SX


@dataclass(frozen=True, eq=False)
class WantedMotion:
    """Hold y, y', y'' (k, zero where an orientation is wanted as a whole), R_d, w_d and a_d."""

    y: ca.SX
    dy: ca.SX
    ddy: ca.SX
    R: ca.SX
    omega: ca.SX
    alpha: ca.SX


def task_error(equations: Equations, task: Task, columns: list[ca.SX], told: bool) -> TaskError:
    """Return the error of a tool as a function of q and v of a chart.

    columns: of a goal (`task_goals`) with their first and second derivatives; told: how they are
    """
    held, goal = held_task(task), wanted(task, columns, told)
    # The tool moves by t' = J (L v' + b) + J' L v, its coordinates by x'' = A v' + beta.
    tool, rates = equations.mechanism.first_tool, equations.rates
    J, bias = body_motion.tool_twist(equations.tree, tool, rates)
    L, b, _ = equations.elimination
    pose, twist = ca.vertcat(*body_motion.tool_pose(equations.tree, tool)), ca.mtimes(J, rates)
    x, E, turning = task_map(held).call([pose, twist], True, False)
    E = ca.sparsify(E)
    A, beta = ca.mtimes(E, ca.mtimes(J, L)), ca.mtimes(E, ca.mtimes(J, b) + bias) + turning
    # Each coordinate for itself.
    e, de, rest = goal.y - x, goal.dy - ca.mtimes(E, twist), goal.ddy - beta
    for place, item in enumerate(held):
        if is_angle(item):
            e[place] = ca.atan2(ca.sin(e[place]), ca.cos(e[place]))
    if not whole_rotation(held):
        return TaskError(e, de, A, rest)
    # An orientation as a whole.
    places = [held.index(name) for name in ROTATION]
    R_e = ca.mtimes(goal.R, ca.reshape(pose[3:12], 3, 3))
    turned = ca.mtimes(R_e, twist[:3])
    w, r = goal.omega - turned, SX.sym("r", 3)
    e[places] = rotation_vector(matrix_quaternion(R_e))
    B = turn_rates(e[places])
    de[places] = ca.mtimes(B, w)
    dB = ca.reshape(ca.jtimes(ca.vec(turn_rates(r)), r, de[places]), 3, 3)
    (dB,) = ca.substitute([dB], [r], [e[places]])
    own = goal.alpha - ca.cross(w, turned) - ca.mtimes(R_e, beta[places])
    rest[places] = ca.mtimes(B, own) + ca.mtimes(dB, w)
    A[places, :] = ca.mtimes(B, ca.mtimes(R_e, A[places, :]))
    return TaskError(e, de, A, rest)


def wanted(task: Task, columns: list[ca.SX], told: bool) -> WantedMotion:
    """Return what columns of a goal and their derivatives ask for."""
    held, whole = held_task(task), whole_rotation(task)
    count = len(task) + (0 if told or not whole else 1)
    c, dc, ddc = (SX.sym(f"{'d' * order}c", count) for order in range(3))
    apart = [k for k, item in enumerate(task) if not (whole and item in ROTATION)]
    source = c if told else ca.vertcat(*[c[place] for place in range(len(apart))], SX(0, 1))
    y = SX.zeros(len(held), 1)
    for place, k in enumerate(apart):
        y[k] = source[k if told else place]
    if told and (pointing := pointing_of(task)):
        azimuth, tilt = (c[place] for place in pointing)
        y[pointing[0]], y[pointing[1]] = tilt * ca.cos(azimuth), tilt * ca.sin(azimuth)
    p = SX([1, 0, 0, 0])
    if whole:
        p = (
            vector_quaternion(c[[task.index(name) for name in ROTATION]])
            if told
            else c[len(apart) :] / ca.norm_2(c[len(apart) :])
        )
    (dy, ddy), (dp, ddp) = along(y, c, dc, ddc), along(p, c, dc, ddc)
    turning = 4 * quaternion_map(p).T  # p' = map(p) w / 2 ..., p'' likewise but for what is along p
    found = [y, dy, ddy, quaternion_matrix(p), ca.mtimes(turning, dp), ca.mtimes(turning, ddp)]
    return WantedMotion(*ca.substitute(found, [c, dc, ddc], columns))


def along(y: ca.SX, x: ca.SX, dx: ca.SX, ddx: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return y' and y'' of a function y of x."""
    dy = ca.jtimes(y, x, dx)
    return dy, ca.jtimes(dy, x, dx) + ca.jtimes(y, x, ddx)


def vector_quaternion(r: ca.SX) -> ca.SX:
    """Return the quaternion (cos(t / 2), sin(t / 2) r / t) of a rotation vector of length t, smooth
    at zero."""
    s = ca.sumsqr(r)
    near = s < NEAR_ZERO
    t = ca.sqrt(ca.if_else(near, 1, s))
    cosine, sine = (
        sum((factor * s**power for power, factor in enumerate(series)), SX(0))
        for series in (COSINE, SINE)
    )
    w = ca.if_else(near, cosine, ca.cos(t / 2))
    return ca.vertcat(w, ca.if_else(near, sine, ca.sin(t / 2) / t) * r)
