"""Events are located on the dense output, in the order of their times, and end the run where they
are asked to."""

import math

import numpy as np
import pytest
from simulation_problems import (
    GRAVITY,
    above_diagonal,
    bead,
    bead_closure,
    drift,
    falling,
    height_and_speed,
    oscillator,
    position_twice,
    undefined,
)  # fmt: skip

from linkwork.errors import LinkworkError
from linkwork.simulation import (
    DORMAND_PRINCE,
    RK4,
    SHARP_SMART,
    Condition,
    Events,
    Status,
    SymplecticEuler,
    dop853,
    integrate,
)  # fmt: skip


def oscillate(*conditions, q=1.0, v=0.0, duration=10.0, **options):
    """q = cos t, with the events q = 0 and v = 0."""
    events = Events(height_and_speed.address, conditions)
    return integrate(
        oscillator.address, None, [q], [v], [], duration=duration, events=events, **options
    )


@pytest.mark.parametrize("method", [DORMAND_PRINCE, dop853()], ids=lambda method: method.name)
def test_all_zeros_are_found_in_the_order_of_their_times(method):
    run = oscillate(
        Condition(), Condition(), rtol=1e-11, atol=1e-11, method=method, save_at=[0.0, 10.0]
    )
    zeros = np.arange(1, 7) * math.pi / 2
    np.testing.assert_allclose(run.events.times, zeros, atol=1e-9)
    np.testing.assert_array_equal(run.events.index, [0, 1, 0, 1, 0, 1])
    np.testing.assert_allclose(
        run.events.states, np.transpose([np.cos(zeros), -np.sin(zeros)]), atol=1e-9
    )
    np.testing.assert_array_equal(run.t, [0.0, 10.0])


@pytest.mark.parametrize(
    ("direction", "zeros"), [(1, [1.5, 3.5]), (-1, [0.5, 2.5]), (0, [0.5, 1.5, 2.5, 3.5])]
)
def test_direction_chooses_among_the_zeros(direction, zeros):
    run = oscillate(Condition(direction=direction), Condition(direction=-direction), duration=11.0)
    np.testing.assert_allclose(
        run.events.times[run.events.index == 0], np.array(zeros[: len(zeros)]) * math.pi, rtol=1e-6
    )


def test_a_terminal_event_ends_the_run_exactly_there():
    run = integrate(
        falling.address, None, [5.0], [0.0], [], duration=10.0, save_at=np.arange(0, 10, 0.25),
        events=Events(height_and_speed.address, (Condition(terminal=True), Condition())),
    )  # fmt: skip
    fall = math.sqrt(2 * 5 / GRAVITY)
    assert run.status is Status.EVENT
    assert run.end_time == run.events.times[0] == pytest.approx(fall, abs=1e-12)
    assert (
        run.message == f"The run was ended by event 0 (counted from 0) at t = {run.end_time:.9g} s."
    )
    assert run.q_end[0] <= 0 and abs(run.q_end[0]) < 1e-13
    np.testing.assert_array_equal(run.t, np.arange(0, fall, 0.25))


def test_every_step_is_saved_up_to_the_end_and_no_further():
    run = oscillate(Condition(terminal=True), Condition())
    assert run.t[-1] == run.end_time == pytest.approx(math.pi / 2, abs=1e-7)
    assert (run.q[-1], run.v[-1]) == (run.q_end, run.v_end)


def test_events_do_not_change_the_steps():
    run, plain = (
        oscillate(Condition(), Condition()),
        integrate(oscillator.address, 0, [1.0], [0.0], [], duration=10.0),
    )
    np.testing.assert_array_equal(run.t, plain.t)
    np.testing.assert_array_equal(run.q, plain.q)


def test_a_ball_that_is_thrown_up_again_and_again():
    """A run goes on from a terminal event without meeting it again: five parabolas, each half as
    fast as the one before."""
    v, t, times = 4.0, 0.0, []
    events = Events(height_and_speed.address, (Condition(terminal=True, direction=-1), Condition()))
    q = np.zeros(1)
    for _ in range(5):
        run = integrate(falling.address, None, q, [v], [], start=t, duration=10.0, events=events)
        times.append(run.end_time)
        q, v, t = run.q_end, -run.v_end[0] / 2, run.end_time
    np.testing.assert_allclose(
        times, np.cumsum(2 * 4.0 / GRAVITY / 2.0 ** np.arange(5)), rtol=1e-11
    )


