"""Controllers of a study: records of its file, made of what each law of `linkwork.control` says
that files give of it.

The models of controllers are the robot of the study with the numbers that its file gives, whatever
varies in the robot that is controlled; `model` changes numbers of them, by path. A controller's
gains are parameters of the runs; those of a linear-quadratic one follow from its weights.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, Union

from pydantic import Field, create_model, model_validator

from linkwork import control
from linkwork.control.controllers import Controller, Form
from linkwork.control.records import Number, described
from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import (
    MechanismError,
    PathName,
    Real,
    Record,
)
from linkwork.robot import Robot, State
from linkwork.sweeps.goals import AnyGoal, Pose

Law = Callable[[Any, Any], Any]
MODEL = "numbers of the model that differ from the robot's, by path"


class SamplerRecord(Record):
    """Call a controller at a fixed rate, and hold what it gives in between
    (`linkwork.control.Sampler`)."""

    def around(self, law: Law) -> control.Sampler:
        """Return the controller that calls another one so."""
        return control.Sampler(law, **dict(self), compiled=True)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        try:
            self.around(lambda t, state: ())
        except LinkworkError as error:
            raise MechanismError(str(error)) from None
        return self


def read(numbers: Mapping[str, Number], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a record for described numbers; defaults: of those that may be left
    out."""
    given = {}
    for name, of in numbers.items():
        kind = of.kind | Mapping[PathName, of.kind] if of.by else of.kind
        default = {"default": defaults[name]} if name in defaults else {}
        given[name] = kind, Field(description=of.expected, **default)
    return given


Sampling = create_model(
    "Sampling",
    __base__=SamplerRecord,
    __module__=__name__,
    __doc__=SamplerRecord.__doc__,
    **read(described(control.Sampler), {"delay": 0.0, "quantise": None}),
)


class ControllerRecord(Record):
    """Lead the robot to a goal by a law, in one of its forms."""

    LAW: ClassVar[type[Controller]]
    FORM: ClassVar[Form]

    goal: AnyGoal = Field(description="where the robot is led to")

    def law(self, goal: Any, robot: Robot) -> Law:
        """Return the controller; goal: a state or a motion; robot: with the study's own numbers."""
        given = {name: getattr(self, name) for name in self.FORM.takes}
        if "model" in given:
            numbers = tuple(given["model"].items())
            given["model"] = model = changed(robot, numbers) if numbers else robot
            if self.LAW.still and model is not robot:
                goal = posed(model, goal)
        return self.LAW.led(goal, **given)

    def forces(self, goal: Any, robot: Robot) -> Law | control.Sampler:
        """Return what leads the runs: the controller as it is called."""
        law, sampled = self.law(goal, robot), getattr(self, "sampled", None)
        return law if sampled is None else sampled.around(law)

    @property
    def numbers(self) -> tuple[str, ...]:
        """The names of all numbers that can vary."""
        given = {name: getattr(self, name) for name in self.FORM.takes if name != "model"}
        return tuple(
            name
            for field, value in given.items()
            for name in (
                [f"{field}.{label}" for label in value] if isinstance(value, Mapping) else [field]
            )
        )

    @property
    def weights(self) -> tuple[str, ...]:
        """The names of those that are no parameters of the runs, but that parameters follow
        from."""
        own = {field.name for field in fields(self.LAW)}
        return tuple(name for name in self.numbers if name.partition(".")[0] not in own)

    def but(self, numbers: Mapping[str, float]) -> Self:
        """Return the controller with other values of some `numbers`."""
        changed: dict[str, Any] = {}
        for name, value in numbers.items():
            field, _, label = name.partition(".")
            changed[field] = (
                changed.get(field, getattr(self, field)) | {label: value} if label else value
            )
        return type(self)(**dict(self) | changed)


@lru_cache(maxsize=16)
def changed(robot: Robot, numbers: tuple[tuple[str, float], ...]) -> Robot:
    """Return a robot with other numbers, by path; it is derived once for all controllers that
    believe in them."""
    try:
        return Robot(edited(robot.mechanism, dict(numbers)), robot.independent)
    except MechanismError as error:
        raise MechanismError(
            f"{'.'.join(error.where)}: {error.what}".removeprefix(": "), ("model",)
        ) from None


def posed(model: Robot, goal: State) -> State:
    """Return the pose of a model with the independent coordinates of a goal."""
    near = State.known(goal.positions, goal.rates, goal.q, model.coordinates, model.independent)
    return model.assemble({name: float(goal[name]) for name in model.independent}, guess=near)


def record(law: type[Controller], form: Form) -> type[ControllerRecord]:
    """Return the record of one form of a law: its goal, how it is sampled, its model, its type and
    its numbers.

    A law with states of its own is not sampled.
    """
    given: dict[str, Any] = {}
    if law.still:
        given["goal"] = Pose, Field(default=Pose(), description="the pose to hold")
    if not hasattr(law, "extras"):
        given["sampled"] = Sampling | None, Field(default=None, description="how it is sampled")
    if "model" in form.takes:
        given["model"] = Mapping[str, Real], Field(default_factory=dict, description=MODEL)
    given["type"] = Literal[form.type], form.type
    told = law.described_numbers()
    given |= read({name: told[name] for name in form.takes if name != "model"}, form.defaults)
    doc = f"{form.said} (`linkwork.control.{law.__name__}`)."
    made = create_model(
        form.title, __base__=ControllerRecord, __module__=__name__, __doc__=doc, **given
    )
    made.LAW, made.FORM = law, form
    return made


RECORDS = tuple(record(law, form) for law in control.LAWS for form in law.forms)

if TYPE_CHECKING:
    AnyController = ControllerRecord
else:
    AnyController = Annotated[Union[RECORDS], Field(discriminator="type")]  # noqa: UP007
