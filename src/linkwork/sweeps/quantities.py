"""Quantities: what can be measured of the members of a study, with the axis of its components and its unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """Describe a quantity: the axis of its components, if it has any, and its unit, or two: of slides and of turns."""

    axis: str | None
    unit: str


QUANTITIES = {
    "joint_position": Quantity("coordinate", "m, rad"),
    "joint_rate": Quantity("rate", "m/s, rad/s"),
    "joint_acceleration": Quantity("rate", "m/s^2, rad/s^2"),
    "tool_pose": Quantity("pose", "m, rad"),
    "tool_error": Quantity("pose", "m, rad"),
    "tracking_error": Quantity("actuator", "m, rad"),
    "actuator_force": Quantity("actuator", "N, N m"),
    "actuator_power": Quantity("actuator", "W"),
    "command": Quantity("actuator", ""),
    "reaction_moment": Quantity("joint", "N m"),
    "reaction_force": Quantity("joint", "N"),
    "drive_state": Quantity("extra", ""),
    "kinetic_energy": Quantity(None, "J"),
    "potential_energy": Quantity(None, "J"),
    "energy": Quantity(None, "J"),
    "conditioning": Quantity(None, "1"),
}
REACTIONS = ("reaction_moment", "reaction_force")
