"""Cases: the ways to drive the robot that a study compares. Each has a controller, or constant
forces, and its numbers.

Numbers that vary are parameters of the runs, or weights, from which a controller's parameters
follow: each member's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from linkwork.control import Drive, Sampler
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import MechanismError
from linkwork.robot import Motion, Robot, State
from linkwork.runs.system import system
from linkwork.sweeps.controllers import Law
from linkwork.sweeps.study import Study, StudyError


@dataclass(frozen=True)
class Case:
    """Hold one way to drive the robot.

    law: the controller; goal: what it leads to; parameters: names of those of the runs
    weights: names of numbers that parameters follow from; weighted: gives the controller that has
    other values of these
    """

    law: Law | Sampler | None
    goal: State | Motion | None
    parameters: tuple[str, ...]
    weights: tuple[str, ...] = ()
    weighted: Callable[[Mapping[str, float]], Law] | None = None

    @property
    def numbers(self) -> tuple[str, ...]:
        """The names of all that can vary."""
        return (*self.weights, *self.parameters)

    def values(self, robot: Robot, given: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the runs' parameters (M) by name for given numbers (M); nan where weights do not
        make a controller."""
        weights = {name: column for name, column in given.items() if name in self.weights}
        if not weights or self.weighted is None:
            return dict(given)
        table, places = np.unique(
            np.stack([*weights.values()], axis=1), axis=0, return_inverse=True
        )
        rows = [
            gains(robot, self.weighted, dict(zip(weights, row, strict=True)))
            for row in table.tolist()
        ]
        names = dict.fromkeys(name for row in rows for name in row) or self.parameters
        found = {name: np.array([row.get(name, np.nan) for row in rows])[places] for name in names}
        return found | {name: column for name, column in given.items() if name not in weights}


def gains(
    robot: Robot, weighted: Callable[[Mapping[str, float]], Law], weights: Mapping[str, float]
) -> dict[str, float]:
    """Return the values that a controller with these weights gives its own parameters; none if
    there is no such one."""
    found: dict[str, float] = {}
    seen = robot.observe(robot.home)
    source = replace(
        seen.source, parameter=lambda name, value: found.setdefault(name, float(value))
    )
    try:
        weighted(weights)(0.0, replace(seen, source=source))
    except LinkworkError:
        return {}
    return found


def controlled(
    study: Study,
    name: str,
    goal: State | Motion,
    nominal: Robot,
    robot: Robot,
    drives: Mapping[str, Drive],
) -> Case:
    """Return what a controller of the study leads the robot by; nominal: the robot with the study's
    own numbers.

    Raises:
        StudyError: a controller that does not fit the robot.
    """
    given, where = study.controllers[name], ("controllers", name)
    try:
        law = given.forces(goal, nominal)
    except MechanismError as error:
        raise StudyError(error.what, (*where, *error.where)) from None
    except LinkworkError as error:
        raise StudyError(str(error), where) from None
    names = parameters(study, robot, law, drives, where)
    return Case(
        law, goal, names, given.weights, lambda weights: given.but(weights).law(goal, nominal)
    )


def pushed(study: Study, robot: Robot, drives: Mapping[str, Drive]) -> Case:
    """Return the constant forces of a study, which are parameters.

    Raises:
        StudyError: a force of what is no actuator.
    """
    for name in study.forces:
        if name not in robot.actuators:
            there = ", ".join(robot.actuators) or "none"
            raise StudyError(f"there is no actuator {name!r}; there are {there}", ("forces", name))

    def law(t: Any, state: Any) -> list[Any]:
        return [
            state.parameter(f"forces.{name}", study.forces.get(name, 0.0))
            for name in robot.actuators
        ]

    own = law if robot.actuators else None
    return Case(own, None, parameters(study, robot, own, drives, ("forces",)))


def parameters(
    study: Study,
    robot: Robot,
    law: Law | Sampler | None,
    drives: Mapping[str, Drive],
    where: tuple[str, ...],
) -> tuple[str, ...]:
    """Return the names of the parameters of a controller and the drives."""
    try:
        runs = system(robot, law, drives, (), (), {}, (0.0, study.duration))
    except LinkworkError as error:
        raise StudyError(str(error), where) from None
    return tuple(runs.acting.parameters) if runs.acting else ()


def reached(study: Study, name: str, robot: Robot, start: State) -> State | Motion:
    """Return what a controller leads to.

    Raises:
        StudyError: a goal out of reach.
    """
    guess = State.known(start.positions, start.rates, start.q, robot.coordinates, robot.independent)
    try:
        return study.controllers[name].goal.reached(robot, guess, study.duration, study.samples)
    except LinkworkError as error:
        raise StudyError(str(error), ("controllers", name, "goal")) from None
