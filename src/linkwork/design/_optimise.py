"""Optimise a design: numbers of the description, chosen by gradient for the best worst case.

    max t  over numbers z, a level t, and configurations q_k at all poses that count, with
    z within its bounds,    phi(q_k, p(z)) = 0,    x(q_k, p(z)) = x_k,    measure_k >= t,
    other measures no worse than their bounds,  joints within their ranges

The configurations are unknowns of their own, so that loops are closed by constraints and all
derivatives, second ones too, are exact (CasADi); IPOPT finds a local optimum. What it finds is
measured by the robot itself, with its numbers: poses led to from home on its own branch, in which
IPOPT begins again where it found others.

Source: of loops as constraints, Haug & Arora, Applied Optimal Design, 1979, sec. 2.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.design.choices import Choices, choices
from linkwork.design.judging import Measure, require_measurable
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.ipopt import LocalOptimum, Programme
from linkwork.patience import announced
from linkwork.robot import Robot

STEPS, BEGINNINGS = 500, 4
SAME = 1e-5  # part by which the robot's own measure may differ from what was found
PASSED = 0.01  # part by which it may be worse between samples without a warning
AT_BOUND = 1e-6  # part of the way between its bounds at which a choice is at one
SHOWN = 12  # numbers in a repr


@dataclass(frozen=True, eq=False)
class OptimalDesign:
    """Hold a design that is locally optimal.

    robot: with the chosen numbers
    chosen: of each choice its value, or the factor of several numbers; values: all numbers by path
    objective: what was optimised; before, after: its worst value, told by the robots themselves
    constraints: of each other measure its bound, and its value before and after
    active: names of the choices at a bound
    steps: of IPOPT; stationarity: residual of the conditions of optimality over the largest
        multiplier
    """

    robot: Robot
    chosen: dict[str, float]
    values: dict[str, float]
    objective: Measure
    before: float
    after: float
    constraints: dict[Measure, tuple[float, float, float]]
    active: tuple[str, ...]
    steps: int
    stationarity: float

    def __repr__(self) -> str:
        unit = f" {self.objective.unit(self.robot)}".rstrip()
        kind = type(self.objective).__name__
        lines = [
            f"Design of {self.robot.mechanism.name}, locally optimal: {kind} {self.after:.6g}"
            f"{unit}, {self.before:.6g} before ({self.steps} steps)"
        ]
        for measure, (bound, before, after) in self.constraints.items():
            word = "at least" if measure.larger_is_better else "at most"
            lines.append(
                f"  {type(measure).__name__} {after:.6g}, {word} {bound:.6g}, {before:.6g} before"
            )
        for name, value in list(self.chosen.items())[:SHOWN]:
            lines.append(f"  {value:<12.6g} {name}" + " (at its bound)" * (name in self.active))
        more = len(self.chosen) - SHOWN
        return "\n".join(lines + [f"  ... and {more} more"] * (more > 0))


@announced("optimising the design")
def optimise(
    robot: Robot,
    numbers: Mapping[Any, tuple[float, float]],
    objective: Measure,
    subject_to: Mapping[Measure, float] | None = None,
) -> OptimalDesign:
    """Choose numbers of a description for the best worst value of a measure.

    Args:
        robot: with as many actuators as freedoms and a tool that is led in as many coordinates; it
            has to reach all poses as it is.
        numbers: bounds by path [unit of the number], as for `Robot.free`; several numbers, by a
            pattern ("rod_*.length") or a tuple of paths and patterns, stay in proportion, and the
            bounds are those of their common factor, above 0 for lengths and masses.
        objective: an `Isotropy` or a `Frequency`, to be as large, or a `PeakForce`, to be as small
            as can be.
        subject_to: bounds of other measures that are kept: at least, or at most for forces.

    Returns:
        An `OptimalDesign`, a local optimum: others may lie elsewhere within the bounds.

    Raises:
        LinkworkError: numbers that cannot be free, bounds that leave out the robot as it is; poses
            out of its reach; no optimum found, and why; an optimum that lies beyond a singular
            pose, so that the robot does not get there from its home.

    Warns:
        ModelWarning: a measure along a path that is worse between its samples, by more than 1 %.
    """
    checks.needed(robot, Robot)
    if subject_to is not None and not isinstance(subject_to, Mapping):
        raise LinkworkError(
            f"the bounds are {checks.shown(subject_to)}; give them by measure, such as "
            "{measure: 1.0}"
        )
    kept = {} if subject_to is None else dict(subject_to)
    for measure in (objective, *kept):
        if not isinstance(measure, Measure):
            raise LinkworkError(
                f"a measure is {checks.shown(measure)}; give design.Isotropy(poses), PeakForce or "
                "Frequency"
            )
    require_measurable(robot)
    bounds = {
        each: checks.positive(b, f"the bound of {type(each).__name__}") for each, b in kept.items()
    }
    chosen = choices(robot, numbers)
    before = {measure: measure.value(chosen.robot) for measure in (objective, *bounds)}
    # What the robot itself is worth at the optimum.
    found = settled(chosen, objective, before[objective], bounds)
    better, after = found.robot, found.after
    for measure, value in after.items():
        warn_of_between(measure, better, value)
    at_ends = np.minimum(found.parts, 1 - found.parts) < AT_BOUND
    return OptimalDesign(
        better,
        dict(zip(chosen.names, chosen.at(found.parts).tolist(), strict=True)),
        chosen.values(chosen.at(found.parts)),
        objective,
        before[objective],
        after[objective],
        {each: (bound, before[each], after[each]) for each, bound in bounds.items()},
        tuple(name for name, end in zip(chosen.names, at_ends, strict=True) if end),
        found.steps,
        found.optimum.stationarity,
    )


class Settled(NamedTuple):
    """Hold a local optimum, the choices as parts of the ways between their bounds, the robot with
    them, its own measures, and the steps that led there."""

    optimum: LocalOptimum
    parts: np.ndarray
    robot: Robot
    after: dict[Measure, float]
    steps: int


def settled(
    chosen: Choices, objective: Measure, start: float, bounds: Mapping[Measure, float]
) -> Settled:
    """Return the local optimum that the robot itself tells, too.

    On its way IPOPT opens the loops, and may close them on other branches. Then it begins again, at
    the numbers that it found, in the configurations that the robot takes with them.
    """
    steps, elsewhere = 0, ""
    for _ in range(BEGINNINGS):
        optimum, parts = solved(chosen, objective, start, bounds)
        z = chosen.at(parts)
        robot = chosen.robot.with_parameters(chosen.values(z))
        after = {measure: told(measure, robot) for measure in (objective, *bounds)}
        level = -optimum.value * objective.better * scale_of(start)
        elsewhere, steps = told_elsewhere(objective, level, bounds, after), steps + optimum.steps
        if not elsewhere:
            return Settled(optimum, parts, robot, after, steps)
        chosen, start = replace(chosen, robot=robot, start=z), after[objective]
    raise LinkworkError(elsewhere)


def solved(
    chosen: Choices, objective: Measure, start: float, bounds: Mapping[Measure, float]
) -> tuple[LocalOptimum, np.ndarray]:
    """Return the local optimum, and the choices as parts of the ways between their bounds."""
    # Unknowns: the choices, the level, and the configurations at the points of each measure.
    part, level = ca.MX.sym("part", len(chosen.names)), ca.MX.sym("level")
    p, functions = chosen.parameters(part), chosen.robot.functions()
    scale = scale_of(start)
    x = [part, level]
    begin = [(chosen.start - chosen.lower) / chosen.width, np.array([start / scale])]
    equations, margins = [], []
    for measure, t in [(objective, scale * level), *bounds.items()]:
        points = measure.points(chosen.robot, functions)
        count = points.start.shape[1]
        w = ca.MX.sym("w", *points.start.shape)
        at = points.function.map(count)
        known = ca.DM(points.known)
        own = at(w, known, ca.repmat(p, 1, count), ca.repmat(ca.MX(t), 1, count))
        equations, margins = [*equations, ca.vec(own[0])], [*margins, ca.vec(own[1])]
        x, begin = [*x, ca.vec(w)], [*begin, points.start.ravel(order="F")]
    # Bounds: choices within theirs, equations zero, margins not negative.
    free = sum(part.size for part in begin[1:])
    lower = np.concatenate([np.zeros(len(chosen.names)), np.full(free, -np.inf)])
    upper = np.concatenate([np.ones(len(chosen.names)), np.full(free, np.inf)])
    g = ca.vertcat(*equations, *margins)
    held = sum(each.numel() for each in equations)
    most = np.concatenate([np.zeros(held), np.full(g.numel() - held, np.inf)])
    # The programme; what depends on nothing is refused.
    programme = Programme(
        ca.vertcat(*x),
        -objective.better * level,
        g,
        np.concatenate(begin),
        (lower, upper),
        (np.zeros(g.numel()), most),
    )
    for idle in programme.unmoved(len(chosen.names)):
        raise LinkworkError(
            f"nothing that is measured depends on {chosen.names[idle]!r}; leave it out, or measure "
            "what does"
        )
    found = programme.solve("design that keeps all loops closed and all bounds", STEPS)
    return found, np.clip(found.x[: len(chosen.names)], 0.0, 1.0)


def scale_of(value: float) -> float:
    """Return what a level is divided by: its value at the start, or 1 where that is zero."""
    return abs(value) if value else 1.0


def told(measure: Measure, robot: Robot) -> float:
    """Return the worst value of a robot; refuse poses that it does not reach from its home."""
    try:
        return measure.value(robot)
    except LinkworkError as error:
        raise LinkworkError(
            f"what IPOPT finds is no design: the robot with these numbers refuses ({error}); give "
            "narrower bounds"
        ) from None


def warn_of_between(measure: Measure, robot: Robot, value: float) -> None:
    """Warn where a measure is worse between its samples."""
    if (finer := measure.finer()) is measure:
        return
    between = told(finer, robot)
    if abs(between - value) > PASSED * abs(value):
        name = type(measure).__name__
        warnings.warn(
            f"between its samples {name} is {between:.6g}, not {value:.6g}; give more samples",
            ModelWarning,
            stacklevel=4,
        )


def told_elsewhere(
    objective: Measure,
    level: float,
    bounds: Mapping[Measure, float],
    after: Mapping[Measure, float],
) -> str:
    """Say which measure is that of configurations that the robot does not take: a level that is not
    its own, or a bound that it does not keep; nothing if none is."""
    missed = [(objective, level, abs(level - after[objective]))]
    missed += [(each, bound, (bound - after[each]) * each.better) for each, bound in bounds.items()]
    for measure, asked, lacking in missed:
        own = after[measure]
        if not lacking <= SAME * max(abs(asked), abs(own)):
            return (
                f"what IPOPT finds is no design: {type(measure).__name__} {asked:.6g} is that of "
                f"poses on other branches, where the robot from its home has {own:.6g}; give "
                "narrower bounds"
            )
    return ""
