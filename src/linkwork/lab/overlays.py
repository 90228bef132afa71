"""Pictures of a comparison: every source drawn over the others, and its difference from Linkwork on
a log axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.lab.comparison import NOC, PRESCRIBED, Comparison, Curve, tool_differences
from linkwork.scene.colours import BLUE, GREEN, GREY, INK, ORANGE, PALE, PINK
from linkwork.views.style import COLOURS, label_time, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
POINTS = 400  # drawn of a curve
FLOOR = 1e-16
LOOKS = {
    PRESCRIBED: {"color": "#b9c3cc", "linestyle": "-", "lw": 5.5},
    NOC: {"color": BLUE, "linestyle": "-", "lw": 2.7},
    "exudyn": {"color": ORANGE, "linestyle": (0, (5, 6)), "lw": 1.8},
    "pinocchio": {"color": INK, "linestyle": (0, (1.4, 4.1)), "lw": 1.7},
    "mujoco": {"color": GREEN, "linestyle": (6, (3, 8)), "lw": 1.8},
}
OTHER = {"color": PINK, "linestyle": (0, (4, 2)), "lw": 1.5}
THIN = {"linestyle": "-", "lw": 1.3}
OVER = {"color": INK, "linestyle": (0, (3, 4)), "lw": 1.3}


def forces_figure(comparison: Comparison) -> Figure:
    """Draw the actuator forces over time."""
    robot, (every, time) = comparison.robot, thinned(comparison)
    with styled():
        figure = new_figure(7.2, 3.0)
        axes = figure.subplots()
        for name, values, colour in zip(
            robot.actuators, comparison.forces[every].T, COLOURS, strict=False
        ):
            axes.plot(time, values, color=colour, label=name)
        axes.axhline(0, color=PALE, lw=0.8, zorder=0.5)
        axes.set_ylabel(f"actuator force [{units(comparison, 'N', 'N m')}]")
        label_time(axes, time)
        axes.legend(
            loc="upper left", ncols=len(robot.actuators), bbox_to_anchor=(0, 1.12), borderaxespad=0
        )
    return figure


def path_figure(comparison: Comparison) -> Figure:
    """Draw the tool's path, and its distance from Linkwork's over time."""
    with styled():
        figure = new_figure(9.6, 4.0)
        draw_path(
            figure.add_subplot(1, 2, 1, projection=None if comparison.robot.planar else "3d"),
            comparison,
        )
        axes = figure.add_subplot(1, 2, 2)
        every, time = thinned(comparison)
        for curve in others(comparison):
            distance, _ = tool_differences(comparison.robot, curve.tool, comparison[NOC].tool)
            axes.semilogy(time, visible(distance[every]), **look(curve) | THIN)
        axes.set_ylabel("distance from Linkwork's path [m]")
        label_time(axes, time)
        legend(figure, comparison)
    return figure


def series_figure(
    comparison: Comparison, field: str, quantity: str, linear: str, angular: str
) -> Figure:
    """Draw one quantity of the actuated joints: a panel each, below it the differences from
    Linkwork.

    field: "positions" or "accelerations" of a `Curve`; linear, angular: the units for lengths and
    for angles.
    """
    robot, (every, time) = comparison.robot, thinned(comparison)
    names = drawn(comparison, field)
    columns = min(max(len(names), 1), COLUMNS)
    blocks = -(-len(names) // columns)
    with styled():
        figure = new_figure(3.2 * columns, 4.0 * blocks)
        grid = figure.subplots(2 * blocks, columns, sharex=True, squeeze=False)
        for index, name in enumerate(names):
            block, column = divmod(index, columns)
            above, below = grid[2 * block, column], grid[2 * block + 1, column]
            unit = angular if robot.unit(name) == "rad" else linear
            for curve in comparison.curves:
                above.plot(time, values_of(comparison, curve, field, name)[every], **look(curve))
            reference = values_of(comparison, comparison[NOC], field, name)
            for curve in others(comparison):
                difference = np.abs(values_of(comparison, curve, field, name) - reference)
                below.semilogy(time, visible(difference[every]), **look(curve) | THIN)
            above.set_title(name)
            label_time(below, time)
            if column == 0:
                above.set_ylabel(f"{quantity} [{unit}]")
                below.set_ylabel(f"difference from\nLinkwork [{unit}]")
        for axes in grid.flat:
            axes.set_visible(bool(axes.lines))
        same_limits(grid[1::2])
        legend(figure, comparison)
    return figure


def summary_figure(comparison: Comparison) -> Figure:
    """Draw forces, path, accelerations and positions in four panels; the first engine as dashes
    over Linkwork's curves."""
    from matplotlib.lines import Line2D

    # Forces, accelerations and positions, by actuator.
    robot, (every, time) = comparison.robot, thinned(comparison)
    curves = comparison.engines[:1]
    with styled():
        figure = new_figure(9.0, 6.4)
        grid = figure.subplots(2, 2)
        for index, (name, colour) in enumerate(zip(robot.actuators, COLOURS, strict=False)):
            grid[0, 0].plot(time, comparison.forces[every, index], color=colour, label=name)
            for axes, field in ((grid[1, 0], "accelerations"), (grid[1, 1], "positions")):
                if name in drawn(comparison, field):
                    axes.plot(
                        time,
                        values_of(comparison, comparison[NOC], field, name)[every],
                        color=colour,
                        lw=2.2,
                    )
                    for curve in curves:
                        axes.plot(time, values_of(comparison, curve, field, name)[every], **OVER)
        # The tool's path.
        grid[0, 1].plot(*comparison[NOC].tool[every, :2].T, color=BLUE, lw=2.2)
        for curve in curves:
            grid[0, 1].plot(*curve.tool[every, :2].T, **OVER)
        frame_path(grid[0, 1], comparison)
        titles = (
            ("actuator forces", "N", "N m"),
            ("accelerations", "m/s²", "rad/s²"),
            ("positions", "m", "rad"),
        )
        for axes, (title, *names) in zip((grid[0, 0], *grid[1]), titles, strict=True):
            axes.set_title(f"{title} [{units(comparison, *names)}]")
            label_time(axes, time)
        grid[0, 1].set_title("path of the tool")
        handles = [
            *grid[0, 0].lines,
            Line2D([], [], color=GREY, lw=2.2, label="Linkwork (NOC)"),
            *(Line2D([], [], label=curve.title, **OVER) for curve in curves),
        ]
        figure.legend(
            handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6
        )
    return figure


