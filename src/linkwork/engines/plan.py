"""How Pinocchio and MuJoCo hold a mechanism: one tree that they move, and ties that close its loops.

The description is carried out with free joints for bodies that only rods reach and with links for rods; both add
coordinates, which follow from those of the described joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.engines.interface import EngineRun, checked
from linkwork.engines.joints import Step
from linkwork.engines.motion import BodyMotion, JointMotion, along_tree, places, read_joints
from linkwork.engines.rewrite import with_free_joints, with_links
from linkwork.engines.start import Guess, bodies_at, with_link_motion
from linkwork.engines.tree import Branch, Tie, Tree, branches, spanning_tree, ties
from linkwork.engines.vectors import Drives, JointForces, Quaternion, Vectors
from linkwork.mechanism import Mechanism


@dataclass(frozen=True)
class Plan:
    """Hold a mechanism as a tree with ties.

    Attributes:
        mechanism: the description.
        hanging, hanging_tree: with free joints for the bodies `hung` that only rods reach; where its bodies are is
            known from the joints.
        carried, tree: with links for rods; what the engine moves.
        branches, ties: what the engine has to set up.
        vectors, joint_forces: the engine's q and v, and the forces of springs and friction in its joints.
        drives: the actuators' places in v.
        guess: approximate poses (4, 4) of the hung bodies.
    """

    mechanism: Mechanism
    hanging: Mechanism
    hanging_tree: Tree
    hung: tuple[str, ...]
    carried: Mechanism
    tree: Tree
    branches: tuple[Branch, ...]
    ties: tuple[Tie, ...]
    vectors: Vectors
    joint_forces: JointForces
    drives: Drives
    guess: Guess

    def state(self, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the engine's q and v at a state of the described joints, shapes (nq,) and (nv,)."""
        positions, rates = checked(self.mechanism, positions, rates)
        if self.carried is not self.mechanism:
            motion = bodies_at(self.hanging, self.hanging_tree, positions, rates, self.hung, self.guess)
            if self.carried is not self.hanging:
                motion = with_link_motion(self.hanging, self.carried, motion)
            added = read_joints(self.carried, motion.at_one_instant(), np.zeros(len(self.carried.coordinates)))
            positions = np.concatenate([positions, added.positions[0, len(positions) :]])
            rates = np.concatenate([rates, added.rates[0, len(rates) :]])
        return self.vectors.into(positions, rates)

    def forces(self, q: np.ndarray, v: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return tau (nv,) of the actuators and of springs and friction in the joints."""
        tau = self.vectors.forces(q, self.drives, forces)
        self.joint_forces.add_to(tau, q, v)
        return tau

    def actuated(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the derivatives of the actuated rates (..., n) from the engine's q, v and v'."""
        place = places(self.carried.rates)
        return self.vectors.out_of(q, v, a)[2][..., [place[name] for name in self.mechanism.actuators]]

    def bodies(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> BodyMotion:
        """Return the motion of all carried bodies from the engine's q, v and v', at k instants."""
        return along_tree(self.carried, self.tree, *self.vectors.out_of(q, v, a))

    def joints(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, start: np.ndarray) -> JointMotion:
        """Return the described joints' motion from the engine's q, v and v', at k instants."""
        return read_joints(self.mechanism, self.bodies(q, v, a), start)

    def run(
        self, time: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, start: np.ndarray, seconds: float
    ) -> EngineRun:
        """Complete a run from the engine's q, v and v' at the instants; it began at `start`, all joints' coordinates."""
        motion = self.bodies(q, v, a)
        joints = read_joints(self.mechanism, motion, start)
        return EngineRun(
            time=time,
            positions=joints.positions,
            rates=joints.rates,
            joint_accelerations=joints.accelerations,
            accelerations=self.actuated(q, v, a),
            body_poses=motion.poses[:, : len(self.mechanism.bodies)],
            closure_error=joints.closure_error,
            alignment_error=joints.alignment_error,
            seconds=seconds,
        )


def plan(mechanism: Mechanism, order: Quaternion, guess: Guess, split_screws: bool = False) -> Plan:
    """Plan a mechanism for an engine.

    Args:
        mechanism: the description.
        order: places of w, x, y, z in the engine's quaternions.
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where left out.
        split_screws: the engine has no screws, but a turn and a slide that follows it.
    """
    hanging, hung = with_free_joints(mechanism)
    carried = with_links(hanging)
    tree = spanning_tree(carried)
    grown = branches(tree)
    steps = [step for branch in grown for step in branch.edge.steps]
    vectors = Vectors.of(carried, split(steps) if split_screws else steps, order)
    return Plan(
        mechanism=mechanism,
        hanging=hanging,
        hanging_tree=tree if carried is hanging else spanning_tree(hanging),
        hung=hung,
        carried=carried,
        tree=tree,
        branches=grown,
        ties=ties(tree),
        vectors=vectors,
        joint_forces=JointForces.of(vectors),
        drives=vectors.drives(mechanism.actuators),
        guess=guess,
    )


def split(steps: Sequence[Step]) -> list[Step]:
    """Replace every screw by a turn and a slide of `pitch` times its angle."""
    return [part for step in steps for part in (step.halves() if step.motion == "screw" else (step,))]
