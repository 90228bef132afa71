"""Derivatives of runs: the same steps in forty digits, differences of the same steps, and closed
solutions."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork import math
from linkwork.control import DCMotor, Event, Sampler

from tests.catalogue import WHOLE, built
from tests.oracle.random_joints import random_tree

FIXED = {"method": "rk4", "step": 0.01}
TIGHT = {"rtol": 1e-12, "atol": 1e-13}


def derivative(of, h=2e-3):
    """Return the derivative of a function at zero, by differences extrapolated to order 8."""
    found = [(of(d) - of(-d)) / (2 * d) for d in (h, h / 2, h / 4, h / 8)]
    for power in (4, 16, 64):
        found = [(power * b - a) / (power - 1) for a, b in pairwise(found)]
    return found[0]


def moved(robot, state, forces, options, quantities, name, d):
    """Return the last values of a run of which one number is another by d."""
    group, _, rest = name.partition(".")
    options, start = dict(options), state
    if group == "positions":
        held = {own: float(state[own]) for own in state.independent}
        start = robot.assemble(held | {rest: held[rest] + d}, guess=state, rates=state.rates)
    elif group == "rates":
        start = state.with_rates(state.rates + d * (np.array(state.independent) == rest))
    elif group == "forces":
        forces = np.asarray(forces) + d * (np.array(robot.actuators) == rest)
    elif name in robot.parameters:
        robot = robot.with_parameters({name: robot.parameters[name] + d})
        start = robot.state(state.positions, state.rates, tolerance=0.1)
    else:
        options["parameters"] = {name: options["parameters"][name] + d}
    run = robot.simulate(start, forces, **options)
    return np.concatenate([run[own].values[-1].ravel() for own in quantities])


def require_derivatives(
    robot, state, forces, within=1e-9, quantities=("joint_rate",), h=2e-3, **options
):
    """Compare tangents with differences of the same steps, and the adjoint with the tangents;
    return the run."""
    run = robot.simulate(state, forces, **options)
    told = run.sensitivity(list(quantities))
    numbers = told["number"].values.tolist()
    found = {
        name: np.concatenate([told[own].sel(number=name).values[-1].ravel() for own in quantities])
        for name in numbers
    }
    largest = max(np.abs(values).max() for values in found.values())
    for name in numbers:
        expected = derivative(partial(moved, robot, state, forces, options, quantities, name), h)
        assert np.abs(found[name] - expected).max() < within * largest, name
    weights = {
        own: np.random.default_rng(0).normal(size=run.variables[own].shape) for own in quantities
    }
    back = run.gradient(weights)
    sums = {
        name: sum((weights[own] * told[own].sel(number=name).values).sum() for own in quantities)
        for name in numbers
    }
    size = max(map(abs, sums.values()))
    assert [*back] == numbers
    assert all(abs(back[name] - sums[name]) < 1e-12 * size for name in numbers)
    return run


# The same steps in forty digits


def swung(length, mass, angle, rate, torque, h, count):
    """Return angle and rate of a pendulum of a point mass after steps of Kutta's method."""

    def slope(y):
        swing = -mpmath.mpf("9.81") / length * mpmath.cos(y[0]) + torque / (mass * length**2)
        return mpmath.matrix([y[1], swing])

    y = mpmath.matrix([angle, rate])
    for _ in range(count):
        k1 = slope(y)
        k2 = slope(y + h / 2 * k1)
        k3 = slope(y + h / 2 * k2)
        k4 = slope(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def test_tangents_and_adjoints_are_those_of_the_same_steps_in_forty_digits():
    robot = lw.Robot(lw.robots.pendulum((0.8,), (1.3,))).free("rod_1.mass")
    h, count = 0.0625, 16  # a step without rounding
    run = robot.simulate(
        robot.home.with_rates([0.7]), [2.5], duration=h * count, method="rk4", step=h
    )
    told = run.sensitivity(["joint_position", "joint_rate"])
    with mpmath.workdps(60):
        start = {"length": mpmath.mpf(0.8), "mass": mpmath.mpf(1.3), "h": mpmath.mpf(h)}
        start |= {"angle": mpmath.mpf(0), "rate": mpmath.mpf(0.7), "torque": mpmath.mpf(2.5)}
        tiny = mpmath.mpf(10) ** -20
        exact = {}
        for name, key in (
            ("positions.hinge_1", "angle"),
            ("rates.hinge_1", "rate"),
            ("forces.hinge_1", "torque"),
            ("rod_1.mass", "mass"),
        ):
            up, down = (swung(count=count, **start | {key: start[key] + d}) for d in (tiny, -tiny))
            exact[name] = np.array(((up - down) / (2 * tiny)).tolist(), float).ravel()
    for name, values in exact.items():
        own = [told[q].sel(number=name).values[-1, 0] for q in ("joint_position", "joint_rate")]
        assert own == pytest.approx(values, rel=1e-12, abs=1e-13)


# Differences of the same steps


def led(t, state):
    """Draw the slides to 0.2 m, by free gains."""
    kp, kd = state.parameter("kp", 20.0), state.parameter("kd", 2.0)
    return [-kp * (state[name] - 0.2) - kd * state.rate(name) for name in SLIDES]


SLIDES = ("slide_1", "slide_2", "slide_3")
GAINS = {"kp": 20.0, "kd": 2.0}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "law",
    [led, Sampler(led, rate=50, compiled=True), Sampler(led, rate=50, compiled=True, delay=0.04)],
    ids=["continuous", "sampled", "delayed"],
)
def test_controllers_their_gains_and_masses(law):
    robot = lw.Robot("prr3").free("platform.mass")
    for asked in ({}, {"samples": 7}):
        options = FIXED | asked | {"parameters": GAINS}
        require_derivatives(robot, robot.home, law, duration=0.2, **options)


