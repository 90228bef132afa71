"""A robot as a live model of Pinocchio: the spanning tree of its equations, with constraints that
close the loops.

    M v' + h = S' u + f + J' lambda,   J v' + gamma = 0               (v: the rates of the tree)

f is what else acts: springs, friction, stops, contacts and a fluid, for which Pinocchio has no
place, by the robot's own equations.

Turns, slides and screws have the robot's own coordinates and rates; of a ball, with R = R_12 and
the angular velocity w of F2 relative to F1 in F1's axes,

    R_pinocchio = R,   v = R' w        or where it leads backwards   R_pinocchio = R',   v = -w

A spherical joint that closes a loop holds one point, a revolute one a point in the plane, else two
of its axis: 6 rows of which one depends on the others, which the proximal iterations allow for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from linkwork import checks
from linkwork.equations.algebra import SX
from linkwork.equations.functions import function
from linkwork.equations.joints import ElementaryMotion, held_length, motions_of, pattern
from linkwork.equations.topology import Branch, span
from linkwork.equations.uncharted import uncharted
from linkwork.errors import LinkworkError
from linkwork.export._mujoco import home_of
from linkwork.formats import poses
from linkwork.formats.mjcf.model_plan import ARM
from linkwork.mechanism import GROUND, Mechanism, PairJoint
from linkwork.mechanism.bearing import bearings
from linkwork.mechanism.joints import JointFreedom
from linkwork.mechanism.sticking import require_no_bristles
from linkwork.model.checks import actuator_forces
from linkwork.model.state import State
from linkwork.robot import Robot

MISSING = "Pinocchio is not installed; pip install 'linkwork[engines]'"
ACCURACY, REGULARISATION, ROUNDS = 1e-6, 1e-6, 20  # of the proximal iterations
TURN, BALL = ("turn",), ("ball",)
ACTING = ("transmissions", "gears")


@dataclass(frozen=True, eq=False)
class PlacedFreedom:
    """Say where a joint of Pinocchio is in q and v, and which freedom of the robot it is."""

    q: slice
    v: slice
    freedom: JointFreedom
    ball: bool
    backwards: bool


@dataclass(frozen=True, eq=False)
class PinocchioModel:
    """Hold a robot as a model of Pinocchio.

    robot: with its loops closed exactly; model: `pinocchio.Model` of the tree
    constraints: `pinocchio.RigidConstraintModel`s that close the loops
    joints: where Pinocchio has the tree's joints; notes: what acts otherwise than in the robot
    """

    robot: Robot
    model: Any
    constraints: Any
    joints: tuple[PlacedFreedom, ...]
    notes: tuple[str, ...]

    def configuration(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return Pinocchio's q and v at one state of the robot."""
        own = self.robot.own(state)
        if own.batch:
            raise LinkworkError("Pinocchio's q is of one state, not a stack; give state.at(index)")
        positions = dict(zip(self.robot.coordinates, own.positions, strict=True))
        rates = dict(zip(self.robot.rates, self.robot.joint_rates(own), strict=True))
        q, v = np.empty(self.model.nq), np.empty(self.model.nv)
        for joint in self.joints:
            own_q = np.array([positions[name] for name in joint.freedom.coordinates])
            own_v = np.array([rates[name] for name in joint.freedom.rates])
            if joint.ball:
                R = Rotation.from_quat(own_q, scalar_first=True)
                own_v = -own_v if joint.backwards else R.inv().apply(own_v)
                own_q = (R.inv() if joint.backwards else R).as_quat()
            q[joint.q], v[joint.v] = own_q, own_v
        return q, v

    def forces(self, forces: ArrayLike | Mapping[str, ArrayLike]) -> np.ndarray:
        """Return tau (nv) of actuator forces u (actuators) [N, N m], or by name, others zero."""
        u = checks.finite(actuator_forces(forces, self.robot.actuators), "forces")
        if u.ndim != 1:
            raise LinkworkError("Pinocchio's tau is of one state; give one force per actuator")
        tau, pushed = np.zeros(self.model.nv), dict(zip(self.robot.actuators, u, strict=True))
        for joint in self.joints:
            if not joint.ball:
                tau[joint.v] = pushed.get(joint.freedom.rates[0], 0.0)
        return tau

    def applied(self, state: State) -> np.ndarray:
        """Return tau (nv) of what acts beside actuators and weight at one state: springs, friction,
        stops, contacts and a fluid; add it to that of `forces` where Pinocchio is called."""
        own, tree = self.robot.own(state), self.robot.equations.tree
        q, v = self.configuration(state)
        rates = dict(zip(self.robot.rates, self.robot.joint_rates(own), strict=True))
        w = [rates[name] for name in tree.rates]
        f = np.asarray(self.acting(own.q, w, self.robot.p), float).ravel()
        found, tau = dict(zip(tree.rates, f, strict=True)), np.zeros_like(v)
        for joint in self.joints:
            part = np.array([found[name] for name in joint.freedom.rates])
            if joint.ball:
                R = Rotation.from_quat(q[joint.q])
                part = -part if joint.backwards else R.inv().apply(part)
            tau[joint.v] = part
        return tau

    @cached_property
    def acting(self) -> ca.Function:
        """(q, w) -> f on the rates of the tree."""
        free = uncharted(self.robot.equations)
        alone, whole = (
            free.tree_forces(SX.zeros(free.nv), free.gravity, passive) for passive in (False, True)
        )
        return function("acting", free, {"f": alone - whole}, w=free.v)

    def accelerations(
        self, state: State, forces: ArrayLike | Mapping[str, ArrayLike]
    ) -> dict[str, float]:
        """Return the accelerations of the tree's rates by name [m/s^2, rad/s^2], by Pinocchio's
        `constraintDynamics`.

        Args:
            state: one state; forces: u (actuators) [N, N m], or by name, others zero.

        Raises:
            LinkworkError: what does not fit, or a tree whose mass matrix is singular.
        """
        engine, (q, v) = loaded(), self.configuration(state)
        data, held = self.model.createData(), engine.StdVec_RigidConstraintData()
        for constraint in self.constraints:
            held.append(constraint.createData())
        engine.initConstraintDynamics(self.model, data, self.constraints, held)
        proximal = engine.ProximalSettings(ACCURACY, ACCURACY, REGULARISATION, ROUNDS)
        tau = self.forces(forces) + self.applied(state)
        a = engine.constraintDynamics(self.model, data, q, v, tau, self.constraints, held, proximal)
        if not np.isfinite(a).all():
            raise LinkworkError(
                f"Pinocchio finds no accelerations of {self.robot.mechanism.name}: what moves "
                "without inertia makes the mass matrix of its tree singular"
            )
        return self.rates(q, np.array(a))

    @staticmethod
    def _held(values: Any, what: str, size: int) -> np.ndarray:
        found = checks.finite(values, what)
        if found.shape != (size,):
            raise LinkworkError(f"{what} has the shape {found.shape}; give {size} numbers")
        return found

    def positions(self, q: np.ndarray) -> dict[str, float]:
        """Return the coordinates of the tree's joints by name [m, rad; 1 of quaternions].

        q: Pinocchio's configuration (nq).
        """
        found: dict[str, float] = {}
        q = self._held(q, "q", self.model.nq)
        for joint in self.joints:
            own = q[joint.q]
            if joint.ball:
                R = Rotation.from_quat(own)
                own = (R.inv() if joint.backwards else R).as_quat(scalar_first=True)
            found |= zip(joint.freedom.coordinates, map(float, own), strict=True)
        return found

    def rates(self, q: np.ndarray, v: np.ndarray) -> dict[str, float]:
        """Return the rates of the tree's joints by name [m/s, rad/s]; accelerations for v', which
        turn by the same map.

        q: Pinocchio's configuration (nq); v: its velocity, or v' (nv).
        """
        found: dict[str, float] = {}
        q, v = self._held(q, "q", self.model.nq), self._held(v, "v", self.model.nv)
        for joint in self.joints:
            own = v[joint.v]
            if joint.ball:
                R = Rotation.from_quat(q[joint.q])
                own = -own if joint.backwards else R.apply(own)
            found |= zip(joint.freedom.rates, map(float, own), strict=True)
        return found

    def __repr__(self) -> str:
        return (
            f"PinocchioModel({self.robot.mechanism.name}: {self.model.nq} coordinates, "
            f"{self.model.nv} rates, {len(self.constraints)} constraints)"
        )


