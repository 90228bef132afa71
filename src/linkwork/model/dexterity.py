"""Conditioning: how well the actuators move the tool in a configuration, from 1 (alike in all
directions) to 0 (singular).

With an orthonormal basis N of the motions that the loops allow, the actuated rates are Q z and the
rates of the task coordinates X z:

    conditioning = 1 / cond K,    q' = K x',    K = Q X^+        turns counted times a length

The length makes the columns of K for turns and for shifts equally long at the reference, or the
rows for actuators that turn and that slide where the tool does one of these alone. Where the robot
has no task, or a single freedom, it is the smallest singular value of Q in the mechanism's own
units: the part of the worst motion of the tree's joints that the actuators see, another number
where another joint of a loop is cut.
Source: Gosselin & Angeles, J. Mech. Design 113 (1991) 220-226; Angeles 2014, sec. 5.8
(characteristic length).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from linkwork.mechanism.task import is_length
from linkwork.model.asked import ToolAsked
from linkwork.model.closing import Least
from linkwork.model.modes import ModeStages
from linkwork.model.spread import extent
from linkwork.model.task import Task, around, freedoms, task_if_any

if TYPE_CHECKING:
    from linkwork.model.model import Model

HARDLY = 1e-3  # of the largest length and its inverse: turns hardly move the actuators, or shifts
LOST = 1e-12  # singular value, over the largest and in own units, that is none


@dataclass(frozen=True, eq=False)
class Allowed:
    """Hold what the motions that the loops allow do at configurations (K): Q (K, a, n) of the
    actuated rates and X (K, k, n) of the task coordinates, where there is a task.

    units: the mechanism's own of the task coordinates (k), in which X is
    """

    Q: np.ndarray
    X: np.ndarray
    units: np.ndarray

    @cached_property
    def parts(self) -> tuple[np.ndarray, ...]:
        """S, U and V' of X = U S V': singular values (K, r) and vectors (K, k, r), (K, r, n)."""
        U, values, V = np.linalg.svd(self.X, full_matrices=False)
        return values, U, V

    @property
    def led(self) -> np.ndarray:
        """Which configurations (K) are not leg-singular."""
        values = self.parts[0]
        return values[:, -1] > LOST * np.maximum(values[:, 0], 1.0)

    @property
    def K(self) -> np.ndarray:
        """K (K, a, k) of q' = K x', by the pseudo-inverse V S^+ U' of X."""
        values, U, V = self.parts
        kept = values > LOST * values[:, :1]
        inverse = np.divide(1.0, values, where=kept, out=np.zeros(values.shape))
        X_inverse = V.swapaxes(1, 2) @ (inverse[..., None] * U.swapaxes(1, 2))
        return self.Q @ X_inverse / self.units


def actuated(robot: Model) -> tuple[str, ...]:
    """Return the rates that are driven, the independent ones where too few are."""
    enough = len(robot.actuators) >= freedoms(robot)
    return robot.actuators if enough else robot.independent


