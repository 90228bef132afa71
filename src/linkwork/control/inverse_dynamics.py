"""Inverse dynamics of a robot inside a controller: of the robot that is controlled, or of a wrong
model of it.

    S' u = M v' + C v + G - f            at the coordinates and rates that the controller sees

All rates driven: u follows. More actuators than freedoms: u of least norm. Fewer: the rates y that
nothing drives accelerate as the others make them,  M_yy y' = -(M_ya a + h_y)  (collocated partial
feedback linearisation, Spong 1994).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from linkwork import math
from linkwork.control.observation import Observation
from linkwork.control.plant import Plant, require_plant
from linkwork.equations import Equations, bearings
from linkwork.equations.algebra import matrix_quaternion
from linkwork.equations.symmetric import solve_symmetric
from linkwork.errors import LinkworkError
from linkwork.mechanism.bearing import require_no_bearings


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """Give the actuator forces that a robot needs for accelerations of its actuated joints."""

    robot: Plant

    def __post_init__(self) -> None:
        require_plant(self.robot)

    @cached_property
    def function(self) -> ca.Function:
        """(q, v, a, p) -> u for accelerations a of the actuated rates."""
        equations, actuators = self.robot.equations, self.robot.actuators
        independent = equations.independent
        a = ca.SX.sym("a", len(actuators))
        M, h = equations.inertia[0], self._bias(a)
        if set(actuators) <= set(independent):
            driven = [independent.index(name) for name in actuators]
            free = [i for i in range(len(independent)) if i not in driven]
            y = (
                solve_symmetric(M[free, free], -(ca.mtimes(M[free, driven], a) + h[free]))
                if free
                else ca.SX(0, 1)
            )
            u = ca.mtimes(M[driven, driven], a) + ca.mtimes(M[driven, free], y) + h[driven]
        elif set(independent) <= set(actuators):
            S, places = equations.actuation, [actuators.index(name) for name in independent]
            u = ca.mtimes(S, solve_symmetric(ca.mtimes(S.T, S), ca.mtimes(M, a[places]) + h))
        else:
            raise LinkworkError(
                f"the model's independent rates {', '.join(independent)} are not those of its "
                "actuators; a model in a controller has to be driven by them"
            )
        inputs = [equations.tree.q, equations.v, a, equations.p]
        return ca.Function("model", inputs, [ca.densify(u)], {"cse": True})

    def require_same_actuators(self, state: Observation) -> None:
        """Refuse a robot that is driven otherwise than the model."""
        ours, theirs = self.robot.actuators, state.names.actuators
        if ours != theirs:
            raise LinkworkError(
                f"the model has the actuators {', '.join(ours)}, the robot {', '.join(theirs)}; "
                "they have to be the same"
            )

    def _bias(self, a: ca.SX) -> ca.SX:
        """Return C v + G - f (n), with the friction of bearings for accelerations a of the actuated
        rates."""
        equations, actuators = self.robot.equations, self.robot.actuators
        h, independent = equations.bias_forces(equations.gravity), equations.independent
        if set(actuators) != set(independent):
            require_no_bearings(
                equations.mechanism.joints,
                "a model in a controller whose actuators are not its independent rates leaves out",
                "give the controller a model without",
            )
            return h
        dv = ca.vertcat(ca.SX(0, 1), *(a[actuators.index(name)] for name in independent))
        phi = bearings.friction(equations, dv, ca.SX.zeros(len(actuators)))
        return h if phi is None else h - bearings.on_rates(equations, phi)

    def forces(self, state: Observation, accelerations: Any, still: bool = False) -> np.ndarray:
        """Return u (na) for accelerations (na) of the actuated rates, in the order of the
        actuators.

        state: what the controller sees; still: whether to leave its rates out
        """
        equations, robot = self.robot.equations, self.robot
        self.require_same_actuators(state)
        q = measured(equations, state)
        v = [0.0 if still else state.rate(label) for label in equations.independent]
        p = [state.parameter(f"model.{path}", value) for path, value in robot.parameters.items()]
        a = math.array(accelerations).ravel()
        u = self.function(*(ca.vertcat(ca.SX(0, 1), *values) for values in (q, v, a, p)))
        return numeric(math.vector(u))


def measured(equations: Equations, state: Observation) -> list[Any]:
    """Return the tree's coordinates q (nq) as a controller sees them: those of joints, and of
    bodies that the tree lets float the pose, a quaternion behind the position."""
    floating = {}
    for name in equations.topology.added:
        joint = equations.topology.joints[name]
        frame = state.body(joint.connects[1])
        R = ca.reshape(ca.SX(ca.vertcat(*frame.rotation.ravel())), 3, 3).T
        p = matrix_quaternion(R)
        pose = [*frame.position, *numeric(math.vector(p))]
        floating |= dict(zip(joint.coordinates(name), pose, strict=True))
    return [
        floating[label] if label in floating else state[label]
        for label in equations.tree.coordinates
    ]


def numeric(values: np.ndarray) -> np.ndarray:
    """Return constant symbols as numbers."""
    return values.astype(float) if all(value.is_constant() for value in values) else values