def pinocchio(robot: Robot) -> PinocchioModel:
    """Return a robot as a live model of Pinocchio: `Robot.to_pinocchio`.

    Args:
        robot: the robot, with the values that its free numbers have.

    Raises:
        LinkworkError: Pinocchio is not installed; something acts that its model has no place for;
            a joint closes a loop that its constraints do not hold.
    """
    checks.needed(robot, Robot)
    mechanism, engine = robot.mechanism, loaded()
    refuse(mechanism)
    # A tree of the robot's own joints.
    topology = span(mechanism)
    for name in topology.added:
        raise LinkworkError(
            f"{topology.joints[name].connects[1]}: all of its joints close loops, and Pinocchio's "
            "tree would carry it by a free joint that the robot does not have; take to_mujoco"
        )
    # The tree, each joint with the body that it carries.
    model = engine.Model()
    model.gravity.linear = np.array(mechanism.gravity)
    seats: Seats = {GROUND: (0, engine.SE3.Identity())}
    joints: list[PlacedFreedom] = []
    armature: list[float] = []
    for branch in depth_first(topology.branches):
        for each in grown(model, seats, branch, topology.joints[branch.joint], mechanism):
            joints.append(each)
            armature += [each.freedom.effects.rotor] * (each.v.stop - each.v.start)
    model.armature = np.array(armature)
    # What is driven is a turn or a slide of the tree.
    driven = {rate for each in joints if not each.ball for rate in each.freedom.rates}
    for name in mechanism.actuators:
        if name not in driven:
            raise LinkworkError(
                f"the actuator {name!r} drives no turn or slide of the tree that Pinocchio moves; "
                "drive another joint, or take to_mujoco"
            )
    # What closes the loops.
    reach = 0.0 if robot.planar else ARM * home_of(robot).size(mechanism)
    constraints = engine.StdVec_RigidConstraintModel()
    for name, joint in topology.closing.items():
        for each in closures(model, seats, name, joint, reach):
            constraints.append(each)
    notes = tuple(
        f"drives.{name}: does not act here; forces are forces" for name in mechanism.drives
    )
    return PinocchioModel(robot, model, constraints, tuple(joints), notes)


