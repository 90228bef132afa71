"""Ensembles against the same runs one by one."""

from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork import Sampled, Status
from linkwork.errors import LinkworkError
from linkwork.simulation import as_signal

from tests.robot.mixed_freedoms import turned
from tests.robot.one_by_one import random, require_equal

T = np.linspace(0.0, 0.4, 5)


@pytest.fixture(scope="module")
def prr3():
    return lw.Robot(lw.robots.prr3())


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", ["prr3", "spatial_slider_crank", "pendulum", "rpr3"])
def test_members_come_to_what_they_come_to_alone(name):
    robot = lw.Robot(getattr(lw.robots, name)())
    state = robot.home.with_rates(0.3 * random(robot.mobility))
    forces = 0.5 * random(9, len(robot.actuators))
    members = robot.ensemble(state, forces, duration=0.4, save_at=T)
    require_equal(members, [robot.simulate(state, u, duration=0.4, save_at=T) for u in forces])
    assert members.closure_error.max() < 1e-12
    np.testing.assert_allclose(
        robot.joint_rates(members.final),
        members.dataset.joint_rate.values[:, -1],
        rtol=1e-9,
        atol=1e-11,
    )


def test_states_on_both_sides_of_a_singular_surface(prr3):
    """The pivots of the chart have the other sign on the other side; both sides keep to vector
    lanes."""
    poses = np.array([[0.5, 0.28, angle] for angle in (1.2, 0.3, 1.1, 0.2, 1.3)])
    states = prr3.assemble(tool=poses)
    members = prr3.ensemble(states, [0.2, 0.1, 0.0], duration=0.4, save_at=T)
    require_equal(
        members,
        [
            prr3.simulate(states.at(i), [0.2, 0.1, 0.0], duration=0.4, save_at=T)
            for i in range(len(poses))
        ],
    )


@pytest.mark.parametrize(("name", "fastest", "push"), [("five_bar", 12.0, 0.0), ("prr3", 1.5, 1.0)])
def test_members_that_change_charts(name, fastest, push):
    robot = lw.Robot(getattr(lw.robots, name)())
    rates = np.linspace(0.1, fastest, 6)[:, None] * np.cos(np.arange(robot.mobility))
    states = robot.state(np.broadcast_to(robot.home.positions, (6, len(robot.coordinates))), rates)
    u = push * np.ones(len(robot.actuators))
    runs = [robot.simulate(states.at(i), u, duration=0.4, save_at=T) for i in range(6)]
    assert len({run.attrs["charts"].count("from") for run in runs}) > 1
    require_equal(robot.ensemble(states, u, duration=0.4, save_at=T), runs)


def test_each_member_has_its_signal(prr3):
    t = np.linspace(0, 0.4, 5)
    signals = [
        Sampled(t, 0.3 * random(5, 3, seed=i), kind)
        for i, kind in enumerate(("spline", "linear", "hold"))
    ]
    members = prr3.ensemble(prr3.home, signals, duration=0.4, save_at=T)
    require_equal(members, [prr3.simulate(prr3.home, u, duration=0.4, save_at=T) for u in signals])
    one = prr3.ensemble(
        prr3.assemble(tool=[[0.5, 0.28, 1.2], [0.5, 0.3, 1.2]]), signals[1], duration=0.4, save_at=T
    )
    again = prr3.simulate(prr3.assemble(tool=[0.5, 0.28, 1.2]), signals[1], duration=0.4, save_at=T)
    np.testing.assert_allclose(one.dataset.tool_pose[0], again["tool_pose"], rtol=1e-12)


def test_forces_by_name(prr3):
    pushes = np.array([0.1, 0.2, 0.3])
    by_name = prr3.ensemble(prr3.home, {"slide_1": pushes, "slide_3": 0.1}, duration=0.2)
    table = np.column_stack([pushes, 0 * pushes, 0 * pushes + 0.1])
    assert np.array_equal(by_name.final.q, prr3.ensemble(prr3.home, table, duration=0.2).final.q)


