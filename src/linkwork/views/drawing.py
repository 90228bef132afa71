"""Draw a mechanism in a pose: ground, bodies between their joints, joints by kind, the tool's frame.

A planar mechanism is drawn in the xy plane, a spatial one in three dimensions. A stack of states is drawn as a
stroboscopic picture: the last pose in full, the earlier ones the paler the longer ago.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.views.skeleton import JointPlace, Skeleton, hull, skeleton
from linkwork.views.style import BLUE, GREEN, GREY, INK, ORANGE, PALE, VERMILION, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIDE = 5.0  # of the picture [in]
EDGE, LINK, PLATE = INK, "#aab4be", "#8fc1e3"
OLDEST, LAST_BUT_ONE = 0.12, 0.45  # how strong earlier poses are drawn
SLIDER = np.array([0.075, 0.042])  # length and width, relative to the mechanism
TRIAD = 0.09  # length of the tool's axes, relative to the mechanism
OVERHANG = 0.07  # of a rail beyond what the slider uses, relative to the mechanism
HATCH = 0.018  # length of a stroke that marks the ground, relative to the mechanism


def plot_mechanism(robot: Robot, state: State, ax: Axes | None = None, *, names: bool = False) -> Axes:
    """Draw a robot in a state, or in a stack of states.

    Args:
        robot: the robot.
        state: one state, or a stack (K,) in the order of time.
        ax: where to draw, three-dimensional for a spatial robot; left out: axes of a new figure.
        names: write the joints' names beside them.

    Returns:
        The axes; `axes.figure` is the figure.

    Raises:
        LinkworkError: a stack of more than one dimension, or axes that do not fit.
    """
    if len(state.batch) > 1:
        raise LinkworkError(f"a stack of states of shape {state.batch} is no sequence of poses; give one dimension")
    if ax is not None and hasattr(ax, "get_zlim") == robot.planar:
        raise LinkworkError(f"this robot is drawn in {'two' if robot.planar else 'three'} dimensions; give such axes")
    poses = [skeleton(robot, state)] if not state.batch else [skeleton(robot, state.at(k)) for k in range(*state.batch)]
    with styled():
        axes: Any = ax
        if axes is None:
            axes = new_figure(SIDE, SIDE).add_subplot(projection=None if robot.planar else "3d")
        (draw_planar if robot.planar else draw_spatial)(axes, poses)
        if names:
            write_names(axes, poses[-1], 2 if robot.planar else 3)
    return axes


def strengths(count: int) -> list[float]:
    """Return how strong each pose is drawn: the last in full."""
    return [*np.linspace(OLDEST, LAST_BUT_ONE, count - 1), 1.0] if count > 1 else [1.0]


def mixed(colour: str, strength: float) -> tuple[float, ...]:
    """Return a colour mixed with white."""
    from matplotlib.colors import to_rgb

    return tuple(1 - strength * (1 - part) for part in to_rgb(colour))


def size_of(poses: list[Skeleton]) -> float:
    """Return the largest extent of the mechanism [m]."""
    points = np.concatenate([pose.points for pose in poses])
    return float(np.ptp(points, axis=0).max()) or 1.0


# In the plane


def draw_planar(axes: Any, poses: list[Skeleton]) -> None:
    size = size_of(poses)
    for joint in zip(*(pose.joints for pose in poses), strict=True):
        draw_ground(axes, joint, size)
    for level, (pose, strength) in enumerate(zip(poses, strengths(len(poses)), strict=True)):
        draw_bodies(axes, pose, strength, 2 + level / len(poses))
    for joint in poses[-1].joints:
        draw_joint(axes, joint, size)
    for origin, directions in poses[-1].tools.values():
        for column, colour in ((0, VERMILION), (1, GREEN)):
            tip = origin + TRIAD * size * directions[:, column]
            arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", tip[:2], origin[:2], arrowprops=arrow, zorder=6)
            axes.plot(*tip[:2], alpha=0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def draw_bodies(axes: Any, pose: Skeleton, strength: float, level: float) -> None:
    """Draw bodies as plates or bars; those with a single joint are shown by the joint."""
    from matplotlib.patches import Polygon

    for points in pose.bodies.values():
        face = hull(points)[0][:, :2]
        edge = mixed(EDGE, strength)
        if len(face) > 2:
            axes.add_patch(
                Polygon(face, fc=mixed(PLATE, strength), ec=edge, lw=1.3, joinstyle="round", zorder=level + 0.01)
            )
        elif len(face) == 2:
            axes.plot(*face.T, color=edge, lw=6.5, zorder=level)
            axes.plot(*face.T, color=mixed(LINK, strength), lw=4.2, zorder=level)


def draw_joint(axes: Any, joint: JointPlace, size: float) -> None:
    """Draw a revolute joint as a circle, a prismatic one as a slider along its axis, a fixed one as a square."""
    from matplotlib.patches import Polygon

    x, y = joint.far[:2]
    if joint.type == "prismatic":
        along = joint.axis[:2]
        across = np.array([-along[1], along[0]])
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) / 2 * SLIDER * size
        axes.add_patch(
            Polygon((x, y) + corners @ [along, across], fc=ORANGE, ec=EDGE, lw=1.2, joinstyle="round", zorder=4)
        )
        if not joint.grounded:
            axes.plot(*np.stack([joint.near, joint.far])[:, :2].T, color=GREY, lw=1.2, zorder=3.5)
    else:
        axes.plot(x, y, "o" if joint.type == "revolute" else "s", ms=6.5, mfc="white", mec=EDGE, mew=1.3, zorder=5)


def draw_ground(axes: Any, joint: tuple[JointPlace, ...], size: float) -> None:
    """Draw what is fixed of a joint to the ground, over all poses: a rail, or a bearing."""
    if not joint[-1].grounded:
        return
    anchor, travel, axis = fixed_side(joint)
    if joint[-1].type == "prismatic":
        low, high = min(0.0, *travel) - OVERHANG * size, max(0.0, *travel) + OVERHANG * size
        start, along, length = anchor + low * axis, axis[:2], high - low
        below = -np.array([-along[1], along[0]])
        start = start[:2] + SLIDER[1] / 2 * size * below
    else:
        start, along, length = anchor[:2] - (0.045 * size, 0.045 * size), np.array([1.0, 0.0]), 0.09 * size
        below = np.array([0.0, -1.0])
        legs = np.array([start + 0.01 * size * along, anchor[:2], start + (length - 0.01 * size) * along])
        axes.plot(*legs.T, color=GREY, lw=1.2, zorder=1)
    stop = start + length * along
    axes.plot(*np.stack([start, stop]).T, color=GREY, lw=1.2, zorder=1, solid_capstyle="butt")
    stroke = HATCH * size * (below - along)
    places = start + np.arange(HATCH * size, length, HATCH * size)[:, None] * along
    strokes = np.stack([places, places + stroke, np.full_like(places, np.nan)], axis=1).reshape(-1, 2)
    axes.plot(*strokes.T, color=PALE, lw=0.9, zorder=1)


def fixed_side(joint: tuple[JointPlace, ...]) -> tuple[np.ndarray, list[float], np.ndarray]:
    """Return the origin of the joint's frame on the ground, the travel of the other body along the axis, and the axis."""
    near = np.stack([place.near for place in joint])
    far = np.stack([place.far for place in joint])
    anchor, moving = (near, far) if np.ptp(near, axis=0).max() <= np.ptp(far, axis=0).max() else (far, near)
    axis = joint[-1].axis
    return anchor[0], [float(d @ axis) for d in moving - anchor], axis


