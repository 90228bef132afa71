"""Ready controllers against closed forms: second-order responses, exact error dynamics, balance,
steady errors, Riccati."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import (
    LQR,
    PD,
    PID,
    ComputedTorque,
    PDWithGravity,
    Sampler,
    SlidingMode,
    Wrench,
)
from linkwork.control.inverse_dynamics import InverseDynamics as Model

from tests.control.plants import cart, circle_motion, pendulum

TIMES = np.linspace(0, 2, 41)


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.prr3())


def second_order(t, x, rate, kp, kd):
    """Return x(t) of x'' + kd x' + kp x = 0."""
    roots = np.roots([1, kd, kp]).astype(complex)
    weights = np.linalg.solve(np.vstack([[1, 1], roots]), [x, rate])
    return np.real(np.exp(np.outer(t, roots)) @ weights)


@pytest.mark.parametrize(
    "goal", [{"slide": 0.4}, "state", lw.Sampled([0, 2], [0.4, 0.4], "linear")]
)
def test_pd_on_a_mass_is_a_second_order_response(goal):
    plant = cart(mass=2.0)
    goal = plant.state([0.4]) if goal == "state" else goal
    run = plant.simulate(
        plant.state([0.1], [0.5]), PD(goal, 18.0, 4.0), duration=2.0, save_at=TIMES
    )
    expected = 0.4 + second_order(TIMES, -0.3, 0.5, 9.0, 2.0)
    assert np.allclose(run["joint_position"].values[:, 0], expected, 0, 1e-7)


def test_gains_are_parameters_by_name_or_by_actuator(robot):
    goal = robot.assemble(tool=[0.51, 0.28, 0.5])
    one = robot.simulate(
        robot.home, PD(goal, 300.0, 30.0), duration=0.5, save_at=[0, 0.5], parameters={"kp": 500.0}
    )
    each = {name: 500.0 for name in robot.actuators}
    other = robot.simulate(robot.home, PD(goal, each, 30.0), duration=0.5, save_at=[0, 0.5])
    assert np.allclose(one["tool_pose"], other["tool_pose"], 0, 1e-12)
    changed = robot.simulate(
        robot.home,
        PD(goal, each, 30.0),
        duration=0.5,
        save_at=[0, 0.5],
        parameters={"kp.slide_2": 100.0},
    )
    assert np.abs(changed["tool_pose"][-1] - other["tool_pose"][-1]).max() > 1e-4


def test_gravity_compensation_leaves_no_steady_error():
    plant = pendulum()
    goal = {"hinge_1": 0.6}
    bare = plant.simulate(plant.home, PD(goal, 40.0, 8.0), duration=15.0, save_at=[15.0])
    held = plant.simulate(
        plant.home, PDWithGravity(goal, 40.0, 8.0, model=plant), duration=15.0, save_at=[15.0]
    )
    (bare,), (held,) = (run["joint_position"].values[-1] for run in (bare, held))
    weight = 1.5 * 9.81 * 0.7
    assert abs(held - 0.6) < 1e-6
    assert abs(40 * (0.6 - bare) - weight * np.cos(bare)) < 1e-5 and abs(bare - 0.6) > 0.1


def test_gravity_compensation_of_a_platform():
    robot = lw.Robot(lw.robots.delta())
    model = Model(robot)
    state = robot.assemble(tool=robot.tool_pose(robot.home)[:3] + np.array([0.05, 0.02, -0.03]))
    found = model.forces(
        robot.observe(state.with_rates(1.0 + 0 * state.rates)), np.zeros(3), still=True
    )
    assert np.allclose(found, robot.inverse_dynamics(state, 0 * state.rates), 1e-9, 1e-9)


def test_pid_leaves_no_steady_error_under_a_constant_wrench():
    plant = cart(mass=2.0)
    law = PID({"slide": 0.1}, 60.0, 20.0, ki=40.0, joints=("slide",))
    push = Wrench("cart", force=[-5.0, 0, 0])
    run = plant.simulate(plant.home, law, duration=20.0, wrenches=[push], save_at=[0, 20.0])
    assert abs(run["joint_position"].values[-1, 0] - 0.1) < 1e-7
    assert np.isclose(run["drive_state"].sel(extra="integral.slide").values[-1], 5.0 / 40.0, 1e-6)