def refuse(mechanism: Mechanism) -> None:
    """Refuse what acts on the motion and has no place in Pinocchio's model."""
    for kind in ACTING:
        for name in getattr(mechanism, kind):
            raise LinkworkError(
                f"{kind}.{name}: Pinocchio's model has no place for {kind}; take to_mujoco"
            )
    for name in bearings(mechanism.joints):
        raise LinkworkError(f"joints.{name}: Pinocchio has no friction of bearings; leave it out")
    for name, joint in mechanism.pairs.items():
        if held_length(joint) is not None:
            raise LinkworkError(
                f"joints.{name}: is a rod, which Pinocchio has no constraint for; make it a link "
                "between spherical joints, or take to_mujoco"
            )
    require_no_bristles(mechanism, "Pinocchio leaves out", "give it without a bristle")


def depth_first(branches: tuple[Branch, ...], parent: str = GROUND) -> Iterator[Branch]:
    """Yield the branches from a body outwards, each with all behind it: Pinocchio's joints of a
    subtree have numbers in a row."""
    for branch in branches:
        if branch.parent == parent:
            yield branch
            yield from depth_first(branches, branch.body)


Seats = dict[str, tuple[int, Any]]
"""The joint of Pinocchio that carries each body, and the body's pose in that joint's frame."""


def grown(
    model: Any, seats: Seats, branch: Branch, joint: PairJoint, mechanism: Mechanism
) -> Iterator[PlacedFreedom]:
    """Add a joint of the tree and the body that it carries; yield its freedoms."""
    engine = loaded()
    near, far = (engine.SE3(poses.of_frame(frame)) for frame in joint.frames)
    steps = list(zip(joint.parts(branch.joint), motions_of(joint), strict=True))
    if branch.reversed:
        near, far = far, near
        steps = [(part, motion.reversed()) for part, motion in steps[::-1]]
    index, pose = seats[branch.parent]
    pose = pose * near
    for part, motion in steps:
        at = model.nq, model.nv
        index = model.addJoint(index, moving(motion), pose, f"joint {part.coordinates[0]}")
        pose = engine.SE3.Identity()
        ends = slice(at[0], model.nq), slice(at[1], model.nv)
        yield PlacedFreedom(*ends, part, motion.ball, branch.reversed)
    seat = pose * far.inverse()
    body = mechanism.bodies[branch.body]
    tensor = body.inertia.zz * np.eye(3) if body.inertia.planar else body.inertia.tensor()
    inertia = engine.Inertia(body.mass, np.array(body.centre_of_mass), np.array(tensor, float))
    model.appendBodyToJoint(index, inertia, seat)
    seats[branch.body] = index, seat


def moving(motion: ElementaryMotion) -> Any:
    """Return Pinocchio's joint for an elementary motion."""
    engine, turn = loaded(), np.asarray(motion.turn, float)
    match motion.what:
        case "turn":
            return engine.JointModelRevoluteUnaligned(turn)
        case "slide":
            return engine.JointModelPrismaticUnaligned(np.asarray(motion.slide, float))
        case "screw":
            return engine.JointModelHelicalUnaligned(turn, float(motion.pitch or 0.0))
        case "ball":
            return engine.JointModelSpherical()


def closures(model: Any, seats: Seats, name: str, joint: PairJoint, reach: float) -> Iterator[Any]:
    """Yield the constraints of a joint that closes a loop; the two points of an axis are `reach`
    [m] apart, or one where that is zero."""
    engine, kind = loaded(), pattern(joint)
    if kind not in (TURN, BALL):
        raise LinkworkError(
            f"joints.{name}: closes a loop by a {joint.type} joint, which Pinocchio's constraints "
            "do not hold (revolute and spherical ones they do); take to_mujoco"
        )
    spread, point = [np.zeros(3)], engine.ContactType.CONTACT_3D
    if kind == TURN and reach:
        spread = [side * reach * np.asarray(motions_of(joint)[0].turn) for side in (-0.5, 0.5)]
    (first, near), (second, far) = (seats[body] for body in joint.connects)
    F1, F2 = (engine.SE3(poses.of_frame(frame)) for frame in joint.frames)
    for arm in spread:
        along = engine.SE3(np.eye(3), arm)
        ends = first, near * F1 * along, second, far * F2 * along
        yield engine.RigidConstraintModel(point, model, *ends, engine.ReferenceFrame.LOCAL)


def loaded() -> Any:
    """Return Pinocchio's module.

    Raises:
        LinkworkError: it is not installed.
    """
    return checks.imported("pinocchio", MISSING)
