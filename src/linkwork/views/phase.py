"""Phase portraits: rates over coordinates, one panel for each joint coordinate, one curve for each
run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import names, needed
from linkwork.errors import LinkworkError
from linkwork.simulation import Run
from linkwork.views.style import look, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMED = 6  # runs in a row of the legend
COLUMNS, SIDE = 3, 3.3  # panels in a row, and their width [in]


def plot_phase(runs: Run | Sequence[Run], coordinates: str | Sequence[str] | None = None) -> Figure:
    """Draw rates over joint coordinates: the ring is where a curve begins, the dot where it ends.

    A run that saved each of few steps is drawn between them, too (`Run.smooth`).

    Args:
        runs: one run, or several of robots with the same joints.
        coordinates: names of joint coordinates that have a rate of the same name (not of the
            quaternions of free turns); left out: those of the actuated joints, or of all joints if
            none is actuated.

    Returns:
        A matplotlib figure.

    Raises:
        LinkworkError: no run, a coordinate that one of the runs does not hold, or whose rate has
            another name.
    """
    # What is drawn.
    several = isinstance(runs, Iterable) and not isinstance(runs, str | Run)
    given: list[Run] = list(runs) if several else [runs]  # pyright: ignore
    if not given:
        raise LinkworkError("there is no run to draw; give one or several")
    for run in given:
        needed(run, Run)
    asked = [coordinates] if isinstance(coordinates, str) else coordinates
    wanted = (asked is not None and names(asked, "coordinates")) or usual(given[0])
    if not wanted:
        raise LinkworkError(
            "no coordinate is named; name some of " + ", ".join(portrayed(given[0]))
        )
    curves = [[curve(run.smooth, name) for name in wanted] for run in given]
    # A plane for each coordinate, a curve in it for each run.
    columns = min(len(wanted), COLUMNS)
    rows = -(-len(wanted) // columns)
    with styled():
        figure = new_figure(SIDE * columns, 0.88 * SIDE * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, name in zip(grid.flat, wanted, strict=False):
            symbol = unit(given[0], name)
            axes.set(title=name, xlabel=f"position [{symbol}]", ylabel=f"rate [{symbol}/s]")
        for index, of_run in enumerate(curves):
            colour, name = look(index), f"run {index + 1}"
            for axes, points in zip(grid.flat, of_run, strict=False):
                axes.plot(*points, label=name, **colour)
                axes.plot(*points[:, :1], "o", mfc="white", mec=colour["color"], ms=5.5, zorder=3)
                axes.plot(*points[:, -1:], "o", color=colour["color"], ms=5.5, zorder=3)
        for axes in list(grid.flat)[len(wanted) :]:
            axes.set_visible(False)
        if len(given) > 1:
            told = grid.flat[0].get_legend_handles_labels()
            figure.legend(*told, loc="outside lower center", ncols=min(len(given), NAMED))
    return figure


def portrayed(run: Run) -> list[str]:
    """Return the coordinates that have a rate of the same name."""
    rates = set(map(str, run.coords["rate"].values))
    return [name for name in map(str, run.coords["coordinate"].values) if name in rates]


def usual(run: Run) -> list[str]:
    """Return the actuated ones of these coordinates, or all if there are none."""
    found, driven = portrayed(run), set(map(str, run.coords["actuator"].values))
    return [name for name in found if name in driven] or found


def curve(run: Run, name: str) -> np.ndarray:
    """Return position and rate (2, K) of a joint coordinate."""
    if name not in portrayed(run):
        raise LinkworkError(
            f"the run holds no coordinate {name!r} with a rate of its name; it holds "
            f"{', '.join(portrayed(run))}"
        )
    parts = (("joint_position", "coordinate"), ("joint_rate", "rate"))
    return np.stack(
        [
            run.variables[of].values[:, list(run.coords[axis].values).index(name)]
            for of, axis in parts
        ]
    )


def unit(run: Run, name: str) -> str:
    """Return the unit of a joint coordinate: m or rad."""
    axis = run.coords["coordinate"]
    return str(axis.attrs["unit_of_each"]).split(", ")[list(axis.values).index(name)]
