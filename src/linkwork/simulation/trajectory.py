"""A `Trajectory`: what one integration computed, up to where it ended."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from linkwork.simulation.events import Control, Occurrences, Pace
from linkwork.simulation.status import Status

if TYPE_CHECKING:
    from linkwork.simulation.native_loop import LoopOutcome


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Hold what an integration computed, up to where it ended.

    At the K saved times: `t` (K,) in s, `q` (K, nq), `v` (K, nv), `u` (K, nu), and `residual` (K,),
    the largest |phi(q)|. `events`: the zeros of the event functions, as `Occurrences`.
    The last state reached: `end_time`, `q_end` (nq,), `v_end` (nv,), and `turns` (nq,), the whole
    turns of angles that are not in `q_end`. To go on from there: `pace`, the step size, and
    `control`, what a sampled controller holds. How it went: `status`, `message`; `nfev` evaluations
    of the motion kernel, `steps` accepted, `rejected`, and `projections`, evaluations of the
    closure kernel; `pivot`, the smallest pivot met, at `pivot_time`; `closure_error`, the largest
    residual at the start, at the end and of all rows saved.

    All of it is read from `rows` (K, 3 + nq + nv + nu), each (t, q, v, u, residual, number of an
    event), `found`, such rows where events happened, `y_end`, (q, v) at the end, `outcome`, the
    loop's own account, and `bounds`, what it was held to.
    """

    rows: np.ndarray
    found: np.ndarray
    y_end: np.ndarray
    turns: np.ndarray
    nq: int
    outcome: "LoopOutcome"
    control: Control | None
    bounds: Mapping[str, float | str]
    status: Status

    @property
    def success(self) -> bool:
        """Tell whether the run reached its end."""
        return self.status is Status.FINISHED

    @property
    def message(self) -> str:
        if self.success:
            return self.status.sentence(time=self.end_time)
        return self.status.sentence(
            **self.outcome._asdict(), fault_source=self._fault_source, **self.bounds
        )

    @property
    def _fault_source(self) -> str:
        """What is not finite, by the number that the compiled loop gives it."""
        fault, held = int(self.outcome.fault), self.control.held.size if self.control else 0
        kinds = {
            "component {} of q'": self.nq,
            "component {} of v'": self.v_end.size,
            "the pivot": 1,
            "held input {}": held,
            "the function of event {}": math.inf,
        }
        for kind, count in kinds.items():
            if fault < count:
                return kind.format(fault) + (" (counted from 0)" if "{}" in kind else "")
            fault -= int(count)
        raise AssertionError(fault)

    @property
    def t(self) -> np.ndarray:
        return self.rows[:, 0]

    @property
    def q(self) -> np.ndarray:
        return self.rows[:, 1 : 1 + self.nq]

    @property
    def v(self) -> np.ndarray:
        return self.rows[:, 1 + self.nq : 1 + self.y_end.size]

    @property
    def u(self) -> np.ndarray:
        return self.rows[:, 1 + self.y_end.size : -2]

    @property
    def residual(self) -> np.ndarray:
        return self.rows[:, -2]

    @cached_property
    def events(self) -> Occurrences:
        n = self.y_end.size
        return Occurrences(
            self.found[:, 0], self.found[:, -1].astype(int), self.found[:, 1 : 1 + n]
        )

    @property
    def q_end(self) -> np.ndarray:
        return self.y_end[: self.nq]

    @property
    def v_end(self) -> np.ndarray:
        return self.y_end[self.nq :]

    @property
    def pace(self) -> Pace:
        """The step size to go on with, its growth, and what is known of stiffness."""
        done = self.outcome
        counts = int(done.since), int(done.votes)
        return Pace(done.step, done.growth, done.longest, done.ideal, *counts)

    @property
    def next_step(self) -> float:
        """The step size to go on with, in s."""
        return self.outcome.step

    @property
    def end_time(self) -> float:
        return self.outcome.time

    @property
    def nfev(self) -> int:
        return int(self.outcome.evaluations)

    @property
    def steps(self) -> int:
        return int(self.outcome.accepted)

    @property
    def rejected(self) -> int:
        return int(self.outcome.rejected)

    @property
    def projections(self) -> int:
        return int(self.outcome.projections)

    @property
    def pivot(self) -> float:
        return self.outcome.pivot

    @property
    def pivot_time(self) -> float:
        return self.outcome.pivot_time

    @property
    def closure_error(self) -> float:
        return self.outcome.closure_error
