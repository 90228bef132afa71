"""Many robots stepped on together: each does what it does alone, whatever its neighbours do."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork import control
from linkwork.robots import n_four_bar, pendulum, prr3
from linkwork.stepping import StepError, Stepper, Steppers

from tests.catalogue import built
from tests.stepping.test_stepper import SAMPLED, stiff_joint

DT = 1e-3
N = 37  # two full blocks of lanes, and some


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot(prr3())


def spread(robot: lw.Robot, size: float = 0.2) -> tuple[lw.State, np.ndarray]:
    """N states of different rates, and forces of each."""
    draw = np.random.default_rng(7)
    states = robot.state(np.tile(robot.home.positions, (N, 1)))
    v, u = (draw.normal(size=(N, count)) for count in (robot.mobility, len(robot.actuators)))
    return states.with_rates(size * v), u


def require_alike(many: Steppers, alone: Stepper, member: int) -> None:
    """A member is where it is alone, to the last bit."""
    assert many.time[member] == alone.time
    assert many.independent(member) == alone.independent
    np.testing.assert_array_equal(many.y[member], alone.y)


@pytest.mark.parametrize(("name", "size"), [("prr3", 0.2), ("rrr3", 1.0), ("delta", 0.2)])
def test_each_does_what_it_does_alone(name, size):
    """From chart to chart, too."""
    robot = built(name)
    states, u = spread(robot, size)
    many = robot.stepper(states, DT, threads=1)
    for _ in range(50):
        many.step(u)
    many.step(steps=150)
    assert not many.status.any()
    for member in range(N):
        alone = robot.stepper(states.at(member), DT)
        alone.step(u[member], 200)
        require_alike(many, alone, member)
    charts = {many.independent(member) for member in range(N)}
    assert (len(charts) > 1) == (name != "delta")
    states = many.states
    np.testing.assert_array_equal(states.q, many.q)
    assert robot.closure_error(states).max() < 1e-12


def test_starts_are_closed_as_those_of_one(robot):
    """States whose loops are open by more than runs leave, and by less than states are refused or
    closed for."""
    states, u = spread(robot)
    states = robot.state(states.positions + np.linspace(0, 8e-13, N)[:, None], states.rates)
    gaps = robot.closure_error(states)
    assert ((gaps > 2e-13) & (gaps < 1e-12)).sum() > 5
    many = robot.stepper(states, DT, threads=1)
    many.step(u)
    for member in range(N):
        alone = robot.stepper(states.at(member), DT)
        alone.step(u[member])
        require_alike(many, alone, member)


@pytest.mark.parametrize(("name", "size"), [("prr3", 0.2), ("rrr3", 1.0)])
def test_symplectic_steps_are_those_of_one(name, size):
    """From chart to chart, too; of extra states, and of the one that is told alone."""
    robot = built(name)
    states, u = spread(robot, size)
    given = {"method": "symplectic_euler", "drives": {robot.actuators[0]: control.Lag(0.02)}}
    many = robot.stepper(states, DT, threads=1, **given)
    many.step(u, steps=200)
    assert not many.status.any()
    for member in (0, 9, 16, N - 1):
        alone = robot.stepper(states.at(member), DT, **given)
        alone.step(u[member], 200)
        require_alike(many, alone, member)
    again = many.alone(9)
    again.step()
    many.step()
    np.testing.assert_array_equal(again.y, many.y[9])


@pytest.mark.parametrize(
    ("forces", "options"),
    [
        (None, {"drives": {"slide_2": control.Lag(0.02)}}),
        (SAMPLED, {}),
        (lambda t, state: [t - state.rate("slide_1"), 0.1, state["slide_2"]], {}),
        (None, {"wrenches": [control.Wrench("platform", force=lambda t, state: [t, 0.3, 0.0])]}),
    ],
)
def test_whatever_acts_acts_as_on_one(robot, forces, options):
    states, u = spread(robot)
    many = robot.stepper(states, DT, forces, threads=1, **options)
    for _ in range(60):
        many.step(u if forces is None else None)
    for member in (0, 15, 16, N - 1):
        alone = robot.stepper(states.at(member), DT, forces, **options)
        alone.step(u[member] if forces is None else None, 60)
        require_alike(many, alone, member)


def test_stops_are_struck_as_by_one():
    robot, _ = stiff_joint()
    states = robot.state(np.linspace(0.01, 0.1, N)[:, None])
    many = robot.stepper(states, 1e-4, threads=1)
    many.step(steps=1500)
    for member in (0, 20, N - 1):
        alone = robot.stepper(states.at(member), 1e-4)
        alone.step(steps=1500)
        require_alike(many, alone, member)


def test_bristles_bend_as_they_do_alone():
    """Slides that stick on their springs, and balls that fall, slide and roll on bristles."""
    bristle = lw.Bristle(stiffness=1e4, damping=100.0)
    friction = lw.Friction(coulomb=2.0, bristle=bristle)
    rail = lw.PrismaticJoint(
        connects=("ground", "body"), spring=lw.Spring(stiffness=40.0), friction=friction
    )
    body = lw.Body(mass=0.5, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
    floor = lw.Contact(
        connects=("ground", "body"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=1e4,
        friction=lw.Sliding(coefficient=0.2, bristle=bristle),
    )
    free = {"free": lw.FreeJoint(connects=("ground", "body"))}
    slide = lw.Robot(lw.Mechanism(bodies={"body": body}, joints={"x": rail}))
    ball = lw.Robot(lw.Mechanism(bodies={"body": body}, joints=free, contacts={"floor": floor}))
    drawn = slide.state(np.linspace(0.1, 0.4, N)[:, None])
    fallen = ball.state([[0, 0, 0.1 + 1e-6 * k, 1, 0, 0, 0] for k in range(N)])
    for states, of in ((drawn, slide), (fallen.with_rates([0.5, 0.1, 0, 0, 0, 0]), ball)):
        many = of.stepper(states, dt=1e-4)
        many.step(steps=60)
        assert (abs(many.z).max(axis=1) > 1e-3).all()
        for member in (0, 17, N - 1):
            alone = of.stepper(states.at(member), dt=1e-4)
            alone.step(steps=60)
            require_alike(many, alone, member)


def test_parameters_of_each(robot):
    free, masses = robot.free("platform.mass"), np.linspace(0.5, 5.0, N)
    states, u = spread(free)
    many = free.stepper(states, DT, parameters={"platform.mass": masses}, threads=1)
    many.step(u, 100)
    for member in (0, 18, N - 1):
        own = free.with_parameters({"platform.mass": masses[member]})
        alone = own.stepper(own.home.with_rates(states.rates[member]), DT)
        alone.step(u[member], 100)
        require_alike(many, alone, member)
        require_alike(many, many.alone(member), member)


def test_threads_change_nothing(robot):
    states = robot.state(np.tile(robot.home.positions, (900, 1)))
    states = states.with_rates(np.random.default_rng(3).normal(size=(900, 3)))
    found = []
    for threads in (1, 2, 3):
        many = robot.stepper(states, DT, [1.0, -0.5, 0.2], threads=threads)
        found.append(many.step(steps=60))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_whole_turns_of_each():
    robot = lw.Robot(pendulum())
    states = robot.state(np.zeros((N, 1))).with_rates(np.linspace(-200, 200, N)[:, None])
    many = robot.stepper(states, 2e-4, threads=1)
    many.step(steps=15_000)
    for member in (0, 17, N - 1):
        alone = robot.stepper(states.at(member), 2e-4)
        alone.step(steps=15_000)
        require_alike(many, alone, member)
    assert np.abs(many.q).max() > 500
    many.v[:] = 0.0  # what is not written, q, keeps its turns
    before = many.q.copy()
    many.step()
    np.testing.assert_allclose(many.q, before, atol=1e-5)


def test_one_that_ends_does_not_stop_the_others():
    """The bars of two four-bars lie in one line at t = 0.714 s at one rate, later at others."""
    robot = lw.Robot(n_four_bar(2))
    states = robot.state(np.tile(robot.home.positions, (3, 1))).with_rates([[-1.0], [0.0], [0.5]])
    many = robot.stepper(states, DT, threads=1)
    many.step(steps=750)
    assert many.status.tolist() == [lw.Status.SINGULAR, 0, 0]
    assert many.time == pytest.approx([0.714, 0.75, 0.75], abs=2e-3)
    kept, when = many.y[0].copy(), many.time[0]
    many.step(steps=10)
    assert many.time[0] == when
    np.testing.assert_array_equal(many.y[0], kept)
    with pytest.raises(StepError, match="branches of motion meet"):
        many.alone(0).step(steps=5)
    # It starts anew; the others are where they were.
    others = many.y[1:].copy()
    many.reset(0)
    assert many.status.tolist() == [0, 0, 0]
    np.testing.assert_array_equal(many.y[1:], others)
    many.step(steps=100)
    alone = robot.stepper(states.at(0), DT)
    alone.step(steps=100)
    require_alike(many, alone, 0)


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
def test_friction_that_leaves_no_motion_ends_members_where_one_ends(method):
    """Faster than some rate the slide jams: 2 mu h s(v) / l is 1 there; what a step comes to is
    known by the accelerations at its start."""
    rubs = lw.SlidingBearing(friction=lw.Sliding(coefficient=0.9, rate=0.5), span=0.5)
    body = lw.Body(mass=2.0, centre_of_mass=(0, 0.3, 0), inertia=lw.Inertia(zz=0.01))
    joint = lw.PrismaticJoint(connects=("ground", "block"), axis=(1, 0, 0), bearing=rubs)
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"block": body}, joints={"x": joint}, gravity=(0, -9.81, 0), actuators=("x",)
        )
    )
    pushed = np.array([[200.0], [80.0], [50.0], [5.0]])
    states = robot.state(np.zeros((4, 1))).with_rates(np.full((4, 1), 0.1))
    many = robot.stepper(states, 0.01, method=method, threads=1)
    many.step(pushed, steps=40)
    assert many.status.tolist() == [lw.Status.NON_FINITE] * 3 + [0]
    for i, forces in enumerate(pushed):
        alone = robot.stepper(states.at(i), 0.01, method=method)
        if many.status[i]:
            with pytest.raises(StepError, match="bearings of x"):
                alone.step(forces, steps=40)
        else:
            alone.step(forces, steps=40)
        require_alike(many, alone, i)
        run = robot.simulate(states.at(i), duration=0.4, forces=forces, method=method, step=0.01)
        np.testing.assert_array_equal(run.final.rates, many.v[i])
        assert run.status == many.status[i]


def test_some_are_put_elsewhere(robot):
    states, u = spread(robot)
    many = robot.stepper(states, DT, threads=1)
    many.step(u, 30)
    other = robot.assemble({"slide_1": 0.17, "slide_2": 0.165, "slide_3": 0.16})
    many.reset([3, 30], other.with_rates([0.3, -0.2, 0.1]), time=0.5)
    np.testing.assert_array_equal(many.u[[3, 30]], 0.0)
    many.reset(np.arange(N) == 5, states.at(slice(0, 1)))
    many.step(u, 20)
    alone = robot.stepper(other.with_rates([0.3, -0.2, 0.1]), DT)
    alone.reset(time=0.5)
    alone.step(u[30], 20)
    require_alike(many, alone, 30)
    first = robot.stepper(states.at(0), DT)
    first.step(u[5], 20)
    require_alike(many, first, 5)
    undisturbed = robot.stepper(states.at(4), DT)
    undisturbed.step(u[4], 50)
    require_alike(many, undisturbed, 4)
    many.reset()
    np.testing.assert_array_equal(many.time, 0.0)
    np.testing.assert_array_equal(many.v, states.rates)


def test_what_is_written_is_taken_over_member_by_member(robot):
    """Also what cannot be: that member ends where it was, and tells why."""
    states, u = spread(robot)
    many = robot.stepper(states, DT, threads=1)
    many.step(u, 10)
    before = many.y.copy()
    alone = many.alone(2)
    for written in (many.q[2], alone.q):
        written[:3] = [0.17, 0.165, 0.16]
    many.q[4, 0], many.v[7, 1], many.q[8] = np.nan, np.inf, 50.0
    forces = u.copy()
    forces[9, 2] = np.nan
    many.step(forces)
    alone.step(u[2])
    np.testing.assert_allclose(many.y[2], alone.y, atol=1e-13)
    wrong = {4: lw.Status.NON_FINITE, 7: lw.Status.NON_FINITE, 8: lw.Status.CLOSURE_LOST}
    wrong[9] = lw.Status.NON_FINITE
    assert {i: s for i, s in enumerate(many.status.tolist()) if s} == wrong
    np.testing.assert_array_equal(many.y[[4, 7, 8, 9]], before[[4, 7, 8, 9]])
    assert robot.closure_error(many.states).max() < 1e-12
    many.reset([4, 7, 8, 9])
    many.step(u)
    assert not many.status.any()


def test_drives_do_not_swallow_forces_that_are_no_numbers(robot):
    drives = {name: control.Saturated(1.0) for name in robot.actuators}
    states, u = spread(robot)
    many = robot.stepper(states, DT, drives=drives, threads=1)
    u[3] = np.nan
    many.step(u)
    assert np.flatnonzero(many.status).tolist() == [3]


def test_states_are_copied_or_written_where_asked(robot):
    states, u = spread(robot)
    many = robot.stepper(states, DT, u, threads=1)
    np.testing.assert_array_equal(many.u, u)
    kept, space = many.step(), np.empty(many.y.shape)
    assert many.step(out=space) is space
    assert many.step(out=many.y) is many.y
    assert kept.flags.c_contiguous and not np.array_equal(kept, many.y)
    assert len(many) == N and "37 robots, 37 go on" in repr(many)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            {"method": "rodas"},
            "together by 'rk4' or 'symplectic_euler', not by 'rodas'; make a stepper",
        ),
        ({"method": np.array(["rk4", "rk4"])}, r"not by array\(.*; make a stepper of each"),
        ({"readings": 3}, "readings are 3; give a list of functions"),
        ({"rtol": 1e-3}, "there is no option of steppers 'rtol'; there are drives"),
        ({"threads": 0}, "threads is 0; give a whole number, at least 1"),
        ({"dt": -1.0}, "dt is -1.0; give a positive number"),
        ({"forces": [SAMPLED] * N}, "signals of each robot are no forces of steppers"),
        ({"forces": np.zeros((3, 3))}, "members do not fit together: 37 of states, 3 of forces"),
        ({"forces": control.Sampler(lambda t, s: [0, 0, 0])}, "a sampled controller is not"),
        ({"parameters": {"mass": 1.0}}, "there is no parameter 'mass'"),
    ],
)
def test_what_makes_no_steppers(robot, options, sentence):
    given = {"state": spread(robot)[0], "dt": DT, **options}
    with pytest.raises(lw.LinkworkError, match=sentence):
        robot.stepper(**given)


def test_calls_that_do_not_fit(robot):
    states, u = spread(robot)
    many = robot.stepper(states, DT, threads=1)
    other = robot.stepper(states, DT, SAMPLED)
    for call, sentence in (
        (lambda: many.step(u[:3]), r"forces are of shape \(3, 3\); give \(37, 3\) numbers"),
        (lambda: many.step("abc"), "forces are 'abc'; give"),
        (lambda: many.step(1j * u), "forces are array.*; give"),
        (lambda: many.step(u, steps=0), "steps is 0; give a whole number"),
        (lambda: many.step(u, steps=np.array([1, 2])), r"steps is array\(\[1, 2\]\)"),
        (lambda: many.step(u, out=np.zeros(3)), r"out is float64 of shape \(3,\)"),
        (lambda: many.reset(99), "index 99 does not fit 37 robots"),
        (lambda: many.reset([1, 1]), r"index \[1, 1\] does not fit 37 robots; give .* different"),
        (lambda: many.reset([1, 2], states), r"a stack of the shape \(37,\); give one, or 2"),
        (lambda: many.reset(1, robot), "a state is needed, not Robot"),
        (lambda: many.reset(time=-1.0), "time -1.0 does not fit; give one from 0 s on"),
        (lambda: many.alone([1, 2]), r"index \[1, 2\] is none of one robot; give a number"),
        (lambda: pickle.dumps(many), "steppers cannot be copied or pickled"),
        (lambda: other.step(u), "the forces of these steppers are those that they were made with"),
        (lambda: other.step(steps=1001), "what acts is sampled up to 1 s, and the last"),
    ):
        with pytest.raises(lw.LinkworkError, match=sentence):
            call()
    with pytest.raises(ValueError, match="read-only"):
        many.status[0] = 0
    assert not many.u.any()
    np.testing.assert_array_equal(many.time, 0.0)


def test_lowered_bounds_are_raised_alike_however_steps_are_asked_for():
    """Near singular poses of a five-bar the bound of the pivots falls, and rises behind them: by
    the schedule of one robot, in one call as in many."""
    robot = built("five_bar")
    begun = robot.home.with_rates([1.968120555255462, -3.6552968276992237])
    u = [-4.793728600599119, 3.3552373148269328]
    alone = robot.stepper(begun, 2e-3, u)
    with pytest.raises(StepError, match=r"stopped at t = 0\.496 s"):
        alone.step(steps=400)
    for parts in ([400], [1] * 400, [7] * 57 + [1]):
        many = robot.stepper(robot.state(np.tile(begun.positions, (2, 1)), begun.rates), 2e-3, u)
        for steps in parts:
            many.step(steps=steps)
        require_alike(many, alone, 1)


def test_states_with_open_loops_are_refused_and_nobody_is_moved():
    """They were closed wherever Newton's method led, without a word."""
    robot = built("five_bar")
    many = robot.stepper(robot.state(np.tile(robot.home.positions, (3, 1))), DT)
    many.step(steps=2)
    before, q = many.y.copy(), robot.home.q + np.array([0.0, 0.0, 0.5, 0.0])
    for index in (1, None):
        with pytest.raises(lw.LinkworkError, match=r"the state .* loops are open by"):
            many.reset(index, replace(robot.home, q=q))
        np.testing.assert_array_equal(many.y, before)
    with pytest.raises(lw.LinkworkError, match=r"the state .* loops are open by"):
        both = np.stack([robot.home.q, q])
        stack = robot.state(np.tile(robot.home.positions, (2, 1)))
        robot.stepper(replace(stack, q=both), DT)