# In space


def draw_spatial(axes: Any, poses: list[Skeleton]) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    size = size_of(poses)
    for pose, strength in zip(poses, strengths(len(poses)), strict=True):
        for points in pose.bodies.values():
            faces = hull(points)
            if len(faces[0]) > 2:
                inside, edge = mixed(PLATE, strength), mixed(EDGE, strength)
                axes.add_collection3d(Poly3DCollection(faces, alpha=0.55, lw=0.7, facecolor=inside, edgecolor=edge))
            elif len(faces[0]) == 2:
                axes.plot(*faces[0].T, color=mixed(BLUE, strength), lw=3)
    for joint in poses[-1].joints:
        draw_spatial_joint(axes, joint, size)
    for origin, directions in poses[-1].tools.values():
        for column, colour in ((0, VERMILION), (1, GREEN), (2, BLUE)):
            axes.plot(*np.stack([origin, origin + TRIAD * size * directions[:, column]]).T, color=colour, lw=1.6)
    points = np.concatenate([pose.points for pose in poses])
    middle, reach = (points.min(axis=0) + points.max(axis=0)) / 2, 0.55 * np.ptp(points, axis=0)
    reach = np.maximum(reach, 0.1 * size)
    for letter, centre, half in zip("xyz", middle, reach, strict=True):
        getattr(axes, f"set_{letter}lim")(centre - half, centre + half)
        getattr(axes, f"set_{letter}label")(f"{letter} [m]")
    axes.set_box_aspect(reach, zoom=0.86)  # leaves room for the labels


def draw_spatial_joint(axes: Any, joint: JointPlace, size: float) -> None:
    """Draw a joint as a point, with a stretch of its axis; a prismatic joint along the way it has slid."""
    reach = 0.05 * size * joint.axis
    line = [joint.near, joint.far] if joint.type == "prismatic" else [joint.far - reach, joint.far + reach]
    if joint.type != "fixed":
        colour = ORANGE if joint.type == "prismatic" else EDGE
        axes.plot(*np.stack(line).T, color=colour, lw=2.4)
    marker = "^" if joint.grounded else "o"
    axes.plot(*joint.far[:, None], marker, ms=5, mfc="white", mec=EDGE)


def write_names(axes: Any, pose: Skeleton, dimensions: int) -> None:
    """Write the joints' names a little outside of the joints; names at the same place stand one below the other."""
    size, middle = size_of([pose]), pose.points.mean(axis=0)
    places: dict[tuple[float, ...], list[str]] = {}
    for joint in pose.joints:
        places.setdefault(tuple(np.round(joint.far / size, 3)), []).append(joint.name)
    for place, names in places.items():
        outwards = np.array(place) * size - middle
        outwards *= 0.06 * size / (np.linalg.norm(outwards) or 1.0)
        side = "left" if outwards[0] > 0 else "right"
        spot = np.array(place) * size + outwards
        ground = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 1.0}
        style = {"ha": side, "va": "center", "fontsize": 8, "linespacing": 1.1, "zorder": 7}
        axes.text(*spot[:dimensions], "\n".join(names), bbox=ground, **style)
