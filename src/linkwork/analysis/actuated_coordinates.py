"""Coordinates of actuators: those of joints, and the lengths of transmissions."""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.mechanism import Thrust
from linkwork.robot import Robot


def with_coordinate(robot: Robot) -> tuple[str, ...]:
    """Return the actuators that have a coordinate: all but those of ball joints, and thrust."""
    lines = robot.mechanism.transmissions
    lengths = (name for name, line in lines.items() if not isinstance(line, Thrust))
    shown = {*robot.coordinates, *lengths}
    return tuple(name for name in robot.actuators if name in shown)


def actuated_coordinates(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return the coordinates (..., k) [m, rad] of these actuators at configurations (..., nq)."""

    def made(equations: Equations) -> ca.Function:
        places = [equations.joints.position(name) for name in with_coordinate(robot)]
        outputs = {"a": ca.vertcat(SX(0, 1), *places)}
        return functions.function("actuated_coordinates", equations, outputs)

    return robot.chart.compiled("actuated coordinates", made).given(robot.p)(q)[0]
