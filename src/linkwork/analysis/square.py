"""Square systems: what is asked of a mechanism, together with its loops, as one elimination.

    [Phi; J] w = [0; y']        J: rows of what is asked: joint rates, or the tool's twist

Such a system decides the direct (J: the actuators' rates) and the inverse kinematics (J: the
tool's). It is solved as the equations of motion are: an order of elimination chosen once, traced as
straight-line code, evaluated many states at a time. Rates that the rows leave undetermined (spins)
are held. The determinant of each stage of the block triangular form vanishes where the system is
singular and nowhere else: between its zeros its sign tells working modes and assembly modes apart.
Source: Gosselin & Angeles, IEEE Trans. Robotics and Automation 6 (1990) 281-290 (the two
Jacobians); Chablat & Wenger, ICRA 1998 (working modes by the signs of the inverse problem's
determinant).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.chart import Chart, choose_chart
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.independence import choose_independent
from linkwork.errors import LinkworkError
from linkwork.model import checks, task
from linkwork.model.asked import ToolAsked
from linkwork.model.asked_rows import Rows, joint_rows
from linkwork.model.task import DEPENDENT, around
from linkwork.robot import Robot


@dataclass(frozen=True, eq=False)
class Square:
    """Hold the rows of what is asked of a robot, and the elimination that solves them together with
    the loops.

    what: names of the rows; J: rows x nv; target: y (rows); error: value - target (rows), angles
        the short way round
    heights: units of the rows: the mechanism's own length of lengths, 1 of angles
    asked: what is asked of the tool, if it is: its held values are what the rows are for
    """

    robot: Robot
    what: tuple[str, ...]
    J: ca.SX
    target: ca.SX
    error: ca.SX
    heights: np.ndarray
    asked: ToolAsked | None = None

    @property
    def equations(self) -> Equations:
        return self.robot.equations

    @property
    def chart(self) -> Chart:
        """Order of elimination of [Phi; J], the loops' rows first."""
        return self._chosen[0]

    @property
    def base(self) -> np.ndarray:
        """Configuration (nq) at which it was chosen: the reference, or one near it where that
        itself is singular."""
        return self._chosen[1]

    @cached_property
    def _chosen(self) -> tuple[Chart, np.ndarray]:
        equations, rows = self.equations, self.equations.rows
        A = ca.vertcat(rows.Phi, self.J)
        read = ca.Function("A", [equations.tree.q, equations.p], [ca.densify(A)])
        kept = (*equations.chart.rows, *range(len(rows.names), A.shape[0]))
        heights, widths = np.concatenate([rows.units, self.heights]), equations.tree.rate_units
        values = [
            (q, np.array(read(q, self.robot.p)) * widths / heights[:, None])
            for q in around(self.robot)
        ]
        regular = [(q, value) for q, value in values if full_rank(scaled(value)[list(kept)])]
        if not regular:
            raise LinkworkError(
                f"{', '.join(self.what)} do not determine the configuration near the reference of "
                f"{self.robot.mechanism.name!r}; choose others, or another reference"
            )
        samples = [value for _, value in regular]
        held = choose_independent(scaled(samples[0])[list(kept)], ())
        return choose_chart(A, samples, kept, held, (heights, widths)), regular[0][0]

    @cached_property
    def solution(self) -> ca.SX:
        """W (nv x rows): the rates w = W y' for which the loops stay closed, at closed
        configurations."""
        count = self.J.shape[0]
        return self._solve(
            self.equations.rows.Phi, SX.zeros(len(self.equations.rows.names), count), SX.eye(count)
        )[0]

    def led(self, rates: ca.SX) -> ca.SX:
        """Return the rates w (nv) for some of what is asked, y' (rows)."""
        return self._solve(self.equations.rows.Phi, SX(len(self.equations.rows.names), 1), rates)[0]

    @cached_property
    def determinant(self) -> ca.SX:
        """Determinant of [Phi; J] over its value at `base`."""
        return product(ca.vertsplit(self.determinants))

    @cached_property
    def determinants(self) -> ca.SX:
        """Determinant of each stage over its value at `base`."""
        pivots = self._pivots
        ends = np.cumsum([len(stage.blocks) for stage in self.chart.stages])
        parts = [
            pivots[end - len(stage.blocks) : end]
            for end, stage in zip(ends, self.chart.stages, strict=True)
        ]
        return ca.vertcat(SX(0, 1), *[product(part) for part in parts])

    @property
    def weakest(self) -> ca.SX:
        """The smallest relative pivot of the elimination."""
        return ca.fabs(weakest(self._pivots))

    @cached_property
    def _pivots(self) -> list[ca.SX]:
        return self._solve(
            self.equations.rows.Phi, SX(len(self.equations.rows.names), 0), SX(self.J.shape[0], 0)
        )[1]

    @cached_property
    def newton(self) -> ca.SX:
        """The rates' Newton step for phi = 0 and error = 0, from open configurations, too."""
        return self._solve(self.equations.rows.open_Phi, -self.equations.rows.phi, -self.error)[0]

    def _solve(self, Phi: ca.SX, loops: ca.SX, asked: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        X, pivots = solve(self.chart, ca.vertcat(Phi, self.J), ca.vertcat(loops, asked))
        held = SX.zeros(1, asked.shape[1])
        return ca.densify(ca.vertcat(*[X.get(k, held) for k in range(self.equations.nv)])), pivots


def product(factors: Sequence[ca.SX]) -> ca.SX:
    """Return the product of expressions."""
    result = SX(1)
    for factor in factors:
        result = result * factor
    return result


def of_joints(robot: Robot, names: Sequence[str]) -> Square:
    """Return the system that asks for joint coordinates, made once for each robot: the direct
    kinematics where they are the actuated ones.

    Args:
        names: joint coordinates that have a rate of their own.

    Raises:
        LinkworkError: names that are unknown or part of a quaternion; coordinates that do not
            determine the motion.
    """
    return robot.once(_of_joints, tuple(names))


def _of_joints(robot: Robot, names: tuple[str, ...]) -> Square:
    checks.known(names, robot.coordinates, "joint")
    for name in names:
        if name not in robot.rates:
            raise LinkworkError(
                f"{name!r} is part of a quaternion and cannot be asked for; name angles and slides"
            )
    places = [robot.coordinates.index(name) for name in names]
    rows = joint_rows(robot.equations, names, robot.labels.angular[places].tolist())
    return square(robot, names, rows, robot.labels.sizes[places])


def of_tool(robot: Robot, what: Sequence[str] | None = None) -> Square:
    """Return the system that asks for task coordinates of the tool, made once for each robot: the
    inverse kinematics.

    Args:
        what: names of coordinates, of the tool's task or of any pose (`mechanism.task`); the task
            if left out.

    Raises:
        LinkworkError: no tool; unknown names; coordinates that do not determine the motion.
    """
    robot.require_tool()
    return robot.once(_of_tool, task.task_of(robot) if what is None else task.known(robot, what))


def _of_tool(robot: Robot, coordinates: task.Task) -> Square:
    asked = ToolAsked(coordinates, robot.equations.tree.length, robot.planar)
    return square(robot, asked.labels, asked.expressed(robot.equations), asked.units, asked)


def full_rank(rows: np.ndarray) -> bool:
    """Tell whether the rows are defined and independent."""
    return bool(np.isfinite(rows).all()) and bool(
        np.linalg.matrix_rank(rows, rtol=DEPENDENT) == len(rows)
    )


def square(
    robot: Robot,
    what: tuple[str, ...],
    rows: Rows,
    heights: np.ndarray,
    asked: ToolAsked | None = None,
) -> Square:
    """Return the system; refuse another number of rows than freedoms."""
    freedoms = task.freedoms(robot)
    if len(what) != freedoms:
        besides = " besides spins of members about themselves" if robot.spins else ""
        raise LinkworkError(
            f"{', '.join(what) or 'nothing'}: {checks.amount_is(len(what), 'coordinate')} given, "
            f"but the mobility is {freedoms}{besides}; give as many"
        )
    return Square(robot, what, *rows, heights, asked)


def scaled(A: np.ndarray) -> np.ndarray:
    """Return A with its columns, then its rows, brought to length 1: free of units."""
    A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return A / np.maximum(np.linalg.norm(A, axis=1), 1e-300)[:, None]
