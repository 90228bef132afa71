"""What the engines share: the result of a run, the spanning tree, and body motion from joint motion and back.

Every joint frame is turned so that its z axis is the joint's axis: a revolute joint is then Rot(z, q), a prismatic one
Trans(z, q), whatever the description says. A pose X_GB is a 4 x 4 matrix, a twist is (angular, linear) of a body's
origin in the ground's axes; leading dimensions (instants of time) are kept everywhere.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.errors import LinkworkError
from linkwork.mechanism import GROUND, Body, Frame, Joint, Mechanism

Forces = Callable[[float], np.ndarray]
Kind = Literal["fixed", "revolute", "prismatic"]
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
ARM = 0.2  # distance of the two points tied on the axis of a cut revolute joint [m]


class EngineError(LinkworkError):
    """Refuse what an engine cannot do, in one sentence."""


@dataclass(frozen=True)
class EngineRun:
    """Hold a motion computed by an engine.

    Attributes:
        time: instants, shape (k,) [s].
        positions, rates: all joint coordinates in the order of `mechanism.joints` (a fixed joint has none), shape (k, m)
            [m, rad; /s].
        accelerations: of the actuated joints, shape (k, n) [m/s^2, rad/s^2].
        body_poses: X_GB of the bodies in the order of `mechanism.bodies`, shape (k, r, 4, 4) [m].
        closure_error: largest distance between the two sides of any joint over the run [m].
        alignment_error: largest angle between directions that a joint keeps parallel, over the run [rad].
        seconds: wall time of the integration alone [s].
    """

    time: np.ndarray
    positions: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    body_poses: np.ndarray
    closure_error: float
    alignment_error: float
    seconds: float

    @property
    def body_positions(self) -> np.ndarray:
        """Return the origins of the bodies in the ground's frame, shape (k, r, 3) [m]."""
        return self.body_poses[..., :3, 3]


class Engine(Protocol):
    """Answer for one mechanism: accelerations at a state, and the motion under given actuator forces."""

    name: str
    version: str
    mechanism: Mechanism

    def accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations of the actuated joints, shape (n,) [m/s^2, rad/s^2].

        Args:
            positions, rates: of all joints in the order of `mechanism.joints`, shape (m,) [m, rad; /s]; they close the
                loops (an engine with a spanning tree reads the joints of its tree only).
            forces: of the actuators in the order of `mechanism.actuators`, shape (n,) [N, N m].
        """
        ...

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion from a state under `forces(t)`, with steps of `step` seconds up to `duration`."""
        ...


def load_engine(module: str, title: str) -> Any:
    """Import an engine's module; a missing one is refused in one sentence."""
    try:
        return import_module(module)
    except ImportError as error:
        raise EngineError(f"{title} cannot be imported ({error}); try `pip install linkwork[engines]`") from None


def checked(mechanism: Mechanism, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and rates of all joints as vectors of shape (m,); other shapes and non-numbers are refused."""
    size = len(coordinates(mechanism))
    for title, values in (("positions", positions), ("rates", rates)):
        if np.shape(values) != (size,) or not np.all(np.isfinite(values)):
            raise EngineError(f"{title}: give {size} finite numbers, one per joint coordinate, not {values!r}")
    return np.asarray(positions, dtype=float), np.asarray(rates, dtype=float)


def checked_forces(mechanism: Mechanism, forces: np.ndarray) -> np.ndarray:
    """Return actuator forces as a vector of shape (n,); another shape is refused."""
    if np.shape(forces) != (len(mechanism.actuators),):
        raise EngineError(f"forces: give {len(mechanism.actuators)} numbers, one per actuator, not {forces!r}")
    return np.asarray(forces, dtype=float)


def instants(duration: float, step: float) -> np.ndarray:
    """Divide [0, duration] into equal steps no longer than `step` [s]."""
    if not (0 < step < np.inf and 0 < duration < np.inf):
        raise EngineError(f"duration {duration!r} and step {step!r} must be positive and finite")
    return np.linspace(0.0, duration, int(np.ceil(duration / step - 1e-9)) + 1)


# ---------------------------------------------------------------------------------------------- joints and the tree


@dataclass(frozen=True, eq=False)
class Edge:
    """Join two bodies so that the second frame's motion relative to the first is Rot(z, q) or Trans(z, q) or none."""

    joint: str
    kind: Kind
    bodies: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray]

    def reversed(self) -> Edge:
        """Return the same joint seen from the other body: half a turn about x keeps the sign of q."""
        (first, second), (near, far) = self.bodies, self.frames
        return Edge(self.joint, self.kind, (second, first), (far @ FLIP, near @ FLIP))


