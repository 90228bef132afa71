"""Events along a run, and runs that go on from where another ended."""

from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, DCMotor, Event, Sampler, limit_events, singular_events

from tests.control.plants import cart, circle_motion, pendulum


@pytest.fixture(scope="module")
def plant():
    return cart(mass=2.0)


def test_user_events_are_found_at_their_times(plant):
    """x = 0.5 t^2 / 2: x passes 0.04 at t = 0.4; sin(10 t) falls through zero at pi / 10 and 3 pi /
    10."""
    passes = Event(lambda t, state: state["slide"] - 0.04, name="passes")
    falls = Event(lambda t, state: lw.math.sin(10 * t), direction=-1, name="falls")
    run = plant.simulate(plant.home, [1.0], duration=1.0, events=[passes, falls], max_step=0.05)
    assert run.success
    assert list(run.coords["event"].values) == ["falls", "passes", "falls"]
    assert np.allclose(run.coords["event_time"].values, [np.pi / 10, 0.4, 3 * np.pi / 10], 0, 1e-7)


def test_a_terminal_event_ends_the_run_there(plant):
    stop = Event(lambda t, state: state["slide"] - 0.04, terminal=True, name="stop")
    run = plant.simulate(plant.home, [1.0], duration=1.0, events=[stop])
    assert run.status is lw.Status.EVENT and "'stop'" in run.message
    assert np.isclose(run.attrs["final_time"], 0.4, 1e-7)


def test_a_plain_function_is_an_event(plant):
    run = plant.simulate(
        plant.home, [1.0], duration=1.0, events=[lambda t, state: state.rate("slide") - 0.25]
    )
    assert np.allclose(run.coords["event_time"].values, [0.5], 0, 1e-8)


def test_limits_as_events():
    slide = lw.PrismaticJoint(
        connects=("ground", "cart"), axis=(1, 0, 0), limits=lw.Limits(lower=-0.5, upper=0.09)
    )
    body = lw.Body(mass=2.0, inertia=lw.Inertia(zz=1.0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"cart": body}, joints={"slide": slide}, actuators=("slide",))
    )
    assert [event.name for event in limit_events(robot)] == [
        "slide: lower limit",
        "slide: upper limit",
    ]
    run = robot.simulate(robot.home, [1.0], duration=2.0, events="limits")
    assert run.status is lw.Status.EVENT and "slide: upper limit" in run.message
    assert np.isclose(run.attrs["final_time"], 0.6, 1e-7)
    back = robot.simulate(robot.home, [-1.0], duration=1.3, events="limits")
    assert back.success and not len(back.coords["event_time"].values)


def test_limits_of_a_free_turn_as_events():
    """A ball turning at 0.5 rad/s about x reaches 0.4 rad after 0.8 s."""
    joint = lw.SphericalJoint(connects=("ground", "top"), limits={"turn": lw.Limits(upper=0.4)})
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    robot = lw.Robot(lw.Mechanism(gravity=(0, 0, 0), bodies={"top": body}, joints={"ball": joint}))
    start = robot.home.with_rates({"ball.wx": 0.5, "ball.wy": 0.0, "ball.wz": 0.0})
    run = robot.simulate(start, duration=2.0, events="limits")
    assert run.status is lw.Status.EVENT and np.isclose(run.attrs["final_time"], 0.8, 1e-7)


def test_actuator_singular_poses_as_events():
    """A slider-crank driven at its slider is singular where crank and rod are in line: crank angles
    k pi."""
    mechanism = lw.robots.slider_crank()
    crank, slide = (
        mechanism.actuators[0],
        next(name for name, j in mechanism.joints.items() if j.type == "prismatic"),
    )
    robot = lw.Robot(
        mechanism.model_copy(update={"actuators": (slide,), "gravity": (0.0, 0.0, 0.0)})
    )
    start = robot.in_chart(robot.home, [crank]).with_rates([6.0])
    run = robot.simulate(start, duration=2.0, events=singular_events(robot, terminal=False))
    times = run.coords["event_time"].values
    found = (
        robot.simulate(start, duration=2.0, save_at=times)["joint_position"]
        .sel(coordinate=crank)
        .values
    )
    assert len(times) == 4 and np.allclose(found / np.pi, np.round(found / np.pi), 0, 1e-7)
    ended = robot.simulate(start, duration=2.0, events="singular")
    assert ended.status is lw.Status.EVENT and np.isclose(ended.attrs["final_time"], times[0], 1e-7)


