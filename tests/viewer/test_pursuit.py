"""Posing by hand: it arrives where assembling does, keeps loops closed, stops at edges and limits,
and says why."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork import Robot, robots
from linkwork.mechanism import (
    Body,
    FixedJoint,
    Frame,
    Inertia,
    Limits,
    Mechanism,
    RevoluteJoint,
    SphericalJoint,
    Tool,
)
from linkwork.scene.fixtures import fixtures_of
from linkwork.viewer.bounds import bounds_of
from linkwork.viewer.pursuit import Pursuit, listed
from linkwork.viewer.session import Session

from tests.analysis.test_translating_platforms import BASE, upu
from tests.oracle.scaling import Scale
from tests.robot.mixed_freedoms import scara, three_legs


@pytest.fixture(scope="module")
def pursuits() -> dict[str, Pursuit]:
    made = {
        name: Robot(getattr(robots, name)())
        for name in ("prr3", "five_bar", "stewart", "delta", "pendulum")
    }
    return {name: Pursuit(robot, fixtures_of(robot).size) for name, robot in made.items()}


def tool(pursuit: Pursuit, state) -> tuple[np.ndarray, np.ndarray]:
    out = pursuit.assembler.still(state.q)
    return out["position"], out["orientation"].reshape(3, 3)


@pytest.mark.parametrize(
    ("name", "shift"),
    [("prr3", (0.05, -0.03)), ("five_bar", (0.02, 0.01)), ("delta", (0.1, 0.05, -0.1))],
)
def test_a_pose_within_reach_is_that_of_assembling(pursuits, name, shift):
    pursuit = pursuits[name]
    robot = pursuit.robot
    position, R = tool(pursuit, robot.home)
    target = position + np.append(shift, np.zeros(3 - len(shift)))
    reached = pursuit.lead(robot.home, pursuit.tool_goal(target, R))
    pose = robot.tool_pose(robot.home)
    pose[: len(shift)] += shift
    asked = pose if name == "prr3" else pose[: robot.mobility]
    assert reached.arrived and not reached.obstacle
    assert reached.state.positions == pytest.approx(robot.assemble(tool=asked).positions, abs=1e-8)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("L", "M"), [(1e-6, 1e-9), (1e6, 1e6)])
def test_the_way_to_a_pose_is_the_same_in_micrometres_and_in_megametres(pursuits, L, M):
    plain, scale = pursuits["prr3"], Scale(robots.prr3(), L, M)
    robot = Robot(scale.mechanism)
    pursuit = Pursuit(robot, fixtures_of(robot).size)
    position, R = tool(plain, plain.robot.home)
    for shift in ([0.05, -0.03, 0.0], [0.0, 3.0, 0.0]):  # within reach, and out of it
        expected = plain.lead(plain.robot.home, plain.tool_goal(position + shift, R))
        found = pursuit.lead(robot.home, pursuit.tool_goal(L * (position + shift), R))
        assert (found.arrived, bool(found.obstacle)) == (expected.arrived, bool(expected.obstacle))
        assert found.state.positions / scale.coordinates() == pytest.approx(
            expected.state.positions, abs=1e-6
        )
        assert robot.closure_error(found.state) < 1e-9


@pytest.mark.parametrize("count", [1, 4])
def test_a_tool_that_nothing_moves_stands_still_when_it_is_dragged(count):
    """It is on a fixed body, beside joints that turn."""
    joints = {f"pin_{k}": RevoluteJoint(connects=("ground", f"arm_{k}")) for k in range(count)}
    bodies = {f"arm_{k}": Body(mass=1.0, inertia=Inertia(zz=0.1)) for k in range(count)}
    seat = FixedJoint(connects=("ground", "plate"))
    mechanism = Mechanism(
        bodies={**bodies, "plate": Body(mass=1.0)},
        joints={**joints, "seat": seat},
        tools={"tip": Tool(body="plate")},
    )
    session = Session(Robot(mechanism))
    place, R = session.view().tool
    session.drag(np.add(place, (0.1, 0, 0)), R)
    session.advance(0.03)
    assert "the tool stands still" in session.notice and session.goal is None


def test_robots_of_mixed_freedoms_are_dragged_in_their_task():
    """A 3-RRS rises and tilts and heeds no sideways pull; a SCARA arm shifts and turns upright."""
    legs, turn = Robot(three_legs("RRS")), Rotation.from_rotvec([0.1, -0.05, 0.0])
    pursuit = Pursuit(legs, fixtures_of(legs).size)
    position, R = tool(pursuit, legs.home)
    goal = pursuit.tool_goal(np.add(position, (0.1, -0.2, 0.03)), turn.as_matrix() @ R)
    reached = pursuit.lead(legs.home, goal)
    assert reached.arrived
    assert legs.task_values(reached.state) == pytest.approx(
        [position[2] + 0.03, 0.1, -0.05], abs=1e-7
    )
    out = pursuit.assembler.still(reached.state.q)
    assert goal.unled(out) == "the tool is led in z, rx, ry alone"
    assert pursuit.tool_goal(out["position"], out["orientation"].reshape(3, 3)).unled(out) == ""
    arm = Robot(scara())
    pursuit, values = Pursuit(arm, fixtures_of(arm).size), arm.task_values(arm.home)
    position, R = tool(pursuit, arm.home)
    goal = pursuit.tool_goal(
        np.add(position, (-0.05, 0.02, 0.1)), Rotation.from_rotvec([0, 0, 0.4]).as_matrix() @ R
    )
    reached = pursuit.lead(arm.home, goal)
    assert reached.arrived
    assert arm.task_values(reached.state) == pytest.approx(
        np.add(values, [-0.05, 0.02, 0.1, 0.4]), abs=1e-7
    )


def test_a_planar_tool_is_dragged_in_the_task_that_it_states():
    """An arm of two links whose tip is led in x and its angle, wherever the hand is in y."""
    arm = robots.pendulum((1.0, 0.6), (1.0, 1.0))
    (name, tip), *_ = arm.tools.items()
    own = {name: tip.model_copy(update={"task": ("x", "angle")})}
    bent = {"hinge_1": 0.3, "hinge_2": 1.2}
    robot = Robot(arm.model_copy(update={"tools": own, "reference": bent}))
    pursuit = Pursuit(robot, fixtures_of(robot).size)
    assert pursuit.turns
    position, R = tool(pursuit, robot.home)
    turned = Rotation.from_rotvec([0, 0, -0.2]).as_matrix() @ R
    reached = pursuit.lead(robot.home, pursuit.tool_goal(np.add(position, (-0.1, 9.0, 0)), turned))
    assert reached.arrived
    expected = np.add(robot.task_values(robot.home), (-0.1, -0.2))
    assert robot.task_values(reached.state) == pytest.approx(expected, abs=1e-7)
    assert reached.state.positions == pytest.approx(
        robot.assemble(tool=expected).positions, abs=1e-6
    )


def test_the_handle_of_a_relative_tool_is_where_the_tool_is():
    mechanism = scara()
    fields = {name: getattr(mechanism, name) for name in type(mechanism).model_fields}
    own = Tool(body="hand", relative_to="upper")
    session = Session(Robot(Mechanism(**(fields | {"tools": {"hand": own}}))))
    plain = Session(Robot(mechanism))
    for seen, expected in zip(session.view().tool, plain.view().tool, strict=True):
        assert seen == pytest.approx(expected, abs=1e-12)


def test_a_hexapod_is_led_in_all_six_freedoms(pursuits):
    pursuit = pursuits["stewart"]
    robot = pursuit.robot
    pose = np.array([0.2, -0.1, 2.3, 0.1, -0.2, 0.15])
    reached = pursuit.lead(
        robot.home, pursuit.tool_goal(pose[:3], Rotation.from_rotvec(pose[3:]).as_matrix())
    )
    assert robot.tool_pose(reached.state) == pytest.approx(pose, abs=1e-7)
    assert reached.state.positions == pytest.approx(robot.assemble(tool=pose).positions, abs=1e-7)


def test_loops_stay_closed_and_steps_stay_small_whatever_is_dragged(pursuits):
    random = np.random.default_rng(8)
    for name in ("prr3", "five_bar", "stewart"):
        pursuit = pursuits[name]
        state = pursuit.robot.home
        for _ in range(60):
            position, R = tool(pursuit, state)
            goal = pursuit.tool_goal(position + 4 * pursuit.size * random.standard_normal(3), R)
            after = pursuit.step(state, goal).state
            assert pursuit.robot.closure_error(after) < 1e-9
            assert np.linalg.norm(tool(pursuit, after)[0] - position) < 0.25 * pursuit.size
            state = after


def test_out_of_reach_a_pendulum_points_at_the_hand(pursuits):
    """The nearest point of a circle lies on the line to its centre."""
    pursuit = pursuits["pendulum"]
    position, R = tool(pursuit, pursuit.robot.home)
    length = np.linalg.norm(position)
    target = np.array([3.0, -1.0, 0.0]) * length
    reached = pursuit.lead(pursuit.robot.home, pursuit.tool_goal(target, R))
    found = tool(pursuit, reached.state)[0]
    assert found == pytest.approx(length * target / np.linalg.norm(target), abs=2e-2 * length)
    assert "freedoms" in reached.obstacle


def test_out_of_reach_the_legs_are_named(pursuits):
    pursuit = pursuits["five_bar"]
    position, R = tool(pursuit, pursuit.robot.home)
    reached = pursuit.lead(
        pursuit.robot.home, pursuit.tool_goal(position + np.array([5.0, 0.0, 0.0]), R)
    )
    assert reached.obstacle.startswith("the edge of the workspace: stretched out or folded at")
    assert "elbow_1" in reached.obstacle and "elbow_2" not in reached.obstacle
    links = [np.linalg.norm(p) for p in stretched(pursuit.robot, reached.state)]
    assert links[0] == pytest.approx(links[1] + links[2], rel=5e-3)


def stretched(robot, state):
    """Return the vectors motor to tip, motor to elbow, elbow to tip of the first leg."""
    poses = robot.body_poses(state)
    joint = robot.mechanism.joints
    first, second = joint["motor_1"], joint["elbow_1"]
    motor = np.array(first.frames[0].position)
    p, R = poses[second.connects[0]]
    elbow = p + R @ np.array(second.frames[0].position)
    tip = np.append(robot.tool_pose(state)[:2], 0.0)
    return tip - motor, elbow - motor, tip - elbow


def limited(lower: float, upper: float) -> Pursuit:
    """Return the pursuit of a 3-PRR whose first slide has limits."""
    plain = robots.prr3()
    slide = plain.joints["slide_1"].model_copy(update={"limits": Limits(lower=lower, upper=upper)})
    robot = Robot(Mechanism(**{**dict(plain), "joints": {**plain.joints, "slide_1": slide}}))
    return Pursuit(robot, fixtures_of(robot).size)


def test_limits_hold_and_are_named():
    pursuit = limited(0.1, 0.2)
    position, R = tool(pursuit, pursuit.robot.home)
    state, said = pursuit.robot.home, set()
    for shift in ((0.3, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, 0.1, 0.0)):
        reached = pursuit.lead(state, pursuit.tool_goal(position + shift, R))
        state = reached.state
        said.add(reached.obstacle)
        if "upper" in reached.obstacle:
            assert state["slide_1"] == pytest.approx(0.2, abs=1e-9)
        assert 0.1 - 1e-9 <= state["slide_1"] <= 0.2 + 1e-9
        assert pursuit.robot.closure_error(state) < 1e-9
    assert {"slide_1 is at its upper limit 0.2 m", "slide_1 is at its lower limit 0.1 m"} <= said


def test_a_start_outside_the_limits_is_led_no_further_out():
    pursuit = limited(0.3, 0.4)
    position, R = tool(pursuit, pursuit.robot.home)
    reached = pursuit.lead(pursuit.robot.home, pursuit.tool_goal(position - (0.2, 0.0, 0.0), R))
    assert reached.state["slide_1"] >= pursuit.robot.home["slide_1"] - 1e-9
    assert "lower limit" in reached.obstacle


def test_limits_of_a_free_turn_change_with_the_rates_as_their_rows_say():
    body = Body(mass=1.0, inertia=Inertia(xx=0.1, yy=0.1, zz=0.1))
    ball = SphericalJoint(connects=("ground", "arm"), limits={"turn": Limits(upper=1.0)})
    tip = Tool(body="arm", frame=Frame(position=(0.0, 0.0, 1.0)))
    robot = Robot(Mechanism(bodies={"arm": body}, joints={"ball": ball}, tools={"tip": tip}))
    pursuit = Pursuit(robot, 1.0)
    (bound,) = bounds_of(robot)
    q, w, h = (
        pursuit.moved(robot.home.q, pursuit.assembler.still(robot.home.q), np.full(3, 0.1)),
        np.eye(3),
        1e-7,
    )
    out = pursuit.assembler.still(q)
    for k in range(3):
        later = pursuit.assembler.still(pursuit.moved(q, out, h * w[k] / pursuit.scale))
        assert (bound.value(later) - bound.value(out)) / h == pytest.approx(
            bound.row(out)[k], abs=1e-6
        )
    position, R = tool(pursuit, robot.home)
    reached = pursuit.lead(robot.home, pursuit.tool_goal(np.array([0.0, 3.0, -1.0]), R))
    angle = np.arccos(tool(pursuit, reached.state)[0] @ position)
    assert "upper limit 1 rad" in reached.obstacle and angle <= 1.0 + 1e-9


def test_joints_are_set_as_assembling_sets_them(pursuits):
    pursuit = pursuits["prr3"]
    robot = pursuit.robot
    targets = {name: float(robot.home[name]) for name in robot.actuators} | {"slide_2": 0.25}
    reached = pursuit.lead(robot.home, pursuit.joint_goal(targets))
    assert reached.arrived
    assert reached.state.positions == pytest.approx(robot.assemble(targets).positions, abs=1e-8)


def test_a_joint_that_cannot_go_on_leaves_the_others_where_they_are(pursuits):
    pursuit = pursuits["prr3"]
    robot = pursuit.robot
    targets = {name: float(robot.home[name]) for name in robot.actuators} | {"slide_2": 3.0}
    reached = pursuit.lead(robot.home, pursuit.joint_goal(targets))
    assert not reached.arrived and "the loops cannot be closed" in reached.obstacle
    assert robot.closure_error(reached.state) < 1e-9
    for name in ("slide_1", "slide_3"):
        assert reached.state[name] == pytest.approx(targets[name], abs=1e-6)


def test_what_the_tool_can_do(pursuits):
    turning = {name: pursuit.turns for name, pursuit in pursuits.items()}
    assert turning == {
        "prr3": True,
        "five_bar": False,
        "stewart": True,
        "delta": False,
        "pendulum": False,
    }


def test_a_slightly_open_configuration_is_closed_and_a_hopeless_one_is_not(pursuits):
    pursuit = pursuits["five_bar"]
    q = pursuit.robot.home.q
    closed = pursuit.close(q + 1e-3)
    assert closed is not None and pursuit.robot.closure_error(pursuit.at(closed)) < 1e-12
    assert pursuits["prr3"].close(pursuits["prr3"].robot.home.q + 50.0 * np.eye(7)[0]) is None


def dragged(session: Session, *shift: float) -> str:
    """Drag the tool to a place beside its first one; return what is told there."""
    p, R = tool(session.pursuit, session.robot.home)
    session.drag(p + np.array(shift), R)
    while session.active:
        session.advance(0.05)
    return session.notice


def test_singular_poses_of_the_drives_that_are_passed_are_told():
    """A five-bar whose forearms come into one line, and back; what was told goes with the hand."""
    session = Session(Robot("five_bar"))
    assert dragged(session, 0.0, 0.02, 0.0) == ""
    assert "a singular pose of the drives was passed" in dragged(session, 0.0, -0.3, 0.0)
    session.release()
    assert dragged(session, 0.0, -0.31, 0.0) == ""
    assert "of the drives was passed" in dragged(session, 0.0, 0.0, 0.0)


def test_singular_poses_of_the_loops_that_are_passed_are_told():
    """Where a 3-UPU's platform may turn: its legs' axes are at their base's radius from there."""
    session = Session(upu())
    for y in (0.9 * BASE, -0.9 * BASE):
        assert dragged(session, 0.0, y, 0.0) == ""
    assert "a singular pose of the loops was passed" in dragged(session, 0.0, -1.1 * BASE, 0.0)


def test_listed_names():
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c", "d"]) == "a, b, c and d"
    assert listed(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def test_sides_are_told_by_all_rows():
    """A Bennett linkage meets no singular pose in a turn, but its kept rows depend on each other at
    one."""
    robot = Robot("bennett")
    joints = robot.leader_of_joints(robot.joints_asked(("hinge_1",)))
    crossings = Pursuit(robot, fixtures_of(robot).size).crossings
    goal: Any = SimpleNamespace(strict=True)
    turn = robot.assemble({"hinge_1": np.linspace(-3.0, 3.2, 60)})
    outs = [{name: of[0] for name, of in joints.outputs(q[None]).items()} for q in turn.q]
    kept = list(robot.equations.chart.rows)
    alone = [
        np.linalg.det(np.vstack([crossings.loops(out)[kept], out["J_coordinates"][:1]]))
        for out in outs
    ]
    assert min(alone) < 0 < max(alone)
    for out, other in pairwise(outs):
        assert list(crossings.turned(out, other, goal).values()) == [1.0]
