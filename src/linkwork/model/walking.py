"""Walking: bring one mechanism from a closed configuration to one thing asked, by compiled steps.

What `leading` does of many is done of one here, the shortest way: all of the straight way at once,
else in steps as long as Newton's method contracts at once and the signs of the mode stay.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import copysign, isfinite

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.reference import CLOSED
from linkwork.kernels import Kernel
from linkwork.model.asked import Asked
from linkwork.model.assembly import FAR
from linkwork.model.charts import CompiledChart
from linkwork.model.closing import CONDITIONS, CONTRACTS, LONGEST, MET, Approach
from linkwork.model.modes import FLAT, ModeStages

NEWTON = 7  # steps of Newton's method in which it has to contract
ROUNDS, FINEST = 200, 1 / 64  # steps of a way at most, and the part of it that the shortest one is
FARTHEST = 1e4  # own units from which ways are no longer walked in shorter parts
STEPS_AHEAD = 8  # steps, tried ones too, that each own unit of a way takes
FIRST = 0.25  # part of the way that is tried where all of it at once was not met


@dataclass(frozen=True, eq=False)
class Walker:
    """Walk to what is asked, one at a time.

    approach: compiled steps; modes: what has to keep its signs; chart: whose equations tell ways
    """

    approach: Approach
    modes: ModeStages
    chart: CompiledChart
    asked: Asked

    def walked(self, start: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far the straight way to what is asked (rows) leads from a start (nq), on its
        mode: q (1, nq), and whether to its end (1)."""
        begun, last = self.contracted(start, y)
        mode = [copysign(1.0, part) if abs(part) > FLAT else 0.0 for part in self.parts(begun)]
        if last is not None and self.fits(last, mode):
            return last[None, : start.size], np.array([True])
        q, part, length, way = start, 0.0, FIRST, self.way.flat
        here = way(start, y, np.zeros(1), self.approach.p)
        far = distances(self.asked, here, y, begun[start.size + 1])
        for _ in range(rounds_of(far)):
            aim = min(1.0, part + length)
            _, last = self.contracted(q, way(start, y, np.array([aim]), self.approach.p))
            if last is not None and self.fits(last, mode):
                q, part, length = last[: start.size], aim, 2.0 * length
            else:
                length *= 0.25
            if part == 1 or length * far[0] <= FINEST:
                break
        return q[None].copy(), np.array([part == 1])

    def contracted(self, q: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return what the first of Newton's steps tells, and what the last one does; None for that
        where they do not contract (`closing.closed`)."""
        step, p = self.approach.kernel.flat, self.approach.p
        size, longest, begun = q.size, LONGEST, None
        for _ in range(NEWTON):
            told = step(q, y, p)
            begun = told if begun is None else begun
            q, residual, length = told[:size], told.item(size), told.item(size + 1)
            near = residual <= CLOSED
            if not length <= (MET if near else longest):
                break
            if near:  # no number is finite again once it was none
                return begun, told if isfinite(q @ q) else None
            longest = CONTRACTS * length
        assert begun is not None
        return begun, None

    def fits(self, told: np.ndarray, mode: list[float]) -> bool:
        """Tell whether frames face each other where a step began, and no determinant is against the
        signs of a mode."""
        if not told.item(self.first - 1) >= 0:
            return False
        signed = zip(self.parts(told), mode, strict=True)
        return not any([part * sign < -FLAT for part, sign in signed])

    def parts(self, told: np.ndarray) -> list[float]:
        """Return the determinants (stages) relative to their sizes where a step began."""
        return (told[self.first :] / self.approach.sizes).tolist()

    @cached_property
    def first(self) -> int:
        """Return where the determinants begin in what a step tells."""
        return self.chart.equations.nq + CONDITIONS

    @cached_property
    def way(self) -> Kernel:
        """Return (q, y, part, p) -> what is asked at a part of the straight way from q to y."""
        asked = self.asked
        key = f"way {asked.names} {asked.wraps.tolist()}"
        return self.chart.compiled(key, lambda equations: way(equations, asked))


def distances(asked: Asked, begin: np.ndarray, end: np.ndarray, length: ArrayLike) -> np.ndarray:
    """Return how far ways from values to others (K, rows) lead (K), by the first of Newton's steps
    to their ends (K), in own units: at least 1, by which their steps are shorter parts of them than
    those of others."""
    length = np.atleast_1d(length)
    sound = walkable(asked, begin, end) & (length > 1) & (length <= FARTHEST)
    return np.where(sound, length, 1.0)


def walkable(asked: Asked, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Tell which ways from values to others (..., rows) have no lengths that may be in another
    unit."""
    aside = ((end - begin) / asked.units)[..., asked.lengths]
    return np.asarray(np.linalg.norm(aside, axis=-1) <= FAR)


def rounds_of(far: np.ndarray) -> int:
    """Return how many steps ways of some lengths may take."""
    return ROUNDS + int(STEPS_AHEAD * (far.max(initial=1.0) - 1))


def way(equations: Equations, asked: Asked) -> ca.Function:
    """Return (q, y, part, p) -> what is asked at a part, from 0 to 1, of the straight way."""
    part = SX.sym("part")
    y, there = asked.along(equations, part)
    inputs = [equations.tree.q, y, part, equations.p]
    return ca.Function("way", inputs, [ca.densify(there)], {"cse": True})
