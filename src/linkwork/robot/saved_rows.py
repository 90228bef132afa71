"""Rows: states of many members side by side, those in the same chart together, so that kernels see
them all at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from linkwork.equations.chart import Chart
from linkwork.robot.charts import CompiledChart
from linkwork.robot.members import Members
from linkwork.robot.one_by_one import Lone
from linkwork.robot.recording import trimmed

NO_INPUTS = np.empty((1, 0))


class Nodes(NamedTuple):
    """Hold the nodes of crossings on the way of which states were saved: K for each row.

    t: times (rows, K) [s]; y: states (rows, K, n); weights: what of each node counts (rows, K)
    """

    t: np.ndarray
    y: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, eq=False)
class SavedRows:
    """Hold states y = (q, v, z) in one chart: row i is that of member `members[i]` at the saved
    time `times[i]`, t[i] [s].

    held: what a sampled controller holds there (rows, inputs); no inputs without one
    nodes: where these states were saved while singular poses were stepped over
    """

    chart: CompiledChart
    members: np.ndarray
    times: np.ndarray
    t: np.ndarray
    y: np.ndarray
    held: np.ndarray
    nodes: Nodes | None = None

    def measured(
        self, measure: Callable[[SavedRows], Mapping[str, np.ndarray]]
    ) -> dict[str, np.ndarray]:
        """Return quantities (rows, ...) by name, those of crossings by their values at the nodes
        (`Segment.measured`)."""
        if self.nodes is None:
            return dict(measure(self))
        t, y, weights = self.nodes
        each = [
            np.repeat(values, t.shape[1], axis=0)
            for values in (self.members, self.times, self.held)
        ]
        found = measure(
            SavedRows(self.chart, each[0], each[1], t.ravel(), y.reshape(-1, y.shape[2]), each[2])
        )
        return {name: blended(weights, values) for name, values in found.items()}

    def __getitem__(self, rows: slice) -> SavedRows:
        """Return some of the rows."""
        parts = (values[rows] for values in (self.members, self.times, self.t, self.y, self.held))
        return SavedRows(
            self.chart, *parts, nodes=self.nodes and Nodes(*(values[rows] for values in self.nodes))
        )

    def split(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, v and z."""
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return self.y[:, :nq], self.y[:, nq : nq + n], self.y[:, nq + n :]


def blended(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return quantities (rows, ...) from their values at the nodes (rows K, ...)."""
    return np.einsum("rk,rk...->r...", weights, values.reshape(*weights.shape, *values.shape[1:]))


def pieces(crew: Members, one: Lone, times: np.ndarray) -> Iterator[SavedRows]:
    """Yield the states of each segment of a run at the saved times, which are found by their values
    among `times`."""
    signals = crew.system.inputs.coefficients.shape[2]
    for part, rows in trimmed(one.segments):
        done, nodes = part.trajectory, None
        t = done.t[rows]
        if part.crossed:
            known, shape = part.crossed, (len(t), len(part.crossed.t))
            each = (
                np.broadcast_to(known.t, shape),
                np.broadcast_to(known.y, (*shape, known.y.shape[1])),
            )
            nodes = Nodes(*each, known.weights(t))
        y, u = np.concatenate([done.q[rows], done.v[rows]], axis=1), done.u[rows, signals:]
        yield SavedRows(
            part.chart, np.full(len(t), one.member), np.searchsorted(times, t), t, y, u, nodes
        )


def last(one: Lone) -> SavedRows:
    """Return the last state of a run."""
    segment = one.segments[-1]
    done, none = segment.trajectory, np.zeros(1, int)
    end = np.array([done.end_time])
    return SavedRows(segment.chart, np.array([one.member]), none, end, done.y_end[None], NO_INPUTS)


def gathered(found: Iterable[SavedRows]) -> Iterator[SavedRows]:
    """Yield the states that lie in the same chart together, those of crossings apart."""
    alike: dict[tuple[Chart, bool], list[SavedRows]] = {}
    for rows in found:
        if len(rows.t):
            alike.setdefault((rows.chart.key, rows.nodes is None), []).append(rows)
    for same in alike.values():
        columns = zip(
            *((rows.members, rows.times, rows.t, rows.y, rows.held) for rows in same), strict=True
        )
        crossed = zip(*(rows.nodes for rows in same if rows.nodes), strict=True)
        nodes = [np.concatenate(values) for values in crossed]
        yield SavedRows(
            same[0].chart, *map(np.concatenate, columns), nodes=Nodes(*nodes) if nodes else None
        )
