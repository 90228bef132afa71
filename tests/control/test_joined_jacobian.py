"""The Jacobian of a large system, column by column, is the one that is written out."""

import ctypes

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, joined
from linkwork.runs.system import system, with_jacobian

from tests.oracle.hinges import hinges

ENTRY = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def jacobians(robot: lw.Robot, monkeypatch, **given) -> list[np.ndarray]:
    """Return df/dy and df/dr of a robot written out, and column by column."""
    plain = system(robot, given.get("forces"), None, (), (), {}, (0.0, 1.0))
    found = []
    for bound in (10**9, 0):
        monkeypatch.setattr(joined, "WRITTEN_OUT", bound)
        whole = with_jacobian(robot, plain)
        inputs = whole.joined(robot.chart).inputs
        state = np.random.default_rng(0).normal(size=sum(x.numel() for x in inputs.values()))
        state[: robot.home.q.size] = robot.home.q
        size = inputs["q"].numel() + inputs["v"].numel() + inputs["z"].numel()
        out = np.empty(size * (size + inputs["r"].numel()))
        ENTRY(whole.jacobian(robot.chart))(state.ctypes.data, out.ctypes.data)
        found.append(out)
    return found


def test_both_ways_agree_with_loops_trees_and_controllers(monkeypatch):
    goal = dict.fromkeys(lw.robots.prr3().actuators, 0.1)
    cases = (lw.robots.prr3(), None), (hinges(2), None), (lw.robots.prr3(), PD(goal, 90.0, 9.0))
    for mechanism, forces in cases:
        written, columns = jacobians(lw.Robot(mechanism), monkeypatch, forces=forces)
        np.testing.assert_allclose(columns, written, rtol=1e-10, atol=1e-10 * abs(written).max())


@pytest.mark.long
def test_a_large_tree_runs_by_the_stiff_method():
    """Six hinges, damped; the explicit method of order 8 is the other way."""
    robot = lw.Robot(hinges(6))
    whole = with_jacobian(robot, system(robot, None, None, (), (), {}, (0.0, 0.1)))
    assert whole.joined(robot.chart).large
    ends = [
        robot.simulate(robot.home, duration=0.1, rtol=1e-9, atol=1e-11, method=method)
        for method in ("rodas", "dop853")
    ]
    assert all(run.success for run in ends)
    found, expected = (run.variables["joint_position"].values[-1] for run in ends)
    np.testing.assert_allclose(found, expected, atol=1e-7)