@pytest.mark.long
@pytest.mark.parametrize("samples", [None, 8])
def test_symplectic_steps(samples):
    """q moves by the new rates: within steps, through a controller's states and a sampled force."""
    robot = lw.Robot("prr3").free("platform.mass")

    def law(t, state):
        return [-state.parameter("k", 30.0) * state.rate("slide_1") * t, 0.5 * state["slide_2"], 0]

    given = {"duration": 0.1, "method": "symplectic_euler", "step": 0.0103, "samples": samples}
    start = robot.home.with_rates([0.4, -0.2, 0.3])
    quantities = "joint_rate", "tool_pose"
    require_derivatives(
        robot, start, law, quantities=quantities, parameters={"k": 30.0}, **given, within=1e-8
    )
    require_derivatives(robot, start, [1.0, 0.5, -0.3], quantities=quantities, **given, within=1e-8)
    found = robot.gradient(
        None, start, [1.0, 0, 0], running=lambda t, s: s.rate("slide_1"), **given
    )
    times = np.arange(10) * given["step"]
    run = robot.simulate(start, [1.0, 0, 0], **given | {"samples": None})
    steps = np.diff(run.time)
    assert np.allclose(run.time[:-1], times)
    assert found.value == pytest.approx(run["joint_rate"].values[:-1, 0] @ steps, rel=1e-12)


@pytest.mark.long
def test_steps_that_are_chosen_are_differentiated_to_the_tolerance():
    robot = lw.Robot("prr3")
    for asked in ({}, {"samples": 5}, {"method": "dop853"}, {"method": "dormand_prince"}):
        options = TIGHT | asked
        quantities = ("joint_position", "joint_rate", "tool_pose")
        require_derivatives(
            robot, robot.home, [1, 0.5, -0.3], 1e-8, quantities, duration=0.1, **options
        )


