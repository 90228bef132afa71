"""The work that a run records (`linkwork.runs.work`), to be differentiated.

It is a sum of the powers P at Gauss's nodes within the run's own steps, whose sizes are held:

    W(t) = sum_k h_k / 2 sum_i w_i P_ki over the steps before t, and the integral of the polynomial
           through the P_ki up to t in the step that t is in

so that dW is the same sum of dP. Where an event ends the run, its time adds P dt_e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.control.joined import Joined
from linkwork.errors import LinkworkError
from linkwork.gradients.breaks import Breaks
from linkwork.gradients.instants import Sampling, sampled
from linkwork.gradients.retraced import Retraced
from linkwork.gradients.segment_rows import SegmentRows
from linkwork.runs.work import NODES, integrals, nodes


def power(joined: Joined) -> ca.SX:
    """Return all powers together [W], of what acts and of what resists."""
    terms = joined.powers().call(joined.inputs)
    resisted = (terms[name] for name in ("friction", "dampers", "contacts", "drags"))
    given = ca.dot(joined.applied, joined.equations.v)
    return sum((ca.sum1(part) for part in resisted), given)


class NodeWeights(NamedTuple):
    """Tell work as a sum of powers at nodes.

    h (K,): the steps; step (S,), shares (S, NODES): of the times that are asked for, in which step
        each is, and what the coefficients of its polynomial add
    """

    h: np.ndarray
    step: np.ndarray
    shares: np.ndarray

    def along(self, powers: np.ndarray) -> np.ndarray:
        """Return the work (S, D) of powers (K NODES, D)."""
        c = np.einsum("knd,nl->kld", powers.reshape(len(self.h), NODES, -1), nodes()[1])
        ends = np.cumsum(self.h[:, None] / 2 * c[:, 0], axis=0)
        before = np.concatenate([np.zeros((1, c.shape[2])), ends])
        return before[self.step] + np.einsum("sl,sld->sd", self.shares, c[self.step])

    def against(self, bars: np.ndarray) -> np.ndarray:
        """Return the derivatives (K NODES,) by the powers of a sum of bars (S,) times the work."""
        c, ends = np.zeros((len(self.h), NODES)), np.zeros(len(self.h))
        np.add.at(c, self.step, self.shares * bars[:, None])
        np.add.at(ends, self.step, bars)
        later = np.append(np.cumsum(ends[::-1])[::-1][1:], 0.0)
        c[:, 0] += self.h / 2 * later
        return (c @ nodes()[1].T).ravel()


@dataclass(frozen=True, eq=False)
class WorkDone:
    """The work of a run; of: the run with the samples that are asked for."""

    of: Retraced

    @cached_property
    def steps(self) -> np.ndarray:
        """Where all steps begin and end (K, 2) [s], and the number of the segment of each."""
        found = []
        for number, segment in enumerate(self.of.segments):
            part = segment.trajectory
            edges = np.unique([segment.start[0], *part.t, part.end_time])
            found += [(a, b, number) for a, b in pairwise(edges)]
        return np.array(found).reshape(-1, 3)

    @cached_property
    def at_nodes(self) -> Retraced:
        """The same run, of which the nodes are read; the last state is, too."""
        x, _ = nodes()
        parts = []
        for number, segment in enumerate(self.of.segments):
            own, part = self.steps[self.steps[:, 2] == number], segment.trajectory
            times = own[:, :1] + (own[:, 1:2] - own[:, :1]) * x
            assert segment.again is not None
            # A sampled controller is not called again: each step has what was held at its start.
            rows = [-1] * len(own) if part.control is None else part.t.searchsorted(own[:, 1]) - 1
            groups = [(times, -1)] if part.control is None else zip(times, rows, strict=True)
            for each, row in groups:
                done = segment.again(each.ravel(), int(row))
                parts.append(sampled(self.of.system, number, done, done.rows))
        last = self.of.segments[-1].trajectory
        parts.append(sampled(self.of.system, len(self.of.segments) - 1, last, last.rows[-1:], True))
        sampling = Sampling(*map(np.concatenate, zip(*parts, strict=True)))
        if len(sampling.t) != NODES * len(self.steps) + 1:
            raise LinkworkError("the work is not differentiated: the run could not be retraced")
        return replace(self.of, samples=sampling, happened=np.empty(0, int))

    @cached_property
    def weights(self) -> NodeWeights:
        """What the recorded work is of the powers at the nodes."""
        t = self.of.record.time
        begin, end = self.steps[:, 0], self.steps[:, 1]
        step = np.clip(begin.searchsorted(t, side="right") - 1, 0, len(begin) - 1)
        h = end - begin
        shares = h[step, None] / 4 * integrals((t - begin[step]) / h[step])
        return NodeWeights(h, step, shares)

    @cached_property
    def at_end(self) -> np.ndarray:
        """The power at the end where an event ends the run, for each time that is asked for: 0 but
        for the last."""
        found = np.zeros(len(self.of.record.time))
        if self.of.ended:
            own = slice(NODES * len(self.steps), None)
            found[-1] = self.at_nodes.values("power", power, own)[-1, 0]
        return found

    def require_no_jumps(self) -> None:
        """Refuse events within the run at which what acts jumps."""
        rows = (SegmentRows(self.of, number) for number in range(len(self.of.segments)))
        if any(Breaks(own).jumps for own in rows):
            raise LinkworkError(
                "the work is not differentiated over an event at which what acts jumps; "
                "differentiate a run up to there, and one from there on"
            )
