"""Collocation: the motion of a robot between two states as equations of its states at points of
time.

In each of N intervals of the time T the state y = (q, v) is a polynomial of degree d that keeps
y' = f(y, u) at d points of Radau's, with forces u that are constant there:

    sum_j C_ji y_j = (T / N) f(y_i, u_k),    y at the end of interval k = y at the begin of k + 1

The order is 2 d - 1. Forces that are constant in intervals are what a sampled controller holds.

Source: Betts 2010, Practical Methods for Optimal Control, ch. 4; Hairer & Wanner 1996, IV.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.analysis.square import of_joints
from linkwork.design.judged_poses import joint_margins
from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.mechanism.limits import undriven_speeds
from linkwork.model.state import State
from linkwork.motions import ActuatorLimits
from linkwork.robot import Robot

DEGREE = 3


@dataclass(frozen=True, eq=False)
class MotionMesh:
    """Hold the mesh of a robot's motion: points (intervals * (degree + 1) + 1), the first of each
    interval at its begin, the last one at the end."""

    robot: Robot
    intervals: int

    @cached_property
    def parts(self) -> np.ndarray:
        """Where in an interval its points are: 0, and Radau's up to 1."""
        return np.array([0.0, *ca.collocation_points(DEGREE, "radau")])

    @property
    def times(self) -> np.ndarray:
        """Times of all points over T."""
        inside = np.arange(self.intervals)[:, None] + self.parts
        return np.append(inside.ravel() / self.intervals, 1.0)

    @property
    def begins(self) -> np.ndarray:
        """Places of the begins of intervals, and of the end, among the points."""
        return np.arange(self.intervals + 1) * (DEGREE + 1)

    def equations(self, y: ca.MX, u: ca.MX, T: ca.MX | float) -> list[ca.MX]:
        """Return what is zero along a motion."""
        C, D, _ = ca.collocation_coeff(list(self.parts[1:]))
        f, nq, found = self.rate.map(DEGREE), self.robot.equations.nq, []
        for k, first in enumerate(self.begins[:-1]):
            own = y[:, first : first + DEGREE + 1]
            forces = ca.repmat(u[:, k], 1, DEGREE)
            rates = f(own[:nq, 1:], own[nq:, 1:], forces)
            found.append(ca.vec(own @ C - T / self.intervals * rates))
            found.append(y[:, first + DEGREE + 1] - own @ D)
        return found

    @cached_property
    def rate(self) -> ca.Function:
        """(q, v, u) -> y'."""
        equations, p = self.robot.equations, ca.DM(self.robot.p)
        motion = functions.motion(equations)
        q, v = ca.SX.sym("q", equations.nq), ca.SX.sym("v", equations.mobility)
        u = ca.SX.sym("u", len(self.robot.actuators))
        found = motion(q, v, u, p)
        return ca.Function("rate", [q, v, u], [ca.vertcat(*found[:2])], {"cse": True})

    def margins(self, limits: ActuatorLimits, start: State, apart: float) -> ca.Function:
        """Return (q, v, u) -> what is not negative within limits, far enough from singular poses
        and within the ranges of joints."""
        robot, equations, p = self.robot, self.robot.equations, ca.DM(self.robot.p)
        q, v = ca.SX.sym("q", equations.nq), ca.SX.sym("v", equations.mobility)
        u = ca.SX.sym("u", len(robot.actuators))
        # Rates and accelerations of the actuators, over their limits, both ways.
        given, found = limits.of_robot(robot), []
        r = functions.actuation(equations)(q, p)[0] @ v
        shares = {"speed": r, "power": u * r}
        if np.isfinite(given["acceleration"]).any():
            places = [robot.rates.index(name) for name in driven(robot)]
            moved = functions.joints_motion(equations)(q, v, self.rate(q, v, u)[-v.numel() :], p)
            shares["acceleration"] = moved[2][places]
        for kind, value in shares.items():
            for k in np.flatnonzero(np.isfinite(given[kind])).tolist():
                found += [1 - value[k] / given[kind][k], 1 + value[k] / given[kind][k]]
        found += speed_margins(robot, functions.joints_motion(equations)(q, v, 0 * v, p)[1])
        # Apart from where the independent rates cease to determine the motion.
        D = determinant(robot)
        if D is not None:
            here = float(D(start.q, p))
            found.append(D(q, p) / here - apart)
        found += joint_margins(robot, q, ca.SX(p))
        return ca.Function("margins", [q, v, u], [ca.vertcat(ca.SX(0, 1), *found)], {"cse": True})


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
