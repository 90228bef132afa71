"""What Pinocchio and MuJoCo carry out: the description with free joints for bodies that only rods
reach, and links for rods.

Both add coordinates, which follow from those of the described joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from linkwork.equations.fluid import felt
from linkwork.lab.engines.interface import EngineError, EngineRun, checked
from linkwork.lab.engines.motion import BodyMotion, JointMotion, places, read_joints
from linkwork.lab.engines.rewrite import with_free_joints, with_links
from linkwork.lab.engines.start import Guess, bodies_at, with_link_motion
from linkwork.lab.engines.tree import EngineTree, spanning_tree
from linkwork.mechanism import Mechanism
from linkwork.mechanism.bearing import bearings
from linkwork.mechanism.limits import meetings


@dataclass(frozen=True)
class Carried:
    """Hold a mechanism in the words that an engine knows.

    Attributes:
        mechanism: the description.
        hanging, tree: with free joints for the bodies `hung` that only rods reach; where its bodies
            are is known from the joints.
        whole: with links for rods, too; its first coordinates, rates and bodies are the
            description's.
        guess: approximate poses (4, 4) of the hung bodies.
    """

    mechanism: Mechanism
    hanging: Mechanism
    tree: EngineTree
    hung: tuple[str, ...]
    whole: Mechanism
    guess: Guess

    def state(self, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return all coordinates and rates of the whole at a state of the described joints, shapes
        (nq,) and (nv,)."""
        positions, rates = checked(self.mechanism, positions, rates)
        if self.whole is self.mechanism:
            return positions, rates
        return self.joints(
            bodies_at(self.hanging, self.tree, positions, rates, self.hung, self.guess),
            positions,
            rates,
        )

    def joints(
        self, hanging: BodyMotion, positions: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Add the coordinates and rates of the joints that the description lacks, from the motion
        of the hanging bodies."""
        motion = (
            hanging
            if self.whole is self.hanging
            else with_link_motion(self.hanging, self.whole, hanging)
        )
        added = read_joints(
            self.whole, motion.at_one_instant(), np.zeros(len(self.whole.coordinates))
        )
        return (
            np.concatenate([positions, added.positions[0, len(positions) :]]),
            np.concatenate([rates, added.rates[0, len(rates) :]]),
        )

    @cached_property
    def actuated(self) -> list[int]:
        """Return the places of the actuated rates among all rates of the whole."""
        place = places(self.whole.rates)
        return [place[name] for name in self.mechanism.actuators]


def carry(mechanism: Mechanism, guess: Guess) -> Carried:
    """Rewrite a mechanism for an engine that has no rods.

    Raises:
        EngineError: a body has no mass that its rods could borrow, or there are stops,
            contacts, static friction, bristles, bearings or a fluid.
    """
    for name in meetings(mechanism):
        raise EngineError(f"{name}: engines stop by laws of their own; compare without stops")
    for name, joint in mechanism.joints.items():
        effects = joint.effects().values()
        if any((*own.friction.powers, *own.spring.powers) for own in effects):
            raise EngineError(
                f"joints.{name}: engines have linear springs and viscous friction alone; compare "
                "without their powers"
            )
        if any(own.friction.static or own.friction.bristle for own in effects):
            raise EngineError(
                f"joints.{name}: engines have no friction with a rise or bristles; compare without"
            )
    for name in bearings(mechanism.joints):
        raise EngineError(f"joints.{name}: engines have no friction by load; compare without")
    if felt(mechanism):
        raise EngineError("fluid: not every engine has one; compare without")
    hanging, hung = with_free_joints(mechanism)
    return Carried(mechanism, hanging, spanning_tree(hanging), hung, with_links(hanging), guess)


class Translation(Protocol):
    """Translate between the described joints and an engine's q and v."""

    @property
    def carried(self) -> Carried: ...

    def actuated(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray: ...

    def bodies(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> BodyMotion: ...


def joints_of(
    plan: Translation, q: np.ndarray, v: np.ndarray, a: np.ndarray, start: np.ndarray
) -> JointMotion:
    """Return the described joints' motion from the engine's q, v and v', at k instants."""
    return read_joints(plan.carried.mechanism, plan.bodies(q, v, a), start)


def run_of(
    plan: Translation,
    time: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    start: np.ndarray,
    seconds: float,
) -> EngineRun:
    """Complete a run from the engine's q, v and v' at the instants; it began at `start`, all
    joints' coordinates."""
    motion, mechanism = plan.bodies(q, v, a), plan.carried.mechanism
    joints = read_joints(mechanism, motion, start)
    return EngineRun(
        time=time,
        positions=joints.positions,
        rates=joints.rates,
        joint_accelerations=joints.accelerations,
        accelerations=plan.actuated(q, v, a),
        body_poses=motion.poses[:, : len(mechanism.bodies)],
        closure_error=joints.closure_error,
        alignment_error=joints.alignment_error,
        seconds=seconds,
    )