@dataclass(frozen=True)
class Tree:
    """Split the joints: `edges` reach every body from ground, depth first, parent before child; `cuts` close loops.

    Cut joints lead to a body, never to ground. A cut fixed joint closes a loop of fixed joints: it adds no constraint.
    """

    edges: tuple[Edge, ...]
    cuts: tuple[Edge, ...]


def pose_of(frame: Frame) -> np.ndarray:
    """Return the 4 x 4 pose of a frame."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(frame.rotation).as_matrix()
    pose[:3, 3] = frame.position
    return pose


def turn_z_to(axis: np.ndarray) -> np.ndarray:
    """Return a pose without translation whose z axis is the given unit axis."""
    pose = np.eye(4)
    if axis[2] < 1.0:
        x = np.cross(np.eye(3)[np.argmin(abs(axis))], axis)
        x /= np.linalg.norm(x)
        pose[:3, :3] = np.column_stack([x, np.cross(axis, x), axis])
    return pose


def edge(name: str, joint: Joint) -> Edge:
    """Turn a joint's frames so that z is its axis; a type without a counterpart here is refused."""
    if joint.type not in ("fixed", "revolute", "prismatic"):
        raise EngineError(f"joints.{name}: the engines know fixed, revolute and prismatic joints, not {joint.type}")
    turn = np.eye(4) if joint.type == "fixed" else turn_z_to(np.array(joint.axis))
    first, second = joint.frames
    return Edge(name, joint.type, joint.connects, (pose_of(first) @ turn, pose_of(second) @ turn))


def coordinates(mechanism: Mechanism) -> dict[str, int]:
    """Number the joint coordinates: the place of each joint that is not fixed."""
    moving = [name for name, joint in mechanism.joints.items() if joint.type != "fixed"]
    return {name: place for place, name in enumerate(moving)}


def actuated(mechanism: Mechanism) -> np.ndarray:
    """Return the places of the actuated joints among the joint coordinates, shape (n,)."""
    places = coordinates(mechanism)
    return np.array([places[name] for name in mechanism.actuators], dtype=int)


def spanning_tree(mechanism: Mechanism) -> Tree:
    """Choose a minimum spanning tree from ground by Prim's rule; the cut joints are revolute where possible.

    Fixed joints enter first, then actuated ones, then prismatic ones; among equals the chain nearest to ground grows.

    Raises:
        EngineError: a loop consists of actuated (and fixed) joints only, so that one of them would have to be cut.
    """
    edges = {name: edge(name, joint) for name, joint in mechanism.joints.items()}
    depth = {GROUND: 0}
    chosen: dict[str, Edge] = {}

    def cost(item: Edge) -> tuple[int, int]:
        order = {"fixed": 0, "prismatic": 2, "revolute": 3}
        return (1 if item.joint in mechanism.actuators else order[item.kind]), depth[item.bodies[0]]

    both = [e for item in edges.values() for e in (item, item.reversed())]
    while len(depth) <= len(mechanism.bodies):
        best = min((e for e in both if e.bodies[0] in depth and e.bodies[1] not in depth), key=cost)
        depth[best.bodies[1]] = depth[best.bodies[0]] + (best.kind != "fixed")
        chosen[best.joint] = best
    for name in mechanism.actuators:
        if name not in chosen:
            raise EngineError(f"actuators: {name!r} closes a loop of actuated joints; leave one of them unactuated")

    def below(body: str) -> list[Edge]:
        return [e for item in chosen.values() if item.bodies[0] == body for e in (item, *below(item.bodies[1]))]

    cuts = (item for name, item in edges.items() if name not in chosen)
    return Tree(tuple(below(GROUND)), tuple(cut if cut.bodies[1] != GROUND else cut.reversed() for cut in cuts))


