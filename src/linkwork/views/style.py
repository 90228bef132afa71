"""How figures look, and how they are written: one style, colours that everybody can tell apart,
reproducible SVG."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, cast

import numpy as np

from linkwork.checks import file_path, shown, writing
from linkwork.errors import LinkworkError
from linkwork.scene.colours import BLUE, GREEN, GREY, INK, ORANGE, PINK, SKY, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

COLOURS = (BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, INK)  # of curves, the darker ones first
DASHES = (
    *("-", (0, (5, 1.6)), (0, (1.2, 1.4)), (0, (6, 1.6, 1.2, 1.6))),
    *((0, (9, 3)), (0, (1.2, 3.6)), (0, (6, 1.6, 1.2, 1.6, 1.2, 1.6)), (0, (2.6, 2.6))),
)

STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "figure.facecolor": "white",
    "font.size": 9,
    "grid.color": "#e9edf0",
    "grid.linewidth": 0.7,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "linkwork",
    "text.color": INK,
    "xtick.color": GREY,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.color": GREY,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 8.5,
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the project's style; the user's own settings come back afterwards."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches that lays itself out."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def svg(figure: Figure, *, cropped: bool = False) -> str:
    """Return a figure as SVG: text as text, the same bytes every time, no date and no other
    metadata.

    cropped: leave out the empty margins.
    """
    buffer = io.StringIO()
    nothing: dict[Any, None] = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with styled():
        if cropped or not draws_at_once(figure):
            cut = "tight" if cropped else None
            figure.savefig(buffer, format="svg", metadata=nothing, bbox_inches=cut)
        else:
            print_at_once(figure, buffer, nothing)
    return buffer.getvalue()


def draws_at_once(figure: Figure) -> bool:
    """Tell whether nothing but the figure says how it is saved: no window, no setting of the
    user."""
    from matplotlib import rcParams, rcParamsDefault
    from matplotlib.backend_bases import FigureCanvasBase

    usual = all(rcParams[name] == rcParamsDefault[name] for name in rcParams.find_all("^savefig"))
    return usual and type(figure.canvas) is FigureCanvasBase


def print_at_once(figure: Figure, file: TextIO, metadata: Mapping[Any, None]) -> None:
    """Write what `savefig` writes, drawn once, while the layout is found, and not before, too."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    canvas, dpi = figure.canvas, figure.dpi
    try:
        FigureCanvasSVG(figure).print_svg(file, metadata={**metadata})
    finally:
        figure.set_canvas(canvas)
        figure.dpi = dpi


def require_axes(ax: object) -> None:
    """Refuse what is drawn on and is no axes of matplotlib; none is left out."""
    from matplotlib.axes import Axes

    if ax is not None and not isinstance(ax, Axes):
        raise LinkworkError(f"ax is {shown(ax)}; give axes of matplotlib, or leave it out")


def save_figure(drawn: Figure | SubFigure | Axes, path: str | Path) -> Path:
    """Write a figure as .svg or .pdf (lines and text as such, the same bytes every time) or as .png
    (300 dpi).

    Args:
        drawn: a figure, or axes of it.
        path: of the file; one that exists is replaced.

    Raises:
        LinkworkError: another suffix, or a file that cannot be written.
    """
    path = file_path(path, "the path of a figure")
    figure = cast("Figure", getattr(drawn, "figure", drawn))
    if not hasattr(figure, "savefig"):
        raise LinkworkError(f"what is drawn is {shown(drawn)}; give a figure, or axes of it")
    if path.suffix.lower() not in (".svg", ".pdf", ".png"):
        raise LinkworkError(f"a figure is written as .svg, .pdf or .png, not as {path.name!r}")
    with writing(path):
        if path.suffix.lower() == ".svg":
            path.write_text(svg(figure), encoding="utf-8")
        else:
            dated = {"CreationDate": None} if path.suffix.lower() == ".pdf" else {}
            with styled():
                figure.savefig(path, dpi=300, metadata=dated)
    return path


def look(index: int) -> dict:
    """Return the colour and dashes of the curve of a number; they repeat after 56 curves."""
    return {
        "color": COLOURS[index % len(COLOURS)],
        "linestyle": DASHES[index // len(COLOURS) % len(DASHES)],
    }


def label_time(axes: Axes, time: np.ndarray) -> None:
    """Let the horizontal axis be the time [s] of a run."""
    axes.set_xlabel("time [s]")
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
