"""The closed configuration as a function of the independent coordinates, or of the tool's, found by
Newton's method.

    phi(q) = 0,  q_independent = a    ->    q(a),    dq/da = N L
    phi(q) = 0,  x(q) = x             ->    q(x),    dq/dx = N L J^-1

Derivatives follow from the implicit function theorem, whatever the way Newton's method took.
Evaluating such a function fails where the method does not end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from linkwork.equations import Equations
from linkwork.errors import LinkworkError
from linkwork.export.expressions import led_to
from linkwork.mechanism.task import labels
from linkwork.model.asked import ToolAsked
from linkwork.model.task import task_of
from linkwork.robot import Robot

CLOSED = 1e-13  # residual and step in own units at which Newton's method ends
STEPS = 30  # most steps of Newton's method


def closed(robot: Robot, equations: Equations) -> ca.Function:
    """Return (a, guess) -> q with its loops closed, the independent coordinates a, near a guess."""
    given = require_coordinates(robot, equations)
    a = ca.SX.sym("a", len(given))
    return by_newton("closed", equations, {"a": a}, given, ca.SX(0, 1))


def tool_to_joints(robot: Robot, equations: Equations) -> ca.Function:
    """Return (x, guess) -> q with its loops closed, the tool's task coordinates x, near a guess."""
    require_leading(robot, equations)
    task = task_of(robot)
    asked = ToolAsked(task, equations.tree.length, robot.planar)
    x = ca.SX.sym("x", len(task))
    error = led_to(asked, equations, x)[1] / ca.DM(asked.units)
    return by_newton("tool_to_joints", equations, {"x": x}, [], error)


def by_newton(
    name: str,
    equations: Equations,
    asked: Mapping[str, ca.SX],
    given: Sequence[int],
    error: ca.SX,
) -> ca.Function:
    """Return (asked, guess) -> q with closed loops and no error.

    asked: symbols of what is known, by its name; given: their places in q, none where they enter
        the error alone
    """
    ((label, known),) = asked.items()
    tree, rows, kept = equations.tree, equations.rows, list(equations.chart.rows)
    found = [place for place in range(equations.nq) if place not in given]
    # Residuals and unknowns in own units, as many as each other.
    unknown, units = ca.SX.sym("unknown", len(found)), ca.DM(tree.units[found])
    q = ca.SX(equations.nq, 1)
    q[[*given, *found]] = ca.vertcat(known if given else ca.SX(0, 1), unknown * units)
    phi = rows.phi[kept, :] / ca.DM(rows.units[kept])
    residual = ca.substitute(ca.vertcat(phi, *tree.norms(), error), tree.q, ca.densify(q))
    # The configuration, put together in the tree's order.
    p = equations.p
    names = [label, "guess", "p"][: 3 if p.numel() else 2]
    sizes = known.numel(), equations.nq, p.numel()
    inputs = [ca.MX.sym(*each) for each in zip(names, sizes, strict=False)]
    whole = [inputs[0]] if given else []
    if found:
        options = {"abstol": CLOSED, "abstolStep": CLOSED, "max_iter": STEPS}
        problem = {"x": unknown, "p": ca.vertcat(known, p), "g": residual}
        solver = ca.rootfinder("newton", "fast_newton", problem, options)
        start = inputs[1][found] / units
        whole.append(solver(x0=start, p=ca.vertcat(inputs[0], *inputs[2:]))["x"] * units)
    order = [*given, *found]
    places = [order.index(place) for place in range(equations.nq)]
    return ca.Function(name, inputs, [ca.vertcat(*whole)[places]], names, ["q"])


def require_coordinates(robot: Robot, equations: Equations) -> list[int]:
    """Return the places in q of the independent rates' coordinates; refuse rates without one."""
    tree = equations.tree
    places = {tree.rates[k]: place for place, k in tree.single}
    turning = [name for name in equations.independent if name not in places]
    if turning:
        raise LinkworkError(
            f"closed is not defined: the independent rates {', '.join(turning)} are those of a "
            "free turn, which has no coordinates of its own; choose a chart without them"
        )
    return [places[name] for name in equations.independent]


def require_leading(robot: Robot, equations: Equations) -> None:
    """Refuse a tool whose task coordinates are not as many as freedoms."""
    robot.require_tool()
    task = task_of(robot)
    if len(task) != equations.mobility:
        raise LinkworkError(
            f"tool_to_joints is not defined: the tool's {', '.join(labels(task))} are "
            f"{len(task)} and the robot has {equations.mobility} freedoms; take closed, or name a "
            "task of as many"
        )
