"""Between the steps of many robots: readings, members put where others are, numbers written."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import control, math
from linkwork.robots import pendulum, prr3
from linkwork.stepping.native_readings import ReadingTables

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
    turned = np.zeros((len(READINGS), N)).T
    assert many.read(turned) is turned
    np.testing.assert_array_equal(turned, found)


@pytest.mark.parametrize("first", [0, 3, 9, 12])
def test_steps_tell_what_readings_say_after_them(robot, first):
    """In rows and columns, of members that change charts, stay where they are, or have ended."""
    laws = [
        *READINGS,
        *(lambda t, state, i=i: state.tool_velocity[i % 3] * (1 + i) for i in range(9)),
    ]
    states, u = spread(robot)
    many, other = (robot.stepper(states, DT, readings=laws, threads=1) for _ in range(2))
    told = ReadingTables(np.full((N, first), np.nan), np.full((12 - first, N), np.nan))
    idle, going = np.array([3, 17, 36]), np.ones(N, bool)
    going[idle] = False
    for steppers in (many, other):
        steppers.u[:] = u
    for _ in range(80):
        assert many.step_and_tell(told, 2, idle=idle)
        other.step(steps=2, index=going)
        expected = other.read()
        np.testing.assert_array_equal(told.rows, expected[:, :first])
        np.testing.assert_array_equal(told.columns, expected[:, first:].T)
    assert len({many.independent(member) for member in range(N)}) > 1
    np.testing.assert_array_equal(many.y, other.y)
    # A member that ends keeps the state before, of which it is told, and from then on.
    for steppers in (many, other):
        steppers.v[5] = np.nan
    for _ in range(2):
        assert many.step_and_tell(told, 1, idle=idle)
        other.step(index=going)
        np.testing.assert_array_equal(told.rows, other.read()[:, :first])
    assert many.status[5] == lw.Status.NON_FINITE


def test_steps_tell_whether_all_readings_are_finite(robot):
    states, _ = spread(robot)
    law = [lambda t, state: math.log(0.0025 - t)]
    many = robot.stepper(states, DT, readings=law, threads=1)
    told = ReadingTables(np.empty((N, 1)), np.empty((0, N)))
    assert [many.step_and_tell(told, 1, idle=np.array([0])) for _ in range(3)] == [
        True,
        True,
        False,
    ]
    np.testing.assert_array_equal(np.isfinite(told.rows[:, 0]), np.arange(N) == 0)


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
    many.put(others, slice(1, 9, 3), slice(30, 36, 2))
    np.testing.assert_array_equal(many.y[[1, 4, 7]], others.y[[30, 32, 34]])


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


def held(robot, law=None, drives=None):
    """Return steppers of all members at home, with parameters of each."""
    free = robot.free("platform.mass", "link_1.inertia.zz", "slide_1.frames.1.position.0")
    states, _ = spread(free)
    given = {name: np.full(N, value) for name, value in free.parameters.items()}
    return free.stepper(states, DT, law, drives=drives, parameters=given, threads=1)


def test_parameters_are_assigned_as_they_are_written(robot):
    """A whole one, or one number for all: what is assigned acts."""
    assigned, written = (held(robot, control_law()) for _ in range(2))
    assigned.parameters["platform.mass"] = np.linspace(1, 3, N)
    assigned.parameters["push"] = 2.0
    written.parameters["platform.mass"][:] = np.linspace(1, 3, N)
    written.parameters["push"][:] = 2.0
    np.testing.assert_array_equal(assigned.step(steps=9), written.step(steps=9))


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("platform.mass", -1.0, "member 0: .*mass: -1.0 is below 0"),
        ("platform.mass", np.arange(N) - 3.0, "member 0: .*mass: -3.0 is below 0"),
        ("link_1.inertia.zz", -1e-6, "is below 0"),
        ("platform.mass", np.nan, "'platform.mass' is nan; give finite numbers"),
        ("platform.mass", [1.0, 2.0], r"the shape \(2,\); give one number, or"),
        ("slide_1.frames.1.position.0", 0.2, "the loops close otherwise by"),
        ("platform.weight", 1.0, "there is no parameter 'platform.weight'"),
        ("slide_1.time_constant", -1.0, "the drive of 'slide_1': "),
    ],
)
def test_parameters_that_nothing_may_have_are_refused(robot, name, values, said):
    many = held(robot, drives={"slide_1": control.Lag(0.1)})
    before = {key: row.copy() for key, row in many.parameters.items()}
    with pytest.raises(lw.LinkworkError, match=said):
        many.parameters[name] = values
    for key, row in many.parameters.items():
        np.testing.assert_array_equal(row, before[key])


def test_parameters_that_were_written_are_looked_at_before_a_step(robot):
    """Those that are not finite are told by the member's status, as of all numbers."""
    many = held(robot)
    start = many.y.copy()
    many.parameters["platform.mass"][4] = -5.0
    with pytest.raises(lw.LinkworkError, match=r"mass: -5\.0 is below 0"):
        many.step()
    np.testing.assert_array_equal(many.y, start)
    many.parameters["platform.mass"][4] = np.nan
    many.step()
    assert [*np.flatnonzero(many.status)] == [4]


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
