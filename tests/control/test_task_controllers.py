"""Controllers in task coordinates against the closed form of their error dynamics, virtual work,
and what turns come back to."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.control import TaskComputedTorque, TaskPDWithGravity
from linkwork.control.task_goals import quaternions

from tests.control.test_task_outputs import stated
from tests.products import first
from tests.robot.mixed_freedoms import scara, three_legs

KP, KD = 64.0, 12.0
TIMES = np.linspace(0, 1, 21)
TILTED = ("z", "tilt_x", "tilt_y")
TURN = lw.TurnAbout(axis=(0, 0, 1), name="spin")


def relative():
    """An arm whose shoulder a gear ties to its elbow, led as its upper arm sees it."""
    mechanism = scara()
    joints = mechanism.joints | {
        "gear": lw.GearJoint(ratios={"shoulder": 2, "elbow": -1}, offset=-0.2)
    }
    tool = lw.Tool(body="hand", relative_to="upper", task=("x", "z", "rz"))
    changed = {"joints": joints, "actuators": ("elbow", "lift", "wrist"), "tools": {"hand": tool}}
    return mechanism.model_copy(update=changed)


LED = {
    "prr3": lw.robots.prr3,
    "stewart": lw.robots.stewart,
    "scara": lambda: scara(task=("x", "y", TURN, lw.DistanceTo(point=(0, 0, 1)))),
    "pointing": lambda: stated(three_legs("RRS"), ("z", "azimuth", "tilt")),
    "leaning": lw.robots.rrs3,
    "relative": relative,
    "tilting": lambda: stated(three_legs("RPS"), TILTED),
    # Turned about the vertical as the scara is, by loops as the others are.
    "par4": lw.robots.par4,
    "delta": lw.robots.delta,
    "puma560": lw.robots.puma560,
}
RUN = first(6, tuple(LED))


@pytest.fixture(scope="module", params=RUN)
def robot(request):
    return lw.Robot(LED[request.param]())


def errors(robot, goal, run):
    """Return x_d - x over a run by the robot's own values, the rotation vector of R_d R' of whole
    orientations."""
    states = robot.state(run["joint_position"].values)
    e = np.array(goal) - robot.task_values(states)
    if {"rx", "ry", "rz"} <= {*robot.task}:
        R = Rotation.from_rotvec(robot.task_values(states)[:, 3:])
        e[:, 3:] = (Rotation.from_rotvec(np.array(goal)[..., 3:]) * R.inv()).as_rotvec()
    return e


def require_second_order(e, kp=KP, kd=KD):
    """Samples h apart of e'' + kd e' + kp e = 0 obey e_2 = (a + b) e_1 - a b e_0, a and b = exp(h
    roots)."""
    a, b = np.exp((TIMES[1] - TIMES[0]) * np.roots([1, kd, kp]).astype(complex))
    left = e[2:] - np.real(a + b) * e[1:-1] + np.real(a * b) * e[:-2]
    assert np.abs(e[0]).max() > 0.01
    np.testing.assert_allclose(left, 0, atol=2e-9)


@pytest.mark.sample(1)
def test_with_an_exact_model_errors_are_of_second_order(robot):
    """To a pose, and after a moving goal that is a cubic in time, which its samples tell
    exactly."""
    home = robot.task_values(robot.home)
    aside = np.where(np.arange(home.size) < 3, 0.02, 0.1) * np.resize([1.0, -0.7, 0.5], home.size)
    goal, rates = home + aside, np.resize([0.05, -0.1], robot.mobility)
    if "tilt" in robot.task:
        goal, rates = np.array([home[0] + 0.02, 2.0, 0.1]), 0 * rates
    start = robot.home.with_rates(rates)
    accurate = {"duration": 1.0, "save_at": TIMES, "rtol": 1e-11, "atol": 1e-12}
    law = TaskComputedTorque(dict(zip(robot.task, goal, strict=True)), KP, KD, robot)
    e = errors(robot, goal, robot.simulate(start, law, **accurate))
    if "tilt" not in robot.task:
        require_second_order(e)
        course = goal + 0.5 * aside * np.array([t**2 - t**3 for t in TIMES])[:, None]
        law = TaskComputedTorque(lw.Sampled(TIMES, course), KP, KD, robot)
        require_second_order(errors(robot, course, robot.simulate(start, law, **accurate)))
        return
    # A pointing direction is held in tilt (cos azimuth, sin azimuth), regular where it is upright.
    run = robot.simulate(start, law, **accurate)
    held = robot.task_values(robot.state(run["joint_position"].values), TILTED)
    require_second_order([goal[0], 0.1 * np.cos(2.0), 0.1 * np.sin(2.0)] - held)


@pytest.mark.long
def test_a_motion_is_followed_by_its_states_and_gains_are_by_coordinate():
    robot = lw.Robot("stewart")
    home = robot.task_values(robot.home)
    motion = robot.follow(
        lw.paths.line(home, home + np.array([0.05, 0.02, 0.03, 0.2, -0.1, 0.3])), 1.0, samples=201
    )
    start = robot.assemble(tool=home + np.array([0.02, 0, -0.02, 0.05, 0.1, -0.1]))
    kp = dict(zip(robot.task, [64.0, 64.0, 64.0, 100.0, 36.0, 49.0], strict=True))
    kd = dict(zip(robot.task, [12.0, 12.0, 12.0, 15.0, 10.0, 9.0], strict=True))
    law = TaskComputedTorque(motion, kp, kd, robot)
    run = robot.simulate(start, law, duration=1.0, save_at=TIMES, rtol=1e-11, atol=1e-12)
    e = errors(robot, robot.task_values(motion.state)[::10], run)
    for k, name in enumerate(robot.task):
        if abs(e[0, k]) > 0.01:
            require_second_order(e[:, k : k + 1], kp[name], kd[name])


@pytest.mark.parametrize("law", [TaskComputedTorque, TaskPDWithGravity])
def test_a_goal_may_change_between_runs(law):
    """By name, or as states over time of the user's own: each run is led as by a new controller."""
    robot = lw.Robot(lw.robots.prr3())
    poses = [robot.assemble(tool=tool) for tool in ([0.5, 0.29, 0.6], [0.48, 0.31, 0.5])]
    goal, own = {}, SimpleNamespace(time=np.array([0.0, 1.0]))
    led = [law(each, 40.0, 9.0, robot) for each in (goal, own)]
    for pose in poses:
        goal.update(zip(robot.task, robot.task_values(pose), strict=True))
        own.state = robot.state(np.tile(pose.positions, (2, 1)))
        wanted = robot.simulate(robot.home, law(pose, 40.0, 9.0, robot), duration=0.1)
        for kept in led:
            found = robot.simulate(robot.home, kept, duration=0.1)
            np.testing.assert_allclose(found.final.positions, wanted.final.positions, atol=1e-9)


