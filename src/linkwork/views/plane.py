"""Joints, ground and frames of a planar mechanism, in the xy plane.

revolute circle, spherical circle with a point, universal circle with a cross, planar diamond, fixed square; what slides
in the plane a slider on its line. Ground is hatched: a bearing, or a rail as long as the slider needs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkwork.mechanism import GROUND
from linkwork.views.canvas import Canvas
from linkwork.views.skeleton import SLIDING, JointPlace
from linkwork.views.style import EDGE, GREEN, GREY, LINK, ORANGE, PALE, VERMILION

SLIDER = np.array([0.075, 0.042])  # length and width, relative to the mechanism
TRIAD = 0.09  # length of the tool's axes, relative to the mechanism
OVERHANG = 0.07  # of a rail beyond what the slider uses, relative to the mechanism
BEARING = 0.045  # height and half the width of a bearing, relative to the mechanism
HATCH = 0.018  # length of a stroke that marks the ground, relative to the mechanism
MARGIN = 0.06  # room around what is drawn, relative to it
MARKERS = {"fixed": "s", "planar": "D"}
INSIDE = {"spherical": (".", 3.5), "universal": ("x", 4.5), "screw": ("2", 5.0)}


def slides(joint: JointPlace) -> bool:
    """Tell whether a joint slides along an axis in the plane."""
    return joint.type in SLIDING and abs(joint.axes[0][2]) < 0.5


def draw_joint(canvas: Canvas, joint: JointPlace) -> None:
    """Draw a joint as its kind."""
    if slides(joint):
        along = joint.axes[0]
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) / 2 * SLIDER * canvas.size
        box = joint.far + corners @ [along, (-along[1], along[0], 0.0)]
        canvas.faces([box], ORANGE if joint.driven else LINK, EDGE, 4, lw=1.2, gid=joint.name)
        if not joint.grounded:
            canvas.line(np.stack([joint.near, joint.far]), 3.5, color=GREY, lw=1.2)
        return
    colour = ORANGE if joint.driven else "white"
    canvas.dot(joint.far, 5, MARKERS.get(joint.type, "o"), ms=6.5, mfc=colour, mec=EDGE, mew=1.3, gid=joint.name)
    if joint.type in INSIDE:
        marker, size = INSIDE[joint.type]
        canvas.dot(joint.far, 5.1, marker, ms=size, mfc=EDGE, mec=EDGE)


def draw_ground(canvas: Canvas, joint: Sequence[JointPlace]) -> None:
    """Draw what is fixed of a joint to the ground, over all poses: a rail, or a bearing."""
    size, (anchors, travel) = canvas.size, fixed_side(joint)
    if slides(joint[-1]):
        axis = joint[-1].axes[0]
        low, high = min(0.0, *travel) - OVERHANG * size, max(0.0, *travel) + OVERHANG * size
        below = np.array([axis[1], -axis[0], 0.0])
        draw_floor(canvas, anchors[0] + low * axis + SLIDER[1] / 2 * size * below, (high - low) * axis, below)
    elif joint[-1].type != "planar":
        draw_stand(canvas, anchors[0])


def draw_stand(canvas: Canvas, place: np.ndarray) -> None:
    """Draw a bearing below a point of the ground."""
    along, below = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
    half, inset = BEARING * canvas.size, 0.01 * canvas.size
    left, right = place + half * (below - along), place + half * (below + along)
    canvas.line(np.array([left + inset * along, place, right - inset * along]), 1, color=GREY, lw=1.2)
    draw_floor(canvas, left, right - left, below)


def draw_floor(canvas: Canvas, start: np.ndarray, way: np.ndarray, below: np.ndarray) -> None:
    """Draw a line of the ground from a point along a vector, hatched below."""
    length, size = float(np.linalg.norm(way)), canvas.size
    along = way / length
    canvas.line(np.stack([start, start + way]), 1, color=GREY, lw=1.2, solid_capstyle="butt")
    places = start + np.arange(HATCH * size, length, HATCH * size)[:, None] * along
    canvas.line(hatched(places, HATCH * size * (below - along)), 1, color=PALE, lw=0.9)


def fixed_side(joint: Sequence[JointPlace]) -> tuple[np.ndarray, list[float]]:
    """Return the joint's origin on the ground in every pose (K, 3), and the travel of the other body along the axis."""
    sides = [(place.near, place.far) if place.connects[0] == GROUND else (place.far, place.near) for place in joint]
    axis = joint[-1].axes[0] if len(joint[-1].axes) else np.zeros(3)
    return np.array([anchor for anchor, _ in sides]), [float((moving - anchor) @ axis) for anchor, moving in sides]


def hatched(places: np.ndarray, stroke: np.ndarray) -> np.ndarray:
    """Return strokes from places (k, 3) as one broken line."""
    return np.stack([places, places + stroke, np.full_like(places, np.nan)], axis=1).reshape(-1, 3)


def draw_base(canvas: Canvas, joints: Sequence[JointPlace]) -> None:
    """Draw nothing: in the plane the ground is behind everything."""


def draw_frame(canvas: Canvas, origin: np.ndarray, directions: np.ndarray) -> None:
    """Draw a tool's axes: x vermilion, y green."""
    for column, colour in ((0, VERMILION), (1, GREEN)):
        tip = origin + TRIAD * canvas.size * directions[:, column]
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
        canvas.axes.annotate("", tip[:2], origin[:2], arrowprops=arrow, zorder=6)
        canvas.axes.update_datalim([tip[:2]])


def finish(canvas: Canvas) -> None:
    """Make the axes equal and name them."""
    canvas.axes.set_aspect("equal", adjustable="datalim")
    canvas.axes.margins(MARGIN)
    canvas.axes.set_xlabel("x [m]")
    canvas.axes.set_ylabel("y [m]")