@pytest.mark.long
def test_changes_of_chart_lengths_gains_and_calls_together():
    """The crank turns once while the rocker's rate is the first independent one."""
    robot = lw.Robot(lw.robots.four_bar(), independent=["rocker_pivot"])
    robot = robot.free("coupler.mass", "crank_pin.frames.0.position.x")
    state = robot.assemble({"crank_pivot": 1.2}, rates={"crank_pivot": 9.0})

    def law(t, seen):
        return [seen.parameter("torque", 0.3) * math.sin(3 * t) - 0.02 * seen.rate("crank_pivot")]

    run = require_derivatives(
        robot,
        state,
        Sampler(law, rate=100, compiled=True),
        1e-8,
        ("joint_position", "joint_rate", "kinetic_energy", "joint_acceleration"),
        2e-4,
        duration=0.6,
        method="rk4",
        step=0.005,
        samples=9,
        parameters={"torque": 0.3},
    )
    assert run.attrs["charts"].count(";") == 1


@pytest.mark.long
@pytest.mark.parametrize("name", ["rrs3", *["stewart"] * WHOLE])
def test_spatial_loops_and_their_tool(name):
    robot = built(name)
    names = ("joint_rate", "tool_pose", "potential_energy", "actuator_power")
    forces = np.full(len(robot.actuators), 30.0)
    require_derivatives(robot, robot.home, forces, 1e-9, names, duration=0.03, **FIXED)


TUMBLING = lw.Mechanism(
    name="tumbling",
    gravity=(0, 0, -9.81),
    bodies={"box": lw.Body(mass=1.5, inertia={"xx": 0.1, "yy": 0.25, "zz": 0.3})},
    joints={"free": lw.FreeJoint(connects=("ground", "box"))},
)


@pytest.mark.long
def test_gears_and_free_turns():
    """Rates, forces and a mass of a floating tree, whose coordinates hold a quaternion."""
    mechanism, rng = (
        random_tree(1, 5, effects=True, gears=1, actuation=-2),
        np.random.default_rng(1),
    )
    robot = lw.Robot(mechanism)
    robot = robot.free(f"{robot.bodies[-1]}.mass")
    start = robot.home.with_rates(0.3 * rng.standard_normal(robot.mobility))
    forces, options = rng.standard_normal(len(robot.actuators)), {"duration": 0.05, **FIXED}
    run = robot.simulate(start, forces, **options)
    told = run.sensitivity("joint_rate", to=["rates", "forces", "parameters"]).joint_rate
    largest = np.abs(told.values[-1]).max()
    for name in told["number"].values.tolist():
        own = partial(moved, robot, start, forces, options, ["joint_rate"], name)
        found = told.sel(number=name).values[-1]
        assert np.abs(found - derivative(own)).max() < 1e-8 * largest, name


def test_turns_of_free_bodies_are_rotation_vectors():
    """A step of positions.free.wx turns the body about the ground's x axis."""
    robot, rates = lw.Robot(TUMBLING), np.array([0, 0, 0, 1.0, 4.0, 0.2])
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8])

    def begun(turn):
        x, y, z, w = turn.as_quat()
        return robot.state([0.1, 0, 0, w, x, y, z], rates)

    def final(turn, options):
        run = robot.simulate(begun(turn), duration=0.4, **options)
        return np.concatenate([run["joint_position"].values[-1], run["joint_rate"].values[-1]])

    for options in ({"method": "rk4", "step": 0.05}, {"rtol": 1e-11, "atol": 1e-12}):
        run = robot.simulate(begun(turn), duration=0.4, **options)
        told = run.sensitivity(["joint_position", "joint_rate"], "positions")
        for axis, unit in zip("xyz", np.eye(3), strict=True):
            own = told.sel(number=f"positions.free.w{axis}")
            parts = own.joint_position.values[-1], own.joint_rate.values[-1]
            expected = derivative(
                lambda d, unit=unit, options=options: final(
                    Rotation.from_rotvec(d * unit) * turn, options
                )
            )
            assert np.concatenate(parts) == pytest.approx(expected, abs=1e-9)


# Events


CART = lw.Mechanism(
    name="cart",
    gravity=(0, 0, 0),
    bodies={"cart": lw.Body(mass=2.0, inertia={"zz": 1.0})},
    joints={"rail": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))},
    actuators=("rail",),
)


