"""The map between joints and motors, compiled: what each is at states, refused where it is not
defined.

States take a short way (`short_way`), whose code watches over its results itself; what that doubts
is looked at again here, and refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import inf

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.analysis import loop_map as maps
from linkwork.analysis.loop_map import LoopMap
from linkwork.analysis.short_way import Quick, short_way
from linkwork.equations import Equations
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.model.checks import PIVOT_BOUND, SingularError
from linkwork.model.state import State
from linkwork.robot import Robot

SIDEWAYS = 1e-7
"""Least determinant of a block of J from which it is inverted, over that where the equations are
arranged."""


class QuickCalls(dict[str, Quick]):
    """Hold the shortest calls by name, each made when it is first asked for."""

    def __init__(self, make: Callable[[str], Quick]):
        super().__init__()
        self._make = make

    def __missing__(self, name: str) -> Quick:
        return self.setdefault(name, self._make(name))


@dataclass(frozen=True, eq=False)
class CompiledMap:
    """Hold the map of a robot's motors by joints in the rates of a chart.

    about: the state that the equations are arranged at
    """

    robot: Robot
    joints: tuple[str, ...]
    motors: tuple[str, ...]
    chart: CompiledChart
    about: State

    @cached_property
    def expressions(self) -> LoopMap:
        """The same as expressions."""
        return LoopMap(self.chart.equations, self.joints, self.motors)

    @cached_property
    def quick(self) -> Mapping[str, Quick]:
        """What gives one result at states (and vectors), None where that is doubted."""
        return QuickCalls(lambda name: self._short(name, None))

    @cached_property
    def of_state(self) -> Mapping[str, Quick]:
        """The same at the rates of the states."""
        home = self.robot.chart.equations
        return QuickCalls(lambda name: self._short(name, home))

    def found(self, name: str, state: State, given: np.ndarray | None = None) -> np.ndarray:
        """Return what is asked for (..., size) at states, refused where it is not defined.

        given: of k joints or motors, or the rates of the map's chart.
        """
        parts = () if given is None else (given,)
        found, pivots, sides = self._kernel(name)(self.robot.own(state).q, *parts, self.robot.p)
        for part in parts:
            checks.finite(part, "what is given")
        if not np.abs(pivots).min(initial=inf) > PIVOT_BOUND:
            raise SingularError(
                f"the joints {', '.join(self.joints)} do not determine the motors "
                f"{', '.join(self.motors)} here: the loops are singular; take another pose"
            )
        if not np.abs(sides).min(initial=inf) > self._least(name):
            raise SingularError(
                f"the motors {', '.join(self.motors)} do not hold {', '.join(self.joints)} in this "
                "pose: their Jacobian is singular; take another pose"
            )
        return found

    def rates(self, state: State) -> np.ndarray:
        """Return the rates of a state in the map's chart, those of others as they are."""
        given = self.robot.chart_of(self.robot.own(state))
        if given.independent == self.chart.independent:
            return state.rates
        w = given.weighed(state.q, state.rates, self.robot.p)[0]
        return w.take(self.chart.equations.chart.independent, axis=-1)

    @cached_property
    def places(self) -> list[int]:
        """Where the joints' rates are among the chart's."""
        return self.expressions.places

    @cached_property
    def _kernel(self) -> Callable[[str], Kernel]:
        return lru_cache(maxsize=None)(
            lambda name: self._compiled(name, lambda: maps.function(self.expressions, name))
        )

    def _short(self, name: str, rates: Equations | None) -> Quick:
        what = f"{name}, watched" + (f", in {rates.independent}" if rates else "")
        kernel = self._compiled(what, lambda: maps.watched(self.expressions, name, rates))
        size = len(self.joints)
        shape = (size, size) if name in maps.MATRICES else (size,)
        return short_way(kernel, self.robot, shape, self._least(name), of_state=rates is not None)

    def _compiled(self, what: str, make: Callable[[], ca.Function]) -> Kernel:
        return self.chart.compiled(f"{what} of {self.motors} by {self.joints}", lambda _: make())

    def _least(self, name: str) -> float:
        return SIDEWAYS * self._usual if name in maps.INVERTED else 0.0

    @cached_property
    def _usual(self) -> float:
        """The least determinant of a block of J, in own units, where the equations are arranged."""
        kernel = self._kernel("joint_rates")
        return abs(kernel.flat(self.about.q, np.zeros(len(self.joints)), self.robot.p).item(-1))
