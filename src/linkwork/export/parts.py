"""The functions that CasADi gets: what each takes, gives and means, and the expressions that it is
a part of.

Many are parts of one function of `equations.functions`: M, C v, G and f of its `terms`. A part
takes what it depends on and no more, and p where numbers are free.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from linkwork.equations import Equations, body_motion, functions
from linkwork.equations.algebra import SX
from linkwork.equations.joint_map import derivative
from linkwork.equations.task import task_map
from linkwork.export import expressions
from linkwork.export.implicit import (
    closed,
    require_coordinates,
    require_leading,
    tool_to_joints,
)
from linkwork.export.joint_wrenches import reactions
from linkwork.model.task import task_of
from linkwork.robot import Robot

Make = Callable[[Robot, Equations], ca.Function]
Refuse = Callable[[Robot, Equations], object]
PIVOT = "pivot"


def coordinate_rates(robot: Robot, equations: Equations) -> ca.Function:
    """Return (q, v) -> q' of the tree's coordinates."""
    outputs = {"dq": equations.tree.derivatives(equations.rates), PIVOT: pivot(equations)}
    return functions.function("coordinate_rates", equations, outputs, v=equations.v)


def bodies_motion(robot: Robot, equations: Equations) -> ca.Function:
    """Return (q, v) -> of the bodies the origins (3 x r), orientations side by side (3 x 3r) and
    twists (6 x r)."""
    count = len(robot.bodies)
    found = functions.bodies_motion(equations)(equations.tree.q, equations.v, equations.p)
    rows = ca.vertsplit(found[1], 9) if count else []
    outputs = {
        "origins": ca.reshape(found[0], 3, count),
        "orientations": ca.horzcat(SX(3, 0), *[ca.reshape(R, 3, 3).T for R in rows]),
        "twists": ca.reshape(found[2], 6, count),
        PIVOT: found[3],
    }
    return functions.function("bodies_motion", equations, outputs, v=equations.v)


def task(robot: Robot, equations: Equations) -> ca.Function:
    """Return (q, v) -> x, J and J' of the tool's task coordinates."""
    J = expressions.task_jacobian(robot, equations)
    tree = equations.tree
    pose = ca.vertcat(*body_motion.tool_pose(tree, equations.mechanism.first_tool))
    outputs = {
        "x": task_map(task_of(robot))(pose, SX.zeros(6))[0],
        "J": J,
        "dJ": derivative(J, tree, equations.rates),
        PIVOT: pivot(equations),
    }
    return functions.function("task", equations, outputs, v=equations.v)


def pivot(equations: Equations) -> ca.SX:
    """Return the weakest relative pivot of the elimination."""
    return equations.elimination.pivot


def of_chart(make: Callable[[Equations], ca.Function]) -> Make:
    """Return a function of robot and equations that needs the equations only."""
    return lambda robot, equations: make(equations)


WHOLES: Mapping[str, Make] = {
    "motion": of_chart(functions.motion),
    "actuator_forces": expressions.actuator_forces,
    "coordinate_rates": coordinate_rates,
    "terms": of_chart(functions.terms),
    "actuation": of_chart(functions.actuation),
    "energy": of_chart(functions.energy),
    "maps": of_chart(functions.maps),
    "joints_motion": of_chart(functions.joints_motion),
    "bodies_motion": bodies_motion,
    "constraints": of_chart(functions.constraints),
    "closure_step": of_chart(functions.closure_step),
    "pose": lambda robot, equations: expressions.pose(robot),
    "tool_motion": of_chart(functions.tool_motion),
    "task": task,
    "closed": closed,
    "tool_to_joints": tool_to_joints,
    "reactions": reactions,
}
"""The functions that parts are taken of, by name."""


def with_tool(robot: Robot, equations: Equations) -> None:
    """Refuse what is of a tool where there is none."""
    robot.require_tool()


def with_task(robot: Robot, equations: Equations) -> None:
    """Refuse task coordinates without a tool, or where no task is plain."""
    robot.require_tool()
    task_of(robot)


@dataclass(frozen=True)
class CasadiPart:
    """Describe a function.

    whole: the function that it is a part of, in `WHOLES`; inputs: names; outputs: their names, and
        those that they have in the whole where these are others, "dq=derivatives"
    says: what it gives; weighs: whether it tells the weakest relative pivot, too
    refuse: raises where a robot cannot have it
    """

    whole: str
    inputs: str
    outputs: str
    says: str
    weighs: bool = True
    refuse: Refuse = lambda robot, equations: None

    @property
    def renamed(self) -> dict[str, str]:
        """The names of the outputs in the whole, by their own."""
        pairs = [each.split("=") for each in self.outputs.split()]
        return {each[0]: each[-1] for each in pairs} | ({PIVOT: PIVOT} if self.weighs else {})

    def of(self, name: str, whole: ca.Function) -> ca.Function:
        """Return the part of a function of q, others and p, or whole what Newton's method finds; p
        is an input where it is not empty."""
        if not whole.is_a("SXFunction"):
            return whole
        given = whole.sx_in()
        symbols = dict(zip(whole.name_in(), given, strict=True))
        found = dict(zip(whole.name_out(), whole.call(given), strict=True))
        inputs = self.inputs.split() + ["p"] * bool(symbols["p"].numel())
        outputs = self.renamed
        taken = [found[old] for old in outputs.values()]
        own = [symbols[each] for each in inputs]
        return ca.Function(name, own, taken, inputs, [*outputs], {"cse": True})


PARTS: Mapping[str, CasadiPart] = {
    # Dynamics
    "forward_dynamics": CasadiPart(
        "motion", "q v u", "dq=derivatives dv=accelerations", "q', v' of M v' + C v + G = S' u + f"
    ),
    "inverse_dynamics": CasadiPart(
        "actuator_forces",
        "q v dv",
        "u",
        "forces of least sum of squares",
        refuse=expressions.require_driven,
    ),
    "mass_matrix": CasadiPart("terms", "q", "M", "generalised inertia"),
    "coriolis": CasadiPart("terms", "q v", "Cv", "Coriolis and centrifugal forces"),
    "gravity": CasadiPart("terms", "q", "G", "forces that hold the weight"),
    "passive_forces": CasadiPart("terms", "q v", "f", "springs, friction, contacts, a fluid"),
    "actuation": CasadiPart("actuation", "q", "S", "actuated rates S v, forces S' u"),
    "energy": CasadiPart("energy", "q v", "kinetic potential", "energies"),
    "reactions": CasadiPart("reactions", "q v u", "wrenches", "[moment; force] of each joint"),
    # Joints and bodies
    "coordinate_rates": CasadiPart("coordinate_rates", "q v", "dq", "q'"),
    "rate_map": CasadiPart("maps", "q", "L", "rates of all joints L v"),
    "twist_map": CasadiPart("maps", "q", "T", "twists of all bodies T v"),
    "positions": CasadiPart(
        "joints_motion", "q", "positions", "coordinates of all joints", weighs=False
    ),
    "joint_rates": CasadiPart("joints_motion", "q v", "rates", "rates of all joints"),
    "joint_accelerations": CasadiPart(
        "joints_motion", "q v dv", "accelerations", "accelerations of all joints"
    ),
    "body_poses": CasadiPart(
        "bodies_motion", "q", "origins orientations", "frames of the bodies", weighs=False
    ),
    "twists": CasadiPart("bodies_motion", "q v", "twists", "[omega; v] of the bodies"),
    # Loops
    "closure": CasadiPart(
        "constraints", "q", "phi Phi", "closure rows and their Jacobian", weighs=False
    ),
    "closure_step": CasadiPart(
        "closure_step", "q", "q_next residual", "a Newton step that closes loops", weighs=False
    ),
    "closed": CasadiPart(
        "closed",
        "a guess",
        "q",
        "loops closed by Newton's method",
        weighs=False,
        refuse=require_coordinates,
    ),
    # The tool
    "tool_pose": CasadiPart("pose", "q", "pose", "its pose", weighs=False, refuse=with_tool),
    "tool_twist": CasadiPart("tool_motion", "q v", "twist", "its [omega; v]", refuse=with_tool),
    "tool_acceleration": CasadiPart(
        "tool_motion", "q v dv", "acceleration", "its [alpha; a]", refuse=with_tool
    ),
    "tool_twist_map": CasadiPart("tool_motion", "q", "T", "its twist T v", refuse=with_tool),
    "task_values": CasadiPart(
        "task", "q", "x", "its task coordinates", weighs=False, refuse=with_task
    ),
    "tool_to_joints": CasadiPart(
        "tool_to_joints",
        "x guess",
        "q",
        "joints of its task coordinates",
        weighs=False,
        refuse=require_leading,
    ),
    "jacobian": CasadiPart("task", "q", "J", "their rates J v", refuse=with_task),
    "jacobian_rate": CasadiPart(
        "task", "q v", "dJ", "their accelerations J v' + J' v", refuse=with_task
    ),
}
"""The functions by name, in their order."""
