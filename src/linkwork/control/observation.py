"""Observation: what a controller sees of a robot, by name; the same class holds numbers, or symbols
while tracing.

A quantity is read when it is first asked for, from a source (`Readings`): of a state's numbers, or
of fresh symbols. `expression` gives every quantity as a function of the tree's coordinates and
independent rates of any chart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from linkwork import math
from linkwork.checks import amount, known
from linkwork.equations import Equations, bearings, body_motion
from linkwork.equations.algebra import SX, matrix_quaternion
from linkwork.equations.effects import rotation_vector
from linkwork.equations.task import mapped_rows
from linkwork.equations.transmissions import at_surface
from linkwork.equations.tree import near_offset, offset
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism, Tool
from linkwork.mechanism.bearing import loaded
from linkwork.mechanism.limits import at_surfaces, meetings, pulling
from linkwork.mechanism.sticking import Strain, strains
from linkwork.mechanism.task import labels

OF_CHARTS = ("actuation_determinant", "task_jacobian")  # kinds that read a chart's own rates


class Quantity(NamedTuple):
    """Name a measurable quantity: its kind, and which one of them.

    kinds: "position", "rate" of a joint (1); "tool_pose", "tool_velocity" (3 or 6); "body": p, R
    row by row, omega, v (18); "gap" of what may meet, "actuation_determinant": det S (1); "task",
    "task_rates" (k), "task_jacobian" column by column (k na) of the task that the tool states;
    for events: "load" along a line by which a joint rubs, which follows from all that acts (1);
    "surface", zero where something happens to a cable at one (1)
    """

    kind: str
    name: str = ""


@dataclass(frozen=True)
class Names:
    """Hold the names by which a controller reads: of coordinates, rates, actuators, bodies, extra
    states and transmissions.

    pose: number of components of the tool's pose, 0 without a tool; meetings: what may meet,
        and ends of slack; strains: of bristles; task: coordinates of the task that the tool states;
        loaded: forces along lines by whose size joints rub; surfaces: what may happen to cables
        there
    """

    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    actuators: tuple[str, ...]
    bodies: tuple[str, ...]
    pose: int
    extras: tuple[str, ...] = ()
    meetings: tuple[str, ...] = ()
    transmissions: tuple[str, ...] = ()
    strains: tuple[Strain, ...] = ()
    task: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    surfaces: tuple[str, ...] = ()

    @classmethod
    def of(cls, mechanism: Mechanism, planar: bool, extras: tuple[str, ...] = ()) -> Names:
        """Return the names of a mechanism; planar: whether its poses are (x, y, angle)."""
        pose = (3 if planar else 6) if mechanism.tools else 0
        return cls(
            mechanism.coordinates,
            mechanism.rates,
            mechanism.actuators,
            tuple(mechanism.bodies),
            pose,
            tuple(extras),
            meetings(mechanism) + pulling(mechanism),
            tuple(mechanism.transmissions),
            tuple(strains(mechanism)),
            labels((mechanism.first_tool.task if mechanism.tools else None) or ()),
            loaded(mechanism.joints),
            tuple(at_surfaces(mechanism)),
        )

    @property
    def measured(self) -> tuple[str, ...]:
        """What may be read: coordinates, and lengths of transmissions."""
        return (*self.coordinates, *self.transmissions)

    def size(self, quantity: Quantity) -> int:
        """Return how many numbers a quantity has."""
        led = len(self.task)
        sizes = {"position": 1, "rate": 1, "gap": 1, "actuation_determinant": 1, "body": 18}
        sizes["load"] = sizes["surface"] = 1
        sizes |= {"task": led, "task_rates": led, "task_jacobian": led * len(self.actuators)}
        return sizes.get(quantity.kind, self.pose)


@dataclass(frozen=True)
class Readings:
    """Say where quantities come from: each is a function that returns a vector of numbers or of
    symbols.

    quantity: by `Quantity`; parameter: by name and default; extra: states of drives and controllers
    by name
    """

    quantity: Callable[[Quantity], np.ndarray]
    parameter: Callable[[str, float], Any]
    extra: Callable[[str], Any]


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Hold a body's frame and its motion, in the ground's axes.

    position: p_0B (3) [m]; rotation: R_0B (3, 3); angular_velocity: omega (3) [rad/s]; velocity: of
    the frame's origin (3) [m/s]
    """

    position: np.ndarray
    rotation: np.ndarray
    angular_velocity: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True, eq=False)