def planar_loop(tree: Tree, cut: Edge) -> bool:
    """Tell whether a revolute cut joint closes a planar loop: revolutes parallel to it, prismatic ones across it.

    Turning about parallel axes leaves their directions alone, so that they may be compared with all coordinates zero.
    """
    up = {item.bodies[1]: item for item in tree.edges}

    def seen_from_ground(body: str) -> tuple[list[Edge], np.ndarray]:
        if body == GROUND:
            return [], np.eye(4)
        path, pose = seen_from_ground(up[body].bodies[0])
        return [*path, up[body]], pose @ up[body].frames[0] @ np.linalg.inv(up[body].frames[1])

    (left, pose), (right, other) = map(seen_from_ground, cut.bodies)
    loop = {e.joint: e for e in (*left, *right) if not (e in left and e in right)}.values()
    directions = {e.joint: (seen_from_ground(e.bodies[0])[1] @ e.frames[0])[:3, 2] for e in loop}
    normal, far = (pose @ cut.frames[0])[:3, 2], (other @ cut.frames[1])[:3, 2]
    straight = {"fixed": 0.0, "revolute": 1.0, "prismatic": 0.0}
    tilts = [abs(directions[e.joint] @ normal) - straight[e.kind] for e in loop if e.kind != "fixed"]
    return all(abs(tilt) < 1e-9 for tilt in (abs(far @ normal) - 1.0, *tilts))


@dataclass(frozen=True)
class Branch:
    """Carry one part of a body on a joint: the part's name and its share of the body's mass and inertia."""

    edge: Edge
    part: str
    share: float


@dataclass(frozen=True)
class Tie:
    """Close a loop between two parts of bodies: hold two points together, or two frames (a weld)."""

    kind: Literal["point", "weld"]
    parts: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray]


def branches(tree: Tree) -> tuple[Branch, ...]:
    """Return the joints of the tree and the cut prismatic joints, depth first, each with the part that it carries.

    Neither Pinocchio nor MuJoCo closes a loop with a sliding joint. Such a joint stays, leads to one part of its body,
    and the parts are welded; they share the body's mass equally, and the one in the tree bears the body's own name.
    """
    sliding = [cut for cut in tree.cuts if cut.kind == "prismatic"]
    parts = Counter((*(item.bodies[1] for item in tree.edges), *(cut.bodies[1] for cut in sliding)))

    def slides_from(body: str) -> list[Branch]:
        return [Branch(cut, part_of(cut), 1 / parts[cut.bodies[1]]) for cut in sliding if cut.bodies[0] == body]

    grown = slides_from(GROUND)
    for item in tree.edges:
        body = item.bodies[1]
        grown += [Branch(item, body, 1 / parts[body]), *slides_from(body)]
    return tuple(grown)


def ties(tree: Tree) -> tuple[Tie, ...]:
    """Return what closes the loops: a revolute joint ties one point (planar loop) or two on its axis, parts are welded."""
    closed = []
    for cut in tree.cuts:
        if cut.kind == "revolute":
            for arm in (0.0,) if planar_loop(tree, cut) else (-ARM / 2, ARM / 2):
                near, far = (frame @ joint_motion("prismatic", np.array(arm)) for frame in cut.frames)
                closed.append(Tie("point", cut.bodies, (near, far)))
        elif cut.kind == "prismatic":
            closed.append(Tie("weld", (cut.bodies[1], part_of(cut)), (np.eye(4), np.eye(4))))
    return tuple(closed)


