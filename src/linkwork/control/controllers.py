"""Ready controllers. Each is a function of (t, state) with its gains as free parameters, traced
like any other.

With the error e = x_d - x of the actuated joints' coordinates:

    PD               u = kp e + kd e' (+ g(q))
    PID              u = kp e + ki z + kd e' (+ g(q)),    z' = e
    computed torque  u = M a + C v + G - f,    a = x_d'' + kd e' + kp e
    sliding mode     the same with  a = x_d'' + slope e' + gain sat(s / boundary),  s = e' + slope e

Sources: Siciliano, Sciavicco, Villani & Oriolo, Robotics, sec. 8.5 (PD with gravity compensation,
computed torque); Slotine & Li, Applied Nonlinear Control, ch. 7 and 9 (sliding mode with a boundary
layer).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, wraps
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np

from linkwork import checks, math
from linkwork.control.drives import Extra
from linkwork.control.goals import DesiredMotion, Goal, target
from linkwork.control.inverse_dynamics import InverseDynamics
from linkwork.control.observation import Names, Observation
from linkwork.control.plant import Plant
from linkwork.control.records import ActingPart, Number, described, number, of_package
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Positive
from linkwork.moved import warn

Gain = float | Mapping[str, float]
EACH = "actuator"
Law = TypeVar("Law")


class Form(NamedTuple):
    """Say how study files give a controller.

    type: its name there; said: what it does, in a line; title: its name in schemas
    takes: its numbers in their order, and "model" if it has one; defaults: of numbers that may be
    left out
    """

    type: str
    said: str
    title: str
    takes: tuple[str, ...]
    defaults: Mapping[str, float] = {}


@dataclass(frozen=True, eq=False)
class Controller(ActingPart, ABC):
    """Lead a robot to a goal.

    forms: of study files; still: whether the goal is a pose
    """

    forms: ClassVar[tuple[Form, ...]] = ()
    still: ClassVar[bool] = False
    _kept: dict[Any, tuple[Any, Any]] = field(default_factory=dict, init=False, repr=False)

    @abstractmethod
    def __call__(self, t: Any, state: Observation) -> Any:
        """Return the forces of the actuators, in their order."""

    @classmethod
    def described_numbers(cls) -> Mapping[str, Number]:
        """Return the numbers that `led` takes, by name."""
        return described(cls)

    @classmethod
    @abstractmethod
    def led(cls, goal: Any, **given: Any) -> Self:
        """Return the controller to a goal with what one of its forms takes."""

    def renewed(self, key: Any, goal: Any, find: Callable[[], Any]) -> Any:
        """Return what a goal asks for: found once, but anew where it changed, or may have.

        key: under which it is kept; find: how it is found.
        """
        now = dict(goal) if isinstance(goal, Mapping) else None
        kept = self._kept.get(key)
        if kept is None or kept[0] != now or not (now or of_package(goal)):
            kept = self._kept[key] = now, find()
        return kept[1]


@dataclass(frozen=True, eq=False)
class Follower(Controller):
    """Lead the actuated joints to a goal: a state, a motion (`robot.follow`), coordinates by name,
    or a signal of them."""

    goal: Goal

    @classmethod
    def led(cls, goal: Goal, **given: Any) -> Self:
        return cls(goal, **given)

    def asked(self, names: Names) -> DesiredMotion:
        """Return what the goal asks of a robot with these names."""
        return self.renewed(names, self.goal, lambda: target(self.goal, names))

    def errors(self, t: Any, state: Observation) -> tuple[Any, Any, Any]:
        """Return e, e' and x_d'' (na each).

        t: the time [s] or its symbol; state: what is measured.
        """
        names = state.names
        x_d, dx_d, ddx_d = self.asked(names).at(t)
        x, dx = (
            math.array([read(name) for name in names.actuators])
            for read in (state.__getitem__, state.rate)
        )
        return x_d - x, dx_d - dx, ddx_d


def gain(state: Observation, name: str, value: Gain, by: Sequence[str] | None = None) -> np.ndarray:
    """Return a gain as free parameters: one of its name, or name.actuator where it is given by
    actuator; by: names in their place."""
    each = state.names.actuators if by is None else by
    if not isinstance(value, Mapping):
        return math.array([state.parameter(name, value)] * len(each))
    missing = [one for one in each if one not in value]
    if missing:
        raise LinkworkError(
            f"the gain {name} lacks {missing[0]!r}; give one number, or one for each of "
            f"{', '.join(each)}"
        )
    checks.known(value, each, "actuator" if by is None else "coordinate", f" with a gain {name}")
    return math.array([state.parameter(f"{name}.{one}", value[one]) for one in each])


def model_last(law: type[Law]) -> type[Law]:
    """Let a law take its model behind the gains, as all laws do; before them, where it stood
    formerly, it is taken with a warning."""
    made: Any = law.__init__

    @wraps(made)
    def taken(self: Any, goal: Any, *given: Any, **named: Any) -> None:
        if given and not isinstance(given[0], int | float | Mapping | np.ndarray):
            order = ", ".join(f.name for f in fields(law) if f.init)  # pyright: ignore
            warn(f"{law.__name__}(goal, model, ...)", f"{law.__name__}({order})")
            given, named = given[1:], {"model": given[0], **named}
        made(self, goal, *given, **named)

    law.__init__ = taken  # pyright: ignore[reportAttributeAccessIssue]
    return law


@dataclass(frozen=True, eq=False)
class PD(Follower):
    """Pull each actuated joint to its goal: u = kp e + kd e'.

    model: formerly, for `PDWithGravity`
    """

    kp: Gain = number("", "N/m, N m/rad", by=EACH)
    kd: Gain = number("", "N s/m, N m s/rad", by=EACH)
    model: Plant | None = None

    forms: ClassVar = (Form("pd", "u = kp e + kd e'", "PD", ("kp", "kd")),)

    def __post_init__(self) -> None:
        if type(self) is PD and self.model is not None:
            warn("PD(..., model=...)", "PDWithGravity(goal, kp, kd, model)", stacklevel=4)

    def __call__(self, t, state):
        e, de, _ = self.errors(t, state)
        return (
            gain(state, "kp", self.kp) * e + gain(state, "kd", self.kd) * de + self.holding(state)
        )

    def holding(self, state: Observation) -> Any:
        """Return the forces (na) that hold the model still at the present pose; zero without a
        model."""
        if self._model is None:
            return np.zeros(len(state.names.actuators))
        return self._model.forces(state, np.zeros(len(state.names.actuators)), still=True)

    @cached_property
    def _model(self) -> InverseDynamics | None:
        return None if self.model is None else InverseDynamics(self.model)


@dataclass(frozen=True, eq=False)
class PDWithGravity(PD):
    """Add what holds a model's weight and springs at the present pose to `PD`: u = kp e + kd e' +
    g(q).

    model: a robot with the same joints
    """

    model: Plant = field()  # pyright: ignore

    forms: ClassVar = (
        Form(
            "pd_with_gravity",
            "u = kp e + kd e' + g(q) with the model's weight and springs",
            "PDWithGravity",
            ("model", "kp", "kd"),
        ),
    )


@dataclass(frozen=True, eq=False)
class PID(PD):
    """Add the integral of the error to `PD`: u = kp e + ki z + kd e', z' = e.

    model: a robot with the same joints, whose weight and springs at the present pose are added

    joints: actuators whose errors are integrated, all if left out; the integrals are extra states
    "integral.joint"
    """

    ki: Gain = number("", "N/(m s), N m/(rad s)", default=0.0, by=EACH)
    joints: Sequence[str] | None = None

    forms: ClassVar = (Form("pid", "u = kp e + ki z + kd e', z' = e", "PID", ("kp", "ki", "kd")),)

    def extras(self, actuators: tuple[str, ...]) -> tuple[Extra, ...]:
        """Return the integrals of the errors of a robot with these actuators."""
        return tuple(
            Extra(f"integral.{name}", "m s, rad s", 0.0) for name in self.integrated(actuators)
        )

    def integrated(self, actuators: tuple[str, ...]) -> tuple[str, ...]:
        """Return the actuators whose errors are integrated; refuse joints that are none."""
        joints = actuators if self.joints is None else checks.names(self.joints, "joints")
        for name in joints:
            checks.known([name], actuators, "actuator to integrate the error of")
        return joints

    def __call__(self, t, state):
        actuators, (e, _, _) = state.names.actuators, self.errors(t, state)
        integrated = self.integrated(actuators)
        integral = [
            state.extra(f"integral.{name}") if name in integrated else 0.0 for name in actuators
        ]
        rates = {
            f"integral.{name}": error
            for name, error in zip(actuators, e, strict=True)
            if name in integrated
        }
        forces = super().__call__(t, state) + gain(state, "ki", self.ki) * math.array(integral)
        return (forces, rates) if rates else forces


@model_last
@dataclass(frozen=True, eq=False)
class ComputedTorque(Follower):
    """Linearise the motion by a model's inverse dynamics; with an exact model e'' + kd e' + kp e =
    0.

    model: a robot with the same joints, which may be wrong
    """

    kp: Gain = number("", "1/s^2", by=EACH)
    kd: Gain = number("", "1/s", by=EACH)
    model: Plant  # pyright: ignore[reportGeneralTypeIssues]

    forms: ClassVar = (
        Form(
            "computed_torque",
            "u = inverse dynamics of a model",
            "ComputedTorque",
            ("model", "kp", "kd"),
        ),
    )

    def __call__(self, t, state):
        e, de, ddx_d = self.errors(t, state)
        a = ddx_d + gain(state, "kd", self.kd) * de + gain(state, "kp", self.kp) * e
        return self._model.forces(state, a)

    @cached_property
    def _model(self) -> InverseDynamics:
        return InverseDynamics(self.model)


@model_last
@dataclass(frozen=True, eq=False)
class SlidingMode(Follower):
    """Drive the error onto s = e' + slope e = 0 and keep it near, whatever a wrong model lacks.

    The gain is a reserve of acceleration; in the layer the switching is smoothed.

    model: a robot with the same joints
    """

    slope: Gain = number("", "1/s", by=EACH)
    gain: Gain = number("", "m/s^2, rad/s^2", by=EACH)
    boundary: float = number("thickness of the layer", "m/s, rad/s", Positive)
    model: Plant  # pyright: ignore[reportGeneralTypeIssues]

    forms: ClassVar = (
        Form(
            "sliding_mode",
            "Sliding mode with a boundary layer",
            "SlidingMode",
            ("model", "slope", "gain", "boundary"),
        ),
    )

    def __post_init__(self) -> None:
        if not math.symbolic(self.boundary):
            checks.positive(self.boundary, "the boundary of SlidingMode", "m/s, rad/s")

    def __call__(self, t, state):
        e, de, ddx_d = self.errors(t, state)
        slope = gain(state, "slope", self.slope)
        switch = math.clip((de + slope * e) / gain(state, "boundary", self.boundary), -1, 1)
        return self._model.forces(
            state, ddx_d + slope * de + gain(state, "gain", self.gain) * switch
        )

    @cached_property
    def _model(self) -> InverseDynamics:
        return InverseDynamics(self.model)
