"""Newton's method on many starts at a time: closed configurations with asked joint coordinates or
tool poses.

    q_next = q + N w s,    [Phi; J] w = -[phi; error],    s = min(1, 1 / largest of |w_k| / limit_k)

Steps are limited in what is not linear, so that an almost singular Jacobian throws no start far
away. States are worked off in chunks that fit the processor's cache, over threads; those that have
converged leave their chunk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import casadi as ca
import numpy as np

from linkwork.analysis.square import Square
from linkwork.equations import functions
from linkwork.kernels import Kernel, compile_function
from linkwork.model.closing import Step, bending, closed, of_any_length
from linkwork.model.spread import extent
from linkwork.robot import Robot
from linkwork.threads import usable_processors

CHUNK = 4096
TURN = 1.0  # largest turn of a step [rad]
SLIDE = 3.0  # largest slide of a step, in lengths of the mechanism
CONVERGED = (
    1e-10  # largest residual in the mechanism's own units, relative to what rounding grows with
)


@dataclass(frozen=True, eq=False)
class Solver:
    """Solve a square system from many starts.

    length: unit of slides in a step's limit [m]
    """

    square: Square
    length: float

    @cached_property
    def step(self) -> Kernel:
        """(q, y) -> q after a step, and the largest of |phi| and |error| before it, in the
        mechanism's own units."""
        square, tree = self.square, self.square.equations.tree
        w = square.newton
        w = w * (1 / ca.fmax(1, ca.mmax(ca.fabs(w * ca.DM(1 / self.limits)))))
        q = tree.q + tree.derivatives(w)
        for places, _ in tree.quaternions:
            q[list(places)] /= ca.sqrt(ca.sumsqr(q[list(places)]))
        rows = square.equations.rows
        residuals = ca.vertcat(rows.phi, square.error) * (
            1 / np.concatenate([rows.units, square.heights])
        )
        gap = ca.mmax(ca.fabs(ca.vertcat(residuals, rows.excess, *tree.norms())))
        return self._compiled("newton_step", {"q_next": q, "gap": gap})

    @cached_property
    def limits(self) -> np.ndarray:
        """Largest rates of a step (nv), infinite where all is linear; a thread advances by as much
        as a slide."""
        square, tree = self.square, self.square.equations.tree
        slide = SLIDE * self.length
        limits = np.where(tree.slides, slide, TURN)
        for node in (node for node in tree.nodes if node.turns and node.slides):
            assert node.motion is not None
            pitch = np.linalg.norm(tree.number(node.motion.slide))
            limits[node.columns[0].rate] = max(TURN, slide / pitch)
        A = ca.vertcat(square.equations.rows.Phi, square.J)
        return np.where(bending(tree, A), limits, np.inf)

    @cached_property
    def verdict(self) -> Kernel:
        """(q, y) -> the alignment of the joints' frames, and the stages' determinants."""
        return self._compiled(
            "verdict",
            {
                "alignment": self.square.equations.rows.alignment,
                "determinants": self.square.determinants,
            },
        )

    def _compiled(self, name: str, outputs: dict[str, ca.SX]) -> Kernel:
        square = self.square
        function = functions.function(name, square.equations, outputs, y=square.target)
        return compile_function(function).given(square.robot.p)

    def signs(self, q: np.ndarray) -> np.ndarray:
        """Return the signs of the stages' determinants (..., stages), relative to those at the
        reference."""
        return np.sign(self.verdict(q, np.zeros(len(self.square.what)))[1])

    def solve(
        self, q: np.ndarray, y: np.ndarray, iterations: int, mode: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Solve for configurations from starts.

        Args:
            q: starts (N, nq) or (nq); y: what is asked (N, rows) or (rows).
            iterations: most steps to take.
            mode: signs of the stages' determinants (stages) that solutions have to have; any if
                left out.

        Returns:
            q (N, nq), and which of them have converged, in the mode and with the joints' frames
            facing the right way (N).
        """
        count = max(len(part) for part in (q, y) if part.ndim == 2)
        q, y = (np.broadcast_to(part, (count, part.shape[-1])) for part in (q, y))
        found, good = np.empty(q.shape), np.zeros(count, bool)

        def work(part: slice) -> None:
            found[part], good[part] = self._solve(q[part], y[part], iterations, mode)

        in_threads(work, [slice(k, k + CHUNK) for k in range(0, count, CHUNK)])
        return found, good

    def _solve(
        self, q: np.ndarray, y: np.ndarray, iterations: int, mode: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        enough = CONVERGED * self.square.robot.size
        q, good, *_ = closed(
            staying_closed(self.step, enough), q, (y,), iterations, enough, contracting=False
        )
        alignment, determinants = self.verdict(q[good], np.zeros(y.shape[-1]))
        fits = True if mode is None else (np.sign(determinants) == mode).all(axis=1)
        good[good] = (alignment[:, 0] > 0) & fits
        return q, good


def staying_closed(kernel: Kernel, enough: float) -> Step:
    """Return the steps of a kernel, as `of_any_length` does, but for those that lead from a small
    enough residual to a larger one, as where a pivot vanishes: there q stays."""
    plain = of_any_length(kernel)

    def step(q: np.ndarray, *given: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
        after, residual, _ = plain(q, *given)
        near = np.flatnonzero(residual <= enough)
        if near.size:
            own = [part[near] if part.ndim == 2 else part for part in given]
            opened = near[~(plain(after[near], *own)[1] <= enough)]
            after[opened] = q[opened]
        return after, residual, None

    return step


def solver(square: Square) -> Solver:
    """Return the solver of a square system that its robot keeps."""
    return square.robot.once(_solver, square)


def _solver(robot: Robot, square: Square) -> Solver:
    return Solver(square, extent(robot.mechanism, robot.chart, robot.home.q))


Result = TypeVar("Result")


def in_threads(work: Callable[[slice], Result], parts: Sequence[slice]) -> list[Result]:
    """Do the parts of a job in as many threads as there are processors; compiled code runs side by
    side."""
    if len(parts) <= 1:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(min(len(parts), usable_processors())) as pool:
        return list(pool.map(work, parts))


def random_configurations(
    of: Square | Robot, length: float, count: int, random: np.random.Generator
) -> np.ndarray:
    """Return random configurations (count, nq): angles and orientations uniform, slides within a
    length of home.

    Their loops are open. Coordinates that are asked for are set by the caller.
    """
    tree, home = of.equations.tree, of.equations.reference
    q = np.empty((count, len(tree.coordinates)))
    for place, k in tree.single:
        spread = random.uniform(-1, 1, count)
        q[:, place] = home[place] + length * spread if tree.slides[k] else np.pi * spread
    for places, _ in tree.quaternions:
        p = random.standard_normal((count, 4))
        q[:, list(places)] = p / np.linalg.norm(p, axis=1, keepdims=True)
    return q
