"""The wrenches in all joints as an FMU tells them: of closed states and their motion, in any choice
of independent rates.

    K(q) x = r(q, w, w', u),    wrenches = B(q) x                 (`joint_wrenches`)

with an equation along every joint rate, of which as many depend on the others as the robot has
freedoms: an elimination with the strongest pivot each time leaves these to the end. Tangents follow
from the same matrix:  K tx = tr - tK x.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.functions import function
from linkwork.equations.reactions import joint_loads
from linkwork.export.calls import PartProgram
from linkwork.export.fmi.driven import Driven
from linkwork.export.fmi.programs import Seeds, along, free_motion
from linkwork.export.joint_wrenches import about_first, scaled_loads, system, units
from linkwork.model.reactions import spread
from linkwork.robot import Robot


@dataclass(frozen=True, eq=False)
class JointBalance:
    """Hold the equations of the wrenches in a robot's joints, with what its drives do."""

    driven: Driven

    @property
    def robot(self) -> Robot:
        return self.driven.robot

    @cached_property
    def motion(self) -> tuple[Equations, ca.SX, ca.SX]:
        """Equations in which all rates of the tree are independent, and symbols of w' and u."""
        return *free_motion(self.robot), self.driven.symbol()

    @cached_property
    def parts(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """K, r and B."""
        free, dw, u = self.motion
        forces, _ = self.driven.acting(free, u)
        still = SX.zeros(6 * len(self.robot.bodies))
        *loads, _ = joint_loads(free)(free.tree.q, free.v, dw, forces, SX(0, 1), still, free.p)
        length, joints = spread(self.robot), len(free.mechanism.pairs)
        E, K, right = system(free, scaled_loads(free, loads, length), ())
        unit = ca.diagcat(SX(0, 0), *[ca.diag(units(length))] * joints)
        shown = about_first(loads[2], joints) @ unit @ E
        return K, right, ca.horzcat(shown, SX(shown.shape[0], K.shape[0] - shown.shape[1]))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.parts[0].shape[0]

    @property
    def places(self) -> tuple[list[int], list[int]]:
        """Rows and columns of what may not be zero in K."""
        rows, columns = self.parts[0].sparsity().get_triplet()
        return list(rows), list(columns)

    def balanced(self, robot: Robot) -> ca.Function:
        """Return (q, w, w', u) -> what may not be zero in K, r."""
        free, dw, u = self.motion
        K, right, _ = self.parts
        outputs = {"K": K.nz[:], "right": right}
        return function("balanced", free, outputs, w=free.v, dw=dw, u=u)

    def shown(self, robot: Robot) -> ca.Function:
        """Return (q, w, w', u, x) -> the wrenches."""
        free, dw, u = self.motion
        x = SX.sym("x", self.size)
        outputs = {"wrenches": self.parts[2] @ x}
        return function("shown", free, outputs, w=free.v, dw=dw, u=u, x=x)

    def change(self, robot: Robot) -> ca.Function:
        """Return (q, w, w', u, x, tq, tw, tw', su, sp) -> tr - tK x, and tB x."""
        free, dw, u = self.motion
        x, tdw, seeds = SX.sym("x", self.size), SX.sym("tdw", free.nv), Seeds.of(free, u.numel())
        K, right, B = self.parts
        pairs = [(free.tree.q, seeds.q), (free.v, seeds.w), (dw, tdw), (u, seeds.u)]
        pairs.append((free.p, seeds.p))
        outputs = {"tright": along(right - K @ x, pairs), "twrenches": along(B @ x, pairs)}
        given = {"tq": seeds.q, "tw": seeds.w, "tdw": tdw, "su": seeds.u, "sp": seeds.p}
        return function("change", free, outputs, w=free.v, dw=dw, u=u, x=x, **given)

    @property
    def programs(self) -> Mapping[str, PartProgram]:
        """The programs by name."""
        motion = "q", "w", "dw", "u"
        seeds = "tq", "tw", "tdw", "su", "sp"
        made: dict[str, tuple[Callable[[Robot], ca.Function], tuple[str, ...], tuple[str, ...]]]
        made = {
            "balanced": (self.balanced, motion, ("K", "right")),
            "shown": (self.shown, (*motion, "x"), ("wrenches",)),
            "change": (self.change, (*motion, "x", *seeds), ("tright", "twrenches")),
        }
        return {name: PartProgram(*each) for name, each in made.items()}
