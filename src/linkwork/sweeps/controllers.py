"""What leads the robot in a study: goals, controllers and drives as records of a file, and what they stand for.

The models of controllers are the robot of the study with the numbers that its file gives, whatever varies in the robot
that is controlled; `model` changes numbers of them, by path.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Literal

from pydantic import Field

from linkwork import control, paths
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import MechanismError, Name, PathName, Real, Record
from linkwork.mechanism.refusal import suggestion
from linkwork.robot import Motion, Robot, State

Numbers = tuple[Real, ...]
Gain = Real | Mapping[Name, Real]
GAIN = "a number, or one by actuator"
MODEL = "numbers of the model that differ from the robot's, by path"


class Goal(Record, ABC):
    """Say where the robot is led to."""

    @abstractmethod
    def reached(self, robot: Robot, start: State, duration: float, samples: int) -> State | Motion:
        """Return a state or a motion; start: where to look for it from."""


class Pose(Goal):
    """Hold a pose, of the tool [m, rad] or of joints by name."""

    type: Literal["pose"] = "pose"
    tool: Numbers | None = Field(default=None, description="pose of the tool [m, rad]")
    joints: Mapping[PathName, Real] | None = Field(default=None, description="joint coordinates by name [m, rad]")

    def reached(self, robot, start, duration, samples):
        return robot.assemble(self.joints, tool=self.tool, guess=start)


class Course(Goal, ABC):
    """Lead the tool along a path, from rest to rest over the whole run."""

    @property
    @abstractmethod
    def path(self) -> paths.Path:
        """The path."""

    def reached(self, robot, start, duration, samples):
        return robot.follow(self.path, duration, samples=samples, guess=start)


class Line(Course):
    """Lead the tool straight from one pose to another [m, rad]."""

    type: Literal["line"] = "line"
    start: Numbers = Field(description="the first pose [m, rad]")
    end: Numbers = Field(description="the last pose [m, rad]")

    @property
    def path(self) -> paths.Path:
        return paths.line(self.start, self.end)


class Circle(Course):
    """Lead the tool around a circle: centre, radius [m], orientation [rad], turns."""

    type: Literal["circle"] = "circle"
    centre: Numbers = Field(description="the centre [m]")
    radius: Real = Field(description="the radius [m]")
    orientation: Real | Numbers | None = Field(default=None, description="angle, or rotation vector [rad]")
    turns: Real = Field(default=1.0, description="number of turns")

    @property
    def path(self) -> paths.Path:
        return paths.circle(self.centre, self.radius, self.orientation, turns=self.turns)


class Through(Course):
    """Lead the tool through four poses or more [m, rad]."""

    type: Literal["through"] = "through"
    poses: tuple[Numbers, ...] = Field(description="poses [m, rad]")

    @property
    def path(self) -> paths.Path:
        return paths.through(self.poses)


AnyGoal = Annotated[Pose | Line | Circle | Through, Field(discriminator="type")]
Law = Callable[[Any, Any], Any]


class Controller(Record, ABC):
    """Lead the actuated joints to a goal."""

    goal: AnyGoal = Field(description="where the robot is led to")

    @abstractmethod
    def law(self, goal: Any, robot: Robot) -> Law:
        """Return the controller; goal: a state or a motion; robot: with the study's own numbers."""


class Modelled(Controller, ABC):
    """Control by a model, which may be wrong."""

    model: Mapping[str, Real] = Field(default_factory=dict, description=MODEL)

    def model_of(self, robot: Robot) -> Robot:
        """Return the robot that the controller believes in."""
        if not self.model:
            return robot
        return Robot(edited(robot.mechanism, self.model), robot.independent)


class PD(Controller):
    """u = kp e + kd e' (`linkwork.control.PD`)."""

    type: Literal["pd"] = "pd"
    kp: Gain = Field(description=GAIN)
    kd: Gain = Field(description=GAIN)

    def law(self, goal, robot):
        return control.PD(goal, self.kp, self.kd)


class WeightlessPD(Modelled):
    """u = kp e + kd e' + g(q) with the model's weight and springs (`linkwork.control.PD`)."""

    type: Literal["pd_with_gravity"] = "pd_with_gravity"
    kp: Gain = Field(description=GAIN)
    kd: Gain = Field(description=GAIN)

    def law(self, goal, robot):
        return control.PD(goal, self.kp, self.kd, model=self.model_of(robot))


class PID(Controller):
    """u = kp e + ki z + kd e', z' = e (`linkwork.control.PID`)."""

    type: Literal["pid"] = "pid"
    kp: Gain = Field(description=GAIN)
    ki: Gain = Field(description=GAIN)
    kd: Gain = Field(description=GAIN)

    def law(self, goal, robot):
        return control.PID(goal, self.kp, self.kd, ki=self.ki, joints=robot.actuators)


class ComputedTorque(Modelled):
    """u = inverse dynamics of a model (`linkwork.control.ComputedTorque`)."""

    type: Literal["computed_torque"] = "computed_torque"
    kp: Gain = Field(description=GAIN)
    kd: Gain = Field(description=GAIN)

    def law(self, goal, robot):
        return control.ComputedTorque(goal, self.model_of(robot), self.kp, self.kd)


class SlidingMode(Modelled):
    """Sliding mode with a boundary layer (`linkwork.control.SlidingMode`)."""

    type: Literal["sliding_mode"] = "sliding_mode"
    slope: Gain = Field(description=GAIN)
    gain: Gain = Field(description=GAIN)
    boundary: Real = Field(description="thickness of the layer [m/s, rad/s]")

    def law(self, goal, robot):
        return control.SlidingMode(goal, self.model_of(robot), self.slope, self.gain, self.boundary)


AnyController = Annotated[PD | WeightlessPD | PID | ComputedTorque | SlidingMode, Field(discriminator="type")]

DRIVES: Mapping[str, type[control.Drive]] = {
    "saturated": control.Saturated,
    "lag": control.Lag,
    "dc_motor": control.DCMotor,
    "hydraulic_cylinder": control.HydraulicCylinder,
    "pneumatic_cylinder": control.PneumaticCylinder,
}


def drive(given: Mapping[str, Any], where: tuple[str, ...]) -> control.Drive:
    """Return the drive that a mapping of its type and its numbers stands for (`linkwork.control`)."""
    numbers = dict(given)
    kind = numbers.pop("type", None)
    if kind not in DRIVES:
        fault = "is missing" if kind is None else f"{kind!r} is not a type{suggestion(str(kind), DRIVES)}"
        raise MechanismError(f"{fault}; the types are {', '.join(DRIVES)}", (*where, "type"))
    own = {field.name: field for field in fields(DRIVES[kind]) if field.type not in ("bool", bool)}
    for name, value in numbers.items():
        if name not in own:
            near = suggestion(name, own)
            raise MechanismError(f"is not a known field{near}; the fields here are {', '.join(own)}", (*where, name))
        if not isinstance(value, int | float):
            raise MechanismError(f"{value!r} is not a number", (*where, name))
    for name, field in own.items():
        if name not in numbers and field.default is MISSING:
            raise MechanismError("is missing; expected a number", (*where, name))
    try:
        return DRIVES[kind](**{name: float(value) for name, value in numbers.items()})
    except ValueError as error:
        raise MechanismError(str(error), where) from None
