"""Sentences on what an export leaves to its user."""

from __future__ import annotations

from linkwork.robot import Robot


def drives_left_out(robot: Robot, whole: str, inputs: str) -> list[str]:
    """Return a sentence on the drives of the description, if there are any; whole: what they are no
    part of, inputs: what the forces are called there."""
    described = ", ".join(robot.mechanism.drives)
    sentence = f"the drives of {described} are no part of {whole}: {inputs} are the forces"
    return [sentence] if described else []
