"""Draw a mechanism in a pose: all parts of its scene, by their form and role.

A planar mechanism is drawn in the xy plane (`plane`), a spatial one in three dimensions (`space`).
A stack of states is drawn as a stroboscopic picture: the last pose in full, the earlier ones the
paler the longer ago. Driven joints are orange.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork import checks
from linkwork.checks import needed
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.scene.colours import EDGE, GREY
from linkwork.scene.curves import zigzag
from linkwork.scene.meshes import BLOCK, PlacedMesh
from linkwork.scene.parts import Bar, Coil, Hull, ScenePart
from linkwork.scene.scene import Scene, scene_of
from linkwork.views import plane, space
from linkwork.views.canvas import Canvas
from linkwork.views.lettering import write_names
from linkwork.views.style import new_figure, require_axes, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIDE = 5.0  # of the picture [in]
OLDEST, LAST_BUT_ONE = 0.12, 0.45  # how strong earlier poses are drawn
# Levels of joints that are boxes, below what may turn in them, and that are dots.
BOXED, DOTTED = -0.2, 0.2
BARS = ("member", "rod", "tube")


def plot_mechanism(
    robot: Robot, state: State, ax: Axes | None = None, *, names: bool | Sequence[str] = False
) -> Axes:
    """Draw a robot in a state, or in a stack of states.

    Args:
        robot: the robot.
        state: one state, or a stack (K,) in the order of time.
        ax: where to draw, three-dimensional for a spatial robot; left out: axes of a new figure.
        names: write the joints' names beside them: of all joints, or of these.

    Returns:
        The axes; `axes.figure` is the figure.

    Raises:
        LinkworkError: a stack of more than one dimension or of no states, axes that do not fit, a
            name that is no joint's.
    """
    needed(robot, Robot)
    needed(state, State)
    require_axes(ax)
    if len(state.batch) > 1 or 0 in state.batch:
        raise LinkworkError(
            f"a stack of states of shape {state.batch} is no sequence of poses; give one dimension"
        )
    if ax is not None and hasattr(ax, "get_zlim") == robot.planar:
        raise LinkworkError(
            f"this robot is drawn in {'two' if robot.planar else 'three'} dimensions; give such "
            "axes"
        )
    shown = named(robot, names)
    scene = scene_of(robot, state.at(-1) if state.batch else state, state)
    with styled():
        axes: Any = new_axes(scene.points, robot.planar) if ax is None else ax
        draw(Canvas.on(axes, scene.points), scene, shown)
        if ax is None and not robot.planar:
            space.fit(axes)
    return axes


def new_axes(points: np.ndarray, planar: bool) -> Any:
    """Return axes of a new figure in two dimensions, or in three from where the points are seen
    well apart."""
    figure = new_figure(SIDE, SIDE)
    if planar:
        return figure.add_subplot()
    elevation, azimuth = space.viewpoint(points)
    return figure.add_subplot(projection="3d", elev=elevation, azim=azimuth)


def named(robot: Robot, names: bool | Sequence[str]) -> tuple[str, ...]:
    """Return the joints whose names are written."""
    if isinstance(names, bool):
        return robot.joints if names else ()
    asked = checks.names(names, "names")
    for name in asked:
        if name not in robot.joints:
            raise LinkworkError(
                f"there is no joint {name!r}; the joints are {', '.join(robot.joints)}"
            )
    return asked


def draw(canvas: Canvas, scene: Scene, names: Sequence[str] = ()) -> None:
    """Draw a scene in its poses in the order of time; all but its bodies only in the last one."""
    earlier = list(enumerate(strengths(scene.count)))[:-1]
    for part in scene.parts:
        for k, strength in earlier if part.look.bodily else ():
            paint(canvas.at(strength, k / scene.count), part.at(scene.moves_to(k)))
        paint(canvas.at(1.0, len(earlier) / scene.count if part.look.bodily else 0.0), part)
    write_names(canvas, scene.pose, names)
    (plane if canvas.flat else space).finish(canvas)


def strengths(count: int) -> list[float]:
    """Return how strong each pose is drawn: the last in full."""
    return [*np.linspace(OLDEST, LAST_BUT_ONE, count - 1), 1.0] if count > 1 else [1.0]


def paint(canvas: Canvas, part: ScenePart) -> None:
    """Draw a part by its form and role."""
    match part.form:
        case PlacedMesh() as piece:
            paint_piece(canvas, part, piece)
        case Bar() as line:
            paint_line(canvas, part, line)
        case Hull() as hull:
            edge, alpha = (GREY, 0.35) if part.look.grounded else (EDGE, 0.6)
            look = {"lw": 1.3} if canvas.flat else {"lw": 0.8, "alpha": alpha}
            canvas.faces(hull.faces, part.colour, edge, part.look.level, **look)
        case Coil() as coil:
            start, end = coil.points
            aside = np.cross((0.0, 0.0, 1.0) if canvas.flat else canvas.towards, end - start)
            points = zigzag(start, end, 2 * coil.radius, aside)
            canvas.line(points, part.look.level, color=part.colour, lw=1.2, solid_joinstyle="round")


def paint_piece(canvas: Canvas, part: ScenePart, piece: PlacedMesh) -> None:
    """Draw a solid; a pad as ground, and balls and what is seen along its axis as dots, but for the
    shapes of bodies."""
    level, gid = part.look.level, part.name if part.standing else None
    if part.role == "stand":
        (plane if canvas.flat else space).draw_stand(canvas, piece.position)
    elif part.role != "member" and piece.is_disc(canvas.flat):
        look = {
            "ms": canvas.width(piece.scale[0]),
            "mfc": part.colour,
            "mec": EDGE,
            "mew": 1.2,
            "gid": gid,
        }
        canvas.dot(piece.position, level + DOTTED, **look)
    else:
        boxed = part.role == "joint" and piece.mesh is BLOCK
        canvas.piece(piece, part.colour, level + BOXED if boxed else level, gid)


def paint_line(canvas: Canvas, part: ScenePart, line: Bar) -> None:
    """Draw a line: a rail or floor as ground, an arrow of a tool, a bar with dark edges, or a thin
    line, dashed between gears."""
    symbols, gid = plane if canvas.flat else space, part.name if part.standing else None
    if part.role == "rail":
        symbols.draw_rail(canvas, line.points)
    elif part.role == "floor":
        for start, end in pairwise(line.points):
            plane.draw_floor(canvas, start, end)
    elif part.role == "tool":
        symbols.draw_arrow(canvas, line.points, str(part.colour))
    elif part.role in BARS:
        canvas.bar(line.shown, part.look.level, canvas.width(line.radius), part.colour, gid)
    else:
        dashes = {"linestyle": (0, (3, 2))} if part.role == "gear" else {}
        look = {"color": part.colour, "lw": canvas.width(line.radius)}
        canvas.line(line.shown, part.look.level, **look, **dashes)
