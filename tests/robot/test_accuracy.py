"""How far a run is from the exact motion: estimates against closed forms and other methods, and
what the message says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw

from tests.catalogue import built
from tests.robot.test_sticking import slide

RTOL, ATOL = 1e-6, 1e-8


def oscillator(stiffness: float = 4.0) -> lw.Robot:
    """Return a mass of 1 kg on a spring: x = cos(w t) from x = 1."""
    slide = lw.PrismaticJoint(connects=("ground", "mass"), spring=lw.Spring(stiffness=stiffness))
    bodies, joints = {"mass": lw.Body(mass=1.0)}, {"slide": slide}
    return lw.Robot(
        lw.Mechanism(bodies=bodies, joints=joints, actuators=("slide",), gravity=(0, 0, 0))
    )


def light_cart() -> lw.Robot:
    """Return a cart of 1 mg with a pole of 1 m and 1 kg at its tip, level at first: the cart darts
    as the pole passes."""
    cart = lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))
    pole = lw.RevoluteJoint(connects=("cart", "pole"))
    bodies = {"cart": lw.Body(mass=1e-6), "pole": lw.Body(mass=1.0, centre_of_mass=(1, 0, 0))}
    return lw.Robot(
        lw.Mechanism(bodies=bodies, joints={"cart": cart, "pole": pole}, gravity=(0, -9.81, 0))
    )


def off(x: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error of states (K, n), relative to atol + rtol |y|."""
    return float((np.abs(x - exact) / (ATOL + RTOL * np.abs(x).max(axis=0))).max())


def states(run: lw.Run) -> np.ndarray:
    return np.hstack([run.variables[name].values for name in ("joint_position", "joint_rate")])


@pytest.mark.parametrize("duration", [1.0, 30.0])
def test_errors_of_an_oscillator_at_every_saved_time(duration):
    robot = oscillator()
    run = robot.simulate(
        robot.state([1.0], [0.0]),
        duration=duration,
        rtol=RTOL,
        atol=ATOL,
        save_at=np.linspace(0, duration, 50),
    )
    t = run.coords["time"].values
    exact = np.stack([np.cos(2 * t), -2 * np.sin(2 * t)], axis=1)
    assert run.error_estimate == pytest.approx(off(states(run), exact), rel=0.3)
    errors = run.global_errors
    found = np.hstack([errors.joint_position.values, errors.joint_rate.values])
    np.testing.assert_allclose(
        found, states(run) - exact, atol=0.3 * np.abs(states(run) - exact).max()
    )
    assert errors.joint_position.dims == ("time", "coordinate")


