"""What is drawn of a planar mechanism in its own way, in the xy plane: ground, tools, axes.

Ground is hatched: a bearing for what stands on it, a floor along a rail.
"""

from __future__ import annotations

import numpy as np

from linkwork.scene.colours import GREY, PALE
from linkwork.scene.symbols import SLIDER
from linkwork.views.canvas import Canvas

BEARING = 0.045  # height and half the width of a bearing, relative to the mechanism
HATCH = 0.018  # length of a stroke that marks the ground, relative to the mechanism
MARGIN = 0.06  # room around what is drawn, relative to it
STEEP = 0.5  # part of a rail's length along z from which on it is seen as a point


def draw_rail(canvas: Canvas, ends: np.ndarray) -> None:
    """Draw the floor under a slider, or a bearing where the rail is seen as a point."""
    floor = floor_of(ends, canvas.size)
    if len(floor) > 2:
        draw_stand(canvas, ends[0])
    else:
        draw_floor(canvas, *floor)


def floor_of(ends: np.ndarray, size: float) -> np.ndarray:
    """Return the line (2, 3) under a slider on a rail, or the bearing of a rail that is seen as a
    point."""
    way = (ends[1] - ends[0]) * (1, 1, 0)
    length = np.linalg.norm(way)
    if length < STEEP * np.linalg.norm(ends[1] - ends[0]):
        return bearing(ends[0], size)
    return ends + SLIDER[0] / 2 * size / length * np.array([way[1], -way[0], 0.0])


def bearing(place: np.ndarray, size: float) -> np.ndarray:
    """Return the triangle (4, 3) below a point of the ground."""
    return place + BEARING * size * np.array([(0, 0, 0), (-1, -1, 0), (1, -1, 0), (0, 0, 0)])


def draw_stand(canvas: Canvas, place: np.ndarray) -> None:
    """Draw a bearing below a point of the ground."""
    top, left, right, _ = bearing(place, canvas.size)
    inset = np.array([0.01 * canvas.size, 0.0, 0.0])
    canvas.line(np.array([left + inset, top, right - inset]), 1, color=GREY, lw=1.2)
    draw_floor(canvas, left, right)


def draw_floor(canvas: Canvas, start: np.ndarray, end: np.ndarray) -> None:
    """Draw a line of the ground from one point to another, hatched to the right."""
    length, size = float(np.linalg.norm(end - start)), canvas.size
    along = (end - start) / length
    below = np.array([along[1], -along[0], 0.0])
    canvas.line(np.stack([start, end]), 1, color=GREY, lw=1.2, solid_capstyle="butt")
    places = start + np.arange(HATCH * size, length, HATCH * size)[:, None] * along
    canvas.line(hatched(places, HATCH * size * (below - along)), 1, color=PALE, lw=0.9)


def hatched(places: np.ndarray, stroke: np.ndarray) -> np.ndarray:
    """Return strokes from places (k, 3) as one broken line."""
    return np.stack([places, places + stroke, np.full_like(places, np.nan)], axis=1).reshape(-1, 3)


def draw_arrow(canvas: Canvas, ends: np.ndarray, colour: str) -> None:
    """Draw an arrow from one point to another."""
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    canvas.axes.annotate("", ends[1][:2], ends[0][:2], arrowprops=arrow, zorder=6)
    canvas.axes.update_datalim([ends[1][:2]])


def finish(canvas: Canvas) -> None:
    """Make the axes equal and name them."""
    canvas.axes.set_aspect("equal", adjustable="datalim")
    canvas.axes.margins(MARGIN)
    canvas.axes.set_xlabel("x [m]")
    canvas.axes.set_ylabel("y [m]")
