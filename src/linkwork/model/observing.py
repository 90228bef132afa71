"""Observing: the numbers of a state as a controller sees them, by name, each read when it is first
asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.control.observation import (
    OF_CHARTS,
    Names,
    Observation,
    Quantity,
    Readings,
    expression,
)
from linkwork.equations import Equations, functions
from linkwork.errors import LinkworkError
from linkwork.model.charts import CompiledChart
from linkwork.model.reordering import ordered
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.model.model import Model

JOINTS = ("position", "rate")


def observation(
    chart: CompiledChart,
    names: Names,
    q: np.ndarray,
    v: np.ndarray,
    extras: np.ndarray | None = None,
    parameters: Mapping[str, float] | None = None,
    turned: Callable[[np.ndarray], np.ndarray] = lambda read: read,
) -> Observation:
    """Return the observation of q and v in a chart; the joints' quantities are evaluated together.

    extras: extra states in the order of the names; parameters: of controllers and drives, by name
    turned: adds whole turns to the coordinates that are read off q
    """
    labels = {"position": names.coordinates, "rate": names.rates}

    @cache
    def rated() -> tuple[CompiledChart, np.ndarray]:
        """The chart whose kernels evaluate what depends on no choice of it, and its rates."""
        return (chart.free, chart.weighed(q, v, chart.p)[0]) if chart.told() else (chart, v)

    @cache
    def joints() -> dict[str, np.ndarray]:
        own, rates = rated()
        positions, rates = own.compiled("observation of joints", joints_function)(q, rates, chart.p)
        return dict(zip(JOINTS, (turned(positions), rates), strict=True))

    @cache
    def quantity(key: Quantity) -> np.ndarray:
        if key.name in labels.get(key.kind, ()):
            place = labels[key.kind].index(key.name)
            return joints()[key.kind][place : place + 1]
        own, rates = (chart, v) if key.kind in OF_CHARTS else rated()
        kernel = own.compiled(
            f"observation of {key}", lambda equations: quantity_function(equations, key)
        )
        return kernel(q, rates, chart.p)[0]

    def parameter(name: str, default: float) -> float:
        return (parameters or {}).get(name, default)

    def extra(name: str) -> float:
        return float(np.asarray(extras)[names.extras.index(name)])

    return Observation(names, Readings(quantity, parameter, extra))


def joints_function(equations: Equations) -> ca.Function:
    """Return (q, v) -> coordinates and rates of all joints."""
    outputs = {
        "positions": equations.joints.positions(),
        "rates": ca.mtimes(equations.joints.rate_rows(), equations.rates),
    }
    return functions.function("observation", equations, outputs, v=equations.v)


def quantity_function(equations: Equations, key: Quantity) -> ca.Function:
    """Return (q, v) -> one quantity."""
    outputs = {"quantity": expression(equations, key)}
    return functions.function("observation", equations, outputs, v=equations.v)


def observed(robot: Model, state: State) -> Observation:
    """Return one state as controllers see it, as numbers: `Robot.observe`."""
    if robot.own(state).batch:
        raise LinkworkError("a controller sees one state, not a stack; take one by state.at(index)")
    chart, names = ordered(robot, robot.chart_of(state), state.q), robot.names
    return observation(chart, names, state.q, state.rates, turned=lambda _: state.positions)
