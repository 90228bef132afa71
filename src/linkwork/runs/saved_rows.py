"""Saved rows: states of many members side by side, those in the same chart together, so that
kernels see them all at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from linkwork.equations.chart import Chart
from linkwork.model.chart_transfer import reread
from linkwork.model.charts import CompiledChart
from linkwork.model.state import State
from linkwork.runs.members import Members
from linkwork.runs.one_by_one import SingleRun
from linkwork.runs.run_record import trimmed
from linkwork.runs.side_by_side import Leg
from linkwork.simulation.turns import whole

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

    @property
    def at_nodes(self) -> SavedRows:
        """The states at the nodes of the crossings, those of each row one after the other."""
        assert self.nodes is not None
        t, y, _ = self.nodes
        members, times, held = (
            np.repeat(values, t.shape[1], axis=0)
            for values in (self.members, self.times, self.held)
        )
        return SavedRows(self.chart, members, times, t.ravel(), y.reshape(-1, y.shape[2]), held)

    @classmethod
    def saved(cls, leg: Leg, at: np.ndarray, wanted: np.ndarray) -> SavedRows:
        """Return the states of a leg's wanted members (M,) at the saved times `at` [s]."""
        done, times = leg.outcomes, np.arange(leg.outcomes.samples.shape[1])
        kept = (times >= leg.stands.saved[:, None]) & (times < done.saved[:, None])
        rows, places = np.nonzero(kept & wanted[:, None])
        none = np.empty((rows.size, 0))
        y = done.samples[rows, places]
        return cls(leg.chart, leg.members[rows], places, at[places], y, none)

    @classmethod
    def at_end(cls, leg: Leg, wanted: np.ndarray) -> SavedRows:
        """Return the last states of a leg's wanted members (M,)."""
        own, done = leg.members[wanted], leg.outcomes
        none = np.empty((own.size, 0))
        return cls(
            leg.chart, own, np.zeros(own.size, int), done.end_time[wanted], done.y_end[wanted], none
        )

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


def pieces(batch: Members, one: SingleRun, times: np.ndarray) -> Iterator[SavedRows]:
    """Yield the states of each segment of a run at the saved times, which are found by their values
    among `times`."""
    signals = batch.system.inputs.coefficients.shape[2]
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


def last(one: SingleRun) -> SavedRows:
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
        if len(same) == 1:
            yield same[0]
            continue
        columns = zip(
            *((rows.members, rows.times, rows.t, rows.y, rows.held) for rows in same), strict=True
        )
        crossed = zip(*(rows.nodes for rows in same if rows.nodes), strict=True)
        nodes = [np.concatenate(values) for values in crossed]
        yield SavedRows(
            same[0].chart, *map(np.concatenate, columns), nodes=Nodes(*nodes) if nodes else None
        )


def saved(
    batch: Members, legs: Sequence[Leg], singles: Sequence[SingleRun], at: np.ndarray
) -> Iterator[SavedRows]:
    """Yield the states at the saved times `at` [s], chart by chart; of members that ran by
    themselves those of their own runs."""
    alone = [one.member for one in singles]
    found = [SavedRows.saved(leg, at, ~np.isin(leg.members, alone)) for leg in legs]
    yield from gathered([*found, *(piece for one in singles for piece in pieces(batch, one, at))])


def last_states(
    batch: Members, legs: Sequence[Leg], singles: Sequence[SingleRun]
) -> tuple[State, np.ndarray]:
    """Return the last states reached, in one chart, and the extra states there; angles as they are
    read off the tree's.

    It is the home chart where that tells all motions, else the first of the members' own that does;
    if none does it is the home chart, and the rates that it does not tell are nan.
    """
    robot, count = batch.robot, len(batch)
    q, z = (np.empty((count, size)) for size in (robot.equations.nq, len(batch.system.states)))
    turns, latest = np.zeros(q.shape), np.zeros(count, int)
    for i, leg in enumerate(legs):
        latest[leg.members], turns[leg.members] = i, leg.outcomes.turns
    for one in singles:
        latest[one.member], turns[one.member] = -1, one.segments[-1].trajectory.turns
    ends = [SavedRows.at_end(leg, latest[leg.members] == i) for i, leg in enumerate(legs)]
    rows = list(gathered([*ends, *map(last, singles)]))
    for row in rows:
        q[row.members], _, z[row.members] = row.split()
    own = {row.chart.independent: row.chart for row in rows}.values()
    home, common, v = robot.chart, robot.chart, told_in(batch, rows, robot.chart)
    if np.isnan(v).any():
        ways = ((chart, told_in(batch, rows, chart)) for chart in own)
        common, v = next(
            ((chart, found) for chart, found in ways if not np.isnan(found).any()), (home, v)
        )
    if common is not home:
        robot.charts.setdefault(common.independent, common)
    q = whole(q, turns)
    (positions,) = robot.kernel("positions")(q, batch.p_robot())
    return State.known(positions, v, q, robot.coordinates, common.independent), z[
        :, : len(batch.system.extras)
    ]


def told_in(batch: Members, rows: Sequence[SavedRows], chart: CompiledChart) -> np.ndarray:
    """Return the rates (N, n) in one chart of states in others; nan where it does not tell their
    motion."""
    v = np.full((len(batch), batch.robot.mobility), np.nan)
    for row in rows:
        q, rates, _ = row.split()
        if row.chart.independent != chart.independent:
            rates, kept = reread(
                batch.robot, row.chart, chart, q, rates, batch.p_robot(row.members)
            )
            rates = np.where(kept[:, None], rates, np.nan)
        v[row.members] = rates
    return v