# Parts


def draw_path(axes: Any, comparison: Comparison) -> None:
    """Draw the tool's path by every source."""
    every, _ = thinned(comparison)
    for curve in comparison.curves:
        axes.plot(*curve.tool[every, : dimensions(comparison)].T, **look(curve))
    frame_path(axes, comparison)


def frame_path(axes: Any, comparison: Comparison) -> None:
    """Mark with a dot where a path starts, and make the axes equal."""
    axes.plot(*comparison[NOC].tool[:1, : dimensions(comparison)].T, "o", color=BLUE, ms=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def dimensions(comparison: Comparison) -> int:
    return 2 if comparison.robot.planar else 3


def legend(figure: Figure, comparison: Comparison) -> None:
    """Name the sources above the panels."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label=curve.title, **look(curve)) for curve in comparison.curves]
    figure.legend(
        handles=handles,
        loc="outside upper left",
        ncols=len(handles),
        handlelength=3.6,
        columnspacing=1.6,
    )


def look(curve: Curve) -> dict[str, Any]:
    return LOOKS.get(curve.source, OTHER)


def others(comparison: Comparison) -> list[Curve]:
    """Return the curves that are compared with Linkwork's."""
    return [curve for curve in comparison.curves if curve.source != NOC]


def drawn(comparison: Comparison, field: str) -> list[str]:
    """Return the actuated joints that a field is drawn of; a free turn has rates, but no
    coordinates that belong to them."""
    robot = comparison.robot
    return [
        name for name in robot.actuators if field == "accelerations" or name in robot.coordinates
    ]


def values_of(comparison: Comparison, curve: Curve, field: str, name: str) -> np.ndarray:
    """Return a field (K,) of an actuated joint."""
    robot = comparison.robot
    if field == "accelerations":
        return curve.accelerations[:, robot.actuators.index(name)]
    return curve.positions[:, robot.coordinates.index(name)]


def thinned(comparison: Comparison) -> tuple[slice, np.ndarray]:
    """Return which samples are drawn, and their times."""
    every = slice(None, None, max(1, len(comparison.time) // POINTS))
    return every, comparison.time[every]


def visible(values: np.ndarray) -> np.ndarray:
    """Return positive values for a log axis; what is zero to rounding is left out."""
    return np.where(values > FLOOR, values, np.nan)


def units(comparison: Comparison, linear: str, angular: str) -> str:
    found = {comparison.robot.unit(name) for name in comparison.robot.actuators}
    return " or ".join(unit for kind, unit in (("m", linear), ("rad", angular)) if kind in found)


def same_limits(grid: np.ndarray) -> None:
    """Give all panels the same vertical limits."""
    shown = [axes for axes in grid.flat if axes.lines]
    limits = np.array([axes.get_ylim() for axes in shown])
    for axes in shown:
        axes.set_ylim(limits[:, 0].min(), limits[:, 1].max())
