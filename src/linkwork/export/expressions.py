"""The functions that are written straight from the equations, as CasADi functions.

Each ends with the weakest relative pivot where it goes through the chart's elimination. Matrices
are row by row, as arrays of C are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import prod

import casadi as ca
import numpy as np

from linkwork.equations import body_motion, functions, uncharted
from linkwork.equations.algebra import SX, matrix_quaternion
from linkwork.equations.chart import Chart
from linkwork.equations.effects import rotation_vector
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.equations import Equations, conditions
from linkwork.equations.symmetric import solve_symmetric
from linkwork.equations.task import task_map
from linkwork.equations.tree import Tree
from linkwork.errors import LinkworkError
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.mechanism.sticking import require_no_bristles
from linkwork.mechanism.task import labels
from linkwork.model.actuation import DRIVEN, undriven
from linkwork.model.asked import ToolAsked
from linkwork.model.closing import LONGEST
from linkwork.model.modes import ModeStage, modes_of
from linkwork.model.task import task_of
from linkwork.robot import Robot


def motion(robot: Robot) -> ca.Function:
    """Return (q, v, u) -> dq, dv, pivot."""
    return functions.motion(robot.equations)


def inverse_dynamics(robot: Robot) -> ca.Function:
    """Return (q, v, dv) -> u, pivot: the forces of least sum of squares that give dv."""
    return actuator_forces(robot, robot.equations)


def actuator_forces(robot: Robot, equations: Equations) -> ca.Function:
    """Return the same in any chart."""
    own = functions.inverse_dynamics(equations)
    dv = SX.sym("dv", equations.mobility)
    forces, pivot = own(equations.tree.q, equations.v, dv, equations.p)
    if robot.actuators != equations.independent:
        require_driven(robot, equations)
        S = equations.actuation
        forces = ca.mtimes(S, solve_symmetric(ca.mtimes(S.T, S), forces))
    outputs = {"u": forces, "pivot": pivot}
    return functions.function("inverse_dynamics", equations, outputs, v=equations.v, dv=dv)


def mass_matrix(robot: Robot) -> ca.Function:
    """Return q -> M, pivot."""
    equations = robot.equations
    outputs = {"M": equations.inertia[0], "pivot": equations.elimination.pivot}
    return functions.function("mass_matrix", equations, outputs)


def jacobian(robot: Robot) -> ca.Function:
    """Return q -> J row by row, pivot: x' = J v in the tool's task coordinates."""
    equations = robot.equations
    J = ca.vec(task_jacobian(robot, equations).T)
    outputs = {"J": J, "pivot": equations.elimination.pivot}
    return functions.function("jacobian", equations, outputs)


def task_jacobian(robot: Robot, equations: Equations) -> ca.SX:
    """Return J (k x n) of x' = J v in the tool's task coordinates."""
    robot.require_tool()
    tool = equations.mechanism.first_tool
    twist, _ = body_motion.tool_twist(equations.tree, tool, equations.rates)
    pose = ca.vertcat(*body_motion.tool_pose(equations.tree, tool))
    E = task_map(task_of(robot))(pose, SX.zeros(6))[1]
    return ca.densify(ca.mtimes(E, ca.mtimes(twist, equations.elimination.L)))


def closure(robot: Robot) -> ca.Function:
    """Return q -> phi, and the largest |phi| in the mechanism's own units."""
    equations = robot.equations
    outputs = {"phi": equations.rows.phi, "gap": conditions(equations)}
    return functions.function("closure", equations, outputs)


def require_driven(robot: Robot, equations: Equations) -> None:
    """Refuse inverse dynamics where actuators do not drive all independent rates at home, or are
    others and load what rubs."""
    if robot.actuators == equations.independent:
        return
    S = robot.actuation(robot.home)
    values = np.linalg.svd(S, compute_uv=False)
    if (values > DRIVEN * values.max(initial=0.0)).sum() < robot.mobility or robot.idle:
        raise LinkworkError(
            "inverse_dynamics is not defined: the actuators do not drive "
            f"{', '.join(undriven(S, robot.independent))}; leave it out of the functions, or add "
            "actuators"
        )
    if {*robot.actuators} != {*equations.independent}:
        require_no_bearings(
            robot.mechanism.joints,
            "inverse_dynamics whose actuators are not its independent rates leaves out",
            "leave it out of the functions, or drive the independent rates",
        )


def closing(robot: Robot) -> ca.Function:
    """Return q -> q after a Newton step of the dependent coordinates, the gap before it, the length
    of the step in own units, and the weakest determinant of the elimination, relative: from
    quaternions of length 1 on, for which phi is to be closed."""
    equations = robot.equations
    tree, rows = equations.tree, equations.rows
    step, pivots = solve(equations.chart, rows.Phi, -rows.phi)
    w = equations.scatter(step, SX.zeros(equations.mobility, 1))
    outputs = {
        "next": unit(tree, tree.q + tree.derivatives(w)),
        "gap": conditions(equations, partial(unit, tree)),
        "length": unit(tree, largest(w * ca.DM(1 / tree.rate_units))),
        "pivot": unit(tree, weakest_stage(equations.chart, pivots)),
    }
    return functions.function("closing", equations, outputs)


