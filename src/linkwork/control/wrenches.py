"""External wrenches: forces and moments from outside on a body, as generalised forces  Q = T' w  on
the rates v."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.control.records import ActingPart
from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import cross, vector
from linkwork.equations.tree import near_offset, offset
from linkwork.errors import LinkworkError
from linkwork.simulation import Sampled, Signal

Part = Sequence[float] | np.ndarray | Sampled | Signal | Callable[[Any, Any], Any]
ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Wrench(ActingPart):
    """Act on a body with a force [N] at a point and a moment [N m].

    force, moment: three numbers, three numbers over time (`Sampled`, `Signal`), or a traced
        function (t, state) -> three
    body: name of the body; point: where the force acts, in the body's frame [m]
    frame: whether force and moment are given in the axes of the "ground" or of the "body"
    """

    body: str
    force: Part = ZERO
    moment: Part = ZERO
    point: Sequence[float] = ZERO
    frame: Literal["ground", "body"] = "ground"

    def __post_init__(self) -> None:
        if not checks.among(self.frame, ("ground", "body")):
            raise LinkworkError(
                f"the frame of the wrench on {self.body!r} is {self.frame!r}; give 'ground' or "
                "'body'"
            )
        for part, unit in (("point", "m"), ("force", "N"), ("moment", "N m")):
            value = getattr(self, part)
            if part == "point" or not (isinstance(value, Sampled | Signal) or callable(value)):
                object.__setattr__(
                    self, part, three(value, f"the {part} of the wrench on {self.body!r}", unit)
                )

    def in_ground(self, equations: Equations, wrench: ca.SX) -> ca.SX:
        """Return (moment, force) (6) in the ground's axes.

        equations: of the robot; wrench: (moment, force) (6) in the axes of `frame`.
        """
        if self.frame == "ground":
            return wrench
        R = equations.tree.node(self.body).R.matrix
        return ca.vertcat(ca.mtimes(R, wrench[:3]), ca.mtimes(R, wrench[3:]))

    def on_rates(self, equations: Equations, wrench: ca.SX) -> ca.SX:
        """Return the generalised forces (n) of (moment, force) given in the ground's axes: L' J'
        w.

        equations: of the robot; wrench: (6), about the point where it acts.
        """
        node = equations.tree.node(self.body)
        J = body_motion.jacobian(
            equations.tree, node, near_offset(node, np.array(self.point, float))
        )
        return ca.mtimes(equations.elimination.L.T, ca.mtimes(J.T, wrench))

    def about_centre(self, equations: Equations, wrench: ca.SX) -> tuple[str, ca.SX]:
        """Return the body, and (moment, force) given in the ground's axes about its mass centre.

        equations: of the robot; wrench: (6), about the point where it acts.
        """
        centre = equations.mechanism.bodies[self.body].centre_of_mass
        node = equations.tree.node(self.body)
        arm = offset(node, np.array(self.point, float)) - offset(node, vector(centre))
        moment, force = wrench[:3], wrench[3:]
        return self.body, ca.vertcat(moment + cross(arm, force), force)


def three(values: Any, what: str, unit: str) -> tuple[float, ...]:
    """Return three numbers; refuse what are none."""
    array = checks.finite(values, what)
    if array.shape != (3,):
        raise LinkworkError(f"{what} is {values!r}; give three numbers [{unit}]")
    return tuple(array.tolist())
