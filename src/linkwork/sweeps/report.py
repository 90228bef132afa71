"""The report: what a study comes to, in a table and in plots, read from the store chunk by chunk.

For each output: mean, standard deviation, least and largest value of the members that finished, and
its correlation with each number that varies. Means and second moments of chunks are put together by
Chan's formula.
Source: Chan, Golub & LeVeque, Algorithms for computing the sample variance (1983).
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import folder_path, needed
from linkwork.sweeps.chunk import Results
from linkwork.sweeps.preparation import STATUSES
from linkwork.sweeps.store import Store, written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE, PLOTS = "table.csv", "plots.svg"
PLOTTED = 2000  # members of which points are drawn
NAMED = 6  # controllers in a row of the legend
PANELS = (8, 5)  # outputs and varied names that are drawn
ALIKE = 1e-9  # how far values that only rounding tells apart spread, over their size


@dataclass(frozen=True, eq=False)
class MemberMoments:
    """Hold what members that finished come to: columns are the varied numbers, then all components
    of the outputs."""

    count: int
    mean: np.ndarray
    product: np.ndarray
    least: np.ndarray
    largest: np.ndarray
    at: np.ndarray

    @classmethod
    def of(cls, table: np.ndarray, members: np.ndarray) -> MemberMoments:
        """Return the moments of members' columns (M, columns); members: their numbers (M)."""
        mean = table.mean(axis=0)
        low, high = table.argmin(axis=0), table.argmax(axis=0)
        columns = np.arange(table.shape[1])
        product = (table - mean).T @ (table - mean)
        return cls(
            len(table),
            mean,
            product,
            table[low, columns],
            table[high, columns],
            np.stack([members[low], members[high]]),
        )

    def __add__(self, other: MemberMoments) -> MemberMoments:
        count = self.count + other.count
        step = other.mean - self.mean
        # What is no number counts as both, wherever it stands.
        less = ~np.isnan(self.least) & ~(other.least >= self.least)
        more = ~np.isnan(self.largest) & ~(other.largest <= self.largest)
        return MemberMoments(
            count,
            self.mean + step * other.count / count,
            self.product + other.product + np.outer(step, step) * self.count * other.count / count,
            np.where(less, other.least, self.least),
            np.where(more, other.largest, self.largest),
            np.stack(
                [np.where(less, other.at[0], self.at[0]), np.where(more, other.at[1], self.at[1])]
            ),
        )

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviations of the columns."""
        return np.sqrt(np.diag(self.product) / max(self.count - 1, 1))

    @property
    def correlation(self) -> np.ndarray:
        """Correlations of all columns; nan for those that do not vary."""
        size = np.sqrt(np.diag(self.product))
        with np.errstate(all="ignore"):
            return np.where(np.outer(size, size) > 0, self.product / np.outer(size, size), np.nan)


@dataclass(frozen=True, eq=False)
class SummaryRow:
    """Hold one component of an output under one controller."""

    controller: str
    output: str
    unit: str
    count: int
    mean: float
    deviation: float
    least: float
    least_member: int
    largest: float
    largest_member: int
    correlation: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Summary:
    """Hold what a study comes to: how many members ended in which way, and a row for each
    output."""

    statuses: Mapping[str, int]
    rows: tuple[SummaryRow, ...]
    points: Results


def summary(store: Store) -> Summary:
    """Read a store through once, chunk by chunk; keep PLOTTED members at most to draw."""
    needed(store, Store, "linkwork.sweeps.sweep")
    bench, study = store.bench, store.bench.study
    moments: dict[int, MemberMoments] = {}
    statuses: dict[int, int] = {}
    stride, kept = -(-study.members // PLOTTED), []
    names = columns(store)
    for index in range(study.chunks):
        part = store.read(index)
        members = np.arange(store.rows(index).start, store.rows(index).stop)
        for status, count in zip(*np.unique(part["status"], return_counts=True), strict=True):
            statuses[int(status)] = statuses.get(int(status), 0) + int(count)
        table = flat(part, [*study.varied, *bench.outputs])
        controller = part.get("controller", np.zeros(len(members), dtype=int))
        drawn = members % stride == 0
        kept.append(np.column_stack([controller[drawn], table[drawn]]))
        for case in range(len(bench.cases)):
            rows = (part["status"] == 0) & (controller == case)
            if rows.any():
                found = MemberMoments.of(table[rows], members[rows])
                moments[case] = moments[case] + found if case in moments else found
    points = np.concatenate(kept)
    return Summary(
        {STATUSES[status]: count for status, count in sorted(statuses.items())},
        tuple(
            row for case in sorted(moments) for row in rows_of(store, case, moments[case], names)
        ),
        {"controller": points[:, 0]} | {name: points[:, 1 + i] for i, name in enumerate(names)},
    )


def columns(store: Store) -> list[str]:
    """Return the names of the varied numbers, then of all components of the outputs."""
    bench, names = store.bench, list(store.bench.study.varied)
    for name in bench.outputs:
        axes = bench.fields[name].axes[1:]
        names += [f"{name}.{label}" for label in bench.labels[axes[0]]] if axes else [name]
    return names


def flat(part: Results, names: Sequence[str]) -> np.ndarray:
    """Return arrays side by side (M, columns)."""
    return np.concatenate([part[name].reshape(len(part[name]), -1) for name in names], axis=1)


def rows_of(
    store: Store, case: int, moments: MemberMoments, names: Sequence[str]
) -> Iterator[SummaryRow]:
    """Yield the rows of one controller."""
    bench, varied = store.bench, store.bench.study.varied
    controllers = tuple(bench.study.controllers)
    correlation, deviation = moments.correlation, moments.deviation
    for i in range(len(varied), len(names)):
        output = next(
            name for name in bench.outputs if names[i] == name or names[i].startswith(f"{name}.")
        )
        told = bench.outputs[output]
        yield SummaryRow(
            controllers[case] if controllers else "",
            names[i],
            bench.unit(told, told.component or names[i].removeprefix(output).removeprefix(".")),
            moments.count,
            float(moments.mean[i]),
            float(deviation[i]),
            float(moments.least[i]),
            int(moments.at[0, i]),
            float(moments.largest[i]),
            int(moments.at[1, i]),
            {name: float(correlation[i, j]) for j, name in enumerate(varied)},
        )


def write(store: Store, found: Summary, folder: Path) -> list[Path]:
    """Write table.csv and plots.svg into a folder; return their paths.

    store: of the results; found: what is told of them; folder: which is there.
    """
    from linkwork.views.style import svg

    needed(store, Store, "linkwork.sweeps.sweep")
    needed(found, Summary, "linkwork.sweeps.summary")
    folder = folder_path(folder, "the folder")
    table, plots = folder / TABLE, folder / PLOTS
    varied = store.bench.study.varied
    fields = [name for name in SummaryRow.__dataclass_fields__ if name != "correlation"]
    with written(table), table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*fields, *(f"correlation with {name}" for name in varied)])
        for row in found.rows:
            writer.writerow([*(getattr(row, name) for name in fields), *row.correlation.values()])
    drawn = svg(figure(store, found))
    with written(plots):
        plots.write_text(drawn, encoding="utf-8")
    return [table, plots]


def ends_of(values: np.ndarray) -> tuple[float, float]:
    """Return the ends of the axis of values (K,): of values that only rounding tells apart, far
    from these."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low > max(ALIKE * size, 1e-300):
        return low, high
    return low - (size / 2 or 0.5), high + (size / 2 or 0.5)


