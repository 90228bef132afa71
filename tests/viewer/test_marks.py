"""Names, frames and the trail of the tool, without a browser."""

import numpy as np
import pytest

from linkwork import Robot, robots
from linkwork.viewer.cameras import CAMERAS, camera
from linkwork.viewer.marks import FRAMES, NAMES, Marks, written
from linkwork.viewer.session import Session

from tests.catalogue import built

SOME = ("prr3", "stewart", "delta", "flyball_governor", "bricard")


@pytest.fixture
def session() -> Session:
    return Session(built("prr3"))


def settle(session: Session) -> None:
    for _ in range(300):
        if not session.advance(1 / 30):
            return
    raise AssertionError("it does not come to rest")


@pytest.mark.parametrize("name", SOME)
def test_names_and_frames_move_with_their_bodies(name):
    robot = built(name)
    session = Session(robot)
    joint = next(iter(session.sliders))
    session.slide(joint, float(robot.home[joint]) + 0.01)
    settle(session)
    session.shown = frozenset(NAMES + FRAMES)
    marks = session.view().marks
    centres = robot.body_poses(session.state)
    for k, (body, data) in enumerate(robot.mechanism.bodies.items()):
        p, R = centres[body]
        assert marks["names of bodies"].positions[k] == pytest.approx(p + R @ data.centre_of_mass)
        assert marks["frames of bodies"].turns[k + 1] == pytest.approx(R)
        assert marks["frames of bodies"].names[k + 1] == body
    assert marks["frames of joints"].names[::2] == marks["names of joints"].names


def test_the_frames_of_a_joint_part_by_its_coordinates():
    """A slide's second frame lies its coordinate along its axis from the first, turned alike; a
    hinge's two frames have one origin and the angle between them."""
    robot = built("prr3")
    session = Session(robot)
    session.slide("slide_1", 0.13)
    settle(session)
    session.shown = frozenset(FRAMES)
    marks = session.view().marks["frames of joints"]
    for k, name in enumerate(robot.mechanism.pairs):
        first, second = marks.turns[2 * k : 2 * k + 2]
        way = marks.positions[2 * k + 1] - marks.positions[2 * k]
        turn = first.T @ second
        if name.startswith("slide"):
            assert np.linalg.norm(way) == pytest.approx(abs(float(session.state[name])))
            assert turn == pytest.approx(np.eye(3))
        else:
            assert way == pytest.approx(np.zeros(3), abs=1e-9)
            if name in robot.coordinates:
                angle = np.arctan2(turn[1, 0], turn[0, 0])
                assert np.cos(angle - float(session.state[name])) == pytest.approx(1)


def test_nothing_is_marked_unless_asked_for(session):
    view = session.view()
    assert view.marks == {} and view.trail.shape == (0, 2, 3)


def test_names_at_one_place_stand_below_each_other():
    places = np.array([(0, 0, 0), (1, 0, 0), (0, 0, 0.001), (0, 0, 0.03)], float)
    marks = Marks(("a", "b", "c", "d"), places, np.array([np.eye(3)] * 4))
    assert written(marks, 1.0) == ("a\nc", "b", "", "d")


def test_the_trail_of_a_run_leads_along_the_closed_way_of_the_tool_to_where_it_is(session):
    robot = session.robot
    fine = robot.simulate(
        robot.home, {"slide_1": 2.0}, duration=0.4, save_at=np.linspace(0, 0.4, 9)
    )
    session.load(fine)
    session.trailing = True
    session.seek(0.3)
    view = session.view()
    assert view.trail[0, 0] == pytest.approx(tool(robot, robot.home))
    assert view.trail[-1, 1] == pytest.approx(view.tool[0])
    assert view.trail[1:, 0] == pytest.approx(view.trail[:-1, 1])
    passed = np.stack([fine.variables["tool_pose"].values[k, :2] for k in range(7)])
    ends = np.concatenate([view.trail[:, 0], view.trail[-1:, 1]])[:, :2]
    nearest = np.linalg.norm(ends[:, None] - passed, axis=2).min(axis=0)
    assert nearest == pytest.approx(0, abs=1e-9)
    session.seek(0.0)
    assert not len(session.view().trail)


def tool(robot: Robot, state) -> np.ndarray:
    x, y, _ = robot.tool_pose(state)
    return np.array([x, y, 0.0])


def test_the_trail_of_a_hand_begins_where_it_took_hold_and_ends_with_a_pose_that_is_shown(session):
    robot = session.robot
    start = session.view().tool
    session.trailing = True
    session.drag(start[0] + (0.04, 0.02, 0), start[1])
    settle(session)
    trail = session.view().trail
    assert trail[0, 0] == pytest.approx(start[0])
    assert trail[-1, 1] - start[0] == pytest.approx([0.04, 0.02, 0], abs=1e-8)
    session.show(robot.home)
    assert not len(session.view().trail)


def test_a_robot_without_tool_has_no_trail():
    session = Session(built("bricard"))
    session.trailing = True
    assert session.view().trail.shape == (0, 2, 3)


def test_cameras_look_along_axes_and_with_equal_angles():
    robot = Robot(robots.stewart())
    for name, towards in (("xy", (0, 0, 1)), ("xz", (0, -1, 0)), ("yz", (1, 0, 0))):
        up, found = camera(name, robot)
        assert found == pytest.approx(towards)
        assert np.cross(up, found) == pytest.approx(np.eye(3)["xyz".index(name[0])])
    for name in ("stewart", "prr3", "five_bar"):
        up, towards = camera("iso", built(name))
        assert np.abs(towards) == pytest.approx(np.full(3, np.sqrt(1 / 3)))
        assert up @ towards == pytest.approx(np.sqrt(1 / 3))
    assert set(CAMERAS) == {"iso", "xy", "xz", "yz"}
