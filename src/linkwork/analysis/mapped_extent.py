"""How large what a workspace holds is: the largest circle or sphere in it, its area or volume."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from linkwork.checks import number, shown
from linkwork.errors import LinkworkError

if TYPE_CHECKING:
    import xarray


def inscribed(mapped: xarray.Dataset, *, at_least: float = 0.0) -> tuple[dict[str, float], float]:
    """Return the centre and radius of the largest circle or sphere of reached poses, to the
    accuracy of the grid.

    Args:
        mapped: a workspace over two or three lengths, equally spaced each; other coordinates
            constant.
        at_least: least conditioning that counts.

    Returns:
        centre by coordinate [m], radius [m]; the radius is zero where nothing is reached.

    Raises:
        LinkworkError: axes that are angles or not equally spaced; no number.
    """
    from scipy.ndimage import distance_transform_edt

    require_workspace(mapped, "reachable")
    dims = mapped["reachable"].dims
    axes = [mapped[name].values for name in dims]
    for name, axis in zip(dims, axes, strict=True):
        steps = np.diff(axis)
        if (
            mapped[name].attrs.get("units", "m") != "m"
            or len(axis) < 2
            or not np.allclose(steps, steps[0], rtol=1e-6, atol=0)
        ):
            raise LinkworkError(
                f"{name} is no axis of equally spaced lengths; a circle or sphere lies in x, y, z"
            )
    least = number(at_least, "at_least")
    inside = mapped["reachable"].values & ~(mapped["conditioning"].values < least)
    spacing = [abs(axis[1] - axis[0]) for axis in axes]
    distance = np.asarray(distance_transform_edt(np.pad(inside, 1), spacing))[
        (slice(1, -1),) * len(dims)
    ]
    best = np.unravel_index(int(np.argmax(distance)), distance.shape)
    centre = {str(name): float(axis[k]) for name, axis, k in zip(dims, axes, best, strict=True)}
    return centre, float(distance[best])


def require_workspace(mapped: object, *quantities: str) -> None:
    """Refuse what is no workspace, or one without some quantities."""
    import xarray

    if not isinstance(mapped, xarray.Dataset) or not {*quantities} <= {*mapped}:
        raise LinkworkError(
            f"the workspace is {shown(mapped)}; give one made by linkwork.analysis.workspace"
        )


def content(mapped: xarray.Dataset) -> float:
    """Return the area or volume of the reached poses [m, rad to the number of axes], to the
    accuracy of the grid.

    mapped: as `workspace` gives it, over at least one axis.
    """
    require_workspace(mapped, "reachable")
    return integral(mapped["reachable"].astype(float))


def integral(values: xarray.DataArray) -> float:
    """Return the integral over all axes, each from its least coordinate to its largest."""
    axes = list(values.dims)
    return float(values.sortby(axes).integrate(axes))
