"""Sensitivities: how what a run recorded changes with the numbers that determine it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.gradients.amplification import require_meant
from linkwork.gradients.chain import chained
from linkwork.gradients.links import Changes, LossSlopes, Partials
from linkwork.gradients.numbers import Numbers
from linkwork.gradients.retraced import Retraced, retraced
from linkwork.gradients.run_kernels import Expressions
from linkwork.gradients.told import FOUND, TOLD
from linkwork.gradients.work_done import WorkDone, power
from linkwork.simulation import Run
from linkwork.simulation.variables import Variable, dataset_of

if TYPE_CHECKING:
    import xarray

NUMBER, EVENT_TIME, WORK = "number", "event_time", "work"

ERRORS = {  # why these have no derivative
    "closure_error": "is what rounding leaves of zero",
    "energy_balance": "is what errors of the run leave of zero, of work and energies",
}


def sensitivity(
    run: Run, quantities: Sequence[str] | str | None = None, to: Sequence[str] | str | None = None
) -> xarray.Dataset:
    """Return the derivatives of what a run recorded: `Run.sensitivity`."""
    of = retraced(run)
    wanted, numbers = quantities_of(run, quantities), Numbers(of)
    names = numbers.chosen(to)
    changes = numbers.changes(names)
    begun = np.abs(changes.y).max(initial=1.0)
    for link in chained(of):
        link.along(changes)
    require_meant(of, np.abs(changes.sample_y).max(initial=0.0) / begun, 4, np.inf)
    # What is read, from the changes of states, inputs and parameters at the samples.
    found = {}
    for name in wanted:
        if name == EVENT_TIME:
            values = np.array([event_along(of, i, changes) for i in range(len(of.happened))])
            require_finite(name, values)
            found[name] = Variable(("event", NUMBER), values, {"units": "s"})
            continue
        told = run.variables[name]
        if name == WORK:
            values = work_along(of, names, changes)
            require_finite(name, values)
            found[name] = Variable((*told.dims, NUMBER), values, told.attrs)
            continue
        values = np.empty((told.shape[0], len(names), int(np.prod(told.shape[1:]))))
        for own, partials in readings(of, name):
            states = changes.sample_y[own], changes.sample_held[own], changes.sample_t[own]
            values[own] = partials.along(changes, *states)
        require_finite(name, values)
        shape = (*told.shape, len(names))
        values = np.swapaxes(values, 1, 2).reshape(shape)
        found[name] = Variable((*told.dims, NUMBER), values, told.attrs)
    axes = {axis for variable in found.values() for axis in variable.dims}
    coords = {axis: run.coords[axis] for axis in run.coords if axis in axes}
    coords[NUMBER] = Variable((NUMBER,), np.array(names, dtype=object))
    return dataset_of(found, coords, {})


def pulled_back(
    run: Run, weights: Mapping[str, ArrayLike], to: Sequence[str] | str | None = None
) -> dict[str, float]:
    """Return the derivatives of a sum of what a run recorded: `Run.gradient`."""
    of = retraced(run)
    given = checks.by_name(weights, "the weights", "{'tool_pose': ...}")
    numbers = Numbers(of)
    names, slopes = numbers.chosen(to), numbers.slopes()
    totals, grown = np.zeros(len(numbers.names) + len(numbers.samples)), 0.0
    for name in quantities_of(run, [*given]):
        if name == EVENT_TIME:
            bars = checks.finite(given[name], f"weights of {name}")
            require_shape(name, bars, (len(of.happened),))
            for i, bar in enumerate(bars):
                event_against(of, i, slopes, bar)
            continue
        shape, bars = of.record.shape(name), checks.finite(given[name], f"weights of {name}")
        require_shape(name, bars, shape)
        bars = bars.reshape(shape[0], -1)
        if name == WORK:
            share, grown = work_against(of, slopes, bars[:, 0])
            totals += share
        else:
            pull_back(of, slopes, name, bars)
    totals += gathered(of, numbers, slopes)
    require_meant(of, max(grown, slopes.grown), 4)
    require_finite("the loss", totals)
    found = dict(zip((*numbers.names, *numbers.samples), totals.tolist(), strict=True))
    return {name: found[name] for name in names}


def require_shape(name: str, bars: np.ndarray, shape: tuple[int, ...]) -> None:
    """Refuse weights that are not as a quantity was recorded."""
    if bars.shape != shape:
        raise LinkworkError(
            f"the weights of {name} have the shape {bars.shape}; it was recorded in {shape}"
        )


def event_along(of: Retraced, number: int, changes: Changes) -> np.ndarray:
    """Return the changes (D) of the time of an event; at the end of a run they are known there."""
    place = len(of.samples.t) - len(of.happened) + number
    if of.ends(place):
        return changes.sample_t[place]
    states = changes.sample_y[place][None], changes.sample_held[place][None]
    return of.moment_of(number).along(changes, *states)[0, :, 0]


def event_against(of: Retraced, number: int, slopes: LossSlopes, bar: float) -> None:
    """Add the derivative of a loss with respect to the time of an event."""
    place = len(of.samples.t) - len(of.happened) + number
    if of.ends(place):
        slopes.sample_t[place] += bar
    else:
        slopes.add(np.array([place]), *of.moment_of(number).against(slopes, np.array([[bar]])))


def pull_back(of: Retraced, slopes: LossSlopes, name: str, bars: np.ndarray) -> None:
    """Add derivatives (S, rows) of a loss with respect to a quantity."""
    if name in TOLD:
        pull(of, slopes, name, TOLD[name], bars)
        return
    found = of.robot.once(FOUND[name])
    parts = [found.slope(of.values(name, found, own)) for own in in_segments(of)]
    pull(of, slopes, name, found, bars * np.concatenate(parts))


def pull(
    of: Retraced, slopes: LossSlopes, name: str, expression: Expressions, bars: np.ndarray
) -> None:
    """Add derivatives (S, rows) of a loss with respect to an expression that is read at samples."""
    for own in in_segments(of):
        slopes.add(own, *of.pulled(name, expression, own, bars[own]).against(slopes))


def gathered(of: Retraced, numbers: Numbers, slopes: LossSlopes) -> np.ndarray:
    """Lead derivatives of a loss back to the start; return those with respect to all numbers, then
    to the values of sampled forces."""
    found = led_back(of, numbers, slopes)
    return np.append(found, numbers.by_samples(slopes)) if numbers.samples else found


def work_along(of: Retraced, names: tuple[str, ...], changes: Changes) -> np.ndarray:
    """Return the changes (S, D) of the work; changes: led along the run."""
    done = WorkDone(of)
    done.require_no_jumps()
    inner = Numbers(done.at_nodes).changes(names)
    for link in chained(done.at_nodes):
        link.along(inner)
    powers = np.empty((len(done.at_nodes.samples.t), len(names)))
    for own, partials in partials_of(done.at_nodes, "power", power):
        states = inner.sample_y[own], inner.sample_held[own], inner.sample_t[own]
        powers[own] = partials.along(inner, *states)[:, :, 0]
    at_end = done.at_end[:, None] * changes.sample_t[: len(done.at_end)]
    return done.weights.along(powers[:-1]) + at_end


def work_against(of: Retraced, slopes: LossSlopes, bars: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the derivatives of a sum of bars (S,) times the work by all numbers, but for what the
    time of its end adds to the slopes, and how many times larger they have become."""
    done = WorkDone(of)
    done.require_no_jumps()
    inner = Numbers(done.at_nodes)
    own = inner.slopes()
    pull(done.at_nodes, own, "power", power, np.append(done.weights.against(bars), 0.0)[:, None])
    slopes.sample_t[: len(bars)] += done.at_end * bars
    return gathered(done.at_nodes, inner, own), own.grown


