"""What is drawn of a spatial mechanism in its own way, in three dimensions: ground, tools, axes,
and from where it is seen.

Ground is hatched: a level pad for what stands on it, a rail for what slides.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from linkwork.scene.colours import GREY, PALE
from linkwork.scene.curves import across
from linkwork.views.canvas import Canvas, direction
from linkwork.views.plane import hatched

# Of the viewer [deg]; the first ones where they serve.
ELEVATIONS, AZIMUTHS = (24, 34), (-56, -68, -40, -24, 22, 36)
BETTER = 0.1  # by how much another must be better
CLOSE = 0.02  # distance in the picture that counts as none, relative to the mechanism
MOST = 400  # points, of meshes and long motions, that a view is chosen by
PAD = 0.045  # half the side of a pad, relative to the mechanism
ROOM = 0.56  # half the axes' length over the extent of what is drawn
THIN = 0.16  # least of it, relative to the mechanism
STROKE = 0.025  # distance of the strokes at a rail, relative to the mechanism
# Of axes beside others, leaving room for labels; part of a figure for themselves.
ZOOM, FILLED = 0.86, 0.94
LABEL = 9  # distance of the axes' names from their numbers [pt]
TICKS = 6


def draw_rail(canvas: Canvas, ends: np.ndarray) -> None:
    """Draw a rail, hatched below."""
    canvas.line(ends, 1, color=GREY, lw=2.2, solid_capstyle="butt")
    length, stroke = float(np.linalg.norm(ends[1] - ends[0])), STROKE * canvas.size
    axis = (ends[1] - ends[0]) / length
    places = ends[0] + np.arange(stroke, length, stroke)[:, None] * axis
    canvas.line(hatched(places, -0.7 * stroke * (across(axis)[1] + axis)), 1, color=GREY, lw=0.8)


def draw_stand(canvas: Canvas, place: np.ndarray) -> None:
    """Draw a hatched level pad at a point of the ground."""
    half = PAD * canvas.size
    square = place + half * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)])
    canvas.faces([square], PALE, GREY, 1, alpha=0.8, lw=0.8)
    c = np.linspace(-1.5, 1.5, 6)
    start, stop = np.maximum(-1, c - 1), np.minimum(1, c + 1)
    strokes = np.array([(start, start - c, 0 * c), (stop, stop - c, 0 * c)])
    lines = (
        np.concatenate([strokes, np.full_like(strokes[:1], np.nan)])
        .transpose(2, 0, 1)
        .reshape(-1, 3)
    )
    canvas.line(place + half * lines, 1.02, color=GREY, lw=0.7)


def draw_arrow(canvas: Canvas, ends: np.ndarray, colour: str) -> None:
    """Draw an arrow from one point to another."""
    canvas.axes.quiver(
        *ends[0], *(ends[1] - ends[0]), color=colour, lw=1.6, arrow_length_ratio=0.3, zorder=6
    )


def finish(canvas: Canvas) -> None:
    """Make the axes equal, as long as what is drawn, and name them."""
    from matplotlib.ticker import MaxNLocator

    axes, points = canvas.axes, canvas.points
    middle, reach = (points.min(axis=0) + points.max(axis=0)) / 2, ROOM * np.ptp(points, axis=0)
    reach = np.maximum(reach, THIN * canvas.size)
    for letter, centre, half in zip("xyz", middle, reach, strict=True):
        getattr(axes, f"set_{letter}lim")(centre - half, centre + half)
        getattr(axes, f"set_{letter}label")(f"{letter} [m]")
        axis = getattr(axes, f"{letter}axis")
        axis.set_major_locator(
            MaxNLocator(max(2, round(TICKS * half / reach.max())), steps=[1, 2, 5, 10])
        )
        axis.set_pane_color("white")
        axis.labelpad = LABEL
    axes.set_box_aspect(reach, zoom=ZOOM)


def take_in(axes: Any, points: np.ndarray) -> None:
    """Let axes reach as far as points (k, 3) do, too."""
    limits = []
    for letter, column in zip("xyz", points.T, strict=True):
        low, high = getattr(axes, f"get_{letter}lim")()
        limits.append((min(low, column.min()), max(high, column.max())))
        getattr(axes, f"set_{letter}lim")(*limits[-1])
    axes.set_box_aspect(np.ptp(limits, axis=1), zoom=ZOOM)


def fit(axes: Any) -> None:
    """Let axes that have a figure for themselves stand in its middle and fill it, all that is
    written included."""
    figure, limits = axes.figure, (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())
    corners = np.array(list(product(*limits)))
    figure.set_layout_engine("none")
    zoom, corner = ZOOM, np.zeros(2)
    for _ in range(3):
        axes.set_position((*corner, 1, 1))
        axes.set_box_aspect(np.ptp(limits, axis=1), zoom=zoom)
        figure.draw_without_rendering()
        around = [
            axis.get_tightbbox().get_points() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)
        ]
        around += [written_box(axes, text) for text in axes.texts]
        taken = figure.transFigure.inverted().transform(
            np.concatenate([on_screen(axes, corners), *around])
        )
        low, high = taken.min(axis=0), taken.max(axis=0)
        growth = FILLED / max(high - low)
        corner = growth * (corner + 0.5 - (low + high) / 2)
        zoom *= growth


def on_screen(axes: Any, points: np.ndarray) -> np.ndarray:
    """Return where points (k, 3) [m] are seen (k, 2) [pixels]."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    x, y, z = points.T
    return axes.transData.transform(np.transpose(proj_transform(x, y, z, axes.get_proj())[:2]))


def written_box(axes: Any, text: Any) -> np.ndarray:
    """Return two opposite corners (2, 2) of what is written at a point [pixels]."""
    half = np.array(text.get_window_extent().size) / 2
    return on_screen(axes, np.array([text.get_position_3d()])) + np.array([-half, half])


def viewpoint(points: np.ndarray) -> tuple[float, float]:
    """Return elevation and azimuth [deg] from where points (k, 3) are seen well apart: largest mean
    log distance."""
    unlike = np.unique(np.round(points / (np.ptp(points, axis=0).max() or 1.0), 3), axis=0)
    unlike = unlike[np.linspace(0, len(unlike) - 1, min(len(unlike), MOST)).astype(int)]
    first, second = np.triu_indices(len(unlike), 1)
    gaps = unlike[first] - unlike[second]

    def apart(view: tuple[float, float]) -> float:
        d = direction(*view)
        seen = np.linalg.norm(gaps - np.outer(gaps @ d, d), axis=1)
        return float(np.log(seen + CLOSE).mean()) if len(gaps) else 0.0

    views = [(elevation, azimuth) for elevation in ELEVATIONS for azimuth in AZIMUTHS]
    best = max(views, key=apart)
    return best if apart(best) > apart(views[0]) + BETTER else views[0]
