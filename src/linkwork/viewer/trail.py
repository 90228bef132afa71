"""The trail of a robot's tools: where they were along a run until now, or where a hand led them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from linkwork.robot import Robot, State
from linkwork.viewer.replay import Replay

PLACES = 400  # of a run at which the tools' places are taken at least
MOST = 2000  # places of the trail of a hand that are kept, and of a run that are taken at most


def tool_points(robot: Robot, state: State) -> np.ndarray:
    """Return the origins (tools, 3) of all tools' frames in the ground's axes [m]."""
    poses = robot.body_poses(state)
    return np.array(
        [
            poses[tool.body][0] + poses[tool.body][1] @ np.array(tool.frame.position)
            for tool in robot.mechanism.tools.values()
        ]
    ).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class RunTrail:
    """Tell where the tools are along a run.

    Between samples of a run that has few of them the loops are closed, as they are where it is
    played.
    """

    replay: Replay

    @cached_property
    def time(self) -> np.ndarray:
        samples = self.replay.time
        if len(samples) >= PLACES:
            return samples[np.unique(np.linspace(0, len(samples) - 1, MOST).astype(int))]
        return np.union1d(samples, np.linspace(samples[0], samples[-1], PLACES))

    @cached_property
    def points(self) -> np.ndarray:
        """Places (K, tools, 3) at `time` [m]."""
        return np.array([tool_points(self.replay.robot, self.replay.state(t)) for t in self.time])

    def until(self, now: float) -> np.ndarray:
        """Return the places (k, tools, 3) before a time [s]."""
        return self.points[: np.searchsorted(self.time, now)]


@dataclass(eq=False)
class HandTrail:
    """Keep where a hand has led the tools, one after the other; the oldest places go first."""

    points: list[np.ndarray] = field(default_factory=list)

    def add(self, points: np.ndarray) -> None:
        self.points = [*self.points[-MOST + 1 :], points]


def segments(points: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Return the lines (s, 2, 3) along places (k, tools, 3) and from the last one to here
    (tools, 3)."""
    along = np.concatenate([points.reshape(len(points), *here.shape), here[None]])
    return np.stack([along[:-1], along[1:]], axis=2).reshape(-1, 2, 3)
