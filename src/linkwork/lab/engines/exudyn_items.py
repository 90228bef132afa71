"""What an Exudyn system is made of: bodies, joints, gears, rotors, springs, friction, loads,
sensors.

Exudyn's bodies are referred to their mass centres, with axes that are all parallel where the tree's
joints stand at zero. Only then does Exudyn's relative coordinate of two bodies, by which screws,
gears and rotors are built, mean the coordinate of the joint between them. A rotor is a mass of one
freedom whose coordinate is tied to the joint's. Springs and viscous friction are Exudyn's own; it
calls back for smoothed Coulomb friction and for springs of free turns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.lab.engines.interface import Forces, load_engine
from linkwork.lab.engines.joints import Edge, Step, edge
from linkwork.lab.engines.motion import BodyMotion, along_tree
from linkwork.lab.engines.rewrite import inertia_tensor
from linkwork.lab.engines.tree import EngineTree
from linkwork.lab.engines.vectors import effects
from linkwork.mechanism import GROUND, Friction, GearJoint, Mechanism, PointSpring, Spring

exu = load_engine("exudyn", "Exudyn")
items = load_engine("exudyn.itemInterface", "Exudyn")
rigid = load_engine("exudyn.rigidBodyUtilities", "Exudyn")

Seat = tuple[
    Any, np.ndarray
]  # Exudyn's number of a body, and the pose of our body frame in its frame


@dataclass(frozen=True)
class BuiltSystem:
    """Hold a system while it is being built.

    Attributes:
        system: Exudyn's.
        mechanism: joints on which something acts have one freedom or are spherical.
        positions, rates: of all joints at the start, by name.
        seats: the bodies.
        edges, markers: the joints that connect bodies, and the markers at their two frames.
    """

    system: Any
    mechanism: Mechanism
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    seats: Mapping[str, Seat]
    edges: Mapping[str, Edge]
    markers: Mapping[str, tuple[Any, Any]]


def scene(
    mechanism: Mechanism,
    tree: EngineTree,
    start: BodyMotion,
    positions: np.ndarray,
    rates: np.ndarray,
    rows: Mapping[str, tuple[int, ...]],
    forces: Forces,
) -> BuiltSystem:
    """Return a mechanism at a state with all but its sensors.

    Args:
        mechanism, tree: the description and a spanning tree of it.
        start: the bodies' poses and twists.
        positions, rates: of all joints, shapes (nq,) and (nv,).
        rows: for each joint the indices of `held` that it holds; a gear holds its one row or none.
        forces: constant, shape (n,), or a function of time.
    """
    # Bodies, and markers where joints hold them.
    system = exu.SystemContainer().AddSystem()
    seats = bodies(system, mechanism, tree, start)
    edges = {name: edge(name, joint) for name, joint in mechanism.pairs.items()}
    built = BuiltSystem(
        system=system,
        mechanism=mechanism,
        positions=dict(zip(mechanism.coordinates, positions, strict=True)),
        rates=dict(zip(mechanism.rates, rates, strict=True)),
        seats=seats,
        edges=edges,
        markers={
            name: tuple(
                marker(system, seats[body], frame)
                for body, frame in zip(item.bodies, item.frames, strict=True)
            )
            for name, item in edges.items()
        },
    )
    # Joints, with what acts in each of their freedoms.
    acting = effects(mechanism)
    for item in edges.values():
        add_joint(built, item, rows[item.joint])
        for step in item.steps:
            own = acting[step.rates[0]]
            add_joint_forces(built, item, step, own.friction, own.spring)
            if own.rotor:
                add_rotor(built, item, own.rotor)
    # What acts between several joints or bodies.
    for name, gear in mechanism.gears.items():
        if rows[name]:
            add_gear(built, gear)
    for spring in mechanism.springs.values():
        add_point_spring(built, spring)
    add_actuators(built, forces)
    return built


# Bodies


def bodies(
    system: Any, mechanism: Mechanism, tree: EngineTree, start: BodyMotion
) -> dict[str, Seat]:
    """Add the ground and the bodies at their initial poses and twists."""
    zero = np.zeros(len(mechanism.coordinates))
    zero[[label.endswith(".qw") for label in mechanism.coordinates]] = 1.0
    parallel = along_tree(mechanism, tree, zero, np.zeros(len(mechanism.rates))).poses
    seats: dict[str, Seat] = {GROUND: (system.CreateGround(), np.eye(4))}
    motion = zip(
        mechanism.bodies.items(), parallel[:, :3, :3], start.poses, start.twists, strict=True
    )
    for (name, body), turned, pose, twist in motion:
        arm = pose[:3, :3] @ body.centre_of_mass
        number = system.CreateRigidBody(
            inertia=rigid.RigidBodyInertia(
                mass=body.mass, inertiaTensor=turned @ inertia_tensor(body) @ turned.T
            ),
            referencePosition=pose[:3, 3] + arm,
            referenceRotationMatrix=pose[:3, :3] @ turned.T,
            initialVelocity=twist[3:] + np.cross(twist[:3], arm),
            initialAngularVelocity=twist[:3],
            gravity=list(mechanism.gravity),
        )
        seat = np.eye(4)
        seat[:3, :3], seat[:3, 3] = turned, -turned @ body.centre_of_mass
        seats[name] = number, seat
    return seats


def marker(system: Any, seat: Seat, frame: np.ndarray) -> Any:
    """Add a marker at a frame of a body."""
    number, pose = seat
    place = pose @ frame
    return system.AddMarker(
        items.MarkerBodyRigid(
            bodyNumber=number, localHT=exu.HT(rotation=place[:3, :3], translation=place[:3, 3])
        )
    )


def sensors(built: BuiltSystem, names: tuple[str, ...]) -> list[list[Any]]:
    """Add sensors for pose, twist and its derivative at these bodies' origins."""
    kinds = exu.OutputVariableType
    pose, twist = (kinds.Position, kinds.RotationMatrix), (kinds.AngularVelocity, kinds.Velocity)

    def sensor(name: str, kind: Any) -> Any:
        number, seat = built.seats[name]
        return built.system.AddSensor(
            items.SensorBody(
                bodyNumber=number,
                localPosition=seat[:3, 3],
                outputVariableType=kind,
                storeInternal=True,
                writeToFile=False,
            )
        )

    wanted = (*pose, *twist, kinds.AngularAcceleration, kinds.Acceleration)
    return [[sensor(name, kind) for kind in wanted] for name in names]


