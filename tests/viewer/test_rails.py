"""Rails in the viewer: as long as limits, runs and hands need, and never shorter than what slides
on them."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import GROUND
from linkwork.viewer import Viewer
from linkwork.viewer.session import Session


def cart(limits: lw.Limits | None = None, connects=("ground", "cart")) -> lw.Robot:
    """Return a cart that is pushed along (0, 1, 0)."""
    joint = lw.PrismaticJoint(connects=connects, axis=(0.0, 1.0, 0.0), limits=limits or lw.Limits())
    arm = lw.RevoluteJoint(connects=("cart", "arm"), axis=(0.0, 0.0, 1.0))
    bodies = {"cart": lw.Body(mass=1.0), "arm": lw.Body(mass=0.1, centre_of_mass=(1.0, 0, 0))}
    joints = {"x": joint, "hinge": arm}
    mechanism = lw.Mechanism(bodies=bodies, joints=joints, actuators=("x",), gravity=(0, 0, 0))
    return lw.Robot(mechanism)


def ends(session: Session) -> np.ndarray:
    """Return from where to where the one rail leads along y [m]."""
    (rail,) = session.view().rails
    return np.sort([rail.start[1], (rail.start + rail.length * rail.axis)[1]])


@pytest.mark.parametrize("connects", [("ground", "cart"), ("cart", "ground")])
def test_a_rail_is_as_long_as_the_run(connects):
    robot = cart(connects=connects)
    session, sense = Session(robot), 1.0 if connects[0] == GROUND else -1.0
    run = robot.simulate(robot.home, [sense * 4.4], duration=2.0)
    way = run.variables["joint_position"].values[:, 0]
    assert sense * way[-1] == pytest.approx(8.0, rel=0.01)
    session.load(run)
    low, high = ends(session)
    room = session.rails[0].room
    assert high == pytest.approx(sense * way[-1] + room)
    assert low == pytest.approx(-room) and 0 < room < 0.5


def test_limits_say_how_long_it_is():
    robot = cart(lw.Limits(lower=-1.0, upper=3.0))
    session = Session(robot)
    half = session.rails[0].half
    assert ends(session) == pytest.approx([-1.0 - half, 3.0 + half])
    session.load(robot.simulate(robot.home, [0.5], duration=0.5))
    assert ends(session) == pytest.approx([-1.0 - half, 3.0 + half])


def test_a_hand_that_leads_beyond_it_makes_it_longer():
    robot = cart()
    session = Session(robot)
    low, high = ends(session)
    session.show(robot.state({"x": 5.0, "hinge": 0.0}))
    longer = ends(session)
    assert longer == pytest.approx([low, 5.0 + session.rails[0].half]) and high < longer[1]
    session.show(robot.home)
    assert ends(session) == pytest.approx(longer)


def test_a_screw_in_the_ground_is_as_long_as_its_nut_travels():
    joints = {"screw": lw.ScrewJoint(connects=("ground", "nut"), axis=(0.0, 1.0, 0.0), pitch=0.1)}
    robot = lw.Robot(lw.Mechanism(bodies={"nut": lw.Body(mass=1.0)}, joints=joints))
    session = Session(robot)
    for rail in session.rails:
        session.show(robot.state({"screw": 40 * np.pi}))
        assert ends(session)[1] == pytest.approx(4 * np.pi + rail.half)


def test_the_page_shows_rails_as_long_as_they_are():
    robot = cart()
    with Viewer(robot, robot.simulate(robot.home, [4.4], duration=2.0)) as viewer:
        (rail,) = viewer.session.rails
        (batch,) = [batch for batch in viewer.stage.still if rail.part in batch.group]
        place = list(batch.group).index(rail.part)
        assert batch.node.batched_positions[place] == pytest.approx(rail.start)
        assert rail.length > 8.0
        assert batch.node.batched_scales[place][2] == pytest.approx(rail.length)
