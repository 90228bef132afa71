"""Input of the wrong type, shape or name at every method of a robot: one sentence of ours, never
NumPy's own error."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import checks
from linkwork.robots import five_bar

PATH = lw.paths.line([0.15, 0.4], [0.15, 0.42])

CASES = {
    # a rate, force or acceleration vector that is none
    "rates: text": ("abc", lambda r, h, s: h.with_rates("abc")),
    "rates: texts": ("'b'", lambda r, h, s: h.with_rates(["a", "b"])),
    "rates: ragged": ("[[1, 2], [3]]", lambda r, h, s: h.with_rates([[1, 2], [3]])),
    "rates: another name": ("elbow_9", lambda r, h, s: h.with_rates({"motor_1": 1, "elbow_9": 2})),
    "rates: text by name": ("'x'", lambda r, h, s: h.with_rates({"motor_1": "x", "motor_2": 1})),
    "rates: a stack on one state": ("rates", lambda r, h, s: h.with_rates(np.zeros((3, 2)))),
    "rates: another stack": ("rates", lambda r, h, s: s.with_rates(np.zeros((4, 2)))),
    "forces: text": ("'abc'", lambda r, h, s: r.forward_dynamics(h, "abc")),
    "forces: ragged": ("forces", lambda r, h, s: r.forward_dynamics(h, [[1, 2], [1]])),
    "forces: complex": ("forces", lambda r, h, s: r.forward_dynamics(h, [1j, 0])),
    "forces: nothing": ("forces", lambda r, h, s: r.forward_dynamics(h, None)),
    "forces: few": (
        "forces has shape (1,); give 2 numbers",
        lambda r, h, s: r.forward_dynamics(h, [1]),
    ),
    "forces: another name": (
        "elbow",
        lambda r, h, s: r.forward_dynamics(h, {"elbow": 1.0, "motor_1": 1.0}),
    ),
    "forces: another stack": (
        "stacks of the shapes (3,) and (2,)",
        lambda r, h, s: r.forward_dynamics(s, np.zeros((2, 2))),
    ),
    "forces before the state": ("forces is", lambda r, h, s: r.forward_dynamics([0, 0], h)),
    "accelerations: text": ("'abc'", lambda r, h, s: r.inverse_dynamics(h, "abc")),
    "accelerations: another stack": (
        "stacks of the shapes",
        lambda r, h, s: r.inverse_dynamics(s, np.zeros((2, 2))),
    ),
    "accelerations: one number": (
        "accelerations has shape ()",
        lambda r, h, s: r.inverse_dynamics(h, 1.0),
    ),
    "accelerations: none": ("give the accelerations", lambda r, h, s: r.inverse_dynamics(h)),
    "accelerations of joints: text": ("'abc'", lambda r, h, s: r.joint_accelerations(h, "abc")),
    "accelerations of joints: stack": (
        "stacks of the shapes",
        lambda r, h, s: r.joint_accelerations(s, np.zeros((2, 2))),
    ),
    # what is no state
    "a state: none": ("a state is needed, not NoneType", lambda r, h, s: r.mass_matrix(None)),
    "a state: numbers": ("a state is needed, not list", lambda r, h, s: r.joint_rates([0.0] * 5)),
    "inverse dynamics: none": (
        "a state is needed, not NoneType",
        lambda r, h, s: r.inverse_dynamics(None, [0, 0]),
    ),
    "internal forces: none": (
        "a state is needed, not NoneType",
        lambda r, h, s: r.internal_forces(None),
    ),
    "internal forces: a stack": ("a stack", lambda r, h, s: r.internal_forces(s)),
    "limits: none": ("a state is needed, not NoneType", lambda r, h, s: r.limits_passed(None)),
    "the joint of a state": ("'elbow'", lambda r, h, s: h["elbow"]),
    "a part of one state": ("one state", lambda r, h, s: h.at(0)),
    "a part beyond the stack": ("index 5", lambda r, h, s: s.at(5)),
    "a part by name": ("'first'", lambda r, h, s: s.at("first")),
    # making states
    "positions: text": ("'abc'", lambda r, h, s: r.state("abc")),
    "positions: one number": ("positions has shape ()", lambda r, h, s: r.state(5.0)),
    "positions: ragged": ("positions", lambda r, h, s: r.state([[1] * 5, [1] * 4])),
    "positions: few": (
        "positions has shape (4,); give 5 numbers",
        lambda r, h, s: r.state([0, 0, 0, 0]),
    ),
    "positions: few names": ("positions lack motor_2", lambda r, h, s: r.state({"motor_1": 0.1})),
    "positions: another name": ("'elbow'", lambda r, h, s: r.state({"elbow": 1.0})),
    "positions: stacks by name": (
        "stacks of the shapes (2,)",
        lambda r, h, s: r.state(
            {**dict.fromkeys(r.coordinates, 0.0), "motor_1": [1, 2], "tip": [1, 2, 3]}
        ),
    ),
    "positions and rates: two stacks": (
        "stacks of the shapes (3,) and (2,)",
        lambda r, h, s: r.state(s.positions, np.zeros((2, 2))),
    ),
    "rates: few": ("give 2", lambda r, h, s: r.state(h.positions, {"elbow_1": 1.0})),
    "rates: dependent": ("do not determine", lambda r, h, s: stretched(r)),
    "rates by name: another stack": (
        "stacks of the shapes",
        lambda r, h, s: r.state(s.positions, {"elbow_1": [1.0, 2.0], "motor_1": 0.0}),
    ),
    "a tolerance: text": ("tolerance", lambda r, h, s: r.state(h.positions, tolerance="small")),
    # assembling
    "assemble: a number": ("joint coordinates by name", lambda r, h, s: r.assemble(5.0)),
    "assemble: a list": ("joint coordinates by name", lambda r, h, s: r.assemble([1, 2])),
    "assemble: two values": ("motor_1", lambda r, h, s: r.assemble({"motor_1": [1.0, 2.0]})),
    "assemble: text": ("'x'", lambda r, h, s: r.assemble({"motor_1": "x"})),
    "assemble: nothing": ("say where to assemble", lambda r, h, s: r.assemble()),
    "assemble: both": (
        "say where to assemble",
        lambda r, h, s: r.assemble({"motor_1": 1.0}, tool=[0.15, 0.4]),
    ),
    "a tool pose: one number": ("a tool pose of 1 number", lambda r, h, s: r.assemble(tool=5.0)),
    "a tool pose: none": ("a tool pose of 0 number", lambda r, h, s: r.assemble(tool=[])),
    "a tool pose: four numbers": (
        "a tool pose of 4 number",
        lambda r, h, s: r.assemble(tool=[1, 2, 3, 4]),
    ),
    "a tool pose: text": ("'here'", lambda r, h, s: r.assemble(tool="here")),
    "a tool pose: ragged": ("tool", lambda r, h, s: r.assemble(tool=[[1, 2], [1]])),
    "a guess: a number": (
        "a state is needed, not int",
        lambda r, h, s: r.assemble({"motor_1": 2.0}, guess=5),
    ),
    "a guess: a stack": ("guess", lambda r, h, s: r.assemble({"motor_1": 2.0}, guess=s)),
    "two poses, three rates": (
        "stacks of the shapes (2,) and (3,)",
        lambda r, h, s: r.assemble(tool=[[0.15, 0.4]] * 2, rates=np.zeros((3, 2))),
    ),
    # robots, charts, kernels, units
    "a robot of text": ("there is no robot 'five bar'", lambda r, h, s: lw.Robot("five bar")),
    "a robot of nothing": ("a Mechanism, not from None", lambda r, h, s: lw.Robot(None)),
    "independent: another name": (
        "'elbow_9'",
        lambda r, h, s: lw.Robot(r.mechanism, independent=("elbow_9",)),
    ),
    "independent: a number": ("5", lambda r, h, s: lw.Robot(r.mechanism, independent=5)),
    "a chart: nothing": ("None", lambda r, h, s: r.in_chart(h, None)),
    "a chart of nothing": (
        "a state is needed",
        lambda r, h, s: r.in_chart(None, ["elbow_1", "elbow_2"]),
    ),
    "a kernel": ("'foo'", lambda r, h, s: r.kernel("foo")),
    "a kernel that is a module": ("'np'", lambda r, h, s: r.kernel("np")),
    "a kernel: a number": ("5", lambda r, h, s: r.kernel(5)),
    "a unit": ("'foo'", lambda r, h, s: r.unit("foo")),
    # runs
    "a run of a stack": ("a stack", lambda r, h, s: r.simulate(s, duration=1.0)),
    "a run from nothing": ("a state is needed", lambda r, h, s: r.simulate(None, duration=1.0)),
    "a duration: text": ("duration", lambda r, h, s: r.simulate(h, duration="long")),
    "a duration: a number as text": (
        "duration is '1'",
        lambda r, h, s: r.simulate(h, duration="1"),
    ),
    "a duration: none": ("duration", lambda r, h, s: r.simulate(h, duration=None)),
    "a duration: not a number": ("duration", lambda r, h, s: r.simulate(h, duration=np.nan)),
    "forces of a run: text": ("'abc'", lambda r, h, s: r.simulate(h, "abc", duration=1.0)),
    "forces of a run: a function of time alone": (
        "the controller cannot be traced",
        lambda r, h, s: r.simulate(h, lambda t: [0, 0], duration=1.0),
    ),
    "forces of a run: a table": (
        "(2, 2); give 2 numbers: motor_1, motor_2",
        lambda r, h, s: r.simulate(h, np.zeros((2, 2)), duration=1.0),
    ),
    "forces of a run: another name": (
        "'elbow'",
        lambda r, h, s: r.simulate(h, {"elbow": 1.0}, duration=1.0),
    ),
    "a tolerance of a run: text": (
        "rtol",
        lambda r, h, s: r.simulate(h, duration=1.0, rtol="small"),
    ),
    "a tolerance of a run: zero": ("rtol", lambda r, h, s: r.simulate(h, duration=1.0, rtol=0)),
    "the largest step: text": (
        "max_step",
        lambda r, h, s: r.simulate(h, duration=1.0, max_step="small"),
    ),
    "the most steps: text": (
        "max_steps",
        lambda r, h, s: r.simulate(h, duration=1.0, max_steps="few"),
    ),
    "the most steps: a part": (
        "max_steps is 1.5",
        lambda r, h, s: r.simulate(h, duration=1.0, max_steps=1.5),
    ),
    "parameters: a list": (
        "parameters are [1]",
        lambda r, h, s: r.simulate(h, duration=1.0, parameters=[1]),
    ),
    "parameters of members: a list": (
        "parameters are [1]",
        lambda r, h, s: r.ensemble(h, None, [1], duration=1.0),
    ),
    "threads: none": ("threads is 0", lambda r, h, s: r.ensemble(h, duration=0.1, threads=0)),
    "threads: fewer": ("threads is -1", lambda r, h, s: r.ensemble(h, duration=0.1, threads=-1)),
    "threads: a part": ("threads is 1.5", lambda r, h, s: r.ensemble(h, duration=0.1, threads=1.5)),
    "threads: text": ("threads is 'a'", lambda r, h, s: r.ensemble(h, duration=0.1, threads="a")),
    "a member": (
        "there is no member 9; there are 3",
        lambda r, h, s: r.ensemble(s, duration=0.1).message(9),
    ),
    "a member by name": (
        "there is no member 'a'",
        lambda r, h, s: r.ensemble(s, duration=0.1).events("a"),
    ),
    "the most steps: none": ("max_steps", lambda r, h, s: r.simulate(h, duration=1.0, max_steps=0)),
    "times to save: text": (
        "save_at",
        lambda r, h, s: r.simulate(h, duration=1.0, save_at="often"),
    ),
    "times to save: backwards": (
        "save_at",
        lambda r, h, s: r.simulate(h, duration=1.0, save_at=[1.0, 0.5]),
    ),
    "times to save: beyond": (
        "save_at",
        lambda r, h, s: r.simulate(h, duration=1.0, save_at=[0.0, 2.0]),
    ),
    "forces of a run: short": (
        "the forces are sampled from 0 s to 0.5 s",
        lambda r, h, s: r.simulate(
            h, lw.Sampled([0, 0.5], np.zeros((2, 2)), kind="linear"), duration=1.0
        ),
    ),
    "at a singular pose": (
        "on_singular is 'go on'",
        lambda r, h, s: r.simulate(h, duration=1.0, on_singular="go on"),
    ),
    # paths
    "a path: a number": ("path", lambda r, h, s: r.follow(5, 1.0)),
    "the duration of a path": ("duration", lambda r, h, s: r.follow(PATH, "long")),
    "one sample of a path": ("at least 2", lambda r, h, s: r.follow(PATH, 1.0, samples=1)),
    "the samples of a path": ("samples", lambda r, h, s: r.follow(PATH, 1.0, samples=2.5)),
    "the end of a path": (
        "the end is [0.1, nan]",
        lambda r, h, s: r.follow(lw.paths.line([0.1, 0.4], [0.1, np.nan]), 1.0),
    ),
    "the guess of a path": ("guess", lambda r, h, s: r.follow(PATH, 1.0, guess=s)),
}


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(five_bar())


def stretched(robot: lw.Robot) -> lw.State:
    """Ask for rates of leg 1 where leg 2 is stretched: it lets the tip move in one direction
    only."""
    return robot.assemble({"elbow_2": 0.0, "motor_2": 1.9}, rates={"motor_1": 1.0, "elbow_1": 0.0})


@pytest.mark.parametrize("name", CASES)
def test_wrong_input_is_refused_in_one_sentence(robot, name):
    word, action = CASES[name]
    home = robot.home
    with pytest.raises(lw.LinkworkError) as refusal:
        action(robot, home, robot.state(np.stack([home.positions] * 3)))
    assert word in str(refusal.value), str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_of_many_names_the_nearest_is_asked_for():
    legs = [f"leg_{i}" for i in range(1, 8)]
    with pytest.raises(
        lw.LinkworkError, match=r"no joint 'Leg3'; .*, leg_7 \(did you mean leg_3\?"
    ):
        checks.known(["Leg3"], legs, "joint")
    with pytest.raises(lw.LinkworkError, match=r"no joint 'Leg3'; there are leg_1, leg_2, leg_3$"):
        checks.known(["Leg3"], legs[:3], "joint")


def test_empty_stacks_go_through_everything(robot):
    empty = robot.state(np.zeros((0, 5)))
    assert empty.batch == (0,)
    shapes = {
        "mass_matrix": (0, 2, 2),
        "coriolis": (0, 2),
        "gravity": (0, 2),
        "passive_forces": (0, 2),
        "rate_map": (0, 5, 2),
        "twist_map": (0, 24, 2),
        "joint_rates": (0, 5),
        "twists": (0, 4, 6),
        "tool_pose": (0, 3),
        "actuation": (0, 2, 2),
        "closure_error": (0,),
    }
    for name, shape in shapes.items():
        assert getattr(robot, name)(empty).shape == shape
    assert robot.forward_dynamics(empty, [0, 0]).shape == (0, 2)
    assert robot.forward_dynamics(empty, np.zeros((0, 2))).shape == (0, 2)
    assert robot.inverse_dynamics(empty, np.zeros((0, 2))).shape == (0, 2)
    assert robot.joint_accelerations(empty, np.zeros((0, 2))).shape == (0, 5)
    assert [part.shape for part in robot.energy(empty)] == [(0,), (0,)]
    assert robot.limits_passed(empty) == ()
    assert robot.assemble(tool=np.zeros((0, 2))).batch == (0,)


def test_forces_may_be_given_by_name(robot):
    by_name = robot.forward_dynamics(robot.home, {"motor_2": 0.3, "motor_1": -0.2})
    assert np.array_equal(by_name, robot.forward_dynamics(robot.home, [-0.2, 0.3]))
