"""What is traced once, and what is traced in every run: nothing that changed is ever taken from
before."""

from dataclasses import dataclass

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, Drive, Event, Sampler, Saturated, Wrench
from linkwork.control import kept_traces as settled

from tests.control.plants import cart

DURATION = 0.5


@pytest.fixture(scope="module")
def robot():
    return cart(mass=2.0)


@pytest.fixture
def traces(monkeypatch):
    """Collect what is traced in a test."""
    settled._kept.cache_clear()
    made, act = [], settled.act
    monkeypatch.setattr(settled, "act", lambda *arguments: made.append(act(*arguments)) or made[-1])
    return made


def reached(robot, *forces, **options):
    """Return where the cart is at the end: x = u T^2 / (2 m) under a constant force."""
    run = robot.simulate(robot.home, *forces, duration=DURATION, **options)
    assert run.success, run.message
    return float(run.attrs["final_q"][0])


def pushed(force):
    return force * DURATION**2 / (2 * 2.0)


def test_a_function_is_traced_once_for_all_that_it_reads(robot, traces):
    def led(force):
        return lambda t, state: [force * state.parameter("factor", 1.0)]

    assert np.isclose(reached(robot, led(1.0)), pushed(1.0), 1e-9)
    assert np.isclose(reached(robot, led(1.0), parameters={"factor": 2.0}), pushed(2.0), 1e-9)
    assert len(traces) == 1
    assert np.isclose(reached(robot, led(3.0)), pushed(3.0), 1e-9)
    assert len(traces) == 2


def test_a_loss_is_traced_once(robot, traces):
    for bound in (0.0, 0.0, 1.0):
        found = robot.gradient(
            lambda t, state, bound=bound: (state["slide"] - bound) ** 2,
            robot.home, [1.0], duration=DURATION,
        )  # fmt: skip
        assert found.value == pytest.approx((DURATION**2 / 4 - bound) ** 2, rel=1e-9)
    assert len(traces) == 2


class Law:
    """A law with a gain of its own, which changes unseen."""

    force = 1.0

    def act(self, t, state):
        return [self.force]


def test_what_changes_unseen_is_traced_in_every_run(robot, traces):
    law = Law()
    for law.force in (1.0, 3.0):
        assert np.isclose(reached(robot, law.act), pushed(law.force), 1e-9)
    assert len(traces) == 2


def test_what_a_function_captured_may_change(robot, traces):
    captured = [1.0]

    def law(t, state):
        return captured

    assert np.isclose(reached(robot, law), pushed(1.0), 1e-9)
    captured[0] = 3.0
    assert np.isclose(reached(robot, law), pushed(3.0), 1e-9)
    sampler = Sampler(law, rate=100, compiled=True)
    assert np.isclose(reached(robot, sampler), pushed(3.0), 1e-9)
    captured[0] = -2.0
    assert np.isclose(reached(robot, sampler), pushed(-2.0), 1e-9)
    wrench = Wrench("cart", force=lambda t, state: [captured[0], 0, 0])
    assert np.isclose(reached(robot, wrenches=[wrench]), pushed(-2.0), 1e-9)
    captured[0] = 1.0
    assert np.isclose(reached(robot, wrenches=[wrench]), pushed(1.0), 1e-9)
    assert len(traces) == 6


def test_an_event_that_changed_is_another(robot, traces):
    bound = [0.05]
    passes = Event(lambda t, state: state["slide"] - bound[0], terminal=True)
    for x in (0.05, 0.02):
        bound[0] = x
        run = robot.simulate(robot.home, [4.0], duration=1.0, events=[passes])
        assert np.isclose(run.attrs["final_q"][0], x, 1e-8)
    assert len(traces) == 2


def test_controllers_are_traced_once_until_their_numbers_change(robot, traces):
    gains = {"slide": 30.0}
    pd = PD({"slide": 0.2}, gains, 2.0)
    first = reached(robot, pd)
    assert reached(robot, pd) == first and len(traces) == 1
    gains["slide"] = 60.0
    stiffer = reached(robot, pd)
    assert len(traces) == 2
    assert stiffer == reached(robot, PD({"slide": 0.2}, 60.0, 2.0)) != first
    assert reached(robot, PD({"slide": 0.1}, gains, 2.0)) == pytest.approx(stiffer / 2, rel=1e-6)


def test_a_goal_by_name_may_change(robot, traces):
    goal = {"slide": 0.2}
    pd = PD(goal, 30.0, 2.0)
    first = reached(robot, pd)
    goal["slide"] = 0.4
    assert reached(robot, pd) == pytest.approx(2 * first, rel=1e-6)
    goal["slide"] = 0.2
    assert reached(robot, pd) == first


