"""Derivatives of runs whose losses jump or bend at events, where stages of the step that ends there
fall behind it: closed solutions of an oscillator."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import math
from linkwork.control import Event, Sampler
from linkwork.gradients.breaks import STRAY, parts

from tests.gradients.test_runs import CART
from tests.robot.test_bearings import slider_crank
from tests.robot.test_gear_teeth import N, hoist


def hung(a):
    """Return an oscillator of k = 30 N/m and m = 2 kg, its start at 3 m/s, the time at which it is
    at a and the derivative of that by the speed."""
    w = np.sqrt(15.0)
    place = a * w / 3
    return w, np.arcsin(place) / w, -place / 3 / w / np.sqrt(1 - place**2)


ACCURATE = (1e-6, 1e-9, 1e-12)
WAYS = [(None, each) for each in ACCURATE] + [("dormand_prince", 1e-7), ("rodas", 1e-8)]


@pytest.mark.sample(13)
@pytest.mark.parametrize(("method", "rtol"), WAYS)
@pytest.mark.parametrize("a", [0.5, 0.47, 0.3])
def test_a_loss_that_jumps_where_stages_fall_behind_the_event(method, rtol, a):
    """2 up to where x = a, then 5."""
    robot, (_, hit, slope) = lw.Robot(CART), hung(a)
    switch = Event(lambda t, state: state["rail"] - a, cuts=True)
    found = robot.gradient(
        None,
        robot.home.with_rates([3.0]),
        lambda t, state: [-30 * state["rail"]],
        running=lambda t, state: math.where(state["rail"] < a, 2.0, 5.0),
        events=[switch],
        duration=hit + 0.15,
        rtol=rtol,
        atol=rtol / 10,
        **({} if method is None else {"method": method}),
    )
    assert found.value == pytest.approx(2 * hit + 5 * 0.15, rel=30 * rtol + 1e-11)
    assert found["rates.rail"] == pytest.approx(-3 * slope, rel=30 * rtol + 1e-9)


@pytest.mark.sample(12)
@pytest.mark.parametrize(("method", "rtol"), WAYS)
@pytest.mark.parametrize("a", [0.5, 0.47, 0.3])
def test_a_loss_that_bends_where_stages_fall_behind_the_event(method, rtol, a):
    """int max(x - a, 0) dt under x = v0 sin(w t) / w; stiff steps begin farther off a kink."""
    within = 1e-5 if method == "rodas" else 1e-7
    robot, (w, hit, _) = lw.Robot(CART), hung(a)
    switch, ahead = Event(lambda t, state: state["rail"] - a, cuts=True), 0.15
    found = robot.gradient(
        None,
        robot.home.with_rates([3.0]),
        lambda t, state: [-30 * state["rail"]],
        running=lambda t, state: math.where(state["rail"] < a, 0.0, state["rail"] - a),
        events=[switch],
        duration=hit + ahead,
        rtol=rtol,
        atol=rtol / 10,
        **({} if method is None else {"method": method}),
    )
    swing = (np.cos(w * hit) - np.cos(w * (hit + ahead))) / w**2
    assert found.value == pytest.approx(3 * swing - a * ahead, rel=30 * rtol + within)
    assert found["rates.rail"] == pytest.approx(swing, rel=100 * rtol + within)


@pytest.mark.parametrize(("method", "rtol"), WAYS)
def test_a_loss_that_jumps_where_the_run_ends(method, rtol):
    """2 up to where x = a and the run ends."""
    a = 0.5
    robot, (_, hit, slope) = lw.Robot(CART), hung(a)
    found = robot.gradient(
        None,
        robot.home.with_rates([3.0]),
        lambda t, state: [-30 * state["rail"]],
        running=lambda t, state: math.where(state["rail"] < a, 2.0, 5.0),
        events=[Event(lambda t, state: state["rail"] - a, terminal=True, cuts=True)],
        duration=2.0,
        rtol=rtol,
        atol=rtol / 10,
        **({} if method is None else {"method": method}),
    )
    assert found.value == pytest.approx(2 * hit, rel=30 * rtol + 1e-11)
    assert found["rates.rail"] == pytest.approx(2 * slope, rel=30 * rtol + 1e-9)


@pytest.mark.long
@pytest.mark.parametrize("place", [0.764, 0.766, 0.77])
@pytest.mark.parametrize("own", [{}, {"method": "rodas"}])
def test_a_loss_that_jumps_is_that_of_the_times_at_which_it_does(place, own):
    """A joint that turns round under a controller called every 27 ms: stages of a step from such a
    call strayed past the event, which forces do not see. 1 a second is paid below, 2.5 above."""
    robot, period = lw.Robot("rpr3"), 1 / 37
    slides = dict(zip(robot.actuators, (-0.5, 6.2, 3.7), strict=True))

    def hold(t, state):
        return [c - 0.7 * state.rate(x) - 3.6 * (state[x] - 0.52) for x, c in slides.items()]

    found = robot.gradient(
        None,
        robot.home.with_rates([0.73, -0.48, -0.38]),
        Sampler(hold, rate=37.0, delay=2 * period, compiled=True),
        running=lambda t, state: math.where(state["wrist_1"] < place, 1.0, 2.5),
        events=[Event(lambda t, state: state["wrist_1"] - place, cuts=True)],
        duration=0.174,
        **own,
    )
    down, up = found.run.coords["event_time"].values
    assert found.value == pytest.approx(2.5 * 0.174 - 1.5 * (up - down), rel=1e-9)
    told = found.run.sensitivity("event_time", to="rates").event_time.values
    assert found["rates"] == pytest.approx(1.5 * (told[0] - told[1]), rel=1e-5)


@pytest.mark.parametrize("bend", [0.0, 1.0, 1e3, 1e30, np.inf, np.nan])
def test_a_way_to_a_break_has_few_parts_however_much_the_motion_bends(bend):
    """Behind each part as much is left as its stages may stray, or half of the way."""
    found = parts(0.1, 1e-14, bend)
    before = np.concatenate([[0.1], found[:-1]])
    assert 1 < len(found) < 50 and (found >= 1e-14).all()
    stray = np.nan_to_num(STRAY * bend * (before - found) ** 2, nan=0.0)
    assert (found >= np.minimum(before / 2, stray) * (1 - 1e-9)).all()


@pytest.mark.long
def test_a_load_that_a_jump_of_forces_turns_round_does_so_at_its_time():
    """The friction of a slider-crank's bearings has its kinks when the held force jumps, not when
    their loads would pass zero: by differences."""
    robot = slider_crank(rate=1e-2)
    held = lw.Sampled([0.0, 0.05, 0.1, 0.2], np.c_[[3.0, -4.0, 2.0, 1.0]], kind="hold")

    def end(speed: float) -> lw.gradients.LossGradient:
        return robot.gradient(
            lambda t, state: state["main"] + 0.1 * state.rate("main"),
            robot.home.with_rates([speed]),
            held,
            duration=0.15,
            rtol=1e-10,
            atol=1e-12,
        )

    found = end(1.0)
    assert sum("turns round" in name for name in found.run.coords["event"].values) > 2
    slope = (end(1 + 1e-4).value - end(1 - 1e-4).value) / 2e-4
    assert found["rates.main"] == pytest.approx(slope, rel=1e-6)


def test_a_load_that_turns_round_with_a_law_wants_the_law_s_own_event():
    """Torques on a hoist that jump at 0.1 s: the drum's rate is that at first and what they add."""
    robot = hoist(rate=1e-2)
    start = robot.home.with_rates({robot.independent[0]: 300.0})

    def law(t, state):
        return [math.where(t < 0.1, 1.0, -0.5), math.where(t < 0.1, -20.0, -2.0)]

    def loss(t, state):
        return state.rate("drum")

    with pytest.raises(
        lw.LinkworkError, match=r"'mesh: load turns round' at t = 0\.1 s leaps over"
    ):
        robot.gradient(loss, start, law, duration=0.2)
    switch = Event(lambda t, state: t - 0.1, cuts=True)
    found = robot.gradient(loss, start, law, duration=0.2, events=[switch])
    assert found["rates.motor"] == pytest.approx(1 / N, rel=1e-8)


