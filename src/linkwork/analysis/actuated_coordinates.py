"""Coordinates of actuators: those of joints, and the lengths of transmissions.

An actuator has a coordinate where the rate a' = J w along which it acts is that of one, a' = da/dt;
there a constant force u has the potential -u a, and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX, present, vector
from linkwork.equations.reference import unit
from linkwork.mechanism import Displacement, Thrust
from linkwork.model.asked import JointsAsked, Outputs
from linkwork.model.asked_rows import Rows, joint_rows
from linkwork.robot import Robot

NEAR, SAMPLES = 0.3, 3  # configurations around the reference at which rates are compared
EQUAL = 1e-9  # part of a rate by which rounding may change it


@dataclass(frozen=True, eq=False)
class ActuatorsAsked(JointsAsked):
    """Ask for what all actuators of a robot act along, transmissions among it, by rows alone: their
    lengths are not among the outputs."""

    @classmethod
    def of(cls, robot: Robot) -> ActuatorsAsked:
        names = robot.actuators
        angular = np.array([robot.unit(name) != "m" for name in names], bool)
        units = np.where(angular, 1.0, robot.equations.tree.length)
        return cls(names, [], [], angular, np.zeros(len(names), bool), units)

    def expressed(self, equations: Equations) -> Rows:
        lines = equations.mechanism.transmissions
        turns = [
            bool(angle) and name not in lines
            for name, angle in zip(self.what, self.angular, strict=True)
        ]
        return joint_rows(equations, self.what, turns)

    def jacobian(self, out: Outputs) -> np.ndarray:
        return out["J_actuated"]


def with_coordinate(robot: Robot) -> tuple[str, ...]:
    """Return the actuators that have a coordinate: all but those of ball joints, thrust, and
    moments between bodies that turn about no fixed axis."""
    lines = robot.mechanism.transmissions
    return tuple(
        name
        for name in robot.actuators
        if (name in robot.coordinates if name not in lines else robot.once(has_length, name))
    )


def has_length(robot: Robot, name: str) -> bool:
    """Tell whether the rate of a transmission is that of its length: no rotation vector has the
    angular velocity as its rate, but for turns about one axis."""
    line, equations = robot.mechanism.transmissions[name], robot.equations
    if not (isinstance(line, Displacement) and present(vector(line.moment))):
        return not isinstance(line, Thrust)
    tree, w = equations.tree, SX.sym("w", equations.nv)
    length, row = equations.joints.position(name), equations.joints.rate_row(name)
    rates = ca.mtimes(row, w), ca.jtimes(length, tree.q, tree.derivatives(w))
    read = ca.Function("rates", [tree.q, equations.p, w], [*rates])
    random = np.random.default_rng(1990)
    for _ in range(SAMPLES):
        aside = NEAR * random.standard_normal(equations.nq)
        moving = tree.rate_units * random.standard_normal(equations.nv)
        told, found = (
            float(value) for value in read(unit(tree, robot.home.q + aside), robot.p, moving)
        )
        if not abs(told - found) <= EQUAL * max(abs(told), abs(found), 1e-300):
            return False
    return True


def actuated_coordinates(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return the coordinates (..., k) [m, rad] of these actuators at configurations (..., nq)."""

    names = with_coordinate(robot)

    def made(equations: Equations) -> ca.Function:
        places = [equations.joints.position(name) for name in names]
        outputs = {"a": ca.vertcat(SX(0, 1), *places)}
        return functions.function("actuated_coordinates", equations, outputs)

    return robot.chart.compiled(f"actuated coordinates {names}", made).given(robot.p)(q)[0]
