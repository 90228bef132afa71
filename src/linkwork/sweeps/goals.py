"""Goals of a study: where its controllers lead the robot, as records of a file; a robot resolves
them to states or motions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from linkwork import paths
from linkwork.control.plant import Plant
from linkwork.mechanism.record import PathName, Real, Record

Numbers = tuple[Real, ...]


class Goal(Record, ABC):
    """Say where the robot is led to."""

    @abstractmethod
    def reached(self, robot: Plant, start: Any, duration: float, samples: int) -> Any:
        """Return a state or a motion; start: where to look for it from."""


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
        return robot.follow(self.path, duration, samples=samples, guess=start)


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


AnyGoal = Annotated[Pose | Line | Circle | Through, Field(discriminator="type")]
