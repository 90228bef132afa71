"""Following: whole turns of joints that close loops, counted along a run from step to step.

The tree's coordinates do not tell them (`labels`): they are the start's, and what was turned since.
Between two steps an angle turns by little, so that its rates at both tell how far; between the
times that were asked for it may turn as far as it will. A run that was saved at such times is gone
through once more in its own steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.model.charts import CompiledChart
from linkwork.model.state import State
from linkwork.runs.passage import Segment
from linkwork.simulation import Status, Trajectory

if TYPE_CHECKING:
    from linkwork.model.model import Model
    from linkwork.model.whole_turns import TurnedLabels
    from linkwork.runs.members import Members

DENSE, NEAR = 2.0, 1.0
"""Saved times for each step, and how far an angle turns from one to the next [rad], that tell its
turns."""


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """Hold the motion of a run, or of many, at times (..., K) [s]: coordinates read off the tree's,
    rates of all joints."""

    time: np.ndarray
    read: np.ndarray
    rates: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[SampledMotion]) -> SampledMotion:
        """Return the motion of parts one after the other; an instant that two of them hold is the
        earlier one's."""
        time, first = np.unique(np.concatenate([part.time for part in parts]), return_index=True)
        return cls(
            time,
            *(
                np.concatenate([getattr(part, name) for part in parts])[first]
                for name in ("read", "rates")
            ),
        )

    def windings(self, labels: TurnedLabels, first: np.ndarray) -> np.ndarray:
        """Return the whole turns of joints' coordinates (..., K, m), from those at the first time
        (..., m) on."""
        begun = labels.turned(self.read, np.broadcast_to(first[..., None, :], self.read.shape))
        return labels.windings(labels.unwrapped(self.time, begun, self.rates), self.read)

    def sure(self, labels: TurnedLabels, steps: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Tell of runs (N,) whether their times are so dense that nothing turns unseen.

        steps, times: how many each took and has (N,)
        """
        fastest = np.abs(self.rates[..., labels.turning]).max(axis=(-2, -1), initial=0.0)
        return (times > DENSE * steps) & (
            fastest * np.diff(self.time).max(axis=-1, initial=0.0) < NEAR
        )


def windings(
    robot: Model, state: State, segments: Sequence[Segment], every: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return when whole turns of joints' coordinates were counted (K,) [s], and these (K, m).

    Args:
        state: that the run went out from.
        every: whether every step was saved.
    """
    labels, first = robot.labels, robot.windings(state)
    if not labels.may_jump:
        return np.array([segments[-1].trajectory.end_time]), first[None]
    sampled = SampledMotion.joined(
        [part for segment in segments for part in passed(segment, every)]
    )
    return sampled.time, sampled.windings(labels, first)


def passed(segment: Segment, every: bool) -> Iterator[SampledMotion]:
    """Yield the motion of a segment: at its start, its steps and the times saved, and at its
    end."""
    part, (start, q, v), n = segment.trajectory, segment.start, segment.chart.equations.mobility
    if segment.crossed is not None:
        yield from crossed(segment)
        return
    ends = np.vstack([q, part.q_end]), np.vstack([v[:n], part.v_end[:n]])
    yield moving(segment.chart, np.array([start, part.end_time]), *ends)
    for saved in (part, *([] if every else steps(segment))):
        yield moving(segment.chart, saved.t, saved.q, saved.v[:, :n])


def steps(segment: Segment) -> Iterator[Trajectory]:
    """Yield the steps of a segment, those between the calls of a sampled controller apart; none of
    one that was cancelled."""
    part = segment.trajectory
    if segment.again is None or part.status is Status.CANCELLED:
        return
    edges = [segment.start[0], *(part.t if part.control else ()), part.end_time]
    for row in np.flatnonzero(np.diff(edges) > 0).tolist():
        yield segment.again(None, row - 1)


def moving(chart: CompiledChart, time: np.ndarray, q: np.ndarray, v: np.ndarray) -> SampledMotion:
    """Return the motion at states in a chart (K, ...)."""
    q, v = np.ascontiguousarray(q), np.ascontiguousarray(v)
    read, rates, _ = chart.joints_moving(q, v, 0 * v, chart.p, chart.told(len(q)))
    return SampledMotion(time, read, rates)


def crossed(segment: Segment) -> Iterator[SampledMotion]:
    """Yield the motion on the way over a singular pose: at the nodes, and at the times saved, where
    rates are interpolated."""
    part, over, chart = segment.trajectory, segment.crossed, segment.chart
    assert over is not None
    nq, n = chart.equations.nq, chart.equations.mobility
    known = moving(chart, over.t, over.y[:, :nq], over.y[:, nq : nq + n])
    kept = over.t <= part.end_time
    yield SampledMotion(over.t[kept], known.read[kept], known.rates[kept])
    times, q = np.append(part.t, part.end_time), np.vstack([part.q, part.q_end])
    yield SampledMotion(times, chart.kernel("positions")(q)[0], over.through(known.rates, times))


def of_members(
    batch: Members,
    time: np.ndarray,
    read: np.ndarray,
    rates: np.ndarray,
    steps: np.ndarray,
    again: Callable[[Sequence[int]], Iterable[tuple[int, Sequence[Segment], bool]]],
) -> np.ndarray:
    """Return the whole turns (N, K, m) of joints' coordinates along the runs of an ensemble's
    members.

    Args:
        time: (N, K) [s]; read: coordinates that are read off the tree's; rates: of all joints, nan
            where a run did not get.
        steps: that each member took (N,); again: runs members again whose turns these times do not
            tell for sure, and tells whether every step was saved.
    """
    robot, state, p = batch.robot, batch.given, batch.p_robot()
    labels, chart = robot.labels, robot.chart_of(state)
    begun, start, *_ = chart.kernel("joints_motion")(batch.q, state.rates, 0 * state.rates, p)
    begun, start = (np.broadcast_to(part, (len(batch), part.shape[-1])) for part in (begun, start))
    first = labels.windings(np.broadcast_to(state.positions, begun.shape), begun)
    if not labels.may_jump:
        return np.repeat(first[:, None], time.shape[1], axis=1)
    reached = np.concatenate(
        [np.ones((len(batch), 1), bool), ~np.isnan(rates).any(axis=-1)], axis=1
    )
    # Where a run did not get: before.
    last = np.maximum.accumulate(np.where(reached, np.arange(reached.shape[1]), 0), axis=1)

    def along(values: np.ndarray, at_start: np.ndarray) -> np.ndarray:
        whole = np.concatenate([at_start[:, None], values], axis=1)
        return np.take_along_axis(
            whole, last.reshape(*last.shape, *(1 for _ in whole.shape[2:])), axis=1
        )

    sampled = SampledMotion(
        along(time, np.zeros(len(batch))), along(read, begun), along(rates, start)
    )
    found = sampled.windings(labels, first)
    unsure = np.flatnonzero(~sampled.sure(labels, steps, reached.sum(axis=1)))
    for i, segments, every in again(unsure.tolist()):
        parts = [part for segment in segments for part in passed(segment, every)]
        own = SampledMotion.joined(
            [SampledMotion(sampled.time[i], sampled.read[i], sampled.rates[i]), *parts]
        )
        found[i] = own.windings(labels, first[i])[np.searchsorted(own.time, sampled.time[i])]
    return found[:, 1:]
