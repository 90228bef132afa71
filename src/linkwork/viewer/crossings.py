"""Crossings: which singular poses lie between two neighbouring poses of a robot led by hand.

With A = [Phi; J], all closure rows and the rows J of as many rates as there are freedoms, and A_0
of a neighbouring pose, det(A_0' A) changes its sign where these rates do not determine the motion
(Cauchy-Binet, as in `model.modes`): J those of the actuators, at a singular pose of the drives;
those of what the hand leads, at one of the tool. Both do where more rows of Phi depend on each
other than elsewhere: at a singular pose of the loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.robot import Robot
from linkwork.viewer.hand_goals import HandGoal, Outputs

LOOPS = (
    "a singular pose of the loops was passed: there the mechanism has further freedoms, and "
    "branches of motion meet"
)
DRIVES = (
    "a singular pose of the drives was passed: there the robot moves while they hold still, and "
    "no forces of theirs hold it"
)
TOOL = (
    "a singular pose of the tool was passed: there joints move and it does not, and on the other "
    "side it is led on another working mode"
)
HALVINGS = 12  # of the way between two poses, to find the singular one
SINGULAR = 1e-3  # least singular value of rows, over the largest, that tells a singular pose
EDGE = 1e-4  # likewise of a pose on the edge, such as a leg's when it is stretched out: of no side
Posed = tuple[np.ndarray, Outputs]  # q, and the outputs there
Between = Callable[[np.ndarray, np.ndarray], Posed]


@dataclass(eq=False)
class Crossings:
    """Tell singular poses of a robot; scale: of the tree's rates, as lengths (nv); units: of the
    closure rows; between: gives the pose between two others, its loops closed, and its outputs;
    aside: the last pose of one side, while the robot is led along an edge, and the q there."""

    robot: Robot
    scale: np.ndarray
    units: np.ndarray
    between: Between
    aside: tuple[Posed, np.ndarray] | None = None

    @cached_property
    def driven(self) -> list[int]:
        """The rows of the actuators' rates, where these are as many as the freedoms."""
        rates, actuators = self.robot.rates, self.robot.actuators
        if len(actuators) != self.robot.mobility or not {*actuators} <= {*rates}:
            return []
        return [rates.index(name) for name in actuators]

    def rows(self, out: Outputs, goal: HandGoal) -> dict[str, np.ndarray]:
        """Return the rows J of the drives and of what is led, where they are as many as the
        freedoms."""
        found = {DRIVES: out["J_coordinates"][self.driven]}
        if not goal.strict:  # of the tool
            found[TOOL] = goal.rows(out)[1]
        n = self.robot.mobility
        return {kind: J * self.scale for kind, J in found.items() if len(J) == n}

    def loops(self, out: Outputs) -> np.ndarray:
        """Return the closure rows for steps as lengths."""
        return out["Phi"] / self.units[:, None] * self.scale

    def turned(self, out: Outputs, other: Outputs, goal: HandGoal) -> dict[str, float]:
        """Return the signs of det(A_0' A) at two poses, by what J is of."""
        stacks = [
            {kind: np.vstack([self.loops(each), J]) for kind, J in self.rows(each, goal).items()}
            for each in (out, other)
        ]
        pairs = {kind: (A, stacks[1][kind]) for kind, A in stacks[0].items() if kind in stacks[1]}
        return {kind: float(np.linalg.slogdet(A.T @ B)[0]) for kind, (A, B) in pairs.items()}

    def of_one_side(self, out: Outputs, goal: HandGoal) -> bool:
        """Tell whether a pose lies beside all singular ones, and not on them."""
        loops, nv = self.loops(out), len(self.scale)
        return all(weakest(np.vstack([loops, J]), nv) > EDGE for J in self.rows(out, goal).values())

    def passed(self, first: Posed, last: Posed, goal: HandGoal) -> str:
        """Return what lies between two neighbouring poses; nothing most often."""
        # From the last pose that was of one side.
        if self.aside is not None and np.array_equal(self.aside[1], first[0]):
            first = self.aside[0]
        self.aside = None
        if not self.of_one_side(last[1], goal):
            self.aside = first, last[0]
            return ""
        if not self.of_one_side(first[1], goal):
            return ""
        # Signs that change, and whether a singular pose is why.
        for kind, sign in self.turned(first[1], last[1], goal).items():
            if sign >= 0:
                continue
            out = self.nearest(kind, first, last, goal)
            loops, rows = self.loops(out), self.rows(out, goal)
            if weakest(loops, len(self.robot.equations.chart.rows)) < SINGULAR:
                return LOOPS
            if weakest(np.vstack([loops, rows[kind]]), loops.shape[1]) < SINGULAR:
                return kind
        return ""

    def nearest(self, kind: str, first: Posed, last: Posed, goal: HandGoal) -> Outputs:
        """Return the outputs at the pose where the sign of a kind changes."""
        ends = [first, last]
        for _ in range(HALVINGS):
            middle = self.between(ends[0][0], ends[1][0])
            ends[int(self.turned(first[1], middle[1], goal)[kind] < 0)] = middle
        return ends[0][1]


def weakest(rows: np.ndarray, rank: int) -> float:
    """Return the singular value of rows, over the largest, of the last of so many."""
    values = np.linalg.svd(rows, compute_uv=False)
    return float(values[rank - 1] / values[0]) if rank else 1.0
