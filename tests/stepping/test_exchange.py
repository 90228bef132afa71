"""Between the steps of many robots: readings, members put where others are, numbers written."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import control
from linkwork.robots import pendulum, prr3

from tests.stepping.test_steppers import DT, N, require_alike, spread


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot(prr3())


READINGS = (
    lambda t, state: state.tool_pose[0],
    lambda t, state: t + 2 * state.rate("wrist_2"),
    lambda t, state: state["pivot_1"] * state.parameter("gain", 1.0),
)


def test_readings_say_what_functions_of_the_state_do(robot):
    """In each chart that members came to, at the time of each."""
    states, u = spread(robot)
    many = robot.stepper(states, DT, readings=READINGS, threads=1)
    for _ in range(200):
        many.step(u)
    assert len({many.independent(member) for member in range(N)}) > 1
    many.parameters["gain"][:] = np.arange(N)
    found = many.read()
    for member in range(N):
        seen = robot.observe(many.states.at(member))
        told = [seen.tool_pose[0], 0.2 + 2 * seen.rate("wrist_2"), member * seen["pivot_1"]]
        np.testing.assert_allclose(found[member], told, 1e-12, 1e-12)
    some = np.full_like(found, 7.0)
    many.read(some, [3, 20])
    np.testing.assert_array_equal(some[[3, 20]], found[[3, 20]])
    assert (some[[0, 4]] == 7).all()


def test_readings_of_coordinates_tell_whole_turns():
    robot = lw.Robot(pendulum())
    states = robot.state(np.zeros((N, 1))).with_rates(np.linspace(-200, 200, N)[:, None])
    (name,) = robot.coordinates
    many = robot.stepper(states, DT, readings=[lambda t, state: state[name]], threads=1)
    many.step(steps=300)
    assert np.abs(many.q).max() > 50
    np.testing.assert_array_equal(many.read(), many.q)


def test_members_are_put_where_others_are_and_go_on_as_these(robot):
    states, u = spread(robot)
    others = robot.stepper(states, DT, threads=1)
    others.step(u, 200)
    many = robot.stepper(robot.state(np.tile(robot.home.positions, (50, 1))), DT, threads=1)
    kept, seen = many.y[5].copy(), many.states
    known = seen.positions.copy()
    many.put(others, [0, 3, 49], [20, 20, 8])
    np.testing.assert_array_equal(seen.positions, known)
    np.testing.assert_allclose(many.states.positions[3], others.states.positions[20], atol=1e-12)
    many.reset([7])
    np.testing.assert_array_equal(many.y[5], kept)
    many.step(steps=100)
    others.step(steps=100)
    for mine, other in ((0, 20), (3, 20), (49, 8)):
        require_alike(many, others.alone(other), mine)


def test_a_member_that_ended_goes_on_where_it_is_put(robot):
    states, u = spread(robot)
    many = robot.stepper(states, DT, threads=1)
    before = robot.stepper(states, DT, threads=1)
    u[4] = np.nan
    many.step(u)
    assert many.status[4] == lw.Status.NON_FINITE
    many.put(before, 4, 4)
    u[4] = 0.1
    many.step(u)
    before.step(u)
    assert not many.status.any()
    np.testing.assert_array_equal(many.y[4], before.y[4])


def test_written_parameters_act(robot):
    free = robot.free("platform.mass", "slide_1.frames.1.position.0")
    states, _ = spread(free)
    law = control_law()
    given = {name: np.full(N, value) for name, value in free.parameters.items()}
    many = free.stepper(states, DT, law, parameters=given, threads=1)
    assert not many.parameters["slide_1.frames.1.position.0"].flags.writeable
    many.parameters["platform.mass"][:] = np.linspace(1, 3, N)
    many.parameters["push"][:] = np.linspace(-1, 1, N)
    many.step(steps=50)
    for member in (0, 18, N - 1):
        own = free.with_parameters({"platform.mass": 1 + 2 * member / (N - 1)})
        push = {"push": -1 + 2 * member / (N - 1)}
        start = own.home.with_rates(states.rates[member])
        run = own.simulate(start, law, duration=0.05, method="rk4", step=DT, parameters=push)
        np.testing.assert_allclose(many.v[member], run.final.rates, 1e-12, 1e-12)


def control_law():
    return lambda t, state: [state.parameter("push", 0.0), 0.0, 0.0]


def test_what_does_not_fit_is_refused(robot):
    states, _ = spread(robot)
    many = robot.stepper(states, DT, threads=1)
    lag = robot.stepper(states, DT, drives={"slide_1": control.Lag(0.1)}, threads=1)
    with pytest.raises(lw.LinkworkError, match="of other forces, drives"):
        many.put(lag)
    with pytest.raises(lw.LinkworkError, match="give steppers of this robot"):
        many.put(states)  # pyright: ignore[reportArgumentType]
    with pytest.raises(lw.LinkworkError, match="2 members cannot be put where 3 are"):
        many.put(many, [1, 2], [1, 2, 3])
    with pytest.raises(lw.LinkworkError, match="readings are a function; give a list"):
        robot.stepper(states, DT, readings=lambda t, state: t)
    with pytest.raises(lw.LinkworkError, match="give an array of floats of shape"):
        many.read(np.zeros((N, 3)))