def approaching(robot: Robot) -> ca.Function:
    """Return (q, x, left) -> q after a Newton step towards closed loops and the part of the way
    that is left to the tool's coordinates x, and of before it: the residual, the step's length, the
    weakest determinant, and the error of the coordinates."""
    robot.require_tool()
    equations, task = robot.equations, task_of(robot)
    tree, rows = equations.tree, equations.rows
    asked = ToolAsked(task, tree.length, robot.planar)
    modes = modes_of(equations, robot.p, asked)
    if (order := modes.chart) is None:
        raise LinkworkError(
            f"tool_to_joints is not defined: the tool's {', '.join(labels(task))} do not determine "
            "the motion of all joints; leave it out of the functions, or name another task"
        )
    x, left = SX.sym("x", len(task)), SX.sym("left", len(task))
    J, error = led_to(asked, equations, x)
    residual = ca.vertcat(rows.phi, error - left)
    found, pivots = solve(order, ca.vertcat(rows.Phi, J), -residual)
    w = ca.vertcat(*[found[k] for k in range(equations.nv)])
    length = largest(w * ca.DM(1 / tree.rate_units))
    q = tree.q + tree.derivatives(w * (1 / ca.fmax(1, length / LONGEST)))
    heights = np.concatenate([rows.units, asked.units])
    gap = largest(ca.vertcat(residual * ca.DM(1 / heights), rows.excess))
    outputs = {
        "next": unit(tree, q),
        "gap": largest(ca.vertcat(unit(tree, gap), *tree.norms())),
        "length": unit(tree, length),
        "pivot": unit(tree, weakest_stage(order, pivots, modes.stages)),
        "error": unit(tree, error),
    }
    return functions.function("approaching", equations, outputs, x=x, left=left)


def unit(tree: Tree, found: ca.SX) -> ca.SX:
    """Return what depends on q for its quaternions at length 1."""
    q = SX(tree.q)
    for places, _ in tree.quaternions:
        q[list(places)] /= ca.norm_2(q[list(places)])
    return ca.substitute(found, tree.q, q) if tree.quaternions else found


def led_to(asked: ToolAsked, equations: Equations, x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the rows J (k x nv) of what is asked of a tool, and how far it is from x (k)."""
    J, held, error = asked.expressed(equations)
    return J, ca.substitute(error, held, held_of(asked, x))


def held_of(asked: ToolAsked, x: ca.SX) -> ca.SX:
    """Return the values that are held of those that are given: of an azimuth with a tilt, tilt (cos
    azimuth, sin azimuth)."""
    held = SX(x)
    if asked.pointing is not None:
        a, t = asked.pointing
        held[a], held[t] = x[t] * ca.cos(x[a]), x[t] * ca.sin(x[a])
    return held


def positions(robot: Robot) -> ca.Function:
    """Return q -> coordinates of all joints."""
    return functions.positions(robot.equations)


def pose(robot: Robot) -> ca.Function:
    """Return q -> coordinates of the tool's pose: x, y, angle in the plane, else x, y, z and the
    rotation vector; none without a tool."""
    found = tool_coordinates(robot) if robot.mechanism.tools else SX(0, 1)
    return functions.function("pose", robot.equations, {"pose": found})


def tool_coordinates(robot: Robot) -> ca.SX:
    """Return the coordinates of the pose of a robot's tool."""
    tool = robot.mechanism.first_tool
    position, orientation, angle = body_motion.tool_pose(robot.equations.tree, tool)
    turned = rotation_vector(matrix_quaternion(ca.reshape(orientation, 3, 3).T))
    planar = ca.vertcat(position[:2], angle)
    return planar if robot.planar else ca.vertcat(position, turned)


def rates(robot: Robot) -> ca.Function:
    """Return (q, v) -> the rates w of the tree's joints, pivot."""
    return functions.tree_rates(robot.equations)


def meeting(robot: Robot) -> ca.Function:
    """Return q -> how far what may meet is apart."""
    apart = ca.vertcat(SX(0, 1), *robot.equations.gaps.values())
    return functions.function("meeting", robot.equations, {"apart": apart})


def free_forces(robot: Robot) -> ca.Function:
    """Return (q, w, u) -> q', H, the forces S' u + f - h, and gamma, with every rate of the tree as
    an independent one."""
    free, u = uncharted.uncharted(robot.equations), SX.sym("u", len(robot.actuators))
    outputs = uncharted.balance(free, ca.mtimes(free.actuation.T, u))
    return functions.function("free_forces", free, outputs, v=free.v, u=u)


def require_single(robot: Robot) -> None:
    """Refuse direct kinematics where an independent rate has no coordinate of its own."""
    tree = robot.equations.tree
    single = {tree.rates[k] for _, k in tree.single}
    turning = [name for name in robot.independent if name not in single]
    if turning:
        raise LinkworkError(
            f"kinematics is not defined: the independent rates {', '.join(turning)} are those of a "
            "free turn, which has no coordinates of its own; leave it out of the functions"
        )


def require_steps(robot: Robot) -> None:
    """Refuse motions over time where friction sticks, which has states of its own, or depends on
    what joints carry, which is not known before a chart is chosen."""
    require_no_bearings(
        robot.mechanism.joints,
        "steps in C leave out",
        "leave start, step_rk4 and step out, and integrate motion, which has it",
    )
    require_no_bristles(
        robot.mechanism,
        "steps in C leave out",
        "leave start, step_rk4 and step out, or give it without a bristle",
    )


def weakest_stage(chart: Chart, pivots: Sequence[ca.SX], sized: Sequence[ModeStage] = ()) -> ca.SX:
    """Return the determinant of least magnitude of the stages of an elimination, negative where any
    is: its sign changes where the matrix is singular, and nowhere else.

    sized: stages with the sizes of their determinants, over which these are
    """
    left, found = iter(pivots), []
    sizes = {frozenset(stage.rows): stage.size for stage in sized}
    for stage in chart.stages:
        size = sizes.get(frozenset(stage.rows), 1.0)
        found.append(prod([next(left) for _ in stage.blocks], start=SX(1)) * (1 / size))
    return weakest(found)


def largest(values: ca.SX) -> ca.SX:
    """Return the largest magnitude; zero of none."""
    return ca.mmax(ca.fabs(ca.densify(values))) if values.numel() else SX(0)
