"""Steppers against runs, closed forms, SciPy on the textbook's equations, and what they refuse."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork import control
from linkwork.lab.textbook import Textbook
from linkwork.robots import four_bar, n_four_bar, pendulum, prr3
from linkwork.stepping import StepError, Stepper

from tests.catalogue import built

DT = 1e-3
FORCES = [0.1, 0.2, 0.3]


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot(prr3())


@pytest.fixture
def begun(robot) -> lw.State:
    return robot.home.with_rates([0.1, 0.2, 0.1])


def require_same(stepper: Stepper, run: lw.Run) -> None:
    """The stepper is where the run ended, to the last bit."""
    assert stepper.time == run.attrs["final_time"]
    state, final = stepper.state, run.final
    assert state.independent == final.independent
    for name in ("q", "positions", "rates"):
        np.testing.assert_array_equal(getattr(state, name), getattr(final, name))
    np.testing.assert_array_equal(stepper.y[: stepper.q.size], final.q)


@pytest.mark.sample(5)
@pytest.mark.parametrize(
    "name", ["prr3", "delta", "five_bar", "bricard", "rrr3", "double_pendulum"]
)
def test_steps_are_those_of_a_run_to_the_last_bit(name):
    """The 3-RRR changes its chart on the way."""
    robot = built(name)
    start = robot.home.with_rates(0.3 * np.ones(robot.mobility))
    u = 0.5 * np.ones(len(robot.actuators))
    stepper = robot.stepper(start, DT)
    for _ in range(100):
        stepper.step(u)
    stepper.step(u, steps=100)
    run = robot.simulate(start, u, duration=0.2, method="rk4", step=DT)
    require_same(stepper, run)
    assert stepper.closure_error < 1e-12
    assert ("; from " in run.attrs["charts"]) == (name == "rrr3")


def stiff_joint() -> tuple[lw.Robot, lw.State]:
    """A mass that falls onto a stop, with restitution."""
    stop = lw.Stop(lower=0.0, stiffness=1e4, restitution=0.7)
    body = lw.Body(mass=0.3, inertia=lw.Inertia(xx=0.02, yy=0.02, zz=0.02))
    joint = lw.PrismaticJoint(connects=("ground", "body"), stop=stop)
    mechanism = lw.Mechanism(bodies={"body": body}, joints={"z": joint}, gravity=(0.0, 0.0, -9.81))
    robot = lw.Robot(mechanism)
    return robot, robot.state([0.05])


def counting() -> Callable[..., list[float]]:
    """A controller that branches, as only a called one may."""

    def law(t, state):
        return [1.0 if state["slide_1"] < 0.17 else -1.0, 0.1 * t, 0.0]

    return law


SAMPLED = lw.Sampled(np.linspace(0, 1, 11), np.outer(np.linspace(0, 1, 11), [1.0, -1.0, 0.5]))
TIMES = np.array([0.0, 0.5, 1.0])
PUSH = control.Wrench("platform", force=lw.Sampled(TIMES, np.diag([0.0, 1.0, 0.0])))


@pytest.mark.parametrize(
    ("forces", "options"),
    [
        (None, {"method": "symplectic_euler"}),
        (None, {"drives": {"slide_1": control.Lag(0.01)}}),
        (None, {"wrenches": [PUSH]}),
        (SAMPLED, {}),
        (lambda t, state: [-state.rate("slide_1") + t, 0.1, state["slide_2"]], {}),
        (control.Sampler(counting(), rate=300.0, delay=1 / 300), {}),
        (control.Sampler(lambda t, state: [state["slide_1"], t, 0.0], compiled=True), {}),
    ],
)
def test_whatever_acts_acts_as_in_a_run(robot, begun, forces, options):
    stepper = robot.stepper(begun, DT, forces, **options)
    for _ in range(120):
        stepper.step(FORCES if forces is None else None)
    given = FORCES if forces is None else forces
    run = robot.simulate(begun, given, duration=0.12, step=DT, **{"method": "rk4"} | options)
    require_same(stepper, run)
    np.testing.assert_array_equal(stepper.z, run.attrs["final_v"][robot.mobility :])


def test_a_stop_is_struck_as_in_a_run():
    robot, start = stiff_joint()
    stepper, lowest = robot.stepper(start, 1e-4), 1.0
    for _ in range(2000):
        lowest = min(lowest, stepper.step()[0])
    assert lowest < -1e-3
    require_same(stepper, robot.simulate(start, duration=0.2, method="rk4", step=1e-4))


@pytest.mark.parametrize("method", ["dormand_prince", "sharp_smart", "rodas"])
def test_methods_that_choose_their_steps_do_so_within_dt(robot, begun, method):
    stepper = robot.stepper(begun, 0.05, method=method, rtol=1e-10, atol=1e-12)
    stepper.step(FORCES, 6)
    exact = robot.simulate(begun, FORCES, duration=0.3, rtol=1e-12, atol=1e-13).final
    assert stepper.time == pytest.approx(0.3)
    np.testing.assert_allclose(stepper.state.positions, exact.positions, atol=1e-8)


@pytest.mark.long
def test_the_order_is_four_by_scipy_on_the_textbook_s_equations(robot, begun):
    book = Textbook(robot.mechanism)
    m = len(robot.coordinates)

    def rates(t, y):
        q, v = y[:m], y[m:]
        return [*book.L(q) @ v, *book.forward_dynamics(q, v, FORCES)]

    start = [*begun.positions, *begun.rates]
    exact = solve_ivp(rates, (0, 0.1), start, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for dt in (0.05, 0.025, 0.0125):
        stepper = robot.stepper(begun, dt)
        stepper.step(FORCES, round(0.1 / dt))
        found = np.concatenate([stepper.positions, stepper.v])
        errors.append(np.abs(found - exact).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert ((orders > 3.6) & (orders < 4.6)).all(), errors


def test_a_million_steps_keep_loops_closed_and_the_energy(robot):
    """Over 1,000 s under gravity alone; times do not drift."""
    robot = lw.Robot(four_bar())
    start = robot.home.with_rates([0.5])
    stepper, begun = robot.stepper(start, DT), sum(robot.energy(start))
    stepper.step(steps=1_000_000)
    assert stepper.time == 1000.0
    assert stepper.closure_error < 1e-12
    assert sum(robot.energy(stepper.state)) == pytest.approx(begun, rel=1e-6)


def test_whole_turns_are_told_and_lose_no_digit():
    """A crank that turns for 500 rad is where that of a run is; y tells its turns."""
    robot = lw.Robot(pendulum())
    start = robot.home.with_rates([100.0])
    stepper = robot.stepper(start, 2e-4)
    stepper.step(steps=25_000)
    require_same(stepper, robot.simulate(start, duration=5.0, method="rk4", step=2e-4))
    assert stepper.q[0] > 450
    # What is not written keeps all of its digits.
    stepper.v[0] = stepper.v[0]
    other = robot.resume(stepper.run, duration=0.1, method="rk4", step=2e-4)
    stepper.step(steps=500)
    np.testing.assert_allclose(stepper.y[:2], [other.final.q[0], other.final.rates[0]], rtol=1e-13)


def test_from_a_run_and_back_to_one(robot, begun):
    whole = robot.simulate(begun, FORCES, duration=0.3, method="rk4", step=DT)
    first = robot.simulate(begun, FORCES, duration=0.1, method="rk4", step=DT)
    stepper = robot.stepper(first, DT)
    stepper.step(FORCES, 100)
    last = robot.resume(stepper.run, FORCES, duration=0.1, method="rk4", step=DT)
    np.testing.assert_allclose(last.final.positions, whole.final.positions, rtol=1e-14)
    np.testing.assert_allclose(last.final.rates, whole.final.rates, rtol=1e-13)
    # By way of a file's content, and with the extra states of drives.
    drives = {"slide_1": control.Lag(0.05)}
    stepper = robot.stepper(begun, DT, drives=drives)
    stepper.step(FORCES, 50)
    again = robot.stepper(pickle.loads(pickle.dumps(stepper.run)), DT, drives=drives)
    np.testing.assert_array_equal(again.step(FORCES), stepper.step(FORCES))
    assert again.z[0] == stepper.z[0] != 0


def test_a_state_closed_with_the_lengths_given_is_taken(robot):
    name = "wrist_1.frames.0.position.x"
    free = robot.free(name)
    longer = {name: free.parameters[name] + 0.01}
    given = free.with_parameters(longer)
    stepper = free.stepper(given.home, DT, parameters=longer)
    stepper.step(FORCES, 20)
    own = given.stepper(given.home, DT)
    np.testing.assert_array_equal(stepper.y, own.step(FORCES, 20))
    with pytest.raises(lw.LinkworkError, match="its loops are open by"):
        free.stepper(free.home, DT, parameters=longer)


def test_a_run_of_a_stepper_tells_its_quantities(robot, begun):
    stepper = robot.stepper(begun, DT)
    stepper.step(FORCES, 10)
    told = stepper.run
    assert told.time.tolist() == [0.01]
    np.testing.assert_array_equal(told["joint_position"].values[0], stepper.positions)
    np.testing.assert_allclose(told["joint_rate"].values[0], stepper.rates, rtol=1e-13)
    np.testing.assert_array_equal(told["actuator_force"].values[0], FORCES)


def test_forces_are_those_of_before_until_others_are_given(robot, begun):
    one, other, third = (robot.stepper(begun, DT, [0.5, 0.0, 0.1]) for _ in range(3))
    one.step([0.5, 0.0, 0.1], 20)
    other.step(steps=20)
    third.u[:] = 7.0
    third.reset()
    third.step({"slide_1": 0.5, "slide_3": 0.1}, 20)
    np.testing.assert_array_equal(one.y, other.y)
    np.testing.assert_array_equal(one.y, third.y)


def test_states_are_copied_or_written_where_asked(robot, begun):
    stepper = robot.stepper(begun, DT)
    kept, room = stepper.step(FORCES), np.empty(10)
    assert kept is not stepper.y
    assert stepper.step(out=room) is room
    assert stepper.step(out=stepper.y) is stepper.y
    assert not np.array_equal(kept, stepper.y)
    np.testing.assert_array_equal(stepper.y, np.concatenate([stepper.q, stepper.v, stepper.z]))


def test_what_is_written_to_the_state_is_taken_over(robot, begun):
    """Rates as they are; of q the independent coordinates, to which the others are moved."""
    stepper = robot.stepper(begun, DT)
    stepper.step(FORCES, 5)
    other = robot.assemble({"slide_1": 0.17, "slide_2": 0.165, "slide_3": 0.16})
    stepper.q[:3], stepper.v[:] = [0.17, 0.165, 0.16], [0.3, -0.2, 0.1]
    stepper.step(FORCES)
    fresh = robot.stepper(other.with_rates([0.3, -0.2, 0.1]), DT)
    fresh.reset(time=stepper.time - DT)
    fresh.step(FORCES)
    np.testing.assert_allclose(stepper.y, fresh.y, rtol=1e-12, atol=1e-13)
    assert stepper.closure_error < 1e-12


@pytest.mark.parametrize(
    ("part", "value", "sentence"),
    [
        ("q", np.nan, r"the y that was written to the stepper\[0\] is nan; give finite numbers"),
        ("v", np.inf, r"the y that was written to the stepper\[7\] is inf; give finite numbers"),
        ("q", 9.0, "the loops do not close at the q that was written, however the dependent"),
    ],
)
def test_what_cannot_be_taken_over_leaves_the_state_as_it_was(robot, begun, part, value, sentence):
    stepper = robot.stepper(begun, DT)
    before = stepper.step(FORCES)
    getattr(stepper, part)[0] = value
    with pytest.raises(lw.LinkworkError, match=sentence):
        stepper.step(FORCES)
    np.testing.assert_array_equal(stepper.y, before)
    twin = robot.stepper(begun, DT)
    np.testing.assert_array_equal(stepper.step(FORCES), twin.step(FORCES, 2))


@pytest.mark.parametrize(
    ("u", "sentence"),
    [
        ([1.0, 2.0], r"forces has shape \(2,\); give 3 numbers in the last dimension: slide_1"),
        (np.ones((3, 1)), r"forces has shape \(3, 1\); give 3 numbers"),
        (np.ones((1, 3)), r"forces has shape \(1, 3\); give 3 numbers: slide_1, slide_2, slide_3"),
        (np.array([0.0, np.nan, 0.0]), r"forces\[1\] is nan; give finite numbers"),
        ([0.0, 0.0, -np.inf], r"forces\[2\] is -inf; give finite numbers"),
        (np.ones(3) * 1j, r"forces is array\(.*\); give numbers"),
        ("abc", "forces is 'abc'; give numbers"),
        ({"slide_7": 1.0}, "there is no actuator 'slide_7'"),
    ],
)
def test_forces_that_do_not_fit(robot, begun, u, sentence):
    stepper = robot.stepper(begun, DT)
    stepper.step(FORCES)
    with pytest.raises(lw.LinkworkError, match=sentence):
        stepper.step(u)
    twin = robot.stepper(begun, DT)
    np.testing.assert_array_equal(stepper.step(FORCES), twin.step(FORCES, 2))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"dt": 0.0}, "dt is 0.0; give a positive number"),
        ({"method": np.array(["rk4", "rk4"])}, r"there is no method array\("),
        ({"method": "euler"}, "there is no method 'euler'; there are"),
        ({"step": 1e-3}, "there is no option of a stepper 'step'; there are drives"),
        ({"state": 3}, "a state is needed, not int"),
        ({"forces": [1.0]}, r"forces has shape \(1,\); give 3 numbers"),
        ({"forces": [np.nan] * 3}, r"forces\[0\] is nan"),
    ],
)
def test_what_makes_no_stepper(robot, begun, options, sentence):
    given = {"state": begun, "dt": DT, **options}
    with pytest.raises(lw.LinkworkError, match=sentence):
        robot.stepper(**given)


def test_calls_that_do_not_fit(robot, begun):
    stepper = robot.stepper(begun, DT)
    stack = robot.state(np.tile(begun.positions, (2, 1)))
    for call, sentence in (
        (lambda: stepper.step(steps=0), "steps is 0; give a whole number, at least 1"),
        (lambda: stepper.step([9.0] * 3, steps=np.array([1, 2])), r"steps is array\(\[1, 2\]\)"),
        (lambda: stepper.step(steps=True), "steps is True; give numbers"),
        (lambda: stepper.step(out=np.zeros(3)), r"out is float64 of shape \(3,\); give an array"),
        (lambda: stepper.step(out=[0.0] * 10), "out is .*; give an array of floats of shape"),
        (lambda: stepper.step(out=np.broadcast_to(0.0, 10)), "out cannot be written"),
        (lambda: pickle.dumps(stepper), "a stepper cannot be copied or pickled"),
        (lambda: stepper.reset(time=np.nan), "time is nan; give finite numbers"),
        (lambda: stepper.reset(time=-1.0), "must start at a finite time from 0 s on, not at -1"),
        (lambda: stepper.reset(robot), "a state is needed, not Robot"),
        (lambda: stepper.reset(stack), r"a stack of the shape \(2,\); a stepper takes one"),
    ):
        with pytest.raises(lw.LinkworkError, match=sentence):
            call()
    assert stepper.time == 0.0 and not stepper.u.any()
    other = robot.stepper(begun, DT, SAMPLED)
    with pytest.raises(lw.LinkworkError, match="forces of this stepper are those that it was made"):
        other.step(FORCES)
    with pytest.raises(StepError, match=r"what acts is sampled up to 1 s, .* at t = 1 s"):
        other.step(steps=1001)
    assert other.time == 1.0


def test_a_singular_pose_is_told_and_nothing_is_lost():
    """All bars of two four-bars in one line at t = 0.714 s; a run steps over from there."""
    robot = lw.Robot(n_four_bar(2))
    stepper = robot.stepper(robot.home.with_rates([-1.0]), DT)
    with pytest.raises(
        StepError, match=r"branches of motion meet .* The state there is kept"
    ) as at:
        stepper.step(steps=10_000)
    assert at.value.status is lw.Status.SINGULAR
    assert at.value.time == stepper.time == pytest.approx(0.714, abs=2e-3)
    energy = sum(robot.energy(stepper.state))
    run = robot.resume(stepper.run, duration=1.0, on_singular="step_over")
    assert run.success
    assert sum(robot.energy(run.final)) == pytest.approx(energy, rel=1e-7)
    stepper.reset()
    assert stepper.time == 0.0
    stepper.step(steps=100)


def test_singular_poses_of_the_independent_rates_are_passed(robot):
    """Under 5 N the paper's robot passes through them: the work is the change of energy."""
    stepper, energy = robot.stepper(robot.home, 1e-4), sum(robot.energy(robot.home))
    seen = set()
    for _ in range(100):
        stepper.step([5.0, 0.0, 0.0], 100)
        seen.add(stepper.independent)
    work = 5 * (stepper.positions[0] - robot.home.positions[0])
    assert sum(robot.energy(stepper.state)) - energy == pytest.approx(work, rel=1e-7)
    assert len(seen) > 1
    assert stepper.closure_error < 1e-12


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
def test_steps_of_fixed_length_keep_to_it_past_weak_pivots(method):
    """A crank-rocker that is almost a parallelogram passes its fold, where rates are weak."""
    robot = lw.Robot(four_bar(ground=1.0, crank=0.5, coupler=1.0, rocker=0.5001))
    start, how = robot.home.with_rates([8.0]), {"method": method, "step": 2e-3}
    run = robot.simulate(start, duration=0.5, **how)
    np.testing.assert_array_equal(run.time, 2e-3 * np.arange(251))
    stepper = robot.stepper(start, 2e-3, method=method)
    stepper.step(steps=250)
    require_same(stepper, run)
    half = robot.simulate(start, duration=0.2, **how)
    require_same(stepper, robot.resume(half, duration=0.3, **how))


