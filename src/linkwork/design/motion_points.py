"""What holds at one point of a motion, with its derivatives along closed configurations.

At independent coordinates a, rates v, accelerations w and actuator forces u

    r = M w + C v + G - f - S' u = 0,    margins(q(a), v, w, u) >= 0,    phi(q(a)) = 0

The loops are closed at each point: q(a) is found by Newton's method, and derivatives with respect
to a are those along the tangent of all closed configurations (`gradients.tangent`). So the unknowns
of a motion are as few as freedoms ask, whatever the number of joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from linkwork.analysis.square import of_joints
from linkwork.design.judged_poses import joint_margins
from linkwork.equations import functions
from linkwork.equations.algebra import SX
from linkwork.errors import LinkworkError
from linkwork.export.implicit import require_coordinates
from linkwork.gradients.differentiable import Slopes, Throughout
from linkwork.gradients.missing_forces import NeededForces
from linkwork.gradients.tangent import Shift, Tangent
from linkwork.mechanism.limits import undriven_speeds
from linkwork.model.closing import closed
from linkwork.model.state import State
from linkwork.motions import ActuatorLimits
from linkwork.robot import Robot

ROUNDS = 12  # of Newton's steps from the last configurations
PARTS = 1, 4  # in which ways from these are gone


@dataclass(frozen=True, eq=False)
class MotionPoints:
    """Hold what is asked of a robot at each point x = (a, v, w, u) of a motion.

    start: a state on the side of singular poses on which all points are; apart: the part of its
        determinant that is kept; forces: sizes (n) of the forces on the independent rates
    """

    robot: Robot
    limits: ActuatorLimits
    start: State
    apart: float
    forces: np.ndarray

    @cached_property
    def given(self) -> list[int]:
        """Places of the independent coordinates in q."""
        return require_coordinates(self.robot, self.robot.equations)

    @property
    def held(self) -> int:
        """How many rows are zero; the others are not negative."""
        return self.robot.mobility

    @cached_property
    def width(self) -> int:
        """Numbers of a point."""
        return 3 * self.robot.mobility + len(self.robot.actuators)

    @cached_property
    def needed(self) -> NeededForces:
        """M w + C v + G - f, in symbols w."""
        return NeededForces(self.robot.equations)

    @cached_property
    def u(self) -> ca.SX:
        """Symbols of the actuators' forces."""
        return SX.sym("u", len(self.robot.actuators))

    @cached_property
    def rest(self) -> Throughout:
        """The rows r over the sizes of forces, and margins; without the forces needed where these
        are differentiated on their own, for bearings do not rub by what they carry."""
        equations, w = self.robot.equations, self.needed.given
        forces = -ca.mtimes(equations.actuation.T, self.u)
        if self.robot.rubs:
            forces += functions.forces_needed(equations, w, self.u)
        margins = ca.vertcat(SX(0, 1), *self.margins())
        given = ca.vertcat(w, self.u)
        return Throughout(
            Tangent(equations), ca.vertcat(forces / ca.DM(self.forces), margins), given
        )

    def with_needed(self, rows: ca.SX, needed: ca.SX) -> ca.SX:
        """Return rows of the rest with those of the forces needed."""
        if self.robot.rubs:
            return rows
        needed = needed / ca.repmat(ca.DM(self.forces), 1, needed.shape[1])
        more = SX(rows.shape[0] - needed.shape[0], rows.shape[1])
        return rows + ca.vertcat(needed, more)

    @cached_property
    def units(self) -> Slopes:
        """Steps (each x width) of a, v, w and u, one by one."""
        n = self.robot.mobility
        q, v, own = ca.vertsplit(SX.eye(self.width), [0, n, 2 * n, self.width])
        return Slopes(Shift(q, v, SX(self.robot.p.size, self.width)), own)

    @cached_property
    def value(self) -> ca.Function:
        """(q, x) -> r over the sizes of forces, and margins (rows)."""
        return self.function("value", self.with_needed(self.rest.value, self.needed.value))

    @cached_property
    def slope(self) -> ca.Function:
        """(q, x) -> the derivative of the value (rows x width)."""
        by, given = self.units
        needed = self.needed.forward(Slopes(by, given[: self.held, :]))
        return self.function("slope", self.with_needed(self.rest.forward(self.units), needed))

    @cached_property
    def bend(self) -> ca.Function:
        """(q, x, weights) -> the second derivative of weights times the value (width x width)."""
        weights = SX.sym("weights", self.rest.rows)
        by, given = self.rest.backward(weights)
        rows = ca.vertcat(by.q, by.v, given)
        if not self.robot.rubs:
            of, along = self.needed.backward(weights[: self.held] / ca.DM(self.forces))
            rows += ca.vertcat(of.q, of.v, along, SX(self.u.numel(), 1))
        gradient = Throughout(self.rest.tangent, rows, self.rest.given)
        return self.function("bend", gradient.forward(self.units), weights)

    @property
    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function]:
        return self.value, self.slope, self.bend

    def function(self, name: str, found: ca.SX, *more: ca.SX) -> ca.Function:
        """Return a function of (q, x, ...) at the robot's own numbers."""
        equations = self.robot.equations
        x = ca.vertcat(SX.sym("a", self.held), equations.v, self.rest.given)
        own = ca.SX(ca.DM(self.robot.p))
        found = ca.sparsify(ca.substitute(ca.densify(found), equations.p, own))
        return ca.Function(name, [equations.tree.q, x, *more], [found], {"cse": True})

    def margins(self) -> list[ca.SX]:
        """Return what is not negative within limits, far enough from singular poses and within the
        ranges of joints."""
        robot, equations = self.robot, self.robot.equations
        q, v, p, w = equations.tree.q, equations.v, equations.p, self.needed.given
        # Rates and accelerations of the actuators, over their limits, both ways.
        given, found = self.limits.of_robot(robot), []
        r = ca.mtimes(equations.actuation, v)
        shares = {"speed": r, "power": self.u * r}
        if np.isfinite(given["acceleration"]).any():
            places = [robot.rates.index(name) for name in driven(robot)]
            moved = functions.joints_motion(equations)(q, v, w, p)
            shares["acceleration"] = moved[2][places]
        for kind, value in shares.items():
            for k in np.flatnonzero(np.isfinite(given[kind])).tolist():
                found += [1 - value[k] / given[kind][k], 1 + value[k] / given[kind][k]]
        found += speed_margins(robot, functions.joints_motion(equations)(q, v, 0 * v, p)[1])
        # Apart from where the independent rates cease to determine the motion.
        D = determinant(robot)
        if D is not None:
            here = float(D(self.start.q, robot.p))
            found.append(D(q, p) / here - self.apart)
        return found + joint_margins(robot, q, p)


