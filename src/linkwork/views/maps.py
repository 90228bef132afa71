"""Maps of the workspace: a quantity over a plane of poses as colour, singularity loci and the
workspace's edge as lines; over three coordinates, on the surface of what is reached.

Signed quantities, the determinants, have colours that part at zero; all others run from dark (low)
to light (high). The colour maps, cividis and one from purple to orange, are read alike by people
who see colours differently.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.checks import among, shown
from linkwork.errors import LinkworkError
from linkwork.scene.colours import GREY, INK, PALE, PLATE, VERMILION
from linkwork.views.style import new_figure, require_axes, styled
from linkwork.views.volume import surface

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

WIDTH, HEIGHT = 5.6, 4.4  # [in]
# Of two the first lies along the picture, the other upwards.
POSE = (
    "x",
    "y",
    "z",
    "angle",
    "rx",
    "ry",
    "rz",
)
OVER = {2: "two", 3: "three"}  # how many coordinates a picture may have
ROOM = 0.05  # between what is reached and the ends of the axes in space, relative to it
BAR = {"shrink": 0.7, "pad": 0.14}  # of colours beside axes in space: its length, its distance
FLAT_BAR = {"shrink": 0.9, "pad": 0.02}
ENDS = ("neither", "min", "max", "both")  # of a bar that are pointed
SEQUENTIAL, SIGNED = "cividis", "PuOr"
SIGNS = ("det_A", "det_B")
MOST = 0.98  # quantile of a signed quantity's magnitude at which its colours end
LINES = {
    "det_A": (0.0, "actuator-singular", {"color": VERMILION, "linestyle": "-", "lw": 2.0}),
    "det_B": (0.0, "leg-singular", {"color": VERMILION, "linestyle": (0, (4, 2)), "lw": 1.6}),
    "reachable": (0.5, "edge of what is reached", {"color": INK, "linestyle": "-", "lw": 1.1}),
}


def plot_workspace(
    mapped: xarray.Dataset,
    quantity: str = "conditioning",
    ax: Axes | None = None,
    *,
    lines: bool = True,
) -> Axes:
    """Draw a quantity of a workspace over two coordinates of the tool's pose, or, over three, on
    the surface of what is reached.

    Args:
        mapped: of `linkwork.analysis.workspace`, over two or three coordinates; of more, choose by
            `mapped.sel(angle=...)`.
        quantity: name of a quantity over these: conditioning, det_A (where it is zero the robot
            is actuator-singular), det_B, isotropic_force ..., or reachable.
        ax: where to draw, over three coordinates axes in space; left out: axes of a new figure.
        lines: over two coordinates, draw where det_A or det_B vanishes, and the edge of what is
            reached.

    Returns:
        The axes; `axes.figure` is the figure. A surface ends with the grid: where it lies on the
        grid's ends, it tells nothing of the reach.

    Raises:
        LinkworkError: a quantity that the map does not hold over two or three coordinates, flat
            axes for three coordinates.
    """
    if not hasattr(mapped, "data_vars"):
        raise LinkworkError(f"the map is {shown(mapped)}; give one of linkwork.analysis.workspace")
    # What can be drawn over two or three coordinates of the pose, those of one value left out.
    mapped = mapped.isel({name: 0 for name in mapped.dims if mapped.sizes[name] == 1})
    known = {
        str(name): array.ndim
        for name, array in mapped.data_vars.items()
        if array.ndim in OVER and set(array.dims) <= set(POSE)
    }
    require_axes(ax)
    if not among(quantity, known):
        over = OVER[min(known.values(), default=2)]
        have = (
            f"; over {over} it holds {', '.join(known)}"
            if known
            else "; choose a plane of it by mapped.sel(...)"
        )
        raise LinkworkError(f"the map holds no {quantity!r} over {over} coordinates{have}")
    if known[quantity] == 3:
        return draw_surface(mapped, quantity, ax)
    array = mapped[quantity]
    first, second = sorted(map(str, array.dims), key=POSE.index)
    array = array.transpose(second, first)
    with styled():
        axes: Any = new_figure(WIDTH, HEIGHT).add_subplot() if ax is None else ax
        x, y, values = mapped[first].values, mapped[second].values, array.values.astype(float)
        shading = {"shading": "nearest", "rasterized": True, "zorder": 1} | colours(
            quantity, values
        )
        # Colours over the plane, or that there are none.
        if np.isfinite(values).any():
            painted = axes.pcolormesh(x, y, values, **shading)
            add_bar(axes, painted, mapped, quantity, values, FLAT_BAR)
        else:
            axes.text(
                0.5, 0.5, "no pose is reached", transform=axes.transAxes, ha="center", va="center"
            )
        # Where det A and det B vanish, and the edge of what is reached.
        drawn = [draw_line(axes, mapped, name, first) for name in LINES] if lines else []
        # One scale for both axes where both are lengths.
        axes.set(
            xlabel=f"{first} [{units(mapped, first)}]", ylabel=f"{second} [{units(mapped, second)}]"
        )
        axes.update_datalim([(x.min(), y.min()), (x.max(), y.max())])
        axes.autoscale_view()
        if units(mapped, first) == units(mapped, second) == "m":
            axes.set_aspect("equal", adjustable="box")
        if any(drawn):
            axes.legend(
                loc="lower left", bbox_to_anchor=(0, 1.0), ncols=sum(drawn), borderaxespad=0.2
            )
    return axes


def draw_surface(mapped: xarray.Dataset, quantity: str, ax: Axes | None) -> Axes:
    """Draw the surface of what is reached over three coordinates, coloured by a quantity."""
    from matplotlib import cm, colormaps, colors
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if ax is not None and ax.name != "3d":
        raise LinkworkError(
            "the map is over three coordinates and the axes are flat; give axes with "
            "projection='3d', or choose a plane of the map by mapped.sel(...)"
        )
    names = sorted(map(str, mapped[quantity].dims), key=POSE.index)
    values = mapped[quantity].transpose(*names).values.astype(float)
    places = [mapped[name].values for name in names]
    found = surface(mapped["reachable"].transpose(*names).values, places)
    # Its axes, and a sentence where nothing is reached.
    with styled():
        axes: Any = new_figure(WIDTH, HEIGHT).add_subplot(projection="3d") if ax is None else ax
        for letter, name in zip("xyz", names, strict=True):
            axes.set(**{f"{letter}label": f"{name} [{units(mapped, name)}]"})
        if not len(found.faces):
            axes.text2D(
                0.5, 0.5, "no pose is reached", transform=axes.transAxes, ha="center", va="center"
            )
            return axes
        # The surface, each face in the colour of the reached pose behind it.
        faces = Poly3DCollection(list(found.faces), edgecolors=GREY, linewidths=0.2)
        shown = values[tuple(found.points.T)]
        if quantity == "reachable":
            faces.set_facecolor(PLATE)
        else:
            look = colours(quantity, shown)
            ends = colors.Normalize(look.get("vmin"), look.get("vmax"))
            paint = cm.ScalarMappable(ends, colormaps[look["cmap"]].with_extremes(bad=PALE))
            paint.set_array(np.ma.masked_invalid(shown))
            paint.autoscale_None()
            faces.set_facecolor(paint.to_rgba(np.ma.masked_invalid(shown)))
            add_bar(axes, paint, mapped, quantity, shown, BAR)
        axes.add_collection3d(faces)
        # Axes around it, of one scale where all are lengths.
        low, high = found.faces.min(axis=(0, 1)), found.faces.max(axis=(0, 1))
        room = np.maximum(ROOM * (high - low), ROOM * (high - low).max() * 0.1)
        for letter, start, end in zip("xyz", low - room, high + room, strict=True):
            axes.set(**{f"{letter}lim": (start, end)})
        if all(units(mapped, name) == "m" for name in names):
            axes.set_aspect("equal")
    return axes


def add_bar(
    axes: Any,
    painted: ScalarMappable,
    mapped: xarray.Dataset,
    quantity: str,
    values: np.ndarray,
    place: Mapping[str, float],
) -> None:
    """Add the bar of colours: of signs that occur, and pointed where values lie beyond its end."""
    (low, high), least, most = painted.get_clim(), np.nanmin(values), np.nanmax(values)
    pointed = ENDS[(least < low) + 2 * (most > high)]
    bar = axes.figure.colorbar(painted, ax=axes, extend=pointed, **place)
    if quantity in SIGNS and not least < 0 < most and least != most:
        bar.ax.set_ylim(low if least < 0 else 0.0, high if most > 0 else 0.0)
    bar.set_label(f"{meaning(mapped, quantity)} [{units(mapped, quantity)}]")
    bar.outline.set_visible(False)


def colours(quantity: str, values: np.ndarray) -> dict[str, Any]:
    """Return the colour map and its limits: about zero for a signed quantity."""
    if quantity not in SIGNS:
        return {"cmap": SEQUENTIAL}
    finite = np.abs(values[np.isfinite(values)])
    most = float(np.quantile(finite, MOST)) if finite.size else 1.0
    return {"cmap": SIGNED, "vmin": -(most or 1.0), "vmax": most or 1.0}


def draw_line(axes: Any, mapped: xarray.Dataset, name: str, first: str) -> bool:
    """Draw the line on which a quantity has its level; return whether there is one."""
    from linkwork.analysis import loci

    if name not in mapped or mapped[name].ndim != 2 or min(mapped[name].shape) < 2:
        return False
    level, label, look = LINES[name]
    order = slice(None) if mapped[name].dims[0] == first else slice(None, None, -1)
    found = loci(mapped, name, level)
    for index, line in enumerate(found):
        axes.plot(*line[:, order].T, label="" if index else label, **look)
    return bool(found)


def units(mapped: xarray.Dataset, name: str) -> str:
    return str(mapped[name].attrs.get("units", "1"))


def meaning(mapped: xarray.Dataset, name: str) -> str:
    return str(mapped[name].attrs.get("long_name", name.replace("_", " ")))