def test_a_state_of_the_other_sign_may_be_written():
    """q of another assembly mode: the chart there has pivots of other signs."""
    robot = lw.Robot(four_bar())
    modes = lw.analysis.assembly_modes(robot, {"crank_pivot": 0.8}).states
    assert len(modes) == 2
    steppers = [robot.stepper(mode, DT) for mode in modes]
    for other, stepper in zip([modes.at(1), modes.at(0)], steppers, strict=True):
        stepper.q[:], stepper.v[:] = other.q, 0.0
        stepper.step()
    for stepper, mode in zip(steppers[::-1], modes, strict=True):
        np.testing.assert_allclose(stepper.y, robot.stepper(mode, DT).step(), atol=1e-12)


def test_a_function_that_raises_is_told(robot, begun):
    def law(t, state):
        if t > 0.0105:
            raise RuntimeError("the bus is down")
        return [0.0, 0.0, 0.0]

    stepper = robot.stepper(begun, DT, control.Sampler(law, rate=1000.0))
    with pytest.raises(StepError, match="RuntimeError: the bus is down") as at:
        stepper.step(steps=100)
    assert isinstance(at.value.__cause__, RuntimeError)
    assert at.value.status is lw.Status.CALLBACK_FAILED
    assert stepper.time == pytest.approx(0.011)


def test_steps_between_multiples_of_dt_are_counted_from_the_start(robot, begun):
    run = robot.simulate(begun, FORCES, duration=0.00123456)
    stepper = robot.stepper(run, DT)
    stepper.step(FORCES, 1000)
    assert stepper.time == pytest.approx(0.00123456 + 1.0, abs=1e-15)
