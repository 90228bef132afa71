"""Cranks that turn for long: whole turns are counted apart where nothing reads them, and kept where
something does."""

from __future__ import annotations

from decimal import Decimal, localcontext

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.control import PD, Event, Sampler
from linkwork.kernels.program import trace
from linkwork.model.turning import shares, wrapping
from linkwork.simulation.turns import HIGH, LOW, MIDDLE, SPAN, whole

from tests.equations.evaluation import close

TURN = 2 * np.pi
MANY = {"max_steps": 10**8}
WHEEL = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.5))


def wheel(**joint) -> lw.Robot:
    """Return a wheel on a hinge, of inertia 0.5 kg m^2, without weight."""
    hinge = lw.RevoluteJoint(connects=("ground", "wheel"), **joint)
    return lw.Robot(
        lw.Mechanism(
            bodies={"wheel": WHEEL},
            joints={"hinge": hinge},
            gravity=(0, 0, 0),
            actuators=("hinge",),
        )
    )


@pytest.fixture(scope="module")
def crank():
    return lw.Robot(lw.robots.slider_crank())


def spinning(robot: lw.Robot, rate: float) -> lw.State:
    return robot.home.with_rates(np.full(robot.mobility, rate))


def test_a_turn_is_two_pi_in_three_parts():
    two_pi = Decimal("6.283185307179586476925286766559005768394")
    with localcontext() as context:
        context.prec = 60
        assert abs(Decimal(HIGH) + Decimal(MIDDLE) + Decimal(LOW) - two_pi) < 1e-31
        assert whole(np.array(0.5), np.array(1e6)) == float(two_pi * 10**6 + Decimal("0.5"))
    assert (HIGH * 2**23).is_integer()  # its products with up to 2^27 turns are exact


@pytest.mark.parametrize("make", [lw.robots.slider_crank, lw.robots.four_bar])
def test_a_crank_turns_thousands_of_times(make):
    """No force does work but weight, which is kept: the energy stays; so do the loops."""
    robot = lw.Robot(make())
    run = robot.simulate(
        spinning(robot, 314.0), duration=20.0, save_at=np.linspace(0, 20, 41), rtol=1e-10, **MANY
    )
    assert run.success, run.message
    energy = run.variables["kinetic_energy"].values + run.variables["potential_energy"].values
    close(energy / energy[0], np.ones(41), 1e-5)
    turned = run["joint_position"].values[:, 0] / TURN
    assert turned[-1] > 750 and (np.diff(turned) > 0).all()
    assert run.closure_error < 3e-13
    for row in run["joint_position"].values[
        [20, 40]
    ]:  # rows have their turns, as far as doubles hold them
        assert robot.closure_error(robot.state(row)) < 1e-11


def test_millions_of_turns_at_the_start_change_nothing(crank):
    """The equations are periodic: a run from a million turns is the one from none, moved."""
    k, home = 10.0**6, crank.home.positions
    moved = dict(zip(crank.coordinates, home + TURN * k * np.array([1, -1, 0, 0]), strict=True))
    times = np.linspace(0, 1.0, 11)
    options = {"duration": 1.0, "save_at": times, "rtol": 1e-10, **MANY}
    here = crank.simulate(spinning(crank, 62.8), **options)
    there = crank.simulate(crank.state(moved, [62.8]), **options)
    assert there.success, there.message
    shift = there["joint_position"].values - here["joint_position"].values
    close(shift, np.tile(TURN * k * np.array([1, -1, 0, 0]), (11, 1)), 2e-8)


def test_a_member_turns_as_it_does_alone(crank):
    rates = np.array([[62.8], [-200.0], [31.0], [500.0]])
    times = np.linspace(0, 4, 7)
    stack = crank.make_state(np.tile(crank.home.q, (4, 1)), rates)
    many = crank.ensemble(stack, duration=4.0, save_at=times, rtol=1e-7, **MANY)
    assert many.success
    for i in range(4):
        run = crank.simulate(stack.at(i), duration=4.0, save_at=times, rtol=1e-7, **MANY)
        np.testing.assert_array_equal(
            many.dataset["joint_position"].values[i], run["joint_position"].values
        )
        close(many.final["crank"][i], run["joint_position"].values[-1, 0], 1e-11)


@pytest.mark.parametrize("method", ["sharp_smart", "dormand_prince", "dop853", "rodas", "rk4"])
def test_a_free_wheel_turns_uniformly_for_ten_thousand_turns(method):
    """q = w t, whatever the method, between the steps too, and to the last digit that doubles
    hold."""
    robot, w = wheel(), 2.0e4
    times = np.linspace(0, np.pi, 1001)
    step = {"step": 1e-3} if method == "rk4" else {"max_step": 1e-3}
    run = robot.simulate(
        robot.state([0.25], [w]), duration=np.pi, save_at=times, method=method, **step
    )
    found = run["joint_position"].values[:, 0]
    close(found, 0.25 + w * times, 1e-9)
    assert run.attrs["final_turns"] == pytest.approx(1e4, abs=50)