def test_each_member_has_its_parameters():
    robot = lw.Robot(lw.robots.prr3()).free("platform.mass", "link_1.mass")
    values = {"platform.mass": np.linspace(0.5, 3.0, 6), "link_1.mass": 0.7}
    members = robot.ensemble(robot.home, [0.3, 0.1, 0.0], values, duration=0.4, save_at=T)
    runs = [
        robot.with_parameters({"platform.mass": mass, "link_1.mass": 0.7}).simulate(
            robot.home, [0.3, 0.1, 0.0], duration=0.4, save_at=T
        )
        for mass in values["platform.mass"]
    ]
    require_equal(members, runs)
    assert np.array_equal(members.dataset["platform.mass"], values["platform.mass"])
    assert len({run.attrs["final_q"].tobytes() for run in runs}) == 6


def test_members_with_lengths_close_their_loops_as_far_as_alone():
    """To the last bit, where redundant rows have every step's gap measured: of ensembles, and of
    steppers."""
    robot = lw.Robot(turned(lw.robots.four_bar(), (0.3, 0.1, 0.0)))
    robot, N = robot.free(path := "rocker_pin.frames.0.position.x"), 4
    assert robot.redundant
    lengths = robot.parameters[path] * np.linspace(1.1, 1.25, N)
    each = [robot.with_parameters({path: length}) for length in lengths]
    assert all(other.size == robot.size for other in each)
    starts = [other.home.with_rates([-20.0]) for other in each]
    parts = [np.array([getattr(x, k) for x in starts]) for k in ("positions", "rates", "q")]
    stack = lw.State.known(*parts, starts[0].coordinates, starts[0].independent)
    members = robot.ensemble(stack, None, {path: lengths}, duration=0.5)
    many = robot.stepper(stack, 1e-3, parameters={path: lengths}, threads=1)
    many.step(steps=200)
    for i, (other, start) in enumerate(zip(each, starts, strict=True)):
        np.testing.assert_array_equal(
            members.final.q[i], other.simulate(start, duration=0.5).attrs["final_q"]
        )
        one = other.stepper(start, 1e-3)
        one.step(steps=200)
        np.testing.assert_array_equal(many.y[i], one.y)


def test_a_traced_controller_with_gains_of_each_member(prr3):
    def law(t, state):
        kp = state.parameter("kp", 40.0)
        return {
            name: -kp * (state[name] - 0.2 - 0.05 * lw.math.sin(3 * t)) for name in prr3.actuators
        }

    gains = np.array([10.0, 40.0, 90.0])
    members = prr3.ensemble(prr3.home, law, {"kp": gains}, duration=0.4, save_at=T)
    runs = [
        prr3.simulate(prr3.home, law, duration=0.4, save_at=T, parameters={"kp": gain})
        for gain in gains
    ]
    require_equal(members, runs)


@pytest.mark.long
def test_a_member_is_run_by_itself_with_its_sensitivities():
    robot = lw.Robot("five_bar").free("gravity.y")
    home, rates = np.tile(robot.home.positions, (3, 1)), np.linspace(-0.3, 0.3, 6).reshape(3, 2)
    states = robot.state(home, rates)
    forces, g = 0.1 * np.arange(6.0).reshape(3, 2), np.array([-9.81, -1.6, 0.0])
    ensemble = robot.ensemble(
        states, forces, duration=0.3, save_at=[0.1, 0.3], parameters={"gravity.y": g}
    )
    run = ensemble.run(-2)
    alone = robot.with_parameters({"gravity.y": -1.6}).simulate(
        states.at(1), forces[1], duration=0.3, save_at=[0.1, 0.3]
    )
    assert np.array_equal(run.final.q, ensemble.final.at(1).q)
    for name in ("joint_position", "actuator_force"):
        assert np.array_equal(run.variables[name].values, alone.variables[name].values)
    found, expected = (each.sensitivity("joint_rate").joint_rate for each in (run, alone))
    assert found.shape[0] == 2 and np.array_equal(found, expected)
    weights = np.ones(found.shape[:-1])
    assert run.gradient({"joint_rate": weights}, to="gravity.y")["gravity.y"] == pytest.approx(
        float(found.sel(number="gravity.y").sum()), rel=1e-10
    )
    every = robot.ensemble(states, forces, duration=0.3).run(0)
    assert len(every.time) == every.statistics.steps + 1
    with pytest.raises(LinkworkError, match="3"):
        ensemble.run(3)


