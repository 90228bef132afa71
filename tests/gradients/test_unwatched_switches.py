"""Switches for which nobody watches, in steps that end or begin at events, and events that hardly
pass zero: closed solutions of a cart of 2 kg."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork import math
from linkwork.control import Event
from linkwork.errors import LinkworkError

from tests.gradients.test_runs import CART

ADAPTIVE = [{}, {"method": "rodas"}]
FIXED = [{"method": "rk4", "step": 0.01}, {"method": "symplectic_euler", "step": 1e-3}]
LAST = 0.5


def at(place):
    return Event(lambda t, state: state["rail"] - place, cuts=True)


def paid(robot, places, watched, duration=1.0, **own):
    """Lead the cart by 1 m/s past places, at each of which what is paid a second grows by 3."""
    return robot.gradient(
        None,
        robot.home.with_rates([1.0]),
        [0.0],
        running=lambda t, s: 2 + sum(math.where(s["rail"] < place, 0.0, 3.0) for place in places),
        events=[at(place) for place in watched],
        duration=duration,
        **own,
    )


PLACES = [LAST - 1e-2, LAST - 1e-6, LAST + 1e-6, LAST + 1e-2]


@pytest.mark.sample(5)
@pytest.mark.parametrize("own", ADAPTIVE)
@pytest.mark.parametrize("near", PLACES)
def test_another_switch_near_an_event_is_not_left_out(near, own):
    robot = lw.Robot(CART)
    with pytest.raises(LinkworkError, match=f"what acts jumps at t = {near:.6g} s, .*; watch"):
        paid(robot, (near, LAST), (LAST,), **own)
    found = paid(robot, (near, LAST), (near, LAST), **own)
    assert found.value == pytest.approx(2 + 3 * (1 - near) + 3 * (1 - LAST), rel=1e-10)
    assert found["positions.rail"] == pytest.approx(6.0, rel=1e-9)


@pytest.mark.parametrize("own", FIXED)
@pytest.mark.parametrize("near", [LAST - 1e-4, LAST + 1e-4])
def test_steps_of_given_lengths_end_at_no_event(near, own):
    """But at those that meet their ends."""
    robot = lw.Robot(CART)
    for watched in [(LAST,), (near, LAST)]:
        with pytest.raises(LinkworkError, match=f"t = {near:.6g} s, .* method that chooses its"):
            paid(robot, (near, LAST), watched, **own)
    found = paid(robot, (LAST,), (LAST,), **own)
    assert found["positions.rail"] == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize("own", [*ADAPTIVE, *FIXED])
def test_what_is_paid_from_a_stated_time_on_asks_for_an_event(own):
    """Values were 2 % off. Forces that jump at a stated time need none."""
    robot = lw.Robot(CART)
    given = None, robot.home.with_rates([1.0])
    later = {"running": lambda t, state: math.where(t > 0.105, 3 * state["rail"], 0.0)}
    with pytest.raises(LinkworkError, match=r"what acts jumps at t = 0.105 s, where no step ends"):
        robot.gradient(*given, [0.0], duration=0.2, **later, **own)
    law = lambda t, state: [math.where(t > 0.1, 2.0, 0.0)]  # noqa: E731
    smooth = {"running": lambda t, state: state["rail"] ** 2}
    assert robot.gradient(*given, law, duration=0.2, **smooth, **own).value > 0
    if own not in FIXED:
        events = [Event(lambda t, state: t - 0.105, cuts=True)]
        found = robot.gradient(*given, [0.0], duration=0.2, events=events, **later, **own)
        assert found.value == pytest.approx(1.5 * (0.2**2 - 0.105**2), rel=1e-9)


@pytest.mark.parametrize("own", FIXED)
@pytest.mark.parametrize("behind", [lambda t: t > 0.1, lambda t: t >= 0.1])
def test_fixed_steps_that_end_at_a_time_that_is_an_event_keep_their_sides(behind, own):
    """By differences of runs: stages at the end of a step act as the law does there, whichever."""
    robot, last = lw.Robot(CART), {"joint_position": np.array([[0.0], [1.0]])}
    events = [Event(lambda t, state: t - 0.1, cuts=True)]

    def run(rate: float, k: float) -> lw.Run:
        def law(t, state):
            push = math.where(behind(t), 2.0, -1.0) * state.parameter("k", 1.0)
            return [push * math.cos(state["rail"])]

        start = robot.home.with_rates([rate])
        given = {"parameters": {"k": k}, "duration": 0.2, "samples": 2, "events": events}
        return robot.simulate(start, law, **given, **own)

    def slope(rate: float, k: float) -> float:
        ahead, back = (run(0.5 + h * rate, 1 + h * k).final.positions for h in (1e-5, -1e-5))
        return (ahead - back).item() / 2e-5

    found = run(0.5, 1.0).gradient(last, ["rates", "parameters"])
    np.testing.assert_allclose([*found.values()], [slope(1, 0), slope(0, 1)], rtol=1e-8)
    # What is paid is paid from there on: 3 and 3 x a second, from 0.1 s to 0.2 s.
    paid = robot.gradient(
        None,
        robot.home.with_rates([1.0]),
        [0.0],
        running=lambda t, state: math.where(behind(t), 3 * (1 + state["rail"]), 0.0),
        events=events,
        duration=0.2,
        **own,
    )
    assert paid["positions.rail"] == pytest.approx(0.3, rel=1e-9)


@pytest.mark.parametrize("own", [*ADAPTIVE, *FIXED])
def test_a_switch_that_two_events_or_the_end_meet_is_watched_for(own):
    robot = lw.Robot(CART)
    found = paid(robot, (LAST,), (LAST, LAST), **own)
    assert found["positions.rail"] == pytest.approx(3.0, rel=1e-9)
    # The end is at the switch, but for rounding: it is looked at from before.
    found = paid(robot, (LAST,), (LAST,), duration=LAST, **own)
    assert found.value == pytest.approx(2 * LAST, rel=1e-9)


def test_a_passage_shorter_than_a_step_is_seen_by_its_stages():
    """What is paid between 0.7 m and 0.71 m alone, in steps of 0.05 s whose ends are without."""
    robot = lw.Robot(CART)
    with pytest.raises(LinkworkError, match=r"what acts jumps at t = 0\.72"):
        robot.gradient(
            None,
            robot.home.with_rates([1.0]),
            [0.0],
            running=lambda t, s: math.where(math.abs(s["rail"] - 0.725) < 5e-3, 1.0, 0.0),
            duration=1.0,
            method="rk4",
            step=0.05,
        )


def thrown(depth, **own):
    """Return a cart thrown against 4 N that stops at an event below its top, of 0.25 m, by a depth
    relative to that; with the event's time and the derivative of that by the speed."""
    robot, place = lw.Robot(CART), 0.25 * (1 - depth)
    stop = Event(lambda t, state: state["rail"] - place, terminal=True, name="stop")
    run = robot.simulate(robot.home.with_rates([1.0]), [-4.0], duration=1.0, events=[stop], **own)
    hit = (1 - np.sqrt(depth)) / 2
    return run, hit, -hit / (1 - 2 * hit)


