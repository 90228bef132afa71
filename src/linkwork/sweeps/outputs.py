"""Outputs: named reductions, which make a few numbers of what a quantity does over a run.

"peak actuator_force"      largest |x| of each actuator's force over the run
"rms tool_error.x"         root of the time average of x^2 of one component
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from linkwork.mechanism.record import MechanismError
from linkwork.mechanism.refusal import shown, suggestion
from linkwork.runs.quantities import QUANTITIES, Place

Reduce = Callable[[np.ndarray, np.ndarray], np.ndarray]


def integral(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the integral over time by the trapezoidal rule."""
    return np.trapezoid(x, t, axis=1)


def mean(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the average over time."""
    return integral(t, x) / (t[-1] - t[0])


REDUCTIONS: Mapping[str, tuple[Reduce, str]] = {
    "peak": (lambda t, x: np.abs(x).max(axis=1), "largest |x|"),
    "maximum": (lambda t, x: x.max(axis=1), "largest x"),
    "minimum": (lambda t, x: x.min(axis=1), "least x"),
    "range": (lambda t, x: np.ptp(x, axis=1), "largest less least x"),
    "mean": (mean, "time average of x"),
    "rms": (lambda t, x: np.sqrt(mean(t, x**2)), "root of the time average of x^2"),
    "integral": (integral, "integral of x over time"),
    "total": (lambda t, x: integral(t, np.abs(x)), "integral of |x| over time"),
    "final": (lambda t, x: x[:, -1], "x at the end"),
}
"""Functions of times (K) and values (members, K[, components]), and what they give."""
OVER_TIME = ("integral", "total")


@dataclass(frozen=True)
class Output:
    """Say what an output is: a reduction of a quantity, or of one component of it."""

    reduction: str
    quantity: str
    component: str = ""

    @classmethod
    def read(cls, text: str) -> Output:
        """Read "reduction quantity" or "reduction quantity.component"."""
        words = text.split(maxsplit=1)
        if len(words) != 2:
            raise MechanismError(
                f"{shown(text)} is no output; give a reduction and a quantity, such as 'peak "
                "actuator_force'"
            )
        reduction, (quantity, _, component) = words[0], words[1].partition(".")
        if reduction not in REDUCTIONS:
            near = suggestion(reduction, REDUCTIONS)
            raise MechanismError(
                f"{reduction!r} is no reduction{near}; the reductions are {', '.join(REDUCTIONS)}"
            )
        require_quantity(quantity)
        return cls(reduction, quantity, component)

    @property
    def axis(self) -> str | None:
        """The axis of its components, if it has any."""
        return None if self.component else QUANTITIES[self.quantity].axis

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.reduced(QUANTITIES[self.quantity].unit)

    def reduced(self, unit: str) -> str:
        """Return the unit of what is reduced from values of a unit."""
        return (
            ", ".join(f"{part} s" for part in unit.split(", "))
            if self.reduction in OVER_TIME
            else unit
        )

    def of(self, times: np.ndarray, values: np.ndarray, components: tuple[str, ...]) -> np.ndarray:
        """Return the output (members[, components]) of a quantity's values (members, K[,
        components])."""
        if self.component:
            values = values[..., components.index(self.component)]
        return REDUCTIONS[self.reduction][0](times, values)


def require_quantity(name: str) -> None:
    """Refuse a name that is no quantity's."""
    known = [each.name for each in QUANTITIES.values() if each.belongs(Place.STUDY)]
    if name not in known:
        near = suggestion(name, known)
        raise MechanismError(
            f"{name!r} is no quantity{near}; the quantities are {', '.join(known)}"
        )
