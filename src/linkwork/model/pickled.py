"""Pickled robots: a robot is told by what it was made of, and made of it again where it is read.

That is its description, what was asked of it, the values of its free numbers, its reference, and
the charts in which states were given. Equations and machine code come from the folder where they
are kept, or are made anew. So it computes the same there, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import numpy as np

from linkwork.equations.chart import Chart
from linkwork.mechanism import Mechanism
from linkwork.model.charts import CompiledChart
from linkwork.model.model import Model
from linkwork.model.parameters import with_parameters

Kind = TypeVar("Kind", bound=Model)


class Made(NamedTuple):
    """Hold what a robot was made of.

    asked: the description, the independent rates and the free numbers that were asked for;
    parameters: values of the free numbers by path; reference: q there (nq); charts: by independent
    rates
    """

    asked: tuple[Mechanism, tuple[str, ...], tuple[str, ...]]
    parameters: dict[str, float]
    reference: np.ndarray
    charts: Mapping[tuple[str, ...], Chart]


def made_of(robot: Model) -> Made:
    """Return what a robot was made of."""
    charts = {names: robot.charts[names].key for names in robot.charts}
    return Made(robot.asked, dict(robot.parameters), robot.equations.reference, charts)


def again(kind: type[Kind], made: Made) -> Kind:
    """Return a robot made again."""
    robot = kind(*made.asked)
    if made.parameters != robot.parameters:
        robot = with_parameters(robot, made.parameters)
    if not np.array_equal(robot.equations.reference, made.reference):
        vars(robot)["equations"] = robot.equations.about(made.reference)
    for names, chart in made.charts.items():
        if names not in robot.charts:
            robot.charts[names] = CompiledChart(robot.equations.in_chart(chart), robot.p)
    return robot
