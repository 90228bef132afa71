"""Controllers traced with symbols: the same as with numbers, parameters without compiling, refusals
in one sentence."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.control import observation
from linkwork.kernels import kernel

from tests.control.plants import cart, circle_motion

TIMES = np.linspace(0, 1, 21)


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.prr3())


@pytest.fixture(scope="module")
def plant():
    return cart()


FUNCTIONS = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos,
    "atan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "exp": np.exp,
    "sqrt": np.sqrt, "log": np.log, "log1p": np.log1p, "sign": np.sign, "floor": np.floor,
    "ceil": np.ceil, "abs": np.abs,
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_symbols_and_numbers(name):
    function, x = getattr(lw.math, name), ca.SX.sym("x")
    numbers = np.array([0.1, 0.5, 0.9])
    assert np.allclose(function(numbers), FUNCTIONS[name](numbers), 1e-15, 0)
    traced = ca.Function("f", [x], [function(x)])
    assert np.allclose(
        [float(traced(value)) for value in numbers], FUNCTIONS[name](numbers), 1e-14, 0
    )


def test_vectors_of_symbols_behave_as_arrays():
    x = ca.SX.sym("x", 3)
    a, numbers = lw.math.array(x), np.array([0.3, -1.2, 2.0])
    b = np.array([1.0, 2.0, 3.0])
    results = [
        (lw.math.cross(a, b), np.cross(numbers, b)),
        (lw.math.dot(a, b), numbers @ b),
        (lw.math.norm(a), np.linalg.norm(numbers)),
        (lw.math.maximum(a, b), np.maximum(numbers, b)),
        (lw.math.clip(a, -1, 1), np.clip(numbers, -1, 1)),
        (lw.math.atan2(a, b), np.arctan2(numbers, b)),
        (np.diag(b) @ a + 2 * a[::-1], np.diag(b) @ numbers + 2 * numbers[::-1]),
        (lw.math.where(a[0] > 0, a[1], 7.0), numbers[1]),
        (lw.math.array([a[0], 1.0, [a[1]][0]]), np.array([numbers[0], 1.0, numbers[1]])),
    ]
    for traced, expected in results:
        column = ca.vertcat(*[ca.SX(value) for value in np.atleast_1d(np.asarray(traced, object))])
        found = np.array(ca.Function("f", [x], [column])(numbers)).ravel()
        assert np.allclose(found, np.atleast_1d(expected), 1e-14, 1e-15)


def everything(t, state):
    """Read every kind of quantity, and mix them."""
    body = state.body("link_2")
    first = (
        state["slide_1"]
        + 2 * state.rate("pivot_2")
        + lw.math.sin(t)
        + lw.math.norm(state.positions)
    )
    second = (
        lw.math.dot(state.tool_pose, [1, 2, 3])
        + lw.math.dot(state.tool_velocity, [3, 2, 1])
        + state.rates[4]
    )
    third = (
        lw.math.dot(body.position, body.velocity) + body.rotation[0, 1] * body.angular_velocity[2]
    )
    return {"slide_1": first, "slide_3": third, "slide_2": second}


def test_a_traced_controller_gives_what_it_gives_with_numbers(robot):
    start = robot.home.with_rates([0.1, -0.2, 0.3])
    run = robot.simulate(start, everything, duration=0.3, save_at=[0, 0.1, 0.2, 0.3])
    data = run.dataset
    for k, t in enumerate(run.coords["time"].values):
        state = robot.state(
            data.joint_position.values[k],
            dict(zip(robot.rates[:3], data.joint_rate.values[k, :3], strict=True)),
        )
        seen = robot.observe(state)
        expected = everything(t, seen)
        found = dict(zip(robot.actuators, data.actuator_force.values[k], strict=True))
        for name in robot.actuators:
            assert np.isclose(found[name], expected[name], 1e-9, 1e-9)


def test_observed_numbers_are_the_robots(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42]).with_rates([0.1, 0.2, -0.3])
    seen = robot.observe(state)
    assert seen["wrist_2"] == state["wrist_2"]
    assert np.allclose(seen.positions, state.positions, 1e-14, 0)
    assert np.allclose(seen.rates, robot.joint_rates(state), 1e-14, 1e-15)
    assert np.allclose(seen.tool_pose, robot.tool_pose(state), 1e-14, 0)
    p, R = robot.body_poses(state)["platform"]
    omega_v = robot.twists(state)[-1]
    body = seen.body("platform")  # its mass centre is its origin
    assert np.allclose(body.position, p) and np.allclose(body.rotation, R)
    assert np.allclose([*body.angular_velocity, *body.velocity], omega_v, 1e-12, 1e-14)
    assert np.allclose(seen.tool_velocity, omega_v[[3, 4, 2]], 1e-12, 1e-14)


def test_observed_tool_in_space():
    """Pose as the robot gives it, velocity as the difference of poses a little before and after."""
    robot, h = lw.Robot(lw.robots.puma560()), 1e-6
    q, w = np.array([0.3, -0.5, 0.8, 0.2, -0.6, 1.1]), np.linspace(-1, 1, 6)
    seen = robot.observe(robot.state(q, w))
    assert np.allclose(seen.tool_pose, robot.tool_pose(robot.state(q)), 1e-12, 1e-14)
    before, after = (robot.tool_pose(robot.state(q + step * w)) for step in (-h, h))
    turn = Rotation.from_rotvec(after[3:]) * Rotation.from_rotvec(before[3:]).inv()
    assert np.allclose(seen.tool_velocity[:3], (after - before)[:3] / (2 * h), 1e-6, 1e-8)
    assert np.allclose(seen.tool_velocity[3:], turn.as_rotvec() / (2 * h), 1e-6, 1e-8)


def test_parameters_change_without_compiling(plant, monkeypatch):
    def law(t, state):
        return [-state.parameter("stiffness", 8.0) * state["slide"]]

    start = plant.state([0.3])
    assert plant.simulate(start, law, duration=0.1).dataset is not None
    compiled = []
    monkeypatch.setattr(
        kernel, "load", lambda *args: compiled.append(args) or pytest.fail("compiled anew")
    )
    run = plant.simulate(start, law, duration=1.0, save_at=TIMES, parameters={"stiffness": 18.0})
    assert np.allclose(run["joint_position"].values[:, 0], 0.3 * np.cos(3 * TIMES), 0, 1e-7)
    assert not compiled


def test_references_over_time_become_inputs(plant):
    """m x'' = m a_d(t): the cart follows a sampled course, and its derivative is that course's."""
    times = np.linspace(0, 1, 41)
    desired = lw.Sampled(times, np.sin(3 * times))
    rate = desired.derivative()

    def law(t, state):
        return 2.0 * rate.derivative()(t)

    run = plant.simulate(plant.state([0.0], [3.0]), law, duration=1.0, save_at=TIMES)
    start = float(desired.derivative()(0.0)[0]) - 3.0  # the spline's own slope at the start
    assert np.allclose(
        run["joint_position"].values[:, 0] + start * TIMES, desired(TIMES)[:, 0], 0, 1e-8
    )


