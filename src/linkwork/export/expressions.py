"""The functions that are written straight from the equations, as CasADi functions.

Each ends with the weakest relative pivot where it goes through the chart's elimination. Matrices
are row by row, as arrays of C are.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import body_motion, functions
from linkwork.equations.algebra import SX
from linkwork.equations.equations import conditions, solve_symmetric
from linkwork.equations.task import task_map
from linkwork.errors import LinkworkError
from linkwork.model.actuation import DRIVEN, undriven
from linkwork.model.task import task_of
from linkwork.robot import Robot


def motion(robot: Robot) -> ca.Function:
    """Return (q, v, u) -> dq, dv, pivot."""
    return functions.motion(robot.equations)


def inverse_dynamics(robot: Robot) -> ca.Function:
    """Return (q, v, dv) -> u, pivot: the forces of least sum of squares that give dv."""
    own = functions.inverse_dynamics(robot.equations)
    if robot.actuators == robot.independent:
        return own
    require_driven(robot)
    equations, dv = robot.equations, SX.sym("dv", robot.mobility)
    forces, pivot = own(equations.tree.q, equations.v, dv, equations.p)
    S = equations.actuation
    outputs = {"u": ca.mtimes(S, solve_symmetric(ca.mtimes(S.T, S), forces)), "pivot": pivot}
    return functions.function("inverse_dynamics", equations, outputs, v=equations.v, dv=dv)


def mass_matrix(robot: Robot) -> ca.Function:
    """Return q -> M, pivot."""
    equations = robot.equations
    outputs = {"M": equations.inertia[0], "pivot": equations.elimination.pivot}
    return functions.function("mass_matrix", equations, outputs)


def jacobian(robot: Robot) -> ca.Function:
    """Return q -> J row by row, pivot: x' = J v in the tool's task coordinates."""
    robot.require_tool()
    equations, task = robot.equations, task_of(robot)
    tool = equations.mechanism.first_tool
    twist, _ = body_motion.tool_twist(equations.tree, tool, equations.rates)
    pose = ca.vertcat(*body_motion.tool_pose(equations.tree, tool))
    E = task_map(task)(pose, SX.zeros(6))[1]
    J = ca.mtimes(E, ca.mtimes(twist, equations.elimination.L))
    outputs = {"J": ca.vec(ca.densify(J).T), "pivot": equations.elimination.pivot}
    return functions.function("jacobian", equations, outputs)


def closure(robot: Robot) -> ca.Function:
    """Return q -> phi, and the largest |phi| in the mechanism's own units."""
    equations = robot.equations
    outputs = {"phi": equations.rows.phi, "gap": conditions(equations)}
    return functions.function("closure", equations, outputs)


def require_driven(robot: Robot) -> None:
    """Refuse inverse dynamics where actuators do not drive all independent rates at home."""
    S = robot.actuation(robot.home)
    values = np.linalg.svd(S, compute_uv=False)
    if (values > DRIVEN * values.max(initial=0.0)).sum() < robot.mobility or robot.idle:
        raise LinkworkError(
            "inverse_dynamics is not defined: the actuators do not drive "
            f"{', '.join(undriven(S, robot.independent))}; leave it out of the functions, or add "
            "actuators"
        )