@dataclass(frozen=True, eq=False)
class MotionRows:
    """Hold what stays the same of the rows that tell what allowed motions do.

    least, asked: by which [Phi; J] is told
    kept, heights: the closure rows that are held, and their own units as a column
    widths: the mechanism's own units of the tree's rates as a column
    J: the actuated rates of the tree's (a, nv), where these are the independent ones; driven: their
        places among the rates of all joints, None of transmissions
    units: in which the actuated rates are told, as a column
    """

    least: Least
    asked: ToolAsked
    kept: slice | list[int]
    heights: np.ndarray
    widths: np.ndarray
    J: np.ndarray | None
    driven: list[int] | None
    units: np.ndarray

    @classmethod
    def of(cls, robot: Model, task: Task, own: bool) -> MotionRows:
        """Return those of a task; own: whether the actuated rates are told in the mechanism's own
        units, too."""
        tree, rows, names = robot.equations.tree, robot.equations.rows, actuated(robot)
        asked = ToolAsked(task, tree.length, robot.planar)
        least = Least(robot.kernel("assembly"), tree, rows.units, asked, ModeStages())
        held = [*robot.equations.chart.rows]
        kept = slice(None) if held == [*range(len(rows.names))] else held
        of_each = [tree.length if own and robot.unit(name) == "m" else 1.0 for name in names]
        units, J, driven = np.array(of_each)[:, None], None, None
        if names == robot.independent:
            J = np.eye(len(tree.rates))[[tree.rates.index(name) for name in names]] / units
        elif not robot.mechanism.transmissions:
            driven = [robot.rates.index(name) for name in names]
        heights, widths = rows.units[kept][:, None], tree.rate_units[:, None]
        return cls(least, asked, kept, heights, widths, J, driven, units)

    def actuated(self, out: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the rows (K or none, a, nv) of the actuated rates in their units."""
        if self.J is not None:
            return self.J
        if self.driven is None:
            return out["J_actuated"] / self.units
        return out["J_coordinates"][:, self.driven] / self.units


def allowed(
    robot: Model, q: np.ndarray, task: Task, p: np.ndarray | None = None, own: bool = False
) -> Allowed:
    """Return what allowed motions do at configurations (K, nq); own: the actuated rates, too, in
    the mechanism's own units."""
    rows: MotionRows = robot.once(MotionRows.of, task, own)
    out = rows.least.outputs(q) if p is None else rows.least.outputs(q, p)
    if len(rows.heights):
        Phi = out["Phi"][:, rows.kept] * rows.widths[:, 0] / rows.heights
        N = np.linalg.svd(Phi)[2][:, len(rows.heights) :].swapaxes(1, 2)
    else:
        N = np.eye(len(rows.widths))[None].repeat(len(q), axis=0)
    Z = rows.widths * N
    X = rows.asked.jacobian(out) @ Z if task else np.zeros((len(q), 0, Z.shape[-1]))
    units = rows.asked.units
    return Allowed(rows.actuated(out) @ Z, X / units[:, None], units)


def scales(robot: Model, task: Task, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what x' and q' are multiplied by to be lengths over time: 1, or a length for turns.

    Where all actuators turn, or all slide, theirs are left as they are.
    """
    turns = turned(robot)
    x = np.where([is_length(item) for item in task], 1.0, length)
    return x, np.where(turns & mixed(turns), length, 1.0)


def turned(robot: Model) -> np.ndarray:
    """Return which of the actuators turn."""
    return np.array([robot.unit(name) != "m" for name in actuated(robot)])


def mixed(turns: np.ndarray) -> bool:
    """Tell whether some of them turn and others slide."""
    return bool(turns.any() and not turns.all())


def characteristic_length(robot: Model, task: Task) -> float:
    """Return the length [m] that makes the columns of K for turns and for shifts of the tool
    equally long, in the mean, at the reference, or near it where that is leg-singular; where the
    tool only turns or only shifts, the rows for actuators that turn and that slide.

    1 m where all rows and all columns have one unit; the mechanism's largest length where there is
    none, or turns hardly move the actuators. It is that of the description's own numbers, whatever
    values its free ones have: conditionings of different designs are told by one length.
    """
    robot = robot.origin or robot
    turning, turns = np.array([not is_length(item) for item in task]), turned(robot)
    if not (mixed(turning) or mixed(turns)):
        return 1.0
    found = allowed(robot, np.array(around(robot)), task)
    squares = found.K[int(np.argmax(found.led))] ** 2
    largest = extent(robot.mechanism, robot.chart, robot.home.q)
    with np.errstate(divide="ignore", invalid="ignore"):
        if mixed(turning):
            # a + b / l^2 = c l^2 + d of parts of columns for turns, and for shifts.
            a, b, c, d = (
                np.sum(squares[np.ix_(rows, columns)]) / np.sum(columns)
                for columns in (turning, ~turning)
                for rows in (turns, ~turns)
            )
            root = np.hypot(d - a, 2 * np.sqrt(b * c))
            square = 2 * b / (d - a + root) if d > a else (a - d + root) / (2 * c)
        else:
            square = np.mean(squares[~turns].sum(axis=1)) / np.mean(squares[turns].sum(axis=1))
    length = float(np.sqrt(square))
    return length if HARDLY * largest < length < largest / HARDLY else largest


def conditioning(robot: Model, q: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
    """Return the conditioning (K) of configurations (K, nq); p: free parameters, the robot's own if
    left out."""
    task = (task_if_any(robot) if robot.mechanism.tools else None) or ()
    if len(task) <= 1:
        seen = np.linalg.svd(allowed(robot, q, (), p, own=True).Q, compute_uv=False)
        return np.minimum(1.0, seen[:, freedoms(robot) - 1])
    found = allowed(robot, q, task, p)
    x, driven = robot.once(scales, task, robot.once(characteristic_length, task))
    values = np.linalg.svd(found.K / x * driven[:, None], compute_uv=False)
    ratio = values[:, len(task) - 1] / np.maximum(values[:, 0], 1e-300)
    return np.where(found.led & (ratio > LOST), ratio, 0.0)
