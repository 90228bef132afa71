"""Tools in model files: frames on bodies; what else descriptions say of them is told to be left
out."""

from __future__ import annotations

from linkwork.formats.notes import Notes
from linkwork.mechanism import GROUND, Mechanism


def tell_tools(mechanism: Mechanism, notes: Notes) -> None:
    """Note what is left out of tools: the coordinates in which they are led, and what their poses
    are relative to."""
    for name, tool in mechanism.tools.items():
        if tool.task:
            notes.say(f"tools.{name}: its task is left out, for the file has frames alone")
        if tool.relative_to != GROUND:
            notes.say(
                f"tools.{name}: its pose is that in the ground, and not relative to "
                f"{tool.relative_to!r}"
            )
