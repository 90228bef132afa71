"""Quantities: what can be measured of the members of a study, with the axis of its components and
its unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StudyQuantity:
    """Describe a quantity: the axis of its components, if it has any, and its unit, or two: of
    slides and of turns."""

    axis: str | None
    unit: str


QUANTITIES = {
    "joint_position": StudyQuantity("coordinate", "m, rad"),
    "joint_rate": StudyQuantity("rate", "m/s, rad/s"),
    "joint_acceleration": StudyQuantity("rate", "m/s^2, rad/s^2"),
    "tool_pose": StudyQuantity("pose", "m, rad"),
    "tool_error": StudyQuantity("pose", "m, rad"),
    "tracking_error": StudyQuantity("actuator", "m, rad"),
    "actuator_force": StudyQuantity("actuator", "N, N m"),
    "actuator_power": StudyQuantity("actuator", "W"),
    "command": StudyQuantity("actuator", ""),
    "reaction_moment": StudyQuantity("joint", "N m"),
    "reaction_force": StudyQuantity("joint", "N"),
    "drive_state": StudyQuantity("extra", ""),
    "kinetic_energy": StudyQuantity(None, "J"),
    "potential_energy": StudyQuantity(None, "J"),
    "energy": StudyQuantity(None, "J"),
    "conditioning": StudyQuantity(None, "1"),
}
REACTIONS = ("reaction_moment", "reaction_force")
