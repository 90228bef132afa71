"""The fastest law along a path: against closed bang-bang solutions and a linear programme."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, linprog
from scipy.sparse import lil_matrix

import linkwork as lw
from linkwork import LinkworkError, motions, paths
from linkwork.motions import _fastest

from tests.catalogue import built

ANY = motions.AxisLimits(speed=1.0)
MASS, WAY, FORCE = 2.0, 3.0, 4.0


def slide(**joint):
    """Return a mass on a rail."""
    return lw.Robot(
        lw.Mechanism(
            name="slide",
            gravity=(0, 0, 0),
            bodies={"b": lw.Body(mass=MASS)},
            joints={"x": lw.PrismaticJoint(connects=("ground", "b"), axis=(1, 0, 0), **joint)},
            actuators=("x",),
        )
    )


def duration(robot, start, end, points=401, **limits):
    timed = motions.point_to_point(start, end, ANY, law="quintic")
    return motions.fastest(robot, timed, motions.ActuatorLimits(**limits), points=points).duration


@pytest.fixture(scope="module")
def rail():
    return slide()


@pytest.mark.long
def test_a_slide_is_driven_bang_bang_and_coasts_at_its_speed_limit(rail):
    way = {"x": 0.0}, {"x": WAY}
    assert duration(rail, *way, force=FORCE) == pytest.approx(
        2 * np.sqrt(WAY * MASS / FORCE), rel=1e-13
    )
    coasting = WAY / 1.5 + 1.5 * MASS / FORCE
    assert duration(rail, *way, force=FORCE, speed=1.5) == pytest.approx(coasting, rel=2e-5)
    assert duration(rail, *way, acceleration=2.0) == pytest.approx(2 * np.sqrt(WAY / 2), rel=1e-13)


SMOOTH = motions.AxisLimits(speed=1.0, acceleration=2.0, jerk=9.0)


@pytest.mark.long
def test_paths_that_begin_and_end_at_rest_by_their_own_time_are_led_as_others(rail):
    """Their parameter is the time of an S-curve, whose first two derivatives vanish there."""
    path = motions.blended([{"x": 0.0}, {"x": WAY}], SMOOTH)
    quick = motions.fastest(rail, path, motions.ActuatorLimits(force=FORCE))
    assert quick.duration == pytest.approx(2 * np.sqrt(WAY * MASS / FORCE), rel=1e-12)
    at = np.array([0.25, 0.5, 0.75]) * quick.duration
    expected = [WAY / 8, WAY / 2, 7 * WAY / 8]
    assert quick.sample(at)[0][:, 0] == pytest.approx(expected, rel=1e-9)
    assert motions.follow(rail, quick).positions[-1] == pytest.approx([WAY], rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("blend", [0.3, 0.5])
def test_a_blended_cycle_is_run_through_at_the_limits_of_two_slides(blend):
    """Its way is the same, and the forces are known from differences of the places."""
    robot = crossed()
    points = [{"x": 0.0, "y": 0.0}, {"x": 0.6, "y": 0.0}]
    path = motions.pick_and_place(*points, lift={"y": 0.2}, limits=SMOOTH, blend=blend)
    quick = motions.fastest(robot, path, motions.ActuatorLimits(force=FORCE))
    t, h = np.linspace(0, quick.duration, 4001, retstep=True)
    x, v, _ = quick.sample(t)
    force = np.array([2 * MASS, MASS]) * np.diff(x, 2, axis=0) / h**2
    reached = np.abs(force).max(axis=1) / FORCE
    assert reached.max() <= 1 + 1e-3 and np.median(reached) > 0.9
    assert np.gradient(x, h, axis=0)[1:-1] == pytest.approx(v[1:-1], abs=5e-3)
    places = path.sample(np.linspace(0, path.duration, 20001))[0]
    off = [np.linalg.norm(places - place, axis=1).min() for place in x[::200]]
    assert max(off) < 1e-4


@pytest.mark.long
def test_corners_that_a_grid_does_not_tell_are_refused_and_told_by_a_finer_one():
    robot, force = crossed(), motions.ActuatorLimits(force=FORCE)
    points = [{"x": 0.0, "y": 0.0}, {"x": 0.6, "y": 0.0}]
    path = motions.pick_and_place(*points, lift={"y": 0.2}, limits=SMOOTH, blend=0.2)
    with pytest.raises(LinkworkError, match="within a few points of the grid, more points"):
        motions.fastest(robot, path, force, points=101)
    assert motions.fastest(robot, path, force, points=1601).duration < path.duration


def crossed():
    """Return a mass on a rail that is carried along another one by a mass alike."""
    body = lw.Body(mass=MASS)
    return lw.Robot(
        lw.Mechanism(
            gravity=(0, 0, 0),
            bodies={"bridge": body, "head": body},
            joints={
                "x": lw.PrismaticJoint(connects=("ground", "bridge"), axis=(1, 0, 0)),
                "y": lw.PrismaticJoint(connects=("bridge", "head"), axis=(0, 1, 0)),
            },
            actuators=("x", "y"),
        )
    )


def test_a_path_that_rests_at_its_corners_is_refused_by_their_place():
    points = [{"x": 0.0, "y": 0.0}, {"x": 0.6, "y": 0.0}, {"x": 0.6, "y": 0.6}]
    path = motions.blended(points, SMOOTH, blend=0.0)
    with pytest.raises(LinkworkError, match=r"the path rests at s = 0\.5; give its parts one by"):
        motions.fastest(crossed(), path, motions.ActuatorLimits(force=FORCE))


@pytest.mark.long
def test_the_description_limits_the_speed():
    """What is given goes before it, and `follow` refuses what passes it."""
    robot, way = slide(limits={"speed": 1.5}), ({"x": 0.0}, {"x": WAY})
    for given, speed in (({}, 1.5), ({"speed": 1.0}, 1.0), ({"speed": {"x": 2.0}}, 2.0)):
        coasting = WAY / speed + speed * MASS / FORCE
        assert duration(robot, *way, force=FORCE, **given) == pytest.approx(coasting, rel=2e-5)
    timed = motions.point_to_point(*way, ANY, law="quintic")
    quick = motions.fastest(robot, timed, motions.ActuatorLimits(force=FORCE))
    assert motions.follow(robot, quick, samples=777).joint_rates.max() <= 1.5 * (1 + 1e-9)
    faster = motions.fastest(robot, timed, motions.ActuatorLimits(force=FORCE, speed=2.0))
    with pytest.raises(
        LinkworkError, match=r"^x is above its limit of speed 1\.5 from .*more time"
    ):
        motions.follow(robot, faster)
    motions.follow(robot, faster, keep_limits=False)


def test_a_passive_joint_keeps_to_its_limit_of_speed():
    """Two wheels, the second 3 times as fast by a gear: the first coasts at a third of its
    limit."""
    wheel = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.5))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"a": wheel, "b": wheel},
            joints={
                "x": lw.RevoluteJoint(connects=("ground", "a")),
                "y": lw.RevoluteJoint(connects=("ground", "b"), limits={"speed": 1.5}),
                "gear": lw.GearJoint(ratios={"y": 1, "x": -3}),
            },
            actuators=("x",),
        )
    )
    inertia, speed = 0.5 + 9 * 0.5, 0.5
    coasting = WAY / speed + speed * inertia / FORCE
    assert duration(robot, {"x": 0.0}, {"x": WAY}, force=FORCE) == pytest.approx(coasting, rel=2e-5)


@pytest.mark.long
def test_a_slide_at_constant_power(rail):
    """m v dv/dt = P from v_1 = P / F on: way m (v^3 - v_1^3) / 3 P, time m (v^2 - v_1^2) / 2 P."""
    power, way = 3.0, ({"x": 0.0}, {"x": WAY})
    v_1 = power / FORCE
    gone = MASS * v_1**2 / (2 * FORCE)
    top = (3 * power * (WAY / 2 - gone) / MASS + v_1**3) ** (1 / 3)
    exact = 2 * (MASS * v_1 / FORCE + MASS * (top**2 - v_1**2) / (2 * power))
    found = [duration(rail, *way, points, force=FORCE, power=power) for points in (401, 801)]
    assert found[1] == pytest.approx(exact, rel=1e-3)
    assert 2 * found[1] - found[0] == pytest.approx(exact, rel=1e-4)


@pytest.mark.long
def test_viscous_friction_is_counted():
    drag = 1.5
    robot = slide(friction=lw.Friction(viscous=drag))
    rate, top = drag / MASS, FORCE / drag

    def gone(t):  # from rest under F, then from there under -F: way, and time in all
        v = top * (1 - np.exp(-rate * t))
        braked = np.log(1 + v / top) / rate
        return top * t - v / rate + v / rate - top * braked, t + braked

    exact = gone(brentq(lambda t: gone(t)[0] - WAY, 0.1, 9))[1]
    ends = {"x": 0.0}, {"x": WAY}
    first, second, third = (duration(robot, *ends, n, force=FORCE) for n in (201, 401, 801))
    assert exact < third < second < first
    # What is left falls geometrically (Aitken).
    last = third - (second - third) ** 2 / (first - 2 * second + third)
    assert last == pytest.approx(exact, rel=2e-4)


@pytest.mark.long
@pytest.mark.parametrize(
    ("path", "force", "static", "jerk"),
    [
        (paths.circle([0.15, 0.4], 0.06), 3.2, None, None),
        (paths.line([0.1, 0.4], [0.2, 0.37]), 0.3, 0.2, None),
        (paths.circle([0.15, 0.4], 0.06), 3.2, 0.2, 2e4),
    ],
    ids=["a circle", "a line", "limited jerk"],
)
def test_sharp_friction_keeps_the_limits_between_points(path, force, static, jerk):
    """Its sign changes within an interval of the grid, or it breaks loose at an end: forces were up
    to 5 % beyond."""
    described = built("five_bar").mechanism
    friction = lw.Friction(
        coulomb=0.15 * force, static=static and static * force, coulomb_rate=0.002
    )
    joints = {
        name: joint.model_copy(update={"friction": friction})
        if name in described.actuators
        else joint
        for name, joint in described.joints.items()
    }
    robot = lw.Robot(described.model_copy(update={"joints": joints}))
    limits = motions.ActuatorLimits(force=force, jerk=jerk)
    timed = motions.fastest(robot, path, limits, points=201 if jerk else 101)
    led = motions.follow(robot, timed, samples=8001)
    used = np.abs(robot.inverse_dynamics(led).values).max() / force
    assert (0.95 if jerk else 0.999) < used <= 1 + 1e-6


def test_a_pendulum_is_swung_up_bang_bang():
    """Energy tells the speed on both arcs: tau (q - q_0) - (V - V_0) up, tau (q_1 - q) + (V_1 - V)
    before the end; they meet where these are equal."""
    robot = built("pendulum")
    (joint,), q_0, q_1 = robot.coordinates, 0.0, 2.0
    M = robot.mass_matrix(robot.home)[0, 0]
    weight = robot.gravity(robot.state(np.linspace(q_0, q_1, 101)[:, None]))
    tau = 1.3 * np.abs(weight).max()

    def V(q):
        return float(robot.energy(robot.state([q]))[1])

    turn = (q_0 + q_1) / 2 + (V(q_1) - V(q_0)) / (2 * tau)

    def time(z, end, sign):  # q = end +- z^2 takes the root out of the integrand
        q = end + sign * z**2
        energy = tau * z**2 - (V(q) - V(end))
        return 2 * z / np.sqrt(2 * energy / M) if z else 0.0

    exact = quad(time, 0, np.sqrt(turn - q_0), (q_0, 1))[0]
    exact += quad(time, 0, np.sqrt(q_1 - turn), (q_1, -1))[0]
    found = [duration(robot, {joint: q_0}, {joint: q_1}, n, force=tau) for n in (401, 801)]
    assert exact < found[1] < found[0]
    assert 2 * found[1] - found[0] == pytest.approx(exact, rel=5e-5)


WAYS = {
    "circle": paths.together(paths.circle([0.48, 0.3], 0.04), paths.swing(1.2, 0.2)),
    "spline": motions.through([[0.48, 0.3, 1.2], [0.5, 0.31, 1.3], [0.48, 0.29, 1.1]], ANY),
}
CORNERED = motions.through(
    [[-0.09, 0.24, -0.87], [0.14, 0.18, -0.86], [-0.03, -0.06, -0.9], [-0.01, -0.13, -0.88]], ANY
)  # whose forces have corners at its points, by 3.5 parts in 1,000 beyond what the grid sees


@pytest.mark.parametrize("way", WAYS)
def test_a_linear_programme_finds_nothing_faster(way, monkeypatch):
    """Of its own coefficients, M v_s and M v_ss + C v_s, and solved for all points at once; limits
    between the points, which it does not see, cost a thousandth."""
    robot, N, U, V = built("prr3"), 80, 5.0, 0.4
    path = WAYS[way]
    limits = motions.ActuatorLimits(force=U, speed=V)
    kept = motions.fastest(robot, path, limits, points=N + 1)
    monkeypatch.setattr(_fastest, "PASSED", np.inf)
    timed = motions.fastest(robot, path, limits, points=N + 1)
    assert timed.duration < kept.duration < 1.002 * timed.duration
    curve = path.path.curve if way == "spline" else path.curve
    motion = robot.follow(paths.Path(curve, paths.uniform), 1.0, samples=N + 1)
    M, v_s = robot.mass_matrix(motion.state), motion.rates
    alpha = np.einsum("kij,kj->ki", M, v_s)
    beta = np.einsum("kij,kj->ki", M, motion.accelerations) + robot.coriolis(motion.state)
    gamma = robot.gravity(motion.state)
    rows, most = lil_matrix((12 * N, N + 1)), []
    for i in range(N):
        for k in (i, i + 1):
            for sign in (1, -1):
                for j in range(3):  # s'' = (x_i+1 - x_i) N / 2
                    row = len(most)
                    rows[row, i] -= sign * alpha[k, j] * N / 2
                    rows[row, i + 1] += sign * alpha[k, j] * N / 2
                    rows[row, k] += sign * beta[k, j]
                    most.append(U - sign * gamma[k, j])
    with np.errstate(divide="ignore"):
        top = ((V / np.abs(v_s)) ** 2).min(axis=1)
    ends = [0, N] if way == "circle" else []
    bounds = [(0, 0 if k in ends else bound) for k, bound in enumerate(top)]
    solved = linprog(-np.ones(N + 1), A_ub=rows.tocsr(), b_ub=most, bounds=bounds)
    rate = np.sqrt(solved.x)
    assert timed.duration == pytest.approx((2 / N / (rate[1:] + rate[:-1])).sum(), rel=1e-5)


@pytest.mark.long
def test_limits_hold_along_the_whole_motion_and_one_of_them_is_reached():
    robot = built("prr3")
    limits = motions.ActuatorLimits(force=5.0, speed=0.5, power=1.0, acceleration=[20.0] * 3)
    timed = motions.fastest(robot, WAYS["circle"], limits)
    motion = motions.follow(robot, timed, samples=1501)
    u = robot.inverse_dynamics(motion).values
    used = np.max(
        [
            np.abs(u) / 5.0,
            np.abs(motion.rates) / 0.5,
            np.abs(u * motion.rates) / 1.0,
            np.abs(motion.accelerations) / 20.0,
        ],
        axis=(0, 2),
    )
    assert used.max() < 1 + 1e-9
    assert np.median(used) > 0.99
    assert np.abs(motion.rates[[0, -1]]).max() < 1e-9


NEAR = [[0.15, 0.445], [0.16, 0.45], [0.151, 0.44], [0.155, 0.455]]  # turned sharply through


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("name", "path", "limits"),
    [
        ("prr3", paths.circle([0.5, 0.288], 0.05, np.pi / 6), {"force": 20.0, "speed": 1.0}),
        ("prr3", WAYS["circle"], {"force": 5.0, "speed": 0.5, "power": 1.0}),
        ("delta", paths.line([-0.3, -0.1, -0.9], [0.3, 0.2, -0.8]), {"force": 40.0}),
        ("delta", CORNERED, {"force": 40.0}),
        ("five_bar", paths.through(NEAR), {"force": 9.2, "power": 0.486}),
    ],
)
def test_no_limit_is_passed_between_the_points_of_the_grid(name, path, limits):
    """At times that are far denser than the grid, by up to 2 parts in 1,000 otherwise."""
    robot = built(name)
    timed = motions.fastest(robot, path, motions.ActuatorLimits(**limits), points=101)
    motion = motions.follow(robot, timed, samples=3001)
    u = robot.inverse_dynamics(motion).values
    used = {"force": u, "speed": motion.rates, "power": u * motion.rates}
    most = [np.abs(used[kind]).max() / limit for kind, limit in limits.items()]
    assert 0.999 < max(most) <= 1 + 1e-9


def test_a_mass_is_lifted_by_little_power():
    robot = lw.Robot(slide().mechanism.model_copy(update={"gravity": (-9.81, 0, 0)}))
    found = duration(robot, {"x": 0.0}, {"x": 1.0}, force=40.0, power=2.0)
    assert found == pytest.approx(MASS * 9.81 / 2.0, rel=1e-2)  # hardly any energy moves it


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda r: motions.fastest(r, WAYS["circle"], 5.0), "the limits are 5.0"),
        (lambda r: motions.ActuatorLimits(), "no limit is given"),
        (lambda r: motions.ActuatorLimits(force=0), "the force limit is 0"),
        (lambda r: motions.ActuatorLimits(force={"a": np.nan}), "the force limit is nan"),
        (
            lambda r: motions.fastest(r, WAYS["circle"], motions.ActuatorLimits(force=[1, 2])),
            "one for each of slide_1, slide_2, slide_3",
        ),
        (
            lambda r: motions.fastest(r, WAYS["circle"], motions.ActuatorLimits(force={"a": 1})),
            "no actuator 'a' with a force limit",
        ),
        (
            lambda r: motions.fastest(r, WAYS["circle"], motions.ActuatorLimits(power=1.0)),
            "a power alone",
        ),
        (
            lambda r: motions.fastest(r, WAYS["circle"], motions.ActuatorLimits(force=1), points=2),
            "the number of samples is 2; give 3 to",
        ),
        (
            lambda r: motions.fastest(
                built("delta"),
                paths.line([0, 0, -0.9], [0.1, 0, -0.9]),
                motions.ActuatorLimits(force=1e-3),
            ),
            r"at s = .* of the path \(of 1\) the actuator .* needs .* to hold the robot still",
        ),
        (
            lambda r: motions.fastest(
                r,
                motions.point_to_point(r.home, {"slide_1": 0.2}, ANY, law="quintic"),
                motions.ActuatorLimits(speed={"slide_2": 1.0}),
            ),
            "nothing limits its speed",
        ),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call(built("prr3"))
