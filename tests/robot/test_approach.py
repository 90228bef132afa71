"""Compiled steps to poses and joint coordinates: they lead where steps of least squares lead, or
leave it to those."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.model.assembly import UnreachableError
from linkwork.model.leading import Leader
from linkwork.model.task import asked_of
from linkwork.model.walking import FIRST

from tests.equations.evaluation import close
from tests.products import first

SIZES = {
    "prr3": 3,
    "five_bar": 2,
    "stewart": 6,
    "delta": 3,
    "linear_delta": 3,
    "rrr3": 3,
    "hexaglide": 6,
    "orthoglide": 3,
}


@pytest.fixture(scope="module", params=first(5, tuple(SIZES)))
def case(request: pytest.FixtureRequest) -> tuple[lw.Robot, int]:
    return lw.Robot(getattr(lw.robots, request.param)()), SIZES[request.param]


def poses_near(robot: lw.Robot, size: int, spread: float, count: int = 12) -> np.ndarray:
    """Return poses about home; a part of them is out of reach or on the far side of a stretched leg
    where they are far."""
    length = robot.equations.tree.length
    units = np.array(([length] * 2 + [1.0] if robot.planar else [length] * 3 + [1.0] * 3)[:size])
    here = robot.tool_pose(robot.home)[:size]
    return here + spread * units * np.random.default_rng(7).uniform(-1, 1, (count, size))


def test_poses_are_met_as_by_steps_of_least_squares(case):
    robot, size = case
    poses = poses_near(robot, size, 0.05)
    compiled = robot.leader_of_tool(asked_of(robot, size), kept=True)
    assert compiled.approach is not None
    q, there = compiled.approached(np.repeat(robot.home.q[None], len(poses), axis=0), poses)
    assert there.all()
    close(q, replace(compiled, approach=None).lead(robot.home.q, poses), 1e-9)
    made = robot.make_state(q, np.zeros((len(q), robot.mobility)))
    assert robot.closure_error(made).max() < 1e-12
    close(robot.tool_pose(made)[:, :size], poses, 1e-11)
    alone = [compiled.lead(robot.home.q, pose[None])[0] for pose in poses]
    close(np.array(alone), q, 1e-13)


def test_determinants_are_those_of_the_matrix(case):
    robot, size = case
    leader = robot.leader_of_tool(asked_of(robot, size), kept=True)
    q, _ = leader.approached(
        np.repeat(robot.home.q[None], 12, axis=0), poses_near(robot, size, 0.05)
    )
    *_, parts = leader.approach.step(q, poses_near(robot, size, 0.05))
    A = leader.matrix(leader.outputs(q))
    for part, stage in zip(parts.T, leader.modes.stages, strict=True):
        close(part, np.linalg.det(A[:, stage.rows][:, :, stage.columns]) / stage.size, 1e-9)


def test_what_is_far_is_met_on_the_same_branch_or_left_to_steps_of_least_squares(case):
    robot, size = case
    leader, poses = (
        robot.leader_of_tool(asked_of(robot, size), kept=True),
        poses_near(robot, size, 0.3, 60),
    )
    q, there = leader.approached(np.repeat(robot.home.q[None], len(poses), axis=0), poses)
    assert 0 < there.sum() < len(poses)
    before, after = leader.signs(robot.home.q[None]), leader.signs(q[there])
    assert (before * after >= 0).all()
    made = robot.make_state(q[there], np.zeros((there.sum(), robot.mobility)))
    assert robot.closure_error(made).max(initial=0.0) < 1e-11


def test_a_stack_of_no_poses_is_a_stack_of_no_states(case):
    robot, size = case
    assert robot.assemble(tool=np.empty((0, size))).batch == (0,)


@pytest.mark.parametrize("turn", [1e-9, 1e-4, 0.3])
def test_turns_of_any_size_are_met(turn: float):
    robot = lw.Robot(lw.robots.stewart())
    axis = turn * np.array([0.6, 0.0, 0.8])
    pose = np.concatenate([robot.tool_pose(robot.home)[:3], axis])
    q, there = robot.leader_of_tool(asked_of(robot, 6), kept=True).approached(
        robot.home.q[None], pose[None]
    )
    assert there.all()
    found = Rotation.from_rotvec(robot.tool_poses(q[0])[3:])
    assert (found * Rotation.from_rotvec(axis).inv()).magnitude() < 1e-12


def test_half_a_turn_is_not_taken_for_none():
    robot = lw.Robot(lw.robots.stewart())
    pose = np.concatenate([robot.tool_pose(robot.home)[:3], [0.0, 0.0, np.pi]])
    _, there = robot.leader_of_tool(asked_of(robot, 6), kept=True).approached(
        robot.home.q[None], pose[None]
    )
    assert not there.any()


def test_joints_near_the_guess_are_met_as_by_steps_of_least_squares(case):
    robot, _ = case
    random, length, met = np.random.default_rng(8), robot.equations.tree.length, 0
    for _ in range(5):
        targets = {
            name: float(robot.home[name])
            + 0.02 * random.uniform(-1, 1) * (length if robot.unit(name) == "m" else 1.0)
            for name in robot.independent
        }
        asked, values = robot.joints_asked(tuple(targets)), np.array(list(targets.values()))
        (q,), (there,) = robot.leader_of_joints(asked).approached(robot.home.q[None], values[None])
        if not there:
            continue
        met += 1
        close(q, robot.assembler.at(robot.least(asked), values, robot.home.q), 1e-9)
        state = robot.assemble(targets)
        assert {name: float(state[name]) for name in targets} == targets
    assert met


def test_singular_guesses_are_left_to_steps_of_least_squares():
    """What is closed there is not moved by a step that divides rounding errors by a pivot that is
    one itself."""
    robot = lw.Robot(lw.robots.prr3())
    upright = robot.assemble({"pivot_1": np.pi / 2, "slide_1": 0.4, "wrist_1": 0.7 - np.pi / 2})
    pose = robot.tool_pose(upright)
    close(robot.assemble(tool=pose, guess=upright).positions, upright.positions, 1e-9)


def test_the_pose_of_a_stack_that_is_out_of_reach_is_named(case):
    robot, size = case
    poses = poses_near(robot, size, 0.02)
    poses[5, :2] += 100 * robot.equations.tree.length
    with pytest.raises(UnreachableError, match=r"^pose 5: "):
        robot.assemble(tool=poses)
    with pytest.raises(UnreachableError, match=r"^(?!pose)"):
        robot.assemble(tool=poses[5])


def test_a_stack_of_joint_coordinates_is_led_as_each_alone(case):
    robot, size = case
    aims = robot.assemble(tool=poses_near(robot, size, 0.01, 10).reshape(2, 5, size))
    stack = {name: aims[name] for name in robot.independent}
    states = robot.assemble(stack)
    assert states.batch == (2, 5)
    assert robot.closure_error(states).max() < 1e-12
    for index in np.ndindex(2, 5):
        alone = robot.assemble({name: float(values[index]) for name, values in stack.items()})
        close(states.at(index).positions, alone.positions, 1e-12)


def test_joints_that_are_not_independent_are_led_in_stacks_too():
    robot = lw.Robot(lw.robots.prr3())
    aims = robot.assemble(tool=poses_near(robot, 3, 0.02, 7))
    for names in (("pivot_1", "slide_2", "wrist_3"), ("pivot_1", "slide_1", "slide_2", "wrist_3")):
        states = robot.assemble({name: aims[name] for name in names})
        close(states.positions, aims.positions, 1e-8)


def test_one_number_beside_a_stack_of_joint_coordinates_holds_for_all():
    robot = lw.Robot(lw.robots.five_bar())
    first, second = (float(robot.home[name]) for name in robot.independent)
    asked = dict(zip(robot.independent, ([first, first + 0.1], second), strict=True))
    states = robot.assemble(asked)
    close(states[robot.independent[0]], [first, first + 0.1], 1e-14)
    close(states[robot.independent[1]], [second, second], 1e-14)


def test_whole_turns_that_are_asked_of_a_stack_are_kept():
    robot = lw.Robot(lw.robots.four_bar())
    (crank,) = robot.independent
    asked = float(robot.home[crank]) + np.array([0.1, 0.1 + 2 * np.pi, 0.1 - 6 * np.pi])
    states = robot.assemble({crank: asked})
    close(states[crank], asked, 1e-12)


def test_the_joints_of_a_stack_that_are_out_of_reach_are_named():
    robot = lw.Robot(lw.robots.prr3())
    stack = {name: np.full(4, float(robot.home[name])) for name in robot.independent}
    stack[robot.independent[0]][2] += 100
    with pytest.raises(UnreachableError, match=r"^state 2: "):
        robot.assemble(stack)


def test_few_joints_make_no_stack():
    robot = lw.Robot(lw.robots.five_bar())
    with pytest.raises(lw.LinkworkError, match="give one number, or values of 2 joints"):
        robot.assemble({robot.independent[0]: [1.0, 2.0]})


@pytest.mark.parametrize("name", ["prr3", "stewart"])
def test_far_poses_are_met_on_the_mode_of_the_guess(name):
    """Behind a barred way steps go on from where it ends, from the guess, or at random: all of what
    is met has the signs of the guess, and its pose."""
    robot = lw.Robot(getattr(lw.robots, name)())
    size = SIZES[name]
    leader, poses = (
        robot.leader_of_tool(asked_of(robot, size), kept=True),
        poses_near(robot, size, 0.3, 200),
    )
    q, there, mode = leader.led(robot.home.q, poses)
    assert there.sum() > 10
    assert (leader.signs(q[there]) * mode >= 0).all()
    made = robot.make_state(q[there], np.zeros((there.sum(), robot.mobility)))
    assert robot.closure_error(made).max() < 1e-11
    _, whole = leader.approached(q[there], poses[there])
    assert whole.all()


def test_one_alone_is_walked_as_one_of_many(case):
    """To poses and to joint coordinates, near and far, in reach and out of it."""
    robot, size = case
    home, random, both = robot.home.q, np.random.default_rng(11), [0, 0]
    joints = robot.joints_asked(robot.independent)
    here = robot.home.positions[joints.places]
    far = here + 1.5 * joints.units * random.uniform(-1, 1, (20, len(here)))
    for leader, y in (
        (robot.leader_of_tool(asked_of(robot, size), kept=True), poses_near(robot, size, 0.4, 40)),
        (robot.leader_of_joints(joints), far),
    ):
        q, whole = leader.approached(np.tile(home, (len(y), 1)), y)
        out, left = leader.outputs(home[None]), np.flatnonzero(~whole)
        way, mode = leader.least.asked.way(out, y), leader.modes.signs(leader.matrix(out))[0]
        q[left], whole[left] = leader.walked(home, way, left, mode, leader.step, FIRST)
        both[0] += int(whole[left].sum())
        both[1] += int((~whole).sum())
        for end, met, values in zip(q, whole, y, strict=True):
            alone, there = leader.walker.walked(home, values)
            assert there == met
            close(alone[0], end, 1e-11)
    assert min(both) > 0


def test_straight_ways_are_the_same_told_twice(case):
    """In expressions and in numbers; of half a turn both take the same side."""
    robot, size = case
    home, joints, part = robot.home.q, robot.joints_asked(robot.independent), np.array([0.4])
    tool = robot.leader_of_tool(asked_of(robot, size), kept=True)
    for leader in (tool, robot.leader_of_joints(joints)):
        out, asked = leader.outputs(home[None]), leader.least.asked
        angles = asked.units == 1
        here = asked.way(out, np.zeros((1, angles.size)))(np.arange(1), np.zeros(1))[0]
        for turn in (1e-9, 0.3, 3.0, np.pi, -np.pi, 7.0):
            y = here + np.where(angles, 0.0, 0.1 * asked.units)
            y[np.flatnonzero(angles)[-1:]] += turn
            expected = asked.way(out, y[None])(np.arange(1), part)[0]
            close(leader.walker.way.flat(home, y, part, robot.p), expected, 1e-12)


def test_a_way_that_is_walked_to_its_end_asks_for_no_other(monkeypatch):
    """Neither is anything else tried, nor the whole way walked once more."""
    robot = lw.Robot(lw.robots.prr3())
    pose = robot.tool_pose(robot.home) + np.array([0.02, 0.02, 0.7])
    for name in ("approached", "led", "elsewhere"):
        monkeypatch.setattr(Leader, name, lambda *given: pytest.fail("it is on the way"))
    close(robot.tool_pose(robot.assemble(tool=pose)), pose, 1e-9)


def test_random_configurations_keep_the_whole_turns_of_a_screw():
    """A nut that climbs a spindle lifts a table on a column; a turn less would leave it a lead too
    low."""
    upright = (0.0, 0.0, 1.0)
    solid = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    robot = lw.Robot(
        lw.Mechanism(
            name="lift",
            bodies={"nut": solid, "table": solid},
            joints={
                "spindle": lw.ScrewJoint(connects=("ground", "nut"), axis=upright, pitch=0.02),
                "bearing": lw.RevoluteJoint(connects=("nut", "table"), axis=upright),
                "column": lw.PrismaticJoint(connects=("ground", "table"), axis=upright),
            },
            actuators=("spindle",),
            tools={"table": lw.Tool(body="table", task=("z",))},
        )
    )
    leader, home = robot.leader_of_tool(asked_of(robot, 1), kept=True), robot.home.q
    y, mode = np.array([[0.15]]), leader.signs(home[None])[0]
    q, _, there = leader.scattered(home, home[None], y, mode, leader.step)
    assert there.all()
    state = robot.make_state(q, np.zeros((1, 1)))
    assert robot.closure_error(state).max() < 1e-11
    np.testing.assert_allclose(robot.tool_pose(state)[0, 2], 0.15, atol=1e-11)