def recorded(built: BuiltSystem, names: tuple[str, ...], numbers: list[list[Any]]) -> BodyMotion:
    """Return the recorded motion of these bodies."""
    data = built.system.GetSensorStoredData
    table = np.stack(
        [np.hstack([data(number)[:, 1:] for number in own]) for own in numbers], axis=1
    )
    position, rotation, twists, accelerations = np.split(table, (3, 12, 18), axis=2)
    poses = np.zeros((*table.shape[:2], 4, 4))
    poses[..., :3, 3], poses[..., 3, 3] = position, 1.0
    turned = np.stack([built.seats[name][1][:3, :3] for name in names])
    poses[..., :3, :3] = rotation.reshape(*table.shape[:2], 3, 3) @ turned
    return BodyMotion(names, poses, twists, accelerations)


# Joints


def add_joint(built: BuiltSystem, item: Edge, rows: tuple[int, ...]) -> None:
    """Hold these rows of a joint."""
    system, markers = built.system, list(built.markers[item.joint])
    if item.rod:
        if rows:
            system.AddObject(items.DistanceConstraint(markerNumbers=markers, distance=item.size))
        return
    threaded = "screw" in item.motions and 2 in rows
    axes = [int(axis in rows) for axis in range(6)]
    if threaded:
        axes[2] = 0
    if any(axes):
        system.AddObject(items.GenericJoint(markerNumbers=markers, constrainedAxes=axes))
    if threaded:
        tie(built, slide_marker(built, item), turn_marker(built, item), item.size, 0.0)