class Goal:
    """A goal of the user's own, which changes unseen."""

    x = 0.2

    def __getitem__(self, name):
        return self.x


def test_a_goal_of_the_users_own_is_asked_in_every_run(robot, traces):
    goal = Goal()
    pd = PD(goal, 30.0, 2.0)
    first = reached(robot, pd)
    goal.x = 0.4
    assert reached(robot, pd) == pytest.approx(2 * first, rel=1e-6)
    assert len(traces) == 2


def test_parameters_are_no_part_of_a_trace(robot, traces):
    pd = PD({"slide": 0.2}, 30.0, 2.0)
    found = [reached(robot, pd, parameters={"kp": kp}) for kp in (30.0, 60.0)]
    assert found == [reached(robot, PD({"slide": 0.2}, kp, 2.0)) for kp in (30.0, 60.0)]
    assert found[0] != found[1] and len(traces) == 3


def test_forces_over_time_are_inputs_of_one_trace(robot, traces):
    for force in (1.0, -3.0):
        assert np.isclose(reached(robot, [force], method="rodas"), pushed(force), 1e-7)
    ramp = lw.Sampled(np.array([0.0, DURATION]), np.array([[0.0], [6.0]]), "linear")
    assert np.isclose(
        reached(robot, ramp, method="rodas"), 6.0 / DURATION * DURATION**3 / (6 * 2.0), 1e-7
    )
    assert len(traces) == 1


def test_a_signal_is_a_wrench_and_a_command_at_once(robot, traces):
    signal = lw.Sampled(np.array([0.0, DURATION]), np.array([[0.0] * 3, [6.0, 0.0, 0.0]]), "linear")
    wrench = Wrench("cart", force=signal)
    ramp = 6.0 / DURATION * DURATION**3 / (6 * 2.0)
    for force in (1.0, 2.0):
        assert np.isclose(reached(robot, [force], wrenches=[wrench]), pushed(force) + ramp, 1e-9)
    assert len(traces) == 1


def test_wrenches_are_told_apart_by_their_numbers(robot, traces):
    force = np.array([1.0, 0.0, 0.0])
    assert np.isclose(reached(robot, wrenches=[Wrench("cart", force=force)]), pushed(1.0), 1e-9)
    assert np.isclose(
        reached(robot, wrenches=[Wrench("cart", force=[1.0, 0.0, 0.0])]), pushed(1.0), 1e-9
    )
    wrench = Wrench("cart", force=force)
    force[0] = 5.0
    assert np.isclose(
        reached(robot, wrenches=[wrench]), pushed(1.0), 1e-9
    )  # it keeps what it was made with
    assert np.isclose(reached(robot, wrenches=[Wrench("cart", force=force)]), pushed(5.0), 1e-9)


def test_drives_of_the_package_are_data_and_others_are_not(robot, traces):
    @dataclass(frozen=True)
    class Halved(Drive):
        factor = 0.5

        def equations(self, command, x, w, z):
            return self.factor * command, ()

    for _ in range(2):
        assert np.isclose(
            reached(robot, [8.0], drives={"slide": Saturated(2.0)}), pushed(2.0), 1e-9
        )
    assert len(traces) == 1
    assert np.isclose(reached(robot, [8.0], drives={"slide": Saturated(3.0)}), pushed(3.0), 1e-9)
    assert np.isclose(reached(robot, [8.0], drives={"slide": Halved()}), pushed(4.0), 1e-9)
    Halved.factor = 0.25
    assert np.isclose(reached(robot, [8.0], drives={"slide": Halved()}), pushed(2.0), 1e-9)


def test_sampled_functions_are_called_and_not_traced(robot, traces):
    calls = []
    first, second = (
        Sampler(lambda t, state, force=f: calls.append(force) or [force], rate=100)
        for f in (1.0, 2.0)
    )
    for sampler, force in ((first, 1.0), (second, 2.0), (first, 1.0)):
        assert np.isclose(reached(robot, sampler), pushed(force), 1e-9)
        assert set(calls) == {force}
        calls.clear()
    assert len(traces) == 2


def test_limits_are_told_apart_by_value(traces):
    ends = {}
    for upper in (0.05, 0.08, 0.05):
        plain = cart(mass=2.0).mechanism
        slide = plain.joints["slide"].model_copy(update={"limits": lw.Limits(upper=upper)})
        limited = lw.Robot(plain.model_copy(update={"joints": {"slide": slide}}))
        run = limited.simulate(limited.home, [4.0], duration=1.0, events="limits")
        ends[upper] = run.attrs["final_q"][0]
        assert "slide: upper limit" in run.message
    assert all(np.isclose(x, upper, 1e-8) for upper, x in ends.items()) and len(traces) == 2
