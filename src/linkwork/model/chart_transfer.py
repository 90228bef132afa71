"""Rereading: tell a motion in other independent rates, and check that nothing of it is lost.

    w = L v,    v_other = w at the other chart's independent rates,    w' H w = w_other' H w_other

Where a chart is nearly singular its rates say little of the motion: what is read in them from
elsewhere, or from them, is wrong by far. So pivots are asked for first, and the kinetic energy is
compared in the end.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.chart_choice import DETERMINED
from linkwork.model import checks
from linkwork.model.charts import CompiledChart
from linkwork.model.reordering import evaluated
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.equations.chart import Chart
    from linkwork.model.model import Model

KEPT = 1e-6  # change of the kinetic energy that is none, relative to it


def reread(
    robot: Model,
    given: CompiledChart,
    chart: CompiledChart,
    q: np.ndarray,
    v: np.ndarray,
    p: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates (..., n) of a chart at states given in those of another, and whether they
    tell the same motion (...).

    Args:
        q, v: coordinates (..., nq) and rates of the given chart (..., n).
        p: values of the robot's free parameters, of each state or of all; the robot's own if left
            out.
    """
    p = robot.p if p is None else p
    if not v.any():
        return np.zeros(v.shape), np.ones(v.shape[:-1], bool)
    w, pivot = told(robot, given, q, v, p)
    found = chart.from_tree(w)
    again, other = told(robot, chart, q, found, p)
    energy = robot.kernel("motion_energy")
    if w.ndim == p.ndim == 1:
        one, two = energy.flat(q, w, p).item(), energy.flat(q, again, p).item()
        strong = abs(pivot) > checks.PIVOT_BOUND and abs(other) > checks.PIVOT_BOUND
        return found, np.array(strong and abs(two - one) <= KEPT * max(one, two))
    before, after = (energy(q, rates, p)[0][..., 0] for rates in (w, again))
    kept = np.abs(after - before) <= KEPT * np.maximum(before, after)
    kept &= np.minimum(np.abs(pivot), np.abs(other)) > checks.PIVOT_BOUND
    at_rest = np.abs(v).max(axis=-1, keepdims=True, initial=0.0) == 0
    return np.where(at_rest, 0.0, found), kept | at_rest[..., 0]


def told(
    robot: Model, chart: CompiledChart, q: np.ndarray, v: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return w = L v (..., nv) and the weakest relative pivot (...), in a good order where the
    chart's own is weak."""
    w, pivot = chart.weighed(q, v, p)
    if (abs(pivot) if w.ndim == 1 else np.abs(pivot).min(initial=np.inf)) > checks.sure(chart.key):
        return w, pivot
    w, pivot = evaluated(robot, chart, lambda other: other.kernel("tree_rates"), q, v, p)
    return w, pivot[..., 0]


def chart_in(
    robot: Model, names: tuple[str, ...], q: np.ndarray, least: float = DETERMINED
) -> CompiledChart | None:
    """Return the known chart in the rates of these names where it is regular at q, else one that is
    chosen there.

    None where these rates do not determine the motion (`chart_choice.chart_in`).
    """
    tree, known = robot.equations.tree.rates, robot.charts.get(names)
    checks.known(names, tree, "rate of the tree")
    if known is not None and abs(known.pivot(q)) > checks.PIVOT_BOUND:
        return known
    return robot.chart.anew(q, tuple(tree.index(name) for name in names), least)


def start(
    robot: Model, state: State, last: Chart | None = None
) -> tuple[CompiledChart, np.ndarray]:
    """Return the chart in which a run from one state starts, and its rates there.

    A state in the home chart may start in a shorter one, if nothing is lost by that; any other
    keeps its own. last: the chart in which a run ended that is resumed, which goes on in it.
    """
    own, shorter = robot.chart, robot.run_chart
    if last is not None:
        known = {own.key: own, shorter.key: shorter}.get(last)
        return known or robot.run_charts.of(last, own), state.rates
    if state.independent != robot.independent:
        return robot.charts[state.independent], state.rates
    if shorter is own:
        return own, state.rates
    v, kept = reread(robot, own, shorter, state.q, state.rates)
    return (shorter, v) if kept else (own, state.rates)
