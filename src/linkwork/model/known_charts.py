"""Known charts: those that were chosen somewhere, found again by the decisions that led to them.

At most configurations the chart that is chosen was chosen before. `charts_at` chooses the others;
what it compared on the way is kept, for `chart_margins` to hold further configurations against.
Where that would have to be compiled first, all are chosen anew until it pays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkwork.equations import Equations, charts_at
from linkwork.equations.chart import Asked, Chart, chart_of, choose_orders, unit_of
from linkwork.equations.chart_choice import FALL, alike, size

MOST = 256  # orders that are kept
PAYS = 2000  # configurations at which choosing anew takes as long as compiling does


class Known(NamedTuple):
    """Hold the decisions that led to orders of elimination, side by side as `decide` takes them."""

    kept: np.ndarray
    independent: np.ndarray
    steps: np.ndarray
    steps_at: np.ndarray
    sizes: np.ndarray
    sizes_at: np.ndarray


class KnownCharts:
    """Choose charts at configurations: those that are known by their decisions, all others anew.

    Args:
        equations: in any chart.
        preferred: rates that should be independent, as far as a configuration allows it well.
    """

    def __init__(self, equations: Equations, preferred: Sequence[int]):
        from linkwork.model import chart_margins

        self._margins = chart_margins
        self._decide = chart_margins.compiled() if chart_margins.were_compiled() else None
        self._met = 0
        self.equations, self.preferred = equations, tuple(preferred)
        columns, heights = equations.sizes
        units = equations.tree.rate_units / equations.rows.units[:, None]
        self._factors = np.stack([1 / columns / heights[:, None], units])
        self._bound, self._wanted = equations.regularity, np.array(preferred, int)
        self._orders: list[Chart] = []
        self._seen: set[object] = set()
        self._charts: dict[tuple[int, ...], Chart] = {}
        rows, n = len(equations.rows.names), equations.mobility
        start, none = np.zeros(1, int), np.empty((0, 8), int)
        self._known = Known(
            np.empty((0, rows), int), np.empty((0, n), int), none, start, np.empty((2, 0)), start
        )

    def at(self, Phi: np.ndarray) -> tuple[np.ndarray, list[tuple[np.ndarray, Chart]]]:
        """Return which configurations are regular (G), and the charts chosen there as `charts_at`
        does.

        Phi: the constraint Jacobian there (G x all rows x nv).
        """
        # Anew, while that is quicker than compiling.
        self._met += len(Phi)
        if self._decide is None and self._met > PAYS:
            self._decide = self._margins.compiled()
        if self._decide is None:
            found = charts_at(self.equations, Phi, self.preferred)
            return self.equations.regular(Phi), found
        # By the decisions, as far as they are sure.
        known, Phi = self._known, np.ascontiguousarray(Phi)
        found = np.zeros((len(Phi), 2 + len(self.equations.chart.rows)), int)
        self._decide(Phi, self._factors, self._bound, self._wanted, *known, found)
        regular, sure = found[:, 0] == 1, found != self._margins.UNKNOWN
        if sure.all():
            return regular, [(own, self._chart(key)) for key, own in alike(found[:, 1:])]
        # Anew, where they are not; that is known from here on.
        old, unsure, new = (np.flatnonzero(each) for each in (sure[:, 1], ~sure[:, 0], ~sure[:, 1]))
        groups = [(old[own], self._chart(key)) for key, own in alike(found[old, 1:])]
        regular[unsure] = self.equations.regular(Phi[unsure])
        if new.size:
            for own, chart in charts_at(self.equations, Phi[new], self.preferred):
                groups.append((new[own], chart))
                self._learn(chart, Phi[new[own[0]]])
        return regular, groups

    def _chart(self, key: tuple[int, ...]) -> Chart:
        """Return the chart of an order, with scales that fall as found."""
        chart = self._charts.get(key)
        if chart is None:
            order = self._orders[key[0]]
            falls, usual = np.array(key[1 : 1 + len(order.blocks)]), self._usual(order)
            scales = np.where(falls % 2, -1.0, 1.0) * usual / FALL ** (falls // 2)
            stages = [stage.blocks for stage in order.stages]
            width = self.equations.nv
            chart = chart_of(stages, scales.tolist(), order.rows, order.independent, width)
            self._charts[key] = chart
        return chart

    def _usual(self, chart: Chart) -> np.ndarray:
        return np.array([size(self.equations, block) for block in chart.blocks])

    def _learn(self, chart: Chart, Phi: np.ndarray) -> None:
        """Keep the decisions that led to a chart at a configuration; Phi: there (all rows x nv)."""
        equations, known = self.equations, self._known
        order = chart.rows, chart.independent, tuple(chart.blocks)
        if order in self._seen or len(self._orders) == MOST:
            return
        self._seen.add(order)
        asked: list[Asked] = []
        own = equations.natural(Phi)[None, None]
        choose_orders(equations.rows.pattern, own, chart.rows, chart.independent, asked)
        if None in asked:
            return
        kept = np.isin(np.arange(known.kept.shape[1]), chart.rows).astype(int)
        steps = np.array([step for each in asked for step in self._margins.steps_of(each)])
        units = equations.rows.units, equations.tree.rate_units
        sizes = np.array([[unit_of(block, units) for block in chart.blocks], self._usual(chart)])
        self._orders.append(chart)
        self._known = Known(
            np.vstack([known.kept, kept]),
            np.vstack([known.independent, chart.independent]),
            np.vstack([known.steps, steps]),
            np.append(known.steps_at, known.steps_at[-1] + len(steps)),
            np.hstack([known.sizes, sizes]),
            np.append(known.sizes_at, known.sizes_at[-1] + sizes.shape[1]),
        )