def led_back(of: Retraced, numbers: Numbers, slopes: LossSlopes) -> np.ndarray:
    """Lead derivatives of a loss back to the start; return those with respect to all numbers."""
    for link in reversed(chained(of)):
        link.against(slopes)
    return numbers.gathered(slopes)


def readings(of: Retraced, name: str) -> Iterator[tuple[slice, Partials]]:
    """Yield which samples are in the same segment, and the Jacobians of a quantity at them; of
    events not."""
    found = None if name in TOLD else of.robot.once(FOUND[name])
    for own, partials in partials_of(of, name, TOLD[name] if found is None else found):
        if found is not None:
            slope = found.slope(of.values(name, found, own))[:, None]
            y, r, p = (slope @ part for part in (partials.y, partials.r, partials.p))
            partials = Partials(y, r, p, partials.inputs)
        yield own, partials


def partials_of(
    of: Retraced, name: str, expression: Expressions
) -> Iterator[tuple[slice, Partials]]:
    """Yield which samples are in the same segment, and the Jacobians of an expression at them."""
    for own in in_segments(of):
        states = of.samples.of(own)
        yield own, of.partials(of.segments[states.segment[0]].chart, name, expression, states)


def in_segments(of: Retraced) -> list[slice]:
    """Return which samples are in the same segment, where they follow each other; of events
    not."""
    segments = of.samples.segment[: len(of.samples.t) - len(of.happened)]
    inner = (np.flatnonzero(segments[1:] != segments[:-1]) + 1).tolist()
    return [slice(*ends) for ends in pairwise([0, *inner, len(segments)]) if len(segments)]


def quantities_of(run: Run, quantities: Sequence[str] | str | None) -> tuple[str, ...]:
    """Return the quantities asked for, all that were recorded and are differentiated where none
    are; refuse others."""
    variables = run.variables
    if quantities is None:
        return tuple(name for name in TOLD if name in variables)
    asked = (quantities,) if isinstance(quantities, str) else checks.names(quantities, "quantities")
    if all(name in TOLD and name in variables for name in asked):  # those that are asked for alone
        return asked
    happened = EVENT_TIME in run.coords and len(run.coords[EVENT_TIME].values)
    told = (name for name in (*TOLD, *FOUND, WORK) if name in variables)
    known = (*told, *(EVENT_TIME,) * bool(happened))
    for name in asked:
        if name in variables and name not in known:
            why = f", for it {ERRORS[name]}" if name in ERRORS else ""
            raise LinkworkError(f"{name} is not differentiated{why}; these are: {', '.join(known)}")
    checks.known(asked, known, "quantity")
    return asked


def require_finite(what: str, values: np.ndarray) -> None:
    """Refuse derivatives that are not defined."""
    if not np.isfinite(values).all():
        raise LinkworkError(
            f"the derivative of {what} is not defined along this run: it passes something that has "
            "none, such as the root or the direction of a vector that vanishes"
        )
