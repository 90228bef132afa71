"""Timed paths drawn: coordinates, speeds, accelerations and jerks over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import needed, shown
from linkwork.errors import LinkworkError
from linkwork.mechanism import task
from linkwork.model.task import asked_of
from linkwork.motions import TimedPath
from linkwork.motions.tables import labels_of
from linkwork.robot import Robot
from linkwork.views.style import label_time, look, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = ("coordinate", "speed", "acceleration", "jerk")
UNITS = {
    "m": ("m", "m/s", "m/s²", "m/s³"),
    "rad": ("rad", "rad/s", "rad/s²", "rad/s³"),
    "1": ("1", "1/s", "1/s²", "1/s³"),
}  # of coordinates and their derivatives
SAMPLES = 400  # on each piece of a profile or path
WIDTH, HEIGHT = 7.2, 1.7  # of a panel [in]


def plot_timed_path(timed: TimedPath, robot: Robot | None = None) -> Figure:
    """Draw the coordinates of a timed path over time with their derivatives, the jerk where it is
    known; the grey lines are where points are passed.

    Args:
        timed: made by `linkwork.motions`.
        robot: whose joints or tool it leads, for names and units; left out: both units are shown.

    Returns:
        A matplotlib figure with one panel for each derivative.

    Raises:
        LinkworkError: what is no timed path.
    """
    if not isinstance(timed, TimedPath):
        raise LinkworkError(
            f"what is drawn is {shown(timed)}; give a timed path made by linkwork.motions"
        )
    if robot is not None:
        needed(robot, Robot)
    time, parts = sampled(timed)
    count = parts[0].shape[1]
    known = timed.names or robot is not None or count in (2, 6)
    labels = labels_of(timed, count, robot) if known else unnamed(count)
    with styled():
        figure = new_figure(WIDTH, HEIGHT * len(parts))
        grid = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
        for order, (axes, values) in enumerate(zip(grid, parts, strict=True)):
            for moment in timed.passed:
                axes.axvline(moment, color="0.8", linewidth=0.8)
            for index, name in enumerate(labels):
                axes.plot(time, values[:, index], label=name, **look(index))
            axes.set_ylabel(f"{TITLES[order]}\n[{unit(timed, count, order, robot)}]")
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.03), "borderaxespad": 0}
        grid[0].legend(labelspacing=0.3, **place)
        label_time(grid[-1], time)
    return figure


def sampled(timed: TimedPath) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return times, and coordinates with their derivatives (K, d) at these; jumps are upright."""
    if timed.profile is None:
        time = np.linspace(0, timed.duration, SAMPLES)
        return time, [*timed.sample(time)]
    edges = timed.profile.knots
    rows = [np.linspace(a, b, SAMPLES // len(edges) + 2) for a, b in pairwise(edges)]
    for row in rows[:-1]:
        row[-1] = np.nextafter(row[-1], 0)
    time = np.concatenate(rows)
    return time, [timed.profile(time, order) for order in range(4)]


def unnamed(count: int) -> tuple[str, ...]:
    """Return names of coordinates of a tool that is not known."""
    if count == 3:
        return "x", "y", "angle or z"
    return tuple(f"coordinate {k}" for k in range(1, count + 1))


def unit(timed: TimedPath, count: int, order: int, robot: Robot | None) -> str:
    """Return the units of coordinates or their derivatives."""
    own = None if robot is None else units_of(timed, count, robot)
    kinds = [*UNITS][:2] if own is None else [kind for kind in UNITS if kind in own]
    return ", ".join(UNITS[kind][order] for kind in kinds)


def units_of(timed: TimedPath, count: int, robot: Robot) -> list[str]:
    """Return m, rad or 1 of the joints of a path, or of the coordinates of the tool."""
    if timed.names:
        return [robot.unit(name) for name in timed.names]
    return [task.unit(item) for item in asked_of(robot, count).what]
