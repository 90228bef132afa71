"""The one palette: colours that everybody can tell apart, and which of them is what in all
pictures.

Source: M. Okabe and K. Ito, Color Universal Design, 2008.
"""

from __future__ import annotations

from typing import NamedTuple

BLUE, ORANGE, GREEN, PINK = "#0072b2", "#e69f00", "#009e73", "#cc79a7"
SKY, VERMILION, YELLOW = "#56b4e9", "#d55e00", "#f0e442"
INK, GREY, PALE, WHITE = "#1f2933", "#7b8794", "#d5dbe1", "#ffffff"
EDGE, LINK, PLATE = INK, "#aab4be", "#8fc1e3"  # of bodies: their edges, bars, plates

Colour = str | tuple[float, float, float]


class RoleLook(NamedTuple):
    """Tell how a part looks: its colour, and its level in pictures, where the higher covers the
    lower."""

    colour: str
    level: float

    @property
    def grounded(self) -> bool:
        """Tell whether it stands still."""
        return self.level < 2

    @property
    def bodily(self) -> bool:
        """Tell whether it belongs to a body or bears load as one, and is drawn in every pose of
        several."""
        return 2 <= self.level < 3


LOOKS = {
    "floor": RoleLook(PALE, 0.8),  # plane or field of heights of the ground
    "base": RoleLook(PALE, 0.9),  # plate between stands
    "rail": RoleLook(GREY, 1.0),  # on the ground
    "stand": RoleLook(PALE, 1.0),  # of what is fixed to the ground
    "member": RoleLook(LINK, 2.0),  # bar or shape of a body
    "plate": RoleLook(PLATE, 2.01),  # hull of a body's points
    "rod": RoleLook(LINK, 2.02),
    "tube": RoleLook(LINK, 2.03),  # in which a rod slides
    "tip": RoleLook(WHITE, 2.5),  # of a rod
    "spring": RoleLook(INK, 2.6),
    "cable": RoleLook(INK, 2.6),
    "gear": RoleLook(GREY, 3.2),  # line between geared joints
    "mass": RoleLook(EDGE, 3.4),  # that is nearly a point
    "guide": RoleLook(GREY, 3.5),  # on which a joint slides between moving bodies
    "joint": RoleLook(WHITE, 4.0),
    "thread": RoleLook(EDGE, 4.1),  # of a screw
    "tool": RoleLook(INK, 6.0),
}
DRIVEN = ORANGE
TRIAD = (VERMILION, GREEN, BLUE)  # a tool's axes


def rgb(colour: Colour) -> tuple[int, int, int]:
    """Return red, green and blue, from 0 to 255."""
    if isinstance(colour, str):
        return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue
