"""A simulation that goes on while a hand pulls: against closed solutions, and against the one run
that is kept of it."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, Robot, robots
from linkwork.viewer.pulling import DAMPING, FREQUENCY, HandPull, Live
from linkwork.viewer.session import Session
from linkwork.viewer.simulating import CONTROLLERS, driving
from linkwork.viewer.traces import quantities, traces

PICTURE = 1 / 30


@pytest.fixture(scope="module")
def stone() -> Robot:
    """Return a free body without weight, whose mass centre is beside its origin."""
    body = lw.Body(mass=2.0, centre_of_mass=(0.1, 0, 0), inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
    joints = {"free": lw.FreeJoint(connects=("ground", "stone"))}
    return Robot(lw.Mechanism(bodies={"stone": body}, joints=joints, gravity=(0, 0, 0)))


def live_of(robot: Robot, body: str, controller: str = CONTROLLERS[0]) -> Live:
    drive = driving(robot, robot.home, controller, {})
    return Live(robot, robot.home, drive, HandPull.at(robot, robot.home, body))


def test_a_free_body_on_the_hand_swings_as_a_damped_oscillator(stone):
    """m x'' + d x' + k x = 0 about the hand, which stands still."""
    live = live_of(stone, "stone")
    assert live.pull.stiffness == pytest.approx(2.0 * (2 * np.pi * FREQUENCY) ** 2)
    hand, start = np.array([0.1, 0.4, 0.0]), live.pull.place(stone, live.state)
    assert start == pytest.approx([0.1, 0, 0])
    for _ in range(15):
        live.advance(PICTURE, hand)
    omega = 2 * np.pi * FREQUENCY
    fast, t = omega * np.sqrt(1 - DAMPING**2), live.time
    x = np.exp(-DAMPING * omega * t) * (
        np.cos(fast * t) + DAMPING * omega / fast * np.sin(fast * t)
    )
    place = live.pull.place(stone, live.state)
    assert t == pytest.approx(0.5) and place == pytest.approx([0.1, 0.4 - 0.4 * x, 0], abs=1e-7)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_is_kept_is_what_was_seen_with_the_force_in_it(controller):
    robot = Robot(robots.prr3())
    live = live_of(robot, "platform", controller)
    live.prepare()
    assert live.time == 0 and live.state is robot.home
    seen = []
    for k in range(20):
        hand = None if k < 5 else np.array([0.6, 0.3 + 0.005 * k, 0.0])
        live.advance(PICTURE, hand)
        seen.append(np.array([*live.pull.place(robot, live.state), *live.force(hand)]))
        assert robot.closure_error(live.state) < 1e-12
    run, notice = live.kept()
    assert notice == "" and run.success and run.time[-1] == pytest.approx(20 * PICTURE)
    assert run.final.positions == pytest.approx(live.state.positions, abs=1e-6)
    # The force that is kept is the one that was told, picture by picture, and does the work.
    told = run.resampled((np.arange(20) + 1) * PICTURE - 1e-9)["external_wrench"].values[:, 0, 3:]
    assert told[:5] == pytest.approx(0 * told[:5]) and np.abs(told[6:]).max() > 1
    np.testing.assert_allclose(told[:, :2], np.array(seen)[:, 3:5], atol=1e-4 * np.abs(told).max())
    assert np.abs(run["energy_balance"].values).max() < 1e-6


def test_a_session_goes_on_until_something_else_is_wanted():
    robot = Robot(robots.prr3())
    session, live = Session(robot), live_of(robot, "platform")
    session.begin(live)
    assert session.active and session.view().pulled.hand is None
    session.hand = session.view().pulled.place + 0.1 * np.eye(3)[0]
    assert session.advance(PICTURE)
    view = session.view()
    assert view.time == pytest.approx(PICTURE) and view.closure < 1e-9
    assert view.pulled.body == "platform" and view.pulled.force[0] > 1
    assert view.forces == {"slide_1": 0.0, "slide_2": 0.0, "slide_3": 0.0}
    session.slide("slide_1", 0.2)
    assert session.live is None and session.hand is None and session.view().pulled is None


def test_without_a_picture_there_is_nothing_to_keep(stone):
    with pytest.raises(LinkworkError, match="there is nothing to play"):
        live_of(stone, "stone").kept()


def test_the_force_is_drawn_over_time_by_its_components():
    robot = Robot(robots.prr3())
    wrench = lw.control.Wrench("platform", force=(0.0, 2.0, 0.0))
    run = robot.simulate(robot.home, duration=0.1, wrenches=[wrench], save_at=[0, 0.1])
    assert "external_wrench" in quantities(run)
    found = traces(run, "external_wrench")
    assert len(found.labels) == 6 and all("platform: " in label for label in found.labels)
    assert found.values[4] == pytest.approx([2.0, 2.0]) and found.unit == "N m, N"
    assert np.abs(np.delete(found.values, 4, axis=0)).max() == 0


def test_a_run_that_is_laid_over_goes_on_beside_a_live_one(stone):
    """It stood where the last run was left."""
    drifting = stone.simulate(stone.home.with_rates([0.7, 0, 0, 0, 0, 0]), duration=1.0)
    session = Session(stone)
    session.load(drifting)
    session.lay_over(drifting)
    session.seek(0.25)
    live = live_of(stone, "stone")
    session.begin(live)
    for _ in range(15):
        live.advance(PICTURE, None)
    seen = session.view()
    assert seen.time == pytest.approx(0.5)
    assert seen.over.positions[0] == pytest.approx([0.1 + 0.7 * 0.5, 0, 0], abs=1e-9)