@pytest.mark.sample(4)
@pytest.mark.parametrize("robot", [name for name in RUN if name != "pointing"], indirect=True)
def test_forces_of_the_pull_are_the_slope_of_its_potential(robot):
    """u - g is minus the derivative of e' Kp e / 2 by the actuated coordinates, whatever the gains;
    a pointing direction is held in other coordinates than it is told in."""
    home = robot.task_values(robot.home)
    goal = home + np.where(np.arange(home.size) < 3, 0.02, 0.3)
    gains = np.linspace(30.0, 80.0, home.size)
    by_name = dict(zip(robot.task, gains, strict=True))
    law = TaskPDWithGravity(dict(zip(robot.task, goal, strict=True)), by_name, 5.0, robot)
    found = np.asarray(law(0.0, robot.observe(robot.home)), float)

    def potential(h, name):
        state = robot.assemble({name: robot.home[name] + h} | held[name], guess=robot.home)
        e = np.array(goal) - robot.task_values(state)
        if {"rx", "ry", "rz"} <= {*robot.task}:
            R = Rotation.from_rotvec(robot.task_values(state)[3:])
            e[3:] = (Rotation.from_rotvec(goal[3:]) * R.inv()).as_rotvec()
        return gains @ e**2 / 2

    actuators, h = robot.actuators, 3e-4
    held = {name: {o: robot.home[o] for o in actuators if o != name} for name in actuators}
    slope = [
        (
            8 * (potential(h, name) - potential(-h, name))
            - potential(2 * h, name)
            + potential(-2 * h, name)
        )
        / (12 * h)
        for name in actuators
    ]
    pull = found - robot.holding_forces(robot.home)
    np.testing.assert_allclose(pull, -np.array(slope), 1e-6, 1e-6)


@pytest.mark.long
def test_the_pull_comes_to_rest_at_its_goal():
    robot = lw.Robot("par4")
    goal = robot.task_values(robot.home) + np.array([0.05, -0.03, 0.04, 0.4])
    gains = {"kp": 2000.0, "kd": 120.0}
    law = TaskPDWithGravity(dict(zip(robot.task, goal, strict=True)), model=robot, **gains)
    run = robot.simulate(robot.home, law, duration=3.0)
    np.testing.assert_allclose(robot.task_values(run.final), goal, atol=1e-7)


