"""Robots, runs and results as notebooks show them: one picture beside the facts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from linkwork.analysis import Identification, Modes
from linkwork.checks import amount
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.mechanism.parameter_units import unit_of_parameter, with_unit
from linkwork.robot import Ensemble, Motion, Robot, State
from linkwork.simulation import Run, Status
from linkwork.views.drawing import plot_mechanism
from linkwork.views.pages import page, picture
from linkwork.views.plots import USUAL, plot_run
from linkwork.views.style import label_time, look, new_figure, styled, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEW = 8  # names, curves or poses that are shown
MOST_BODIES = 40  # of a mechanism that is derived only to be drawn
MEMBERS = 50  # curves of an ensemble
WIDTH, HEIGHT = 5.4, 2.6  # of curves [in]
NUMBERS = count()  # of the pictures of a session: their parts have names of their own


class Portrait(NamedTuple):
    """Hold what is shown of an object: a title, facts by name, a figure, its width [em]."""

    title: str
    facts: Sequence[tuple[str, str]]
    figure: Figure | None
    width: int = 26


def html(thing: object) -> str | None:
    """Return an object as HTML; None where it cannot be drawn."""
    try:
        title, facts, figure, width = portrait(thing)
        drawing = figure and picture(f"lw{next(NUMBERS)}", title, svg(figure, cropped=True))
    except LinkworkError:
        return None
    return page(
        "portrait.html",
        title=title,
        rows=[(name, told) for name, told in facts if told],
        drawing=drawing,
        width=width,
    )


@singledispatch
def portrait(thing: Any) -> Portrait:
    """Return what is shown of an object."""
    raise LinkworkError(f"{type(thing).__name__} has no picture")


@portrait.register
def of_robot(robot: Robot) -> Portrait:
    figure = plot_mechanism(robot, robot.home).get_figure(root=True)
    found = [
        ("mobility", f"{robot.mobility}, {'planar' if robot.planar else 'spatial'}"),
        ("loops", str(robot.equations.topology.loops)),
        *facts_of(robot.mechanism),
        ("redundant rows", some(robot.redundant)),
        ("idle freedoms", some(robot.idle)),
        ("free numbers", some(free_numbers(robot))),
        ("notes", " ".join(robot.notes)),
    ]
    title = f"Robot {robot.mechanism.name}"
    return Portrait(title, found, figure, 20)


@portrait.register
def of_mechanism(mechanism: Mechanism) -> Portrait:
    figure = None
    if len(mechanism.bodies) <= MOST_BODIES:
        robot = Robot(mechanism)
        figure = plot_mechanism(robot, robot.home).get_figure(root=True)
    found = [*facts_of(mechanism), ("caveats", " ".join(mechanism.caveats))]
    title = f"Mechanism {mechanism.name}"
    return Portrait(title, found, figure, 20)


@portrait.register
def of_run(run: Run) -> Portrait:
    found = [
        ("ended", f"{run.status.name.lower()}: {run.message}"),
        ("method", str(run.attrs.get("method", ""))),
        ("steps", f"{run.steps:,} accepted, {run.rejected:,} rejected"),
        ("samples", f"{len(run.time):,}"),
        ("closure error", f"{run.closure_error:.2g}"),
        ("holds", ", ".join(run.variables)),
    ]
    shown = next((name for name in USUAL if name in run.variables), None)
    figure = plot_run(run, shown) if shown and len(run.time) else None
    name = run.attrs.get("mechanism", "")
    return Portrait(f"Run of {name}" if name else "Run", found, figure)


@portrait.register
def of_ensemble(ensemble: Ensemble) -> Portrait:
    kinds, counts = np.unique(ensemble.status, return_counts=True)
    robot = ensemble.members.robot
    units = {name: unit_of_parameter(robot.mechanism, name) for name in ensemble.parameters}
    found = [
        ("members", f"{len(ensemble):,}"),
        *((Status(kind).name.lower(), f"{k:,}") for kind, k in zip(kinds, counts, strict=True)),
        ("parameters", some(f"{name} [{unit}]" if unit else name for name, unit in units.items())),
        ("samples", f"{len(ensemble.settings.save_at):,}"),
        ("largest closure error", f"{np.nanmax(ensemble.closure_error, initial=0.0):.2g}"),
    ]
    # The first driven coordinate: over time where it was saved, else at the end by member.
    name = (*(each for each in robot.actuators if each in robot.coordinates), *robot.coordinates)[0]
    label = f"{name} [{robot.unit(name)}]"
    shown = np.unique(np.linspace(0, len(ensemble) - 1, MEMBERS).astype(int))
    time = np.asarray(ensemble.settings.save_at)
    with styled():
        figure = new_figure(WIDTH, HEIGHT)
        axes = figure.subplots()
        axes.set_ylabel(label)
        if len(time) > 1:
            values = ensemble.dataset["joint_position"].sel(coordinate=name).values[shown]
            axes.plot(time, values.T, **look(0), alpha=max(0.15, 1 / len(shown)))
            label_time(axes, time)
        else:
            axes.plot(ensemble.final[name], "o", ms=3, color=look(0)["color"])
            axes.set_xlabel("member")
            axes.set_ylabel(f"{label} at the end")
    return Portrait(f"Ensemble of {robot.mechanism.name}", found, figure)


@portrait.register
def of_motion(motion: Motion) -> Portrait:
    state = motion.state
    time = motion.time
    found = [
        ("duration", f"{time[-1] - time[0]:g} s, {amount(len(time), 'sample')}"),
        ("independent", some(state.independent)),
        ("largest rate", f"{np.abs(motion.joint_rates).max(initial=0.0):.4g}"),
        ("largest acceleration", f"{np.abs(motion.joint_accelerations).max(initial=0.0):.4g}"),
    ]
    with styled():
        figure = new_figure(WIDTH, HEIGHT)
        axes = figure.subplots()
        for index, name in enumerate(state.coordinates[:FEW]):
            axes.plot(time, state.positions[:, index], label=name, **look(index))
        axes.set_ylabel("joints [m, rad]")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.03), borderaxespad=0)
        label_time(axes, time)
    return Portrait("Motion", found, figure)


@portrait.register
def of_modes(modes: Modes) -> Portrait:
    values = zip(modes.what, modes.asked, strict=True)
    found = [
        ("found", f"{len(modes)}{' (sure)' if modes.sure else ''}"),
        ("with", some([f"{name} = {value:.6g}" for name, value in values])),
        ("starts", f"{modes.starts:,}, of which {modes.converged:,} ended in a solution"),
        ("likely missing", f"{modes.missing:.2g}"),
        ("within limits", f"{int(np.sum(modes.within_limits))} of {len(modes)}"),
    ]
    figure = None
    if modes.robot is not None and len(modes):
        figure = side_by_side(modes.robot, modes.states.at(slice(0, FEW)))
    return Portrait("Modes", found, figure, 32)


@portrait.register
def of_identification(found: Identification) -> Portrait:
    facts = [
        ("base parameters", str(len(found.values))),
        ("condition", f"{found.condition:.4g}"),
        ("remains", ", ".join(f"{value:.3g}" for value in found.residual)),
    ]
    # Each value over the described one, or over the largest where that is zero.
    size = np.where(found.described == 0, np.abs(found.described).max(initial=0.0), found.described)
    size = np.where(size == 0, 1.0, np.abs(size))
    places = np.arange(len(found.values))
    with styled():
        figure = new_figure(WIDTH, HEIGHT)
        axes = figure.subplots()
        off = (found.values - found.described) / size
        axes.errorbar(places, off, found.deviations / size, fmt="o", ms=3, color=look(0)["color"])
        axes.axhline(0.0, color="0.5", linewidth=0.8)
        axes.set_xlabel("base parameter")
        axes.set_ylabel("identified less described,\nover described")
    return Portrait("Identification", facts, figure)


def side_by_side(robot: Robot, states: State) -> Figure:
    """Draw the robot at some states beside each other."""
    columns = min(len(states), 4)
    rows = -(-len(states) // columns)
    with styled():
        figure = new_figure(2.2 * columns, 2.2 * rows)
        for number, state in enumerate(states, 1):
            space = {} if robot.planar else {"projection": "3d"}
            axes = figure.add_subplot(rows, columns, number, **space)
            plot_mechanism(robot, state, axes)
            axes.set_title(str(number))
    return figure


def facts_of(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return what a mechanism is made of."""
    kinds = [joint.type for joint in mechanism.joints.values()]
    return [
        ("bodies", f"{len(mechanism.bodies)}: {some(mechanism.bodies)}"),
        ("joints", ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))),
        ("actuators", some(mechanism.actuators)),
        ("tools", some(mechanism.tools)),
    ]


def free_numbers(robot: Robot) -> list[str]:
    """Return the free numbers of a robot with their values and units."""
    return [
        with_unit(robot.mechanism, path, f"{path} = {value:g}")
        for path, value in robot.parameters.items()
    ]


def some(names: Any) -> str:
    """Return the first of some names, and how many others there are."""
    names = [*names]
    others = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return ", ".join(names[:FEW]) + others
