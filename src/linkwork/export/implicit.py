"""The closed configuration as a function of the independent coordinates, found by Newton's method.

    phi(q) = 0,    q_independent = a        ->    q(a),    dq/da = N L

Derivatives follow from the implicit function theorem, whatever the way Newton's method took.
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations import Equations
from linkwork.errors import LinkworkError
from linkwork.robot import Robot

CLOSED = 1e-13  # residual and step in own units at which Newton's method ends
STEPS = 30  # most steps of Newton's method


def closed(robot: Robot, equations: Equations) -> ca.Function:
    """Return (a, guess) -> q with its loops closed, the independent coordinates a, on the branch
    of a guess nearby; evaluating it fails where Newton's method does not end."""
    tree, rows, chart = equations.tree, equations.rows, equations.chart
    given = require_coordinates(robot, equations)
    found = [place for place in range(equations.nq) if place not in given]
    # Residuals and unknowns in own units, as many as each other.
    a, x, units = ca.SX.sym("a", len(given)), ca.SX.sym("x", len(found)), tree.units[found]
    q = ca.SX(equations.nq, 1)
    q[given], q[found] = a, x * ca.DM(units)
    kept = list(chart.rows)
    phi = rows.phi[kept] / ca.DM(rows.units[kept])
    residual = ca.substitute(ca.vertcat(ca.SX(0, 1), phi, *tree.norms()), tree.q, ca.densify(q))
    p = equations.p
    inputs, sizes = ["a", "guess"] + ["p"] * bool(p.numel()), [len(given), equations.nq, p.numel()]
    A, guess, own = (ca.MX.sym(*each) for each in zip(["a", "guess", "p"], sizes, strict=True))
    # The configuration, put together in the tree's order.
    unknown = ca.MX(0, 1)
    if found:
        options = {"abstol": CLOSED, "abstolStep": CLOSED, "max_iter": STEPS}
        problem = {"x": x, "p": ca.vertcat(a, p), "g": residual}
        solver = ca.rootfinder("closing", "fast_newton", problem, options)
        start = guess[found] / ca.DM(units)
        unknown = solver(x0=start, p=ca.vertcat(A, own))["x"] * ca.DM(units)
    order = [*given, *found]
    places = [order.index(place) for place in range(equations.nq)]
    whole = ca.vertcat(A, unknown)[places]
    return ca.Function("closed", [A, guess, own][: len(inputs)], [whole], inputs, ["q"])


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