def test_the_time_of_an_event_that_ends_a_run_is_differentiated():
    """x = x0 + v0 t + u t^2 / 2 m reaches a at v = sqrt(v0^2 + 2 u (a - x0) / m)."""
    robot, a, u, v0 = lw.Robot(CART).free("cart.mass"), 0.5, 3.0, 0.4
    end = Event(lambda t, state: state["rail"] - state.parameter("a", a), terminal=True)
    state = robot.home.with_rates([v0])
    run = robot.simulate(state, [u], duration=5, events=[end], **TIGHT)
    told = run.sensitivity(["joint_position", "joint_rate"])
    v, m = np.sqrt(v0**2 + 2 * u * a / 2.0), 2.0
    exact = {
        "positions.rail": (0, -u / m / v),
        "rates.rail": (0, v0 / v),
        "forces.rail": (0, a / m / v),
        "cart.mass": (0, -u * a / m**2 / v),
        "a": (1, u / m / v),
    }
    for name, values in exact.items():
        own = [told[q].sel(number=name).values[-1, 0] for q in ("joint_position", "joint_rate")]
        assert own == pytest.approx(values, abs=1e-11)
    seen = {"positions.rail": -1 / v, "rates.rail": (v0 / v - 1) / (u / m), "a": 1 / v}
    half = Event(lambda t, state: state["rail"] - a / 2)
    both = robot.simulate(state, [u], duration=5, events=[half, end], samples=4, **TIGHT)
    times = both.sensitivity("event_time").event_time
    assert times.shape == (2, len(told["number"]))
    w = np.sqrt(v0**2 + u * a / m)
    for name, value in seen.items():
        assert times.sel(number=name).values[1] == pytest.approx(value, rel=1e-10)
    assert times.sel(number="positions.rail").values[0] == pytest.approx(-1 / w, rel=1e-9)
    led_back = both.gradient({"event_time": [1.0, 2.0]})
    assert [*led_back.values()] == pytest.approx([1.0, 2.0] @ times.values, rel=1e-12)
    back = run.gradient({"joint_rate": np.eye(len(run.time))[-1:].T})
    assert [back[name] for name in exact] == pytest.approx([x for _, x in exact.values()])


def test_an_integral_up_to_an_event():
    """int v^2 dt = (v^3 - v0^3) / (3 u / m)."""
    robot, a, u, m = lw.Robot(CART).free("cart.mass"), 0.5, 3.0, 2.0
    end = Event(lambda t, state: state["rail"] - a, terminal=True)
    options = {"duration": 5, "events": [end], **TIGHT}

    def exact(v0=0.4, u=u, m=m, x0=0.0):
        return (np.sqrt(v0**2 + 2 * u * (a - x0) / m) ** 3 - v0**3) / (3 * u / m)

    start = robot.home.with_rates([0.4])
    found = robot.gradient(
        None, start, [u], running=lambda t, state: state.rate("rail") ** 2, **options
    )
    assert found.value == pytest.approx(exact(), rel=1e-11)
    names = {"positions.rail": "x0", "rates.rail": "v0", "forces.rail": "u", "cart.mass": "m"}
    base = {"x0": 0.0, "v0": 0.4, "u": u, "m": m}
    for name, key in names.items():
        expected = derivative(lambda d, key=key: exact(**{key: base[key] + d}))
        assert found[name] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("u", [3.0, 2.7])  # the event's place is rounded to either side
def test_a_running_loss_that_jumps(u):
    robot, m = lw.Robot(CART), 2.0

    def paid(t, state):
        return math.where(state["rail"] < 0.5, 2.0, 5.0)

    switch = Event(lambda t, state: state["rail"] - 0.5, cuts=True)
    options = {"duration": 1.2, **TIGHT}
    found = robot.gradient(None, robot.home, [u], running=paid, events=[switch], **options)
    passed = np.sqrt(2 * 0.5 * m / u)
    assert found.value == pytest.approx(2 * passed + 5 * (1.2 - passed), rel=1e-11)
    assert found["positions.rail"] == pytest.approx(3 / (u / m * passed), rel=1e-7)
    refused("what acts jumps", robot.gradient, None, robot.home, [u], running=paid, **options)


