"""Draw a mechanism in a pose: ground, bodies as their shapes or between their joints, joints by kind, springs, tools.

A planar mechanism is drawn in the xy plane (`plane`), a spatial one in three dimensions (`space`). A stack of states is
drawn as a stroboscopic picture: the last pose in full, the earlier ones the paler the longer ago. Driven joints are orange.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.views import plane, space
from linkwork.views.canvas import Canvas
from linkwork.views.names import write_names
from linkwork.views.shapes import hull, zigzag
from linkwork.views.skeleton import Skeleton, skeleton
from linkwork.views.style import EDGE, GREY, INK, LINK, ORANGE, PLATE, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIDE = 5.0  # of the picture [in]
OLDEST, LAST_BUT_ONE = 0.12, 0.45  # how strong earlier poses are drawn
BAR, ROD, TUBE = 4.2, 2.0, 6.5  # widths [pt]
COIL = 0.05  # width of a spring, relative to the mechanism
TUBED = 0.55  # part of a telescope's length that is its tube


def plot_mechanism(robot: Robot, state: State, ax: Axes | None = None, *, names: bool | Sequence[str] = False) -> Axes:
    """Draw a robot in a state, or in a stack of states.

    Args:
        robot: the robot.
        state: one state, or a stack (K,) in the order of time.
        ax: where to draw, three-dimensional for a spatial robot; left out: axes of a new figure.
        names: write the joints' names beside them: of all joints, or of these.

    Returns:
        The axes; `axes.figure` is the figure.

    Raises:
        LinkworkError: a stack of more than one dimension or of no states, axes that do not fit, a name that is no joint's.
    """
    if len(state.batch) > 1 or 0 in state.batch:
        raise LinkworkError(f"a stack of states of shape {state.batch} is no sequence of poses; give one dimension")
    if ax is not None and hasattr(ax, "get_zlim") == robot.planar:
        raise LinkworkError(f"this robot is drawn in {'two' if robot.planar else 'three'} dimensions; give such axes")
    shown = named(robot, names)
    poses = [skeleton(robot, state)] if not state.batch else [skeleton(robot, state.at(k)) for k in range(*state.batch)]
    points = np.concatenate([pose.points for pose in poses])
    with styled():
        axes: Any = new_axes(points, robot.planar) if ax is None else ax
        draw(Canvas.on(axes, points), poses, shown)
        if ax is None and not robot.planar:
            space.fit(axes)
    return axes


def new_axes(points: np.ndarray, planar: bool) -> Any:
    """Return axes of a new figure in two dimensions, or in three from where the points are seen well apart."""
    figure = new_figure(SIDE, SIDE)
    if planar:
        return figure.add_subplot()
    elevation, azimuth = space.viewpoint(points)
    return figure.add_subplot(projection="3d", elev=elevation, azim=azimuth)


def named(robot: Robot, names: bool | Sequence[str]) -> tuple[str, ...]:
    """Return the joints whose names are written."""
    if isinstance(names, bool):
        return robot.joints if names else ()
    for name in names:
        if name not in robot.joints:
            raise LinkworkError(f"there is no joint {name!r}; the joints are {', '.join(robot.joints)}")
    return tuple(names)


def draw(canvas: Canvas, poses: Sequence[Skeleton], names: Sequence[str] = ()) -> None:
    """Draw a mechanism in poses in the order of time; the joints only in the last one."""
    symbols = plane if canvas.flat else space
    last = poses[-1]
    symbols.draw_base(canvas, last.joints)
    for places in zip(*(pose.joints for pose in poses), strict=True):
        if places[-1].grounded:
            symbols.draw_ground(canvas, places)
    for place in last.anchors:
        symbols.draw_stand(canvas, place)
    for level, (pose, strength) in enumerate(zip(poses, strengths(len(poses)), strict=True)):
        draw_members(canvas.at(strength, 2 + level / len(poses)), pose)
    for joints in last.gears.values():
        canvas.line(np.stack([joint.far for joint in joints]), 3.2, color=GREY, lw=1.2, linestyle=(0, (3, 2)))
    for place in last.masses.values():
        canvas.dot(place, 3.4, ms=15, mfc=EDGE, mec=EDGE)
    for joint in last.joints:
        if joint.type != "rod" and not joint.tubed:
            symbols.draw_joint(canvas, joint)
    for tool in last.tools.values():
        symbols.draw_frame(canvas, *tool)
    write_names(canvas, last, names)
    symbols.finish(canvas)


def strengths(count: int) -> list[float]:
    """Return how strong each pose is drawn: the last in full."""
    return [*np.linspace(OLDEST, LAST_BUT_ONE, count - 1), 1.0] if count > 1 else [1.0]


# Members


def draw_members(canvas: Canvas, pose: Skeleton) -> None:
    """Draw bodies as their shapes, or as plates, bars or arcs (one point is shown by its joint); rods, telescopes, springs."""
    for solids in pose.solids.values():
        for solid in solids:
            canvas.solid(solid, 0.01)
    for points in (points for name, points in pose.bodies.items() if name not in pose.solids):
        faces = hull(points * (1, 1, 0) if canvas.flat else points)
        if len(faces[0]) > 2:
            look = {"lw": 1.3} if canvas.flat else {"lw": 0.8, "alpha": 0.6}
            canvas.faces(faces, PLATE, EDGE, 0.01, **look)
        elif len(faces[0]) == 2:
            canvas.bar(faces[0], BAR, LINK)
    for points in pose.arcs.values():
        canvas.bar(points, BAR, LINK)
    for joint in pose.joints:
        if joint.type == "rod":
            canvas.bar(np.stack([joint.near, joint.far]), ROD, LINK, gid=joint.name)
            for end in (joint.near, joint.far):
                canvas.dot(end, 0.5, ms=4, mfc="white", mec=EDGE, mew=1.0)
        elif joint.tubed:
            middle = joint.near + TUBED * (joint.far - joint.near)
            canvas.bar(np.stack([middle, joint.far]), ROD + 0.8, LINK)
            canvas.bar(np.stack([joint.near, middle]), TUBE, ORANGE if joint.driven else LINK, gid=joint.name)
    for start, end in pose.springs.values():
        aside = np.cross((0.0, 0.0, 1.0) if canvas.flat else canvas.towards, end - start)
        canvas.line(zigzag(start, end, COIL * canvas.size, aside), 0.6, color=INK, lw=1.2, solid_joinstyle="round")