def tie(built: BuiltSystem, first: Any, second: Any, factor: float, offset: float) -> None:
    """Keep the first coordinate at `factor` times the second plus `offset`."""
    built.system.AddObject(
        items.CoordinateConstraint(markerNumbers=[first, second], factor1=factor, offset=-offset)
    )


def add_gear(built: BuiltSystem, gear: GearJoint) -> None:
    """Couple two joint coordinates: a = (offset - r_b b) / r_a."""
    (a, r_a), (b, r_b) = ((label, ratio) for label, ratio in gear.ratios.items() if ratio)
    owner = {
        label: item
        for item in built.edges.values()
        for step in item.steps
        for label in step.coordinates
    }
    tie(
        built,
        coordinate_marker(built, owner[a]),
        coordinate_marker(built, owner[b]),
        -r_b / r_a,
        gear.offset / r_a,
    )


def add_rotor(built: BuiltSystem, item: Edge, inertia: float) -> None:
    """Add a mass of one freedom that moves with a joint's coordinate."""
    system, label = built.system, item.steps[0].coordinates[0]
    node = system.AddNode(
        items.Node1D(
            initialCoordinates=[built.positions[label]], initialVelocities=[built.rates[label]]
        )
    )
    system.AddObject(items.Mass1D(nodeNumber=node, mass=inertia))
    own = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    tie(built, own, coordinate_marker(built, item), 1.0, 0.0)


def coordinate_marker(built: BuiltSystem, item: Edge) -> Any:
    """Add a marker of the coordinate of a joint of one freedom."""
    return slide_marker(built, item) if item.motions == ("slide",) else turn_marker(built, item)


def slide_marker(built: BuiltSystem, item: Edge) -> Any:
    """Add a marker of the distance along a joint's axis."""
    return built.system.AddMarker(
        items.MarkerBodiesRelativeTranslationCoordinate(**between(built, item))
    )


def turn_marker(built: BuiltSystem, item: Edge) -> Any:
    """Add a marker of the angle about a joint's axis, whole turns included."""
    return built.system.AddMarker(
        items.MarkerBodiesRelativeRotationCoordinate(
            nodeNumber=turns(built, item), **between(built, item)
        )
    )


def between(built: BuiltSystem, item: Edge) -> dict[str, Any]:
    """Return the fields of markers between a joint's bodies, about or along its axis."""
    numbers, poses = zip(*(built.seats[body] for body in item.bodies), strict=True)
    near, far = (pose @ frame for pose, frame in zip(poses, item.frames, strict=True))
    return {
        "bodyNumbers": list(numbers),
        "localPosition0": near[:3, 3],
        "localPosition1": far[:3, 3],
        "axis0": near[:3, 2],
    }


def turns(built: BuiltSystem, item: Edge) -> Any:
    """Add a node that remembers a joint's last angle, so that whole turns count."""
    angle = built.positions[item.steps[0].coordinates[0]]
    return built.system.AddNode(
        items.NodeGenericData(initialCoordinates=[angle], numberOfDataCoordinates=1)
    )


# Forces


def add_joint_forces(
    built: BuiltSystem, item: Edge, step: Step, friction: Friction, spring: Spring
) -> None:
    """Add the spring, damper and friction of a freedom."""
    damping = friction.viscous + spring.damping
    if not (spring.stiffness or damping or friction.coulomb):
        return
    fields: dict[str, Any] = {"markerNumbers": list(built.markers[item.joint])}
    if step.motion == "ball":
        resist = ball_resistance(spring.stiffness, damping, friction)
        built.system.AddObject(
            items.RigidBodySpringDamper(springForceTorqueUserFunction=resist, **fields)
        )
        return
    fields |= {"stiffness": spring.stiffness, "damping": damping, "offset": spring.rest}
    resist = resistance(friction) if friction.coulomb else 0
    if step.motion == "slide":
        built.system.AddObject(
            items.LinearSpringDamper(
                axisMarker0=[0, 0, 1], springForceUserFunction=resist, **fields
            )
        )
    else:
        node = turns(built, item)
        built.system.AddObject(
            items.TorsionalSpringDamper(nodeNumber=node, springTorqueUserFunction=resist, **fields)
        )