def test_a_run_goes_on_from_its_end_with_its_turns(crank, tmp_path):
    """Stopped by its steps, saved, loaded and resumed: the last state is that of the run in one
    piece, bit for bit."""
    start, options = spinning(crank, 314.0), {"rtol": 1e-6, "save_at": [3.0]}
    whole_run = crank.simulate(start, duration=3.0, **options)
    part = crank.simulate(start, duration=3.0, rtol=1e-6, max_steps=1500)
    assert part.status is lw.Status.TOO_MANY_STEPS and abs(part.attrs["final_turns"][0]) > 40
    loaded = lw.Run.load(part.save(tmp_path / "part.nc"))
    rest = crank.resume(loaded, duration=3.0 - float(part.attrs["final_time"]), rtol=1e-6)
    for name in ("final_q", "final_turns", "final_v"):
        np.testing.assert_array_equal(rest.attrs[name], whole_run.attrs[name])
    ends = [run["joint_position"].values for run in (part, rest, whole_run)]
    np.testing.assert_array_equal(ends[0][-1], ends[1][0])
    np.testing.assert_array_equal(ends[1][-1], ends[2][-1])


def test_a_spring_keeps_the_turns_that_wind_it_up():
    """A wheel let go 100 turns from the spring's rest swings with that amplitude: q = 200 pi cos(w
    t), w = 2 rad/s."""
    robot = wheel(spring=lw.Spring(stiffness=2.0))
    times = np.linspace(0, 5, 21)
    run = robot.simulate(
        robot.state([100 * TURN]), duration=5.0, save_at=times, rtol=1e-10, atol=1e-10
    )
    close(run["joint_position"].values[:, 0], 100 * TURN * np.cos(2 * times), 1e-5)
    assert "final_turns" not in run.attrs


def test_a_controller_that_reads_an_angle_sees_its_turns():
    """A PD controller pulls a wheel to a goal 300 turns away, critically damped, u = 2 (goal - q) -
    2 q':

    q = goal (1 - (1 + 2 t) e^(-2 t)).
    """
    robot, goal = wheel(), 300 * TURN
    times = np.linspace(0, 4, 9)
    exact = goal * (1 - (1 + 2 * times) * np.exp(-2 * times))

    def law(t, state):
        return [2 * (goal - state["hinge"]) - 2 * state.rate("hinge")]

    for forces in (law, PD({"hinge": goal}, kp=2.0, kd=2.0)):
        run = robot.simulate(robot.home, forces, duration=4.0, save_at=times, rtol=1e-10)
        close(run["joint_position"].values[:, 0], exact, 1e-5)
        assert "final_turns" not in run.attrs
    seen = []

    def watch(t, state):
        seen.append((t, float(state["hinge"])))
        return [0.0]

    run = robot.simulate(robot.state([0.0], [1000.0]), Sampler(watch, 0.01), duration=1.0)
    t, q = np.array(seen).T
    close(q, 1000.0 * t, 1e-9)
    assert run.attrs["final_turns"] > 100


def test_events_see_the_turns():
    """A wheel at w passes its 500th turn at 1000 pi / w, and ends there."""
    robot = wheel()
    passed = Event(lambda t, state: state["hinge"] - 500 * TURN, terminal=True, name="500 turns")
    run = robot.simulate(robot.state([0.0], [400.0]), duration=20.0, events=passed, max_step=0.1)
    assert run.status is lw.Status.EVENT
    assert run.attrs["final_time"] == pytest.approx(500 * TURN / 400.0, rel=1e-13)
    assert run["joint_position"].values[-1, 0] == pytest.approx(500 * TURN, rel=1e-14)


def test_a_geared_crank_closes_as_far_as_doubles_can():
    """q_1 + 2 q_2 = 0 cannot be wrapped: the gear's row is closed to rounding at 10,000 turns."""
    hinges = {f"hinge_{i}": lw.RevoluteJoint(connects=("ground", f"wheel_{i}")) for i in (1, 2)}
    gear = lw.mechanism.GearJoint(ratios={"hinge_1": 1.0, "hinge_2": 2.0})
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"wheel_1": WHEEL, "wheel_2": WHEEL},
            joints={**hinges, "gear": gear},
            actuators=("hinge_1",),
        )
    )
    run = robot.simulate(
        spinning(robot, 2e4), duration=np.pi, save_at=[0.0, 1.0, np.pi], max_step=1e-3
    )
    assert run.success, run.message
    q = run["joint_position"].values
    close(q, np.outer([0.0, 1.0, np.pi], [2e4, -1e4]), 1e-8)
    assert "final_turns" not in run.attrs


