"""Task coordinates: what a tool is led in, as functions of its pose, with their derivatives.

    x = c(p, R),    x' = E [omega; v],    x'' = E [alpha; a] + E' [omega; v]

Angles and directions are differentiated along R' = [omega x] R. The rotation vector has its closed
form, which is regular at zero:

    r' = (1 - [r x] / 2 + b [r x]^2) omega,    b = (1 - (t / 2) cot(t / 2)) / t^2,    t = |r|

Where all of rx, ry, rz are asked for, their rows are those of omega itself: errors are then the
rotation vector of R R_d', in which no turn is singular (`model.asked`).
Source: Bonev, Zlatanov & Gosselin 2002 (tilt and torsion); Murray, Li & Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, sec. 2 (exponential coordinates).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np

from linkwork.equations import body_motion
from linkwork.equations.algebra import SX, matrix_quaternion, rotation_matrix
from linkwork.equations.effects import rotation_vector
from linkwork.equations.tree import Tree
from linkwork.mechanism import Tool
from linkwork.mechanism.task import ROTATION, DistanceTo, TaskCoordinate, TurnAbout

NEAR_ZERO = 1e-2  # square of an angle below which series are taken
UPRIGHT = 1e-4  # square of a sine below which series are taken
DETERMINED = 1e-10  # sine and cosine of an angle, by which rounding turns it by a microradian
SWUNG_BY = {"azimuth": "tilt_x", "tilt": "tilt_y"}  # what both together are held by
POSE = 13  # numbers of a pose: position (3), orientation row by row (9), angle in the plane


def whole_rotation(task: Sequence[TaskCoordinate]) -> bool:
    """Tell whether a task asks for all of the rotation vector."""
    return all(name in task for name in ROTATION)


def pointing_of(task: Sequence[TaskCoordinate]) -> tuple[int, int] | None:
    """Return the places of an azimuth and a tilt that are both in a task."""
    both = all(name in task for name in SWUNG_BY)
    return (list(task).index("azimuth"), list(task).index("tilt")) if both else None


def held_task(task: tuple[TaskCoordinate, ...]) -> tuple[TaskCoordinate, ...]:
    """Return the coordinates by which a task is held: tilt (cos azimuth, sin azimuth) instead of an
    azimuth and a tilt that are both in it, regular where the tool is upright, too."""
    if pointing_of(task) is None:
        return task
    return tuple(SWUNG_BY.get(str(item), item) for item in task)


@cache
def task_map(task: tuple[TaskCoordinate, ...]) -> ca.Function:
    """Return (pose, twist) -> x (k), E (k x 6) and E' [omega; v] (k) of task coordinates; pose: as
    POSE says."""
    pose, twist, r = SX.sym("pose", POSE), SX.sym("twist", 6), SX.sym("r", 3)
    p, R, omega, v = pose[:3], ca.reshape(pose[3:12], 3, 3).T, twist[:3], twist[3:]
    parts = [row(item, p, R, r, pose[12], whole_rotation(task)) for item in task]
    x, E = ca.vertcat(*[part[0] for part in parts]), ca.vertcat(*[part[1] for part in parts])
    # What E depends on moves with the tool: the pose itself, and the rotation vector.
    spun = ca.vec(ca.mtimes(ca.skew(omega), R).T)
    moved, moving = ca.vertcat(pose, r), ca.vertcat(v, spun, omega[2], turn_rates(r) @ omega)
    turned = ca.reshape(ca.jtimes(ca.vec(ca.densify(E)), moved, moving), *E.shape)
    found = [x, E, ca.mtimes(turned, twist)]
    own = rotation_vector(matrix_quaternion(R))
    outputs = [ca.densify(part) for part in ca.substitute(found, [r], [own])]
    names = ["pose", "twist"], ["x", "E", "bias"]
    return ca.Function("task", [pose, twist], outputs, *names, {"cse": True})


def at_rest(task: Sequence[TaskCoordinate], pose: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return x (k) and E (k x 6) of task coordinates at a pose (POSE)."""
    x, E, _ = task_map(tuple(task)).call([pose, SX.zeros(6)], True, False)
    return x, E


def mapped_rows(tree: Tree, tool: Tool, task: Sequence[TaskCoordinate]) -> tuple[ca.SX, ca.SX]:
    """Return x (k) and J (k x nv), x' = J w, of a tool's task coordinates; of a whole rotation
    vector rows of omega."""
    J, _ = body_motion.tool_twist(tree, tool, SX.zeros(len(tree.rates)))
    x, E = at_rest(task, ca.vertcat(*body_motion.tool_pose(tree, tool)))
    return x, ca.mtimes(ca.sparsify(E), J)


