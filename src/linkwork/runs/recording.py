"""Recording: run from a state, and name and measure what was computed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkwork.mechanism.files import written
from linkwork.model import chart_transfer, checks
from linkwork.model.state import State
from linkwork.runs.accuracy import Compared, called_alike
from linkwork.runs.endings import (
    ASKED,
    ERROR,
    TOLD,
    WOUND,
    asked,
    end,
    ending,
    errors,
    statistics,
    told,
)
from linkwork.runs.passage import Departure, Lowered, Passage
from linkwork.runs.quantities import AXES
from linkwork.runs.run_record import RunRecord
from linkwork.runs.sampled_calls import called_besides
from linkwork.runs.settings import Settings
from linkwork.runs.system import System
from linkwork.simulation import Control, Pace, Run
from linkwork.simulation.variables import Deferred

if TYPE_CHECKING:
    from linkwork.equations.chart import Chart
    from linkwork.model.model import Model

COORDS = ("time", *AXES, "event", "event_time")


class Left(NamedTuple):
    """Hold what a run had at its end, from which it is resumed, beside its state.

    time: [s]; extras: extra states; pace: step size
    held: inputs that a sampled controller held; turns: whole turns of angles that are not in the
        state's q; chart: that it was in; lowered: the bound of its pivots, if it was lowered
    names: of the extra states, none where the run does not tell them
    """

    time: float
    extras: np.ndarray
    pace: Pace
    held: np.ndarray | None
    turns: np.ndarray | None
    chart: Chart
    lowered: Lowered | None = None
    names: tuple[str, ...] = ()


def simulate(
    robot: Model, state: State, system: System, settings: Settings, left: Left | None = None
) -> Run:
    """Run a system from a state and record positions, rates, accelerations, forces, tool, energies
    and closure over time.

    left: what a run that is resumed had at its end
    """
    if state.q.ndim > 1:
        raise checks.LinkworkError(
            "a run starts from one state, not from a stack; take one by state.at(index)"
        )
    start, z, pace, held, turns, last, lowered, _ = left or (0.0, *[None] * 7)
    pace = None if settings.integrator.step else pace
    sampler, end, besides = system.sampler, start + settings.duration, np.empty(0)
    if settings.samples is not None:
        settings = settings.saved_from(start)
    control = Control(0, sampler.period, held) if held is not None and sampler else None
    if settings.save_at is not None and sampler:
        settings, besides = called_besides(sampler, settings, start, end)
    passage = Passage(robot, system, start, end, settings, pace, interruptible=True)
    chart, v = chart_transfer.start(robot, state, last)
    begun = Departure(
        chart, state.q, v, system.start(robot, state.positions, state.q, z), control, turns, lowered
    )
    return record(Compared(robot, passage, begun, [*passage.segments(begun)]), state, besides)


def again(made: Compared, state: State, samples: int | np.ndarray | None) -> Run:
    """Carry out a run once more, saved at other times [s], at so many from its start to where it
    ended, or (None) at every step."""
    passage, besides = made.passage, np.empty(0)
    last = made.segments[-1].trajectory.end_time
    times = np.linspace(passage.start, last, samples) if isinstance(samples, int) else samples
    settings = passage.settings.but(save_at=times)
    if passage.system.sampler and times is not None:
        given = passage.system.sampler, settings, passage.start, passage.end
        settings, besides = called_besides(*given)
    passage = replace(passage, settings=settings, interruptible=False)
    leading = passage
    if passage.system.faults:  # it was interrupted: it is to come as far, not further
        taken = sum(part.trajectory.steps + part.trajectory.rejected for part in made.segments)
        system, settings = replace(passage.system, faults=[]), settings.but(max_steps=taken)
        leading = replace(passage, system=system, settings=settings)
    segments = list(leading.segments(made.start))
    return record(replace(made, passage=passage, segments=segments), state, besides)


def record(made: Compared, state: State, besides: np.ndarray) -> Run:
    """Name what a run's segments hold; what is asked of it, and what follows, is found when it is
    first asked for."""
    robot, segments = made.robot, made.segments
    system, settings = made.passage.system, made.passage.settings
    for fault in system.faults:
        if not isinstance(fault, Exception | KeyboardInterrupt):
            raise fault
    # What is told is worked out when it is first asked for.
    of = RunRecord(robot, system, segments, besides, state, settings.save_at is None)

    def sentences() -> str:
        _, message = ending(system, segments)
        return message + made.caveat

    def error() -> dict[str, object]:
        found = made.estimate
        ratio, until = (found.ratio, found.until) if found else (np.nan, np.nan)
        return {"error_estimate": ratio, "error_estimate_until": until}

    # The run, with all of it.
    return Run(
        variables=of,
        coords=Deferred({COORDS: of.coords}),
        attrs=Deferred(
            {
                ASKED: partial(asked, robot, system, settings),
                TOLD: partial(told, system, segments),
                WOUND: of.final_windings,
                ERROR: error,
            }
        ),
        status=end(system, segments[-1]),
        message=sentences,  # pyright: ignore[reportArgumentType]
        statistics=partial(statistics, segments),  # pyright: ignore[reportArgumentType]
        error=system.faults[0] if system.faults else None,
        transmitted=of.reactions,
        errors=partial(errors, made, of) if made.known else None,
        ended=of.final,
        again=partial(again, made, state) if called_alike(system) else None,
        every=of.every,
        described=partial(written, robot.mechanism),
    )
