"""The mechanism in Exudyn: rigid bodies in space with Euler parameters, every joint a constraint.

    M q'' + Q(q, q') = S' u + Phi' lambda,   phi(q) = 0                 (q: seven coordinates per body)

Loops are nothing special here, but dependent rows would make the system singular: of the rows of the joints that close
loops, those kept are the independent ones at the initial state, chosen by a pivoted QR decomposition. An actuator is a
pair of loads on the two bodies along the joint's axis. The integrator is the generalised-alpha method of order 2; it
satisfies phi = 0 to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from time import perf_counter
from typing import Any, cast

import numpy as np
from scipy.linalg import qr

from linkwork.engines.common import (
    BodyMotion,
    EngineError,
    EngineRun,
    Forces,
    actuated,
    along_tree,
    checked,
    checked_forces,
    coordinates,
    edge,
    inertia_tensor,
    instants,
    load_engine,
    spanning_tree,
)
from linkwork.mechanism import GROUND, Mechanism

exu = load_engine("exudyn", "Exudyn")
items = load_engine("exudyn.itemInterface", "Exudyn")
bodies = load_engine("exudyn.rigidBodyUtilities", "Exudyn")

TOLERANCE = 1e-12  # of Newton's method in every step, absolute and relative
SPECTRAL_RADIUS = 0.9
GLIMPSE = 1e-6  # the one step after which a state's initial accelerations can be read [s]
RANK_TOLERANCE = 1e-9
ROWS = {"fixed": (1, 1, 1, 1, 1, 1), "revolute": (1, 1, 1, 1, 1, 0), "prismatic": (1, 1, 0, 1, 1, 1)}
"""Constrained translations and rotations along x, y, z of the joint's frame; the joint's axis is z."""


class ExudynEngine:
    """Evaluate and simulate a mechanism with Exudyn's implicit solver.

    Attributes:
        mechanism: the description.
        tree: a spanning tree; it sets the bodies' initial poses and twists and tells which joints close loops.

    Raises:
        EngineError: Exudyn is missing, or actuated joints alone close a loop.
    """

    name = "exudyn"
    version = str(exu.__version__)

    def __init__(self, mechanism: Mechanism):
        self.mechanism, self.tree = mechanism, spanning_tree(mechanism)

    def accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations of the actuated joints, shape (n,); see `Engine.accelerations`.

        They are the solver's initial accelerations, for which Exudyn differentiates the constraints by differences.
        """
        held = checked_forces(self.mechanism, forces)
        motion, _ = self._solve(positions, rates, lambda _: held, np.array([0.0, GLIMPSE]))
        return motion.joints(positions).accelerations[0, actuated(self.mechanism)]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by the generalised-alpha method; see `Engine.simulate`."""
        time = instants(duration, step)
        checked_forces(self.mechanism, forces(0.0))
        motion, seconds = self._solve(positions, rates, forces, time)
        joints = motion.joints(positions)
        return EngineRun(
            time=time,
            positions=joints.positions,
            rates=joints.rates,
            accelerations=joints.accelerations[:, actuated(self.mechanism)],
            body_poses=motion.poses,
            closure_error=joints.closure_error,
            alignment_error=joints.alignment_error,
            seconds=seconds,
        )

    def _solve(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, time: np.ndarray
    ) -> tuple[BodyMotion, float]:
        """Build the system at a state, run it through the instants, and return the bodies' motion and the wall time."""
        positions, rates = checked(self.mechanism, positions, rates)
        container = exu.SystemContainer()
        system = container.AddSystem()
        start = along_tree(self.mechanism, self.tree, positions, rates)
        seats = add_bodies(system, self.mechanism, *start)
        add_joints(system, self.mechanism, seats, self.independent_rows(positions), lru_cache(maxsize=1)(forces))
        sensors = add_sensors(system, seats)
        system.Assemble()
        begin = perf_counter()
        if not system.SolveDynamic(solver_settings(time), solverType=exu.DynamicSolverType.GeneralizedAlpha):
            raise EngineError(f"Exudyn's solver stopped in {self.mechanism.name!r}; try steps below {time[1]:.6g} s")
        return read(system, self.mechanism, sensors), perf_counter() - begin

    def independent_rows(self, positions: np.ndarray) -> dict[str, list[int]]:
        """Return for each joint which of its six relative motions Exudyn constrains (1) at a closed configuration.

        The tree's joints keep all their rows. Those of the cut joints act on the tree's rates by a matrix whose rows
        are their relative twists for unit rates; pivoted QR finds the independent ones among them.
        """
        joints = [edge(name, joint) for name, joint in self.mechanism.joints.items()]
        rows = {item.joint: list(ROWS[item.kind]) for item in joints}
        place = coordinates(self.mechanism)
        columns = [place[item.joint] for item in self.tree.edges if item.kind != "fixed"]
        unit = np.eye(len(place))[columns]
        poses, twists = along_tree(self.mechanism, self.tree, np.broadcast_to(positions, unit.shape), unit)
        motion = BodyMotion(self.mechanism, poses, twists, np.zeros_like(twists))
        candidates, gradients = [], []
        for cut in self.tree.cuts:
            relative = np.roll(motion.across(cut)[1], 3, axis=1)  # Exudyn counts translations first
            candidates += [(cut.joint, axis) for axis in range(6) if rows[cut.joint][axis]]
            gradients += [relative[:, axis] for axis in range(6) if rows[cut.joint][axis]]
        if candidates:
            triangle, order = cast(tuple[np.ndarray, np.ndarray], qr(np.transpose(gradients), mode="r", pivoting=True))
            pivots = np.zeros(len(order))
            pivots[: min(triangle.shape)] = abs(np.diag(triangle))
            for index in order[pivots <= RANK_TOLERANCE * max(1.0, pivots[0])]:
                joint, axis = candidates[index]
                rows[joint][axis] = 0
        return rows


