"""Steps that are too long: how long those of a fixed size may be where a robot stands, and what is
told where a stepper begins with longer ones.

What moves answers, at y = (q, v, z), by the eigenvalues of J = df/dy of y' = f(y). Steps h tell all
of it steadily while, of every lambda = -a +- i b, about

    h |lambda| < 2.785, 2.6 where b is not 0            with "rk4"
    h |lambda|^2 < 2 (sqrt(a^2 + |lambda|^2) - a)       with "symplectic_euler", b not 0
    h |lambda| < 2                                      with "symplectic_euler", b = 0

Beyond, what is stiff, a spring, stop, bristle, damper, drive or controller, swings from step to
step or is held at a wrong value, often without ever blowing up. J is found by differences: it has
all that acts, and costs two evaluations for each number of y.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import ModelWarning
from linkwork.simulation import RK4

if TYPE_CHECKING:
    from linkwork.model.charts import CompiledChart
    from linkwork.runs.system import System
    from linkwork.simulation import Method

APART = 1e-7  # differences, of what numbers are large in or their own units


class LongestStep(NamedTuple):
    """Tell the longest stable step [s], and what bounds it: its name, and how quickly it answers
    [1/s]; infinite where nothing does, or the method chooses its steps."""

    step: float = np.inf
    name: str = ""
    rate: float = 0.0


def longest_step(
    system: System,
    chart: CompiledChart,
    y: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    method: Method,
) -> LongestStep:
    """Return the longest step that is stable at a state.

    Args:
        system: what acts.
        chart: in which y is told.
        y: the state (q, v, z).
        u: inputs (nu).
        p: parameters of the robot, then of what acts.
        method: of fixed step.
    """
    equations, kernel = chart.equations, system.single(chart, "motion")
    tree, nq, n = equations.tree, equations.nq, equations.mobility
    units = tree.units, tree.rate_units[list(equations.chart.independent)], np.ones(y.size - nq - n)
    size = np.maximum(np.concatenate(units), np.abs(y))

    def f(y: np.ndarray) -> np.ndarray:
        return kernel.flat(y[:nq], y[nq:], u, p)[: y.size]

    # J of numbers of one size, so that eigenvectors tell which of them answer.
    J = np.array([f(y + d) - f(y - d) for d in APART * np.diag(size)]).T / (2 * APART)
    J /= size[:, None]
    if not (y.size and np.isfinite(J).all()):
        return LongestStep()
    values, vectors = np.linalg.eig(J)
    if not values.any():
        return LongestStep()
    steps = stable(values, method)
    k = int(np.argmin(steps))
    names = [*chart.independent, *(state.name for state in system.states)]
    told = names[int(np.argmax(np.abs(vectors[nq:, k])))] if names else ""
    return LongestStep(float(steps[k]), told, float(np.abs(values[k])))


def stable(values: NDArray[np.complex128], method: Method) -> np.ndarray:
    """Return the longest stable step [s] of each eigenvalue [1/s], of a method of fixed step."""
    size = np.maximum(np.abs(values), np.finfo(float).tiny)
    if isinstance(method, RK4):
        return np.where(values.imag == 0, 2.785, 2.6) / size
    a = np.where(values.imag == 0, 0.0, np.abs(values.real))
    return 2 * (np.hypot(a, size) - a) / size / size


def tell_long_step(dt: float, found: LongestStep) -> None:
    """Warn of steps dt [s] that are longer than what was found."""
    if dt > found.step:
        warnings.warn(
            f"steps of {dt:g} s are too long where this begins: {found.name} answers by "
            f"{found.rate:.2g} 1/s there, which steps from about {found.step:.2g} s on tell wrong, "
            "often without blowing up; take shorter ones",
            ModelWarning,
            stacklevel=4,
        )
