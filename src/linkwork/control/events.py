"""Events: zeros of functions of (t, state) along a run, found on its dense output; ready ones for
limits and singular poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from linkwork import checks, math
from linkwork.control.observation import Quantity
from linkwork.control.records import ActingPart
from linkwork.control.tracing import Law
from linkwork.errors import LinkworkError
from linkwork.mechanism.limits import at_surfaces, limited


@dataclass(frozen=True, eq=False)
class Event(ActingPart):
    """Watch for zeros of a traced function.

    It happens when the function reaches zero, from either side: one that is zero at the start of a
    run happens when it comes back to zero, and one that stays at zero does not happen.

    function: (t, state) -> a number that passes zero when the event happens; it is traced as
        controllers are
    terminal: whether the run ends there; direction: 1 for zeros passed upwards only, -1 for
        downwards, 0 for both
    name: to report it by; cuts: whether a step ends there and the next one begins, as where a force
        sets in, past which no step would be right; methods of fixed steps step past it
    """

    function: Law
    terminal: bool = False
    direction: Literal[-1, 0, 1] = 0
    name: str = "event"
    cuts: bool = False

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise LinkworkError(
                f"{self.what} watches a function of (t, state), not {self.function!r}"
            )
        if not isinstance(self.name, str):
            raise LinkworkError(f"the name of an event is {checks.shown(self.name)}; give text")
        for name in ("terminal", "cuts"):
            checks.switch(getattr(self, name), f"{name} of {self.what}")
        if not checks.among(self.direction, (-1, 0, 1)):
            raise LinkworkError(
                f"the direction of {self.what} is {self.direction!r}; give -1, 0 or 1"
            )

    @property
    def borne(self) -> bool:
        """Whether it tells of what a bearing carries."""
        return isinstance(self.function, LineLoad)

    @property
    def meets(self) -> bool:
        """Whether it tells of parts that begin or cease to press."""
        return isinstance(self.function, Gap)

    @property
    def what(self) -> str:
        """How sentences name it."""
        return f"the event {self.name!r}"


def limit_events(robot, terminal: bool = True) -> tuple[Event, ...]:
    """Return an event for each limit of a joint coordinate: it happens where the coordinate leaves
    its range.

    A free turn is limited by the angle between its joint's frames, 2 acos |qw|: its event is a zero
    of |qw| - cos(limit / 2).

    Args:
        robot: whose limits are meant; terminal: whether runs end there.

    Raises:
        LinkworkError: a robot whose joints have no limits.
    """
    if not hasattr(robot, "mechanism"):
        raise LinkworkError(f"the robot is {checks.shown(robot)}; give a linkwork.Robot")
    events = []
    for label, limits, name in limited(robot.mechanism):
        free = name != label
        for bound, side in ((limits.lower, "lower"), (limits.upper, "upper")):
            if bound is not None:
                inside = (
                    WithinTurn(label, bound)
                    if free
                    else Within(label, bound, 1 if side == "lower" else -1)
                )
                events.append(Event(inside, terminal, -1, f"{name}: {side} limit"))
    if not events:
        raise LinkworkError(
            "the joints of this robot have no limits to watch for; give some of them limits"
        )
    return tuple(events)


def singular_events(robot, terminal: bool = True) -> tuple[Event, ...]:
    """Return the event of an actuator-singular pose: the determinant of S, actuated from
    independent rates, passes zero.

    A run changes its independent rates near such a pose, and passes it if its motion is regular
    there.

    Args:
        robot: whose actuators are meant; terminal: whether runs end there.
    """
    return (Event(Regular(), terminal, name="actuator-singular pose"),)


def meeting_events(robot) -> tuple[Event, ...]:
    """Return two events for all that may meet, where it begins to press and where that ends; steps
    end there."""
    return tuple(
        event
        for name in robot.names.meetings
        for event in (
            Event(Gap(name), direction=-1, name=f"{name} begins", cuts=True),
            Event(Gap(name), direction=1, name=f"{name} ends", cuts=True),
        )
    )


def load_events(robot) -> tuple[Event, ...]:
    """Return an event for each force along a line by which a joint rubs, where that turns round:
    there the friction has a kink, and steps end."""
    return tuple(
        Event(LineLoad(name), name=f"{name} turns round", cuts=True) for name in robot.names.loaded
    )


def cable_events(robot) -> tuple[Event, ...]:
    """Return the events of cables along which something acts at surfaces: steps end where one
    begins to touch a surface or comes off it, and where the shorter way leaps to the other side; a
    run ends where energy of a spring, a stop or an inertia would leap with it."""
    found = []
    for name, happens in at_surfaces(robot.mechanism).items():
        leaps = happens.what == "leaps at"
        found.append(Event(AroundSurface(name), leaps, -1 if leaps else 0, name, not leaps))
    return tuple(found)


@dataclass(frozen=True)
class AroundSurface(ActingPart):
    """Tell a number that passes zero where something happens to a cable at a surface."""

    name: str

    def __call__(self, t, state):
        return state.source.quantity(Quantity("surface", self.name))[0]


@dataclass(frozen=True)
class LineLoad(ActingPart):
    """Tell the force along a line by which a joint rubs: of a gear's teeth, thrust, or across an
    axis."""

    name: str

    def __call__(self, t, state):
        return state.source.quantity(Quantity("load", self.name))[0]


@dataclass(frozen=True)
class Gap(ActingPart):
    """Tell how far what may meet is apart."""

    name: str

    def __call__(self, t, state):
        return state.gap(self.name)


@dataclass(frozen=True)
class Within(ActingPart):
    """Tell how far a coordinate is inside of a bound [m, rad]; sign: 1 for a lower one, -1 for an
    upper one."""

    label: str
    bound: float
    sign: int

    def __call__(self, t, state):
        return self.sign * (state[self.label] - self.bound)


@dataclass(frozen=True)
class WithinTurn(ActingPart):
    """Tell how far a free turn is inside of its bound, in cosines of half the angle; label: of
    qw."""

    label: str
    bound: float

    def __call__(self, t, state):
        return math.abs(state[self.label]) - math.cos(self.bound / 2)


@dataclass(frozen=True)
class Regular(ActingPart):
    """Tell how far the pose is from an actuator-singular one: the determinant of S."""

    def __call__(self, t, state):
        return state.actuation_determinant