def test_angles_are_followed_through_the_graph():
    """q_0 through whole multiples in sines, q_1 through a half, q_2 in a product, q_3 carried to a
    result."""
    q = ca.SX.sym("q", 5)
    read = ca.sin(3 * q[0] - q[3] + 0.25) + ca.cos(q[1] / 2) + q[2] * ca.sin(q[0])
    program = trace(
        ca.Function(
            "f", [q], [read, 2 * (q[3] + 1) - q[0] - q[0], ca.atan2(ca.sin(q[4]), ca.cos(q[4]))]
        )
    )
    found, otherwise = shares(program, [{i: 1.0} for i in range(5)])
    assert otherwise == {1, 2}
    assert found == [{}, {3: 2.0, 0: -2.0}, {}]
    assert shares(program, [{i: 1.0} for i in range(5)], wanted=[1])[1] == set()


def test_only_hinges_without_spring_and_gear_are_wrapped(crank):
    assert dict(zip(crank.equations.tree.coordinates, wrapping(crank.chart), strict=True)) == {
        "crank": 1,
        "pin": 1,
        "slide": 0,
    }
    assert wrapping(wheel(spring=lw.Spring(stiffness=1.0)).chart) == [0]
    assert wrapping(wheel(spring=lw.Spring(damping=1.0), limits=lw.Limits(lower=-1.0)).chart) == [1]


def test_runs_below_the_span_are_those_without_counting(crank):
    """40 turns: up to there nothing is wrapped."""
    run = crank.simulate(spinning(crank, 60.0), duration=3.0)
    assert np.abs(run["joint_position"].values).max() < SPAN
    assert "final_turns" not in run.attrs


@pytest.mark.parametrize("method", ["sharp_smart", "dop853", "rodas", "rk4"])
def test_quaternions_keep_their_length_however_far_a_body_flies(method):
    """A millimetre of a body on a weak spring, which reads where it is, falls 5 m in a second: each
    sample has |p| = 1 to 1e-13, and a member of an ensemble is to the last bit what it is alone."""
    inertia = lw.Inertia(xx=1e-13, yy=2e-13, zz=2.7e-13)
    spring = lw.PointSpring(
        connects=("ground", "mote"), points=((0.1, 0, 0), (0, 0, 0)), stiffness=1e-15
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"mote": lw.Body(mass=1e-6, inertia=inertia)},
            joints={"free": lw.FreeJoint(connects=("ground", "mote"))},
            springs={"thread": spring},
        )
    )
    rates = np.array([[0.3, 1, 2, 9, -5, 7], [0.1, 1, -2, 3, 15, 7]])
    states = robot.state(np.tile(robot.home.positions, (2, 1)), rates)
    asked = {"duration": 1.0, "method": method, "save_at": np.linspace(0, 1, 301)}
    asked |= {"step": 1e-3} if method == "rk4" else {}
    found = robot.ensemble(states, **asked).dataset["joint_position"].values
    assert np.abs(np.linalg.norm(found[..., 3:], axis=-1) - 1).max() < 1.01e-13
    alone = robot.simulate(robot.state(robot.home.positions, rates[1]), **asked)[
        "joint_position"
    ].values
    assert (alone == found[1]).all() and abs(alone[-1, 2]) > 1


def test_quaternions_keep_their_length_however_far_a_body_is():
    """No loop opens by where bodies are that hang together in nothing."""
    sphere = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1e-4, yy=2e-4, zz=3e-4))
    joint = lw.FreeJoint(connects=("ground", "body"))
    free = lw.Mechanism(bodies={"body": sphere}, joints={"free": joint}, gravity=(0, 0, 0))
    robot = lw.Robot(free)
    far = {name: float(robot.home[name]) for name in robot.coordinates} | {"free.y": 100.0}
    robot = lw.Robot(free.model_copy(update={"reference": far}))
    run = robot.simulate(robot.home.with_rates([0, 0, 0, 0.1, 3, 0.2]), duration=10.0)
    assert run.closure_error < 1e-13


def test_slides_and_angles_make_the_closure_looser_once_each():
    """A slide beyond the own length counts over that alone, not once more among the angles."""
    robot = lw.Robot(lw.robots.slider_crank())
    slide = next(x for x in robot.coordinates if robot.unit(x) == "m")
    lengths = abs(float(robot.home[slide])) / robot.equations.tree.length
    turned = [abs(float(robot.home[x])) for x in robot.coordinates if robot.unit(x) == "rad"]
    assert robot.size <= max(1.0, lengths) * max(1.0, *turned) * (1 + 1e-12)