@pytest.mark.sample(15)
@pytest.mark.parametrize("duration", [1.02, 1.05, 1.15, 2.0])
@pytest.mark.parametrize(
    "own", [{}, {"rtol": 1e-6, "atol": 1e-8}, {"method": "dop853"}, {"method": "rodas"}]
)
def test_a_stop_begins_to_press_at_the_beginning_of_a_step(duration, own):
    """A mass of 1 kg that runs with v against a spring of w^2 = 1000 N/m at 1 m: 1 + (v / w)
    sin(w (t - 1 / v)), and back with -v. Where a step ended a little before the stop, the next one
    took its first slope from there: derivatives were up to 7 % off."""
    w = np.sqrt(1e3)
    rail = lw.PrismaticJoint(
        connects=("ground", "mass"),
        axis=(1, 0, 0),
        limits=lw.Limits(upper=1.0),
        stop=lw.Stop(stiffness=1e3, exponent=1),
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"mass": lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))},
            joints={"rail": rail},
            gravity=(0, 0, 0),
        )
    )
    run = robot.simulate(robot.home.with_rates([1.0]), duration=duration, **own)
    told = run.sensitivity(["joint_position", "joint_rate"], to="rates")
    pressed = duration - 1.0
    if pressed < np.pi / w:
        s, c = np.sin(w * pressed), np.cos(w * pressed)
        expected = s / w + c, c - w * s
    else:
        expected = -(duration - 1.0 - np.pi / w) - 1.0, -1.0
    found = told.joint_position.values[-1].item(), told.joint_rate.values[-1].item()
    assert found == pytest.approx(expected, rel=2e-4)