@pytest.mark.parametrize("at", [0.3, 0.417, 0.5])
def test_a_running_loss_that_jumps_at_a_time(at):
    robot = lw.Robot(CART)

    def paid(t, state):
        return math.where(t < state.parameter("at", at), 2.0, 5.0) + 0 * state["rail"]

    switch = Event(lambda t, state: t - state.parameter("at", at), cuts=True)
    options = {"duration": 1.2, **TIGHT}
    found = robot.gradient(None, robot.home, [3.0], running=paid, events=[switch], **options)
    assert found.value == pytest.approx(2 * at + 5 * (1.2 - at), rel=1e-11)
    assert found["at"] == pytest.approx(-3, rel=1e-9)


@pytest.mark.parametrize("method", [None, "rodas"])
def test_a_force_that_bends_at_a_time(method):
    """k max(t - a, 0): v = k (T - a)^2 / 2 m."""
    robot, a, k, m = lw.Robot(CART), 0.417, 3.0, 2.0

    def late(t, state):
        return state.parameter("rate", 1.0) * t - state.parameter("a", a)

    def law(t, state):
        return [k * math.where(late(t, state) > 0, late(t, state), 0.0)]

    own = TIGHT if method is None else {"method": method, "rtol": 1e-10, "atol": 1e-11}
    run = robot.simulate(robot.home, law, duration=1.2, events=[Event(late, cuts=True)], **own)
    told = run.sensitivity("joint_rate").joint_rate[-1, 0]
    assert told.sel(number="a") == pytest.approx(-k * (1.2 - a) / m, rel=1e-8)
    assert told.sel(number="rate") == pytest.approx(k * (1.2**2 - a**2) / 2 / m, rel=1e-8)


@pytest.mark.parametrize("speed", [5.0, 0.5, -0.5, -5.0])
def test_a_running_loss_that_bends_at_what_state_and_time_tell(speed):
    """int max(x + s t - g, 0) dt under x = x0 + v0 t, g being met at 0.4 s; with slopes of the
    other side where steps begin, parts of a step would be lacking."""
    robot, v0 = lw.Robot(CART), 1.0
    gap = (v0 + speed) * 0.4

    def beyond(t, state):
        return state["rail"] + speed * t - gap

    def paid(t, state):
        return math.where(beyond(t, state) > 0, beyond(t, state), 0.0)

    found = robot.gradient(
        None,
        robot.home.with_rates([v0]),
        [0.0],
        running=paid,
        events=[Event(beyond, cuts=True)],
        duration=1.2,
        **FIXED,
    )
    after, before = (1.2**2 - 0.4**2) / 2, 0.4**2 / 2
    rises = v0 + speed > 0
    value = (v0 + speed) * (after - 0.4 * 0.8 if rises else before - 0.4 * 0.4)
    assert found.value == pytest.approx(value, rel=1e-8)
    assert found["positions.rail"] == pytest.approx(0.8 if rises else 0.4, rel=1e-8)
    assert found["rates.rail"] == pytest.approx(after if rises else before, rel=1e-8)