def test_robots_without_singular_poses_of_their_actuators_are_refused():
    robot = lw.Robot(lw.robots.double_pendulum().model_copy(update={"actuators": ("hinge_1",)}))
    with pytest.raises(
        lw.LinkworkError, match="1 actuator and a mobility of 2 have no actuator-singular poses"
    ):
        robot.simulate(robot.home, duration=1.0, events="singular")


@pytest.mark.parametrize(
    ("events", "sentence"),
    [
        ("limit", "there are no events 'limit'; give limits, singular"),
        (
            [Event(lambda t, state: [state["slide"], 1.0], name="two")],
            "the event 'two' returns 2 values",
        ),
        (
            [Event(lambda t, state: 1.0 if state["slide"] else 2.0, name="if")],
            (
                r"the event 'if' cannot be traced with symbols \(it branches on .*as a function "
                r"of its arguments alone$"
            ),
        ),
        (
            [Event(lambda t, state: None, name="none")],
            "the event 'none' returns None; give 1 number",
        ),
        (5, "events are 5; give a list"),
        ("limits", "the joints of this robot have no limits to watch for"),
    ],
)
def test_refusals(plant, events, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, [1.0], duration=1.0, events=events)


def test_an_event_that_is_zero_at_the_start_happens_when_it_is_zero_again():
    """x = t - t^2 / 2 under a constant force: back at zero after 2 s."""
    plant = cart(mass=2.0)
    run = plant.simulate(
        plant.home.with_rates([1.0]), [-2.0], duration=3.0, events=lambda t, state: state["slide"]
    )
    assert np.allclose(run.coords["event_time"].values, [2.0], 1e-9)


def test_what_is_no_event_is_refused():
    with pytest.raises(lw.LinkworkError, match=r"watches a function of \(t, state\), not 3"):
        Event(3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(lw.LinkworkError, match="the direction of the event 'event' is 2"):
        Event(lambda t, state: 0.0, direction=2)  # pyright: ignore[reportArgumentType]


# Resuming


def test_a_run_stopped_and_resumed_is_the_uninterrupted_one():
    """Stopped by its number of steps, saved, loaded and resumed: bit for bit, drive's state and
    time included."""
    robot = lw.Robot(lw.robots.prr3())
    motion = circle_motion(robot)
    law, drives = PD(motion, 5000.0, 200.0), {"slide_2": DCMotor(1.0, 2e-3, 0.5, 20.0)}
    start = motion.state.at(0)
    whole = robot.simulate(start, law, duration=1.0, drives=drives, max_steps=400)
    first = robot.simulate(start, law, duration=1.0, drives=drives, max_steps=150)
    assert first.status is lw.Status.TOO_MANY_STEPS
    rest = robot.resume(
        first, law, duration=1.0 - first.attrs["final_time"], drives=drives, max_steps=250
    )
    assert rest.attrs["final_time"] == whole.attrs["final_time"]
    for name in ("final_q", "final_v"):
        assert np.array_equal(rest.attrs[name], whole.attrs[name])


def test_a_saved_run_is_resumed(tmp_path, plant):
    law = PD({"slide": 0.3}, 18.0, 4.0)
    drives = {"slide": DCMotor(2.0, 0.05, 0.3, 4.0)}
    whole = plant.simulate(plant.home, law, duration=1.0, drives=drives, save_at=[1.0])
    first = plant.simulate(plant.home, law, duration=0.37, drives=drives)
    loaded = lw.Run.load(first.save(tmp_path / "first.nc"))
    rest = plant.resume(loaded, law, duration=0.63, drives=drives, save_at=[1.0])
    for name in ("joint_position", "joint_rate", "drive_state"):
        assert np.allclose(rest[name].values, whole[name].values, 0, 1e-7)
    assert rest.coords["time"].values[-1] == 1.0


@pytest.mark.parametrize("compiled", [False, True])
def test_a_sampled_run_goes_on_between_its_samples(plant, compiled):
    sampler = Sampler(PD({"slide": 0.3}, 18.0, 4.0), 10.0, delay=0.1, compiled=compiled)
    whole = plant.simulate(plant.home, sampler, duration=1.0, save_at=[1.0])
    first = plant.simulate(plant.home, sampler, duration=0.55)
    rest = plant.resume(first, sampler, duration=0.45, save_at=[1.0])
    assert np.allclose(rest["joint_position"], whole["joint_position"], 0, 1e-9)


def test_a_run_resumes_in_another_chart():
    """After changes of chart the run's last rates are those of another choice than the robot's
    own."""
    robot = lw.Robot(lw.robots.four_bar())
    start = robot.home.with_rates(3.0 + 0 * robot.home.rates)
    whole = robot.simulate(start, duration=2.0, save_at=[2.0])
    first = robot.simulate(start, duration=1.3)
    rest = robot.resume(first, duration=0.7, save_at=[2.0])
    assert np.allclose(rest["joint_position"], whole["joint_position"], 0, 1e-6)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"start": 2.0}, "there is no option of a run 'start'; there are duration, drives"),
        ({"foo": 2.0}, "there is no option of a run 'foo'"),
        ({"parameters": [1.0]}, r"parameters are \[1.0\]; give them by name"),
    ],
)
def test_options_that_no_run_has(plant, options, sentence):
    run = plant.simulate(plant.home, [1.0], duration=0.1)
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.resume(run, [1.0], duration=0.1, **options)


