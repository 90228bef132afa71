"""Events of ensembles in vector lanes against the same runs one by one."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import Status
from linkwork.control import Event
from linkwork.runs import ensemble

from tests.robot.one_by_one import require_equal

T = np.linspace(0.0, 0.6, 7)


@pytest.fixture
def never_alone(monkeypatch):
    """Let no member run by itself from its start."""

    def refused(batch, method):
        found = in_lanes(batch, method)
        assert found, "these members ran by themselves"
        return found

    in_lanes = ensemble.in_lanes
    monkeypatch.setattr(ensemble, "in_lanes", refused)


def require_identical(together, runs):
    """Require the same numbers to the last bit, events included."""
    require_equal(together, runs)
    for i, run in enumerate(runs):
        assert together.final.q[i].tolist() == run.attrs["final_q"].tolist()
        times = [time for _, time in together.events(i)]
        assert times == run.dataset["event_time"].values.tolist()


@pytest.mark.parametrize("method", ["dormand_prince", None])
def test_balls_bounce_in_lanes_as_they_do_alone(never_alone, method):
    """Free bodies with contact and friction: steps are cut where they touch; some end stiff."""
    ball = lw.Body(mass=0.4, inertia=lw.Inertia(xx=1.6e-3, yy=1.6e-3, zz=1.6e-3))
    floor = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=1e5,
        dissipation=0.5,
        friction=lw.Sliding(coefficient=0.2),
    )
    joints = {"free": lw.FreeJoint(connects=("ground", "ball"))}
    robot = lw.Robot(lw.Mechanism(bodies={"ball": ball}, joints=joints, contacts={"floor": floor}))
    rng, places = np.random.default_rng(1), np.tile([0, 0, 0.3, 1, 0, 0, 0.0], (11, 1))
    places[:, 2] += rng.uniform(0, 0.3, 11)
    states = robot.state(places, rng.normal(size=(11, 6)))
    options = {"duration": 0.6, "save_at": T, "method": method}
    together = robot.ensemble(states, **options)
    runs = [robot.simulate(states.at(i), **options) for i in range(11)]
    require_identical(together, runs)
    assert len({len(together.events(i)) for i in range(11)}) > 2
    assert together.dataset.event_member.values.tolist() == sorted(together.dataset.event_member)


def test_events_of_closed_loops_that_turn_around_and_change_charts(never_alone):
    """Angles with whole turns, loops that are closed at each place looked at, terminal events."""
    robot = lw.Robot(lw.robots.five_bar())
    first, home = robot.coordinates[0], robot.home.positions[0]
    events = [
        Event(lambda t, state: state[first] - home - 0.1, name="there", cuts=True),
        Event(lambda t, state: state.rate(first), name="turns"),
        Event(lambda t, state: state[first] - home - 0.3, name="far", terminal=True),
    ]
    rates = np.linspace(0.5, 12.0, 9)[:, None] * np.cos(np.arange(robot.mobility))
    states = robot.state(np.tile(robot.home.positions, (9, 1)), rates)
    options = {"duration": 0.4, "save_at": T[:5] / 2, "events": events}
    together = robot.ensemble(states, **options)
    runs = [robot.simulate(states.at(i), **options) for i in range(9)]
    require_identical(together, runs)
    assert {Status.EVENT, Status.FINISHED} <= set(together.status.tolist())
    assert {name for i in range(9) for name, _ in together.events(i)} >= {"there", "far"}


def test_turns_of_large_angles_are_seen_by_events(never_alone):
    """A pendulum that goes round meets an angle behind many whole turns."""
    robot = lw.Robot(lw.robots.pendulum())
    name = robot.coordinates[0]
    events = [Event(lambda t, state: state[name] - 40.0, name="turned", terminal=True)]
    states = robot.state(np.zeros((5, 1)), np.array([[1.0], [60.0], [80.0], [100.0], [400.0]]))
    together = robot.ensemble(states, duration=0.6, save_at=T, events=events)
    runs = [robot.simulate(states.at(i), duration=0.6, save_at=T, events=events) for i in range(5)]
    require_identical(together, runs)
    assert together.status.tolist()[1:] == [Status.FINISHED, *[Status.EVENT] * 3]


def test_forces_over_time_of_each_member(never_alone):
    """Inputs with kinks, at which steps end as well, and with one power only."""
    stop = lw.Stop(lower=0.0, stiffness=1e4, restitution=0.7)
    slide = lw.PrismaticJoint(connects=("ground", "block"), axis=(0, 0, 1), stop=stop)
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"block": lw.Body(mass=0.5, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))},
            joints={"z": slide},
            actuators=("z",),
        )
    )
    rng, states = np.random.default_rng(2), robot.state(np.linspace(0.02, 0.2, 6)[:, None])
    kinds = ["linear", "hold", "spline"] * 2
    signals = [lw.Sampled(T, rng.normal(size=(7, 1)), kind) for kind in kinds]
    for forces in (signals, rng.normal(size=(6, 1))):
        together = robot.ensemble(states, forces, duration=0.6, save_at=T)
        runs = [robot.simulate(states.at(i), forces[i], duration=0.6, save_at=T) for i in range(6)]
        require_identical(together, runs)
        assert len(together.events(0)) > 2


def test_an_undefined_event_ends_its_member_alone(never_alone):
    robot = lw.Robot(lw.robots.pendulum())
    name = robot.coordinates[0]
    events = [Event(lambda t, state: lw.math.sqrt(0.5 - state[name]), name="root")]
    states = robot.state(np.zeros((3, 1)), np.array([[0.1], [4.0], [0.2]]))
    options = {"duration": 0.6, "save_at": T, "events": events}
    together = robot.ensemble(states, **options)
    require_equal(together, [robot.simulate(states.at(i), **options) for i in range(3)])
    assert together.status[1] == Status.NON_FINITE