class Observation:
    """Show a robot's present state to a controller, by name.

    state["slide_1"] is a joint coordinate [m, rad], state.rate("slide_1") its rate; `positions` and
    `rates` hold those of all joints, in the order of the robot's `coordinates` and `rates`. All are
    numbers when the controller is called with numbers, and symbols while it is traced: write it
    with `linkwork.math`, and without branches on values.
    """

    names: Names
    source: Readings

    def __getitem__(self, coordinate: str) -> Any:
        """Return one joint coordinate [m, rad; 1 of a quaternion's part], or a transmission's
        length."""
        known([coordinate], self.names.measured, "joint coordinate")
        return self.source.quantity(Quantity("position", coordinate))[0]

    def rate(self, name: str) -> Any:
        """Return one joint rate, or that of a transmission's length [m/s, rad/s]."""
        known([name], (*self.names.rates, *self.names.transmissions), "joint rate")
        return self.source.quantity(Quantity("rate", name))[0]

    def gap(self, name: str) -> Any:
        """Return how far what may meet is apart, negative where it presses [m, rad]: an end of a
        stop ("hinge: lower stop"), a place of a contact ("heel: contact")."""
        known([name], self.names.meetings, "stop or contact")
        return self.source.quantity(Quantity("gap", name))[0]

    @cached_property
    def positions(self) -> np.ndarray:
        """Coordinates of all joints (m) [m, rad]."""
        return math.array([self[label] for label in self.names.coordinates])

    @cached_property
    def rates(self) -> np.ndarray:
        """Rates of all joints [m/s, rad/s]."""
        return math.array([self.rate(label) for label in self.names.rates])

    @cached_property
    def tool_pose(self) -> np.ndarray:
        """The tool's pose: x, y, angle in the plane; x, y, z, rotation vector in space [m, rad]."""
        self._require_tool()
        return self.source.quantity(Quantity("tool_pose"))

    @cached_property
    def tool_velocity(self) -> np.ndarray:
        """The tool's velocity: x', y', angular velocity in the plane; v (3), omega (3) in space, in
        the axes of the ground, or of the body that the tool is relative to [m/s, rad/s]."""
        self._require_tool()
        return self.source.quantity(Quantity("tool_velocity"))

    @cached_property
    def task(self) -> np.ndarray:
        """Coordinates x (k) of the task that the tool states, in its order [m, rad]."""
        self._require_task()
        return self.source.quantity(Quantity("task"))

    @cached_property
    def task_rates(self) -> np.ndarray:
        """Rates x' (k) of the task's coordinates [m/s, rad/s]; of a whole rotation vector the
        angular velocity."""
        self._require_task()
        return self.source.quantity(Quantity("task_rates"))

    @cached_property
    def task_jacobian(self) -> np.ndarray:
        """J (k x actuators) of x' = J q_a': forces f along the task are made by u = J' f.

        Only robots with as many actuators as freedoms have it; where the pose is actuator-singular
        it is infinite.
        """
        self._require_task()
        flat = self.source.quantity(Quantity("task_jacobian"))
        return flat.reshape(len(self.names.actuators), len(self.names.task)).T

    @property
    def actuation_determinant(self) -> Any:
        """The determinant of S, which gives the actuated rates S v: zero where they do not
        determine the motion.

        It is that of the rates v which are independent at the moment; where these are the actuated
        ones it is 1.
        """
        return self.source.quantity(Quantity("actuation_determinant"))[0]

    def body(self, name: str) -> FrameMotion:
        """Return pose and velocity of a body's frame."""
        known([name], self.names.bodies, "body")
        values = self.source.quantity(Quantity("body", name))
        return FrameMotion(values[:3], values[3:12].reshape(3, 3), values[12:15], values[15:])

    def parameter(self, name: str, default: float) -> Any:
        """Return a free parameter: `default`, or what simulate(parameters={name: ...}) sets without
        compiling anew."""
        return self.source.parameter(name, default)

    def extra(self, name: str) -> Any:
        """Return an extra state of a drive ("slide_1.current") or of the controller itself, by
        name."""
        known([name], self.names.extras, "extra state")
        return self.source.extra(name)

    def _require_tool(self) -> None:
        if not self.names.pose:
            raise LinkworkError("the mechanism names no tool; add one under 'tools'")

    def _require_task(self) -> None:
        self._require_tool()
        if not self.names.task:
            raise LinkworkError(
                "the tool states no task; state one in its description, such as task=['z', 'rx', "
                "'ry'], or read tool_pose and tool_velocity"
            )