def test_runs_that_cannot_be_resumed(plant):
    run = plant.simulate(plant.home, [1.0], duration=0.1)
    other = lw.Robot(lw.robots.prr3())
    with pytest.raises(lw.LinkworkError, match="belongs to another robot"):
        other.resume(run, duration=1.0)
    with pytest.raises(
        lw.LinkworkError, match="0 extra states, but these drives and controllers have 1"
    ):
        plant.resume(run, [1.0], duration=1.0, drives={"slide": DCMotor(1, 1, 1)})
    paceless = replace(
        run, attrs={name: fact for name, fact in run.attrs.items() if name != "final_pace"}
    )
    with pytest.raises(lw.LinkworkError, match="cannot be resumed: it does not hold 'final_pace'"):
        plant.resume(paceless, duration=1.0)


# Methods


def test_methods_agree():
    robot = pendulum()
    law = PD({"hinge_1": 0.5}, 40.0, 8.0)
    ends = [
        robot.simulate(
            robot.home, law, duration=1.0, save_at=[1.0], method=method, step=step, rtol=1e-10
        )["joint_position"].values
        for method, step in (
            ("dormand_prince", None),
            ("dop853", None),
            ("rodas", None),
            ("rk4", 1e-3),
        )
    ]
    assert np.allclose(ends, ends[0], 0, 1e-8)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"method": "euler"}, "there is no method 'euler'; there are sharp_smart"),
        ({"method": "rk4"}, r"rk4 needs a step \[s\]"),
        ({"step": 1e-3}, "a step of 0.001 s needs a method that keeps to it"),
        ({"method": "rk4", "step": -1.0}, "step is -1.0; give a positive number"),
    ],
)
def test_methods_that_do_not_fit(plant, options, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, duration=1.0, **options)


def test_the_determinant_of_the_actuation_is_a_number_of_the_observation():
    robot = lw.Robot(lw.robots.prr3())
    state = robot.in_chart(
        robot.home, [name for name in robot.equations.tree.rates if name.startswith("p")][:3]
    )
    assert np.isclose(
        robot.observe(state).actuation_determinant, np.linalg.det(robot.actuation(state)), 1e-12
    )


def test_events_of_a_robot_whose_free_turns_are_driven():
    """A ball that 0.1 N m turn about x, 0.1 kg m^2: its rate passes 0.2 rad/s after 0.2 s; that
    rate has no coordinate."""
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
    ball = lw.SphericalJoint(connects=("ground", "top"))
    actuators = ("ball.wx", "ball.wy", "ball.wz")
    mechanism = lw.Mechanism(
        bodies={"top": body}, joints={"ball": ball}, actuators=actuators, gravity=(0, 0, 0)
    )
    robot = lw.Robot(mechanism)
    passes = Event(lambda t, state: state.rate("ball.wx") - 0.2, name="passes")
    run = robot.simulate(robot.home, [0.1, 0, 0], duration=0.5, events=[passes])
    assert np.allclose(run.coords["event_time"].values, [0.2], 0, 1e-8)