@pytest.mark.parametrize("name", ["scara", "stewart", "prr3"])
def test_whole_turns_ask_for_the_same(name):
    """Also of a rotation vector, by the longer way round its axis."""
    robot = lw.Robot(LED[name]())
    values = robot.task_values(robot.home) + 0.05
    turned = values.copy()
    if name == "stewart":
        r = values[3:]
        turned[3:] = r - 2 * np.pi * r / np.linalg.norm(r)
    else:
        turned[2] += 4 * np.pi
    state = robot.home.with_rates(np.full(robot.mobility, 0.1))
    found = [
        TaskComputedTorque(dict(zip(robot.task, goal, strict=True)), KP, KD, robot)(
            0.0, robot.observe(state)
        )
        for goal in (values, turned)
    ]
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-9)


def test_quaternions_of_turns_are_next_to_each_other():
    axis = np.array([0.6, 0.0, 0.8])
    angles = np.linspace(-0.5, 14.0, 60)
    vectors = Rotation.from_rotvec(angles[:, None] * axis).as_rotvec()
    p = quaternions(vectors)
    assert np.sum(p[1:] * p[:-1], axis=1).min() > 0.99
    expected = np.column_stack([np.cos(angles / 2), np.sin(angles / 2)[:, None] * axis])
    np.testing.assert_allclose(p * np.sign(p[0] @ expected[0]), expected, atol=1e-12)


def test_the_velocity_of_a_relative_tool_is_that_of_its_pose():
    """As differences of poses tell, in the axes of the body that it is relative to."""
    mechanism, h = scara(), 1e-5
    tool = lw.Tool(body="hand", frame=lw.Frame(position=(0.1, 0, 0)), relative_to="upper")
    robot = lw.Robot(mechanism.model_copy(update={"tools": {"hand": tool}}))
    q, v = robot.home.positions, np.array([0.5, -0.7, 0.2, 0.9])
    after, before = (robot.tool_pose(robot.state(q + way * h * v)) for way in (1, -1))
    slope = (after - before) / (2 * h)
    turn = Rotation.from_rotvec(after[3:]) * Rotation.from_rotvec(before[3:]).inv()
    seen = robot.observe(robot.state(q, v)).tool_velocity
    np.testing.assert_allclose(seen[:3], slope[:3], atol=1e-9)
    np.testing.assert_allclose(seen[3:], turn.as_rotvec() / (2 * h), atol=1e-9)


def test_what_cannot_be_led_is_refused():
    delta, arm = lw.Robot("delta"), lw.Robot("double_pendulum")
    pushed = scara().model_copy(update={"actuators": ("lift", "wrist")})
    few = lw.Robot(stated(scara(), ("x", "z")))
    many = lw.Robot(stated(scara(), ("x", "y", "z", "rz", "rx")))
    loose = lw.Robot(stated(pushed, ("x", "y", "z", "rz")))
    pose = {"x": 0.1, "y": 0.0, "z": -0.3}
    cases = [
        (delta, ({"x": 0.1}, 1.0, 1.0, delta), "the goal lacks y, z; give all of x, y, z"),
        (delta, (pose | {"rx": 0.0}, 1.0, 1.0, delta), "no coordinate of the task 'rx'"),
        (delta, (lw.Sampled([0, 1], np.zeros((2, 2))), 1.0, 1.0, delta), "goal has 2 columns"),
        (delta, ("home", 1.0, 1.0, delta), "the goal is 'home'; give a state, a motion"),
        (delta, (pose, {"x": 1.0}, 1.0, delta), "the gain kp lacks 'y'"),
        (delta, (pose, 1.0, 1.0, delta.mechanism), "model of a controller is a Mechanism"),
        (delta, (pose, 1.0, 1.0, arm), "the model has the actuators hinge_1, hinge_2"),
        (arm, (arm.home, 1.0, 1.0, arm), "the goal is singular: there the actuators do not lead"),
        (few, (few.home, 1.0, 1.0, few), "the task x, z has 2 coordinates and the model 4 free"),
        (many, (many.home, 1.0, 1.0, many), "5 coordinates and the model 4 .* state fewer"),
        (loose, (loose.home, 1.0, 1.0, loose), "2 actuators cannot lead 4 freedoms in x, y, z"),
    ]
    for robot, given, sentence in cases:
        for law in (TaskComputedTorque, TaskPDWithGravity):
            with pytest.raises(lw.LinkworkError, match=sentence):
                robot.simulate(robot.home, law(*given), duration=0.1)


def test_a_run_ends_at_a_singular_pose_and_says_what():
    arm = lw.Robot(lw.robots.puma560())
    law = TaskComputedTorque(
        dict(zip(arm.task, arm.task_values(arm.home), strict=True)), KP, KD, arm
    )
    run = arm.simulate(arm.state(np.zeros(6)), law, duration=0.5)
    assert not run.success and "the controller's force on joint_1" in run.message
