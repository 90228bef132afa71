"""Judged poses: what a measure asks at poses of the tool, as equations and margins.

The configuration q of each pose is an unknown of its own, held by closed loops and the tool:

    phi(q, p) = 0,    |quaternions| = 1,    x(q, p) = x_k        in the mechanism's own units
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi

import casadi as ca
import numpy as np

from linkwork.export.expressions import led_to
from linkwork.mechanism.limits import limited
from linkwork.model.asked import ToolAsked
from linkwork.model.task import task_of
from linkwork.robot import Robot, State


@dataclass(frozen=True, eq=False)
class JudgedPoses:
    """Hold what a measure asks at K points: unknowns w in the mechanism's own units from a start
    (W x K), known numbers (D x K), and (w, known, p, t) -> equations, margins."""

    start: np.ndarray
    known: np.ndarray
    function: ca.Function


@dataclass(frozen=True, eq=False)
class PoseEquations:
    """Hold the equations of a robot's poses.

    q, p, t, x: symbols of the configuration, the free numbers, the level of a measure and the
        tool's task coordinates; units: the mechanism's own ones of x; residual: of closed loops and
        the tool at x
    """

    robot: Robot
    q: ca.SX
    p: ca.SX
    t: ca.SX
    x: ca.SX
    units: np.ndarray
    residual: ca.SX

    @classmethod
    def of(cls, robot: Robot) -> PoseEquations:
        equations = robot.equations
        tree, rows, kept = equations.tree, equations.rows, list(equations.chart.rows)
        asked = ToolAsked(task_of(robot), tree.length, robot.planar)
        sizes = {"q": equations.nq, "p": robot.p.size, "t": 1, "x": len(asked.what)}
        q, p, t, x = (ca.SX.sym(name, size) for name, size in sizes.items())
        error = led_to(asked, equations, x)[1] / ca.DM(asked.units)
        phi = rows.phi[kept, :] / ca.DM(rows.units[kept])
        residual = ca.densify(ca.vertcat(phi, *tree.norms(), error))
        own = ca.Function("own", [tree.q, equations.p, x], [residual])
        return cls(robot, q, p, t, x, np.array(asked.units), own(q, p, x))

    def judged(
        self,
        states: State,
        margins: ca.SX,
        equations: ca.SX | None = None,
        unknown: Sequence[tuple[ca.SX, np.ndarray, np.ndarray]] = (),
        known: Sequence[tuple[ca.SX, np.ndarray]] = (),
    ) -> JudgedPoses:
        """Return what a measure asks at states (K): its margins and those of joints' ranges, and
        more equations, with more unknowns (symbol, values, units) and known numbers (symbol,
        values) than q and x."""
        q = self.q, states.q.T, self.robot.equations.tree.units
        unknown, known = [q, *unknown], [(self.x, self.robot.task_values(states).T), *known]
        w, d = (ca.vertcat(*[symbol for symbol, *_ in part]) for part in (unknown, known))
        start, numbers = (
            np.vstack([values for _, values, *_ in part]) for part in (unknown, known)
        )
        held = ca.vertcat(self.residual, *([] if equations is None else [equations]))
        kept = ca.vertcat(margins, *joint_margins(self.robot, self.q, self.p))
        own = ca.Function("own", [w, d, self.p, self.t], [held, kept])
        # The unknowns in their units.
        units, y = np.concatenate([each for *_, each in unknown]), ca.SX.sym("w", len(start))
        rest = d, self.p, self.t
        asked = own.call([ca.DM(units) * y, *rest])
        function = ca.Function("judged", [y, *rest], asked, {"cse": True})
        return JudgedPoses(start / units[:, None], numbers, function)


def joint_margins(robot: Robot, q: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Return how far joints are from the ends of the ranges that the description gives them, in the
    mechanism's own units."""
    equations, found = robot.equations, []
    for own in limited(robot.mechanism):
        label, limits = own.coordinate, own.limits
        unit = equations.tree.length if robot.unit(label) == "m" else 1.0
        place = equations.joints.position(label)
        ends = [(limits.lower, 1), (limits.upper, -1)]
        if label.endswith(".qw") and robot.unit(label) == "1":
            # The angle of a free turn is 2 acos |qw|.
            place, ends = place**2, [(cos((limits.upper or pi) / 2) ** 2, 1)]
        there = ca.Function("place", [equations.tree.q, equations.p], [place])(q, p)
        found += [side * (there - end) / unit for end, side in ends if end is not None]
    return found