def test_forces_that_jump_at_an_event_carry_the_jump_over():
    """Under u1 up to a, and u2 from there on."""
    robot, a, u1, u2, duration = lw.Robot(CART), 0.5, 3.0, -1.0, 1.2

    def law(t, state):
        one, other = state.parameter("u1", u1), state.parameter("u2", u2)
        return [math.where(state["rail"] < state.parameter("a", a), one, other)]

    switch = Event(lambda t, state: state["rail"] - state.parameter("a", a), cuts=True)
    run = robot.simulate(robot.home, law, duration=duration, events=[switch], **TIGHT)

    bare = robot.simulate(robot.home, law, duration=duration, **TIGHT)
    refused("what acts jumps at t = 0.816497 s", bare.sensitivity)

    def final(x0=0.0, v0=0.0, u1=u1, u2=u2, a=a):
        v = np.sqrt(v0**2 + 2 * u1 * (a - x0) / 2.0)
        left = duration - (v - v0) / (u1 / 2.0)
        return np.array([a + v * left + u2 / 4.0 * left**2, v + u2 / 2.0 * left])

    told = run.sensitivity(["joint_position", "joint_rate"])
    names = {"positions.rail": "x0", "rates.rail": "v0", "u1": "u1", "u2": "u2", "a": "a"}
    base = {"u1": u1, "u2": u2, "a": a, "x0": 0.0, "v0": 0.0}
    for name, key in names.items():
        own = [told[q].sel(number=name).values[-1, 0] for q in ("joint_position", "joint_rate")]
        shifted = derivative(lambda d, key=key: final(**{key: base[key] + d}))
        assert own == pytest.approx(shifted, abs=1e-8)
    back = run.gradient({"joint_position": np.eye(len(run.time))[-1:].T})
    sums = told["joint_position"].values[-1, 0]
    assert [*back.values()] == pytest.approx(sums, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("method", [None, "rodas"])
def test_a_step_that_ends_at_an_event_is_weighed_as_the_others(method):
    """It is a sample of the run and of the event."""
    robot = lw.Robot(CART)
    options = TIGHT if method is None else {"method": method}
    events = [
        Event(lambda t, state, a=a: state["rail"] - a, cuts=True) for a in (0.1, 0.2, 0.3, 0.4)
    ]
    run = robot.simulate(robot.home, [2.0], duration=1.2, events=events, **options)
    tangents = run.sensitivity("joint_position").joint_position.values[:, 0]
    for weights in np.eye(len(run.time)):
        back = run.gradient({"joint_position": weights[:, None]})
        assert [*back.values()] == pytest.approx(weights @ tangents, rel=1e-10, abs=1e-12)


def test_branches_without_a_jump_need_no_event():
    robot = lw.Robot(CART)

    def law(t, state):
        pull = state.parameter("k", 4.0) * (0.3 - state["rail"])
        late = math.where(t > 1.0, 0.1, 0.0)  # at a time that nothing changes
        return [math.where(pull > 0.5, 0.5, math.where(pull < -0.5, -0.5, pull)) + late]

    options = {"duration": 2, "parameters": {"k": 4.0}, **FIXED}
    require_derivatives(robot, robot.home, law, 1e-3, **options)  # differences pass the bends


def test_a_ball_that_presses_on_the_ground():
    """With the time of setting in within the run, and forces, gaps and powers told."""
    ball = lw.Mechanism(
        name="ball",
        gravity=(0, 0, -9.81),
        bodies={"ball": lw.Body(mass=0.5, inertia={"xx": 0.01, "yy": 0.01, "zz": 0.01})},
        joints={
            "up": lw.PrismaticJoint(
                connects=("ground", "ball"), axis=(0, 0, 1), friction={"viscous": 0.2}
            )
        },
        contacts={
            "floor": lw.Contact(
                connects=("ground", "ball"),
                surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
                stiffness=2e3,
                exponent=2,
                dissipation=0.3,
            )
        },
        actuators=("up",),
    )
    robot = lw.Robot(ball)
    names = "joint_rate", "contact_force", "contact_gap", "contact_power", "friction_power"
    state = robot.state([0.3], [-1.0])
    run = require_derivatives(robot, state, [0.0], 1e-6, names, 1e-4, duration=0.16, **TIGHT)
    assert run["contact_gap"].values[-1, 0] < 0 < run["contact_gap"].values[0, 0]


# Losses


def test_a_loss_with_a_running_part_of_an_oscillator():
    """x'' = -w^2 x:  int x^2 dt and x(T) in closed form."""
    robot, w, duration = lw.Robot(CART), 3.0, 0.9

    def law(t, state):
        return [-2.0 * state.parameter("w", w) ** 2 * state["rail"]]

    found = robot.gradient(
        lambda t, state: state["rail"] ** 2 + t,
        robot.home.with_rates([0.6]),
        law,
        duration=duration,
        running=lambda t, state: state["rail"] ** 2,
        **TIGHT,
    )

    def exact(v=0.6, w=w):
        integral = duration / 2 - np.sin(2 * w * duration) / 4 / w
        return (v / w) ** 2 * (np.sin(w * duration) ** 2 + integral) + duration

    assert found.value == pytest.approx(exact(), rel=1e-11)
    assert found["rates.rail"] == pytest.approx(derivative(lambda d: exact(v=0.6 + d)), rel=1e-9)
    assert found["w"] == pytest.approx(derivative(lambda d: exact(w=w + d)), rel=1e-9)
    assert found["rates"].shape == (1,) and found["parameters"] == pytest.approx([found["w"]])
    assert "rates.rail" in repr(found)


@pytest.mark.parametrize("kind", ["spline", "linear", "hold"])
def test_values_of_sampled_forces(kind):
    robot, t = lw.Robot("prr3"), np.linspace(0, 0.1, 6)
    values = np.random.default_rng(1).normal(size=(6, 3))

    def of(values):
        forces = lw.Sampled(t, values, kind)
        return robot.gradient(
            lambda t, state: state.tool_pose[2], robot.home, forces, duration=0.1, **FIXED
        )

    found = of(values)
    assert found.samples is not None
    for place in ((0, 0), (3, 1), (5, 2)):
        unit = np.zeros((6, 3))
        unit[place] = 1
        expected = derivative(lambda d, unit=unit: of(values + d * unit).value, 0.05)
        assert found.samples[place] == pytest.approx(expected, rel=1e-8, abs=1e-12)


def test_drives_and_their_states():
    robot = lw.Robot("prr3")
    motor = DCMotor(torque_constant=0.5, resistance=1.0, inductance=0.01)
    drives = {"slide_1": motor}
    run = robot.simulate(robot.home, [1.0, 0, 0], duration=0.1, drives=drives, **FIXED)
    told = run.sensitivity("joint_rate")
    scale = told.joint_rate.sel(number="slide_1.torque_constant").values[-1]

    def other(d):
        options = {"parameters": {"slide_1.torque_constant": 0.5 + d}}
        found = robot.simulate(
            robot.home, [1.0, 0, 0], duration=0.1, drives=drives, **options, **FIXED
        )
        return found["joint_rate"].values[-1]

    assert scale == pytest.approx(derivative(other), rel=1e-9, abs=1e-10)
    assert "states.slide_1.current" in told["number"].values


# Refusals


@pytest.fixture(scope="module")
def run():
    robot = lw.Robot("prr3")
    return robot.simulate(robot.home, [1, 0.5, -0.3], duration=0.05)


def refused(match, call, *given, **options):
    with pytest.raises(lw.LinkworkError, match=match):
        call(*given, **options)


def test_names_and_weights_that_do_not_fit(run):
    refused("no quantity 'pose'", run.sensitivity, "pose")
    refused("energy_balance is not differentiated, for", run.sensitivity, ["energy_balance"])
    refused(
        "closure_error .*, for it is what rounding leaves", run.gradient, {"closure_error": [1]}
    )
    refused("no number to differentiate by", run.sensitivity, None, "mass")
    refused("the shape", run.gradient, {"tool_pose": [1, 2, 3]})
    refused("weights", run.gradient, [1, 2])
    refused("finite", run.gradient, {"tool_pose": np.full((len(run.time), 3), np.nan)})


def test_what_has_no_derivative(run, tmp_path):
    robot = lw.Robot("prr3")
    called = robot.simulate(robot.home, Sampler(lambda t, s: [0, 0, 0]), duration=0.01)
    refused("a Python function", called.sensitivity)
    rounded = Sampler(led, quantise=1e-3, compiled=True)
    refused("whole steps", robot.simulate(robot.home, rounded, duration=0.01).sensitivity)
    refused("read from a file", lw.Run.load(run.save(tmp_path / "run.nc")).sensitivity)
    refused("there is no loss", robot.gradient, None, robot.home, duration=0.1)
    refused("function of", robot.gradient, 3.0, robot.home, duration=0.1)
    refused("option of a run", robot.gradient, led, robot.home, duration=0.1, steps=3)


def test_lengths_that_would_open_a_loop():
    robot = lw.Robot("bennett").free("hinge_2.frames.0.position.x", "crank.mass")
    run = robot.simulate(robot.home.with_rates([1.0]), duration=0.05)
    refused("would open with hinge_2.frames.0.position.x", run.sensitivity)
    refused(
        "would open with hinge_2",
        robot.gradient,
        lambda t, s: s.rate("hinge_1"),
        robot.home,
        duration=0.05,
    )
    assert np.isfinite(run.sensitivity("joint_rate", "crank.mass").joint_rate.values).all()


def test_an_event_that_touches_zero():
    """x = 1 / 2 - t + t^2 / 2 comes to rest at zero, or passes it where rounding has it so."""
    robot = lw.Robot(CART)
    touch = Event(lambda t, state: state["rail"], terminal=True)
    start = robot.state([0.5], [-1.0])
    for u, passes in ((2.0, False), (1.9, True)):
        run = robot.simulate(start, [u], duration=3, events=[touch])
        assert run.status.name == ("EVENT" if passes else run.status.name)
        touches = run.status.name == "EVENT" and not run["joint_rate"].values[-1].any()
        if touches and not passes:
            refused("touches zero rather than passing it", run.sensitivity, "joint_rate")


def test_parameters_of_losses_can_be_set():
    """a x(T)^2 + int b x^2 dt, beside a controller that shares one of their parameters."""
    robot = lw.Robot(CART)

    def law(t, state):
        return [-2.0 * state.parameter("w", 3.0) ** 2 * state["rail"]]

    def loss(t, state):
        return state.parameter("a", 1.0) * state["rail"] ** 2

    def running(t, state):
        return state.parameter("b", 1.0) * state.parameter("w", 3.0) * state["rail"] ** 2

    def found(**parameters):
        start = robot.home.with_rates([0.6])
        given = {"duration": 0.4, "running": running, "parameters": parameters}
        return robot.gradient(loss, start, law, **given)

    plain, other = found(), found(a=3.0, b=0.5, w=2.0)
    assert plain.value == pytest.approx(plain["a"] + plain["b"], rel=1e-12)
    assert other.value == pytest.approx(3 * other["a"] + 0.5 * other["b"], rel=1e-12)
    assert other.groups["parameters"] == ("w", "a", "b")
    slope = derivative(lambda d: found(a=3.0, b=0.5, w=2.0 + d).value, h=1e-2)
    assert other["w"] == pytest.approx(slope, rel=1e-6)
    refused("no parameter 'c'", found, c=1.0)
    refused("give them by name", robot.gradient, loss, robot.home, duration=0.1, parameters=3)


def test_refusals_say_that_it_is_the_loss():
    robot = lw.Robot(CART)
    given = {"duration": 0.1}
    refused("the loss is 3; give a function", robot.gradient, 3, robot.home, **given)
    refused(
        "the running loss returns 2 values", robot.gradient, None, robot.home, **given,
        running=lambda t, state: [t, t],
    )  # fmt: skip
    refused(
        "the loss cannot be traced", robot.gradient, lambda t, state: 1 if t > 0 else 2,
        robot.home, **given,
    )  # fmt: skip


@pytest.mark.parametrize("value", [lambda x: np.nan, lambda x: math.log(x - 9)])
def test_a_loss_that_is_not_finite_has_no_derivative(value):
    robot = lw.Robot("prr3")

    def loss(t, state):
        return value(state["slide_1"])

    refused("is nan along this run", robot.gradient, loss, robot.home, duration=0.01)
    refused("is nan", robot.gradient, None, robot.home, duration=0.01, running=loss)


def test_parameters_that_share_a_name_are_refused():
    """Whether a number is the mechanism's or the controller's is not told by its name then."""
    robot = lw.Robot("prr3").free("platform.mass")

    def law(name):
        return lambda t, state: [state.parameter(name, 2.0) * state.rate("slide_1"), 0, 0]

    both = {"duration": 0.01, "parameters": {"platform.mass": 12.0}}
    refused("neither can be told", robot.simulate, robot.home, law("platform.mass"), **both)
    for name in ("rates", "rates.slide_1"):
        run = robot.simulate(robot.home, law(name), duration=0.01)
        refused("another name to differentiate", run.sensitivity)