@pytest.mark.sample(1)
@pytest.mark.parametrize("duration", [2.0, 20.0])
def test_a_chaotic_motion_shows_how_its_errors_grow(duration):
    """Two uniform rods, against Lagrange's equations and another house's method."""
    rod = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=1 / 12))
    joints = {
        "first": lw.RevoluteJoint(connects=("ground", "upper")),
        "second": lw.RevoluteJoint(
            connects=("upper", "lower"), frames=(lw.Frame.planar(1.0), lw.Frame())
        ),
    }
    robot = lw.Robot(
        lw.Mechanism(bodies={"upper": rod, "lower": rod}, joints=joints, gravity=(0, -9.81, 0))
    )

    def slope(t, y):
        a, b, c, d = y[0], y[0] + y[1], y[2], y[2] + y[3]
        M = np.array([[4 / 3, np.cos(b - a) / 2], [np.cos(b - a) / 2, 1 / 3]])
        f = [
            np.sin(b - a) / 2 * d**2 - 9.81 * 1.5 * np.cos(a),
            -np.sin(b - a) / 2 * c**2 - 9.81 * 0.5 * np.cos(b),
        ]
        first, second = np.linalg.solve(M, f)
        return [y[2], y[3], first, second - first]

    run = robot.simulate(
        robot.state([1.0, 0.5], [0.0, 0.0]), duration=duration, rtol=RTOL, atol=ATOL
    )
    t = run.coords["time"].values
    exact = solve_ivp(
        slope, (0, duration), [1.0, 0.5, 0, 0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t
    )
    assert 1 / 3 < run.error_estimate / off(states(run), exact.y.T) < 3
    assert ("tighten them" in run.message) == (run.error_estimate > 1000)


@pytest.mark.parametrize("name", ["prr3", "four_bar", "andrews", "five_bar", "flyball_governor"])
def test_catalogue_robots_against_another_method_at_the_tightest_tolerance(name):
    robot, duration = built(name), {"andrews": 0.02, "flyball_governor": 0.3}.get(name, 1.0)
    state = robot.home.with_rates([0.5]) if name == "four_bar" else robot.home
    forces = np.full(len(robot.actuators), 0.03 if name == "andrews" else 0.3)
    run = robot.simulate(state, forces, duration=duration, rtol=RTOL, atol=ATOL)
    other = "rodas" if name == "flyball_governor" else "dop853"
    exact = robot.simulate(
        state,
        forces,
        duration=duration,
        rtol=1e-11,
        atol=1e-13,
        method=other,
        save_at=run.coords["time"].values,
    )
    tree = robot.equations.tree
    columns = [robot.coordinates.index(label) for label in tree.coordinates]
    columns += [len(robot.coordinates) + robot.rates.index(label) for label in tree.rates]
    true = off(states(run)[:, columns], states(exact)[:, columns])
    assert 1 / 3 < run.error_estimate / true < 10


def test_a_light_cart_that_darts_says_that_it_is_off():
    """At the default tolerance it reached its end and said no more, thousands of times the
    tolerance away."""
    robot = light_cart()
    run = robot.simulate(robot.home, duration=10.0, rtol=1e-6)
    assert run.success
    assert run.error_estimate > 1000
    assert run.message.startswith("The run reached its end at t = 10 s. Its error is about ")
    assert "cart" in run.message
    assert run.dataset.attrs["error_estimate"] == run.error_estimate
    assert run.dataset.attrs["error_estimate_until"] == 10.0
    sound = built("prr3").simulate(built("prr3").home, [1.0, 0, 0], duration=0.3)
    assert sound.message == "The run reached its end at t = 0.3 s."
    assert 0 < sound.error_estimate < 100


@pytest.mark.parametrize(("method", "step"), [("rk4", 0.02), ("symplectic_euler", 1e-3)])
def test_methods_of_a_fixed_step(method, step):
    robot = oscillator()
    run = robot.simulate(
        robot.state([1.0], [0.0]), duration=2.0, method=method, step=step, rtol=RTOL, atol=ATOL
    )
    t = run.coords["time"].values
    exact = np.stack([np.cos(2 * t), -2 * np.sin(2 * t)], axis=1)
    assert run.error_estimate == pytest.approx(off(states(run), exact), rel=0.2)
    assert run.message == "The run reached its end at t = 2 s."


def test_a_fixed_step_that_is_too_long_for_a_bristle_says_so():
    """Sliding, a bristle bends back at up to 1,790 / s. The run ended 28 mm off, and said no
    more."""
    robot = slide(40.0, coulomb=2.0, bristle=lw.Bristle(stiffness=1e4, damping=60.0))
    start, exact = robot.state([0.09]), robot.simulate(robot.state([0.09]), duration=2.0)
    long, short = (
        robot.simulate(start, duration=2.0, method="rk4", step=step) for step in (5e-3, 2e-4)
    )
    assert long.success and abs(long.final["x"] - exact.final["x"]) > 0.02
    assert "for which a step of 0.005 s is too long; take a shorter one" in long.message
    assert abs(short.final["x"] - exact.final["x"]) < 1e-6
    assert short.message == "The run reached its end at t = 2 s."
    members = robot.ensemble(robot.state([[0.09], [0.09]]), duration=2.0, method="rk4", step=5e-3)
    assert members.message(1) == long.message


def test_runs_that_an_event_ends_resumed_ones_and_those_in_several_charts():
    robot = oscillator()
    event = lw.control.Event(lambda t, state: state["slide"] + 0.5, terminal=True)
    ended = robot.simulate(
        robot.state([1.0], [0.0]), duration=9.0, events=[event], rtol=RTOL, atol=ATOL
    )
    assert ended.status is lw.Status.EVENT
    assert 0.01 < ended.error_estimate < 100
    later = robot.resume(ended, duration=3.0, rtol=RTOL, atol=ATOL)
    assert 0.01 < later.error_estimate < 100
    robot = built("prr3")
    none = robot.simulate(robot.home, [5.0, 0, 0], duration=10.0, max_steps=1)
    assert none.steps == 0
    assert np.isnan(none.error_estimate)
    assert not none.global_errors.joint_position.values.any()
    several = robot.simulate(robot.home, [5.0, 0, 0], duration=1.0)
    assert "; from " in several.attrs["charts"]
    assert np.isfinite(several.error_estimate)


def test_sampled_controllers_are_run_again_only_if_they_are_compiled(tmp_path):
    robot, called = oscillator(), []

    def law(t, state):
        called.append(t)
        return [-0.5 * state.rate("slide")]

    start = robot.state([1.0], [0.0])
    compiled = robot.simulate(start, lw.control.Sampler(law, rate=10, compiled=True), duration=1.0)
    assert 0 < compiled.error_estimate < 100
    python = robot.simulate(start, lw.control.Sampler(law, rate=10, compiled=False), duration=1.0)
    calls = len(called)
    assert np.isnan(python.error_estimate)
    with pytest.raises(lw.LinkworkError, match="cannot be run again to find its errors"):
        python.global_errors  # noqa: B018
    assert len(called) == calls
    loaded = lw.Run.load(compiled.save(tmp_path / "run.nc"))
    assert loaded.error_estimate == compiled.error_estimate
    with pytest.raises(lw.LinkworkError, match="it was read from a file"):
        loaded.global_errors  # noqa: B018


@pytest.mark.parametrize("method", [None, "rodas"])
def test_members_of_an_ensemble_have_their_estimates(method):
    robot, n = oscillator(), np.array([1.0, 9.0, 30.0])
    starts = robot.state(n[:, None], np.zeros((3, 1)))
    found = robot.ensemble(starts, duration=10.0, rtol=RTOL, atol=ATOL, method=method)
    exact = np.stack([n * np.cos(20), -2 * n * np.sin(20)], axis=1)
    ends = np.hstack([found.final.q, found.final.rates])
    true = (np.abs(ends - exact) / (ATOL + RTOL * np.abs([n, 0 * n]).T.clip(min=np.abs(ends)))).max(
        axis=1
    )
    np.testing.assert_allclose(found.error_estimate, true, rtol=0.3)


def test_members_that_are_off_say_so_as_their_own_runs_do():
    robot, options = light_cart(), {"duration": 10.0, "rtol": 1e-6}
    start = robot.home
    starts = robot.state(
        np.stack([start.positions] * 2), np.stack([start.rates, 1e-3 + start.rates])
    )
    members = robot.ensemble(starts, **options)
    for i in range(2):
        assert members.message(i) == robot.simulate(starts.at(i), **options).message
        assert "tighten them" in members.message(i)
    assert (members.error_estimate > 0).all()
    fixed = robot.ensemble(starts, duration=0.1, method="rk4", step=1e-3)
    assert fixed.message(1) == "The run reached its end at t = 0.1 s."


def test_a_companion_that_takes_too_many_steps_tells_how_far_it_came(monkeypatch):
    robot = oscillator()
    run = robot.simulate(robot.state([1.0], [0.0]), duration=50.0)
    monkeypatch.setattr("linkwork.runs.accuracy.MOST", 40)
    assert 0 < run.attrs["error_estimate_until"] < 40.0
    errors = run.global_errors.joint_position.values[:, 0]
    reached = run.coords["time"].values <= run.attrs["error_estimate_until"]
    assert np.isfinite(errors[reached]).all()
    assert np.isnan(errors[~reached]).all()