def part_of(cut: Edge) -> str:
    """Name the part to which a cut prismatic joint leads; no body's name holds a dot."""
    return f"{cut.bodies[1]}.{cut.joint}"


def inertia_tensor(body: Body) -> np.ndarray:
    """Return the inertia tensor about the mass centre in the body's axes, shape (3, 3) [kg m^2].

    A planar body gives zz alone; its xx and yy play no part in the motion, and xx = yy = zz make a valid rigid body.
    """
    return body.inertia.zz * np.eye(3) if body.inertia.planar else body.inertia.tensor()


# ------------------------------------------------------------------------------------------------ motion of bodies


def along_tree(
    mechanism: Mechanism, tree: Tree, positions: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return poses, shape (..., r, 4, 4), and twists, shape (..., r, 6), of the bodies from the tree's joints.

    X_2 = X_1 F_1 J(q) F_2^-1;  omega_2 = omega_1 + q' z (revolute);  v_2 = v_1 + omega_1 x (p_2 - p_1) + the joint's
    own velocity at the second body's origin.
    """
    place = coordinates(mechanism)
    shape = positions.shape[:-1]
    poses = {GROUND: np.broadcast_to(np.eye(4), (*shape, 4, 4))}
    twists = {GROUND: np.zeros((*shape, 6))}
    for item in tree.edges:
        first, second = item.bodies
        near = poses[first] @ item.frames[0]
        q, v = (np.zeros(shape),) * 2
        if item.kind != "fixed":
            q, v = positions[..., place[item.joint]], rates[..., place[item.joint]]
        poses[second] = near @ joint_motion(item.kind, q) @ np.linalg.inv(item.frames[1])
        screw = near[..., :3, 2] * v[..., None]
        omega, origin = twists[first][..., :3], poses[second][..., :3, 3]
        linear = twists[first][..., 3:] + np.cross(omega, origin - poses[first][..., :3, 3])
        if item.kind == "revolute":
            linear, omega = linear + np.cross(screw, origin - near[..., :3, 3]), omega + screw
        elif item.kind == "prismatic":
            linear = linear + screw
        twists[second] = np.concatenate([omega, linear], axis=-1)
    names = tuple(mechanism.bodies)
    return np.stack([poses[n] for n in names], axis=-3), np.stack([twists[n] for n in names], axis=-2)


def joint_motion(kind: Kind, q: np.ndarray) -> np.ndarray:
    """Return Rot(z, q), Trans(z, q) or the identity, shape (..., 4, 4)."""
    motion = np.zeros((*q.shape, 4, 4))
    motion[...] = np.eye(4)
    if kind == "revolute":
        motion[..., 0, 0] = motion[..., 1, 1] = np.cos(q)
        motion[..., 1, 0] = np.sin(q)
        motion[..., 0, 1] = -motion[..., 1, 0]
    elif kind == "prismatic":
        motion[..., 2, 3] = q
    return motion


@dataclass(frozen=True)
class JointMotion:
    """Hold what the bodies' motion says of the joints: coordinates, rates and accelerations (k, m), gaps [m], [rad]."""

    positions: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    closure_error: float
    alignment_error: float


@dataclass(frozen=True)
class BodyMotion:
    """Hold poses, shape (k, r, 4, 4), twists and their derivatives, shape (k, r, 6), of the bodies' origins."""

    mechanism: Mechanism
    poses: np.ndarray
    twists: np.ndarray
    accelerations: np.ndarray

    def frame(self, body: str, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pose, twist and the twist's derivative of a frame fixed in a body."""
        if body == GROUND:
            still = np.zeros((len(self.poses), 6))
            return np.broadcast_to(frame, (len(self.poses), 4, 4)), still, still
        index = tuple(self.mechanism.bodies).index(body)
        pose = self.poses[:, index] @ frame
        arm = pose[:, :3, 3] - self.poses[:, index, :3, 3]
        omega, velocity = np.split(self.twists[:, index], 2, axis=-1)
        alpha, acceleration = np.split(self.accelerations[:, index], 2, axis=-1)
        velocity = velocity + np.cross(omega, arm)
        acceleration = acceleration + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
        return pose, np.hstack([omega, velocity]), np.hstack([alpha, acceleration])

    def across(self, item: Edge) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pose X_12, twist and its derivative of a joint's second frame, seen and resolved in its first.

        d = p_2 - p_1;  v_12 = v_2 - v_1 - omega_1 x d;
        a_12 = a_2 - a_1 - alpha_1 x d - omega_1 x (omega_1 x d) - 2 omega_1 x v_12;
        alpha_12 = alpha_2 - alpha_1 - omega_1 x omega_12.
        """
        (near, twist, change), (far, other, rise) = map(self.frame, item.bodies, item.frames)
        omega, alpha = twist[:, :3], change[:, :3]
        d = far[:, :3, 3] - near[:, :3, 3]
        turning, sliding = other[:, :3] - omega, other[:, 3:] - twist[:, 3:] - np.cross(omega, d)
        spin_up = rise[:, :3] - alpha - np.cross(omega, turning)
        speed_up = rise[:, 3:] - change[:, 3:] - np.cross(alpha, d) - np.cross(omega, np.cross(omega, d) + 2 * sliding)
        back = np.swapaxes(near[:, :3, :3], 1, 2)

        def seen(*vectors: np.ndarray) -> np.ndarray:
            return np.hstack([(back @ vector[:, :, None])[:, :, 0] for vector in vectors])

        return np.linalg.inv(near) @ far, seen(turning, sliding), seen(spin_up, speed_up)

    def joints(self, start: np.ndarray) -> JointMotion:
        """Read the joints off; angles are continuous in time and begin within half a turn of `start`, shape (m,)."""
        columns, gaps, tilts = [], [], []
        for name, joint in self.mechanism.joints.items():
            item = edge(name, joint)
            pose, twist, change = self.across(item)
            free = {"revolute": 2, "prismatic": 5}.get(item.kind)
            if item.kind == "revolute":
                turn = np.unwrap(np.arctan2(pose[:, 1, 0], pose[:, 0, 0]))
                coordinate = turn + 2 * np.pi * np.round((start[len(columns)] - turn[0]) / (2 * np.pi))
                tilts.append(pose[:, :2, 2])
            else:
                coordinate = pose[:, 2, 3]
                tilts.append((pose[:, (2, 0, 1), (1, 2, 0)] - pose[:, (1, 2, 0), (2, 0, 1)]) / 2)
            gaps.append(pose[:, : 2 if item.kind == "prismatic" else 3, 3])
            if free is not None:
                columns.append((coordinate, twist[:, free], change[:, free]))
        positions, rates, accelerations = (np.column_stack(series) for series in zip(*columns, strict=True))
        return JointMotion(positions, rates, accelerations, largest(gaps), largest(tilts))


def largest(series: list[np.ndarray]) -> float:
    """Return the greatest length among the vectors in lists of them."""
    return max(float(np.max(np.linalg.norm(vectors, axis=-1))) for vectors in series)


def run_on_tree(
    mechanism: Mechanism,
    tree: Tree,
    time: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray],
    accelerations: np.ndarray,
    seconds: float,
) -> EngineRun:
    """Complete a run of an engine that moves a tree.

    Args:
        motion: positions and rates, shape (k, m), of which the columns of the tree's joints are filled.
        accelerations: of the actuated joints, shape (k, n).
    """
    poses, twists = along_tree(mechanism, tree, *motion)
    joints = BodyMotion(mechanism, poses, twists, np.zeros_like(twists)).joints(motion[0][0])
    return EngineRun(
        time=time,
        positions=joints.positions,
        rates=joints.rates,
        accelerations=accelerations,
        body_poses=poses,
        closure_error=joints.closure_error,
        alignment_error=joints.alignment_error,
        seconds=seconds,
    )
