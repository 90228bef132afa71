"""Reordering: evaluate in a chart where its rates determine the motion, also where its order of
elimination does not.

    Phi_u w_u = -Phi_a v

has one solution where Phi_u is regular. An order of elimination fails already where one of its
pivots vanishes on the way: there the same rates are solved for in another order, which is chosen at
the configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.chart_choice import charts_in
from linkwork.kernels import Kernel
from linkwork.model import checks
from linkwork.model.charts import BUILDING, CompiledChart

if TYPE_CHECKING:
    from linkwork.model.model import Model


def ordered(
    robot: Model, chart: CompiledChart, q: np.ndarray, p: np.ndarray | None = None
) -> CompiledChart:
    """Return a chart, or the one of its rates in a good order at q (nq) if its own is weak there
    and they have one.

    p: values of the robot's free parameters (np), its own if left out
    """
    given = robot.p if p is None else p
    weakest = chart.single("tree_rates").flat(q, np.zeros(len(chart.independent)), given).item(-1)
    if abs(weakest) > checks.sure(chart.key) or not np.isfinite(q).all():
        return chart
    found = ordered_alike(robot, chart, q[None], None if p is None else p[None])
    return found[0][1] if found else chart


def evaluated(
    robot: Model,
    chart: CompiledChart,
    kernel: Callable[[CompiledChart], Kernel],
    *given: np.ndarray,
    threads: int = 1,
) -> tuple[np.ndarray, ...]:
    """Return what a chart's kernel gives (..., size), its last output the pivot (..., 1), in good
    orders where its own is weak.

    Args:
        kernel: returns the kernel of a chart.
        given: its inputs (..., size): q, others, and p if it is not the robot's.
        threads: over which stacks are dealt.
    """
    found = kernel(chart)(*given, threads=threads)
    pivot = found[-1]
    if checks.weakest(pivot) > checks.sure(chart.key):
        return found
    batch, with_p = pivot.shape[:-1], len(given) == len(kernel(chart).inputs)
    count = prod(batch)
    rows = [
        np.broadcast_to(part, (*batch, part.shape[-1])).reshape(count, part.shape[-1])
        for part in given
    ]
    parts = [part.reshape(count, part.shape[-1]) for part in found]
    weak = ~(np.abs(parts[-1][:, 0]) > checks.sure(chart.key)) & np.isfinite(rows[0]).all(axis=1)
    at = np.flatnonzero(weak)
    q, *others = (row[at] for row in rows)
    for own, other in ordered_alike(robot, chart, q, others[-1] if with_p else None):
        for part, values in zip(
            parts, kernel(other)(q[own], *(each[own] for each in others)), strict=True
        ):
            part[at[own]] = values
    return found


def ordered_alike(
    robot: Model, chart: CompiledChart, q: np.ndarray, p: np.ndarray | None
) -> list[tuple[np.ndarray, CompiledChart]]:
    """Return the charts of a chart's rates in good orders at configurations (K, nq), each with the
    numbers of those at which it is one; none where they have none."""
    with BUILDING:
        Phi = chart.constraint_jacobian(q, p)
        found = charts_in(chart.equations, Phi, chart.key.independent)
        return [(own, robot.run_charts.of(key, chart)) for own, key in found]
