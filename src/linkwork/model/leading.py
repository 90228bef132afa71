"""Leading: bring a mechanism from a closed configuration to what is asked, many times, without
leaving the branch.

What is asked, poses of the tool or coordinates of joints, has a straight way from where these are.
It is walked in steps as long as Newton's method contracts from the last configuration at once and
the signs of the mode stay (`closing`, `modes`). Poses whose straight way is barred, by the edge of
the workspace, are solved from where it ends, from the guess and from random configurations
(fixed seed); of the solutions on the same mode the nearest is taken.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.checks import amount, at
from linkwork.equations.reference import unit
from linkwork.equations.tree import Tree
from linkwork.errors import ModelWarning
from linkwork.mechanism import Mechanism
from linkwork.model.asked import ToolAsked, Way
from linkwork.model.assembly import Assembler, UnreachableError
from linkwork.model.charts import CompiledChart
from linkwork.model.closing import Approach, Closed, Least, Step, closed
from linkwork.model.leg_sides import LegSides, side_of
from linkwork.model.modes import SAMPLES, SPREAD, ModeStages, same
from linkwork.model.spread import extent
from linkwork.model.turning import behind_threads, closing
from linkwork.model.walking import FINEST, FIRST, NEWTON, Walker, distances, rounds_of, walkable

STARTS, ITERATIONS = 48, 40  # random configurations, and Newton's steps from each
LAST = 240  # random configurations where nothing else leads to joint coordinates
SAME = 1e-6  # difference in own units of configurations that are one
FINER = 1 / 4096  # part of a way that the shortest step of it is, before it is taken for barred
PARTS = 64  # of what is asked that are solved at a time from random configurations

Found = tuple[np.ndarray, np.ndarray, np.ndarray]
Told = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Leader:
    """Lead one robot in what is asked.

    least: steps of least squares
    approach: compiled steps, where closure and what is asked determine the motion
    walker: takes them for one, the shortest way
    assembler: solves for one, by steps that are shortened until they lead nearer
    modes: what has to keep its signs
    strict: whether what is on another mode is refused, or else taken as it comes
    mechanism; home: its q there (nq); chart: of its home
    """

    least: Least
    approach: Approach | None
    walker: Walker | None
    assembler: Assembler
    modes: ModeStages
    strict: bool
    mechanism: Mechanism
    home: np.ndarray
    chart: CompiledChart

    def lead(self, start: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return q (N, nq) at what is asked (N, rows), from a closed configuration (nq).

        Raises:
            UnreachableError: what is not reached, by its number where there are several.

        Warns:
            ModelWarning: ways of joints that are barred, straight ones and `bent` ones, beyond
                which another mode may lie.
        """
        walker = self.walker if len(y) == 1 else None
        if walker:
            q, there = walker.walked(start, y[0])
        else:
            q, there = self.approached(start[None].repeat(len(y), axis=0), y)
        if np.count_nonzero(there) == len(q):
            return q
        # Walkers take it for another mode where a row that is kept vanishes in vain.
        left, vain = np.flatnonzero(~there), walker and not self.modes.spared
        near, straight, mode = self.straight(
            start, y[left], q if vain else None, finely=not self.strict
        )
        q[left], there = self.beyond(start, near, y[left], straight, mode)
        for k in left[~there]:
            with at(f"{self.least.asked.noun} {k}: ") if len(q) > 1 else nullcontext():
                q[k] = self.otherwise(start, q[k], y[k], mode)
        if self.modes.chart and not (self.strict or straight.all()):
            barred = left[~straight]
            _, found = self.bent(start, y[barred], mode, q[barred])
            barred = barred[~found]
            if barred.size:
                self.tell_barred(y, barred)
        return q

    def bent(
        self, start: np.ndarray, y: np.ndarray, mode: np.ndarray, to: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) at what is asked (K, rows) to which a way leads that keeps the signs of
        a mode, with one of the rows ahead of the others or behind them, and where one does (K); to:
        configurations (K, nq) that alone count."""
        rows, every, q = np.eye(y.shape[1]), np.arange(len(y)), np.tile(start, (len(y), 1))
        way, found = self.least.asked.way(self.outputs(start[None]), y), np.zeros(len(y), bool)
        begin, end = way(every, np.zeros(len(y))), way(every, np.ones(len(y)))
        near = walkable(self.least.asked, begin, end)
        for ahead in np.unique(np.concatenate([rows, 1 - rows]), axis=0):
            left = np.flatnonzero(near & ~found) if 0 < ahead.sum() < len(rows) else every[:0]
            corner = begin[left] + ahead * (end[left] - begin[left])
            here, there = self.on_straight_ways(start[None], corner, mode)
            left, here = left[there], here[there]
            q[left], there = self.on_straight_ways(here, end[left], mode)
            if to is not None:
                there &= np.abs((q[left] - to[left]) / self.tree.units).max(axis=1) < SAME
            found[left] = there
        return q, found

    def on_straight_ways(
        self, start: np.ndarray, y: np.ndarray, mode: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how far straight ways to what is asked (K, rows) lead on a mode from one start
        (1, nq), or one each (K, nq): q (K, nq), and which to their ends (K)."""
        if not len(y):
            return np.empty((0, start.shape[1])), np.empty(0, bool)
        if len(y) == 1 and self.walker and not self.modes.spared:  # one takes the shortest way
            q, there = self.walker.walked(start[0], y[0])
            return q, there & same(self.signs(q), mode)
        way = self.least.asked.way(self.outputs(start), y)
        return self.walked(start, way, np.arange(len(y)), mode, self.step)

    def tell_barred(self, y: np.ndarray, barred: np.ndarray) -> None:
        """Warn of those of what is asked (N, rows) to which straight ways are barred."""
        count, first = barred.size, barred[0]
        many = f" ({count:,} of {amount(len(y), self.least.asked.noun)})" if len(y) > 1 else ""
        warnings.warn(
            f"between the guess and the mechanism {self.least.asked.said(y[first])}{many} the "
            "straight way of these joints meets a singular pose: what is found beyond may lie on "
            "another assembly mode; give a nearer guess on the mode that is meant",
            ModelWarning,
            stacklevel=7,
        )

    def led(self, start: np.ndarray, y: np.ndarray) -> Found:
        """Return how far straight ways to what is asked (K, rows) lead, or what is found besides: q
        (K, nq).

        Also which of them are at their ends (K), and the signs of the mode of the start (stages).
        """
        near, straight, mode = self.straight(start, y)
        return *self.beyond(start, near, y, straight, mode), mode

    def straight(
        self, start: np.ndarray, y: np.ndarray, near: np.ndarray | None = None, finely: bool = False
    ) -> Found:
        """Return how far straight ways to what is asked (K, rows) lead: q (K, nq), and as `led`.

        near: how far they lead (K, nq), where they have been walked in vain; finely: in finer
        steps, too, where others do not lead to their ends
        """
        out = self.outputs(start[None])
        way, mode = self.least.asked.way(out, y), self.modes.signs(self.matrix(out))[0]
        if near is None:
            # Compiled steps were tried all the way at once (`approached`).
            first = FIRST if self.approach else 1.0
            q, there = self.walked(start, way, np.arange(len(y)), mode, self.step, first)
        else:
            q, there = near, np.zeros(len(y), bool)
        if finely:
            left, step = np.flatnonzero(~there), self.least.step
            q[left], there[left] = self.walked(start, way, left, mode, step, FINEST, finest=FINER)
        return q, there, mode

    def beyond(
        self,
        start: np.ndarray,
        q: np.ndarray,
        y: np.ndarray,
        straight: np.ndarray,
        mode: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what is found `elsewhere` where no straight way leads (K): q (K, nq), and where
        loops are closed (K)."""
        there = straight.copy()
        if self.approach and mode.all() and not there.all():
            left = np.flatnonzero(~there)
            q[left], there[left] = self.elsewhere(start, q[left], y[left], mode)
        return q, there

    def approached(
        self, q: np.ndarray, y: np.ndarray, mode: np.ndarray | None = None, *p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) at what is asked (K, rows) to which compiled steps contract, and which
        these are (K).

        Args:
            q: guesses (K, nq).
            mode: signs to be kept; those of the first guess if left out.
            p: free parameters of each (K, np); the robot's own if left out.
        """
        if self.approach is None or not len(q):
            return q, np.zeros(len(q), bool)
        found = closed(self.approach.step, q, (y, *p), NEWTON)
        if mode is None:
            mode = self.modes.told(found.begun[1][:1])
        good, kept = self.told(found, mode)
        if self.modes.spared and (left := np.flatnonzero(good & ~kept)).size:
            kept[left] = self.alike(q[left], found.q[left])
        return found.q, kept

    def closed(
        self,
        step: Step,
        q: np.ndarray,
        given: Sequence[np.ndarray],
        mode: np.ndarray,
        contracting: bool = True,
        start: np.ndarray | None = None,
    ) -> Found:
        """Return q (K, nq), where it is closed with frames that face each other (K), and where on a
        mode, that of others (K, nq) if given, too (K)."""
        rounds = NEWTON if contracting else ITERATIONS
        found = closed(step, q, given, rounds, contracting=contracting)
        return found.q, *self.told(found, mode, start)

    def told(self, found: Closed, mode: np.ndarray, start: np.ndarray | None = None) -> Told:
        """Return where loops are closed with frames that face each other (K), and where on a mode,
        that of others (K, nq) if given, too (K)."""
        alignment, parts = found.told
        good = found.met & (alignment >= 0)
        if start is None or not self.modes.spared:
            return good, good & same(self.modes.told(parts), mode)
        return good, good & self.alike(start, found.q)

    def walked(
        self,
        start: np.ndarray,
        way: Way,
        which: np.ndarray,
        mode: np.ndarray,
        step: Step,
        first: float = 1.0,
        *p: np.ndarray,
        finest: float = FINEST,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how far the straight ways `which` (K) lead by some steps: q (K, nq), and which to
        their ends (K), from one start (nq) or several (K, nq).

        mode: signs to be kept, or those of each (K, stages); first: the part that is tried first;
        p: as in `approached`; finest: the part that no step falls below, of ways of an own unit.
        """
        modes = np.resize(mode, (which.size, mode.shape[-1]))
        q, going = np.resize(start, (which.size, start.shape[-1])), np.arange(which.size)
        part, length = np.zeros(which.size), np.full(which.size, first)
        end, own = way(which, part + 1), [each[which] for each in p]
        far = distances(self.least.asked, way(which, part), end, step(q, end, *own)[2])
        for _ in range(rounds_of(far)):
            if not going.size:
                break
            aim = np.minimum(1.0, part[going] + length[going])
            given = (way(which[going], aim), *(own[which[going]] for own in p))
            reached, _, good = self.closed(step, q[going], given, modes[going], start=q[going])
            q[going[good]], part[going[good]] = reached[good], aim[good]
            length[going] *= np.where(good, 2.0, 0.25)
            going = going[(part[going] < 1) & (length[going] > finest / far[going])]
        return q, part == 1

    def elsewhere(
        self, start: np.ndarray, near: np.ndarray, y: np.ndarray, mode: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) on a mode to which steps lead that need not contract, and where they do
        (K).

        They begin where straight ways ended, near (K, nq), then at the start, then at random.
        """
        q, there = near.copy(), np.zeros(len(y), bool)
        for begin in (near, np.tile(start, (len(y), 1))):
            left = np.flatnonzero(~there)
            first, given = begin[left], (y[left],)
            found, _, there[left] = self.closed(self.step, first, given, mode, False, first)
            there[left[there[left]]] = self.on_side(found[there[left]], start, mode)
            q[left[there[left]]] = found[there[left]]
        left = np.flatnonzero(~there)
        for some in np.split(left, range(PARTS, left.size, PARTS)):
            found, _, there[some] = self.scattered(start, near[some], y[some], mode, self.step)
            q[some[there[some]]] = found[there[some]]
        return q, there

    def side(self, start: np.ndarray, mode: np.ndarray) -> LegSides | None:
        """Return on which side of their stretched poses single legs are at a closed configuration
        (nq); None where no stage of the mode has more than one row, or its legs are not told apart.
        """
        asked = self.least.asked
        lumped = any(len(stage.rows) > 1 for stage in self.modes.stages)
        if not (lumped and isinstance(asked, ToolAsked)) or asked.rotation:
            return None
        out = self.outputs(start[None])
        random = np.random.default_rng(1998).standard_normal((SAMPLES, asked.units.size))
        way = asked.way(out, asked.values(out) + SPREAD * asked.units * random)
        q, there = self.walked(start, way, np.arange(SAMPLES), mode, self.step)
        if np.sum(there) < 2:  # what vanishes at the start alone is not told from what always does
            return None
        A = self.in_own_units(np.concatenate([start[None], q[there]]))
        return side_of(A, A.shape[1] - asked.units.size)

    def on_side(self, q: np.ndarray, start: np.ndarray, mode: np.ndarray) -> np.ndarray:
        """Tell which configurations (K, nq) are on the side of a start."""
        side = self.side(start, mode) if len(q) else None
        return np.ones(len(q), bool) if side is None else side.keeps(self.in_own_units(q))

    def in_own_units(self, q: np.ndarray) -> np.ndarray:
        """Return [Phi; J] (K, rows, nv) in the mechanism's own units at configurations (K, nq)."""
        return self.matrix(self.outputs(q)) * self.least.factors

    def scattered(
        self,
        start: np.ndarray,
        near: np.ndarray | None,
        y: np.ndarray,
        mode: np.ndarray,
        step: Step,
        starts: int = STARTS,
    ) -> Found:
        """Return the q (K, nq) on a mode, that of near ones (K, nq) if given, nearest to a start
        that so many random configurations lead to.

        Also at which of what is asked (K, rows) any is closed (K), and any is on the mode (K).
        """
        tree, random = self.tree, np.random.default_rng(1990)
        q = np.tile(start, (starts, 1))
        for place, rate in tree.single:
            reach = self.length if tree.slides[rate] else np.pi
            q[:, place] += random.uniform(-1, 1, starts) * reach
        for places, _ in tree.quaternions:
            q[:, list(places)] = random.standard_normal((starts, 4))
        q, y = np.tile(unit(tree, q), (len(y), 1)), np.repeat(y, starts, axis=0)
        q = self.least.asked.put(tree, q, y)
        alike = None if near is None else near.repeat(starts, axis=0)
        q, good, fits = self.closed(step, q, (y,), mode, False, alike)
        fits[fits] = self.on_side(q[fits], start, mode)
        # Whole turns of a screw, or of a wheel in mesh, open loops; others turn as threads do.
        free = closing(self.chart)
        for place, rate in tree.single:
            if free[place] and not tree.slides[rate]:
                q[:, place] -= 2 * np.pi * np.round((q[:, place] - start[place]) / (2 * np.pi))
        for place, turns in behind_threads(self.chart, start, q).items():
            fits &= bool(free[place]) | (turns == 0)
            q[:, place] += 2 * np.pi * turns
        away = np.where(fits, np.linalg.norm((q - start) / tree.units, axis=1), np.inf)
        nearest = away.reshape(-1, starts).argmin(axis=1) + starts * np.arange(len(y) // starts)
        return q[nearest], np.logical_or.reduce(good.reshape(-1, starts), axis=1), fits[nearest]

    def otherwise(
        self, start: np.ndarray, near: np.ndarray, y: np.ndarray, mode: np.ndarray
    ) -> np.ndarray:
        """Return q (nq) at what is asked (rows), to which no straight way leads on the mode by
        compiled steps; near: how far these led."""
        # The straight way by steps of least squares, if these were not the ones that walked it.
        if self.approach:
            way = self.least.asked.way(self.outputs(start[None]), y[None])
            (near,), (there,) = self.walked(start, way, np.arange(1), mode, self.least.step)
            if there:
                return near
        # Bent ways, shortened steps, then any from random configurations.
        if self.strict:
            (q,), (there,) = self.bent(start, y[None], mode)
            if there:
                return q
        refusal, elsewhere, known = None, False, near if self.modes.spared else start
        for begin in (near, start) if self.strict else (start,):
            try:
                q = self.assembler.at(self.least, y, begin)
            except UnreachableError as error:
                refusal = refusal or error
                continue
            if not self.strict or (
                self.keeps(np.stack([known, q]))[1] and self.on_side(q[None], start, mode)[0]
            ):
                return q
            elsewhere = True
        on = (near[None], y[None], mode) if self.strict else (None, y[None], 0 * mode)
        starts = STARTS if self.strict else LAST
        (q,), (met,), (fits,) = self.scattered(start, *on, self.least.step, starts)
        if fits:
            return q
        elsewhere |= bool(met)
        if refusal and not elsewhere:
            raise refusal
        raise UnreachableError(
            f"the tool is at {np.round(y, 6).tolist()} only on another branch than the guess: "
            "joints would have to pass a stretched or folded pose; give a guess on that branch, or "
            'take any by branch="any"'
        )

    def keeps(self, q: np.ndarray) -> np.ndarray:
        """Tell which configurations (N, nq) of a motion are on the mode of the first one (N)."""
        if self.modes.spared:
            return np.logical_and.accumulate(self.alike(q[[0, *range(len(q) - 1)]], q))
        return same(signs := self.signs(q), signs[0])

    def alike(self, q: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Tell which configurations are on the mode of others (K, nq), by all rows."""
        return self.modes.alike(self.in_own_units(q), self.in_own_units(other))

    def signs(self, q: np.ndarray, *p: np.ndarray) -> np.ndarray:
        """Return the signs that tell modes apart (K, stages) at configurations (K, nq); p: as in
        `approached`."""
        return self.modes.signs(self.matrix(self.outputs(q, *p)))

    def outputs(self, q: np.ndarray, *p: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs of `functions.assembly` at rest for configurations (K, nq), by name;
        matrices as such."""
        return self.least.outputs(q, *p)

    def matrix(self, out: dict[str, np.ndarray]) -> np.ndarray:
        """Return [Phi; J] (K, rows, nv)."""
        return self.least.matrix(out)

    @property
    def step(self) -> Step:
        """Return the compiled steps where there are any, and no kept row vanishes in vain, else
        those of least squares."""
        return self.approach.step if self.approach and not self.modes.spared else self.least.step

    @property
    def tree(self) -> Tree:
        return self.least.tree

    @cached_property
    def length(self) -> float:
        """How far slides may be from the guess [m]."""
        return extent(self.mechanism, self.chart, self.home)
