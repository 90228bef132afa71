"""Branches of a grid of poses: which solutions of neighbours lie on one branch.

A stage of the inverse problem that holds one driven leg of two links has as many solutions as its
determinant has signs. Larger ones have more: two legs turned over leave the sign of a product as it
is, and a platform that is led in its position may stand turned. There poses are gone to along
straight ways, in short steps on the arc of solutions,

    |q_2 - q_1 - s (W_1 + W_2) x / 2| <= TIGHT s |W_1 x|,    q' = W x'

for a part s of the way x (trapezoidal rule, in the mechanism's own units), while no determinant
changes its sign or vanishes: shorter ones where that does not hold, as beside a stretched leg,
where q is as a square root. Another branch is farther away than a part of such a step.
Source: Allgower & Georg, Introduction to Numerical Continuation Methods, SIAM 2003, ch. 6 (steps
by how the predictor differs).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.analysis._jacobians import Jacobians
from linkwork.analysis.actuated_coordinates import actuated_coordinates
from linkwork.analysis.all_rows import all_rows
from linkwork.analysis.newton import Solver
from linkwork.analysis.square import Square
from linkwork.analysis.turning_alone import turns_alone
from linkwork.equations import functions
from linkwork.equations.algebra import SX, wrapped
from linkwork.equations.reference import unit
from linkwork.equations.tree import Tree
from linkwork.kernels import Kernel, compile_function
from linkwork.model import task
from linkwork.model.asked import ToolAsked
from linkwork.model.closing import closed
from linkwork.robot import Robot

LEG = 3  # most rates of a stage of one leg, in the plane, too
TIGHT, FLOOR = 0.25, 1e-7  # part of a step, and own units, by which the rule may be off
LONGEST = 0.3  # step, in own units
SHORTER = 0.25  # part of a way across cells that is the longest step
ROUNDS, FINEST = 60, 1 / 256  # steps of a way, tried ones too, and the part of it that is shortest
MEET = 0.01  # part of a determinant where a way begins that is none: branches meet
STEPS = 6  # of Newton's method from where the rates lead
DIRECT = 10  # of it over a whole way
NEAREST = 16  # poses of a grid to which the straight ways from a guess are tried first


def tells_all(J: Jacobians) -> bool:
    """Tell whether the signs of the inverse problem's stages tell its branches apart: each stage is
    one leg's."""
    rows = all_rows(J.inverse)
    stages = rows.leader.modes.by_all_rows if rows.spared else J.inverse.chart.stages
    return all(tells(J, stage.columns) for stage in stages)


def tells(J: Jacobians, columns: Sequence[int]) -> bool:
    """Tell whether the sign of a stage of some rates tells its branches apart: it is one leg's."""
    rates, lines = J.robot.equations.tree.rates, J.robot.mechanism.transmissions
    driven = {rates.index(name) for name in J.direct.what if name in rates}
    for k, name in enumerate(J.direct.what):
        if name in lines:
            driven.update(J.direct.J[k, :].sparsity().get_col())
    return len(columns) <= LEG and len(driven & {*columns}) <= 1


def actuated(J: Jacobians, q: np.ndarray) -> np.ndarray:
    """Return the actuated coordinates (N, n), angles that turn alone within half a turn of those at
    home, also those by which transmissions are as long as they are."""
    robot, names = J.robot, J.direct.what
    if not {*names} <= {*robot.coordinates}:
        return actuated_coordinates(robot, unwound(robot, q))
    places = [robot.coordinates.index(name) for name in names]
    values, home = robot.kernel("positions")(q)[0][:, places], robot.home.positions[places]
    alone = [robot.once(turns_alone, name) for name in names]
    return np.where(alone, home + wrapped(values - home), values)