def test_time_is_exact(plant):
    run = plant.simulate(
        plant.home, lambda t, state: [2.0 * lw.math.cos(t)], duration=1.0, save_at=TIMES, rtol=1e-11
    )
    assert np.allclose(run["joint_position"].values[:, 0], 1 - np.cos(TIMES), 0, 1e-9)


def test_the_same_law_in_every_chart():
    """A five-bar that turns through changes of chart under a law in named quantities keeps the
    energy law's balance."""
    robot = lw.Robot(lw.robots.four_bar())
    (motor,) = robot.actuators
    law = lambda t, state: {motor: 0.5 - 0.2 * state.rate(motor)}  # noqa: E731
    run = robot.simulate(robot.home, law, duration=3.0, save_at=np.linspace(0, 3, 1501))
    data = run.dataset
    power = (
        (data.actuator_force * data.joint_rate.sel(rate=list(robot.actuators)).values)
        .sum("actuator")
        .values
    )
    time = run.coords["time"].values
    work = np.concatenate([[0], np.cumsum(np.diff(time) * (power[1:] + power[:-1]) / 2)])
    energy = (data.kinetic_energy + data.potential_energy).values
    scale = np.abs(energy - energy[0]).max()
    assert np.abs(energy - energy[0] - work).max() < 1e-4 * max(scale, 1e-3)


# Refusals


SHORT = lw.Sampled([0.0, 0.5], np.zeros((2, 1)), kind="linear")


def branching(t, state):
    return [1.0 if state["slide"] > 0 else -1.0]


def rounding_to_float(t, state):
    return [float(state["slide"])]


class Counting:
    def __init__(self):
        self.calls = 0

    def __call__(self, t, state):
        self.calls += 1
        return [float(self.calls)]