Seats = dict[str, tuple[Any, np.ndarray]]  # of each body: Exudyn's number and the mass centre in the body's frame [m]


def add_bodies(system: Any, mechanism: Mechanism, poses: np.ndarray, twists: np.ndarray) -> Seats:
    """Add the ground and the bodies, each referred to its mass centre, at their initial poses and twists."""
    seats = {GROUND: (system.CreateGround(), np.zeros(3))}
    for (name, body), pose, twist in zip(mechanism.bodies.items(), poses, twists, strict=True):
        centre, rotation = np.array(body.centre_of_mass), pose[:3, :3]
        arm = rotation @ centre
        number = system.CreateRigidBody(
            inertia=bodies.RigidBodyInertia(mass=body.mass, inertiaTensor=inertia_tensor(body)),
            referencePosition=pose[:3, 3] + arm,
            referenceRotationMatrix=rotation,
            initialVelocity=twist[3:] + np.cross(twist[:3], arm),
            initialAngularVelocity=twist[:3],
            gravity=list(mechanism.gravity),
        )
        seats[name] = number, centre
    return seats


def add_joints(system: Any, mechanism: Mechanism, seats: Seats, rows: dict[str, list[int]], forces: Forces) -> None:
    """Add the joints with the given rows, and on the actuated ones the pair of loads along z."""
    for name, joint in mechanism.joints.items():
        item = edge(name, joint)
        markers = []
        for body, frame in zip(item.bodies, item.frames, strict=True):
            number, centre = seats[body]
            place = exu.HT(rotation=frame[:3, :3], translation=frame[:3, 3] - centre)
            markers.append(system.AddMarker(items.MarkerBodyRigid(bodyNumber=number, localHT=place)))
        system.AddObject(items.GenericJoint(markerNumbers=markers, constrainedAxes=rows[name]))
        if name in mechanism.actuators:
            load = items.Torque if item.kind == "revolute" else items.Force
            actuator = mechanism.actuators.index(name)
            for marker, sign in zip(markers, (-1.0, 1.0), strict=True):
                pull = along(np.array([0.0, 0.0, sign]), actuator, forces)
                system.AddLoad(load(markerNumber=marker, bodyFixed=True, loadVectorUserFunction=pull))


def along(axis: np.ndarray, actuator: int, forces: Forces) -> Callable[[Any, float, Any], np.ndarray]:
    """Return Exudyn's load function: one actuator's force along an axis of the joint's frame."""
    return lambda _system, time, _load: axis * forces(time)[actuator]


def add_sensors(system: Any, seats: Seats) -> list[list[Any]]:
    """Add sensors for pose, twist and its derivative at every body's origin."""
    kinds = exu.OutputVariableType
    pose = kinds.Position, kinds.RotationMatrix
    twist = kinds.AngularVelocity, kinds.Velocity
    wanted = (*pose, *twist, kinds.AngularAcceleration, kinds.Acceleration)

    def sensor(number: Any, centre: np.ndarray, kind: Any) -> Any:
        return system.AddSensor(
            items.SensorBody(
                bodyNumber=number, localPosition=-centre, outputVariableType=kind, storeInternal=True, writeToFile=False
            )
        )

    return [[sensor(*seat, kind) for kind in wanted] for name, seat in seats.items() if name != GROUND]


def solver_settings(time: np.ndarray) -> Any:
    """Return Exudyn's settings for equal steps, every one recorded."""
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = len(time) - 1, time[-1]
    integration.adaptiveStep, integration.verboseMode = False, 0
    integration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    integration.newton.relativeTolerance = integration.newton.absoluteTolerance = TOLERANCE
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = time[1] / 2
    return settings


def read(system: Any, mechanism: Mechanism, sensors: list[list[Any]]) -> BodyMotion:
    """Return the recorded motion of the bodies."""
    table = np.stack(
        [np.hstack([system.GetSensorStoredData(sensor)[:, 1:] for sensor in body]) for body in sensors], axis=1
    )
    position, rotation, twists, accelerations = np.split(table, (3, 12, 18), axis=2)
    poses = np.zeros((*table.shape[:2], 4, 4))
    poses[..., :3, 3], poses[..., 3, 3] = position, 1.0
    poses[..., :3, :3] = rotation.reshape(*table.shape[:2], 3, 3)
    return BodyMotion(mechanism, poses, twists, accelerations)
