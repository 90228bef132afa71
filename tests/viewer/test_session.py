"""What happens in the viewer, without a browser."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, Robot, robots
from linkwork.analysis import dexterity, transmission_indices
from linkwork.mechanism import Mechanism
from linkwork.mechanism.transmissions import Combination
from linkwork.viewer.named_dexterity import MEASURES, require_measure
from linkwork.viewer.panels import facts
from linkwork.viewer.session import KINDS, Session


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(robots.prr3())


@pytest.fixture
def session(robot) -> Session:
    return Session(robot)


def settle(session: Session) -> None:
    for _ in range(300):
        if not session.advance(1 / 30):
            return
    raise AssertionError("it does not come to rest")


def test_a_drag_moves_the_tool_and_what_is_seen_agrees(session, robot):
    before = session.view()
    session.drag(before.tool[0] + (0.04, 0.02, 0), before.tool[1])
    settle(session)
    after = session.view()
    assert after.tool[0] - before.tool[0] == pytest.approx([0.04, 0.02, 0], abs=1e-8)
    assert after.closure < 1e-9 and after.notice == ""
    assert after.coordinates["slide_1"] == pytest.approx(float(session.state["slide_1"]))
    assert not np.allclose(after.placement.positions, before.placement.positions)


def test_out_of_reach_is_said_and_forgotten_with_the_next_drag(session):
    position, R = session.view().tool
    session.drag(position + 9 * np.eye(3)[0], R)
    settle(session)
    assert "edge of the workspace" in session.notice
    session.release()
    session.drag(position, R)
    settle(session)
    assert "edge of the workspace" not in session.notice  # but how it came back from there
    assert session.view().tool[0] == pytest.approx(position, abs=1e-8)


def test_release_ends_a_pursuit(session):
    position, R = session.view().tool
    session.drag(position + 0.3 * np.eye(3)[0], R)
    session.advance(0.03)
    session.release()
    assert not session.advance(0.03)


def test_a_slider_moves_its_joint_alone(session, robot):
    session.slide("slide_2", 0.2)
    settle(session)
    assert session.state["slide_2"] == pytest.approx(0.2)
    assert session.state["slide_1"] == pytest.approx(float(robot.home["slide_1"]), abs=1e-9)


def test_sliders_take_limits_and_joints_of_robots_without_actuators():
    assert set(Session(Robot(robots.prr3())).sliders) == {"slide_1", "slide_2", "slide_3"}
    passive = Session(Robot(robots.double_pendulum()))
    assert len(passive.sliders) == 2
    name, (low, high) = next(iter(passive.sliders.items()))
    assert low < passive.robot.home[name] < high
    joints = passive.robot.mechanism.joints
    pulled = passive.robot.mechanism.model_dump() | {
        "transmissions": {"tendon": Combination(ratios=dict.fromkeys(joints, 0.1))},
        "actuators": ("tendon",),
    }
    driven = Session(Robot(Mechanism.model_validate(pulled)))
    assert driven.robot.actuators == ("tendon",) and driven.sliders == passive.sliders
    driven.slide(name, high / 2)
    settle(driven)
    assert driven.state[name] == pytest.approx(high / 2)


def test_a_drag_to_where_the_tool_is_not_led_is_said():
    session = Session(Robot(robots.rrs3()))
    position, R = session.view().tool
    session.drag(np.add(position, (0.3 * session.parts.size, 0, 0)), R)
    settle(session)
    assert session.notice == "the tool is led in z, rx, ry alone"
    session.drag(np.add(position, (0, 0, 0.01 * session.parts.size)), R)
    settle(session)
    assert session.notice == "" and session.view().tool[0][2] > position[2]


def test_a_run_plays_to_its_end_and_is_seen_on_its_way(session, robot):
    session.shown = frozenset(KINDS)
    session.load(robot.simulate(robot.home, {"slide_1": 2.0}, duration=0.3))
    session.play()
    seen = []
    while session.advance(0.05):
        view = session.view()
        seen.append(view.time)
        assert view.closure < 1e-9
        assert view.forces == {"slide_1": 2.0, "slide_2": 0.0, "slide_3": 0.0}
        assert set(view.arrows) == set(KINDS) and len(view.arrows["actuator forces"].arrows) == 1
    assert seen == pytest.approx([0.05, 0.1, 0.15, 0.2, 0.25, 0.3])
    assert session.player.ended and not session.player.playing
    session.seek(0.1)
    assert session.view().time == pytest.approx(0.1)


def test_dragging_stops_a_run_where_it_is(session, robot):
    session.load(robot.simulate(robot.home, {"slide_1": 2.0}, duration=0.3))
    session.play()
    session.advance(0.2)
    there = session.view().tool
    session.drag(*there)
    assert session.view().time is None and not session.player.playing
    assert session.view().tool[0] == pytest.approx(there[0])


def test_what_was_said_of_a_pose_is_not_said_of_the_run_that_is_played(session, robot):
    session.load(robot.simulate(robot.home, {"slide_1": 9.0}, duration=1.0, max_steps=3))
    position, R = session.view().tool
    session.drag(position + 9 * np.eye(3)[0], R)
    settle(session)
    assert "edge of the workspace" in session.notice
    session.play()
    assert "edge of the workspace" not in session.notice and "ended early" in session.notice


def test_while_posing_forces_are_those_that_hold(session, robot):
    forces = session.view().forces
    assert list(forces.values()) == pytest.approx(robot.inverse_dynamics(robot.home, np.zeros(3)))


def test_empty_one_sample_and_early_ended_runs_are_said(session, robot):
    session.load(robot.simulate(robot.home, duration=0.1, save_at=[]))
    assert "no samples" in session.notice and not session.playable
    session.play()
    session.seek(0.05)
    assert session.view().time is None
    session.load(robot.simulate(robot.home, duration=0.1, save_at=[0.05]))
    assert "one sample" in session.notice
    session.play()
    assert not session.advance(1.0)
    session.load(robot.simulate(robot.home, {"slide_1": 9.0}, duration=1.0, max_steps=3))
    assert "ended early" in session.notice


def test_a_run_of_another_robot_leaves_things_as_they_were(session, robot):
    own = robot.simulate(robot.home, duration=0.1)
    session.load(own)
    other = Robot(robots.five_bar())
    with pytest.raises(LinkworkError, match="not one of the robot"):
        session.load(other.simulate(other.home, duration=0.1))
    assert session.replay.run is own
    with pytest.raises(LinkworkError):
        session.show(other.home)


def test_robots_without_tool_actuators_or_rest_can_be_seen():
    for name in ("bricard", "double_pendulum", "andrews", "flyball_governor"):
        session = Session(Robot(getattr(robots, name)()))
        session.shown = frozenset(KINDS)
        view = session.view()
        assert np.isfinite(view.placement.positions).all() and 0 <= view.conditioning <= 1


def test_a_planar_tool_is_turned_where_it_is(session, robot):
    before = session.view()
    session.turn(before.angle + 0.3)
    settle(session)
    after = session.view()
    assert after.angle == pytest.approx(before.angle + 0.3)
    assert after.tool[0] == pytest.approx(before.tool[0], abs=1e-8)
    assert after.angle == pytest.approx(robot.tool_pose(session.state)[2])
    with pytest.raises(LinkworkError, match="the tool's angle is"):
        session.turn(float("nan"))


def test_another_run_is_shown_at_the_same_times(session, robot):
    first = robot.simulate(robot.home, {"slide_1": 2.0}, duration=0.3)
    second = robot.simulate(robot.home, {"slide_2": 2.0}, duration=0.5)
    session.load(first)
    assert session.view().over is None
    session.lay_over(second)
    session.seek(0.2)
    at = robot.simulate(robot.home, {"slide_2": 2.0}, duration=0.2).final
    expected = session.layout.place(at)
    assert session.view().over.positions == pytest.approx(expected.positions, abs=2e-3)
    assert not np.allclose(session.view().placement.positions, expected.positions, atol=2e-3)
    session.seek(9.0)
    assert session.view().time == 0.5
    assert session.state.positions == pytest.approx(first.final.positions, abs=1e-9)
    session.lay_over(None)
    assert session.view().over is None and session.view().time == pytest.approx(0.3)
    with pytest.raises(LinkworkError, match="not one of the robot"):
        session.lay_over(Robot(robots.five_bar()).simulate(Robot("five_bar").home, duration=0.1))


def test_the_pose_of_a_relative_tool_is_told_in_its_own_frame():
    """Its place as its angle, for both are told of one frame."""
    slide = {"x": (1, 0, 0), "y": (0, 1, 0)}
    joints = {
        name: lw.PrismaticJoint(connects=(body, f"{body}'"), axis=axis)
        for body, (name, axis) in zip(("ground", "ground'"), slide.items(), strict=True)
    }
    joints["turn"] = lw.RevoluteJoint(connects=("ground", "table"))
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    robot = Robot(
        lw.Mechanism(
            bodies={name: body for name in ("ground'", "ground''", "table")},
            joints=joints,
            actuators=("x", "y", "turn"),
            tools={"tip": lw.Tool(body="ground''", relative_to="table")},
        )
    )
    session = Session(robot)
    session.show(robot.assemble({"x": 0.3, "y": 0.1, "turn": np.pi / 2}))
    said = facts(session, session.view())
    assert "tool at 0.1000, -0.3000 m, -1.5708 rad, relative to table" in said


def test_dexterity_is_told_by_name_and_coloured(session, robot):
    """The numbers are those of the analyses; what is not defined somewhere is said to be so."""
    pose = np.add(robot.task_values(robot.home), (0.03, 0.02, 0.1))
    session.show(robot.assemble(tool=pose))
    told, indices = dexterity(robot, session.state), transmission_indices(robot, session.state)
    volume = told.manipulability / dexterity(robot, robot.home).manipulability
    expected = {
        "conditioning": (f"{told.conditioning:.3f}", told.conditioning),
        "manipulability": (f"{told.manipulability:.3g}, {volume:.3g} times", volume),
        "transmission angle": (
            f"{told.transmission_angle.min():.3f} rad (slide_",
            told.transmissibility.min(),
        ),
        "local transmission index": (f"{indices.local:.3f}", indices.local),
    }
    assert list(MEASURES) == list(expected)
    for name, (words, share) in expected.items():
        session.measure = name
        view = session.view()
        assert (view.measured.name, view.conditioning) == (name, pytest.approx(told.conditioning))
        assert view.measured.told.startswith(words) and view.measured.share == pytest.approx(share)
        assert words in facts(session, view)
    arm = Session(Robot(robots.puma560()))
    with pytest.raises(LinkworkError, match="no unique transmission wrench"):
        require_measure(arm.robot, "local transmission index")
    arm.measure = "local transmission index"
    assert arm.view().measured.told == "not defined here" and np.isnan(arm.view().measured.share)
