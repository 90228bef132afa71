"""Work-precision diagrams: what a computation costs, over how far it is from the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.views.style import look, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 5.4, 5.2  # of a panel with the legend [in]
MARKERS = "osD^vP*X"
FLOOR = 1e-17  # below all rounding; an error of zero is drawn here


def plot_work_precision(
    curves: Mapping[str, Sequence[ArrayLike]], *, unit: str = "m, rad", work: str = "wall time [s]"
) -> Figure:
    """Draw error over work, both in powers of ten: the lower left is best.

    Args:
        curves: by name, each a pair (work, errors) of sequences of the same length, or
            (work, errors, closure errors) to draw these beside.
        unit: of the errors.
        work: what the work is, with its unit.

    Returns:
        A matplotlib figure of one panel, or of two where a curve has closure errors.

    Raises:
        LinkworkError: no curves, sequences of different lengths, work that is not positive, errors
            that are negative.
    """
    read = {str(name): checked(str(name), parts) for name, parts in curves.items()}
    if not read:
        raise LinkworkError("there are no curves; give some by name, each a pair (work, errors)")
    titles = [f"error [{unit}]", f"closure error [{unit}]"][
        : max(len(parts) for parts in read.values()) - 1
    ]
    with styled():
        figure = new_figure(WIDTH * len(titles), HEIGHT)
        grid = figure.subplots(1, len(titles), squeeze=False)[0]
        for index, (name, (seconds, *errors)) in enumerate(read.items()):
            style = look(index) | {
                "marker": MARKERS[index % len(MARKERS)],
                "markersize": 4.5,
                "markeredgewidth": 0,
            }
            for axes, values in zip(grid, errors, strict=False):
                axes.loglog(seconds, np.maximum(values, FLOOR), label=name, **style)
        for axes, title in zip(grid, titles, strict=True):
            axes.set(xlabel=work, ylabel=title)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def checked(name: str, parts: Sequence[ArrayLike]) -> list[np.ndarray]:
    """Return work, errors and perhaps closure errors (K,) of a curve."""
    read = [np.atleast_1d(np.asarray(part, float)) for part in parts]
    if len(read) not in (2, 3) or len({part.shape for part in read}) != 1 or read[0].ndim != 1:
        raise LinkworkError(
            f"the curve {name!r} is no pair (work, errors) of sequences of the same length"
        )
    if not (read[0] > 0).all() or any((part < 0).any() for part in read[1:]):
        raise LinkworkError(
            f"the curve {name!r} has work that is not positive, or errors below zero"
        )
    return read
