"""Losses: one number that a run is judged by, with its derivatives by all numbers of the run.

    loss = g(T, state at T) + integral of l(t, state) dt

g and l are traced as controllers are; the integral is summed up by the weights of the steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import isfinite
from typing import Any

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.checks import by_name
from linkwork.control.events import Event
from linkwork.control.joined import Joined
from linkwork.control.kept_traces import acting_once
from linkwork.control.tracing import Law
from linkwork.errors import LinkworkError
from linkwork.gradients.amplification import require_meant
from linkwork.gradients.numbers import GROUPS, Numbers
from linkwork.gradients.retraced import Retraced, retraced
from linkwork.gradients.sensitivities import led_back, pull, require_finite
from linkwork.model.state import State
from linkwork.runs.run_record import RunRecord
from linkwork.runs.running import EXAMPLE, watched
from linkwork.runs.system import Forces, System, system
from linkwork.simulation import Run, Status


@dataclass(frozen=True, eq=False)
class Loss(Event):
    """A loss, told as the function of an event for which nobody watches."""

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise LinkworkError(f"{self.what} is {self.function!r}; give a function of (t, state)")

    @property
    def what(self) -> str:
        return self.name


@dataclass(frozen=True, eq=False)
class LossGradient:
    """Hold a loss and its gradient: gradient["rates"] is that by all initial rates,
    gradient["rates.slide_1"] by one of them.

    value: the loss; run: the run
    numbers: names of all numbers, "positions.slide_1", "rates.slide_1", "forces.slide_1" ... and
        those of parameters; derivatives: by each of them
    groups: their names by group: positions, rates, states, forces, parameters
    samples: by the values of sampled forces (N, actuators), if the forces are `linkwork.Sampled`
    """

    value: float
    run: Run = field(repr=False)
    numbers: tuple[str, ...]
    derivatives: np.ndarray
    groups: Mapping[str, tuple[str, ...]] = field(repr=False)
    samples: np.ndarray | None = field(repr=False)

    def __getitem__(self, name: str) -> Any:
        checks.known([name], (*GROUPS, *self.numbers), "number or group of numbers")
        if name in self.groups:
            return self.derivatives[[self.numbers.index(own) for own in self.groups[name]]]
        return float(self.derivatives[self.numbers.index(name)])


def loss_gradient(
    robot: Any,
    loss: Law | None,
    state: State,
    forces: Forces,
    *,
    running: Law | None,
    options: Mapping[str, Any],
) -> LossGradient:
    """Return the gradient of a loss: `Robot.gradient`."""
    losses = ((loss, "the loss"), (running, "the running loss"))
    given = tuple(Loss(each, name=name) for each, name in losses if each is not None)
    if not given:
        raise LinkworkError(
            "there is no loss; give one, or a running one, as a function of (t, state)"
        )
    # The run, and in its own steps with the losses as further event functions.
    options, own = divided(robot, state, forces, given, options)
    run: Run = robot.simulate(state, forces, **options)
    if run.status not in (Status.FINISHED, Status.EVENT):
        asked = f"the loss of {options['duration']:g} s"
        raise LinkworkError(f"{asked} has neither value nor derivatives. {run.message}")
    record = run.variables
    assert isinstance(record, RunRecord)
    judged = with_losses(record, forces, given, options, own)
    count = len(record.system.events)
    of = retraced(run, False, judged, count + len(given) - 1 if running is not None else None)
    # The loss at the end, and the integral of the running one, led back over the steps.
    numbers = Numbers(of)
    names, slopes, value = numbers.chosen(None), numbers.slopes(), 0.0
    if loss is not None:
        told = partial(judging, count)
        pull(of, slopes, f"loss {count}", told, np.ones((len(of.samples.t), 1)))
        value += evaluated(of, count)
    found = led_back(of, numbers, slopes)
    require_meant(of, slopes.grown, 4)
    require_finite("the loss", found)
    samples = None
    if numbers.samples:
        samples = numbers.by_samples(slopes)
    value += slopes.integral
    if not isfinite(value):
        raise LinkworkError(
            f"the loss is {value:g} along this run, and has no derivative: it divides by zero, or "
            "takes the root or the logarithm of a number below zero"
        )
    return LossGradient(value, run, names, found, numbers.groups, samples)


def divided(
    robot: Any, state: State, forces: Forces, losses: Sequence[Loss], options: Mapping[str, Any]
) -> tuple[Mapping[str, Any], Mapping[str, float]]:
    """Return the options of the run, and the values of parameters that losses alone have."""
    named = options.get("parameters")
    if not named:
        return options, {}
    named, span = by_name(named, "parameters", EXAMPLE), (0.0, options["duration"])
    read = acting_once(robot.names, None, {}, (), tuple(losses), span).parameters
    if not read.keys() & named.keys():
        return options, {}
    acting = system(
        *(robot, forces, options.get("drives"), options.get("wrenches", ())),
        *(watched(robot, options.get("events", ())), {}, span, True, state),
    ).acting
    assert acting is not None
    own = {name: named[name] for name in named if name in read and name not in acting.parameters}
    others = {name: value for name, value in named.items() if name not in own}
    return {**options, "parameters": others}, own


def with_losses(
    record: RunRecord,
    forces: Forces,
    losses: Sequence[Loss],
    options: Mapping[str, Any],
    parameters: Mapping[str, float],
) -> System:
    """Return a run's system that tells losses as event functions behind its own, for which it does
    not watch; parameters: values of those that losses alone have."""
    own, robot = record.system, record.robot
    span = float(record.segments[0].start[0]), float(record.segments[-1].trajectory.end_time)
    values = dict(parameters)
    if own.acting:
        values |= dict(zip(own.acting.parameters, own.parameters.tolist(), strict=True))
    drives, wrenches = options.get("drives"), options.get("wrenches", ())
    events = (*own.events, *losses)
    found = system(robot, forces, drives, wrenches, events, values, span, True, record.start)
    followed = own.acting.followed if own.acting else ()
    assert found.acting is not None
    if found.acting.followed != followed:
        names = ", ".join(sorted({x for part in found.acting.followed for x in part}))
        raise LinkworkError(
            f"the loss reads {names}, whose whole turns this run does not follow; read its sine "
            "and cosine, or let a controller or an event of the run read it too"
        )
    return replace(found, faults=own.faults)


def judging(number: int, joined: Joined) -> ca.SX:
    """Return an event function of what a run computes."""
    return joined.outputs["events"][number]


def evaluated(of: Retraced, number: int) -> float:
    """Return an event function at the end of a run."""
    chart, end = of.segments[-1].chart, of.samples
    kernel = of.system.kernel(chart, "events")
    return float(kernel.flat(end.y[-1], end.u[-1], of.system.p(chart))[number])