@pytest.mark.parametrize("own", [*ADAPTIVE, FIXED[0]])
def test_events_that_pass_zero_by_little_have_times_with_derivatives(own):
    run, hit, slope = thrown(1e-6, **own)
    assert run.time[-1] == pytest.approx(hit, abs=1e-9)
    assert run.gradient({"event_time": [1.0]})["rates.rail"] == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("own", [{}, {"rtol": 1e-11, "atol": 1e-12}])
def test_events_that_pass_zero_by_no_more_than_errors_are_refused(own):
    run, *_ = thrown(1e-13, **own)
    with pytest.raises(LinkworkError, match=r"'stop' at t = 0.4999.* touches zero"):
        run.gradient({"event_time": [1.0]})


def test_jumps_of_small_numbers_count_beside_large_ones():
    """1e-5 is paid a second from 0.05 m on, under accelerations of up to 75 m/s^2."""
    robot, a, w, v0 = lw.Robot(CART), 0.05, np.sqrt(1500.0), 3.0
    hit = np.arcsin(a * w / v0) / w

    def found(*events):
        return robot.gradient(
            None,
            robot.home.with_rates([v0]),
            lambda t, state: [-3000 * state["rail"]],
            running=lambda t, state: math.where(state["rail"] < a, 0.0, 1e-5),
            events=events,
            duration=hit + 0.01,
            rtol=1e-10,
            atol=1e-12,
        )

    with pytest.raises(LinkworkError, match="what acts jumps"):
        found()
    watched = found(at(a))
    slope = -a / v0**2 / np.sqrt(1 - (a * w / v0) ** 2)
    assert watched.value == pytest.approx(1e-7, rel=1e-7)
    assert watched["rates.rail"] == pytest.approx(-1e-5 * slope, rel=1e-7)


def test_losses_of_runs_that_stop_early_are_refused():
    """The end of a run that stops is an accident of its steps."""
    robot = lw.Robot("prr3")
    with pytest.raises(LinkworkError, match=r"loss of 5 s has neither .* The run stopped at t = "):
        robot.gradient(lambda t, s: s["slide_1"], robot.home, [30.0, 0, 0], duration=5, max_steps=9)