def unwound(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return configurations (N, nq) with the tree's angles that turn alone within half a turn of
    those at home."""
    q, home, tree = q.copy(), robot.home.q, robot.equations.tree
    for place, _ in tree.single:
        label = tree.coordinates[place]
        if label in robot.coordinates and robot.once(turns_alone, label):
            q[:, place] = home[place] + wrapped(q[:, place] - home[place])
    return q


@dataclass(frozen=True, eq=False)
class Ways:
    """Hold straight ways of the tool: where they begin (N, n), and the shifts to their ends (N, n),
    turns the short way round.

    rotation: places of a whole rotation vector, whose shift is the turn between both
    """

    begin: np.ndarray
    shift: np.ndarray
    rotation: list[int] | None

    @classmethod
    def between(cls, asked: ToolAsked, begin: np.ndarray, end: np.ndarray) -> Ways:
        shift = end - begin
        shift[:, asked.wraps] = wrapped(shift[:, asked.wraps])
        if asked.rotation:
            from scipy.spatial.transform import Rotation

            first, last = (Rotation.from_rotvec(y[:, asked.rotation]) for y in (begin, end))
            shift[:, asked.rotation] = (last * first.inv()).as_rotvec()
        return cls(begin, shift, asked.rotation)

    def at(self, which: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Return the values (K, n) of some ways (K) after parts of them (K)."""
        moved = part[:, None] * self.shift[which]
        y = self.begin[which] + moved
        if self.rotation:
            from scipy.spatial.transform import Rotation

            first = Rotation.from_rotvec(self.begin[which][:, self.rotation])
            turn = Rotation.from_rotvec(moved[:, self.rotation])
            y[:, self.rotation] = (turn * first).as_rotvec()
        return y


@dataclass(frozen=True, eq=False)
class GridBranch:
    """Go from pose to pose on one branch.

    solve: configurations (N, nq) on the mode, guesses (N, nq), poses (N, n) and Newton's steps ->
        configurations, and which of them are at their poses and on the mode (N)
    moving: (q, x') -> q' = W x', and the determinants of the stages
    """

    J: Jacobians
    solve: Callable[[np.ndarray, np.ndarray, np.ndarray, int], tuple[np.ndarray, np.ndarray]]
    moving: Callable[[np.ndarray, np.ndarray], Sequence[np.ndarray]]

    @classmethod
    def by_kept_rows(cls, J: Jacobians, problem: Solver, mode: np.ndarray) -> GridBranch:
        """Return the one whose mode is told by the signs of the determinants of kept rows."""
        moving = J.robot.once(branch_rates, J.inverse)
        return cls(J, lambda _, q, y, steps: problem.solve(q, y, steps, mode), moving)

    @classmethod
    def by_all_rows(cls, J: Jacobians) -> GridBranch:
        """Return the one whose mode is told by all rows, from one configuration to the next."""
        rows = all_rows(J.inverse)
        leader = rows.leader

        def solve(here: np.ndarray, q: np.ndarray, y: np.ndarray, steps: int):
            found = closed(leader.least.step, q, (y,), steps, contracting=False)
            return found.q, leader.told(found, np.zeros(0), here)[1]

        def moving(q: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            w = rows.rates(q) @ shift[..., None]
            rates = (leader.outputs(q)["derivatives"] @ w)[..., 0]
            return rates, leader.modes.sizes(rows.matrix(q))

        return cls(J, solve, moving)

    @property
    def asked(self) -> ToolAsked:
        assert self.J.inverse.asked is not None
        return self.J.inverse.asked

    @cached_property
    def tree(self) -> Tree:
        return self.J.robot.equations.tree

    def begun(
        self, start: np.ndarray, poses: np.ndarray, first: int = NEAREST
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return configurations (N, nq) at poses (N, n) to which straight ways lead from that of a
        start (nq), and which these are (N): of the first nearest poses, or else of all."""
        here = task.values(self.J.robot, start, self.J.task)[None]
        begin, q = np.repeat(here, len(poses), axis=0), np.tile(start, (len(poses), 1))
        shift = Ways.between(self.asked, begin, poses).shift / self.J.inverse.heights
        order, good = np.argsort(np.linalg.norm(shift, axis=1)), np.zeros(len(poses), bool)
        for some in (order[:first], order[first:]):
            if not good.any():
                q[some], good[some] = self.walked(q[some], begin[some], poses[some])
        return q, good

    def walked(
        self,
        q: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        finest: float = FINEST,
        longest: float = 1.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return configurations (N, nq) to which straight ways (N, n) lead from others on their
        arcs, and which of them to their ends (N); finest, longest: parts of a way that are the
        shortest and the longest step."""
        ways, q, units = Ways.between(self.asked, begin, end), q.copy(), self.tree.units
        part, going = np.zeros(len(q)), np.arange(len(q))
        length = np.full(len(q), longest)
        rates, determinants = self.moving(q, ways.shift)
        least = MEET * np.abs(determinants)
        for _ in range(ROUNDS):
            if not going.size:
                break
            # A step as the rates lead, closed by Newton's method at the pose after it.
            here, rate = q[going], rates[going]
            swiftest = np.abs(rate / units).max(axis=1) + FLOOR
            aim = np.minimum(1.0, part[going] + np.minimum(length[going], LONGEST / swiftest))
            step = (aim - part[going])[:, None]
            ahead, there = unit(self.tree, here + step * rate), ways.at(going, aim)
            reached, good = self.solve(here, ahead, there, STEPS)
            # It is on the arc where the rates at both of its ends tell what it came to.
            after, determinants = self.moving(reached, ways.shift[going])
            off = np.abs((reached - here - step / 2 * (rate + after)) / units).max(axis=1)
            good &= off <= TIGHT * step[:, 0] * swiftest + FLOOR
            good &= (np.abs(determinants) > least[going]).all(axis=1)
            on = going[good]
            q[on], rates[on], part[on] = reached[good], after[good], aim[good]
            length[going] = np.minimum(longest, step[:, 0] * np.where(good, 4.0, 0.25))
            going = going[(part[going] < 1) & (length[going] > finest)]
        return q, part == 1

    def walked_where_met(
        self, q: np.ndarray, begin: np.ndarray, end: np.ndarray, longest: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what `walked` does, of those ways alone from whose beginnings Newton's method
        leads to a solution of the mode at their ends: most of the others leave what is reached."""
        q, (_, good) = q.copy(), self.solve(q, q, end, DIRECT)
        some = np.flatnonzero(good)
        q[some], good[some] = self.walked(q[some], begin[some], end[some], longest=longest)
        return q, good

    def walked_farther(
        self, q: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what `walked_where_met` does, of longer ways in steps that are not; not where a
        further step of Newton's method still moves what it ended in: there branches meet."""
        q, good = self.walked_where_met(q, begin, end, SHORTER)
        some = np.flatnonzero(good)
        again, good[some] = self.solve(q[some], q[some], end[some], STEPS)
        moved = np.abs((again - q[some]) / self.tree.units).max(axis=1, initial=0.0)
        good[some] &= moved <= FLOOR
        return q, good


def led(
    J: Jacobians, q: np.ndarray, begin: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (N, nq) to which straight ways (N, n) lead from others on a working
    mode by all rows, as `Robot.assemble` leads the tool, and which of them to their ends (N)."""
    leader, asked = all_rows(J.inverse).leader, J.inverse.asked
    assert asked is not None
    way = Ways.between(asked, begin, end).at
    return leader.walked(q, way, np.arange(len(q)), leader.signs(q), leader.step)


def branch_rates(robot: Robot, square: Square) -> Kernel:
    """Return (q, x') -> q' = W x', and the determinants of the stages, of a square system."""
    rates = SX.sym("rates", len(square.what))
    outputs = {
        "q_dot": robot.equations.tree.derivatives(square.led(rates)),
        "determinants": square.determinants,
    }
    function = functions.function("branch_rates", robot.equations, outputs, rates=rates)
    return compile_function(function).given(robot.p)
