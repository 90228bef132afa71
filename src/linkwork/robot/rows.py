"""Rows: states of many members side by side, those in the same chart together, so that kernels see them all at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from linkwork.equations.chart import Chart
from linkwork.robot.alone import Lone
from linkwork.robot.charts import CompiledChart
from linkwork.robot.members import Members
from linkwork.robot.recording import trimmed

NO_INPUTS = np.empty((0, 0))


@dataclass(frozen=True, eq=False)
class Rows:
    """Hold states y = (q, v, z) in one chart: row i is that of member `members[i]` at the saved time `times[i]`.

    held: what a sampled controller holds there (rows, inputs); no inputs without one
    """

    chart: CompiledChart
    members: np.ndarray
    times: np.ndarray
    y: np.ndarray
    held: np.ndarray

    def split(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, v and z."""
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return self.y[:, :nq], self.y[:, nq : nq + n], self.y[:, nq + n :]


class Piece(NamedTuple):
    """Hold states y and held inputs in one chart: of a member, at saved times by their numbers."""

    chart: CompiledChart
    member: int
    times: np.ndarray
    y: np.ndarray
    held: np.ndarray = NO_INPUTS


def pieces(crew: Members, one: Lone) -> Iterator[Piece]:
    """Yield the states at the saved times of each segment of a run."""
    start, signals = 0, crew.system.inputs.coefficients.shape[2]
    for part, rows in trimmed(one.segments):
        y = np.concatenate([part.trajectory.q[rows], part.trajectory.v[rows]], axis=1)
        yield Piece(part.chart, one.member, np.arange(start, start + len(y)), y, part.trajectory.u[rows, signals:])
        start += len(y)


def gathered(found: Iterable[Piece]) -> Iterator[Rows]:
    """Yield the states that lie in the same chart together."""
    alike: dict[Chart, list[Piece]] = {}
    for piece in found:
        alike.setdefault(piece.chart.key, []).append(piece)
    for same in alike.values():
        members = np.repeat([piece.member for piece in same], [len(piece.y) for piece in same])
        times = np.concatenate([piece.times for piece in same])
        y, held = np.vstack([piece.y for piece in same]), np.vstack([piece.held for piece in same])
        yield Rows(same[0].chart, members, times, y, held)
