"""The mechanism in Pinocchio: a spanning tree whose loops are closed by constraints with
multipliers.

    M v' + h = S' u + J' lambda,   J v' + gamma = 0                   (v: the rates of the tree)

A joint of many freedoms is a chain of Pinocchio's own with nothing in between. A cut spherical
joint becomes the coincidence of a point, a cut revolute joint that of one point where its loop is
planar, else of two points of its axis: 6 rows, of which 5 are independent. Other cut joints stay in
the tree and lead to one part of their body; the parts are welded (6 rows). Rods are links with
borrowed mass. Dependent rows are left in: the proximal iterations (mu = 1e-6) solve the equations
as they stand. Springs, dampers and friction are forces added from outside, rotors are Pinocchio's
armature.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from scipy.linalg import null_space

from linkwork.lab.engines.carried import joints_of, run_of
from linkwork.lab.engines.interface import (
    EngineError,
    EngineRun,
    Forces,
    checked_forces,
    in_time,
    instants,
    load_engine,
)
from linkwork.lab.engines.joints import CROSSED, Edge, Step, turn_z_to
from linkwork.lab.engines.rewrite import inertia_tensor
from linkwork.lab.engines.start import Guess
from linkwork.lab.engines.tied_tree import plan
from linkwork.lab.engines.tree import CarriedPart, EngineTie
from linkwork.mechanism import GROUND, Mechanism, PointSpring

pin = load_engine("pinocchio", "Pinocchio")

ACCURACY = 1e-6
"""Of the proximal iterations, absolute and relative; the accelerations are then good to 1e-11."""
REGULARISATION = (
    1e-6  # mu of the proximal iterations; smaller ones do harm where redundant rows drift apart
)
ITERATIONS = 20
QUATERNION = (3, 0, 1, 2)  # places of w, x, y, z


class PinocchioEngine:
    """Evaluate and simulate a mechanism with Pinocchio's `constraintDynamics`.

    Args:
        mechanism: the description; it has no gears.
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where
            left out.

    Attributes:
        plan: the spanning tree chosen in the description, and the translation of its coordinates.
        model, data, constraints, constraint_data, proximal: Pinocchio's own objects.
        seats: for each body (and part of a body) its Pinocchio joint, and its pose in that joint's
            frame.

    Raises:
        EngineError: Pinocchio is missing, there is a gear, or a body has no mass that its rods
            could borrow.
    """

    name = "pinocchio"
    version = str(pin.__version__)

    def __init__(self, mechanism: Mechanism, guess: Guess | None = None):
        for name in mechanism.gears:
            raise EngineError(
                f"joints.{name}: Pinocchio has no constraint that could hold a gear; use mujoco "
                "or exudyn"
            )
        self.mechanism, self.plan = mechanism, plan(mechanism, QUATERNION, guess or {})
        self.model = pin.Model()
        self.model.gravity.linear = np.array(mechanism.gravity)
        self.seats = {GROUND: (0, pin.SE3.Identity())}
        for branch in self.plan.branches:
            self._grow(branch)
        self.model.armature = self.plan.joint_forces.rotors
        self.constraints = pin.StdVec_RigidConstraintModel()
        for tie in self.plan.ties:
            self.constraints.append(self._closure(tie))
        self.data = self.model.createData()
        self.constraint_data = pin.StdVec_RigidConstraintData()
        for constraint in self.constraints:
            self.constraint_data.append(constraint.createData())
        self.proximal = pin.ProximalSettings(ACCURACY, ACCURACY, REGULARISATION, ITERATIONS)
        pin.initConstraintDynamics(self.model, self.data, self.constraints, self.constraint_data)

    @property
    def columns(self) -> np.ndarray:
        """Return for each of the model's coordinates its place among all joint coordinates."""
        return self.plan.vectors.columns

    @property
    def drives(self) -> np.ndarray:
        """Return for each actuator its place among the model's rates."""
        return self.plan.drives.places

    def _grow(self, branch: CarriedPart) -> None:
        """Add a joint and the part of a body that it carries."""
        item = branch.edge
        joint, pose = self.seats[item.bodies[0]]
        pose = pose * pin.SE3(item.frames[0])
        for name, motion, turned in joint_models(item):
            joint = self.model.addJoint(joint, motion, pose * turned, f"joint {name}")
            pose = turned.inverse()
        pose = pose * pin.SE3(item.frames[1]).inverse()
        body, share = self.plan.carried.whole.bodies[item.bodies[1]], branch.share
        inertia = pin.Inertia(
            share * body.mass, np.array(body.centre_of_mass), share * inertia_tensor(body)
        )
        self.model.appendBodyToJoint(joint, inertia, pose)
        self.seats[branch.part] = joint, pose

    def _closure(self, tie: EngineTie) -> object:
        kind = {"point": pin.ContactType.CONTACT_3D, "weld": pin.ContactType.CONTACT_6D}[tie.kind]
        (first, pose), (second, place) = (self.seats[part] for part in tie.parts)
        near, far = pose * pin.SE3(tie.frames[0]), place * pin.SE3(tie.frames[1])
        return pin.RigidConstraintModel(
            kind, self.model, first, near, second, far, pin.ReferenceFrame.LOCAL
        )

    def _forces(self, q: np.ndarray, v: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return tau of the actuators, of springs and friction in joints, and of springs between
        points."""
        tau = self.plan.forces(q, v, forces)
        if self.mechanism.springs:
            pin.computeJointJacobians(self.model, self.data, q)
            for spring in self.mechanism.springs.values():
                tau -= self._pull(spring, v)
        return tau

    def _pull(self, spring: PointSpring, v: np.ndarray) -> np.ndarray:
        """Return the gradient of a spring's length along v times its tension."""
        ends = [
            self._end(body, np.array(point))
            for body, point in zip(spring.connects, spring.points, strict=True)
        ]
        (start, going), (end, coming) = ends
        length = float(np.linalg.norm(end - start))
        if length == 0.0:
            return np.zeros(len(v))
        gradient = (end - start) / length @ (coming - going)
        return gradient * (
            spring.stiffness * (length - spring.rest_length) + spring.damping * (gradient @ v)
        )

    def _end(self, body: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a body's point in ground, and the matrix (3, nv) that takes v to its velocity."""
        joint, seat = self.seats[body]
        if not joint:
            return seat.act(point), np.zeros((3, self.model.nv))
        J = pin.getJointJacobian(
            self.model, self.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        arm = self.data.oMi[joint].rotation @ seat.act(point)
        return self.data.oMi[joint].translation + arm, J[:3] - pin.skew(arm) @ J[3:]

    def _arguments(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> tuple:
        """Return what `constraintDynamics` wants, for a state and actuator forces."""
        q, v = self.plan.state(positions, rates)
        tau = self._forces(q, v, checked_forces(self.mechanism, forces))
        return (
            self.model,
            self.data,
            q,
            v,
            tau,
            self.constraints,
            self.constraint_data,
            self.proximal,
        )

    def evaluation(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> Callable[[], object]:
        """Return Pinocchio's own forward dynamics at a state as a call without arguments or
        wrapping, for timing."""
        return partial(pin.constraintDynamics, *self._arguments(positions, rates, forces))

    def accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of the actuated rates, shape (n,); see `Engine.accelerations`."""
        q, v, a = self._solved(positions, rates, forces)
        return self.plan.actuated(q, v, a)

    def joint_accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of all joint rates, shape (nv,); see
        `Engine.joint_accelerations`."""
        q, v, a = self._solved(positions, rates, forces)
        return joints_of(self.plan, q[None], v[None], a[None], np.asarray(positions)).accelerations[
            0
        ]

    def _solved(self, *state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, v, v' at a state of the joints under actuator forces."""
        arguments = self._arguments(*state)
        return *arguments[2:4], self._finite(np.array(pin.constraintDynamics(*arguments)))

    def _finite(self, accelerations: np.ndarray) -> np.ndarray:
        if not np.all(np.isfinite(accelerations)):
            raise EngineError(
                f"{self.mechanism.name}: Pinocchio finds no accelerations; a body that the tree "
                "moves without inertia makes its mass matrix singular"
            )
        return accelerations

    def inverse_dynamics(
        self, positions: np.ndarray, rates: np.ndarray, accelerations: np.ndarray
    ) -> np.ndarray:
        """Return the actuator forces for derivatives of the actuated rates, both of shape (n,)
        [N, N m].

        Accelerations are affine in the forces. With the null space N of J and the actuators' S,

            S' v' = S' v'_0 + G u,      G = S' N (N' M N)^-1 N' S     (v'_0 without actuator forces)

        Where actuators are redundant, u is the least one.
        """
        arguments = self._arguments(positions, rates, np.zeros(len(self.drives)))
        q, v = arguments[2:4]
        free = self._finite(np.array(pin.constraintDynamics(*arguments)))
        S = np.stack(
            [
                self.plan.vectors.forces(q, self.plan.drives, unit)
                for unit in np.eye(len(self.drives))
            ],
            axis=1,
        )
        N = np.eye(self.model.nv)
        if len(self.constraints):
            pin.computeJointJacobians(self.model, self.data, q)
            J = pin.getConstraintsJacobian(
                self.model, self.data, self.constraints, self.constraint_data
            )
            N = null_space(J, rcond=1e-10)
        upper = np.triu(pin.crba(self.model, self.data, q))
        M = upper + np.triu(upper, 1).T
        G = S.T @ N @ np.linalg.solve(N.T @ M @ N, N.T @ S)
        return np.linalg.lstsq(G, accelerations - self.plan.actuated(q, v, free), rcond=1e-10)[0]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by the classical Runge-Kutta method of order 4; see `Engine.simulate`.

        Nothing holds the loops closed but the accelerations: `closure_error` shows the drift.
        Quaternions are moved as four numbers and made unit ones again in every stage.
        """
        pushing, time = in_time(self.mechanism, forces), instants(duration, step)
        model, data, q, v, _, *constraints = self._arguments(positions, rates, pushing(0.0))
        h = time[1]
        qs, vs, accelerations = (
            np.empty((len(time), size)) for size in (model.nq, model.nv, model.nv)
        )

        def motion(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            q = self._unit(q)
            return self._speed(q, v), pin.constraintDynamics(
                model, data, q, v, self._forces(q, v, pushing(t)), *constraints
            )

        start = perf_counter()
        for k, t in enumerate(time[:-1]):
            qs[k], vs[k] = q, v
            w1, a1 = motion(t, q, v)
            accelerations[k] = a1
            w2, a2 = motion(t + h / 2, q + h / 2 * w1, v + h / 2 * a1)
            w3, a3 = motion(t + h / 2, q + h / 2 * w2, v + h / 2 * a2)
            w4, a4 = motion(t + h, q + h * w3, v + h * a3)
            q = self._unit(q + h / 6 * (w1 + 2 * (w2 + w3) + w4))
            v = v + h / 6 * (a1 + 2 * (a2 + a3) + a4)
        seconds = perf_counter() - start
        qs[-1], vs[-1], accelerations[-1] = q, v, self._finite(motion(time[-1], q, v)[1])
        return run_of(self.plan, time, qs, vs, accelerations, np.asarray(positions), seconds)

    def _unit(self, q: np.ndarray) -> np.ndarray:
        """Return q with unit quaternions."""
        for ball in self.plan.vectors.balls:
            q = q.copy()
            q[ball.q] /= np.linalg.norm(q[ball.q])
        return q

    def _speed(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return q' for v: of a quaternion p, p' = p [0; v] / 2."""
        balls = self.plan.vectors.balls
        if not balls:
            return v
        moving = np.zeros(len(q))
        moving[self.plan.vectors.scalars[0]] = v[self.plan.vectors.scalars[1]]
        for ball in balls:
            w, x, y, z = q[ball.q][list(QUATERNION)]
            moving[ball.q] = (
                np.array([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]]) @ v[ball.v] / 2
            )
        return moving


def joint_models(item: Edge) -> list[tuple[str, Any, Any]]:
    """Return Pinocchio's joints for a joint: a name, the joint, and the pose whose z axis it moves
    about or along."""
    if item.motions == CROSSED:
        first, second = item.steps
        return [
            (first.rates[0], pin.JointModelUniversal(first.axis, second.axis), pin.SE3.Identity())
        ]
    return [
        (step.rates[0], joint_model(step), pin.SE3(turn_z_to(step.axis))) for step in item.steps
    ]


def joint_model(step: Step) -> Any:
    """Return Pinocchio's joint for an elementary motion about or along z."""
    match step.motion:
        case "turn":
            return pin.JointModelRZ()
        case "slide":
            return pin.JointModelPZ()
        case "screw":
            return pin.JointModelHZ(step.pitch)
        case "ball":
            return pin.JointModelSpherical()