def test_all_events_of_the_instant_that_ends_the_run_are_told():
    """Two functions with the same zero, one three times the other: the second event happens when
    the first ends the run."""
    run = integrate(
        oscillator.address, None, [1.0], [0.0], [], duration=10.0,
        events=Events(position_twice.address, (Condition(terminal=True), Condition())),
    )  # fmt: skip
    assert run.status is Status.EVENT
    np.testing.assert_array_equal(np.sort(run.events.index), [0, 1])
    np.testing.assert_allclose(run.events.times, run.end_time, rtol=1e-14)


def test_a_run_goes_on_from_a_terminal_event():
    first = oscillate(Condition(terminal=True), Condition(terminal=True), rtol=1e-10)
    q, v = first.q_end[0], first.v_end[0]
    options = {"q": q, "v": v, "start": first.end_time, "rtol": 1e-10}
    second = oscillate(Condition(terminal=True), Condition(terminal=True), **options)
    assert [first.end_time, second.end_time] == pytest.approx([math.pi / 2, math.pi], abs=1e-8)


def test_zero_at_the_start_is_no_event():
    run = oscillate(Condition(terminal=True), Condition(), q=0.0, v=1.0)
    assert run.end_time == pytest.approx(math.pi, abs=1e-7)


def test_states_at_events_are_closed():
    run = integrate(
        bead.address, bead_closure.address, [math.sin(1.2), -math.cos(1.2)], [0.0], [],
        duration=5.0, rtol=1e-5, events=Events(above_diagonal.address, (Condition(),)),
    )  # fmt: skip
    assert len(run.events) >= 4
    assert np.abs(run.events.states[:, 1] + 0.5).max() < 1e-13
    assert np.abs(np.sum(run.events.states[:, :2] ** 2, axis=1) - 1).max() < 1e-13


@pytest.mark.parametrize(
    "method", [RK4(0.01), SymplecticEuler(0.001)], ids=lambda method: method.name
)
def test_methods_of_a_fixed_step_find_events(method):
    run = oscillate(Condition(), Condition(terminal=True), method=method)
    assert run.events.times == pytest.approx([math.pi / 2, math.pi], abs=2e-3)
    assert run.status is Status.EVENT


def test_an_event_function_that_is_undefined_ends_the_run():
    run = integrate(
        drift.address,
        None,
        [0.0],
        [1.0],
        [],
        duration=0.4,
        events=Events(undefined.address, (Condition(),)),
    )
    assert run.status is Status.NON_FINITE
    assert "the function of event 0 (counted from 0) is infinite or undefined" in run.message


def test_directions_that_are_none_are_refused():
    with pytest.raises(LinkworkError, match="direction of an event is 2; give -1, 0 or 1"):
        Condition(direction=2)


@pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, SHARP_SMART, dop853(), RK4(0.05)], ids=lambda method: method.name
)
@pytest.mark.parametrize("stay", [0.133, 0.022, 1e-3])
def test_an_event_that_is_left_again_within_a_step_is_found_twice(method, stay):
    """A stone thrown up passes a height just below its peak: h = v^2 / 2 g - g (stay / 2)^2 / 2."""
    v = 5.0
    peak, height = v / GRAVITY, v**2 / (2 * GRAVITY) - GRAVITY * (stay / 2) ** 2 / 2
    events = Events(height_and_speed.address, (Condition(), Condition()))
    run = integrate(
        falling.address,
        None,
        [-height],
        [v],
        [],
        duration=1.3,
        rtol=1e-8,
        events=events,
        method=method,
    )
    np.testing.assert_allclose(
        run.events.times, [peak - stay / 2, peak, peak + stay / 2], atol=1e-9
    )
    np.testing.assert_array_equal(run.events.index, [0, 1, 0])
    assert run.steps < 30
    first = integrate(
        falling.address, None, [-height], [v], [], duration=1.3, method=method,
        events=Events(height_and_speed.address, (Condition(terminal=True), Condition())),
    )  # fmt: skip
    assert first.status is Status.EVENT and first.end_time == pytest.approx(
        peak - stay / 2, abs=1e-9
    )


def test_a_function_that_stays_away_from_zero_by_little_does_not_happen():
    events = Events(height_and_speed.address, (Condition(), Condition()))
    v = 5.0
    run = integrate(
        falling.address,
        None,
        [-(v**2) / (2 * GRAVITY) - 1e-9],
        [v],
        [],
        duration=1.3,
        rtol=1e-12,
        atol=1e-13,
        events=events,
    )
    np.testing.assert_array_equal(run.events.index, [1])