def figure(store: Store, found: Summary) -> Figure:
    """Draw each output over each number that varies, and its distribution; a colour for each
    controller."""
    from matplotlib.patches import Patch
    from matplotlib.ticker import LogLocator, NullFormatter

    from linkwork.mechanism.parameter_units import unit_of_parameter
    from linkwork.views.style import COLOURS, new_figure, styled

    # Columns of what varies, rows of outputs, a colour for each controller.
    varied = store.bench.study.varied[: PANELS[1]]
    outputs = columns(store)[len(store.bench.study.varied) :][: PANELS[0]]
    units = {row.output: row.unit for row in found.rows}
    controllers = tuple(store.bench.study.controllers) or ("",)
    with styled():
        drawing = new_figure(2.4 * (len(varied) + 1), 1.9 * len(outputs) + 0.4)
        grid = drawing.subplots(len(outputs), len(varied) + 1, squeeze=False)
        # Each output over what varies, and its distribution.
        for axes_row, output in zip(grid, outputs, strict=True):
            for case, name in enumerate(controllers):
                own = (found.points["controller"] == case) & np.isfinite(found.points[output])
                look = {"color": COLOURS[case % len(COLOURS)], "label": name or None}
                values = found.points[output][own]
                for axes, across in zip(axes_row, varied, strict=False):
                    axes.plot(
                        found.points[across][own], values, ".", markersize=2.5, alpha=0.6, **look
                    )
                if values.size:
                    bins = min(30, 5 + values.size // 20)
                    ends = ends_of(values)
                    axes_row[-1].hist(values, bins=bins, range=ends, alpha=0.6, **look)
            # Names and units.
            axes_row[0].set_ylabel(f"{output}\n[{units.get(output, '')}]")
            axes_row[-1].set_xlabel(f"{output}\n[{units.get(output, '')}]")
            for axes, across in zip(axes_row, varied, strict=False):
                unit = unit_of_parameter(store.bench.robot.mechanism, across)
                axes.set_xlabel(f"{across}\n[{unit}]" if unit else across)
        # So few ticks that their numbers stand apart; what varies by ratios stands so.
        vary = store.bench.study.vary
        by_ratio = [name in vary and vary[name].by_ratio for name in varied]
        for axes, ratio in zip(grid.flat, cycle([*by_ratio, False]), strict=False):
            if ratio:
                axes.set_xscale("log")
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=4))
                axes.xaxis.set_major_formatter("{x:g}")
                axes.xaxis.set_minor_formatter(NullFormatter())
            else:
                axes.locator_params(axis="x", nbins=3)
        # What the colours are, also of those that have nothing in the first row.
        grid[0][-1].set_title("members")
        if len(controllers) > 1:
            looks = zip(controllers, cycle(COLOURS), strict=False)
            handles = [Patch(color=colour, alpha=0.6, label=name) for name, colour in looks]
            drawing.legend(handles=handles, loc="outside upper left", ncols=NAMED)
    return drawing
