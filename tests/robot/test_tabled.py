"""Charts told by tables: the numbers of a chart's own kernels, and runs that are the same."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.kernels.program import Program
from linkwork.model import charts
from linkwork.model.tabled import tabled, varying
from linkwork.simulation import partitioned

from tests.oracle.random_joints import random_loops

NAMES = "motion", "closure_step", "tree_rates"
CASES = {
    "3-PRR": (lw.robots.prr3, ()),
    "Bricard, a row left out": (lw.robots.bricard, ()),
    "ball joints, a block of three": (lw.robots.stewart, ()),
    "free numbers": (lw.robots.five_bar, ("bodies.proximal_1.mass",)),
    "everything": (lambda: random_loops(5, 2, effects=True, rods=1, gears=1, freedoms=2), ()),
    "a free body": (lambda: random_loops(8, 1, effects=True, platform="free"), ()),
}


@pytest.mark.parametrize("case", CASES)
def test_numbers_are_those_of_the_chart_s_own_kernels(case):
    """In the home chart and in one chosen elsewhere, at states near home that are a little open."""
    make, free = CASES[case]
    robot = lw.Robot(make(), free=free)
    rng, q = np.random.default_rng(2), robot.home.q
    for chart in (robot.chart, robot.chart.better(q, ())):
        for name in NAMES:
            own, found = chart.kernel(name), tabled(robot.chart.compiled, chart.equations, name)
            more = rng.normal(size=found.n_in - q.size - robot.p.size)
            x = (q + 1e-3 * rng.normal(size=q.size), more, robot.p)
            expected, values = own.flat(*x), found.flat(*x)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-11 * scale)


def test_pivots_that_vary_are_those_that_count():
    """The trace of the pivots tells which of them are constants."""
    for make in (lw.robots.prr3, lw.robots.stewart, lw.robots.delta, lw.robots.bricard):
        robot = lw.Robot(make())
        program: Program = robot.kernel("pivots").traced()
        traced = [program.nodes[k].op != "const" for k in program.results]
        assert varying(robot.equations.chart, robot.equations.rows.pattern) == traced


def test_a_singular_inertia_is_not_finite():
    M, b = np.outer([1.0, 2.0], [1.0, 2.0]), np.ones(2)
    partitioned.solved_positive(M.ravel(), 2, b)
    assert not np.isfinite(b).all()


def test_runs_by_tables_end_where_others_do(monkeypatch):
    """Nobody waits for kernels of charts on the way, and the results are the same each time."""
    mechanism, compiled = lw.robots.rrr3(), []

    def run(large: int) -> np.ndarray:
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(mechanism)
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        found = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
        assert found.success and len(robot.run_charts) > 1
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        compiled.append(any("motion" in chart._kernels for chart in others))
        return found.variables["joint_position"].values[-1]

    own, told, again = run(10**9), run(0), run(0)
    assert compiled == [True, False, False]
    np.testing.assert_allclose(told, own, atol=1e-8)
    np.testing.assert_array_equal(told, again)


def test_a_chart_that_is_used_for_long_gets_kernels_of_its_own(monkeypatch):
    monkeypatch.setattr(charts, "LARGE", 0)
    robot = lw.Robot(lw.robots.five_bar())
    chart = robot.chart.better(robot.home.q, ())
    assert chart.single("motion") is not chart.kernel("motion")
    chart.count(charts.OWN)
    assert chart.single("motion") is chart.kernel("motion")
    assert robot.chart.single("motion") is robot.chart.kernel("motion")
