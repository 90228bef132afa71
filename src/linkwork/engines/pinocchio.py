"""The mechanism in Pinocchio: a spanning tree whose loops are closed by constraints with multipliers.

    M q'' + h = S' u + J' lambda,   J q'' + gamma = 0                   (q: the joints of the tree)

A cut revolute joint becomes the coincidence of one point where its loop is planar, else of two points of its axis: 6
rows, of which 5 are independent. A cut prismatic joint stays in the tree and leads to one part of its body; the parts
are welded (6 rows). Dependent rows are left in: the proximal iterations solve the equations as they stand.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np

from linkwork.engines.common import (
    Branch,
    EngineRun,
    Forces,
    Tie,
    branches,
    checked,
    checked_forces,
    coordinates,
    inertia_tensor,
    instants,
    load_engine,
    run_on_tree,
    spanning_tree,
    ties,
)
from linkwork.mechanism import GROUND, Mechanism

pin = load_engine("pinocchio", "Pinocchio")

ACCURACY = 1e-6  # of the proximal iterations, absolute and relative; the accelerations are then good to 1e-11
REGULARISATION = 1e-6  # mu of the proximal iterations; smaller ones do harm where redundant rows drift apart
ITERATIONS = 20


class PinocchioEngine:
    """Evaluate and simulate a mechanism with Pinocchio's `constraintDynamics`.

    Attributes:
        mechanism, tree: the description, and the spanning tree chosen in it.
        model, data, constraints, constraint_data, proximal: Pinocchio's own objects.
        columns: for each of the model's coordinates its place among all joint coordinates.
        drives: for each actuator its place among the model's coordinates.
        seats: for each body (and part of a body) its Pinocchio joint, and its pose in that joint's frame.

    Raises:
        EngineError: Pinocchio is missing, or actuated joints alone close a loop.
    """

    name = "pinocchio"
    version = str(pin.__version__)

    def __init__(self, mechanism: Mechanism):
        self.mechanism, self.tree = mechanism, spanning_tree(mechanism)
        self.model = pin.Model()
        self.model.gravity.linear = np.array(mechanism.gravity)
        self.seats = {GROUND: (0, pin.SE3.Identity())}
        place = coordinates(mechanism)
        moving = [name for name in map(self._grow, branches(self.tree)) if name in place]
        self.columns = np.array([place[name] for name in moving], dtype=int)
        self.drives = np.array([moving.index(name) for name in mechanism.actuators], dtype=int)
        self.constraints = pin.StdVec_RigidConstraintModel()
        for tie in ties(self.tree):
            self.constraints.append(self._closure(tie))
        self.data = self.model.createData()
        self.constraint_data = pin.StdVec_RigidConstraintData()
        for constraint in self.constraints:
            self.constraint_data.append(constraint.createData())
        self.proximal = pin.ProximalSettings(ACCURACY, ACCURACY, REGULARISATION, ITERATIONS)
        pin.initConstraintDynamics(self.model, self.data, self.constraints, self.constraint_data)

    def _grow(self, branch: Branch) -> str:
        """Add a joint and the part of a body that it carries; return the joint's name."""
        item = branch.edge
        joint, pose = self.seats[item.bodies[0]]
        near, far = pose * pin.SE3(item.frames[0]), pin.SE3(item.frames[1]).inverse()
        if item.kind == "fixed":
            seat = joint, near * far
        else:
            motion = pin.JointModelRZ() if item.kind == "revolute" else pin.JointModelPZ()
            seat = self.model.addJoint(joint, motion, near, f"joint {item.joint}"), far
        body, share = self.mechanism.bodies[item.bodies[1]], branch.share
        inertia = pin.Inertia(share * body.mass, np.array(body.centre_of_mass), share * inertia_tensor(body))
        self.model.appendBodyToJoint(seat[0], inertia, seat[1])
        self.seats[branch.part] = seat
        return item.joint

    def _closure(self, tie: Tie) -> object:
        kind = {"point": pin.ContactType.CONTACT_3D, "weld": pin.ContactType.CONTACT_6D}[tie.kind]
        (first, pose), (second, place) = (self.seats[part] for part in tie.parts)
        near, far = pose * pin.SE3(tie.frames[0]), place * pin.SE3(tie.frames[1])
        return pin.RigidConstraintModel(kind, self.model, first, near, second, far, pin.ReferenceFrame.LOCAL)

    def _arguments(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> tuple:
        """Return what `constraintDynamics` wants, for a state and actuator forces."""
        q, v = (values[self.columns] for values in checked(self.mechanism, positions, rates))
        tau = np.zeros(self.model.nv)
        tau[self.drives] = checked_forces(self.mechanism, forces)
        return self.model, self.data, q, v, tau, self.constraints, self.constraint_data, self.proximal

    def evaluation(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> Callable[[], object]:
        """Return Pinocchio's own forward dynamics at a state as a call without arguments or wrapping, for timing."""
        return partial(pin.constraintDynamics, *self._arguments(positions, rates, forces))

    def accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations of the actuated joints, shape (n,); see `Engine.accelerations`."""
        return pin.constraintDynamics(*self._arguments(positions, rates, forces))[self.drives]

    def inverse_dynamics(self, positions: np.ndarray, rates: np.ndarray, accelerations: np.ndarray) -> np.ndarray:
        """Return the actuator forces for accelerations of the actuated joints, shape (n,) [N, N m].

        J q'' = J q''_0 for every motion that keeps the loops closed, q''_0 being the one without actuator forces;
        with q' = L q_a' on the null space of J:  u = L' RNEA(q, q', q'').
        """
        arguments = self._arguments(positions, rates, np.zeros(len(self.drives)))
        q, v = arguments[2:4]
        acceleration = np.array(pin.constraintDynamics(*arguments))
        steps = np.eye(self.model.nv)[:, self.drives]
        if len(self.constraints):
            pin.computeJointJacobians(self.model, self.data, q)
            rows = pin.getConstraintsJacobian(self.model, self.data, self.constraints, self.constraint_data)
            passive = np.setdiff1d(np.arange(self.model.nv), self.drives)
            steps[passive] = -np.linalg.lstsq(rows[:, passive], rows[:, self.drives], rcond=1e-10)[0]
        acceleration += steps @ (accelerations - acceleration[self.drives])
        return steps.T @ pin.rnea(self.model, self.data, q, v, acceleration)

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by the classical Runge-Kutta method of order 4; see `Engine.simulate`.

        Nothing holds the loops closed but the accelerations: `closure_error` shows the drift.
        """
        model, data, q, v, tau, *constraints = self._arguments(positions, rates, forces(0.0))
        time = instants(duration, step)
        h = time[1]
        shape = len(time), self.model.nv
        qs, vs, accelerations = np.empty(shape), np.empty(shape), np.empty(shape)

        def acceleration(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            tau[self.drives] = forces(t)
            return pin.constraintDynamics(model, data, q, v, tau, *constraints)

        start = perf_counter()
        for k, t in enumerate(time[:-1]):
            qs[k], vs[k] = q, v
            accelerations[k] = a1 = acceleration(t, q, v)
            v2 = v + h / 2 * a1
            a2 = acceleration(t + h / 2, q + h / 2 * v, v2)
            v3 = v + h / 2 * a2
            a3 = acceleration(t + h / 2, q + h / 2 * v2, v3)
            v4 = v + h * a3
            a4 = acceleration(t + h, q + h * v3, v4)
            q, v = q + h / 6 * (v + 2 * (v2 + v3) + v4), v + h / 6 * (a1 + 2 * (a2 + a3) + a4)
        seconds = perf_counter() - start
        qs[-1], vs[-1], accelerations[-1] = q, v, acceleration(time[-1], q, v)
        table = np.zeros((2, len(time), len(coordinates(self.mechanism))))
        table[0][:] = positions
        table[:, :, self.columns] = qs, vs
        return run_on_tree(
            self.mechanism, self.tree, time, (table[0], table[1]), accelerations[:, self.drives], seconds
        )