def test_computed_torque_gives_the_error_dynamics_exactly(robot):
    """With the exact model e'' + kd e' + kp e = 0 in every actuated joint: its closed form to
    1e-8."""
    motion = circle_motion(robot)
    law = ComputedTorque(motion, 100.0, 12.0, robot)
    start = robot.assemble(
        {
            name: motion.state.at(0)[name] + d
            for name, d in zip(robot.actuators, (0.01, -0.02, 0.015), strict=True)
        }
    )
    start = start.with_rates([0.1, -0.1, 0.05])
    save = np.linspace(0, 1, 51)
    run = robot.simulate(start, law, duration=1.0, save_at=save, rtol=1e-11, atol=1e-12)
    course = lw.Sampled(motion.time, motion.positions[:, :3])
    e = course(save) - run["joint_position"].values[:, :3]
    de = course.derivative()(save) - run["joint_rate"].values[:, :3]
    expected = np.stack(
        [second_order(save, e[0, i], de[0, i], 100.0, 12.0) for i in range(3)], axis=1
    )
    assert np.abs(e - expected).max() < 1e-8


def test_computed_torque_with_too_few_actuators():
    """The driven joint of a double pendulum obeys its error dynamics, whatever the free one
    does."""
    mechanism = lw.robots.double_pendulum().model_copy(update={"actuators": ("hinge_1",)})
    robot = lw.Robot(mechanism)
    law = ComputedTorque({"hinge_1": -1.0}, 29.0, 10.0, robot)
    run = robot.simulate(robot.home, law, duration=1.0, save_at=np.linspace(0, 1, 21), rtol=1e-10)
    expected = -1.0 + second_order(np.linspace(0, 1, 21), 1.0, 0.0, 29.0, 10.0)
    assert np.allclose(run["joint_position"].sel(coordinate="hinge_1"), expected, 0, 1e-7)


def test_computed_torque_with_too_many_actuators():
    """All six joints of a 3-RRR-like plane mechanism driven: least forces, the same error
    dynamics."""
    mechanism = lw.robots.prr3()
    robot = lw.Robot(mechanism.model_copy(update={"actuators": (*mechanism.actuators, "pivot_1")}))
    goal = {name: float(robot.home[name]) for name in robot.actuators}
    start = robot.assemble(tool=[0.505, 0.29, 0.53])
    law = ComputedTorque(goal, 100.0, 16.0, robot)
    save = np.linspace(0, 1, 11)
    run = robot.simulate(start, law, duration=1.0, save_at=save, rtol=1e-10)
    names = list(robot.independent)
    e = run["joint_position"].sel(coordinate=names).values - [goal[name] for name in names]
    expected = np.stack([second_order(save, e[0, i], 0.0, 100.0, 16.0) for i in range(3)], axis=1)
    assert np.abs(e - expected).max() < 1e-8
    assert not np.allclose(run["actuator_force"].sel(actuator="pivot_1").values, 0)


def test_sliding_mode_bears_a_wrong_model(robot):
    """With a platform lighter by a third the error stays within the boundary layer's bound;
    computed torque's does not."""
    motion = circle_motion(robot)
    wrong = lw.Robot(lw.robots.prr3(platform_mass=0.9))
    start = motion.state.at(0)
    slope, boundary = 30.0, 0.02
    run = robot.simulate(
        start, SlidingMode(motion, slope, 20.0, boundary, wrong), duration=1.0, save_at=motion.time
    )
    e = np.abs(run["joint_position"].values - motion.positions)[:, :3].max()
    assert e < boundary / slope  # |s| <= boundary gives |e| <= boundary / slope
    soft = robot.simulate(
        start, ComputedTorque(motion, 30.0, 10.0, wrong), duration=1.0, save_at=motion.time
    )
    assert np.abs(soft["joint_position"].values - motion.positions)[:, :3].max() > e


def test_sliding_mode_of_one_actuator_is_a_second_order_response_in_its_layer():
    """s' = -(gain / boundary) s with s = e' + slope e."""
    slope, gain, boundary = 3.0, 20.0, 5.0
    law = SlidingMode({"slide": 0.4}, slope, gain, boundary, cart(mass=2.0))
    plant = cart(mass=2.0)
    run = plant.simulate(plant.state([0.1]), law, duration=2.0, save_at=TIMES, rtol=1e-10)
    faster = gain / boundary
    e = second_order(TIMES, -0.3, 0.0, slope * faster, slope + faster)
    assert np.abs(run["joint_position"].values[:, 0] - 0.4 - e).max() < 1e-8


def test_lqr_of_a_double_integrator_is_known():
    """m x'' = u with Q = diag(1, 0), R = 1 has K = (1, sqrt(2 m)) (Anderson & Moore)."""
    law = LQR.about(cart(mass=2.0), cart(mass=2.0).home, [1.0, 0.0], [1.0])
    assert np.allclose(law.gains, [[1.0, 2.0]], 1e-9)


def test_lqr_holds_an_upright_pendulum():
    plant = pendulum()
    upright = plant.state([np.pi / 2])
    law = LQR.about(plant, upright, [10.0, 1.0], [1.0])
    run = plant.simulate(plant.state([np.pi / 2 + 0.2]), law, duration=10.0, save_at=[10.0])
    assert abs(run["joint_position"].values[-1, 0] - np.pi / 2) < 1e-6