class Integrating:
    """A controller with a state that forgets to give its rate."""

    extras = (("sum", "m s", 0.0),)

    def __call__(self, t, state):
        return [state["slide"]]


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        (branching, (
            r"cannot be traced with symbols \(it branches on the value of a symbol\); "
            r".*where.*Sampler$"
        )),
        (lambda t, state: None, r"the controller returns None; give 1 number: slide"),
        (lambda t, state: [None], (
            r"the controller returns a list of NoneType; give 1 number: "
            r"slide"
        )),
        (lambda t, state: [state.parameter("k", np.nan)], (
            r"the parameter 'k' is nan; give finite "
            r"numbers"
        )),
        (lambda t, state: [state.parameter("k", [1.0])], (
            r"the parameter 'k' is \[1.0\]; give one "
            r"number"
        )),
        (Counting, r"the controller is the class Counting; make one of it, Counting\(...\)"),
        (lw.control.PID, r"the controller is the class PID"),
        (lambda t, state: [SHORT(t)[0]], (
            r"the controller reads a signal from 0 s to 0.5 s, but the run goes from 0 s to 1 "
            r"s"
        )),
        (rounding_to_float, r"the controller returns other values with numbers"),
        (Counting(), r"it branches on values, or keeps memory.*Sampler"),
        (lambda t, state: [math.sin(state["slide"])], (
            r"returns other values with numbers|cannot be "
            r"traced"
        )),
        (lambda t, state: [1.0, 2.0], r"the controller returns 2 values; give 1: slide"),
        (
            lambda t, state: (lw.math.array([state["slide"]]), {}),
            r"the controller returns a tuple of ndarray, dict; give 1 number: slide$",
        ),
        (Integrating(), (
            r"the controller returns a list of SX; give the forces, and the rates of "
            r"sum$"
        )),
        (lambda t, state: {"slid": 1.0}, (
            r"the controller returns a value for 'slid'; there are "
            r"slide"
        )),
        (lambda t, state: "full speed", (
            r"the controller returns 'full speed'; give 1 number: "
            r"slide"
        )),
        (lambda t, state: [state["slid"]], r"there is no joint coordinate 'slid'; there are slide"),
        (lambda t, state: [state.rate("slid")], r"there is no joint rate 'slid'"),
        (lambda t, state: [state.body("card").position[0]], (
            r"there is no body 'card'; there are "
            r"cart"
        )),
        (lambda t, state: [state.extra("current")], (
            r"there is no extra state 'current'; there are "
            r"none"
        )),
        (lambda t, state: [state.parameter("k", 1.0) * state.parameter("k", 2.0)], (
            r"the parameter 'k' is given "
            r"twice"
        )),
        (lambda t, state: [1 / 0], (
            r"the controller cannot be traced with symbols "
            r"\(ZeroDivisionError"
        )),
    ],
)  # fmt: skip
def test_refusals(plant, law, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, law, duration=1.0)


def test_parameters_of_the_robot_and_of_the_controller_together():
    """Twice the mass under twice the stiffness moves as before; a free tool position moves the
    observed tool."""
    plant = cart(mass=2.0).free("cart.mass", "hook.frame.position.x")

    def law(t, state):
        return [-state.parameter("stiffness", 8.0) * (state.tool_pose[0] - 0.1)]

    start, both = plant.state([0.3]), {"cart.mass": 4.0, "stiffness": 36.0}
    run = plant.simulate(start, law, duration=1.0, save_at=TIMES, parameters=both)
    assert np.allclose(run["joint_position"].values[:, 0], 0.3 * np.cos(3 * TIMES), 0, 1e-7)
    run = plant.simulate(
        start, law, duration=1.0, save_at=TIMES, parameters=both | {"hook.frame.position.x": 0.2}
    )
    assert np.allclose(run["joint_position"].values[:, 0], 0.4 * np.cos(3 * TIMES) - 0.1, 0, 1e-7)


def test_unknown_parameters_are_refused(plant):
    with pytest.raises(lw.LinkworkError, match=r"there is no parameter 'kq' .*; there are k"):
        plant.simulate(
            plant.home, lambda t, s: [-s.parameter("k", 1.0)], duration=1.0, parameters={"kq": 2.0}
        )
    with pytest.raises(
        lw.LinkworkError, match=r"there is no parameter 'k' .robot.free .*; there are none"
    ):
        plant.simulate(plant.home, [1.0], duration=1.0, parameters={"k": 2.0})


def test_a_robot_without_tool_has_no_tool_pose():
    robot = lw.Robot(lw.robots.four_bar().model_copy(update={"tools": {}}))
    with pytest.raises(lw.LinkworkError, match="names no tool"):
        robot.simulate(robot.home, lambda t, s: [s.tool_pose[0]], duration=1.0)


def test_quantities_have_one_place_each(robot):
    names = observation.Names.of(robot.mechanism, robot.planar)
    assert names.size(observation.Quantity("body", "platform")) == 18
    assert names.size(observation.Quantity("tool_pose")) == 3


def test_a_motion_of_the_3_prr(robot):
    """PD about a motion follows it to the error that its stiffness leaves."""
    motion = circle_motion(robot)
    run = robot.simulate(
        motion.state.at(0), lw.control.PD(motion, 5000, 200), duration=1.0, save_at=motion.time
    )
    assert np.abs(run["joint_position"].values - motion.positions)[:, :3].max() < 0.004


def test_values_without_bound_are_undefined_whichever_way_they_come_about(plant):
    """inf with numbers, which CasADi simplifies, and 0 inf + inf with symbols: no branch."""

    def law(t, state):
        far = ca.if_else(state["slide"] < 2, ca.inf, 1.0)
        return [ca.SX(state.parameter("gain", 0.0)) * far + far]

    run = plant.simulate(plant.home, law, duration=0.1)
    assert run.status is lw.Status.NON_FINITE and "force on slide is infinite" in run.message
