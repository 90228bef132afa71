"""How Pinocchio holds a mechanism: one tree that it moves, and ties that close its loops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.lab.engines.carried import Carried, carry
from linkwork.lab.engines.motion import BodyMotion, along_tree
from linkwork.lab.engines.start import Guess
from linkwork.lab.engines.tree import (
    CarriedPart,
    EngineTie,
    EngineTree,
    branches,
    spanning_tree,
    ties,
)
from linkwork.lab.engines.vectors import Drives, JointForces, Quaternion, Vectors
from linkwork.mechanism import Mechanism


@dataclass(frozen=True)
class EnginePlan:
    """Hold a mechanism as a tree with ties.

    Attributes:
        carried, tree: what the engine moves.
        branches, ties: what the engine has to set up.
        vectors, joint_forces: the engine's q and v, and the forces of springs and friction in its
            joints.
        drives: the actuators' places in v.
    """

    carried: Carried
    tree: EngineTree
    branches: tuple[CarriedPart, ...]
    ties: tuple[EngineTie, ...]
    vectors: Vectors
    joint_forces: JointForces
    drives: Drives

    def state(self, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the engine's q and v at a state of the described joints, shapes (nq,) and
        (nv,)."""
        return self.vectors.into(*self.carried.state(positions, rates))

    def forces(self, q: np.ndarray, v: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return tau (nv,) of the actuators and of springs and friction in the joints."""
        tau = self.vectors.forces(q, self.drives, forces)
        self.joint_forces.add_to(tau, q, v)
        return tau

    def actuated(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the derivatives of the actuated rates (..., n) from the engine's q, v and v'."""
        return self.vectors.out_of(q, v, a)[2][..., self.carried.actuated]

    def bodies(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> BodyMotion:
        """Return the motion of all carried bodies from the engine's q, v and v', at k instants."""
        return along_tree(self.carried.whole, self.tree, *self.vectors.out_of(q, v, a))


def plan(mechanism: Mechanism, order: Quaternion, guess: Guess) -> EnginePlan:
    """Plan a mechanism for an engine.

    Args:
        mechanism: the description.
        order: places of w, x, y, z in the engine's quaternions.
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where
            left out.
    """
    carried = carry(mechanism, guess)
    tree = spanning_tree(carried.whole)
    grown = branches(tree)
    vectors = Vectors.of(
        carried.whole, [step for branch in grown for step in branch.edge.steps], order
    )
    return EnginePlan(
        carried=carried,
        tree=tree,
        branches=grown,
        ties=ties(tree),
        vectors=vectors,
        joint_forces=JointForces.of(vectors),
        drives=vectors.drives(mechanism.actuators),
    )
