"""Resuming: read off a run where it ended, and go on from there."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from linkwork.checks import by_name, known, listed
from linkwork.equations.chart import Chart
from linkwork.errors import LinkworkError
from linkwork.mechanism import MechanismError
from linkwork.mechanism.numbers import located
from linkwork.model.parameters import Known, with_parameters
from linkwork.model.state import State
from linkwork.runs.passage import Lowered
from linkwork.runs.recording import Left
from linkwork.runs.running import EXAMPLE, simulate
from linkwork.runs.settings import Settings
from linkwork.runs.system import Forces
from linkwork.simulation import Pace, Run

if TYPE_CHECKING:
    from linkwork.model.model import Model

OTHER_ROBOT = "the run belongs to another robot and cannot be resumed by this one"


def resume(
    robot: Model,
    run: Run,
    forces: Forces,
    settings: Settings,
    *,
    parameters: Mapping[str, float] | None = None,
    **acting: Any,
) -> Run:
    """Go on from the end of a run: see `Robot.resume`. acting: drives and wrenches."""
    state, left, own = left_by(robot, run)
    values = {**own, **by_name(parameters, "parameters", EXAMPLE)}
    return simulate(robot, state, forces, settings, parameters=values, left=left, **acting)


def left_by(robot: Model, run: Run) -> tuple[State, Left, dict[str, float]]:
    """Return the state in which a run ended, what else it had there, and its values of the robot's
    parameters."""
    if not isinstance(run, Run):
        raise LinkworkError(
            f"a run is resumed, not {type(run).__name__}; give what robot.simulate or Run.load "
            "returns"
        )
    # Where the run ended, as far as it tells.
    try:
        q, v = (
            np.atleast_1d(np.asarray(run.attrs[name], float)) for name in ("final_q", "final_v")
        )
        independent = listed(str(run.attrs["final_rates"]), robot.rates)
        start = float(run.attrs["final_time"])
        pace = Pace(*np.asarray(run.attrs["final_pace"], float).tolist())
        told = str(run.attrs["final_chart"])
    except KeyError as error:
        raise LinkworkError(f"the run cannot be resumed: it does not hold {error}") from None
    n = len(independent)
    if q.size != robot.equations.nq or n != robot.mobility:
        raise LinkworkError(OTHER_ROBOT)
    # The state there, in the chart that it ended in, with the whole turns of its joints.
    state = replace(robot.make_state(q, v[:n]), independent=independent)
    if "final_windings" in run.attrs:
        windings = np.atleast_1d(np.asarray(run.attrs["final_windings"], float))
        if windings.size != len(robot.coordinates):
            raise LinkworkError(OTHER_ROBOT)
        state = replace(state, positions=robot.labels.turned(state.positions, windings))
    known(independent, robot.equations.tree.rates, "rate of the tree")
    last = chart_told(robot, told, independent)
    if independent not in robot.charts:
        robot.charts[independent] = robot.run_charts.of(last, robot.chart)
    # What else it goes on with: the bound of its pivots, held inputs, counted turns, parameters,
    # extra states.
    weak = np.asarray(run.attrs.get("final_lowered", ()), float).tolist()
    lowered = Lowered(*weak) if weak else None
    held, turns = (
        np.atleast_1d(np.asarray(run.attrs[name], float)) if name in run.attrs else None
        for name in ("final_held", "final_turns")
    )
    own = own_numbers(robot, described(robot, run), "resume it by")
    names = tuple(map(str, run.coords["extra"].values)) if "extra" in run.coords else ()
    return state, Left(start, v[n:], pace, held, turns, last, lowered, names), own


def chart_told(robot: Model, text: str, independent: tuple[str, ...]) -> Chart:
    """Return the chart that a run ended in, as it tells of it; refuse what is none of the robot's,
    or in other rates."""
    try:
        last = TypeAdapter(Chart).validate_json(text)
    except ValidationError:
        raise LinkworkError(OTHER_ROBOT) from None
    names, height = robot.equations.tree.rates, len(robot.equations.rows.units)
    fits = (
        sorted((*last.independent, *last.dependent)) == [*range(len(names))]
        and independent == tuple(names[place] for place in last.independent)
        and {*last.rows} <= {*range(height)}
        and sorted(last.dependent) == sorted(c for stage in last.stages for c in stage.columns)
        and sorted(last.rows) == sorted(r for stage in last.stages for r in stage.rows)
        and all(len(stage.blocks) == len(stage.scales) for stage in last.stages)
    )
    if not fits:
        raise LinkworkError(OTHER_ROBOT)
    return last


def own_numbers(robot: Model, values: Mapping[str, float], what: str) -> dict[str, float]:
    """Return the values that the robot's free numbers had in a run; refuse other values of numbers
    which are not free.

    values: that the run tells of, of numbers of the description; what: to do by the right robot
    """
    own, others = {}, dict(values)
    for name in list(others):
        if name in robot.parameters:
            own[name] = others.pop(name)
    for path, (value, held) in held_otherwise(robot, others).items():
        raise LinkworkError(
            f"the run had {path} = {value:g}, which is {held:g} here and not free; {what} "
            f"the robot that it is of, or free the number: robot.free({path!r})"
        )
    return own


def as_in(robot: Known, values: Mapping[str, float], what: str = "take") -> Known:
    """Return the robot as it was in a run: with the values that its free numbers had there; as
    `own_numbers`."""
    own = own_numbers(robot, values, what)
    alike = all(robot.parameters[name] == value for name, value in own.items())
    return robot if alike else with_parameters(robot, own)


ENTRY = re.compile(r"(.+?) = (-?[\d.]+(?:e[-+]\d+)?)(?:, |$)")
"""A parameter as a run tells of it; its name may hold commas and equals signs."""


def recorded(run: Run) -> dict[str, float]:
    """Return the values of parameters that a run tells of."""
    entries = ENTRY.findall(str(run.attrs.get("parameters", "")))
    return {name: float(value) for name, value in entries}


def described(robot: Model, run: Run) -> dict[str, float]:
    """Return the values that a run tells of, of numbers of the description; those of controllers
    and drives are none."""
    found = {}
    for path, value in recorded(run).items():
        with suppress(MechanismError):
            located(robot.mechanism, path)
            found[path] = value
    return found


def held_otherwise(robot: Model, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return which of the values of numbers the description holds with others, which it holds, by
    path."""
    held = {path: located(robot.mechanism, path)[1] for path in values}
    return {path: (value, held[path]) for path, value in values.items() if held[path] != value}
