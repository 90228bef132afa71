"""What the tool reaches from where it is, as a surface in space or an area in the plane, and where
it is actuator-singular there: det A changes its sign between two poses that are reached.

The tool's other coordinates stay as they are. Coarse grids find how far it reaches, a finer one
how.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.algebra import wrapped
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.views.volume import surface

if TYPE_CHECKING:
    import xarray

AXES = ("x", "y", "z")
AROUND = 2.5  # how far the tool's reach is looked for to all sides, relative to the mechanism
LEAP = 4.0  # moves of the actuators from pose to pose, over the usual ones, that are leaps
COARSE, FINE = {2: 33, 3: 13}, {2: 121, 3: 27}  # grid points along an axis, by how many there are


@dataclass(frozen=True, eq=False)
class Reach:
    """Hold what is drawn: corners (V, 3) [m] and triangles (F, 3) of what is reached, the same of
    where it is singular in space, and lines (s, 2, 3) of that in the plane [m].

    cut: whether more may be reached than was looked for
    """

    corners: np.ndarray
    triangles: np.ndarray
    singular_corners: np.ndarray
    singular_triangles: np.ndarray
    singular_lines: np.ndarray
    cut: bool


def reach_of(robot: Robot, state: State, size: float) -> Reach:
    """Return what the tool reaches from a state, on its working mode.

    Args:
        size: of the mechanism [m].

    Raises:
        LinkworkError: a tool that is not led in two or three of x, y, z, or one that reaches
            nothing around where it is.
    """
    robot.require_tool()
    values = dict(zip(robot.task, np.asarray(robot.task_values(state)).tolist(), strict=True))
    led = [name for name in AXES if name in values]
    if len(led) < 2:
        raise LinkworkError(
            f"the tool is led in {', '.join(robot.task)}; what it reaches is shown where these are "
            "two or three of x, y, z and others"
        )
    # Coarse looks around, then a fine one, each at what was reached and one step more.
    whole = {name: (values[name] - AROUND * size, values[name] + AROUND * size) for name in led}
    ends = narrowed(mapped(robot, state, values, whole, COARSE[len(led)]), whole)
    ends = narrowed(mapped(robot, state, values, ends, COARSE[len(led)]), ends)
    fine = mapped(robot, state, values, ends, FINE[len(led)])
    cut = any(
        low <= whole[name][0] or high >= whole[name][1]
        for name, (low, high) in spans(fine, led).items()
    )
    if len(led) == 3:
        return in_space(robot, fine, led, cut)
    return in_plane(fine, values, led, cut)


def narrowed(
    found: xarray.Dataset, ends: dict[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Return ends one step beyond what is reached, but within the given ones."""
    narrow = {}
    for name, (low, high) in spans(found, list(ends)).items():
        step = float(found[name][1] - found[name][0])
        narrow[name] = max(low - step, ends[name][0]), min(high + step, ends[name][1])
    return narrow


def spans(found: xarray.Dataset, led: list[str]) -> dict[str, tuple[float, float]]:
    """Return the least and the greatest values of coordinates that are reached.

    Raises:
        LinkworkError: nothing is.
    """
    if not found["reachable"].any():
        raise LinkworkError("no pose around the present one is reached on this working mode")
    told = {}
    for name in led:
        others = [other for other in led if other != name]
        reached = found[name].values[found["reachable"].any(others).values]
        told[name] = float(reached.min()), float(reached.max())
    return told


def mapped(
    robot: Robot,
    state: State,
    values: dict[str, float],
    ends: dict[str, tuple[float, float]],
    count: int,
) -> xarray.Dataset:
    """Map the workspace between ends of some coordinates, the others at their values."""
    from linkwork.analysis import workspace

    grid = {
        name: np.linspace(*ends[name], count) if name in ends else values[name]
        for name in robot.task
    }
    return workspace(robot, grid, guess=state)


def in_space(robot: Robot, found: xarray.Dataset, led: list[str], cut: bool) -> Reach:
    """Return the surface of what is reached, and that between the signs of det A within."""
    axes = [found[name].values for name in led]
    inside = found["reachable"].transpose(*led).values
    positive = inside & (found["det_A"].transpose(*led).values > 0)
    whole, parted = surface(inside, axes), surface(positive, axes)
    # Between two poses that are reached, and from one to the other without a leap of the legs.
    on_grid = ((parted.beyond >= 0) & (parted.beyond < inside.shape)).all(axis=1)
    here, there = (tuple(side[on_grid].T) for side in (parted.points, parted.beyond))
    q = found["actuator_position"].transpose(*led, "actuator").values
    moves = np.abs(wrapped_where(robot, q[here] - q[there])).max(axis=1, initial=0.0)
    usual = [np.abs(wrapped_where(robot, np.diff(q, axis=k))).max(axis=-1) for k in range(3)]
    most = LEAP * np.nanmedian(np.concatenate([part.ravel() for part in usual]))
    faces = parted.faces[on_grid][inside[there] & (moves <= most)]
    return Reach(*split(whole.faces), *split(faces), np.empty((0, 2, 3)), cut)


def wrapped_where(robot: Robot, moves: np.ndarray) -> np.ndarray:
    """Return moves of the actuators (..., n), those of angles the short way round [m, rad]."""
    angular = np.array([robot.unit(name) == "rad" for name in robot.actuators])
    return np.where(angular, wrapped(moves), moves)


def in_plane(found: xarray.Dataset, values: dict[str, float], led: list[str], cut: bool) -> Reach:
    """Return a rectangle about each point that is reached, and the lines on which det A is zero."""
    from linkwork.analysis import loci

    first, second = (found[name].values for name in led)
    columns = [AXES.index(name) for name in led]
    height = values.get(next(name for name in AXES if name not in led), 0.0)
    inside = np.argwhere(found["reachable"].transpose(*led).values)
    steps = np.array([first[1] - first[0], second[1] - second[0]]) / 2
    around = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * steps
    middles = np.column_stack([first[inside[:, 0]], second[inside[:, 1]]])

    def lifted(points: np.ndarray) -> np.ndarray:
        placed = np.full((*points.shape[:-1], 3), height)
        placed[..., columns] = points
        return placed

    lines = [
        np.stack(ends)
        for line in loci(found.transpose(*led, ...), "det_A")
        for ends in pairwise(line)
    ]
    nothing = np.empty((0, 3)), np.empty((0, 3), int)
    drawn = lifted(np.array(lines).reshape(-1, 2, 2))
    return Reach(*split(lifted(middles[:, None] + around)), *nothing, drawn, cut)


def split(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return corners (4 F, 3) and triangles (2 F, 3) of four-cornered faces (F, 4, 3)."""
    first = 4 * np.arange(len(faces))[:, None]
    triangles = np.concatenate([first + np.array(k) for k in ((0, 1, 2), (0, 2, 3))])
    return faces.reshape(-1, 3), triangles
