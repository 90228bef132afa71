"""Lengths and angles of goals and paths in words, which may have units:

circle centre=45cm,0.29 radius=50mm orientation=70deg
line start=0.4,0.3,30deg end=0.5,0.3,60deg
pose joints.crank=40deg
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from linkwork.checks import suggestion
from linkwork.cli.start import measured
from linkwork.cli.words import Fields, values
from linkwork.errors import LinkworkError
from linkwork.formats.references import amount, angles_of
from linkwork.model.task import asked_of
from linkwork.robot import Robot

POSES = ("tool", "start", "end")


@dataclass(frozen=True)
class MeasuredWords:
    """Reads the texts of goals for a robot, whose tool tells which numbers are lengths and angles.

    what: names of the tool's coordinates that a path has; those of its task if left out
    """

    robot: Robot
    what: tuple[str, ...] | None = None

    def __call__(self, fields: Fields, option: str) -> dict[str, Any]:
        """Return the values [m, rad] of the fields' texts.

        Raises:
            LinkworkError: a unit of another kind, or as many numbers as the tool is not led in.
        """
        found = values(fields, option)
        for name, text in fields.items():
            place = f"{option}: {name}"
            if name == "joints" and isinstance(text, dict):
                found[name] = self._joints(text, place)
            elif not isinstance(text, str):
                continue
            elif name in POSES:
                found[name] = self._pose(text, place)
            elif name == "poses":
                found[name] = [self._pose(pose, place) for pose in text.split(";")]
            elif name == "centre":
                found[name] = [amount(part, False, place) for part in text.split(",")]
            elif name == "radius":
                found[name] = amount(text, False, place)
            elif name == "orientation" and isinstance(fields.get("centre"), str):
                found[name] = self._turn(text, fields["centre"], place)
        return found

    def _joints(self, texts: Fields, place: str) -> dict[str, float]:
        """Return joint coordinates by name."""
        known, angles = self.robot.coordinates, angles_of(self.robot.mechanism)
        for name in texts:
            if name not in known:
                raise LinkworkError(f"{place}: there is no {name!r}{suggestion(name, known)}")
        return {
            name: amount(text, name in angles, f"{place}.{name}") for name, text in texts.items()
        }

    def _pose(self, text: str, place: str) -> list[float]:
        """Return coordinates of the tool, as many as are given."""
        return self._told(text.split(","), 0, place)

    def _turn(self, text: str, centre: str, place: str) -> float | list[float]:
        """Return the coordinates that a path holds beside its centre's."""
        found = self._told(text.split(","), len(centre.split(",")), place)
        return found if len(found) > 1 else found[0]

    def _told(self, parts: list[str], before: int, place: str) -> list[float]:
        """Return the coordinates of a tool that follow so many others."""
        self.robot.require_tool()
        task = asked_of(self.robot, before + len(parts), self.what).what[before:]
        return [measured(part, of, place) for part, of in zip(parts, task, strict=True)]