class Closing(ca.Callback):
    """Close the loops at independent coordinates (n x points): q (nq x points), near the last ones;
    NaN where Newton's method does not contract to them."""

    def __init__(self, points: MotionPoints, q: np.ndarray) -> None:
        ca.Callback.__init__(self)
        self.points, self.q = points, q.T.copy()
        self.units = points.robot.equations.tree.units
        self.kernel = points.robot.kernel("closure_step")
        self.construct("closing", {})

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.points.given), len(self.q))

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.q.shape[1], len(self.q))

    def eval(self, arg: Any) -> list[np.ndarray]:
        goal, there = arg[0].full().T, np.zeros(len(self.q), bool)
        for parts in PARTS:
            left = np.flatnonzero(~there)
            self.q[left], there[left] = self.walked(self.q[left], goal[left], parts)
        return [np.where(there[:, None], self.q, np.nan).T]

    def walked(
        self, begin: np.ndarray, goal: np.ndarray, parts: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) to which a straight way in some parts leads, where it was at the begin
        if Newton's method does not contract on it, and where it does (K)."""
        given, q, there = self.points.given, begin.copy(), np.ones(len(begin), bool)
        for k in range(1, parts + 1):
            q[:, given] = begin[:, given] + k / parts * (goal - begin[:, given])
            found = closed(self.step, q, (), ROUNDS)
            q, there = found.q, there & found.met
        return np.where(there[:, None], q, begin), there

    def step(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q after one of Newton's steps, the residual before it and the step's length."""
        after, residual = self.kernel(q)
        return after, residual[:, 0], np.abs((after - q) / self.units).max(axis=1)


def speed_margins(robot: Robot, rates: ca.SX) -> list[ca.SX]:
    """Return 1 - |w|^2 / V^2 of what is no actuator and has a limit of speed in the description."""
    return [
        1 - ca.sumsqr(rates[[robot.rates.index(label) for label in labels]]) / speed**2
        for labels, speed in undriven_speeds(robot.mechanism)
    ]


def determinant(robot: Robot) -> ca.Function | None:
    """Return (q, p) -> the determinant of loops and independent rates, over that at the reference;
    None where it is constant."""
    D = of_joints(robot, robot.independent).determinant
    if D.is_constant():
        return None
    return ca.Function("determinant", [robot.equations.tree.q, robot.equations.p], [D])


def driven(robot: Robot) -> tuple[str, ...]:
    """Return the actuators; refuse those without a rate of their own."""
    strange = [name for name in robot.actuators if name not in robot.rates]
    if strange:
        raise LinkworkError(
            f"the actuator {strange[0]!r} has no coordinate of its own whose acceleration could be "
            "limited; limit its force"
        )
    return robot.actuators
