"""Joints, ground and frames of a spatial mechanism, in three dimensions.

revolute short cylinder about its axis, cylindrical a longer one, screw a thread about it; prismatic box on its axis;
universal cross of its two axes; spherical ball; planar plate across its normal; fixed cube. Ground is hatched: a level
pad, or a rail as long as the slider needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from linkwork.views.canvas import Canvas, direction
from linkwork.views.plane import TRIAD, fixed_side, hatched
from linkwork.views.shapes import across, helix, hull, prism
from linkwork.views.skeleton import SLIDING, JointPlace
from linkwork.views.style import BLUE, EDGE, GREEN, GREY, LINK, ORANGE, PALE, VERMILION

ELEVATIONS, AZIMUTHS = (24, 34), (-56, -68, -40, -24, 22, 36)  # of the viewer [deg]; the first ones where they serve
BETTER = 0.1  # by how much another must be better
CLOSE = 0.02  # distance in the picture that counts as none, relative to the mechanism
BOXED = 3.8  # level of boxes, below that of what may turn in them
SHADE = {False: "#98a4b0", True: "#b97d00"}  # sides of round solids: passive, driven
SOLIDS = {  # circumradius, length relative to the mechanism, and sides
    "revolute": (0.02, 0.065, 12),
    "cylindrical": (0.017, 0.085, 12),
    "screw": (0.012, 0.085, 12),
    "prismatic": (0.045, 0.06, 4),
    "planar": (0.06, 0.012, 4),
    "fixed": (0.022, 0.03, 4),
}
PIN = 0.032  # half the length of a universal joint's axes, relative to the mechanism
LEVEL = 1e-6  # difference of heights that is none, relative to the mechanism
PAD = 0.045  # half the side of a pad, relative to the mechanism
ROOM = 0.56  # half the axes' length over the extent of what is drawn
THIN = 0.16  # least of it, relative to the mechanism
OVERHANG = 0.12  # of a rail beyond what the slider uses, relative to the mechanism
STROKE = 0.025  # distance of the strokes at a rail, relative to the mechanism
ZOOM, FILLED = 0.86, 0.94  # of axes beside others, leaving room for labels; part of a figure for themselves
LABEL = 9  # distance of the axes' names from their numbers [pt]
TICKS = 6


def draw_joint(canvas: Canvas, joint: JointPlace) -> None:
    """Draw a joint as its kind."""
    size, colour = canvas.size, ORANGE if joint.driven else "white"
    if joint.type == "universal":
        for axis in joint.axes:
            ends = np.stack([joint.far - PIN * size * axis, joint.far + PIN * size * axis])
            canvas.line(ends, 4, color=EDGE, lw=2.6)
        canvas.dot(joint.far, 4.2, ms=3.5, mfc=colour, mec=EDGE, mew=0.9, gid=joint.name)
        return
    if joint.type not in SOLIDS:
        canvas.dot(joint.far, 4.2, ms=6.5, mfc=colour, mec=EDGE, mew=1.2, gid=joint.name)
        return
    radius, length, sides = SOLIDS[joint.type]
    axis = joint.axes[0] if len(joint.axes) else np.array([0.0, 0.0, 1.0])
    wall, *ends = prism(joint.far, axis, radius * size, length * size, sides)
    if sides == 4:
        look = {"inside": ORANGE if joint.driven else LINK, "edge": EDGE, "alpha": 1.0, "lw": 0.8}
        canvas.faces([*wall, *ends], level=BOXED, gid=joint.name, **look)
    else:
        ends.sort(key=lambda end: float(end.mean(axis=0) @ canvas.towards))
        shade = SHADE[joint.driven]
        canvas.faces([*wall], inside=shade, edge=shade, level=4.0, alpha=1.0, lw=0.5, gid=joint.name)
        for end, level in zip(ends, (3.98, 4.02), strict=True):
            canvas.faces([end], inside=colour, edge=EDGE, level=level, alpha=1.0, lw=0.8)
    if joint.type == "screw":
        canvas.line(helix(joint.far, axis, 1.6 * radius * size, length * size), 4.1, color=EDGE, lw=0.9)
    if joint.type in SLIDING and not joint.grounded:
        canvas.line(np.stack([joint.near, joint.far]), 3.5, color=GREY, lw=1.6)


def draw_ground(canvas: Canvas, joint: Sequence[JointPlace]) -> None:
    """Draw what is fixed of a joint to the ground, over all poses: a rail, or a pad."""
    size = canvas.size
    anchors, travel = fixed_side(joint)
    if joint[-1].type in SLIDING:
        axis = joint[-1].axes[0]
        low, high = min(0.0, *travel) - OVERHANG * size, max(0.0, *travel) + OVERHANG * size
        start, stop = anchors[0] + low * axis, anchors[0] + high * axis
        canvas.line(np.stack([start, stop]), 1, color=GREY, lw=2.2, solid_capstyle="butt")
        below = -across(axis)[1]
        places = start + np.arange(STROKE * size, high - low, STROKE * size)[:, None] * axis
        canvas.line(hatched(places, 0.7 * STROKE * size * (below - axis)), 1, color=GREY, lw=0.8)
        return
    draw_stand(canvas, anchors[0])


def draw_stand(canvas: Canvas, place: np.ndarray) -> None:
    """Draw a hatched level pad at a point of the ground."""
    half = PAD * canvas.size
    square = place + half * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)])
    canvas.faces([square], PALE, GREY, 1, alpha=0.8, lw=0.8)
    c = np.linspace(-1.5, 1.5, 6)
    start, stop = np.maximum(-1, c - 1), np.minimum(1, c + 1)
    strokes = np.array([(start, start - c, 0 * c), (stop, stop - c, 0 * c)])
    lines = np.concatenate([strokes, np.full_like(strokes[:1], np.nan)]).transpose(2, 0, 1).reshape(-1, 3)
    canvas.line(place + half * lines, 1.02, color=GREY, lw=0.7)


def draw_base(canvas: Canvas, joints: Sequence[JointPlace]) -> None:
    """Draw the plate between three or more joints that stand on ground at one height."""
    standing = [joint for joint in joints if joint.grounded and joint.type not in SLIDING]
    if len(standing) < 3:
        return
    anchors = np.array([fixed_side([joint])[0][0] for joint in standing])
    plate = hull(anchors)
    if np.ptp(anchors[:, 2]) < LEVEL * canvas.size and len(plate[0]) > 2:
        canvas.faces(plate, PALE, GREY, 0.9, alpha=0.35, lw=0.8)


def draw_frame(canvas: Canvas, origin: np.ndarray, directions: np.ndarray) -> None:
    """Draw a tool's axes: x vermilion, y green, z blue."""
    for column, colour in ((0, VERMILION), (1, GREEN), (2, BLUE)):
        arrow = TRIAD * canvas.size * directions[:, column]
        canvas.axes.quiver(*origin, *arrow, color=colour, lw=1.6, arrow_length_ratio=0.3, zorder=6)


