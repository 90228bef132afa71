"""Optimal motions against closed solutions and textbook equations, and in the robots' own runs."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import linkwork as lw
from linkwork import design, motions
from linkwork.design import _optimal_motion
from linkwork.design.collocation import MotionMesh
from linkwork.design.motion_points import Closing, MotionPoints
from linkwork.design.motion_search import MotionSearch
from linkwork.ipopt import NoOptimumError

from tests.catalogue import WHOLE, built

MASS, FORCE, WAY = 2.0, 5.0, 0.6


@pytest.fixture(scope="module")
def cart():
    return lw.Robot(
        lw.Mechanism(
            bodies={"cart": lw.Body(mass=MASS, inertia=lw.Inertia(zz=0.1))},
            joints={"slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))},
            actuators=("slide",),
            gravity=(0, 0, -9.81),
        )
    )


@pytest.fixture(scope="module")
def ends(cart):
    return cart.state([0.1]), cart.state([0.1 + WAY])


def test_a_mass_is_driven_bang_bang(cart, ends):
    """T = 2 sqrt(m d / F): full force to the middle, and back."""
    found = design.optimal_motion(
        cart, ends[0], ends[1], motions.ActuatorLimits(force=FORCE), intervals=8
    )
    assert found.duration == pytest.approx(2 * np.sqrt(MASS * WAY / FORCE), rel=1e-6)
    np.testing.assert_allclose(found.forces.values[:4, 0], FORCE, rtol=1e-5)
    np.testing.assert_allclose(found.forces.values[4:, 0], -FORCE, rtol=1e-5)
    assert np.abs(found.missed).max() < 1e-8 and found.stationarity < 1e-7
    assert found.used["force"] == pytest.approx(1.0, rel=1e-6)
    assert "least time, locally optimal on 8 intervals" in repr(found)


def test_a_mass_coasts_at_its_limit_of_speed(cart, ends):
    """T = d / V + m V / F."""
    limits = motions.ActuatorLimits(force=FORCE, speed=0.8)
    found = design.optimal_motion(cart, ends[0], ends[1], limits, intervals=40)
    exact = WAY / 0.8 + MASS * 0.8 / FORCE
    assert exact < found.duration < 1.005 * exact
    assert found.used["speed"] < 1 + 1e-6
    slide = cart.mechanism.joints["slide"].model_copy(update={"limits": lw.Limits(speed=0.8)})
    slow = lw.Robot(cart.mechanism.model_copy(update={"joints": {"slide": slide}}))
    limits = motions.ActuatorLimits(force=FORCE)
    again = design.optimal_motion(slow, *ends, limits, intervals=40)
    assert again.duration == pytest.approx(found.duration, rel=1e-9)
    assert again.used["speed"] == pytest.approx(found.used["speed"], rel=1e-6)


def test_rates_at_the_end_are_told_and_kept(cart, ends):
    """Against sharp dry friction a mass comes to rest within an interval and goes back, which the
    mesh does not see: it ended at its place but for 8e-5 m, with 13 mm/s."""
    rough = lw.Friction(coulomb=2.0, coulomb_rate=1e-6)
    slide = cart.mechanism.joints["slide"].model_copy(update={"friction": rough})
    robot = lw.Robot(cart.mechanism.model_copy(update={"joints": {"slide": slide}}))
    ends = robot.state([0.1]), robot.state([0.1 + WAY])
    limits = motions.ActuatorLimits(force=FORCE)
    with pytest.raises(lw.LinkworkError, match=r"ends at rates off by 0\.013"):
        design.optimal_motion(robot, *ends, limits, intervals=4)
    found = design.optimal_motion(robot, *ends, limits, intervals=40)
    assert found.missed_rates == found.run["joint_rate"].values[-1]
    assert 0 < np.abs(found.missed_rates[0]) < 5e-3
    assert f"its rates by {abs(found.missed_rates[0]):.2g}" in repr(found)


def test_a_mass_moved_with_the_least_effort(cart, ends):
    """The least sum of squares of forces that are constant in intervals: a pseudo-inverse; it tends
    to 12 m^2 d^2 / T^3."""
    N, T = 12, 1.5
    h = T / N
    after = T - h * (np.arange(N) + 0.5)
    A = h / MASS * np.stack([after, np.ones(N)])
    u = np.linalg.pinv(A) @ [WAY, 0]
    limits = motions.ActuatorLimits(force=50.0)
    found = design.optimal_motion(
        cart, ends[0], ends[1], limits, minimise="effort", duration=T, intervals=N
    )
    np.testing.assert_allclose(found.forces.values[:-1, 0], u, rtol=1e-6)
    assert found.cost == pytest.approx(h * u @ u, rel=1e-7)
    assert found.cost == pytest.approx(12 * MASS**2 * WAY**2 / T**3, rel=0.01)
    assert "least effort" in repr(found)


def test_a_pendulum_is_lifted_bang_bang():
    """Energy tells the speed on both arcs, up by tau and down by -tau, and where they meet."""
    robot = built("pendulum")
    q_0, q_1 = 0.0, 2.0
    M = robot.mass_matrix(robot.home)[0, 0]
    tau = 1.3 * np.abs(robot.gravity(robot.state(np.linspace(q_0, q_1, 101)[:, None]))).max()

    def V(q):
        return float(robot.energy(robot.state([q]))[1])

    def time(z, end, sign):  # q = end +- z^2 takes the root out of the integrand
        q = end + sign * z**2
        return 2 * z / np.sqrt(2 * (tau * z**2 - (V(q) - V(end))) / M) if z else 0.0

    turn = (q_0 + q_1) / 2 + (V(q_1) - V(q_0)) / (2 * tau)
    exact = quad(time, 0, np.sqrt(turn - q_0), (q_0, 1))[0]
    exact += quad(time, 0, np.sqrt(q_1 - turn), (q_1, -1))[0]
    limits = motions.ActuatorLimits(force=tau)
    found = design.optimal_motion(robot, robot.state([q_0]), robot.state([q_1]), limits)
    assert exact < found.duration < 1.002 * exact
    assert np.sum(np.abs(found.forces.values[:-1]) < 0.999 * tau) <= 1


def test_a_pole_is_swung_up_by_its_cart():
    """One actuator for two freedoms; the forces are given to textbook equations, too."""
    m, M, half, inertia = 0.3, 1.0, 0.5, 0.01
    pole = lw.Body(mass=m, centre_of_mass=(0, -half, 0), inertia=lw.Inertia(zz=inertia))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"cart": lw.Body(mass=M, inertia=lw.Inertia(zz=0.1)), "pole": pole},
            joints={
                "slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0)),
                "hinge": lw.RevoluteJoint(connects=("cart", "pole")),
            },
            actuators=("slide",),
            gravity=(0, -9.81, 0),
        )
    )
    up = robot.state({"slide": 0.0, "hinge": np.pi})
    limits = motions.ActuatorLimits(force=10.0)
    found = design.optimal_motion(robot, robot.home, up, limits, intervals=40)
    times, values = found.forces.times, found.forces.values[:, 0]

    def rates(_, y, force):
        _, angle, dx, da = y
        A = [[M + m, m * half * np.cos(angle)], [m * half * np.cos(angle), inertia + m * half**2]]
        b = [force + m * half * np.sin(angle) * da**2, -m * 9.81 * half * np.sin(angle)]
        return [dx, da, *np.linalg.solve(A, b)]

    y = np.zeros(4)
    for k in range(40):
        span = times[k : k + 2]
        y = solve_ivp(rates, span, y, args=(values[k],), rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(y, [0, np.pi, 0, 0], atol=1e-3)
    assert np.abs(values).max() <= 10.0 and found.duration < 2.0


@pytest.mark.parametrize("name", ["five_bar", *["delta", "hexaglide"] * WHOLE])
def test_robots_with_loops(name):
    """Faster than the fastest straight way of their joints, with all limits kept in the run."""
    robot = built(name)
    home = robot.tool_pose(robot.home)[: len(robot.actuators)]
    step = np.array([0.1, 0.05, 0.04, 0.1, 0.05, 0.1])[: home.size]
    start, end = robot.assemble(tool=home - step / 2), robot.assemble(tool=home + step)
    limits = motions.ActuatorLimits(
        force={"five_bar": 4.0, "delta": 60.0, "hexaglide": 400.0}[name]
    )
    found = design.optimal_motion(robot, start, end, limits, intervals=12)
    first, last = ({n: float(each[n]) for n in robot.actuators} for each in (start, end))
    path = motions.point_to_point(first, last, motions.AxisLimits(speed=1.0), law="quintic")
    straight = motions.fastest(robot, path, limits)
    assert 0.7 * straight.duration < found.duration < straight.duration
    assert found.run.closure_error < 1e-10 and found.used["force"] < 1 + 1e-9
    assert np.abs(found.missed).max() < 1e-5
    reached = robot.tool_pose(found.run.final)[: home.size]
    np.testing.assert_allclose(reached, home + step, atol=1e-5)


def test_a_search_that_ends_early_says_so():
    """What it returns keeps all limits and is slower; before it kept them it returns nothing."""
    robot = built("five_bar")
    end = robot.assemble(tool=robot.tool_pose(robot.home)[:2] + [0.1, 0.05])  # noqa: RUF005
    limits = motions.ActuatorLimits(force=4.0)
    ends = robot.home, end
    timed = _optimal_motion.straight(robot, ends, limits)

    def search(seconds):
        return MotionSearch(robot, ends, limits, timed, 12, 0.05, seconds)

    guess = search(0.0).guess
    best, own = search(60.0).solved(guess, True)
    with pytest.raises(
        NoOptimumError, match=r"is found in 0 s .*: the constraints are not kept yet"
    ):
        search(0.0).solved(guess, True)
    clock = iter(range(100))
    with pytest.MonkeyPatch.context() as patch:
        for module in ("linkwork.ipopt", "linkwork.design.motion_search"):
            patch.setattr(f"{module}.thread_time", lambda: next(clock))
        found, longer = search(best.steps - 1.0).solved(guess, True)
    assert best.settled and not found.settled and found.steps <= best.steps
    assert own.T * (1 - 1e-6) < longer.T < 1.5 * own.T and found.violation < 1e-6


def test_power_and_acceleration_are_limited():
    robot = built("five_bar")
    end = robot.assemble(tool=robot.tool_pose(robot.home)[:2] + [0.08, 0.02])  # noqa: RUF005
    limits = motions.ActuatorLimits(force=4.0, power=3.0, acceleration=60.0)
    found = design.optimal_motion(robot, robot.home, end, limits, intervals=16)
    assert 0.9 < found.used["power"] < 1.02
    rates = found.run.resampled(16 * 50 + 1)
    slope = np.diff(rates["joint_rate"].values[:, :2], axis=0) / np.diff(rates.time)[:, None]
    assert np.abs(slope).max() < 1.02 * 60.0


def test_limits_between_points_are_told(cart):
    """A mass slows down with the least effort: at the points of the mesh it keeps to its range,
    between them parabolas of its forces lead beyond, and that is told."""
    slide = cart.mechanism.joints["slide"].model_copy(
        update={"limits": lw.Limits(lower=0.06, upper=0.25)}
    )
    robot = lw.Robot(cart.mechanism.model_copy(update={"joints": {"slide": slide}}))
    with pytest.warns(
        lw.errors.ModelWarning, match=r"passes limits by a part: range 10\.\d%; give"
    ):
        found = design.optimal_motion(
            robot,
            robot.state([0.1], [-0.9]),
            robot.state([0.2]),
            motions.ActuatorLimits(force=50.0),
            minimise="effort",
            duration=1.0,
            intervals=4,
        )
    x, v, least = 0.1, -0.9, 0.1
    for force in found.forces.values[:-1, 0]:
        t = np.linspace(0, 0.25, 1001)
        least = min(least, (x + v * t + force / MASS * t**2 / 2).min())
        x, v = x + v * 0.25 + force / MASS * 0.25**2 / 2, v + force / MASS * 0.25
    assert found.used["range"] == pytest.approx((0.155 - least) / 0.095, abs=1e-3)
    assert "range 110.6%" in repr(found)


def test_distances_from_singular_poses_are_told():
    """Those of a five-bar are as the sine between its outer links."""
    robot = built("five_bar")
    end = robot.assemble(tool=robot.tool_pose(robot.home)[:2] + [-0.2, -0.1])  # noqa: RUF005
    limits = motions.ActuatorLimits(force=4.0, acceleration=900.0)
    found = design.optimal_motion(robot, robot.home, end, limits, intervals=6, apart=0.95)
    fine = found.run.resampled(6 * 200 + 1)
    left = np.sin(fine["joint_position"].sel(coordinate="tip").values)
    assert found.used["apart"] == pytest.approx(0.95 * left[0] / left.min(), rel=1e-5)
    assert found.used["apart"] > 1
    w = fine["joint_acceleration"].values[:, :2]
    assert found.used["acceleration"] == pytest.approx(np.abs(w).max() / 900.0, rel=1e-3)


def test_bad_input_is_refused(cart, ends):
    limits = motions.ActuatorLimits(force=FORCE)
    flipped = built("five_bar")
    modes = lw.analysis.assembly_modes(
        flipped, {n: float(flipped.home[n]) for n in flipped.actuators}
    )
    other = modes.states.at(1)  # the nearest one to home comes first
    cases = [
        ((cart, *ends, 5.0), {}, "give motions.ActuatorLimits"),
        ((cart, 0.1, ends[1], limits), {}, "the start is 0.1; give a State"),
        ((cart, ends[0], cart.state([[0.1], [0.2]]), limits), {}, "the end is a stack"),
        ((cart, ends[0], ends[0], limits), {}, "the end is where the start is"),
        ((cart, *ends, limits), {"minimise": "money"}, "give 'time' or 'effort'"),
        ((cart, *ends, limits), {"minimise": "effort"}, "give a duration"),
        ((cart, *ends, limits), {"duration": 2.0}, "none for the least time"),
        ((cart, *ends, limits), {"intervals": 2}, "give 4 to 1000"),
        ((cart, *ends, limits), {"apart": 1.5}, "between 0 and 1"),
        ((cart, *ends, limits), {"guess": "fast"}, "give a timed path"),
        (
            (cart, *ends, limits),
            {"minimise": "effort", "duration": 0.2},
            r"is found in 0\.2 s: the least time that is found is 0\.97979\d s; give a longer",
        ),
        ((flipped, flipped.home, other, limits), {}, "lies between them"),
        ((cart, *ends, motions.ActuatorLimits(force=1.0, jerk=9.0)), {}, "which limits it"),
        ((cart, *ends, motions.ActuatorLimits(force={"slide": 1.0})), {"search_time": 0}, "search"),
        (
            (cart, cart.state([0.1], [0.9]), ends[1], motions.ActuatorLimits(force=1.0, speed=0.5)),
            {},
            r"at the start 'slide' moves at 0\.9, above its limit of speed 0\.5; give a slower",
        ),
        (
            (flipped, flipped.home, flipped.home, motions.ActuatorLimits(force={"motor_1": 4.0})),
            {},
            "nothing limits the actuator 'motor_2'",
        ),
    ]
    for given, more, sentence in cases:
        with pytest.raises(lw.LinkworkError, match=sentence):
            design.optimal_motion(*given, **more)


@pytest.mark.parametrize("name", ["five_bar", "prr3"])
def test_derivatives_at_points_are_those_of_closed_loops(name):
    """Central differences of values and slopes with loops that are closed anew."""
    robot, rng = built(name), np.random.default_rng(5)
    n, m = robot.mobility, len(robot.actuators)
    limits = motions.ActuatorLimits(force=4.0, speed=3.0, power=5.0, acceleration=60.0)
    points = MotionPoints(robot, limits, robot.home, 0.05, np.full(n, 2.0))
    closing = Closing(points, robot.home.q[:, None])
    x = rng.uniform(-1, 1, points.width)
    x[:n] = robot.home.q[points.given] + 0.05 * x[:n]
    weights = rng.uniform(-1, 1, points.value.numel_out())

    def at(f, x, *more):
        return f(closing(x[:n]), x, *more).full()

    slope, bend = at(points.slope, x), at(points.bend, x, weights)
    step = 1e-5 * np.eye(points.width)
    for f, found in ((points.value, slope), (lambda *y: points.slope(*y).T @ weights, bend)):
        moved = [(at(f, x + d) - at(f, x - d)) / 2e-5 for d in step]
        np.testing.assert_allclose(found, np.hstack(moved), atol=1e-7 * np.abs(found).max())
    assert len(slope) > n + 6 * m and np.abs(bend[: 2 * n, :n]).max() > 1e-3


def test_the_order_of_the_mesh():
    """What is zero along a motion falls with the fourth power of the width for an exact one."""
    robot, T, found = built("pendulum"), 0.8, []
    for intervals in (8, 16):
        mesh = MotionMesh(intervals)
        times, place = np.unique(np.round(mesh.nodes * T, 12), return_inverse=True)
        begin = robot.state([0.3])
        run = robot.simulate(begin, [0.2], duration=T, rtol=1e-13, atol=1e-14, save_at=times)
        a, v = run["joint_position"].values[place].T, run["joint_rate"].values[place].T
        w = robot.forward_dynamics(robot.state(a.T, v.T), [0.2]).T[:, mesh.places]
        zero = ca.vertcat(*map(ca.vec, mesh.equations(*map(ca.MX, (a, v, w)), T)))
        found.append(np.abs(ca.evalf(zero).full()).max())
    assert 12 < found[0] / found[1] < 20 and found[1] < 2e-4
