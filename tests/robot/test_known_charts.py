"""Charts found by the decisions that led to known ones are those that are chosen anew."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import charts_at
from linkwork.model import chart_margins
from linkwork.model.known_charts import KnownCharts
from linkwork.runs.next_chart import choice

from tests.catalogue import WHOLE, built


def jacobians(robot: lw.Robot, count: int, far: float, seed: int) -> np.ndarray:
    """Return constraint Jacobians at configurations about home; the loops may be open there."""
    rng, q = np.random.default_rng(seed), robot.home.q
    size = robot.equations.tree.length
    return robot.chart.constraint_jacobian(q + far * size * rng.normal(size=(count, q.size)))


def by_place(found: list, count: int) -> list:
    """Return the chart chosen at each configuration, None where there is none."""
    charts: list = [None] * count
    for members, chart in found:
        for place in members.tolist():
            assert charts[place] is None
            charts[place] = chart
    return charts


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "name", ["prr3", "delta", "stewart", "agile_wrist", "bennett", "tripteron"]
)
def test_known_charts_are_those_chosen_anew(name):
    robot = built(name)
    rates = robot.equations.tree.rates
    preferred = [rates.index(rate) for rate in robot.independent]
    known = KnownCharts(robot.equations, preferred)
    for far, seed in ((0.05, 1), (0.3, 2), (0.3, 3), (1.0, 4)):
        Phi = jacobians(robot, 60 if WHOLE else 25, far, seed)
        regular, found = known.at(Phi)
        assert (regular == robot.equations.regular(Phi)).all()
        anew = by_place(charts_at(robot.equations, Phi, preferred), len(Phi))
        assert by_place(found, len(Phi)) == anew
        # One by one, by now all known.
        for each, chart in zip(Phi, anew, strict=True):
            one, single = known.at(each[None])
            assert by_place(single, 1) == [chart]
            assert one[0] == robot.equations.regular(each)


@pytest.mark.long
def test_choices_wait_for_no_compiling(monkeypatch):
    """Charts are chosen anew until so many were chosen that compiled decisions pay."""
    robot, compiled = built("prr3"), []
    made = chart_margins.compiled
    monkeypatch.setattr(chart_margins, "were_compiled", lambda: False)
    monkeypatch.setattr(chart_margins, "compiled", lambda: compiled.append(1) or made())
    monkeypatch.setattr("linkwork.model.known_charts.PAYS", 100)
    early, known = KnownCharts(robot.equations, []), KnownCharts(robot.equations, [])
    known._decide = made()
    Phi = jacobians(robot, 40, 0.3, 7)
    for count in range(4):
        (regular, found), (others, expected) = early.at(Phi), known.at(Phi)
        assert (regular == others).all()
        assert by_place(found, len(Phi)) == by_place(expected, len(Phi))
        assert bool(compiled) == (count > 1)


def test_what_rounding_may_turn_is_chosen_anew(monkeypatch):
    """Where a comparison is a tie the decisions say nothing, whatever led to the known charts."""
    robot = built("prr3")
    known = KnownCharts(robot.equations, [])
    known._decide = chart_margins.compiled()
    asked = []
    monkeypatch.setattr(
        "linkwork.model.known_charts.charts_at",
        lambda equations, Phi, preferred: (
            asked.append(len(Phi)) or charts_at(equations, Phi, preferred)
        ),
    )
    Phi = jacobians(robot, 1, 0.1, 5)
    known.at(Phi)
    known.at(Phi)
    assert asked == [1]
    known.at(0.0 * Phi)
    assert asked == [1, 1]


def test_a_choice_does_not_depend_on_what_was_chosen_before():
    robot = built("prr3")
    fresh = lw.Robot(robot.mechanism)
    poses = robot.home.q + np.random.default_rng(6).normal(scale=0.3, size=(40, robot.home.q.size))
    for q in poses:
        choice(robot, robot.run_chart, q)
    for q in poses[::-1]:
        one, other = (choice(each, each.run_chart, q) for each in (robot, fresh))
        assert one.regular == other.regular
        assert (one.better and one.better.key) == (other.better and other.better.key)
