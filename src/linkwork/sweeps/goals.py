"""Goals of a study: where its controllers lead the robot, as records of a file; a robot resolves
them to states or motions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from linkwork import paths
from linkwork.control.plant import Plant
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import PathName, Real, Record
from linkwork.simulation import Sampled

Numbers = tuple[Real, ...]
FEWEST, MOST = 16, 2**16  # intervals between the times that tell how a path is run through
CLOSE, ROUNDING = 1e-5, 1e-10  # how far a spline through them may be off: of a range; own units


class Goal(Record, ABC):
    """Say where the robot is led to."""

    @abstractmethod
    def reached(self, robot: Plant, start: Any, duration: float, samples: int) -> Any:
        """Return a state or a motion; start: where to look for it from; samples: how many times a
        motion has, or a whole number of intervals for each of theirs."""


class Pose(Goal):
    """Hold a pose, of the tool [m, rad] or of joints by name; left out, where runs start."""

    type: Literal["pose"] = "pose"
    tool: Numbers | None = Field(default=None, description="pose of the tool [m, rad]")
    joints: Mapping[PathName, Real] | None = Field(
        default=None, description="joint coordinates by name [m, rad]"
    )

    def reached(self, robot, start, duration, samples) -> Any:
        return start if self == Pose() else robot.assemble(self.joints, tool=self.tool, guess=start)


class AlongPath(Goal, ABC):
    """Lead the tool along a path, from rest to rest over the whole run."""

    @property
    @abstractmethod
    def path(self) -> paths.Path:
        """The path."""

    def reached(self, robot, start, duration, samples) -> Any:
        def led(count: int) -> Any:
            return robot.follow(self.path, duration, samples=count, guess=start)

        return told(led, robot, samples)


class Line(AlongPath):
    """Lead the tool straight from one pose to another [m, rad]."""

    type: Literal["line"] = "line"
    start: Numbers = Field(description="the first pose [m, rad]")
    end: Numbers = Field(description="the last pose [m, rad]")

    @property
    def path(self) -> paths.Path:
        return paths.line(self.start, self.end)


class Circle(AlongPath):
    """Lead the tool around a circle: centre, radius [m], orientation [rad], turns."""

    type: Literal["circle"] = "circle"
    centre: Numbers = Field(description="the centre [m]")
    radius: Real = Field(description="the radius [m]")
    orientation: Real | Numbers | None = Field(
        default=None,
        description="angle, or rotation vector [rad], or what the tool's task has of it",
    )
    turns: Real = Field(default=1.0, description="number of turns")

    @property
    def path(self) -> paths.Path:
        return paths.circle(self.centre, self.radius, self.orientation, turns=self.turns)


class Through(AlongPath):
    """Lead the tool through four poses or more [m, rad]."""

    type: Literal["through"] = "through"
    poses: tuple[Numbers, ...] = Field(description="poses [m, rad]")

    @property
    def path(self) -> paths.Path:
        return paths.through(self.poses)


def told(led: Callable[[int], Any], robot: Plant, samples: int) -> Any:
    """Return a motion of so many samples, or of so many intervals for each of theirs, that the
    spline through them, which controllers follow, is the way between them, too.

    Args:
        led: gives the motion of a number of samples; robot: that is led.
        samples: how many there are at least.

    Raises:
        LinkworkError: a way that no number of samples tells.
    """
    intervals = samples - 1
    while intervals < FEWEST:
        intervals *= 2
    motion = led(intervals + 1)
    while intervals < MOST:
        finer = led(2 * intervals + 1)
        if near_spline(motion, finer, robot):
            return motion
        motion, intervals = finer, 2 * intervals
    if intervals > samples - 1:
        raise LinkworkError(
            f"the path turns too often to be led along it: {MOST} samples do not tell the way "
            "between them; give fewer turns, or a path in parts"
        )
    return motion


def near_spline(motion: Any, finer: Any, robot: Plant) -> bool:
    """Tell whether the spline through a motion's samples has the driven joints, or the tool where
    none has a coordinate, where a finer motion has them."""
    driven = [name for name in robot.actuators if name in motion.state.coordinates]
    led, found = (
        np.stack([each.state[name] for name in driven] or [*each.tool.T], axis=-1)
        for each in (motion, finer)
    )
    lengths = [robot.unit(name) == "m" for name in driven] or [
        name in "xyz" for name in motion.what
    ]
    rounding = ROUNDING * np.where(lengths, robot.equations.tree.length, 1.0)
    off = np.abs(Sampled(motion.time, led)(finer.time) - found)
    return bool((off <= CLOSE * np.ptp(found, axis=0) + rounding).all())


AnyGoal = Annotated[Pose | Line | Circle | Through, Field(discriminator="type")]
