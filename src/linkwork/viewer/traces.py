"""A run's quantities as curves over time beside the scene, with a mark at the present time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from linkwork.simulation import Run, Variable

MOST_CURVES, MOST_POINTS = 8, 400
TIME = "time"


@dataclass(frozen=True, eq=False)
class Traces:
    """Hold curves of one quantity: time (K,) [s], labels, values (curves, K), and the unit of
    all."""

    time: np.ndarray
    labels: tuple[str, ...]
    values: np.ndarray
    unit: str

    def at(self, now: float) -> tuple[np.ndarray, ...]:
        """Return times and curves, and a last curve that marks a time, or the end that is nearest
        to it: a spike there as high as all curves are."""
        now = float(np.clip(now, *self.time[[0, -1]])) if len(self.time) else now
        k = int(np.searchsorted(self.time, now, side="right"))
        time = np.insert(self.time, k, (now, now, now))
        here = [np.interp(now, self.time, curve) for curve in self.values]
        curves = [
            np.insert(curve, k, (y, y, y)) for curve, y in zip(self.values, here, strict=True)
        ]
        low, high = self.range
        mark = np.full(len(time), low)
        mark[k + 1] = high
        return time, *curves, mark

    @property
    def range(self) -> tuple[float, float]:
        """Return the smallest and the largest value, apart from each other."""
        if not self.values.size:
            return 0.0, 1.0
        low, high = float(self.values.min()), float(self.values.max())
        return (low, high) if high > low else (low, low + 1.0)


def quantities(run: Run) -> tuple[str, ...]:
    """Return the quantities of a run that are numbers, or named numbers, at each time."""
    return tuple(name for name, v in run.variables.items() if v.dims[:1] == (TIME,))


def traces(run: Run, quantity: str, preferred: Sequence[str] = ()) -> Traces:
    """Return the curves of a quantity, thinned to some hundred points: of the preferred components
    where it has any.

    Else of its first eight.
    """
    variable, time = run.variables[quantity], np.asarray(run.coords[TIME].values, float)
    values = np.asarray(variable.values, float)
    if values.ndim == 1:
        names, values = [quantity], values[:, None]
    else:
        parts = ([str(name) for name in run.coords[axis].values] for axis in variable.dims[1:])
        names = [": ".join(found) for found in product(*parts)]
        values = values.reshape(len(time), len(names))
    shown = [k for k, name in enumerate(names) if name in preferred] or list(range(len(names)))
    shown = shown[:MOST_CURVES]
    kept = (
        np.unique(np.linspace(0, len(time) - 1, MOST_POINTS).astype(int))
        if len(time)
        else np.empty(0, int)
    )
    clean = np.nan_to_num(values[kept][:, shown].T, posinf=0.0, neginf=0.0)
    return Traces(time[kept], tuple(names[k] for k in shown), clean, unit(run, variable, shown))


def unit(run: Run, variable: Variable, shown: Sequence[int]) -> str:
    """Return the units of the components that are shown."""
    axis = variable.dims[-1]
    units = str(run.coords[axis].attrs.get("unit_of_each", "")).split(", ")
    if axis != "coordinate" or max(shown, default=0) >= len(units):
        return str(variable.attrs.get("units", ""))
    return ", ".join(dict.fromkeys(units[k] for k in shown))
