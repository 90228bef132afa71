"""Choices: which chart a run goes on in where its own has become weak.

It is a matter of the configuration q (and of p) and of the chart that is left, not of the charts
known from elsewhere. At a regular configuration, where the constraints are far from dependent, it
is the one chosen there. Near a singular one every chart is weak, so that only a much stronger one
is worth the change: the rates, or the order of elimination, were bad. A chart is as strong as the
weakest pivot that its elimination comes upon, which tells of both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkwork.equations.chart_choice import alike
from linkwork.model.charts import BUILDING, CompiledChart
from linkwork.model.checks import PIVOT_BOUND

if TYPE_CHECKING:
    from linkwork.model.model import Model

BETTER = 2.0  # factor in strength for which a chart is changed near a singular pose
REUSED = 0.2  # relative pivot from which the chart that runs start in is used again
LOWER = 0.25  # the soft bound falls by this factor while no better chart is found
FIRM = 10 * PIVOT_BOUND  # singular values of a block whose determinant alone is small
HALVED = PIVOT_BOUND**2  # relative determinants of which half of the digits are left


class Choice(NamedTuple):
    """Tell whether a configuration is regular, and the better chart there, if there is one."""

    regular: bool
    better: CompiledChart | None


def lost(chart: CompiledChart, q: np.ndarray) -> bool:
    """Tell whether rank is lost at a configuration, so that no chart determines the motion; chart:
    any."""
    return bool(chart.equations.lost(chart.constraint_jacobian(q)))


def choice(robot: Model, chart: CompiledChart, q: np.ndarray) -> Choice:
    """Choose what is better than a chart at one configuration q (nq)."""
    Phi = robot.chart.constraint_jacobian(q)
    regular, groups = choices(robot, chart, q[None], Phi[None])
    return Choice(bool(regular[0]), groups[0][1] if groups else None)


def choices(
    robot: Model, chart: CompiledChart, q: np.ndarray, Phi: np.ndarray, p: np.ndarray | None = None
) -> tuple[np.ndarray, list[tuple[np.ndarray, CompiledChart]]]:
    """Choose what is better than a chart at each of some configurations.

    Args:
        q: configurations (G x nq).
        Phi: the constraint Jacobian there (G x all rows x nv).
        p: values of the robot's free parameters (G x np), its own if left out.

    Returns:
        Which configurations are regular (G), and the better charts, each with the numbers of the
        configurations that it is chosen for.
    """
    charts = robot.run_charts
    better: list[tuple[np.ndarray, CompiledChart]] = []
    with BUILDING:
        sound, found = robot.known_charts.at(Phi)
        for members, key in found:
            candidate = charts.of(key, robot.chart)
            if candidate.order == chart.order:
                continue
            taken = sound[members]
            if not taken.all():
                near = np.flatnonzero(~taken)
                there = Phi[members[near]]
                taken[near] = candidate.strengths(there) >= BETTER * chart.strengths(there)
            better += kept_charts(robot, candidate, members[taken], q, p)
    return sound, better


def kept_charts(
    robot: Model, candidate: CompiledChart, members: np.ndarray, q: np.ndarray, p: np.ndarray | None
) -> Iterator[tuple[np.ndarray, CompiledChart]]:
    """Yield the charts to use for a chosen one, and the configurations that use them.

    That in which runs start, with its pivots positive there, if it has the same order of
    elimination and they are strong.
    """
    charts, first = robot.run_charts, robot.run_chart
    if candidate.order == first.order:
        (pivots,) = first.kernel("pivots")(q[members], first.p if p is None else p[members])
        strong = np.abs(pivots).min(axis=1) > REUSED
        for signs, own in alike(np.where(pivots[strong] < 0, -1.0, 1.0)):
            faced = first.with_signs(signs)
            yield members[strong][own], charts.setdefault(faced.key, faced)
        members = members[~strong]
    if members.size:
        yield members, charts.setdefault(candidate.key, candidate)


def lowered_bounds(
    chart: CompiledChart, Phi: np.ndarray, bounds: np.ndarray, pivots: np.ndarray
) -> np.ndarray:
    """Return the lower bounds under which runs go on in a chart where none is better (G), zero
    where they end.

    The hard bound tells of one pivot how errors grow. That of a block is a determinant, which falls
    as a power of its singular values: it may fall further where these are firm.

    Args:
        chart: that of the runs.
        Phi: the constraint Jacobian at configurations (G x all rows x nv).
        bounds, pivots: the bounds that ended the runs there, and the relative pivots (G).
    """
    lower = LOWER * np.minimum(bounds, pivots)
    least = np.full(lower.shape, PIVOT_BOUND)
    (near,) = np.nonzero(lower < PIVOT_BOUND)
    if near.size:
        least[near] = np.where(chart.strengths(Phi[near]) > FIRM, HALVED, PIVOT_BOUND)
    return np.where(bounds > least, np.maximum(least, lower), 0.0)