def row(
    item: TaskCoordinate, p: ca.SX, R: ca.SX, r: ca.SX, angle: ca.SX, whole: bool
) -> tuple[ca.SX, ca.SX]:
    """Return the value of one coordinate and its row of E; whole: rotation vectors by omega."""
    unit = SX.eye(6)
    if item in ("x", "y", "z"):
        k = "xyz".index(str(item))
        return p[k], unit[3 + k, :]
    if item == "angle":
        return angle, unit[2, :]
    if item in ROTATION:
        k = ROTATION.index(str(item))
        return r[k], unit[k, :] if whole else ca.horzcat(turn_rates(r)[k, :], SX.zeros(1, 3))
    if isinstance(item, DistanceTo):
        aside = p - ca.DM(item.point)
        distance = ca.norm_2(aside)
        return distance, ca.horzcat(SX.zeros(1, 3), aside.T / distance)
    value, entries = of_orientation(item, R), ca.vec(R)
    turned = ca.horzcat(*[ca.vec(ca.mtimes(ca.skew(unit[:3, k]), R)) for k in range(3)])
    return value, ca.horzcat(ca.mtimes(ca.jacobian(value, entries), turned), SX.zeros(1, 3))


def of_orientation(item: TaskCoordinate, R: ca.SX) -> ca.SX:
    """Return an angle or a direction of an orientation R; R: symbols."""
    if sine_and_cosine := of_angle(item, R):
        return ca.atan2(*sine_and_cosine)
    u, s2 = R[:, 2], R[0, 2] ** 2 + R[1, 2] ** 2
    if item in ("tilt_x", "tilt_y"):
        return u["xy".index(str(item)[-1])] * angle_over_sine(s2, u[2])
    return u["xyz".index(str(item)[-1])]


def of_angle(item: TaskCoordinate, R: ca.SX) -> tuple[ca.SX, ca.SX] | None:
    """Return what an angle of an orientation has its sine and cosine by, times one number; None
    where it is no angle."""
    if isinstance(item, TurnAbout):
        a = np.array(item.axis) / np.linalg.norm(item.axis)
        R = ca.mtimes(R, rotation_matrix(item.zero).T)
        vee = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
        return ca.dot(a, vee), ca.trace(R) - ca.mtimes([a.reshape(1, 3), R, a])
    match item:
        case "roll":
            return R[2, 1], R[2, 2]
        case "pitch":
            return -R[2, 0], ca.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)
        case "yaw":
            return R[1, 0], R[0, 0]
        case "azimuth":
            return R[1, 2], R[0, 2]
        case "torsion":
            return R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]
        case "tilt":
            return ca.sqrt(R[0, 2] ** 2 + R[1, 2] ** 2), R[2, 2]
        case _:
            return None


def determined(item: TaskCoordinate, task: Sequence[TaskCoordinate], R: ca.SX) -> ca.SX:
    """Tell whether an orientation determines one of the coordinates of a task.

    Roll and yaw are not where the pitch is a quarter turn, azimuth, torsion, tilt_x and tilt_y are
    not where the tilt is half a turn; nor a turn about an axis after half a turn across it. An
    azimuth is not where the tool is upright, unless the tilt, which is zero, is asked for, too: all
    azimuths are right then.
    """
    sine_and_cosine = of_angle("azimuth" if item in SWUNG_BY.values() else item, R)
    if sine_and_cosine is None:
        return SX(1)
    found = ca.hypot(*sine_and_cosine) > DETERMINED
    upright = item in SWUNG_BY.values() or (item == "azimuth" and "tilt" in task)
    return ca.logic_or(found, R[2, 2] > 0) if upright else found


def told(task: tuple[TaskCoordinate, ...], pose: ca.SX) -> ca.SX:
    """Return the values (k) of task coordinates as users are told them, NaN where the pose does not
    determine them."""
    x, _ = at_rest(held_task(task), pose)
    if places := pointing_of(task):
        a, t = places
        swung = x[a], x[t]
        x[a], x[t] = ca.atan2(*reversed(swung)), ca.hypot(*swung)
    R = ca.reshape(pose[3:12], 3, 3).T
    return ca.vertcat(
        *[ca.if_else(determined(item, task, R), x[k], np.nan) for k, item in enumerate(task)]
    )


def angle_over_sine(s2: ca.SX, c: ca.SX) -> ca.SX:
    """Return t / sin t from sin^2 t and cos t, by its series near t = 0."""
    near = ca.logic_and(s2 < UPRIGHT, c > 0)
    series = 1 + s2 / 6 * (1 + s2 * 9 / 20 * (1 + s2 * 25 / 42 * (1 + s2 * 49 / 72)))
    s = ca.sqrt(ca.if_else(near, 1, s2))
    return ca.if_else(near, series, ca.atan2(s, c) / s)


def turn_rates(r: ca.SX) -> ca.SX:
    """Return the matrix (3 x 3) of r' = . omega for a rotation vector r."""
    s, K = ca.sumsqr(r), ca.skew(r)
    near = s < NEAR_ZERO
    t = ca.sqrt(ca.if_else(near, 1, s))
    series = 1 / 12 + s / 720 * (1 + s / 42 * (1 + s / 40))
    b = ca.if_else(near, series, (1 - t / 2 / ca.tan(t / 2)) / t**2)
    return SX.eye(3) - K / 2 + b * ca.mtimes(K, K)
