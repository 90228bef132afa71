"""What leads the robot in a study: goals, controllers and drives as records of a file, and what they stand for.

The models of controllers are the robot of the study with the numbers that its file gives, whatever varies in the robot
that is controlled; `model` changes numbers of them, by path. A controller's gains are parameters of the runs; those of a
linear-quadratic one follow from its weights.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from linkwork import control, paths
from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import Amount, MechanismError, Name, PathName, Positive, Real, Record
from linkwork.mechanism.refusal import suggestion
from linkwork.robot import Motion, Robot, State

Numbers = tuple[Real, ...]
Gain = Real | Mapping[Name, Real]
Weight = Amount | Mapping[PathName, Amount]
GAIN = "a number, or one by actuator"
WEIGHT = "weight of its square, a number, or one by {}"
MODEL = "numbers of the model that differ from the robot's, by path"


class Goal(Record, ABC):
    """Say where the robot is led to."""

    @abstractmethod
    def reached(self, robot: Robot, start: State, duration: float, samples: int) -> State | Motion:
        """Return a state or a motion; start: where to look for it from."""


class Pose(Goal):
    """Hold a pose, of the tool [m, rad] or of joints by name; left out, where runs start."""

    type: Literal["pose"] = "pose"
    tool: Numbers | None = Field(default=None, description="pose of the tool [m, rad]")
    joints: Mapping[PathName, Real] | None = Field(default=None, description="joint coordinates by name [m, rad]")

    def reached(self, robot, start, duration, samples):
        return start if self == Pose() else robot.assemble(self.joints, tool=self.tool, guess=start)


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


class Sampling(Record):
    """Call a controller at a fixed rate, and hold what it gives in between (`linkwork.control.Sampler`)."""

    rate: Positive = Field(description="calls per second [Hz]")
    delay: Amount = Field(default=0.0, description="until a result acts [s], a whole number of periods")
    quantise: Positive | Mapping[PathName, Positive] | None = Field(
        default=None, description="step in which joint coordinates are read [m, rad], or one by name"
    )

    def around(self, law: Law) -> control.Sampler:
        """Return the controller that calls another one so."""
        return control.Sampler(law, self.rate, self.delay, self.quantise, compiled=True)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        try:
            self.around(lambda t, state: ())
        except LinkworkError as error:
            raise MechanismError(str(error)) from None
        return self


class Controller(Record, ABC):
    """Lead the robot to a goal."""

    goal: AnyGoal = Field(description="where the robot is led to")

    @abstractmethod
    def law(self, goal: Any, robot: Robot) -> Law:
        """Return the controller; goal: a state or a motion; robot: with the study's own numbers."""

    def forces(self, goal: Any, robot: Robot) -> Law | control.Sampler:
        """Return what leads the runs: the controller as it is called."""
        return self.law(goal, robot)

    @property
    def weights(self) -> tuple[str, ...]:
        """The names of numbers that are no parameters of the runs, but that parameters follow from."""
        return ()

    def weighted(self, weights: Mapping[str, float]) -> Self:
        """Return the controller with other values of some `weights`."""
        changed: dict[str, Any] = {}
        for name, value in weights.items():
            field, _, label = name.partition(".")
            changed[field] = changed.get(field, getattr(self, field)) | {label: value} if label else value
        return type(self)(**dict(self) | changed)


class Memoryless(Controller, ABC):
    """Control without states of one's own, at all times or sampled."""

    sampled: Sampling | None = Field(default=None, description="how it is sampled")

    def forces(self, goal, robot):
        law = self.law(goal, robot)
        return law if self.sampled is None else self.sampled.around(law)


class Modelled(Memoryless, ABC):
    """Control by a model, which may be wrong."""

    model: Mapping[str, Real] = Field(default_factory=dict, description=MODEL)

    def model_of(self, robot: Robot) -> Robot:
        """Return the robot that the controller believes in."""
        return changed(robot, tuple(self.model.items())) if self.model else robot


@lru_cache(maxsize=16)
def changed(robot: Robot, numbers: tuple[tuple[str, float], ...]) -> Robot:
    """Return a robot with other numbers, by path; it is derived once for all controllers that believe in them."""
    try:
        return Robot(edited(robot.mechanism, dict(numbers)), robot.independent)
    except MechanismError as error:
        raise MechanismError(f"{'.'.join(error.where)}: {error.what}".removeprefix(": "), ("model",)) from None


class PD(Memoryless):
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
        return control.PID(goal, self.kp, self.kd, ki=self.ki)


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


class LQR(Modelled):
    """Hold a pose by u = u_0 - K x of least cost, Q = diag(position, rate), R = diag(force) (`linkwork.control.LQR`)."""

    WEIGHTS: ClassVar = ("position", "rate", "force")

    type: Literal["lqr"] = "lqr"
    goal: Pose = Field(default=Pose(), description="the pose to hold")  # pyright: ignore[reportIncompatibleVariableOverride]
    position: Weight = Field(description=WEIGHT.format("independent coordinate"))
    rate: Weight = Field(default=0.0, description=WEIGHT.format("independent rate"))
    force: Positive | Mapping[PathName, Positive] = Field(description=WEIGHT.format("actuator"))

    @property
    def weights(self):
        given = {field: getattr(self, field) for field in self.WEIGHTS}
        return tuple(
            name
            for field, value in given.items()
            for name in ([f"{field}.{label}" for label in value] if isinstance(value, Mapping) else [field])
        )

    def law(self, goal, robot):
        model = self.model_of(robot)
        if model is not robot:
            near = State(goal.positions, goal.rates, goal.q, model.coordinates, model.independent)
            goal = model.assemble({name: goal[name] for name in model.independent}, guess=near)
        Q = [weight for field in ("position", "rate") for weight in self.diagonal(field, model.independent)]
        return control.LQR.about(model, goal, Q, self.diagonal("force", model.actuators))

    def diagonal(self, field: str, names: Sequence[str]) -> list[float]:
        """Return a weight for each name; refuse weights that are others'."""
        given = getattr(self, field)
        if not isinstance(given, Mapping):
            return [given] * len(names)
        for name in set(given) ^ set(names):
            fault = f"lacks {name!r}" if name in names else f"has {name!r}"
            raise MechanismError(f"{fault}; give one number, or one for each of {', '.join(names)}", (field,))
        return [given[name] for name in names]


AnyController = Annotated[PD | WeightlessPD | PID | ComputedTorque | SlidingMode | LQR, Field(discriminator="type")]

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