def test_lqr_balances_a_pole_on_a_cart():
    """One actuator, two freedoms: the upright pole is held by moving the cart (its slide) alone."""
    pole = lw.Body(mass=0.3, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.02))
    robot = lw.Robot(
        lw.Mechanism(
            gravity=(0, -9.81, 0),
            bodies={"cart": lw.Body(mass=1.0, inertia=lw.Inertia(zz=1.0)), "pole": pole},
            joints={
                "slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0)),
                "hinge": lw.RevoluteJoint(connects=("cart", "pole")),
            },
            actuators=("slide",),
        )
    )
    law = LQR.about(robot, robot.state({"slide": 0.0, "hinge": np.pi / 2}), [1, 1, 1, 1], [0.1])
    run = robot.simulate(
        robot.state({"slide": 0.3, "hinge": np.pi / 2 + 0.1}), law, duration=20.0, save_at=[20.0]
    )
    assert np.allclose(run["joint_position"].values[-1], [0, np.pi / 2], 0, 1e-5)


def test_lqr_of_a_closed_loop_robot(robot):
    law = LQR.about(robot, robot.home, [100] * 3 + [1] * 3, [1] * 3)
    run = robot.simulate(robot.assemble(tool=[0.51, 0.28, 0.5]), law, duration=8.0, save_at=[8.0])
    assert np.allclose(run["tool_pose"][-1], robot.tool_pose(robot.home), 0, 1e-6)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: PD({"slid": 1.0}, 1.0, 1.0), "the goal lacks slide; give all of slide"),
        (
            lambda: PD(lw.Sampled([0, 1], np.zeros((2, 2))), 1.0, 1.0),
            "the goal has 2 columns; give 1: slide",
        ),
        (lambda: PD("home", 1.0, 1.0), "the goal is 'home'; give a state, a motion"),
        (lambda: PD(5, 1.0, 1.0), "the goal is 5; give a state"),
        (lambda: PD({"slide": 0.0}, [1.0], 1.0), r"the parameter 'kp' is \[1.0\]; give one number"),
        (lambda: PD({"slide": 0.0}, np.nan, 1.0), "the parameter 'kp' is nan; give finite numbers"),
        (
            lambda: PDWithGravity({"slide": 0.0}, 1.0, 1.0, pendulum().mechanism),
            "model of a controller is a Mechanism; give a linkwork.R",
        ),
        (lambda: PD({"slide": 0.0}, {"slid": 1.0}, 1.0), "the gain kp lacks 'slide'"),
        (
            lambda: PD({"slide": 0.0}, 1.0, {"slide": 1.0, "sled": 2.0}),
            "there is no actuator 'sled' with a gain kd",
        ),
        (
            lambda: ComputedTorque({"slide": 0.0}, 1.0, 1.0, pendulum()),
            "the model has the actuators hinge_1, the robot slide",
        ),
    ],
)
def test_refusals(make, sentence):
    plant = cart()
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, make(), duration=1.0)


def test_gains_of_runs_keep_the_bounds_of_their_controller(robot):
    """Not only those that the controller is made with."""
    law = SlidingMode(robot.home, 1.0, 1.0, 0.1, robot)
    sentence = r"the controller's boundary is -0\.2; give a positive number"
    for acting in (law, Sampler(law, rate=100.0, compiled=True)):
        with pytest.raises(lw.LinkworkError, match=sentence):
            robot.simulate(robot.home, acting, duration=0.01, parameters={"boundary": -0.2})
    with pytest.raises(lw.LinkworkError, match=sentence):
        robot.ensemble(robot.home, law, {"boundary": [0.1, -0.2]}, duration=0.01)


def test_weights_of_another_shape_are_refused():
    with pytest.raises(
        lw.LinkworkError, match=r"the weights Q have the shape \(3,\); give 2 numbers, or 2 x 2"
    ):
        LQR.about(cart(), cart().home, [1, 2, 3], [1])
    with pytest.raises(lw.LinkworkError, match="the model of a controller is a State; give a"):
        LQR.about(cart().home, cart(), [1, 2], [1])  # pyright: ignore


