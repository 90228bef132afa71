"""Plots of a run: named quantities over time, one panel for each unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.model.labels import POSE_ANGLES
from linkwork.simulation import Run
from linkwork.views.style import label_time, look, new_figure, styled

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


TIME = "time"
USUAL = ("tool_pose", "joint_position", "joint_rate", "actuator_force")
WIDTH, HEIGHT = 7.2, 2.1  # of a panel and its legend [in]
CURVES, DASH, LETTER = 5.6, 0.5, 0.068  # widths of what a panel and its legend are made of [in]
LEGEND_ROWS = 9
NOISE = 1e-11  # change of a quantity that is rounding, relative to its scale
PER = {"": 0, "s": 1, "s^2": 2}  # powers of time in rates and accelerations
MARGIN = 0.05  # about curves at rest, relative to their scale
ONE = "o"  # marker of a single sample, which has no line


@dataclass(frozen=True)
class Panel:
    """Hold curves (K, c) of one quantity in one unit, each with its name.

    scale: what would be much of the quantity; 0 where that is not known
    """

    quantity: str
    unit: str
    names: tuple[str, ...]
    values: np.ndarray
    scale: float = 0.0

    @property
    def legend_columns(self) -> int:
        """Return how many columns the names take."""
        return -(-len(self.names) // LEGEND_ROWS)

    @property
    def width(self) -> float:
        """Return the width of curves and legend [in]."""
        return CURVES + self.legend_columns * (DASH + LETTER * max(map(len, self.names)))

    @property
    def resting(self) -> tuple[float, float] | None:
        """Return the limits between which curves that change by rounding only are seen at rest;
        None of others."""
        values = self.values[np.isfinite(self.values)]
        if not len(values):
            return None
        size = max(self.scale, float(abs(values).max()))
        if np.ptp(values) > NOISE * size:
            return None
        middle, half = (values.min() + values.max()) / 2, MARGIN * (size or 1.0)
        return middle - half, middle + half


def plot_run(run: Run | xarray.Dataset, quantities: str | Sequence[str] | None = None) -> Figure:
    """Draw quantities of a run over time.

    Args:
        run: the run; or any dataset over time, such as that of `linkwork.analysis.along`.
        quantities: name of a variable of the dataset, or several; left out: of a run the tool's
            pose, joint positions and rates, and actuator forces, else all over time.

    Returns:
        A matplotlib figure with one panel for each quantity and unit.

    Raises:
        LinkworkError: a quantity that the run does not hold over time.
    """
    # What can be drawn: what the dataset holds over time.
    dataset = run.smooth.dataset if isinstance(run, Run) else run
    if not hasattr(dataset, "data_vars"):
        raise LinkworkError(
            f"a run is drawn, not {type(run).__name__}; give what robot.simulate returns, or its "
            "dataset"
        )
    if not (quantities is None or isinstance(quantities, str | Sequence)):
        raise LinkworkError(f"the quantities are {quantities!r}; give their names in a list")
    moving = [str(name) for name, variable in dataset.data_vars.items() if TIME in variable.dims]
    usual = [name for name in USUAL if name in moving] or moving
    # What is asked for, a panel for each quantity and unit.
    wanted = (
        usual
        if quantities is None
        else [quantities]
        if isinstance(quantities, str)
        else list(quantities)
    )
    for name in wanted:
        if name not in moving:
            raise LinkworkError(
                f"the run holds no {name!r} over time; it holds {', '.join(moving)}"
            )
    shown = [panel for name in wanted for panel in panels(dataset, name)]
    if not shown:
        raise LinkworkError(f"there is nothing to draw; name some of {', '.join(moving)}")
    # Panels below each other, on one time.
    with styled():
        figure = new_figure(max(WIDTH, *(panel.width for panel in shown)), HEIGHT * len(shown))
        grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, panel in zip(grid, shown, strict=True):
            draw(axes, dataset[TIME].values, panel)
        label_time(grid[-1], dataset[TIME].values)
    return figure


def draw(axes, time: np.ndarray, panel: Panel) -> None:
    """Draw one panel; its legend stands to the right."""
    marker = "" if len(time) > 1 else ONE
    for index, name in enumerate(panel.names):
        axes.plot(time, panel.values[:, index], marker=marker, label=name or None, **look(index))
    if panel.resting is not None:
        axes.set_ylim(*panel.resting)
    axes.set_ylabel(f"{panel.quantity.replace('_', ' ')}\n[{panel.unit}]")
    if panel.names != ("",):
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.03), "borderaxespad": 0}
        axes.legend(labelspacing=0.3, ncols=panel.legend_columns, **place)


def panels(dataset: xarray.Dataset, name: str) -> Iterator[Panel]:
    """Divide a quantity over time by the units of its components."""
    array = dataset[name].transpose(TIME, ...)
    if array.ndim == 1:
        unit = units_of(dataset, name, ("",))[0]
        yield Panel(name, unit, ("",), array.values[:, None], scale_of(dataset, unit))
        return
    labels = labels_of(dataset, name)
    units = units_of(dataset, name, labels)
    for unit in dict.fromkeys(units):
        columns = [index for index, found in enumerate(units) if found == unit]
        names, scale = tuple(labels[index] for index in columns), scale_of(dataset, unit)
        yield Panel(name, unit, names, array.values[:, columns], scale)


def scale_of(dataset: xarray.Dataset, unit: str) -> float:
    """Return what would be much in a unit of lengths or angles, their rates or accelerations: the
    greatest length of the run's joints and tool, or a radian, over the run's duration; 0 in other
    units."""
    length, _, per = unit.partition("/")
    duration = float(np.ptp(dataset[TIME].values)) if dataset.sizes[TIME] else 0.0
    if length not in ("m", "rad") or per not in PER or (per and not duration > 0):
        return 0.0
    lengths = (
        np.abs(values[:, column])
        for name in ("joint_position", "tool_pose")
        if length == "m" and name in dataset and dataset[name].ndim == 2
        for values in [dataset[name].transpose(TIME, ...).values]
        for column, own in enumerate(units_of(dataset, name, labels_of(dataset, name)))
        if own == "m"
    )
    finite = (own[np.isfinite(own)].max(initial=0.0) for own in lengths)
    return (1.0 if length == "rad" else float(max(finite, default=0.0))) / duration ** PER[per]


def labels_of(dataset: xarray.Dataset, name: str) -> list[str]:
    """Return the names of the components of a quantity over time."""
    array = dataset[name].transpose(TIME, ...)
    return [str(label) for label in array[array.dims[1]].values]


def units_of(dataset: xarray.Dataset, name: str, labels: Sequence[str]) -> list[str]:
    """Return the unit of each component: of two ("m/s, rad/s") the first holds for lengths, the
    second for angles.

    Parts of quaternions have the unit 1.
    """
    stated = str(dataset[name].attrs.get("units", "1"))
    linear, _, angular = stated.partition(", ")
    if not angular:
        return [stated] * len(labels)
    if dataset[name].ndim == 1:
        return [f"{linear} or {angular}"]
    units = {"m": linear, "rad": angular, "1": "1"}
    kinds: dict[str, str] = (
        dict.fromkeys(POSE_ANGLES, "rad")
        if "pose" in dataset[name].dims
        else kinds_of_joints(dataset)
    )
    return [units[kinds.get(label, "m")] for label in labels]


def kinds_of_joints(dataset: xarray.Dataset) -> dict[str, str]:
    """Return m, rad or 1 for each joint coordinate and rate by name."""
    kinds = {}
    for axis in ("coordinate", "rate"):
        units = str(dataset[axis].attrs.get("unit_of_each", "")).split(", ")
        kinds |= {
            str(label): unit.partition("/")[0]
            for label, unit in zip(dataset[axis].values, units, strict=False)
        }
    return kinds