@pytest.mark.parametrize("surface", [lw.Points(points=((0, 0, 0),)), lw.Sphere(radius=0.05)])
def test_the_force_of_a_contact_that_leaps_at_the_edge_of_a_field_asks_for_an_event(surface):
    """Derivatives were 5 % off, without a word; with it they are those of differences."""
    slope = lw.HeightField(
        heights=((0, 0), (0.1, 0.1)), spacing=(1, 1), frame=lw.Frame(position=(0, -0.5, 0))
    )
    upright = lw.Frame(rotation=(np.pi / 2, 0, 0))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.01, yy=0.01, zz=0.01))},
            joints={"p": lw.PlanarJoint(connects=("ground", "ball"), frames=(upright, upright))},
            contacts={
                "c": lw.Contact(
                    connects=("ground", "ball"),
                    surfaces=(slope, surface),
                    stiffness=1e3,
                    exponent=1,
                )
            },
        )
    )
    start = robot.state([0.8, 0.07 + getattr(surface, "radius", 0), 0]).with_rates([2.0, 0.2, 0])
    told: Any = {"duration": 0.15, "rtol": 1e-12, "atol": 1e-13}
    events = [Event(lambda t, state: state["p.x"] - 1.0, cuts=True)]

    def loss(t, state):
        return state["p.x"] + 3 * state.rate("p.x") + 2 * state.rate("p.y")

    def value(rates):
        run = robot.simulate(start.with_rates(rates), events=events, **told)
        return float(loss(0.15, robot.observe(run.final)))

    with pytest.raises(LinkworkError, match=r"force of a contact jumps at t = 0\.10.* watch for"):
        robot.gradient(loss, start, **told)
    found = robot.gradient(loss, start, events=events, **told)["rates"]
    for i, aside in enumerate(1e-4 * np.eye(3)[:2]):
        difference = (value(start.rates + aside) - value(start.rates - aside)) / 2e-4
        assert found[i] == pytest.approx(difference, rel=2e-6)


def on_a_block(upper, **more) -> lw.Robot:
    """Return a body that falls by some millimetres on a block."""
    lower = lw.Box(size=(1.0, 1.0, 0.2))
    contact = lw.Contact(
        connects=("ground", "body"), surfaces=(lower, upper), stiffness=2e4, dissipation=0.4, **more
    )
    return lw.Robot(
        lw.Mechanism(
            bodies={"body": lw.Body(mass=0.5, inertia=lw.Inertia(xx=2e-3, yy=3e-3, zz=4e-3))},
            joints={"f": lw.FreeJoint(connects=("ground", "body"))},
            contacts={"c": contact},
            reference={"f.z": 0.135},
        )
    )


def fallen(robot, rates, **own):
    """Return the derivative of a number of the end by the rate along x, and its difference."""

    def loss(t, state):
        return state["f.x"] + 3 * state.rate("f.z") + 0.3 * state.rate("f.wx")

    def value(aside):
        start = robot.home.with_rates(np.add(rates, [aside, 0, 0, 0, 0, 0]))
        run = robot.simulate(start, duration=0.12, **own)
        return float(loss(0.12, robot.observe(run.final)))

    found = robot.gradient(loss, robot.home.with_rates(rates), duration=0.12, **own)
    return found["rates.f.x"], (value(1e-5) - value(-1e-5)) / 2e-5


def test_contacts_that_are_rounded_off_or_begin_within_rounding_do_not_leap():
    """Where the middle of a ball passes a face the gap is rounded off within 1e-15 m, and what
    presses at first is as small as rounding."""
    feet = lw.Points(
        points=tuple((x, y, -0.03) for x in (0.05, -0.05) for y in (0.04, -0.04)), radius=0.005
    )
    for surface in (feet, lw.Capsule(radius=0.03, length=0.1), lw.Box(size=(0.1, 0.08, 0.06))):
        robot = on_a_block(surface, friction=lw.Sliding(coefficient=0.4, rate=1e-2))
        found, difference = fallen(robot, [0.3, 0.1, 0, 0.8, 1.0, 0.5], rtol=1e-10, atol=1e-12)
        assert found == pytest.approx(difference, rel=1e-3, abs=1e-3)


def test_edges_of_boxes_whose_forces_leap_are_refused():
    """Derivatives were 10 % off."""
    robot = on_a_block(lw.Box(size=(0.1, 0.08, 0.06)), edges=True)
    with pytest.raises(LinkworkError, match=r"the force of a contact jumps at t = 0\.0"):
        fallen(robot, [0.3, 0.1, 0, 0.8, 1.0, 0.5])