@pytest.mark.parametrize(
    ("Q", "R", "sentence"),
    [
        ([1.0, 1.0], [0.0], "the weights R of the forces are not positive definite"),
        ([1.0, 1.0], [np.nan], r"R\[0\] is nan"),
        ([1.0, 1.0], "a", "R is 'a'"),
        ([0.0, 0.0], [1.0], "cannot be stabilised with these weights"),
        ([1.0, 1.0], [1e-30], "cannot be stabilised with these weights"),
        ([0.0, 1.0], [1.0], "cannot be stabilised with these weights"),
    ],
)
def test_weights_that_stabilise_nothing_are_refused(Q, R, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        LQR.about(cart(), cart().home, Q, R)


@pytest.mark.parametrize("mass", [1e-6, 2.0, 3e7])
def test_a_pole_on_the_imaginary_axis_is_no_stable_one_however_it_is_rounded(mass):
    """Where the place has no weight the closed loop leaves it alone: its exact pole is zero."""
    plant, random = cart(mass), np.random.default_rng(1)
    for speed, force in 10 ** random.uniform(-3, 3, (20, 2)):
        with pytest.raises(lw.LinkworkError, match="cannot be stabilised with these weights"):
            LQR.about(plant, plant.home, [0.0, speed], [force])


def test_slow_and_fast_poles_are_stable_together():
    """m x'' = -K x with Q = (a, b): both gains in closed form, poles at about sqrt(a / b) and
    sqrt(b / R) / m."""
    plant = cart(2.0)
    for place, speed in [(1e-6, 1e6), (1e-4, 1.0), (1.0, 1e-6), (1e6, 1.0)]:
        (gains,) = LQR.about(plant, plant.home, [place, speed], [1.0]).gains
        stiffness = np.sqrt(place)
        assert gains == pytest.approx([stiffness, np.sqrt(speed + 2 * 2.0 * stiffness)], rel=1e-6)


def test_controllers_work_with_numbers_too(robot):
    """A ready controller can be sampled from Python: the same forces as traced."""
    motion = circle_motion(robot)
    law = ComputedTorque(motion, 100.0, 12.0, robot)
    runs = [
        robot.simulate(
            motion.state.at(0), Sampler(law, 200, compiled=c), duration=0.2, save_at=[0, 0.2]
        )
        for c in (True, False)
    ]
    first, second = (run["joint_position"].values[-1] for run in runs)
    assert np.allclose(first, second, 0, 1e-12)


def test_pid_integrates_the_errors_of_all_actuators_of_whatever_robot_it_leads(robot):
    """Pulled by a constant wrench without weight in the plane, every actuator ends with ki z = the
    force that it bears."""
    law = PID({name: float(robot.home[name]) for name in robot.actuators}, 400.0, 60.0, ki=1200.0)
    push = Wrench("platform", force=[6.0, -4.0, 0])
    run = robot.simulate(robot.home, law, duration=12.0, wrenches=[push], save_at=[0, 12.0])
    integrals = (
        run["drive_state"].sel(extra=[f"integral.{name}" for name in robot.actuators]).values[-1]
    )
    assert np.allclose(1200.0 * integrals, run["actuator_force"].values[-1], 1e-5, 1e-5)
    assert np.abs(integrals).max() > 1e-3
    (one,) = PID({"slide": 0.0}, 1.0, 1.0, ki=1.0).extras(("slide",))
    assert one.name == "integral.slide"


def test_pid_of_some_actuators_or_none(robot):
    goal = robot.assemble(tool=[0.51, 0.28, 0.5])
    save = [0, 0.3]
    run = robot.simulate(
        robot.home, PID(goal, 300, 30, ki=50.0, joints=["slide_2"]), duration=0.3, save_at=save
    )
    assert list(run.dataset.extra.values) == ["integral.slide_2"]
    none = robot.simulate(
        robot.home, PID(goal, 300, 30, ki=50.0, joints=()), duration=0.3, save_at=save
    )
    plain = robot.simulate(robot.home, PD(goal, 300, 30), duration=0.3, save_at=save)
    assert np.allclose(none.dataset.tool_pose, plain["tool_pose"], 0, 1e-12)


def test_pid_of_an_unknown_actuator_is_refused():
    plant = cart()
    law = PID({"slide": 0.0}, 1.0, 1.0, ki=1.0, joints=("slid",))
    with pytest.raises(
        lw.LinkworkError,
        match="there is no actuator to integrate the error of 'slid'; there are slide",
    ):
        plant.simulate(plant.home, law, duration=1.0)


def test_lqr_holds_what_can_be_held():
    two = lw.Robot(lw.robots.double_pendulum().model_copy(update={"actuators": ("hinge_1",)}))
    with pytest.raises(
        lw.LinkworkError, match=r"no forces of hinge_1 hold this pose: .* are missing"
    ):
        LQR.about(two, two.state([0.0, 0.3]), [1.0] * 4, [1.0])
    loose = lw.Robot(lw.robots.double_pendulum().model_copy(update={"actuators": ()}))
    with pytest.raises(lw.LinkworkError, match="the robot has no actuators"):
        LQR.about(loose, loose.home, [1.0] * 4, [])
    with pytest.raises(lw.LinkworkError, match="one state, not a stack"):
        LQR.about(two, two.state([[0.0, 0.3]] * 2), [1.0] * 4, [1.0])
