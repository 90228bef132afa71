"""Parameters: the same robot with other values of its free numbers.

Equations and kernels are functions of p; only the reference configuration, which has to be closed,
depends on its values.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TypeVar

import numpy as np

from linkwork.equations.homing import closed_reference, home
from linkwork.equations.reference import CLOSED, guess, starts
from linkwork.equations.reflections import reflect
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.mechanism.numbers import edited
from linkwork.model import checks
from linkwork.model.model import Model
from linkwork.readonly import FreeNumbers

Known = TypeVar("Known", bound=Model)


def with_parameters(robot: Known, values: Mapping[str, float]) -> Known:
    """Return the robot with other values of its free numbers; see `Robot.with_parameters`."""
    # Values of numbers that are free, which the description may hold.
    if not isinstance(values, Mapping):
        raise LinkworkError(
            f"the parameters are {values!r}; give values by path, such as {{'platform.mass': 2.0}}"
        )
    if values and not robot.parameters:
        raise LinkworkError(
            "no number of this robot is free; free some first: robot.free('platform.mass')"
        )
    checks.known(values, tuple(robot.parameters), "free parameter")
    given = {path: checks.number(value, f"parameter {path!r}") for path, value in values.items()}
    mechanism = edited(robot.mechanism, given)
    parameters = FreeNumbers(robot.parameters | given)
    p = np.array(list(parameters.values()))
    p.flags.writeable = False
    # All of the robot but what was found with the former values.
    other = object.__new__(type(robot))
    for name, value in vars(robot).items():
        if not isinstance(getattr(type(robot), name, None), cached_property):
            vars(other)[name] = value
    vars(other).update(
        mechanism=mechanism,
        parameters=parameters,
        p=p,
        origin=robot if robot.origin is None else robot.origin,
        chart=robot.chart.with_parameters(p),
        charts=robot.charts.with_parameters(p),
        run_charts=robot.run_charts.with_parameters(p),
    )
    other.charts[other.independent] = other.chart
    # Where a length changes the loops close elsewhere.
    closed = reference(other, mechanism)
    refuse_held(other, closed)
    if closed is not robot.equations.reference:
        # Coordinates that are an object of their own: states of the other robot are looked at.
        vars(other).update(
            equations=robot.equations.about(closed), coordinates=mechanism.coordinates
        )
    return other


def reference(robot: Model, mechanism: Mechanism) -> np.ndarray:
    """Return the closed reference configuration of the robot with its own p: the one it has where
    that is still closed."""
    equations, kept = robot.equations, robot.equations.reference
    gap = robot.chart.kernel("closure_step")(kept)[1][0]
    if np.isnan(gap):
        shown = ", ".join(f"{path} = {value:g}" for path, value in robot.parameters.items())
        raise LinkworkError(
            f"the loops have no meaning with {shown}; a pitch that is free may not be zero"
        )
    if gap <= CLOSED and not equations.rows.unheld:
        return kept
    tree, topology = equations.tree, equations.topology
    if equations.caveats:
        return closed_reference(tree, equations.rows, [kept], robot.p)
    start = guess(mechanism, topology, tree)
    # Home that is off the reference keeps its branch.
    begin = [kept] if equations.notes else starts(mechanism, topology, tree, start)
    return home(equations.joints, equations.rows, start, begin, robot.p)


def refuse_held(robot: Model, q: np.ndarray) -> None:
    """Refuse values with which redundant rows of the description hold motions of their own."""
    equations = robot.equations
    if not equations.redundant:
        return
    Phi = robot.chart.constraint_jacobian(q)
    if len(reflect(equations.natural(Phi)).rows) > len(equations.chart.rows):
        shown = ", ".join(f"{path} = {value:g}" for path, value in robot.parameters.items())
        raise LinkworkError(
            f"with {shown} the loops hold more than with the numbers of the description, where "
            f"{', '.join(equations.redundant)} follow from the other rows, and the mechanism is "
            "locked or loses motions; choose values that keep its geometry, such as turns of all "
            "parallel axes alike"
        )
