"""Quantities of runs as expressions of what a run computes, to be differentiated."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import casadi as ca

from linkwork.control.joined import Joined
from linkwork.control.observation import Quantity, expression
from linkwork.equations import functions
from linkwork.gradients.conditioning import Conditioning


def joints(joined: Joined, which: str) -> ca.SX:
    """Return rates or accelerations of all joints."""
    equations = joined.equations
    found = functions.joints_motion(equations)
    dv = joined.accelerations if which == "accelerations" else ca.SX.zeros(equations.mobility)
    names = dict(q=equations.tree.q, v=equations.v, dv=dv, p=equations.p)
    return found.call(names)[which]


def energy(joined: Joined, which: str) -> ca.SX:
    """Return the kinetic or the potential energy."""
    equations = joined.equations
    names = dict(q=equations.tree.q, v=equations.v, p=equations.p)
    return functions.energy(equations).call(names)[which]


def powers(joined: Joined, which: str) -> ca.SX:
    """Return powers of `linkwork.equations.powers.power_terms`."""
    return joined.powers().call(joined.inputs)[which]


def contacts(joined: Joined, which: str) -> ca.SX:
    """Return forces or gaps where bodies may touch."""
    return joined.contacts().call(joined.inputs)[which]


def of_tool(kind: str) -> Callable[[Joined], ca.SX]:
    """Return what reads the tool."""
    return lambda joined: expression(joined.equations, Quantity(kind))


TOLD: Mapping[str, Callable[[Joined], ca.SX]] = {
    "joint_position": lambda joined: joined.equations.joints.positions(),
    "joint_rate": lambda joined: joints(joined, "rates"),
    "joint_acceleration": lambda joined: joints(joined, "accelerations"),
    "actuator_force": lambda joined: joined.outputs["force"],
    "command": lambda joined: joined.outputs["command"],
    "external_wrench": lambda joined: joined.outputs["wrenches"],
    "kinetic_energy": lambda joined: energy(joined, "kinetic"),
    "potential_energy": lambda joined: energy(joined, "potential"),
    "tool_pose": of_tool("tool_pose"),
    "task_position": of_tool("task"),
    "actuator_power": lambda joined: powers(joined, "actuated") * joined.outputs["force"],
    "friction_power": lambda joined: powers(joined, "friction"),
    "damper_power": lambda joined: powers(joined, "dampers"),
    "contact_power": lambda joined: powers(joined, "contacts"),
    "fluid_power": lambda joined: powers(joined, "drags"),
    "contact_force": lambda joined: contacts(joined, "forces"),
    "contact_gap": lambda joined: contacts(joined, "gaps"),
    "drive_state": lambda joined: joined.inputs["z"][: len(joined.acting.extras)],
}
"""What can be differentiated, by the names of `linkwork.runs.quantities`."""

FOUND = {"conditioning": Conditioning}
"""What is no expression, but found from one: made of a robot, called with what a run computes. It
is told only where it is asked for, for there are poses at which it has no derivative."""
