"""Tool errors: how far the tool moves where numbers of the description, or what the drives measure,
are a little off, and the loops close again.

    [Phi; J_a] w = -[phi_p dp; a_p dp - da],    dx = J_x w + x_p dp

a are the coordinates of the actuators, which stay where they are measured, off by da; p are free
numbers; w is the small motion of the tree's joints by which the loops close again; and dx is the
tool's [rotation; translation] in the ground's axes [rad, m].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.analysis.actuated_coordinates import with_coordinate
from linkwork.analysis.square import scaled
from linkwork.checks import amount
from linkwork.equations import body_motion, functions
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.robot import Robot

CHUNK = 256  # states at a time
DEPENDENT = 1e-9  # singular value over the largest, of rows and columns of length 1
OPENED = 1e-6  # gap that stays, over what opened it


@dataclass(frozen=True, eq=False)
class ToolErrors:
    """Evaluate d(tool)/dp and d(tool)/da of a robot with free numbers, many configurations at a
    time.

    moves: steps of the free numbers (np, k), one by one; names: what each of these is (k)
    """

    robot: Robot
    moves: np.ndarray
    names: tuple[str, ...]

    @cached_property
    def kernel(self) -> Kernel:
        """q -> Phi, J_a, J_x, and the derivatives of phi, a and x with respect to p."""
        equations, robot = self.robot.equations, self.robot
        tree, p, tool = equations.tree, equations.p, equations.mechanism.first_tool
        pose = body_motion.tool_pose(tree, tool)
        a = ca.vertcat(*[equations.joints.position(name) for name in robot.actuators])
        R = ca.reshape(pose.orientation, 3, 3).T
        turned = [
            axial(ca.reshape(ca.jacobian(pose.orientation, p[k]), 3, 3).T @ R.T)
            for k in range(p.numel())
        ]
        outputs = {
            "Phi": equations.rows.open_Phi,
            "J_a": equations.joints.rate_rows(robot.actuators),
            "J_x": body_motion.tool_twist(tree, tool, equations.rows.rates)[0],
            "phi_p": ca.jacobian(equations.rows.phi, p),
            "a_p": ca.jacobian(a, p),
            "x_p": ca.vertcat(ca.horzcat(ca.SX(3, 0), *turned), ca.jacobian(pose.position, p)),
        }
        return compile_function(functions.function("tool_errors", equations, outputs)).given(
            robot.p
        )

    def __call__(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the tool's [rotation; translation] per move (N, 6, k) and per coordinate of the
        actuators (N, 6, n), for closed configurations q (N, nq).

        Raises:
            LinkworkError: a configuration at which the actuators do not hold the tool; a number
                that opens loops which no joint can close again.
        """
        parts = [self._some(q[k : k + CHUNK], k) for k in range(0, max(len(q), 1), CHUNK)]
        return np.concatenate([part[0] for part in parts]), np.concatenate(
            [part[1] for part in parts]
        )

    def _some(self, q: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Do so for few configurations, the first of which is that of a number."""
        equations, count = self.robot.equations, len(self.robot.actuators)
        rows, nv, free = len(equations.rows.names), equations.nv, self.robot.p.size
        shapes = (rows, nv), (count, nv), (6, nv), (rows, free), (count, free), (6, free)
        Phi, J_a, J_x, phi_p, a_p, x_p = (
            np.swapaxes(part.reshape(len(q), *shape[::-1]), -1, -2)
            for part, shape in zip(self.kernel(q), shapes, strict=True)
        )
        phi_p, a_p, x_p = (part @ self.moves for part in (phi_p, a_p, x_p))
        moves = self.moves.shape[1]
        # In own units, and rows and columns of length 1: rates by the tree's units, rows by theirs.
        heights = np.concatenate([equations.rows.units, self.actuated_units])[:, None]
        widths = equations.tree.rate_units
        A = np.concatenate([Phi, J_a], axis=1) * widths / heights
        opened = np.concatenate([phi_p, a_p], axis=1) / heights
        led = np.concatenate([np.zeros((rows, count)), np.eye(count)]) / heights
        right = np.concatenate([-opened, np.broadcast_to(led, (len(q), *led.shape))], axis=2)
        refuse_loose(self.robot, A, first)
        w = np.linalg.pinv(A, rcond=DEPENDENT) @ right
        refuse_open(self.robot, A @ w - right, right, self.names)
        dx = (J_x * widths) @ w
        dx[:, :, :moves] += x_p
        return dx[:, :, :moves], dx[:, :, moves:]

    @property
    def actuated_units(self) -> np.ndarray:
        """Units of the actuators' coordinates: the own length of lengths, 1 of angles."""
        robot = self.robot
        lengths = [robot.unit(name) == "m" for name in robot.actuators]
        return np.where(lengths, robot.equations.tree.length, 1.0)


def refuse_loose(robot: Robot, A: np.ndarray, first: int = 0) -> None:
    """Refuse configurations at which loops and actuators leave more than spins free.

    A: [Phi; J_a] in own units (N, rows + actuators, nv); first: number of the first one
    """
    needed = A.shape[2] - len(robot.spins)
    for k, one in enumerate(A):
        sigma = np.linalg.svd(scaled(one), compute_uv=False)
        if not (np.isfinite(sigma).all() and sigma[needed - 1] > DEPENDENT * sigma[0]):
            raise LinkworkError(
                f"at state {first + k} the tool can move with all actuators held (a singular "
                "pose), so that errors have no bound; leave it out"
            )


def refuse_open(robot: Robot, left: np.ndarray, right: np.ndarray, names: Sequence[str]) -> None:
    """Refuse numbers that open loops which no joint can close again.

    left: gaps that stay, of each number (N, rows, k and more); right: what opened them; names: of
    these (k)
    """
    gaps, sizes = np.abs(left).max(axis=(0, 1)), np.abs(right).max(axis=(0, 1))
    beyond = np.flatnonzero(gaps > OPENED * sizes)
    if beyond.size:
        path = names[beyond[0]]
        if not robot.redundant:
            raise LinkworkError(
                f"where {path!r} is off, the loops do not close, for a pose is singular there or "
                "nearly so; leave it out, or see whether the readings are those of this robot"
            )
        raise LinkworkError(
            f"where {path!r} is off, the loops do not close, for the mechanism has more "
            f"constraints than it needs ({amount(len(robot.redundant), 'redundant row')})"
            "; give it a joint that takes this error up, or leave the number out"
        )


def axial(W: ca.SX) -> ca.SX:
    """Return the vector of a matrix that is skew."""
    return ca.vertcat(W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]) / 2


def refuse_without_coordinate(robot: Robot) -> None:
    """Refuse actuators that have no coordinate, as those of ball joints and thrust."""
    loose = {*robot.actuators} - {*with_coordinate(robot)}
    if loose:
        raise LinkworkError(
            f"the actuator {min(loose)!r} has no coordinate that could be held; an error of the "
            "tool is told with all actuators held"
        )


def require_held(robot: Robot) -> None:
    """Refuse a robot whose tool is not held by actuators that are as many as its freedoms."""
    robot.require_tool()
    freedoms = robot.mobility - len(robot.spins)
    refuse_without_coordinate(robot)
    if len(robot.actuators) != freedoms:
        raise LinkworkError(
            f"the robot has {amount(len(robot.actuators), 'actuator')} and the mobility "
            f"{freedoms}; the tool's error needs as many, which hold it"
        )
