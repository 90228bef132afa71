"""Kinematics and motions in C beside the robot's own, and the statuses of what cannot be done."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism.task import is_length
from linkwork.robot import Robot

from tests.catalogue import built
from tests.export.compiled import Library
from tests.oracle.scaling import Scale

OK, SINGULAR, NOT_FINITE, NOT_CLOSED, TOO_MANY_STEPS, _, OUT_OF_RANGE = range(7)
KINEMATICS = ["closure", "project", "kinematics", "tool_to_joints"]
BODY = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
FREE = lw.FreeJoint(connects=("ground", "body"))
STEPS = ["start", "step_rk4", "step"]


def library(robot: Robot, folder, functions, **options) -> Library:
    return Library(robot, lw.export.c(robot, functions, **options), folder)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["prr3", "delta", "puma560", "five_bar"])
def test_kinematics_is_that_of_the_robot(name, tmp_path):
    robot = built(name)
    own, random = library(robot, tmp_path, KINEMATICS), np.random.default_rng(3)
    for _ in range(10):
        spread = 0.15 * random.normal(size=robot.mobility) * robot.equations.tree.length
        places = [robot.coordinates.index(each) for each in robot.independent]
        a = robot.home.positions[places] + spread
        try:
            expected = robot.assemble(dict(zip(robot.independent, a, strict=True)))
        except lw.LinkworkError:
            status, [q, *_] = own("kinematics", a, robot.home.q)
            assert status in (NOT_CLOSED, SINGULAR)
            np.testing.assert_array_equal(q, robot.home.q)
            continue
        status, [q, positions, pose] = own("kinematics", a, robot.home.q)
        assert status == OK
        assert own("closure", q)[1][1] < 1e-12
        np.testing.assert_allclose(positions, expected.positions, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(pose, robot.tool_pose(expected), rtol=1e-9, atol=1e-10)
        # And back, from home, on home's working mode.
        x = robot.task_values(expected)
        status, [q, positions] = own("tool_to_joints", x, robot.home.q)
        try:
            expected = robot.assemble(tool=x)
        except lw.LinkworkError:
            assert status in (NOT_CLOSED, SINGULAR)
            continue
        assert status == OK
        np.testing.assert_allclose(positions, expected.positions, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(("name", "L"), [("five_bar", 1e-3), ("delta", 1e-4), ("prr3", 1e6)])
def test_the_tool_is_led_at_any_size(name, L, tmp_path):
    """Whether legs are stretched is told by determinants over their sizes."""
    robot = lw.Robot(Scale(getattr(lw.robots, name)(), L, L).mechanism)
    own, random = library(robot, tmp_path, ["tool_to_joints"]), np.random.default_rng(3)
    home = robot.task_values(robot.home)
    units = np.where([is_length(each) for each in robot.task], robot.equations.tree.length, 1.0)
    for _ in range(5):
        x = home + 0.01 * units * random.normal(size=home.size)
        status, [_, positions] = own("tool_to_joints", x, robot.home.q)
        assert status == OK
        expected = robot.assemble(tool=x).positions
        sizes = [L if robot.unit(label) == "m" else 1.0 for label in robot.coordinates]
        np.testing.assert_allclose(positions / sizes, expected / sizes, rtol=1e-8, atol=1e-9)


def test_what_cannot_be_reached_leaves_the_guess_as_it_is(tmp_path):
    robot = built("five_bar")
    own, home = library(robot, tmp_path, KINEMATICS), robot.home.q
    for name, given, wanted in (
        ("tool_to_joints", [10.0, 0.0], NOT_CLOSED),
        ("tool_to_joints", [np.nan, 0.0], NOT_FINITE),
        ("kinematics", [np.inf, 0.0], NOT_FINITE),
    ):
        status, [q, *_] = own(name, given, home)
        assert status == wanted
        np.testing.assert_array_equal(q, home)
    assert own("project", home + 0.01)[0] == OK
    assert own("project", home + np.nan)[0] == NOT_FINITE


def test_projection_closes_loops_with_the_independent_coordinates_as_they_are(tmp_path):
    robot = built("delta")
    own, q = library(robot, tmp_path, KINEMATICS), robot.home.q + 0.01
    status, [found, gap] = own("project", q)
    assert status == OK and gap[0] < 1e-13
    assert own("closure", found)[1][1] == gap
    np.testing.assert_array_equal(found[:3], q[:3])


def rubbed() -> lw.Robot:
    """Return a slider-crank in space whose ball rubs, so that its quaternion is in the tree."""
    bare = lw.robots.spatial_slider_crank()
    rubbing = {"friction": {"turn": lw.Friction(viscous=1e-3)}}
    ball = bare.joints["ball"].model_copy(update=rubbing)
    return lw.Robot(bare.model_copy(update={"joints": {**bare.joints, "ball": ball}}))


@pytest.mark.parametrize("longer", [1e-9, 1e-6, -1e-4])
def test_projection_closes_loops_from_quaternions_that_are_too_long(longer, tmp_path):
    """Loops that are closed for these are open as soon as their lengths are 1."""
    robot = rubbed()
    own, q = library(robot, tmp_path, ["project"]), robot.home.q.copy()
    q[robot.equations.tree.coordinates.index("ball.qw")] += longer
    status, [found, gap] = own("project", q)
    assert status == OK and gap[0] < 1e-13
    np.testing.assert_allclose(found, robot.home.q, atol=1e-12)


def run(own: Library, robot: Robot, state: lw.State, u, dt: float, steps: int, *tolerances):
    """Return the state after some steps."""
    status, [moving] = own("start", state.q, state.rates)
    assert status == OK
    for _ in range(steps):
        name = "step" if tolerances else "step_rk4"
        assert own(name, u, dt, *tolerances, moving)[0] == OK
    return moving


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["prr3", "delta", "double_pendulum", "four_bar"])
def test_steps_are_those_of_runs(name, tmp_path):
    robot = built(name)
    own, u = library(robot, tmp_path, STEPS), np.linspace(1.0, 2.0, len(robot.actuators))
    state = robot.state(robot.home.positions, np.linspace(0.1, 0.3, robot.mobility))
    fixed = robot.simulate(state, u, duration=0.2, method="rk4", step=0.002).final
    moving = run(own, robot, state, u, 0.002, 100)
    np.testing.assert_allclose(moving.q, fixed.q, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(
        [*moving.w], robot.chart.tree_rates(fixed.q, fixed.rates), rtol=1e-8, atol=1e-10
    )
    assert moving.t == pytest.approx(0.2) and moving.changes == 0
    exact = robot.simulate(state, u, duration=0.2, rtol=1e-11, atol=1e-12).final
    moving = run(own, robot, state, u, 0.05, 4, 1e-10, 1e-11)
    np.testing.assert_allclose(moving.q, exact.q, rtol=1e-8, atol=1e-9)
    assert moving.t == 0.2 and moving.next > 0


def test_charts_change_where_the_own_one_is_singular(tmp_path):
    """A crank that turns on past its dead centres, told by the rate of its slider: the energy is
    kept, the loops stay closed, and so does a run."""
    robot = Robot(lw.robots.slider_crank(), independent=["slide"])
    own = library(robot, tmp_path, [*STEPS, "closure"])
    fast = robot.state(robot.home.positions, {"slide": 3.0})
    energy = sum(robot.energy(fast))
    u = np.zeros(len(robot.actuators))
    for steps, tolerances, close in ((5000, (), 1e-3), (100, (1e-9, 1e-10), 1e-6)):
        moving = run(own, robot, fast, u, 1.0 / steps, steps, *tolerances)
        assert moving.changes >= 20
        assert own("closure", np.array(moving.q))[1][1] < 1e-11
        expected = robot.simulate(fast, u, duration=1.0, rtol=1e-10, atol=1e-11).final
        np.testing.assert_allclose(moving.q, expected.q, rtol=close, atol=close)
        kinetic = robot.kernel("motion_energy")(np.array(moving.q), np.array(moving.w))[0][0]
        potential = robot.energy(robot.make_state(np.array(moving.q), np.zeros(1)))[1]
        assert kinetic + potential == pytest.approx(energy, rel=close)


def three_cranks() -> lw.Robot:
    """Return a bar on three cranks, of which one is too many, all of them soon in a line."""
    body = lw.Body(mass=1.0, centre_of_mass=(0.25, 0.0, 0.0), inertia=lw.Inertia(zz=0.02))

    def pin(first: str, second: str, x: float = 0.0, y: float = 0.0) -> lw.RevoluteJoint:
        frames = (lw.Frame(position=(x, 0.0, 0.0)), lw.Frame(position=(y, 0.0, 0.0)))
        return lw.RevoluteJoint(connects=(first, second), frames=frames)

    joints = {"p": pin("ground", "a"), "r": pin("ground", "c", 1.0), "t": pin("ground", "d", 0.6)}
    joints |= {"q": pin("a", "b", 0.5), "s": pin("b", "c", 1.0, 0.5), "w": pin("b", "d", 0.6, 0.5)}
    reference = {"p": 1.0, "q": -1.0, "r": 1.0, "s": 0.0, "t": 1.0}
    bodies = dict.fromkeys("abcd", body)
    return lw.Robot(
        lw.Mechanism(bodies=bodies, joints=joints, gravity=(0, 0, 0), reference=reference)
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("make", "rate", "duration"), [(lambda: built("rrs3"), 0.0, 0.3), (three_cranks, 4.0, 0.9)]
)
def test_steps_do_not_pass_over_where_branches_meet(make, rate, duration, tmp_path):
    """Long steps, which a loose tolerance allows, would come out behind it in other rates."""
    robot = make()
    start = robot.home.with_rates(np.full(robot.mobility, rate) if rate else robot.home.rates)
    own, nothing = library(robot, tmp_path, STEPS), np.zeros(len(robot.actuators))
    ends = robot.simulate(start, duration=duration)
    assert ends.status is lw.Status.SINGULAR
    for name, dt, tolerances in (("step", duration, (1e-4, 1e-6)), ("step_rk4", 0.02, ())):
        status, [moving] = own("start", start.q, start.rates)
        while status == OK and moving.t < duration:
            status, _ = own(name, nothing, dt, *tolerances, moving)
        assert status == SINGULAR and ends.time[-1] - dt < moving.t < ends.time[-1]


@pytest.mark.long
def test_steps_go_on_close_by_a_singular_pose(tmp_path):
    """Where the smallest singular value of the constraints is 0.4 % of that at home, as a run."""
    robot = built("rrs3")
    start, u = robot.home.with_rates([-0.474, 0.99, -0.264]), [2.521, -0.894, 0.591]
    expected = robot.simulate(start, u, duration=0.41, rtol=1e-10, atol=1e-12).final
    moving = run(library(robot, tmp_path, STEPS), robot, start, u, 0.01, 41, 1e-9, 1e-11)
    np.testing.assert_allclose(moving.q, expected.q, atol=1e-5)


def test_steps_that_cannot_be_made_say_why(tmp_path):
    robot = built("five_bar")
    own, nothing = library(robot, tmp_path, STEPS), np.zeros(2)
    status, [moving] = own("start", robot.home.q, nothing)
    assert status == OK
    before = [*moving.q]
    assert own("step", nothing, -1.0, 1e-6, 1e-6, moving)[0] == OUT_OF_RANGE
    assert own("step", nothing, 1.0, 0.0, 0.0, moving)[0] == OUT_OF_RANGE
    assert own("step", [np.nan, 0.0], 1.0, 1e-6, 1e-6, moving)[0] == NOT_FINITE
    assert own("step_rk4", [np.nan, 0.0], 1.0, moving)[0] == NOT_FINITE
    assert own("step_rk4", nothing, np.inf, moving)[0] == NOT_FINITE
    assert [*moving.q] == before
    assert own("start", robot.home.q, [np.inf, 0.0])[0] == NOT_FINITE
    assert own("step", [1.0, 0.0], 1.0, 0.0, 1e-30, moving)[0] == TOO_MANY_STEPS
    assert 0 < moving.t < 1


def test_bristles_and_free_turns_are_refused_by_name():
    friction = lw.Friction(coulomb=0.1, bristle=lw.Bristle(stiffness=100.0))
    hinge = lw.RevoluteJoint(connects=("ground", "body"), friction=friction)
    robot = lw.Robot(lw.Mechanism(name="arm", bodies={"body": BODY}, joints={"hinge": hinge}))
    assert not {*STEPS} & {*lw.export.c(robot).functions}
    with pytest.raises(lw.LinkworkError, match=r"sticks by bristles.*hinge"):
        lw.export.c(robot, ["step"])
    floating = lw.Robot(lw.Mechanism(name="top", bodies={"body": BODY}, joints={"base": FREE}))
    assert "step" in lw.export.c(floating).functions
    with pytest.raises(lw.LinkworkError, match=r"base.wx, base.wy, base.wz are those of a free"):
        lw.export.c(floating, ["kinematics"])


def test_a_free_body_keeps_its_quaternion_and_momentum(tmp_path):
    parts = {"bodies": {"body": BODY}, "joints": {"base": FREE}}
    robot = Robot(lw.Mechanism(name="top", gravity=(0.0, 0.0, 0.0), **parts))
    state = robot.state(robot.home.positions, [0.1, 0.2, 0.3, 1.0, 2.0, -1.0])
    moving = run(library(robot, tmp_path, STEPS), robot, state, [], 0.1, 20, 1e-10, 1e-11)
    expected = robot.simulate(state, duration=2.0, rtol=1e-11, atol=1e-12).final
    np.testing.assert_allclose(moving.q, expected.q, rtol=1e-8, atol=1e-8)


def bouncing(ceiling: float | None = None, stiffness: float = 1e5) -> Robot:
    """Return a ball of 0.4 kg on a rail, 0.1 m over a floor without losses; under a stop."""
    ends = lw.Stop(upper=ceiling, stiffness=1e5, exponent=1.0) if ceiling else None
    rail = lw.PrismaticJoint(connects=("ground", "body"), axis=(0, 0, 1), stop=ends)
    floor = lw.Contact(
        connects=("ground", "body"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=stiffness,
        exponent=1.0,
    )
    body = lw.Body(mass=0.4, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
    parts = {"bodies": {"body": body}, "joints": {"z": rail}, "contacts": {"floor": floor}}
    return Robot(lw.Mechanism(name="ball", **parts))


def bounced(t: float, h: float, m: float = 0.4, k: float = 1e5, g: float = 9.81) -> float:
    """Return the height of a ball that falls from h, and goes in and out as on a spring."""
    v, w = np.sqrt(2 * g * h), np.sqrt(k / m)
    fall, d = v / g, g / w**2
    A, phase = np.hypot(d, v / w), np.arctan2(v / w, d)
    pressed = 2 * (np.pi - phase) / w
    t = t % (2 * fall + pressed)
    if t < fall:
        return h - g * t**2 / 2
    t -= fall
    return (
        -d + A * np.cos(w * t + phase)
        if t < pressed
        else v * (t - pressed) - g * (t - pressed) ** 2 / 2
    )


@pytest.mark.parametrize("dt", [0.01, 1.0])
def test_a_ball_bounces_as_its_closed_solution_says(dt, tmp_path):
    robot = bouncing()
    own, start = library(robot, tmp_path, STEPS), robot.state([0.3])
    _, [moving] = own("start", start.q, start.rates)
    for _ in range(round(3 / dt)):
        assert own("step", [], dt, 1e-11, 1e-13, moving)[0] == OK
        height = moving.q[0] - 0.1
        assert height == pytest.approx(bounced(moving.t, 0.2), abs=5e-9)
        spring = 1e5 * min(height, 0.0) ** 2 / 2
        energy = 0.4 * (9.81 * height + moving.w[0] ** 2 / 2) + spring
        assert energy == pytest.approx(0.4 * 9.81 * 0.2, abs=1e-8)


def test_a_ball_that_hardly_comes_off_goes_on(tmp_path):
    """Where it comes off its way within a step is less than the rounding of its height."""
    robot = bouncing(stiffness=1e6)
    own, start = library(robot, tmp_path, STEPS), robot.state([0.1 + 1e-12], [-1e-9])
    moving = run(own, robot, start, [], 1e-4, 200, 1e-9, 1e-11)
    period = 2 * np.pi * np.sqrt(0.4 / 1e6)
    sunk = 0.4 * 9.81 / 1e6 * (1 - np.cos(2 * np.pi * moving.t / period))
    assert moving.q[0] == pytest.approx(0.1 - sunk, abs=1e-9)


def test_what_is_struck_in_the_middle_of_a_step_is_struck(tmp_path):
    """A stop that is met between the evaluations of a long step."""
    robot = bouncing(0.1 + 0.45)
    start = robot.state([0.1], [3.0])  # would rise by 0.4587 m
    own = library(robot, tmp_path, STEPS)
    _, [moving] = own("start", start.q, start.rates)
    moving.next = 1.0  # as after a long flight
    assert own("step", [], 0.6, 1e-10, 1e-12, moving)[0] == OK
    run = robot.simulate(start, duration=0.6, rtol=1e-11, atol=1e-13)
    assert moving.q[0] == pytest.approx(run.final.q[0], abs=1e-8)
    assert abs(moving.q[0] - (0.1 + 3.0 * 0.6 - 9.81 * 0.18)) > 0.01


@pytest.mark.sample(1)
@pytest.mark.parametrize("precision", ["double", "float"])
def test_a_linkage_strikes_its_stops_as_in_runs(precision, tmp_path):
    """A four-bar that swings to and fro between stops."""
    mechanism = lw.robots.four_bar()
    crank = mechanism.actuators[0]
    home = Robot(mechanism).home
    ends = lw.Stop(
        lower=float(home[crank]) - 0.3,
        upper=float(home[crank]) + 0.4,
        stiffness=2e3,
        dissipation=0.3,
    )
    joints = {**mechanism.joints, crank: mechanism.joints[crank].model_copy(update={"stop": ends})}
    robot = Robot(mechanism.model_copy(update={"joints": joints}))
    own = library(robot, tmp_path, STEPS, precision=precision)
    start, u = robot.home.with_rates({crank: 6.0}), np.zeros(1)
    small = precision == "float"
    moving = run(own, robot, start, u, 0.1, 10, *((1e-5, 1e-6) if small else (1e-10, 1e-12)))
    options = {"duration": 1.0, "rtol": 1e-11, "atol": 1e-13}
    found = robot.simulate(start, u, **options)
    assert found.dataset.sizes["event"] >= 4
    np.testing.assert_allclose(moving.q, found.final.q, atol=2e-2 if small else 1e-8)
