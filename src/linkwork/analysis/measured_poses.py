"""Measured poses: what a robot with free numbers p would show at the readings of its actuators, and
how that depends on p.

    phi(q, p) = 0,   a(q, p) = a_measured        q follows from p, on the branch of the states given
    [Phi; J_a] w_p = -[phi_p; a_p],              dx/dp = J_x w_p + x_p,   dz/dp = J_z w_p + z_p

a are the coordinates of the actuators, x is the pose of the tool, z are the coordinates of further
joints that have an encoder. What is left between measured and foretold values is weighed by the
noise: r = (x_measured - x) / sigma, the rotation's part being the rotation vector of R_measured R'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from linkwork.analysis.actuated_coordinates import actuated_coordinates
from linkwork.analysis.tool_errors import (
    axial,
    refuse_loose,
    refuse_open,
    refuse_without_coordinate,
    require_held,
)
from linkwork.checks import finite, known, needed, positive, shown
from linkwork.equations import body_motion, functions
from linkwork.equations.algebra import SX
from linkwork.equations.reference import unit
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.robot import Robot, State

STEPS = 30
CLOSED = 1e-13  # gap in own units that ends the closing of loops
OPEN = 1e-9  # gap that is no rounding
DEPENDENT = 1e-9  # singular value over the largest
TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class MeasuredPoses:
    """Hold measured poses: what the encoders read, and what else was measured there.

    states: where the description stands at the readings (N), as `robot.assemble` gives; of these
        the coordinates of the actuators are the readings, all others only tell the branch
    tool: poses of the tool as `Robot.tool_pose` gives them (N, 6; N, 3 in the plane, or for
        positions alone) [m, rad]; None where it was not measured
    joints: readings (N) of further joints by coordinate [m, rad]; whole turns do not matter
    position, rotation: standard deviation of each measured component of the tool's position [m] and
        rotation [rad]; encoders: of the further joints' readings, one or by name [m, rad]; what
        is left out is of one size in the robot's own units, its length and 1 rad, that of what is
        stated
    """

    states: State
    tool: np.ndarray | None = None
    joints: Mapping[str, ArrayLike] = field(default_factory=dict)
    position: float | None = None
    rotation: float | None = None
    encoders: float | Mapping[str, float] | None = None

    def __repr__(self) -> str:
        told = ", ".join(("tool",) * (self.tool is not None) + (*self.joints,))
        return f"MeasuredPoses({self.states}; measured: {told or 'nothing'})"


@dataclass(frozen=True, eq=False)
class PoseModel:
    """Foretell what is measured, for a robot with free numbers.

    rows: which of the tool's [rotation; position] (6) are measured; joints: further coordinates
    kinds: "tool.rotation", "tool.position" or the joint of each row of what is measured (rows);
        scales: its standard deviation (rows); weighed: whether the noise of all is stated
    """

    robot: Robot
    rows: tuple[int, ...]
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    scales: np.ndarray
    weighed: bool

    @property
    def kernel(self) -> Kernel:
        """(q, p) -> phi, a, z and the pose; their derivatives along the rates and by p; the map
        from the rates to q'."""
        key = f"measured poses {', '.join(self.joints)}"
        return self.robot.chart.compiled(key, lambda equations: self._function())

    def _function(self) -> ca.Function:
        # The loops, the actuators and further joints.
        equations, robot = self.robot.equations, self.robot
        tree, p = equations.tree, equations.p
        a, z = (
            ca.vertcat(SX(0, 1), *[equations.joints.position(name) for name in names])
            for names in (robot.actuators, self.joints)
        )
        outputs = {
            "phi": equations.rows.phi,
            "a": a,
            "z": z,
            "Phi": equations.rows.open_Phi,
            "J_a": equations.joints.rate_rows(robot.actuators),
            "J_z": equations.joints.rate_rows(self.joints),
            "N": tree.derivative_map,
            "phi_p": ca.jacobian(equations.rows.phi, p),
            "a_p": ca.jacobian(a, p),
            "z_p": ca.jacobian(z, p),
        }
        # The tool, its turns by p read off the change of its orientation.
        if robot.mechanism.tools:
            tool = equations.mechanism.first_tool
            pose = body_motion.tool_pose(tree, tool)
            R = ca.reshape(pose.orientation, 3, 3).T
            turned = [
                axial(ca.mtimes(ca.reshape(ca.jacobian(pose.orientation, p[k]), 3, 3).T, R.T))
                for k in range(p.numel())
            ]
            x_p = ca.vertcat(ca.horzcat(SX(3, 0), *turned), ca.jacobian(pose.position, p))
            outputs |= {
                "x": ca.vertcat(pose.position, pose.orientation),
                "J_x": body_motion.tool_twist(tree, tool, equations.rows.rates)[0],
                "x_p": x_p,
            }
        return functions.function("measured_poses", equations, outputs)

    def evaluated(self, q: np.ndarray, p: np.ndarray) -> dict[str, np.ndarray]:
        """Return what the kernel gives at configurations (N, nq), matrices as such."""
        equations, free, count = self.robot.equations, p.size, len(self.robot.actuators)
        rows, nv, more = len(equations.rows.names), equations.nv, len(self.joints)
        shapes = [(rows, 1), (count, 1), (more, 1), (rows, nv), (count, nv), (more, nv)]
        shapes += [(equations.nq, nv), (rows, free), (count, free), (more, free)]
        names = ["phi", "a", "z", "Phi", "J_a", "J_z", "N", "phi_p", "a_p", "z_p"]
        if self.robot.mechanism.tools:
            shapes += [(12, 1), (6, nv), (6, free)]
            names += ["x", "J_x", "x_p"]
        found = zip(names, shapes, self.kernel.given(p)(q), strict=True)
        return {
            name: np.swapaxes(part.reshape(len(q), *shape[::-1]), -1, -2)
            for name, shape, part in found
        }

    @property
    def reach(self) -> float:
        """What is shown, over the noise, of a move by the robot's length or 1 rad, at most."""
        lengths = [row >= 3 for row in self.rows]
        lengths += [self.robot.unit(name) == "m" for name in self.joints]
        own = np.where(lengths, self.robot.equations.tree.length, 1.0)
        return float((own / self.scales).max())

    @cached_property
    def heights(self) -> np.ndarray:
        """Units of the loops' rows and the actuators' coordinates, as a column."""
        robot, length = self.robot, self.robot.equations.tree.length
        led = [length if robot.unit(name) == "m" else 1.0 for name in robot.actuators]
        return np.concatenate([robot.equations.rows.units, led])[:, None]

    def matrix(self, out: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return [Phi; J_a] in own units (N, rows + actuators, nv)."""
        widths = self.robot.equations.tree.rate_units
        return np.concatenate([out["Phi"], out["J_a"]], axis=1) * widths / self.heights

    def closed(self, q: np.ndarray, readings: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return configurations (N, nq) that are closed with p at the readings (N, n), near given
        ones.

        Raises:
            LinkworkError: a sample at which the loops do not close.
        """
        tree = self.robot.equations.tree
        for _ in range(STEPS):
            out = self.evaluated(q, p)
            a = out["a"] - readings[..., None]
            residual = np.concatenate([out["phi"], a], axis=1) / self.heights
            gaps = np.abs(residual).max(axis=(1, 2), initial=0.0)
            if gaps.max(initial=0.0) <= CLOSED:
                return q
            if not np.isfinite(gaps).all():
                break
            w = np.linalg.pinv(self.matrix(out), rcond=DEPENDENT) @ residual
            moved = out["N"] @ (w * tree.rate_units[:, None])
            q = unit(tree, q - moved[..., 0])
        worst = int(np.argmax(np.where(np.isfinite(gaps), gaps, np.inf)))
        if not gaps[worst] <= OPEN:
            values = ", ".join(
                f"{path} = {x:.6g}" for path, x in zip(self.robot.parameters, p, strict=True)
            )
            raise LinkworkError(
                f"at sample {worst} the loops do not close at its readings, with {values[:300]}; "
                "leave the sample out, see whether its state is on the branch that was measured, "
                "or begin nearer to the robot as it is"
            )
        return q

    def slopes(self, q: np.ndarray, p: np.ndarray, tool: np.ndarray | None = None) -> np.ndarray:
        """Return the derivative by p of what is foretold, which is that of what remains but for its
        sign, over the noise (N, rows, np).

        tool: measured [rotation vector; position] (N, 6); that which is foretold if left out
        """
        out = self.evaluated(q, p)
        A = self.matrix(out)
        refuse_loose(self.robot, A)
        opened = np.concatenate([out["phi_p"], out["a_p"]], axis=1) / self.heights
        w = -np.linalg.pinv(A, rcond=DEPENDENT) @ opened
        refuse_open(self.robot, A @ w + opened, opened, tuple(self.robot.parameters))
        w = w * self.robot.equations.tree.rate_units[:, None]
        parts = [out["J_z"] @ w + out["z_p"]]
        if self.rows:
            twist = out["J_x"] @ w + out["x_p"]
            if tool is not None and len(self.rows) != 3:
                twist[:, :3] = turning(turned_by(out["x"], tool)) @ twist[:, :3]
            parts = [twist[:, list(self.rows)], *parts]
        return np.concatenate(parts, axis=1) / self.scales[:, None]

    def remains(
        self, q: np.ndarray, p: np.ndarray, tool: np.ndarray | None, joints: np.ndarray
    ) -> np.ndarray:
        """Return what was measured less what is foretold, over the noise (N, rows), angles without
        whole turns.

        tool: measured [rotation vector; position] (N, 6); joints: readings (N, further joints)
        """
        out = self.evaluated(q, p)
        apart = joints - out["z"][..., 0]
        turns = np.array([self.robot.unit(name) == "rad" for name in self.joints], bool)
        parts = [apart - TURN * turns * np.round(apart / TURN)]
        if self.rows and tool is not None:
            turn = turned_by(out["x"], tool)
            both = np.concatenate([turn, tool[:, 3:] - out["x"][:, :3, 0]], axis=1)
            parts = [both[:, list(self.rows)], *parts]
        return np.concatenate(parts, axis=1) / self.scales


def turned_by(x: np.ndarray, tool: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (N, 3) from foretold orientations, rows 3 to 12 of x (N, 12, 1),
    to measured ones (N, 6)."""
    R = Rotation.from_matrix(x[:, 3:, 0].reshape(-1, 3, 3))
    return (Rotation.from_rotvec(tool[:, :3]) * R.inv()).as_rotvec()


def turning(turns: np.ndarray) -> np.ndarray:
    """Return B (N, 3, 3) by which rotation vectors r (N, 3) fall where what is foretold turns:
    r' = -B omega,  B = 1 + [r x] / 2 + (1 - (a / 2) cot(a / 2)) [r x]^2 / a^2,  a = |r|."""
    a = np.linalg.norm(turns, axis=1)
    half = np.where(a > 1e-3, a / 2, 1.0)
    share = np.where(a > 1e-3, (1 - half / np.tan(half)) / (4 * half**2), 1 / 12 + a**2 / 720)
    K = np.cross(turns[:, None, :], np.eye(3)).swapaxes(1, 2)
    return np.eye(3) + K / 2 + share[:, None, None] * (K @ K)


def model_of(
    robot: Robot,
    rows: tuple[int, ...],
    joints: tuple[str, ...] = (),
    position: float | None = None,
    rotation: float | None = None,
    encoders: float | Mapping[str, float] | None = None,
) -> PoseModel:
    """Return the model of a robot's measured poses; refuse what cannot be measured of it."""
    needed(robot, Robot)
    if not robot.parameters:
        raise LinkworkError(
            "no number of this robot is free; free those that are to be found: robot.free(...)"
        )
    if rows:
        require_held(robot)
        if robot.mechanism.first_tool.relative_to != "ground":
            raise LinkworkError(
                "the tool's pose is told relative to a moving body; measure it in the ground's axes"
            )
    if not rows and not joints:
        raise LinkworkError("nothing was measured; give poses of the tool, or readings of joints")
    known(joints, robot.coordinates, "joint")
    for name in joints:
        if name in robot.actuators:
            raise LinkworkError(f"{name!r} is an actuator, whose readings the states hold")
    # The noise that is stated; what is not is of one size in own units, that of what is.
    length = robot.equations.tree.length
    own = {name: length if robot.unit(name) == "m" else 1.0 for name in joints}
    if isinstance(encoders, Mapping):
        known(encoders, joints, "measured joint")
    stated = encoders if isinstance(encoders, Mapping) else dict.fromkeys(joints, encoders)
    given = {"tool.position": position, "tool.rotation": rotation, **stated}
    units = {"tool.position": length, "tool.rotation": 1.0, **own}
    given = {
        name: positive(value, f"the deviation of {name.removeprefix('tool.')}")
        for name, value in given.items()
        if value is not None
    }
    size = float(np.exp(np.mean([np.log(v / units[n]) for n, v in given.items()] or [0.0])))
    kinds = [f"tool.{'rotation' if row < 3 else 'position'}" for row in rows] + [*joints]
    scales = np.array([given.get(kind, size * units[kind]) for kind in kinds], float)
    return PoseModel(robot, rows, joints, tuple(kinds), scales, {*kinds} <= given.keys())


def measured_rows(robot: Robot, tool: np.ndarray | None) -> tuple[int, ...]:
    """Return which of a tool's [rotation; position] (6) measured poses hold."""
    if tool is None:
        return ()
    if robot.planar:
        return (2, 3, 4)
    return (3, 4, 5) if tool.shape[-1] == 3 else (0, 1, 2, 3, 4, 5)


def spatial(robot: Robot, tool: np.ndarray) -> np.ndarray:
    """Return measured poses as [rotation vector; position] (N, 6); what is not measured is zero."""
    found = np.zeros((len(tool), 6))
    if robot.planar:
        found[:, 3:5], found[:, 2] = tool[:, :2], tool[:, 2]
    else:
        found[:, 3:] = tool[:, :3]
        found[:, :3] = tool[:, 3:] if tool.shape[1] == 6 else 0.0
    return found


def readings_of(robot: Robot, states: State) -> tuple[np.ndarray, np.ndarray]:
    """Return q (N, nq) and the actuators' coordinates (N, n), lengths of transmissions too, of
    measured states."""
    if not isinstance(states, State):
        raise LinkworkError(
            f"the states are {shown(states)}; give a stack of states, as robot.assemble makes"
        )
    if states.positions.ndim != 2 or not len(states.positions):
        raise LinkworkError("the states are no stack (N) of states; give one for each sample")
    q = finite(robot.state(states.positions).q, "the states")
    refuse_without_coordinate(robot)
    return q, actuated_coordinates(robot, q)
