"""Lagrange multipliers in maximal coordinates: an independent formulation of the same dynamics, to
test against.

Every body is free: its coordinates are the pose, its velocity the twist t_i = [omega_i; v_i] of the
mass centre in base axes. Every joint, tree or loop alike, gives the six components of the twist of
its second body relative to the first, at the second frame's origin, in axes E fixed in the first
body (the joint's axis first):

    s = J t,     s' = J t' + b(t)

The components that the joint leaves free are its rate (F t = q'), the others vanish (A t = 0). With
the extended inertia Mtot, the gyroscopic wrench h = [omega x I omega; 0] and the applied wrenches
w, Newton and Euler say

    [Mtot  -A'] [t'     ]   [w - h + F_a' tau]
    [A      0 ] [lambda ] = [-b_A            ]                                      forward dynamics

and with the actuated joints' accelerations prescribed as constraints, the actuator forces are their
multipliers:

    B = [F_a; A],     B t' = [q_a''; 0] - b_B,  B' [tau; lambda] = Mtot t' + h - w  inverse dynamics

Nothing is shared with the library but the description. Redundant constraint rows are left out
(QR with pivoting), and their multipliers are zero. A mechanism in a plane z = constant keeps
omega_z, v_x, v_y of each body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space, qr

from linkwork.mechanism import GROUND, FixedJoint, Frame, Mechanism, PrismaticJoint, RevoluteJoint

from tests.oracle.arithmetic import Arithmetic, arithmetic, axial, skew, solve

FREE = {
    FixedJoint: (),
    RevoluteJoint: (0,),
    PrismaticJoint: (3,),
}  # free components of s: omega along e, v along e
ALL_COORDINATES, PLANAR_COORDINATES = (0, 1, 2, 3, 4, 5), (2, 3, 4)

Pose = tuple[
    np.ndarray, np.ndarray
]  # R, and the position c of the mass centre (of the frame's origin for ground)


class OracleError(ValueError):
    """Say in one sentence why there is no answer."""


@dataclass(frozen=True)
class Joint:
    """Hold a joint's data in the oracle's numbers: frames (R, p), axes E (rows, in F1), free
    components, coordinate."""

    name: str
    bodies: tuple[str, str]
    frames: tuple[Pose, Pose]
    E: np.ndarray
    free: tuple[int, ...]

    def motion(self, numbers: Arithmetic, q: Any) -> Pose:
        """Return (R_12, p_12) of the second frame in the first."""
        e = self.E[0]
        return (
            numbers.rotation(q * e) if self.free == (0,) else numbers.eye(3),
            q * e if self.free == (3,) else numbers.zeros(3),
        )


@dataclass(frozen=True)
class Placement:
    """Hold all bodies placed, every joint's rows J (6 per joint) and the choice of rows and
    coordinates."""

    poses: Mapping[str, Pose]
    q: np.ndarray
    J: np.ndarray  # all rows x kept coordinates
    columns: np.ndarray  # the kept coordinates among 6r
    free: np.ndarray  # rows of the joint rates, in the order of q
    actuated: np.ndarray  # rows of the actuated joints' rates
    constrained: np.ndarray  # independent constraint rows

    @property
    def square(self) -> np.ndarray:
        """Return the rows of B = [F_a; A]."""
        return np.concatenate([self.actuated, self.constrained])


@dataclass(frozen=True)
class LagrangeOracle:
    """Evaluate the dynamics of a mechanism of revolute, prismatic and fixed joints by Lagrange
    multipliers.

    `digits` None computes in doubles, 40 with 40 decimal digits (results are then arrays of mpmath
    numbers). q_all (m,) are the coordinates of all joints but the fixed ones, in the mechanism's
    order [rad, m]; the actuated ones are taken exactly, the others as a guess that is refined until
    the loops are closed to all digits. rates, accelerations and forces (n,) are those of the
    actuated joints, in the actuators' order, SI.

    Raises:
        OracleError: actuated joints that do not determine the motion; loops that do not close.
    """

    mechanism: Mechanism
    digits: int | None = None

    @cached_property
    def numbers(self) -> Arithmetic:
        return arithmetic(self.digits)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        return tuple(self._joint(name) for name in self.mechanism.joints)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Return the names of the joints in q_all."""
        return tuple(joint.name for joint in self.joints if joint.free)

    @cached_property
    def centres(self) -> dict[str, np.ndarray]:
        bodies = self.mechanism.bodies
        centres = {name: self.numbers.array(body.centre_of_mass) for name, body in bodies.items()}
        return {GROUND: self.numbers.zeros(3)} | centres

    @cached_property
    def reference(self) -> np.ndarray:
        """Return the reference coordinates with the loops closed (m,)."""
        return self.assemble(
            np.array([self.mechanism.reference.get(name, 0.0) for name in self.moving])
        )

    # Questions

    def assemble(self, q_guess: ArrayLike, q_a: ArrayLike | None = None) -> np.ndarray:
        """Return all joint coordinates with the loops closed near q_guess, the actuated ones at q_a
        (m,)."""
        q = self.numbers.array(q_guess)
        if q_a is not None:
            q[[self.moving.index(name) for name in self.mechanism.actuators]] = self.numbers.array(
                q_a
            )
        return self._placed(q).q

    def independent_joints(self, q_all: ArrayLike) -> tuple[str, ...]:
        """Return the names of as many joints as there are freedoms, those that determine the motion
        best.

        With the columns of N a basis of the motions A t = 0, they are the pivots of the joints'
        rates F N.
        """
        J = self._rows(self._tree_poses(self.numbers.array(q_all))).astype(float)
        free = self._free()
        N = null_space(J[np.setdiff1d(np.arange(len(J)), free)], rcond=1e-9)
        _, pivots = pivoted((J[free] @ N).T)
        return tuple(self.moving[i] for i in sorted(pivots[: N.shape[1]]))

    def twists(self, q_all: ArrayLike, rates: ArrayLike) -> dict[str, np.ndarray]:
        """Return [omega; v of the mass centre] of every body in base axes."""
        placed = self._placed(q_all)
        return self._by_body(placed, self._velocity(placed, rates))

    def all_rates(self, q_all: ArrayLike, rates: ArrayLike) -> np.ndarray:
        """Return q' of all joints (m,)."""
        placed = self._placed(q_all)
        return placed.J[placed.free] @ self._velocity(placed, rates)

    def all_accelerations(
        self, q_all: ArrayLike, rates: ArrayLike, accelerations: ArrayLike
    ) -> np.ndarray:
        """Return q'' of all joints (m,)."""
        placed = self._placed(q_all)
        bias = self._bias(placed, self._velocity(placed, rates))
        t_dot = self._acceleration(placed, bias, self.numbers.array(accelerations))
        return placed.J[placed.free] @ t_dot + bias[placed.free]

    def forward_dynamics(self, q_all: ArrayLike, rates: ArrayLike, forces: ArrayLike) -> np.ndarray:
        """Return q_a'' (n,) from the actuator forces."""
        placed = self._placed(q_all)
        t_dot, _, bias = self._multipliers(placed, rates, forces)
        return placed.J[placed.actuated] @ t_dot + bias[placed.actuated]

    def joint_reactions(
        self, q_all: ArrayLike, rates: ArrayLike, forces: ArrayLike
    ) -> dict[str, np.ndarray]:
        """Return each joint's constraint wrench (moment, force) on its second body.

        It is taken at the second frame's origin, in base axes, without the actuator's own force.
        Parts that redundant constraints leave undetermined are one admissible choice; those out of
        a planar mechanism's plane are zero.
        """
        placed = self._placed(q_all)
        _, wrenches, _ = self._multipliers(placed, rates, forces)
        reactions = {}
        for joint, components in zip(self.joints, wrenches.reshape(-1, 6), strict=True):
            E = self._axes(joint, placed.poses)[0]
            reactions[joint.name] = np.concatenate([components[:3] @ E, components[3:] @ E])
        return reactions

    def inverse_dynamics(
        self, q_all: ArrayLike, rates: ArrayLike, accelerations: ArrayLike
    ) -> np.ndarray:
        """Return the actuator forces tau (n,)."""
        return self._forces(
            self._placed(q_all), rates, self.numbers.array(accelerations), gravity=True
        )

    def mass_matrix(self, q_all: ArrayLike) -> np.ndarray:
        """Return M (n, n): the forces of unit accelerations from rest, without gravity, column by
        column."""
        n = len(self.mechanism.actuators)
        return self._forces(self._placed(q_all), np.zeros(n), self.numbers.eye(n), gravity=False)

    def coriolis(self, q_all: ArrayLike, rates: ArrayLike) -> np.ndarray:
        """Return C v (n,): the forces at these rates without acceleration and gravity."""
        n = len(self.mechanism.actuators)
        return self._forces(self._placed(q_all), rates, self.numbers.zeros(n), gravity=False)

    def gravity(self, q_all: ArrayLike) -> np.ndarray:
        """Return G (n,): the forces at rest."""
        n = len(self.mechanism.actuators)
        return self._forces(self._placed(q_all), np.zeros(n), self.numbers.zeros(n), gravity=True)

    # Mechanics

    def _velocity(self, placed: Placement, rates: ArrayLike) -> np.ndarray:
        rows = placed.square
        right = self.numbers.zeros(len(rows))
        right[: len(placed.actuated)] = self.numbers.array(rates)
        return solve(placed.J[rows], right)

    def _acceleration(
        self, placed: Placement, bias: np.ndarray, accelerations: np.ndarray
    ) -> np.ndarray:
        rows = placed.square
        right = self.numbers.zeros(len(rows), *accelerations.shape[1:])
        right[: len(placed.actuated)] = accelerations
        return solve(placed.J[rows], (right.T - bias[rows]).T)

    def _forces(
        self, placed: Placement, rates: ArrayLike, accelerations: np.ndarray, gravity: bool
    ) -> np.ndarray:
        t = self._velocity(placed, rates)
        Mtot, h, w = self._inertia(placed, t)
        t_dot = self._acceleration(placed, self._bias(placed, t), accelerations)
        wrenches = ((Mtot @ t_dot).T + h - (w if gravity else 0 * w)).T
        return solve(placed.J[placed.square].T, wrenches)[: len(placed.actuated)]

    def _multipliers(
        self, placed: Placement, rates: ArrayLike, forces: ArrayLike
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return t', the multipliers of all rows (zero for those that are no constraint), and the
        bias b."""
        t = self._velocity(placed, rates)
        Mtot, h, w = self._inertia(placed, t)
        A, bias = placed.J[placed.constrained], self._bias(placed, t)
        applied = w - h + placed.J[placed.actuated].T @ self.numbers.array(forces)
        KKT = np.block([[Mtot, -A.T], [A, self.numbers.zeros(len(A), len(A))]])
        solution = solve(KKT, np.concatenate([applied, -bias[placed.constrained]]))
        wrenches = self.numbers.zeros(len(placed.J))
        wrenches[placed.constrained] = solution[len(t) :]
        return solution[: len(t)], wrenches, bias

    def _inertia(
        self, placed: Placement, t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return Mtot, h = [omega x I omega; 0] and the wrenches of gravity w, in the kept
        coordinates."""
        twists, size = self._by_body(placed, t), 6 * len(self.mechanism.bodies)
        Mtot, h, w = (
            self.numbers.zeros(size, size),
            self.numbers.zeros(size),
            self.numbers.zeros(size),
        )
        gravity = self.numbers.array(self.mechanism.gravity)
        for i, (name, body) in enumerate(self.mechanism.bodies.items()):
            turn, shift = slice(6 * i, 6 * i + 3), slice(6 * i + 3, 6 * i + 6)
            R, mass, omega = placed.poses[name][0], self.numbers.number(body.mass), twists[name][:3]
            Mtot[turn, turn] = R @ self.numbers.array(body.inertia.tensor()) @ R.T
            Mtot[shift, shift] = mass * self.numbers.eye(3)
            h[turn] = skew(omega) @ (Mtot[turn, turn] @ omega)
            w[shift] = mass * gravity
        kept = placed.columns
        return Mtot[np.ix_(kept, kept)], h[kept], w[kept]

    def _bias(self, placed: Placement, t: np.ndarray) -> np.ndarray:
        """Return b(t) of all rows: what is left of the relative acceleration, seen in the first
        body, when t' = 0."""
        twists, parts = self._by_body(placed, t), []
        for joint in self.joints:
            E, _, o = self._axes(joint, placed.poses)
            (W_1, v_1, d_1), (W_2, v_2, d_2) = (
                (skew(twists[body][:3]), twists[body][3:], o - placed.poses[body][1])
                for body in joint.bodies
            )
            omega = twists[joint.bodies[1]][:3] - twists[joint.bodies[0]][:3]
            v = v_2 + W_2 @ d_2 - v_1 - W_1 @ d_1
            parts += [
                E @ -(W_1 @ omega),
                E @ (W_2 @ (W_2 @ d_2) - W_1 @ (W_1 @ d_1) - 2 * (W_1 @ v)),
            ]
        return np.concatenate(parts)

    # Geometry

    def _joint(self, name: str) -> Joint:
        joint = self.mechanism.joints[name]
        axis = self.numbers.unit(self.numbers.array(getattr(joint, "axis", (0.0, 0.0, 1.0))))
        helper = self.numbers.zeros(3)
        helper[int(np.argmin(abs(axis)))] = self.numbers.number(1)
        u = self.numbers.unit(skew(axis) @ helper)
        E = np.array([axis, u, skew(axis) @ u], dtype=self.numbers.dtype)
        first, second = (self._frame(frame) for frame in joint.frames)
        return Joint(name, joint.connects, (first, second), E, FREE[type(joint)])

    def _frame(self, frame: Frame) -> Pose:
        return self.numbers.rotation(self.numbers.array(frame.rotation)), self.numbers.array(
            frame.position
        )

    def _axes(
        self, joint: Joint, poses: Mapping[str, Pose]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a joint's axes E (rows, base axes) and the origins o_1, o_2 of its frames."""
        (R_1, p_1), (_, p_2) = (self._frame_pose(joint, side, poses) for side in (0, 1))
        return joint.E @ R_1.T, p_1, p_2

    def _frame_pose(self, joint: Joint, side: int, poses: Mapping[str, Pose]) -> Pose:
        body, (R_F, p_F) = joint.bodies[side], joint.frames[side]
        R, c = poses[body]
        return R @ R_F, c + R @ (p_F - self.centres[body])

    def _tree_poses(self, q: np.ndarray) -> dict[str, Pose]:
        """Place the bodies by shortest paths from ground; the other joints are off by as much as q
        is."""
        joints, coordinates = (
            {joint.name: joint for joint in self.joints},
            dict(zip(self.moving, q, strict=True)),
        )
        graph = self.mechanism.graph()
        poses = {GROUND: (self.numbers.eye(3), self.numbers.zeros(3))}
        for body, path in nx.single_source_shortest_path(graph, GROUND).items():
            if body == GROUND:
                continue
            joint = joints[next(iter(graph[path[-2]][body]))]
            R_12, p_12 = joint.motion(
                self.numbers, coordinates.get(joint.name, self.numbers.number(0))
            )
            side = joint.bodies.index(body)
            R_near, p_near = self._frame_pose(joint, 1 - side, poses)
            R_F, p_F = joint.frames[side]
            R_far = R_near @ (R_12 if side else R_12.T)
            p_far = p_near + (R_near @ p_12 if side else -R_far @ p_12)
            R = R_far @ R_F.T
            poses[body] = R, p_far + R @ (self.centres[body] - p_F)
        return poses

    def _rows(self, poses: Mapping[str, Pose]) -> np.ndarray:
        """Return J, 6 rows per joint, 6 columns per body."""
        columns = {name: 6 * i for i, name in enumerate(self.mechanism.bodies)}
        J = self.numbers.zeros(6 * len(self.joints), 6 * len(columns))
        for j, joint in enumerate(self.joints):
            E, _, o = self._axes(joint, poses)
            for body, sign in zip(joint.bodies, (-1, 1), strict=True):
                if body == GROUND:
                    continue
                k = columns[body]
                J[6 * j : 6 * j + 3, k : k + 3] = J[6 * j + 3 : 6 * j + 6, k + 3 : k + 6] = sign * E
                J[6 * j + 3 : 6 * j + 6, k : k + 3] = -sign * (E @ skew(o - poses[body][1]))
        return J

    def _errors(self, poses: Mapping[str, Pose], q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the six components of each joint's error, and the coordinates that the poses
        show."""
        errors, shown, coordinates = [], [], iter(q)
        for joint in self.joints:
            (R_1, p_1), (R_2, p_2) = (self._frame_pose(joint, side, poses) for side in (0, 1))
            coordinate = next(coordinates) if joint.free else self.numbers.number(0)
            R_12, p_12 = joint.motion(self.numbers, coordinate)
            D = R_1.T @ R_2 @ R_12.T
            turn, shift = joint.E @ axial(D), joint.E @ (R_1.T @ (p_2 - p_1) - p_12)
            errors += [turn, shift]
            if joint.free == (0,):
                shown.append(coordinate + self.numbers.atan2(turn[0], (np.trace(D) - 1) / 2))
            elif joint.free == (3,):
                shown.append(coordinate + shift[0])
        return np.concatenate(errors), np.array(shown, dtype=self.numbers.dtype)

    def _placed(self, q_all: ArrayLike) -> Placement:
        """Place all bodies by Newton's method on the poses, the actuated coordinates kept: B
        (steps) = -(errors)."""
        target = self.numbers.array(q_all)
        poses, q = self._tree_poses(target), target
        rows = self._choice(poses)
        kept = [self.moving.index(name) for name in self.mechanism.actuators]
        for _ in range(50):
            J = self._rows(poses)[:, rows["columns"]]
            error, _ = self._errors(poses, q)
            square = np.concatenate([rows["actuated"], rows["constrained"]])
            step = solve(J[square], -error[square])
            poses = self._moved(poses, step, rows["columns"])
            _, q = self._errors(poses, q)
            q[kept] = target[kept]
            if max(abs(step), default=0) < self.numbers.settled:
                break
        error, _ = self._errors(poses, q)
        worst = float(max(abs(error), default=0))
        if not worst < 10 * self.numbers.settled:
            raise OracleError(
                f"{self.mechanism.name}: the loops do not close from this guess, {worst:.3g} "
                "remains"
            )
        return Placement(poses, q, self._rows(poses)[:, rows["columns"]], **rows)

    def _moved(
        self, poses: Mapping[str, Pose], step: np.ndarray, columns: np.ndarray
    ) -> dict[str, Pose]:
        full = self.numbers.zeros(6 * len(self.mechanism.bodies))
        full[columns] = step
        moved = dict(poses)
        for name, part in zip(self.mechanism.bodies, full.reshape(-1, 6), strict=True):
            R, c = poses[name]
            moved[name] = self.numbers.rotation(part[:3]) @ R, c + part[3:]
        return moved

    def _choice(self, poses: Mapping[str, Pose]) -> dict[str, np.ndarray]:
        """Choose coordinates (planar or all) and independent constraint rows, in doubles."""
        J = self._rows(poses).astype(float)
        bodies, free = len(self.mechanism.bodies), self._free()
        actuated = free[[self.moving.index(name) for name in self.mechanism.actuators]]
        constraints = np.setdiff1d(np.arange(len(J)), free)
        coordinates = np.array(PLANAR_COORDINATES if self._planar(poses) else ALL_COORDINATES)
        columns = (6 * np.arange(bodies)[:, None] + coordinates).ravel()
        A = J[np.ix_(constraints, columns)]
        R, pivots = pivoted(A.T)
        constrained = constraints[np.sort(pivots[: len(columns) - len(actuated)])]
        B = J[np.ix_(np.concatenate([actuated, constrained]), columns)]
        rank = int(np.sum(abs(np.diag(R)) > 1e-9 * abs(R[0, 0])))
        if B.shape[0] != B.shape[1] or not np.linalg.cond(B) < 1e10:
            raise OracleError(
                f"{self.mechanism.name}: {len(columns) - rank} freedoms in this configuration, but "
                f"the actuators {', '.join(self.mechanism.actuators)} do not determine the motion"
            )
        return {"columns": columns, "free": free, "actuated": actuated, "constrained": constrained}

    def _free(self) -> np.ndarray:
        """Return the rows of the joint rates in J, in the order of q."""
        return np.array(
            [6 * j + i for j, joint in enumerate(self.joints) for i in joint.free], dtype=int
        )

    def _planar(self, poses: Mapping[str, Pose]) -> bool:
        """Tell whether every joint moves in the plane z = constant: it turns about z, or slides
        across z."""
        axes = [
            (joint.free, abs(self._axes(joint, poses)[0][0])) for joint in self.joints if joint.free
        ]
        return all((max(e[0], e[1]) if free == (0,) else e[2]) < 1e-12 for free, e in axes)

    def _by_body(self, placed: Placement, t: np.ndarray) -> dict[str, np.ndarray]:
        full = self.numbers.zeros(6 * len(self.mechanism.bodies))
        full[placed.columns] = t
        twists = dict(zip(self.mechanism.bodies, full.reshape(-1, 6), strict=True))
        return {GROUND: self.numbers.zeros(6)} | twists


def pivoted(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return R and the order of the columns in the QR factorisation with pivoting."""
    return cast(tuple[np.ndarray, np.ndarray], qr(A, mode="r", pivoting=True))
