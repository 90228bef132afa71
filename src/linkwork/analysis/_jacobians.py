"""Input-output Jacobians: how the actuated rates q' and the tool's velocity x' depend on each
other.

    A x' = B q',    K = B^-1 A:  q' = K x',    J = A^-1 B:  x' = J q'
    u = J' f  (forces, without motion)

K and J follow from the two square systems of a robot, [Phi; J_x] (inverse kinematics) and
[Phi; J_q] (direct): their determinants are det B and det A up to a common factor, so that the one
vanishes where a leg is stretched out or folded (kind I), the other where the tool can move with the
actuators locked (kind II).

What mixes lengths and angles has no condition number. Turns are therefore measured by the way of a
point at the characteristic length l: omega l and moments over l, and so are the turns of actuators
where others slide.

Source: Gosselin & Angeles, IEEE Trans. Robotics and Automation 6 (1990) 281-290; Angeles 2014, sec.
5.8 (characteristic length).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.analysis.actuated_coordinates import ActuatorsAsked, with_coordinate
from linkwork.analysis.all_rows import all_rows, together
from linkwork.analysis.square import Square, of_joints, of_tool, square
from linkwork.checks import amount, reals, shown
from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism.task import is_length, labels
from linkwork.model import checks, dexterity, task
from linkwork.robot import Robot, State


class InputOutput(NamedTuple):
    """Hold K (..., n, n), J (..., n, n), det B (...) and det A (...) of configurations."""

    K: np.ndarray
    J: np.ndarray
    det_B: np.ndarray
    det_A: np.ndarray


@dataclass(frozen=True, eq=False)
class Jacobians:
    """Evaluate the input-output Jacobians of a robot, many configurations at a time.

    inverse, direct: the square systems of the tool's coordinates and of the actuators
    """

    inverse: Square
    direct: Square

    @property
    def robot(self) -> Robot:
        return self.inverse.robot

    @property
    def what(self) -> tuple[str, ...]:
        """Names of the tool's coordinates: the components of x'. An azimuth and a tilt together
        are told as tilt_x, tilt_y, which are regular where the tool is upright."""
        return labels(self.task)

    @cached_property
    def rows(self) -> ca.Function:
        """(q, p) -> Phi, J_x, J_q."""
        return stacked_rows(self.robot, self.inverse.J, self.direct.J)

    @property
    def turning(self) -> np.ndarray:
        """Which components of x' are angular velocities (n), or rates of directions."""
        return np.array([not is_length(item) for item in self.task])

    @property
    def task(self) -> task.Task:
        """Task coordinates of the components of x'."""
        assert self.inverse.asked is not None
        return self.inverse.asked.held

    @cached_property
    def kernel(self) -> Kernel:
        """q -> K (n x n), J (n x n), det B, det A over their values at the reference, and the
        weakest pivots of both."""
        joints, equations = self.robot.equations.joints, self.robot.equations
        outputs = {
            "K": ca.mtimes(joints.rate_rows(self.direct.what), self.inverse.solution),
            "J": ca.mtimes(self.inverse.J, self.direct.solution),
            "det_B": self.inverse.determinant,
            "det_A": self.direct.determinant,
            "pivot_B": self.inverse.weakest,
            "pivot_A": self.direct.weakest,
        }
        function = functions.function("input_output", equations, outputs)
        return compile_function(function).given(self.robot.p)

    @property
    def spared(self) -> bool:
        """Whether rows of the loops are left out that could stand for others (`all_rows`)."""
        return all_rows(self.inverse).spared or all_rows(self.direct).spared

    def __call__(self, q: np.ndarray, sign: np.ndarray | float | None = None) -> InputOutput:
        """Return K (..., n, n), J (..., n, n), det B (...) and det A (...) for configurations q
        (..., nq).

        Where rows of the loops depend on each other determinants are those by all rows, NaN where
        no way along closed loops is found from the reference that would tell their signs.

        Args:
            q: closed configurations; sign: of det B (...), where it is known.
        """
        given, size = reals(q), len(self.robot.home.q)
        if given is None or given.shape[-1:] != (size,):
            raise LinkworkError(
                f"q is {shown(q)}; give {amount(size, 'number')} in the last axis, as a state's q"
            )
        q = given
        if self.spared:
            return self._by_all_rows(q, sign)
        return self.in_any_order(q)[0]

    def in_any_order(self, q: np.ndarray) -> tuple[InputOutput, np.ndarray]:
        """Return K, J, det B and det A for configurations q (..., nq), and at which of all of them
        (N) either system is regular, but solved in another order."""
        n, batch, q = len(self.what), q.shape[:-1], q.reshape(-1, q.shape[-1])
        *parts, pivot_B, pivot_A = self.kernel(q)
        K, J, det_B, det_A = (part.copy() for part in parts)
        K, J = (np.swapaxes(part.reshape(-1, n, n), -1, -2) for part in (K, J))
        inverse, direct = all_rows(self.inverse), all_rows(self.direct)
        weak_B, weak_A = inverse.misled(q, pivot_B[:, 0]), direct.misled(q, pivot_A[:, 0])
        for weak, system, other, found, D in (
            (weak_B, inverse, direct, K, det_B),
            (weak_A, direct, inverse, J, det_A),
        ):
            if weak.any():
                found[weak] = other.asked(q[weak]) @ system.rates(q[weak])
                D[weak, 0] = system.determinants(q[weak])
        K, J = (part.reshape(*batch, n, n) for part in (K, J))
        return InputOutput(K, J, det_B.reshape(batch), det_A.reshape(batch)), weak_B | weak_A

    def _by_all_rows(self, q: np.ndarray, sign: np.ndarray | float | None) -> InputOutput:
        inverse, direct = all_rows(self.inverse), all_rows(self.direct)
        n, batch, q = len(self.what), q.shape[:-1], q.reshape(-1, q.shape[-1])
        # Of coordinates that are no numbers nothing is told.
        told = np.asarray(np.isfinite(q).all(axis=1))
        q = np.where(told[:, None], q, self.inverse.base)
        K, J = direct.asked(q) @ inverse.rates(q), inverse.asked(q) @ direct.rates(q)
        sign = inverse.signs(q) if sign is None else np.broadcast_to(sign, batch).reshape(-1)
        sign = np.where(told, sign, np.nan)
        K, J = (np.where(told[:, None, None], part, np.nan) for part in (K, J))
        det_B = sign * inverse.sizes(q)
        det_A = sign * direct.sizes(q) * together(inverse, direct, q)
        K, J = (part.reshape(*batch, n, n) for part in (K, J))
        return InputOutput(K, J, det_B.reshape(batch), det_A.reshape(batch))

    def lengths(self, characteristic: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return what x' and q' are multiplied by to be lengths over time: 1, or the characteristic
        length l [m], `characteristic_length` if left out, for turns.

        Where all actuators turn, or all slide, theirs are left as they are.
        """
        scale = self.characteristic_length if characteristic is None else characteristic
        return dexterity.scales(
            self.robot, self.task, checks.positive(scale, "the characteristic length")
        )

    @cached_property
    def characteristic_length(self) -> float:
        """Length l [m] that makes the columns of K for turns and for shifts of the tool equally
        long, in the mean, at the reference; where the tool only turns or only shifts, the rows for
        actuators that turn and that slide.

        1 m where all rows and all columns have one unit; the mechanism's largest length where there
        is none, or turns hardly move the actuators.
        """
        return dexterity.characteristic_length(self.robot, self.task)

    def homogeneous(self, K: np.ndarray, characteristic: float | None = None) -> np.ndarray:
        """Return K (..., n, n) free of units: between lengths over time, turns multiplied by a
        characteristic length [m], `characteristic_length` if left out."""
        x, q = self.lengths(characteristic)
        return K / x * q[:, None]


def jacobians(robot: Robot, what: tuple[str, ...] | None = None) -> Jacobians:
    """Return the input-output Jacobians of a robot that has as many actuators as freedoms, and a
    tool; they are made once for each robot and task.

    Args:
        what: coordinates of the tool, as in `square.of_tool`; if left out those that it is led in
            at the reference.

    Raises:
        LinkworkError: no tool, more or fewer actuators than freedoms, a reference around which all
            is singular.
    """
    if not isinstance(robot, Robot):
        raise LinkworkError(
            f"the Jacobians are those of a robot, not of {type(robot).__name__}; give a "
            "linkwork.Robot"
        )
    robot.require_tool()
    if not (
        what is None
        or (isinstance(what, tuple | list) and all(isinstance(name, str) for name in what))
    ):
        raise LinkworkError(
            f"the coordinates of the tool are {what!r}; give their names, or call what "
            "jacobians(robot) returns with state.q"
        )
    return robot.once(_of_systems, of_tool(robot, what), of_actuators(robot))


def _of_systems(_: Robot, inverse: Square, direct: Square) -> Jacobians:
    return Jacobians(inverse, direct)


def of_actuators(robot: Robot) -> Square:
    """Return the system that asks for what the actuators act along, joints and transmissions, of
    which there have to be as many as freedoms."""
    if len(robot.actuators) != task.freedoms(robot):
        raise LinkworkError(
            f"the robot has {amount(len(robot.actuators), 'actuator')} and the mobility "
            f"{robot.mobility}; input-output Jacobians need as many actuators as freedoms"
        )
    if {*robot.actuators} <= {*robot.coordinates}:
        return of_joints(robot, robot.actuators)
    if loose := {*robot.actuators} - {*with_coordinate(robot)}:
        raise LinkworkError(
            f"the actuator {min(loose)!r} acts along no coordinate, as moments of ball joints and "
            "thrust; input-output Jacobians need such as act along joints, belts or cables"
        )
    return robot.once(_of_lines)


def _of_lines(robot: Robot) -> Square:
    asked = ActuatorsAsked.of(robot)
    return square(robot, asked.what, asked.expressed(robot.equations), asked.units)


def input_output(
    robot: Robot, state: State, what: tuple[str, ...] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B (..., n, n) with A x' = B q' at states, each row of one actuator and of unit
    length.

    Row i is the relation between x' and the rate q_i' of actuator i alone, so that B is diagonal:
    the vector of [Phi; J_x; J_q,i]'s left null space with the largest part in q_i'. It stays finite
    where B or A is singular.

    Args:
        robot: with a tool that is led in as many coordinates as there are actuators.
        state: closed configurations; their rates do not matter.
        what: coordinates of the tool, as in `square.of_tool`; x' is of `Jacobians.what`.
    """
    made = jacobians(robot, what)
    q = robot.own(state).q.reshape(-1, robot.equations.nq)
    rows, n = made.rows, len(made.what)
    A, B = np.zeros((len(q), n, n)), np.zeros((len(q), n, n))
    loops, widths = robot.equations.rows.units, robot.equations.tree.rate_units
    x_heights = made.inverse.heights
    q_heights = made.direct.heights
    for k, one in enumerate(q):
        Phi, J_x, J_q = (np.array(part) for part in rows(one, robot.p))
        for i in range(n):
            heights = np.concatenate([loops, x_heights, q_heights[i : i + 1]])
            relation = widest_relation(np.vstack([Phi, J_x, J_q[i]]) * widths / heights[:, None])
            row = (relation / heights)[-1 - n :]
            row = row / np.linalg.norm(row)
            A[k, i], B[k, i, i] = row[:n], -row[n]
    return A.reshape(*state.batch, n, n), B.reshape(*state.batch, n, n)


def widest_relation(rows: np.ndarray) -> np.ndarray:
    """Return the vector y with y' rows = 0, of length 1, whose last component is the largest
    positive."""
    U, sigma, _ = np.linalg.svd(rows)
    rank = int(np.sum(sigma > 1e-12 * sigma[0]))
    null = U[:, rank:]
    y = null @ null[-1]
    return y / np.linalg.norm(y) if np.linalg.norm(y) > 1e-9 else null[:, 0]


def stacked_rows(robot: Robot, J_x: ca.SX, J_q: ca.SX) -> ca.Function:
    """Return the function (q, p) -> Phi, J_x, J_q."""
    equations = robot.equations
    outputs = [ca.densify(part) for part in (equations.rows.Phi, J_x, J_q)]
    return ca.Function("rows", [equations.tree.q, equations.p], outputs)