def numbers(
    names: Names,
    values: Mapping[Quantity, np.ndarray],
    extras: np.ndarray,
    parameters: Mapping[str, float],
):
    """Return an observation of numbers: quantities, extra states in the order of the names,
    parameters by name."""

    def quantity(key: Quantity) -> np.ndarray:
        if key not in values:
            raise LinkworkError(
                f"the {key.kind.replace('_', ' ')} {key.name!r} was not read when the function "
                "was traced"
            )
        return values[key]

    def extra(name: str) -> float:
        return float(extras[names.extras.index(name)])

    return Observation(
        names, Readings(quantity, lambda name, default: parameters.get(name, default), extra)
    )


def expression(equations: Equations, quantity: Quantity) -> ca.SX:
    """Return a quantity as a function of q and v of a chart."""
    tree, mechanism, name = equations.tree, equations.mechanism, quantity.name
    # What has a name: of joints, of what may meet, of bodies.
    match quantity.kind:
        case "position":
            return equations.joints.position(name)
        case "rate":
            return ca.mtimes(equations.joints.rate_row(name), equations.rates)
        case "gap":
            return equations.gaps[name]
        case "surface":
            return at_surface(mechanism, tree, name)
        case "load":  # but for what acts
            none = SX.zeros(equations.mobility), SX.zeros(len(mechanism.actuators))
            return bearings.line_loads(equations, *none)[0][name]
        case "body":
            node = tree.node(name)
            twist = ca.mtimes(
                body_motion.jacobian(tree, node, near_offset(node, np.zeros(3))), equations.rates
            )
            return ca.vertcat(node.O + offset(node, np.zeros(3)), ca.vec(node.R.matrix.T), twist)
        case "actuation_determinant":
            if len(mechanism.actuators) != equations.mobility:
                raise LinkworkError(
                    f"{amount(len(mechanism.actuators), 'actuator')} and a mobility of "
                    f"{equations.mobility} have no actuator-singular poses"
                )
            return ca.det(equations.actuation)
    # The tool's task, its pose or velocity.
    tool = mechanism.first_tool
    if quantity.kind.startswith("task"):
        return task_expression(equations, tool, quantity.kind)
    planar = body_motion.is_planar(tree, tool)
    if quantity.kind == "tool_pose":
        p, R, angle = body_motion.tool_pose(tree, tool)
        turn = rotation_vector(matrix_quaternion(ca.reshape(R, 3, 3).T)) if not planar else SX(0, 1)
        return ca.vertcat(p[:2], angle) if planar else ca.vertcat(p, turn)
    J, _ = body_motion.tool_twist(tree, tool, SX.zeros(equations.nv))
    return ca.mtimes(J, equations.rates)[body_motion.pose_places(planar)]


def task_expression(equations: Equations, tool: Tool, kind: str) -> ca.SX:
    """Return x, x' or J (column by column) of the task that a tool states, as functions of q and
    v."""
    x, rows = mapped_rows(equations.tree, tool, tool.task or ())
    if kind == "task":
        return x
    if kind == "task_rates":
        return ca.mtimes(rows, equations.rates)
    # x' = rows L v and q_a' = S v.
    S = equations.actuation
    if S.shape[0] != S.shape[1]:
        raise LinkworkError(
            f"{amount(S.shape[0], 'actuator')} and a mobility of {S.shape[1]}: the actuated rates "
            "do not determine the tool's; read task_rates"
        )
    L, *_ = equations.elimination
    return ca.vec(ca.densify(ca.solve(S.T, ca.mtimes(rows, L).T).T))