def test_members_that_fail_are_named_and_the_others_go_on(prr3):
    forces = 0.3 * random(7, 3)
    forces[4, 1] = np.nan
    members = prr3.ensemble(prr3.home, forces, duration=0.4, save_at=T)
    assert members.failed.tolist() == [4]
    assert not members.success
    assert members.status[4] == Status.NON_FINITE
    assert "t = 0 s: the force on slide_2 is infinite or undefined" in members.message(4)
    assert (
        members.dataset.status.values.tolist()
        == ["FINISHED"] * 4 + ["NON_FINITE"] + ["FINISHED"] * 2
    )
    others = np.arange(7) != 4
    require_equal(
        prr3.ensemble(prr3.home, forces[others], duration=0.4, save_at=T),
        [prr3.simulate(prr3.home, u, duration=0.4, save_at=T) for u in forces[others]],
    )


def test_members_with_numbers_that_no_robot_has_are_refused():
    """As single runs refuse them: a mass below zero, wherever it stands, and loops that a shifted
    pivot opens."""
    robot = lw.Robot(lw.robots.prr3()).free(
        "platform.mass", "link_1.mass", "pivot_1.frames.0.position.y"
    )
    for values, member in {
        (1.0, -0.1): 1,
        (-0.1, 1.0): 0,
        (1.0, 1.0, 1.0, 1.0, -0.1, 1.0): 4,
    }.items():
        with pytest.raises(
            LinkworkError, match=rf"member {member}: bodies.platform.mass: -0.1 is below 0"
        ):
            robot.ensemble(
                robot.home, None, {"platform.mass": values, "link_1.mass": 0.7}, duration=0.1
            )
    shifted = {"pivot_1.frames.0.position.y": [0.0, 0.01]}
    with pytest.raises(LinkworkError, match=r"member 1: .*its loops are open by 0.00732 here"):
        robot.ensemble(robot.home, None, shifted, duration=0.1)
    other = robot.with_parameters({"pivot_1.frames.0.position.y": 0.01})
    parts = {
        name: np.stack([getattr(of.home, name) for of in (robot, other)])
        for name in ("positions", "rates", "q")
    }
    states = replace(robot.home, **parts)
    members = robot.ensemble(states, [0.1, 0.0, 0.0], shifted, duration=0.1)
    alone = other.simulate(other.home, [0.1, 0.0, 0.0], duration=0.1)
    assert np.allclose(members.final.q[1], alone.attrs["final_q"], 0, 1e-9)


def test_a_controller_that_is_undefined_is_named(prr3):
    law = lambda t, state: [0.0, 0.0, lw.math.log(0.2 - t)]  # noqa: E731
    members = prr3.ensemble(prr3.home, law, duration=0.4)
    run = prr3.simulate(prr3.home, law, duration=0.4)
    for message in (members.message(0), run.message):
        assert "t = 0.2 s: the controller's force on slide_3 is infinite or undefined" in message


def test_no_members_and_one(prr3):
    none = prr3.ensemble(prr3.home, np.empty((0, 3)), duration=0.1, save_at=[0.1])
    assert len(none) == 0
    assert none.success
    assert none.dataset.sizes["member"] == 0
    one = prr3.ensemble(prr3.home, duration=0.1)
    assert len(one) == 1
    assert one.dataset.sizes["time"] == 0


def test_threads_make_no_difference_to_a_bit(prr3):
    forces = 0.3 * random(40, 3)
    one, two = (
        prr3.ensemble(prr3.home, forces, duration=0.2, threads=threads) for threads in (1, 2)
    )
    assert np.array_equal(one.final.q, two.final.q)
    assert np.array_equal(one.final.rates, two.final.rates)


