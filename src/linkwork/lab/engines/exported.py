"""The joints of an exported MJCF model in the description's terms: its qpos, qvel and qacc, and
what acts from outside.

MuJoCo measures a ball from home, in the axes of the body that it carries. With the joint's frames
F1 and F2 (F2 and F1 for a ball that leads backwards) and the body B in ground at home,

    R_mujoco = A R B',   v_mujoco = B R' w,   A = R_B' R_F1,   B = R_B' R_F2

where R = R_12 and w is in F1's axes.

A free joint of MuJoCo holds the body's own pose, its velocity in ground's axes and its angular
velocity in its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.formats.mjcf.model_plan import ADVANCE, Home, ModelPlan
from linkwork.formats.mjcf.writer import home_of
from linkwork.lab.engines.carried import Carried
from linkwork.lab.engines.joints import Edge, Step, edge
from linkwork.lab.engines.motion import BodyMotion, Moving, along_tree, applied, read_joints
from linkwork.lab.engines.start import with_link_motion
from linkwork.lab.engines.tree import EngineTree
from linkwork.lab.engines.vectors import JointForces, StepPlaces, Vectors
from linkwork.mechanism import GROUND, Mechanism

QUATERNION = (0, 1, 2, 3)  # places of w, x, y, z


@dataclass(frozen=True)
class Layout:
    """Translate between the described joints and a model's qpos and qvel; leading dimensions are
    kept.

    Attributes:
        carried, tree: what the model holds, and the joints that carry its bodies.
        vectors: the turns, slides and balls in the joints' own axes, with the effects that act from
            outside.
        joint_forces: the forces of these effects.
        q, v: places of the vectors' entries in qpos and qvel.
        balls: the balls with A and B.
        floats: places in qpos and qvel of the bodies that float on joints of MuJoCo's own.
        sizes: of qpos and qvel.
    """

    carried: Carried
    tree: EngineTree
    vectors: Vectors
    joint_forces: JointForces
    q: np.ndarray
    v: np.ndarray
    balls: tuple[tuple[StepPlaces, np.ndarray, np.ndarray], ...]
    floats: Mapping[str, tuple[slice, slice]]
    sizes: tuple[int, int]

    def state(self, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return qpos and qvel at a state of the described joints, shapes (nq,) and (nv,)."""
        positions, rates = self.carried.state(positions, rates)
        own = self.vectors.into(positions, rates)
        for ball, A, B in self.balls:
            own[0][ball.q] = quaternions(A @ self.vectors.rotation(own[0], ball) @ B.T)
            own[1][ball.v] = B @ own[1][ball.v]
        q, v = map(np.empty, self.sizes)
        q[self.q], v[self.v] = own
        if self.floats:
            motion = along_tree(self.carried.whole, self.tree, positions, rates)
            for body, (place, speed) in self.floats.items():
                pose, twist, _ = motion.frame(body, np.eye(4))
                q[place] = *pose[:3, 3], *quaternions(pose[:3, :3])
                v[speed] = *twist[3:], *(twist[:3] @ pose[:3, :3])
        return q, v

    def forces(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return qfrc_applied (nv,) of the springs and friction that the model does not hold."""
        own, tau = np.zeros(len(self.v)), np.zeros(self.sizes[1])
        self.joint_forces.add_to(own, *self._in_joints(q, v))
        for ball, _, B in self.balls:
            own[ball.v] = B @ own[ball.v]
        tau[self.v] = own
        return tau

    def actuated(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the derivatives of the actuated rates (..., n) from qpos, qvel and qacc."""
        return self.vectors.out_of(*self._in_joints(q, v, a))[2][..., self.carried.actuated]

    def bodies(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> BodyMotion:
        """Return the motion of all carried bodies from qpos, qvel and qacc."""
        floating = {
            body: floated(q[..., place], v[..., speed], a[..., speed])
            for body, (place, speed) in self.floats.items()
        }
        joints = self.vectors.out_of(*self._in_joints(q, v, a))
        return along_tree(self.carried.whole, self.tree, *joints, floating)

    def _in_joints(self, q: np.ndarray, *speeds: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return q, and rates or accelerations, of turns, slides and balls in the joints' own
        axes."""
        q, own = q[..., self.q], [values[..., self.v] for values in speeds]
        for ball, A, B in self.balls:
            q[..., ball.q] = quaternions(A.T @ self.vectors.rotation(q, ball) @ B)
            for values in own:
                values[..., ball.v] = values[..., ball.v] @ B
        return q, *own


def quaternions(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternions (..., 4), w first, of rotation matrices."""
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return flat.reshape(*R.shape[:-2], 4)


def floated(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Moving:
    """Return the motion of a body from its free joint's qpos (..., 7), qvel and qacc (..., 6)."""
    R = (
        Rotation.from_quat(q[..., 3:].reshape(-1, 4), scalar_first=True)
        .as_matrix()
        .reshape(*q.shape[:-1], 3, 3)
    )
    pose = np.array(np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4)))
    pose[..., :3, :3], pose[..., :3, 3] = R, q[..., :3]
    return Moving(pose, applied(R, v[..., 3:]), v[..., :3], applied(R, a[..., 3:]), a[..., :3])


def home_with_links(carried: Carried) -> Home:
    """Close the loops of the description, and add the joints and links that it lacks."""
    home, names = home_of(carried.mechanism), tuple(carried.mechanism.bodies)
    poses, still = np.stack([home.poses[body] for body in names]), np.zeros((len(names), 6))
    motion = BodyMotion(names, poses, still, still)
    if carried.whole is not carried.hanging:
        motion = with_link_motion(carried.hanging, carried.whole, motion)
    start = np.zeros(len(carried.whole.coordinates))
    start[: len(home.coordinates)] = list(home.coordinates.values())
    read = read_joints(carried.whole, motion.at_one_instant(), start).positions[0]
    coordinates = dict(zip(carried.whole.coordinates, map(float, read), strict=True))
    placed = zip(motion.names, motion.poses, strict=True)
    return Home({GROUND: np.eye(4), **dict(placed)}, {**coordinates, **home.coordinates})


def layout(carried: Carried, outside: Mechanism, home: Home, plan: ModelPlan, model: Any) -> Layout:
    """Lay out an exported model.

    Args:
        carried: what was exported.
        outside: the same joints with the effects that act from outside.
        home: the configuration in which it was exported.
        plan: how the model holds it.
        model: MuJoCo's.
    """
    # Our joints as the export stacked them, their steps by the names of MuJoCo's joints.
    items = {name: outward(edge(name, joint), plan) for name, joint in carried.whole.pairs.items()}
    steps = {title: (item, step) for item in items.values() for title, step in titled(item)}
    # Where MuJoCo has the coordinates and rates of each step.
    found, frames, floats = [], {}, {}
    q, v = [np.zeros(0, int)], [np.zeros(0, int)]
    for seat in plan.seats.values():
        for move in seat.moves:
            at = int(model.joint(move.name).qposadr[0])
            speed = int(model.joint(move.name).dofadr[0])
            # A floating body is read off its pose.
            if move.kind == "free":
                floats[seat.body] = slice(at, at + 7), slice(speed, speed + 6)
                continue
            item, step = steps[move.name]
            found.append(step)
            q.append(np.arange(at, at + len(step.coordinates)))
            v.append(np.arange(speed, speed + len(step.rates)))
            # The turn of a ball is told between the joint's frames, not between the bodies'.
            if move.kind == "ball":
                placed = (home.poses[b] @ F for b, F in zip(item.bodies, item.frames, strict=True))
                frames[step.rates] = [home.poses[seat.body][:3, :3].T @ X[:3, :3] for X in placed]
    vectors = Vectors.of(outside, found, QUATERNION)
    return Layout(
        carried=carried,
        tree=EngineTree(tuple(items[name] for name in plan.tree), (), frozenset()),
        vectors=vectors,
        joint_forces=JointForces.of(vectors),
        q=np.concatenate(q),
        v=np.concatenate(v),
        balls=tuple((ball, *frames[ball.step.rates]) for ball in vectors.balls),
        floats=floats,
        sizes=(model.nq, model.nv),
    )


def outward(item: Edge, plan: ModelPlan) -> Edge:
    """Return a joint seen from the body that carries the other one in the model."""
    if item.joint in plan.tree:
        return item if item.bodies == plan.tree[item.joint] else item.reversed()
    return item if item.bodies[1] != GROUND else item.reversed()


def titled(item: Edge) -> list[tuple[str, Step]]:
    """Return the steps of a joint with the names of MuJoCo's joints."""
    titles = []
    for step in item.steps:
        match step.motion:
            case "screw":
                titles += zip(
                    (step.coordinates[0], f"{item.joint}.{ADVANCE}"), step.halves(), strict=True
                )
            case "ball":
                alone = len(item.steps) == 1
                titles.append((item.joint if alone else f"{item.joint}.turn", step))
            case _:
                titles.append((step.coordinates[0], step))
    return titles
