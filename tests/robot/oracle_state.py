"""A robot's state as the oracle of maximal coordinates sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import linkwork as lw

from tests.equations.evaluation import close
from tests.oracle.maximal import MaximalOracle, Poses, Twists


@dataclass(frozen=True)
class Seen:
    """Hold the oracle with the poses and twists of a robot's state, which are checked to fit all
    joints."""

    robot: lw.Robot
    state: lw.State
    oracle: MaximalOracle
    poses: Poses
    twists: Twists

    @classmethod
    def of(cls, robot: lw.Robot, state: lw.State) -> Seen:
        oracle = MaximalOracle(
            robot.mechanism, dict(zip(robot.coordinates, state.positions, strict=True))
        )
        poses = robot.body_poses(state)
        twists = {
            name: (t[:3], t[3:]) for name, t in zip(robot.bodies, robot.twists(state), strict=True)
        }
        assert (
            max((np.abs(gap).max(initial=0) for gap in oracle.residuals(poses).values()), default=0)
            < 1e-11
        )
        assert oracle.constraint_velocity_error(poses, twists) < 1e-10
        return cls(robot, state, oracle, poses, twists)

    def joint_accelerations(self, forces) -> np.ndarray:
        """Return the accelerations of all joints under actuator forces."""
        accelerations = self.oracle.accelerations(self.poses, self.twists, forces)
        return self.oracle.joint_accelerations(self.poses, self.twists, accelerations)

    def inverse_dynamics(self, accelerations: dict[str, float]) -> np.ndarray:
        """Return the least actuator forces for accelerations of rates, by name."""
        bodies = self.oracle.accelerations_of(self.poses, self.twists, accelerations)
        return self.oracle.inverse_dynamics(self.poses, self.twists, bodies)

    def agree(self, forces, tolerance: float) -> None:
        """Compare coordinates, rates, accelerations under forces and energies of the robot with the
        oracle's."""
        robot, state = self.robot, self.state
        close(state.positions, self.oracle.coordinates(self.poses), tolerance)
        close(robot.joint_rates(state), self.oracle.rates(self.poses, self.twists), tolerance)
        found = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
        close(found, self.joint_accelerations(forces), tolerance)
        close(np.array(robot.energy(state)), self.oracle.energy(self.poses, self.twists), tolerance)