def resistance(friction: Friction) -> Callable[..., float]:
    """Return Exudyn's function of a spring, damper and smoothed Coulomb friction: k (q - rest) +
    (c + F / s) w."""

    def force(
        _system: Any, _time: float, _item: Any, q: float, w: float, k: float, c: float, rest: float
    ) -> float:
        return k * (q - rest) + (c + smoothed(friction, w * w)) * w

    return force


def ball_resistance(
    stiffness: float, damping: float, friction: Friction
) -> Callable[..., np.ndarray]:
    """Return Exudyn's function of the same for a free turn, which gives angles of turns about x, y
    and z in this order."""

    def torque(
        _system: Any, _time: float, _item: Any, _d: Any, angles: Any, _v: Any, omega: Any, *_: Any
    ) -> np.ndarray:
        turn, w = Rotation.from_euler("XYZ", angles).as_rotvec(), np.asarray(omega)
        return np.concatenate(
            [np.zeros(3), stiffness * turn + (damping + smoothed(friction, float(w @ w))) * w]
        )

    return torque


def smoothed(friction: Friction, square: float) -> float:
    """Return the Coulomb friction per rate, F / sqrt(|w|^2 + r^2)."""
    return friction.coulomb / np.sqrt(square + friction.coulomb_rate**2)


def add_point_spring(built: BuiltSystem, spring: PointSpring) -> None:
    """Add a spring and damper between two points."""
    ends = []
    for body, point in zip(spring.connects, spring.points, strict=True):
        frame = np.eye(4)
        frame[:3, 3] = point
        ends.append(marker(built.system, built.seats[body], frame))
    built.system.AddObject(
        items.SpringDamper(
            markerNumbers=ends,
            referenceLength=spring.rest_length,
            stiffness=spring.stiffness,
            damping=spring.damping,
        )
    )


def add_actuators(built: BuiltSystem, forces: Forces) -> None:
    """Add for each actuator a pair of loads on the two bodies, in the axes of the joint's first
    frame."""
    asked = lru_cache(maxsize=1)(forces) if callable(forces) else forces
    for place, name in enumerate(built.mechanism.actuators):
        item, step = next(
            (item, step)
            for item in built.edges.values()
            for step in item.steps
            if name in step.rates
        )
        axis = (
            np.eye(3)[step.rates.index(name)]
            if step.motion == "ball"
            else np.array([0.0, 0.0, 1.0])
        )
        load = items.Force if step.motion == "slide" else items.Torque
        near, far = built.markers[item.joint]
        turning = near if step.motion == "ball" else None
        for number, direction, frame in ((near, -axis, None), (far, axis, turning)):
            built.system.AddLoad(
                load(markerNumber=number, **pushing(direction, place, asked, frame))
            )


def pushing(direction: np.ndarray, place: int, forces: Forces, frame: Any) -> dict[str, Any]:
    """Return the fields of a load along a direction of its own marker's frame, or of another
    marker's."""
    if not callable(forces) and frame is None:
        return {"bodyFixed": True, "loadVector": direction * forces[place]}

    def push(system: Any, time: float, _load: Any) -> np.ndarray:
        force = direction * (forces(time) if callable(forces) else forces)[place]
        if frame is None:
            return force
        R = system.GetMarkerOutput(
            frame, exu.OutputVariableType.RotationMatrix, exu.ConfigurationType.Current
        )
        return np.asarray(R).reshape(3, 3) @ force

    return {"bodyFixed": frame is None, "loadVectorUserFunction": push}