def finish(canvas: Canvas) -> None:
    """Make the axes equal, as long as what is drawn, and name them."""
    from matplotlib.ticker import MaxNLocator

    axes, points = canvas.axes, canvas.points
    middle, reach = (points.min(axis=0) + points.max(axis=0)) / 2, ROOM * np.ptp(points, axis=0)
    reach = np.maximum(reach, THIN * canvas.size)
    for letter, centre, half in zip("xyz", middle, reach, strict=True):
        getattr(axes, f"set_{letter}lim")(centre - half, centre + half)
        getattr(axes, f"set_{letter}label")(f"{letter} [m]")
        axis = getattr(axes, f"{letter}axis")
        axis.set_major_locator(MaxNLocator(max(2, round(TICKS * half / reach.max())), steps=[1, 2, 5, 10]))
        axis.set_pane_color("white")
        axis.labelpad = LABEL
    axes.set_box_aspect(reach, zoom=ZOOM)


def fit(axes: Any) -> None:
    """Let axes that have a figure for themselves stand in its middle and fill it, all that is written included."""
    figure, limits = axes.figure, (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())
    corners = np.array(list(product(*limits)))
    figure.set_layout_engine("none")
    zoom, corner = ZOOM, np.zeros(2)
    for _ in range(3):
        axes.set_position((*corner, 1, 1))
        axes.set_box_aspect(np.ptp(limits, axis=1), zoom=zoom)
        figure.draw_without_rendering()
        around = [axis.get_tightbbox().get_points() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
        around += [written_box(axes, text) for text in axes.texts]
        taken = figure.transFigure.inverted().transform(np.concatenate([on_screen(axes, corners), *around]))
        low, high = taken.min(axis=0), taken.max(axis=0)
        growth = FILLED / max(high - low)
        corner = growth * (corner + 0.5 - (low + high) / 2)
        zoom *= growth


def on_screen(axes: Any, points: np.ndarray) -> np.ndarray:
    """Return where points (k, 3) [m] are seen (k, 2) [pixels]."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    x, y, z = points.T
    return axes.transData.transform(np.transpose(proj_transform(x, y, z, axes.get_proj())[:2]))


def written_box(axes: Any, text: Any) -> np.ndarray:
    """Return two opposite corners (2, 2) of what is written at a point [pixels]."""
    half = np.array(text.get_window_extent().size) / 2
    return on_screen(axes, np.array([text.get_position_3d()])) + np.array([-half, half])


def viewpoint(points: np.ndarray) -> tuple[float, float]:
    """Return elevation and azimuth [deg] from where points (k, 3) are seen well apart: largest mean log distance."""
    unlike = np.unique(np.round(points / (np.ptp(points, axis=0).max() or 1.0), 3), axis=0)
    first, second = np.triu_indices(len(unlike), 1)
    gaps = unlike[first] - unlike[second]

    def apart(view: tuple[float, float]) -> float:
        d = direction(*view)
        seen = np.linalg.norm(gaps - np.outer(gaps @ d, d), axis=1)
        return float(np.log(seen + CLOSE).mean()) if len(gaps) else 0.0

    views = [(elevation, azimuth) for elevation in ELEVATIONS for azimuth in AZIMUTHS]
    best = max(views, key=apart)
    return best if apart(best) > apart(views[0]) + BETTER else views[0]
