"""Running: check what a simulation is asked for, make its system, and start it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from linkwork.checks import by_name, several, shown
from linkwork.control.events import (
    Event,
    cable_events,
    limit_events,
    load_events,
    meeting_events,
    singular_events,
)
from linkwork.errors import LinkworkError
from linkwork.model.parameters import with_parameters
from linkwork.model.state import State
from linkwork.patience import ongoing
from linkwork.runs import recording
from linkwork.runs.cable_leaps import tell_leaps
from linkwork.runs.left_states import require_left
from linkwork.runs.recording import Left
from linkwork.runs.settings import Settings
from linkwork.runs.system import Forces, System, require_starts, system
from linkwork.simulation import Run, Signal

if TYPE_CHECKING:
    from linkwork.model.model import Model

EXAMPLE = "{'kp': 10.0}"
SIMULATING = "simulating"
READY_EVENTS = {"limits": limit_events, "singular": singular_events}


def simulate(
    robot: Model,
    state: State,
    forces: Forces,
    settings: Settings,
    *,
    drives: Mapping[str, Any] | None = None,
    wrenches: Sequence[Any] = (),
    parameters: Mapping[str, float] | None = None,
    left: Left | None = None,
) -> Run:
    """Run from a state: see `Robot.simulate`. left: what a run that is resumed had at its end."""
    robot, state, runs, settings = prepared(
        robot, state, forces, settings, drives, wrenches, parameters, left
    )
    with ongoing(SIMULATING):
        return recording.simulate(robot, state, runs, settings, left)


def prepared(
    robot: Model,
    state: State,
    forces: Forces,
    settings: Settings,
    drives: Mapping[str, Any] | None,
    wrenches: Sequence[Any],
    parameters: Mapping[str, float] | None,
    left: Left | None,
) -> tuple[Model, State, System, Settings]:
    """Return the robot with its parameters, where it starts, what is integrated, and how, as
    `simulate` takes them; refuse what does not fit."""
    # Parameters of the robot, and those of what acts on it.
    given = {}
    if parameters is not None:
        given = dict(by_name(parameters, "parameters", EXAMPLE))
        own = {name: given.pop(name) for name in list(given) if name in robot.parameters}
        robot = with_parameters(robot, own) if own else robot
    # What is integrated, and over which times.
    start = left.time if left else 0.0
    span = (start, start + settings.duration)
    events = watched(robot, settings.events)
    state = robot.own(state)
    runs = system(
        robot, forces, drives, wrenches, events, given, span, settings.integrator.stiff, state
    )
    if not smooth(runs, [runs.inputs]):
        settings = settings.suited(smooth=False)
    # A run that begins, or one that goes on with the extra states and held inputs that it left.
    if left is None:
        if runs.acting is not None:
            require_starts(runs, state, runs.parameters)
            tell_leaps(robot, state.q, robot.p)
        return robot, state, runs, settings
    require_left(runs, left)
    return robot, state, runs, settings


def smooth(runs: System, inputs: Sequence[Signal]) -> bool:
    """Tell whether inputs have no kinks: they are not sampled, nor is a controller."""
    sampled = runs.acting is not None and runs.acting.sampler is not None
    return not sampled and all(len(signal.coefficients) == 1 for signal in inputs)


def watched(
    robot: Model, events: Sequence[Event | Callable[..., Any] | str] | str
) -> tuple[Event, ...]:
    """Return events as such, those of the robot's own meetings and loads behind them: names stand
    for ready ones, and plain functions are watched without ending the run."""
    names, own = robot.names, ()
    if names.meetings or names.loaded or names.surfaces:
        own = (*meeting_events(robot), *load_events(robot), *cable_events(robot))
    if isinstance(events, tuple) and not events:
        return own
    given: Sequence[Any] = (
        [events]
        if isinstance(events, str | Event) or callable(events)
        else several(events, object, "events")
    )
    found: list[Event] = []
    for event in given:
        if isinstance(event, Event):
            found.append(event)
        elif callable(event):
            found.append(Event(event, name=getattr(event, "__name__", "event")))
        elif isinstance(event, str) and event in READY_EVENTS:
            found.extend(READY_EVENTS[event](robot))
        else:
            raise LinkworkError(
                f"there are no events {shown(event)}; give {', '.join(READY_EVENTS)}, or a "
                "linkwork.control.Event"
            )
    return (*found, *own)
