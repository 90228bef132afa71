"""Sampled control: zero-order hold, delay, quantisation, faults; compiled and called back give the
same."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, Lag, Sampler

from tests.control.plants import cart

LAW = PD({"slide": 0.3}, 18.0, 4.0)


@pytest.fixture(scope="module")
def plant():
    return cart(mass=2.0)


def discrete(rate, steps, late=0, quantum=0.0):
    """Return x_k of m x'' = u held over each period: x' = x + h v + h^2 u / 2 m, v' = v + h u /
    m."""
    h, x, v, queue, found = 1 / rate, 0.0, 0.0, [0.0] * late, [0.0]
    for _ in range(steps):
        seen_x = quantum * np.floor(x / quantum + 0.5) if quantum else x
        seen_v = quantum * rate * np.floor(v / (quantum * rate) + 0.5) if quantum else v
        queue.append(18.0 * (0.3 - seen_x) - 4.0 * seen_v)
        u = queue.pop(0)
        x, v = x + h * v + h**2 * u / 4.0, v + h * u / 2.0
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(
    ("delay", "quantise"), [(0.0, None), (0.06, None), (0.0, 0.01), (0.02, {"slide": 0.0031})]
)
def test_the_discrete_recursion(plant, compiled, delay, quantise):
    sampler = Sampler(LAW, 50.0, delay=delay, quantise=quantise, compiled=compiled)
    run = plant.simulate(plant.home, sampler, duration=1.0, save_at=np.arange(51) / 50)
    quantum = quantise["slide"] if isinstance(quantise, dict) else quantise or 0.0
    expected = discrete(50.0, 50, round(delay * 50), quantum)
    assert np.allclose(run["joint_position"].values[:, 0], expected, 0, 1e-9)


def test_the_held_command_is_recorded(plant):
    run = plant.simulate(plant.home, Sampler(LAW, 10.0), duration=1.0, save_at=[0.0, 0.05, 0.099])
    command = run["command"].values[:, 0]
    assert np.allclose(command, 18.0 * 0.3)
    assert np.allclose(run["actuator_force"].values[:, 0], command)


def test_a_fast_sampler_is_the_traced_controller(plant):
    """The difference falls in proportion to the period."""
    save = [0.5, 1.0]
    exact = plant.simulate(plant.home, LAW, duration=1.0, save_at=save, rtol=1e-10)[
        "joint_position"
    ].values
    gaps = [
        np.abs(
            plant.simulate(
                plant.home, Sampler(LAW, rate, compiled=True), duration=1.0, save_at=save
            )["joint_position"].values
            - exact
        ).max()
        for rate in (200, 400, 800)
    ]
    assert gaps[2] < 1e-3
    assert np.allclose(np.divide(gaps[:2], gaps[1:]), 2, 0.03)


def test_a_sampled_function_may_branch_and_remember(plant):
    """A relay: any Python code is called, once in each period, at exact multiples of it."""
    times = []

    def relay(t, state):
        times.append(t)
        return [1.0 if state["slide"] < 0.1 else -1.0]

    run = plant.simulate(plant.home, Sampler(relay, 20.0), duration=2.0, save_at=[2.0])
    assert run.success
    assert np.array_equal(times, np.arange(len(times)) * 0.05) and len(times) in (40, 41)


@pytest.mark.parametrize("drives", [None, {"slide": Lag(0.05)}])
def test_an_exception_ends_the_run_with_what_was_computed(plant, drives):
    def failing(t, state):
        if t > 0.45:
            raise RuntimeError("sensor lost")
        return [1.0]

    run = plant.simulate(plant.home, Sampler(failing, 10.0), duration=1.0, drives=drives)
    assert run.status is lw.Status.CALLBACK_FAILED and not run.success
    assert (
        isinstance(run.error, RuntimeError)
        and "sensor lost" in run.message
        and "0.5 s" in run.message
    )
    time = run.coords["time"].values
    assert np.isclose(time[-1], 0.5) and len(time) > 2
    if drives is None:
        assert np.isclose(run["joint_position"].values[-1, 0], 0.5**2 / 4)


def test_a_wrong_number_of_forces_ends_the_run(plant):
    run = plant.simulate(plant.home, Sampler(lambda t, s: [1.0, 2.0], 10.0), duration=1.0)
    assert (
        run.status is lw.Status.CALLBACK_FAILED and "returns 2 values; give 1: slide" in run.message
    )


def test_an_interrupt_cancels_the_run_and_keeps_what_was_computed(plant):
    def interrupted(t, state):
        if t > 0.45:
            raise KeyboardInterrupt
        return [1.0]

    run = plant.simulate(plant.home, Sampler(interrupted, 10.0), duration=1.0)
    assert run.status is lw.Status.CANCELLED and isinstance(run.error, KeyboardInterrupt)
    assert run.message == "The run was cancelled at t = 0.5 s."
    assert np.isclose(run["joint_position"].values[-1, 0], 0.5**2 / 4)


def test_a_wish_to_leave_is_not_swallowed(plant):
    def leaving(t, state):
        raise SystemExit

    with pytest.raises(SystemExit):
        plant.simulate(plant.home, Sampler(leaving, 10.0), duration=1.0)


@pytest.mark.parametrize("late", [0, 3])
@pytest.mark.parametrize("fault", ["raised", "undefined", "undefined, compiled"])
def test_a_run_goes_on_with_a_repaired_controller(plant, late, fault):
    """The call that failed is repeated, and what was to act later still does: the discrete
    recursion, uninterrupted."""

    def broken(t, state):
        if fault == "raised" and t > 0.45:
            raise RuntimeError("sensor lost")
        return [
            LAW(t, state)[0]
            if fault == "raised"
            else LAW(t, state)[0] + 1e-30 * lw.math.sqrt(0.45 - t)
        ]

    with np.errstate(invalid="ignore"):
        failed = plant.simulate(
            plant.home,
            Sampler(broken, 10.0, delay=late / 10, compiled="compiled" in fault),
            duration=1.0,
        )
    assert not failed.success and failed.attrs["final_time"] == 0.5
    run = plant.resume(failed, Sampler(LAW, 10.0, delay=late / 10), duration=0.5)
    assert run.success
    assert np.isclose(run["joint_position"].values[-1, 0], discrete(10.0, 10, late)[-1], 0, 1e-9)


def test_a_resumed_run_is_sampled_at_its_own_rate(plant):
    times = []

    def noted(t, state):
        times.append(t)
        return [0.0]

    run = plant.simulate(plant.home, Sampler(noted, 10.0), duration=0.45)
    times.clear()
    assert plant.resume(run, Sampler(noted, 16.0), duration=0.3).success
    assert np.array_equal(times, np.arange(8, 12) / 16)


def test_a_resumed_run_needs_the_delay_that_it_had(plant):
    run = plant.simulate(plant.home, Sampler(LAW, 10.0), duration=0.45)
    with pytest.raises(
        lw.LinkworkError,
        match="ended with 1 held inputs, but this controller holds 3; give it the delay",
    ):
        plant.resume(run, Sampler(LAW, 10.0, delay=0.2), duration=0.5)


@pytest.mark.parametrize(
    "wrap",
    [
        lambda law: law,
        lambda law: Sampler(law, 100.0),
        lambda law: Sampler(law, 100.0, compiled=True),
    ],
)
def test_undefined_forces_end_the_run_and_are_named(wrap):
    robot = lw.Robot(lw.robots.prr3())
    law = wrap(lambda t, state: {"slide_2": lw.math.sqrt(0.25 - t), "slide_1": 1.0})
    with np.errstate(invalid="ignore"):
        run = robot.simulate(robot.home, law, duration=1.0)
    assert run.status is lw.Status.NON_FINITE
    assert "slide_2" in run.message and "slide_1" not in run.message
    assert 0.2 < run.coords["time"].values[-1] < 0.27
    assert np.isfinite(run["joint_position"]).all()


def test_a_change_of_chart_keeps_what_is_held():
    """A crank turned right round passes poses where the chart changes; called back and compiled
    agree all the way."""
    robot = lw.Robot(lw.robots.four_bar())
    name = robot.actuators[0]
    law = lambda t, state: {name: 2.0 - state.rate(name)}  # noqa: E731
    ends = []
    for compiled in (False, True):
        run = robot.simulate(
            robot.home, Sampler(law, 50.0, compiled=compiled), duration=4.0, save_at=[0, 4.0]
        )
        assert run.success
        ends.append(run["joint_position"].values[-1])
    assert np.allclose(ends[0], ends[1], 0, 1e-7)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"rate": 0}, "the rate of a sampler is 0"),
        ({"rate": 100, "delay": 0.015}, "1.5 periods; give a whole number of periods"),
        ({"rate": 100, "delay": -0.01}, "the delay of a sampler is -0.01 s"),
        ({"quantise": -1e-3}, "the step of a quantised coordinate is -0.001"),
        ({"quantise": {"slide": 0}}, "the step of a quantised coordinate is 0"),
        ({"quantise": 0}, "the step of a quantised coordinate is 0"),
        ({"quantise": "x"}, "the step of a quantised coordinate is 'x'"),
        ({"rate": "a"}, "the rate of a sampler is 'a'"),
        ({"delay": "x"}, "the delay of a sampler is 'x'"),
    ],
)
def test_refusals(options, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        Sampler(LAW, **options)


@pytest.mark.parametrize("compiled", [False, True])
def test_steps_of_unknown_coordinates_are_refused(plant, compiled):
    with pytest.raises(
        lw.LinkworkError, match="there is no coordinate to quantise 'foo'; there are slide"
    ):
        plant.simulate(
            plant.home, Sampler(LAW, quantise={"foo": 1e-3}, compiled=compiled), duration=0.1
        )


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (lambda: 1 / 0, "raised ZeroDivisionError: division by zero."),
        (lambda: next(iter(())), "raised StopIteration."),
    ],
)
def test_what_was_raised_is_told_with_its_text_if_it_has_one(plant, result, sentence):
    run = plant.simulate(plant.home, Sampler(lambda t, state: result(), 100.0), duration=0.1)
    assert run.status is lw.Status.CALLBACK_FAILED and run.message.endswith(sentence)


def test_no_function_no_sampler():
    with pytest.raises(lw.LinkworkError, match=r"calls a function of \(t, state\)"):
        Sampler([1.0])