def test_an_interruption_keeps_what_is_done(prr3):
    def interrupt(done, members):
        if done:
            raise KeyboardInterrupt

    members = prr3.ensemble(
        prr3.home, 0.1 * random(4000, 3), duration=1.0, threads=1, progress=interrupt
    )
    done = members.status == Status.FINISHED
    assert 0 < done.sum() < len(members)
    assert set(members.status[~done].tolist()) == {Status.CANCELLED}
    assert "cancelled" in members.message(int(members.failed[-1]))
    assert np.isfinite(members.final.q).all()


@pytest.mark.parametrize(
    "method", [{}, {"method": "rk4", "step": 1e-2}], ids=["in lanes", "one by one"]
)
def test_an_interruption_that_comes_when_all_is_done_is_not_lost(prr3, method):
    def interrupt(done, members):
        if done == members:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prr3.ensemble(prr3.home, np.zeros((4, 3)), duration=0.1, progress=interrupt, **method)


def test_members_that_an_interruption_leaves_waiting_are_closed(prr3):
    glances = []

    def interrupt(done, members):
        glances.append(done)
        if len(glances) == 8:
            raise KeyboardInterrupt

    start = replace(prr3.home, q=prr3.home.q + 1e-8 * np.eye(prr3.home.q.size)[0])
    options = {"duration": 10.0, "max_step": 1e-3, "threads": 1, "progress": interrupt}
    members = prr3.ensemble(start, np.zeros((4000, 3)), **options)
    waiting = (members.end_time == 0) & np.isfinite(members.pivot)
    assert waiting.any()
    assert members.closure_error[waiting].max() < 1e-14


def test_forces_that_jump_under_the_method_for_smooth_ones(prr3):
    """No stage reaches beyond the step, where the force is another one; no member depends on its
    neighbours."""
    t, rates = np.linspace(0.0, 0.3, 6), 0.5 * random(6, 3)
    states = prr3.state(np.broadcast_to(prr3.home.positions, (6, len(prr3.coordinates))), rates)
    signals = [
        Sampled(t, 0.3 * random(6, 3, seed=i), kind)
        for i, kind in enumerate(2 * ("spline", "linear", "hold"))
    ]
    options = {
        "duration": 0.3,
        "save_at": np.linspace(0.0, 0.3, 7),
        "method": "sharp_smart",
        "rtol": 1e-6,
    }
    alone = [prr3.simulate(states.at(i), signal, **options) for i, signal in enumerate(signals)]
    assert prr3.simulate(prr3.home, signals[-1], **options).rejected == 0
    for chosen in ([0, 1, 2, 3, 4, 5], [3, 4, 5], [2], [5, 0]):
        group = prr3.state(states.positions[chosen], rates[chosen])
        members = prr3.ensemble(group, [signals[i] for i in chosen], threads=1, **options)
        require_equal(members, [alone[i] for i in chosen])
        assert np.array_equal(
            members.final.q, np.array([alone[i].attrs["final_q"] for i in chosen])
        )


def test_progress_on_the_terminal(prr3, capfd):
    prr3.ensemble(prr3.home, 0.1 * random(20, 3), duration=0.1, progress=True)
    assert "20/20" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("forces", "options", "sentence"),
    [
        (np.zeros((4, 2)), {}, "give 3 numbers in the last dimension"),
        (np.zeros((4, 3)), {"states": 3}, "4 of forces"),
        ([0.0, 0.0], {}, "give 3 numbers"),
        (None, {"parameters": {"kp": 1.0}}, "no parameter 'kp'"),
        (None, {"duration": 0.0}, "duration is 0.0; give a positive number"),
        (None, {"on_singular": "jump"}, "on_singular is 'jump'"),
        (None, {"save_at": [0.3, 0.1]}, "must increase"),
        ([as_signal([1.0])] * 2, {}, "have 1 columns"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(prr3, forces, options, sentence):
    given = {"duration": 0.1} | options
    count = given.pop("states", None)
    states = (
        prr3.home if count is None else prr3.assemble(tool=np.tile([0.5, 0.28, 1.2], (count, 1)))
    )
    with pytest.raises(LinkworkError, match=sentence):
        prr3.ensemble(states, forces, **given)
