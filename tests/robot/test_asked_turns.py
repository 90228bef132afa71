"""Joint angles are taken as they are asked for, whole turns included; and what is asked wrongly is
told in a sentence."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import linkwork as lw
from linkwork import paths

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def andrews():
    return lw.Robot(lw.robots.andrews())


def hinge(**fields) -> lw.Robot:
    joint = lw.RevoluteJoint(connects=("ground", "wheel"), **fields)
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.5))
    return lw.Robot(
        lw.Mechanism(bodies={"wheel": body}, joints={"hinge": joint}, actuators=("hinge",))
    )


@cache
def lift(driven) -> lw.Robot:
    upright, solid = (0.0, 0.0, 1.0), lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    joints = {
        "spindle": lw.ScrewJoint(connects=("ground", "nut"), axis=upright, pitch=0.002),
        "bearing": lw.RevoluteJoint(connects=("nut", "table"), axis=upright),
        "column": lw.PrismaticJoint(connects=("ground", "table"), axis=upright),
    }
    return lw.Robot(
        lw.Mechanism(
            bodies=dict.fromkeys(("nut", "table"), solid),
            joints=joints,
            actuators=(driven,),
            tools={"table": lw.Tool(body="table", task=("z",))},
        )
    )


@pytest.mark.parametrize("angle", [4.0, -1000.0, np.pi, 3 * np.pi])
def test_a_torsion_spring_pulls_from_the_angle_asked_for(angle):
    """-k q, of the whole angle: at 4 rad with 2 N m/rad it is -8 N m."""
    robot = hinge(spring=lw.Spring(stiffness=2.0))
    state = robot.assemble({"hinge": angle})
    assert state["hinge"] == pytest.approx(angle, rel=1e-14)
    assert robot.passive_forces(state) == pytest.approx(-2 * angle, rel=1e-12)


def test_angles_of_the_tree_and_of_cut_joints_are_kept(andrews):
    """Another turn of any one joint is the same configuration: bodies stand where they stood."""
    assert andrews.assemble({"beta": 15.81})["beta"] == pytest.approx(15.81, abs=1e-13)
    here = andrews.body_poses(andrews.home)
    for label in andrews.coordinates:
        asked = float(andrews.home[label]) + 2 * TURN
        state = andrews.assemble({label: asked})
        assert state[label] == pytest.approx(asked, abs=1e-12), label
        assert andrews.closure_error(state) < 1e-14
        there = andrews.body_poses(state)
        for name, pose in here.items():
            for part, other in zip(pose, there[name], strict=True):
                np.testing.assert_allclose(part, other, atol=1e-10)


def test_geared_angles_keep_their_turns():
    """q_1 + 2 q_2 = 0: at q_1 = 4 the other is at -2, not at -2 + pi."""
    hinges = {f"hinge_{i}": lw.RevoluteJoint(connects=("ground", f"wheel_{i}")) for i in (1, 2)}
    gear = lw.mechanism.GearJoint(ratios={"hinge_1": 1.0, "hinge_2": 2.0})
    bodies = {f"wheel_{i}": lw.Body(mass=1.0, inertia=lw.Inertia(zz=1.0)) for i in (1, 2)}
    robot = lw.Robot(
        lw.Mechanism(bodies=bodies, joints={**hinges, "gear": gear}, actuators=("hinge_1",))
    )
    for angle in (4.0, 20.0):
        np.testing.assert_allclose(
            robot.assemble({"hinge_1": angle}).positions, [angle, -angle / 2], atol=1e-10
        )


@pytest.mark.parametrize("driven", ["spindle", "bearing"])
@pytest.mark.parametrize("turn", [3.0, 20.0, -200.0])
def test_whole_turns_of_what_turns_a_thread_advance_it(driven, turn):
    """A nut on a spindle of 2 mm/rad that turns against a table on a column, asked as a joint of
    the tree or as one that closes the loop, and led by its tool."""
    robot = lift(driven)
    asked = {"spindle": turn, "bearing": -turn}
    for state in (
        robot.assemble({"bearing": -turn}),
        robot.assemble({"spindle": turn}),
        robot.assemble(tool=[0.002 * turn]),
    ):
        assert state["column"] == pytest.approx(0.002 * turn, abs=1e-12)
        assert {name: float(state[name]) for name in asked} == pytest.approx(asked, abs=1e-9)


def test_rates_by_name_are_zero_where_they_are_left_out():
    robot = lw.Robot(lw.robots.five_bar())
    name = robot.independent[1]
    expected = [0.0, 2.0]
    for state in (
        robot.state(robot.home.positions, {name: 2.0}),
        robot.assemble(tool=robot.tool_pose(robot.home)[:2], rates={name: 2.0}),
        robot.home.with_rates({name: 2.0}),
    ):
        np.testing.assert_array_equal(state.rates, expected)


def test_stacked_states_are_iterated_and_counted():
    robot = lw.Robot(lw.robots.five_bar())
    rates = np.arange(6.0).reshape(3, 2)
    stack = robot.make_state(np.tile(robot.home.q, (3, 1)), rates)
    assert len(stack) == 3
    for one, expected in zip(stack, rates, strict=True):
        np.testing.assert_array_equal(one.rates, expected)
    assert robot.home
    for use in (len, list, dict):
        with pytest.raises(lw.LinkworkError, match="one state, not a stack"):
            use(robot.home)


def test_what_is_asked_wrongly_is_told():
    robot = lw.Robot(lw.robots.five_bar())
    first = robot.coordinates[0]
    cases = {
        "positions lack .*robot.assemble closes the loops": lambda: robot.state({first: 0.5}),
        "joints are given, but 2 determine all others": lambda: robot.assemble(
            {name: float(robot.home[name]) + 0.1 * k for k, name in enumerate(robot.coordinates)}
        ),
        "the loops do not close from these positions": lambda: robot.state(
            robot.home.positions * 0 + 5.0, tolerance=1e9
        ),
        "rtol is 1e-16, less than what doubles can hold": lambda: robot.simulate(
            robot.home, duration=1, rtol=1e-16
        ),
        "samples does not fit into memory; give at most 10000000": lambda: robot.follow(
            paths.line([0.1, 0.3], [0.15, 0.3]), 1.0, samples=10**12
        ),
        "a run is resumed, not NoneType": lambda: robot.resume(None, duration=1.0),
        "not of NoneType; give": lambda: lw.analysis.jacobians(None),
    }
    for told, call in cases.items():
        with pytest.raises(lw.LinkworkError, match=told):
            call()
    assert robot.simulate(robot.home, duration=1e-3, max_steps=1e30).success
