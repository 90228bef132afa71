"""Axes and ranges in words, whose lengths and angles may have units: "x=0:1:101,angle=30deg"."""

from __future__ import annotations

import numpy as np

from linkwork.cli.entries import number, pairs
from linkwork.cli.start import measured
from linkwork.errors import LinkworkError
from linkwork.formats.references import amount, angles_of
from linkwork.model.task import known
from linkwork.robot import Robot

GRID, LIMITS = "--grid", "--limits"


def axes(robot: Robot, text: str) -> dict[str, np.ndarray | float]:
    """Return the axes of the tool's coordinates [m, rad] of "x=0:1:101,y=20cm"."""
    robot.require_tool()
    given, found = dict(pairs(text, GRID)), {}
    for (name, value), of in zip(given.items(), known(robot, [*given]), strict=True):
        place, parts = f"{GRID}: {name}", value.split(":")
        ends = [measured(part, of, place) for part in parts[:2]]
        count = number(parts[2], place) if len(parts) == 3 else 0
        if len(parts) == 1:
            found[name] = ends[0]
        elif count == int(count) >= 1:
            found[name] = np.linspace(ends[0], ends[1], int(count))
        else:
            raise LinkworkError(f"{place}={value} is no axis; give from:to:count, or one number")
    return found


def ranges(robot: Robot, text: str) -> dict[str, tuple[float, float]]:
    """Return the bounds of joint coordinates [m, rad] of "slide_1=0:50cm"."""
    angles, found = angles_of(robot.mechanism), {}
    for name, value in pairs(text, LIMITS):
        parts = [amount(part, name in angles, f"{LIMITS}: {name}") for part in value.split(":")]
        if len(parts) != 2:
            raise LinkworkError(f"{LIMITS}: {name}={value} is no range; give lower:upper")
        found[name] = (parts[0], parts[1])
    return found
