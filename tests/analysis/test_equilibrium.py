"""Static equilibrium and forces within bounds: closed forms, energy, an independent quadratic
programme."""

import numpy as np
import pytest
from scipy.optimize import minimize

import linkwork as lw
from linkwork.analysis import distributed_forces, equilibria, equilibrium, natural_modes
from linkwork.errors import ModelWarning

from tests.analysis.mechanisms import arm, cables, cart
from tests.catalogue import built

G = 9.81


def test_a_mass_on_a_spring_under_a_force():
    found = equilibrium(cart(2.0, 50.0), [10.0])
    assert found.state["slide"] == pytest.approx(0.1 + 10 / 50)
    assert found.stable and found.residual < 1e-9
    np.testing.assert_allclose(found.stiffness, [[50.0]])


def test_a_pendulum_hangs_and_stands():
    robot = built("pendulum")
    hanging = equilibrium(robot)
    assert np.sin(hanging.state["hinge_1"]) == pytest.approx(-1) and hanging.stable
    upright = equilibrium(robot, guess=robot.state({"hinge_1": 1.4}), stable=False)
    assert upright.state["hinge_1"] == pytest.approx(np.pi / 2) and not upright.stable
    away = equilibrium(robot, guess=upright.state)
    assert np.sin(away.state["hinge_1"]) == pytest.approx(-1)


@pytest.mark.long
def test_a_search_from_many_starts_derives_few_charts():
    """Independent rates that were good for one start are taken for others."""
    described = built("rpr3").mechanism.model_copy(update={"gravity": (0.0, -9.81, 0.0)})
    robot = lw.Robot(described)
    assert equilibria(robot, starts=12)
    assert len(robot.charts) == 2


@pytest.mark.long
@pytest.mark.parametrize("lengths", [(0.86, 0.92, 0.25, 0.39), (0.99, 0.93, 0.81, 0.63)])
def test_stable_and_unstable_equilibria_alternate_around_a_circuit(lengths):
    """A crank between two dead points: near these it hardly turns, and summits lie there."""
    _, crank, coupler, rocker = lengths
    centres = (crank / 2, coupler / 2, rocker / 2)
    described = lw.robots.four_bar(*lengths, centres=centres, gravity=(0.0, -9.81, 0.0))
    found = equilibria(lw.Robot(described))
    assert len(found) == 2 * sum(one.stable for one in found) > 0


def test_a_motor_holds_the_pendulum_at_its_angle():
    """m g l cos q = u."""
    found = equilibrium(built("pendulum"), {"hinge_1": 5.0})
    assert G * np.cos(found.state["hinge_1"]) == pytest.approx(5.0)
    assert found.stable


@pytest.mark.long
def test_a_belt_and_a_fan_hold_a_pendulum():
    """Where m g l cos q = the torque: what the belt does has a potential, and the fan's thrust has
    none."""
    arm_of = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    lines = {
        "belt": lw.Combination(ratios={"hinge": 0.1}),
        "fan": lw.mechanism.Thrust(body="arm", force=(0, 5, 0), point=(1, 0, 0)),
    }
    described = lw.Mechanism(
        bodies={"arm": arm_of},
        joints={"hinge": lw.RevoluteJoint(connects=("ground", "arm"))},
        transmissions=lines,
        actuators=("belt", "fan"),
        gravity=(0, -G, 0),
    )
    robot = lw.Robot(described)
    held = equilibrium(robot, {"belt": 20.0}, guess=robot.state([1.0]))
    assert held.stable and held.state["hinge"] == pytest.approx(-np.arccos(2.0 / (0.5 * G)))
    with pytest.raises(lw.LinkworkError, match="what fan exert has no potential; take stable=F"):
        equilibrium(robot, {"fan": 0.5}, guess=robot.state([1.0]))
    found = equilibrium(robot, {"fan": 0.5}, guess=robot.state([1.0]), stable=False)
    assert np.cos(found.state["hinge"]) == pytest.approx(2.5 / (0.5 * G))


def test_two_links_have_four_equilibria_of_which_one_is_stable():
    found = equilibria(arm(1.0, 0.6))
    angles = {
        tuple(
            np.round(np.sin([one.state["hinge_1"], one.state["hinge_1"] + one.state["hinge_2"]]), 6)
        )
        for one in found
    }
    assert angles == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    assert [one.stable for one in found] == [True, False, False, False]


def test_points_of_a_continuum_are_told():
    """A level five-bar rests anywhere; an arm that hangs from an upright axis, at any angle of it.
    Springs at both motors hold the five-bar."""
    level = lw.robots.five_bar()
    with pytest.warns(ModelWarning, match="equilibria that are found are indifferent"):
        found = equilibria(lw.Robot(level), starts=3)
    assert all(one.indifferent and not one.stable for one in found)
    held = level.model_copy(
        update={"joints": level.joints | {
            name: level.joints[name].model_copy(update={"spring": lw.Spring(stiffness=5.0)})
            for name in level.actuators
        }}
    )  # fmt: skip
    assert not equilibrium(lw.Robot(held)).indifferent
    leaning = lw.Inertia(xx=0.01, yy=0.02, zz=0.02)
    arm_of = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=leaning)
    turned = lw.Mechanism(
        bodies={"post": lw.Body(mass=0, inertia=lw.Inertia(zz=0.1)), "arm": arm_of},
        joints={
            "post": lw.RevoluteJoint(connects=("ground", "post"), axis=(0, 0, 1)),
            "hinge": lw.RevoluteJoint(connects=("post", "arm"), axis=(0, 1, 0)),
        },
        gravity=(0, 0, -G),
    )
    with pytest.warns(ModelWarning):
        found = equilibria(lw.Robot(turned), starts=3)
    assert {round(float(np.sin(one.state["hinge"])), 6) for one in found} == {1.0, -1.0}
    assert all(one.indifferent for one in found)


def test_bodies_that_turn_freely_are_looked_at_from_many_sides():
    """A pendulum on a ball joint hangs or stands; a block lies on a face or stands on an edge, each
    of n corners at the depth (m g / (n k))^(2/3)."""
    bob = lw.Body(mass=2.0, centre_of_mass=(0.3, 0, 0.4), inertia=lw.Inertia(xx=1, yy=1, zz=1))
    ball = lw.SphericalJoint(connects=("ground", "bob"))
    hung = lw.Robot(lw.Mechanism(bodies={"bob": bob}, joints={"ball": ball}))
    floor = lw.Contact(
        connects=("ground", "block"),
        surfaces=(lw.Plane(), lw.Box(size=(0.2, 0.2, 0.2))),
        stiffness=1e4,
    )
    free = lw.FreeJoint(connects=("ground", "block"))
    block = lw.Body(mass=0.4, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
    lying = lw.Mechanism(bodies={"block": block}, joints={"free": free}, contacts={"floor": floor})
    with pytest.warns(ModelWarning):
        ends, rests = equilibria(hung, starts=4), equilibria(lw.Robot(lying), starts=12)
    heights = [hung.energy(one.state)[1] / (2 * G) for one in ends]
    assert {round(float(height), 6) for height in heights} == {0.5, -0.5}
    ways = {1: np.sqrt(3), 2: np.sqrt(2), 4: 1.0}  # from the middle to corner, edge, face
    told = {round(0.1 * way - (0.4 * G / (n * 1e4)) ** (2 / 3), 6) for n, way in ways.items()}
    found = {round(float(one.state["free.z"]), 6) for one in rests}
    assert found <= told and len(found) > 1


def test_a_capsule_lies_down_from_any_side():
    """Both ends at the depth (m g / (2 k))^(2/3); leaning little, it is hardly turned about the
    vertical, about which nothing holds it."""
    rod = lw.Body(mass=0.4, inertia=lw.Inertia(xx=2e-3, yy=2e-3, zz=1e-3))
    floor = lw.Contact(
        connects=("ground", "rod"),
        surfaces=(lw.Plane(), lw.Capsule(radius=0.03, length=0.2)),
        stiffness=1e4,
    )
    free = lw.FreeJoint(connects=("ground", "rod"))
    described = lw.Mechanism(bodies={"rod": rod}, joints={"free": free}, contacts={"floor": floor})
    robot, random = lw.Robot(described), np.random.default_rng(3)
    for turn in (*random.standard_normal((6, 4)), [0.72, 0, 0.69, 0]):
        start = robot.state([0, 0, 0.1, *turn / np.linalg.norm(turn)])
        found = equilibrium(robot, guess=start)
        along = robot.body_poses(found.state)["rod"][1][:, 2]
        assert found.state["free.z"] == pytest.approx(0.03 - (0.4 * G / 2e4) ** (2 / 3), abs=1e-9)
        assert along[2] == pytest.approx(0, abs=1e-6)
    assert along[0] == pytest.approx(1, abs=1e-2)


def test_a_four_bar_rests_where_its_potential_energy_is_least_on_each_assembly_mode():
    robot = lw.Robot(lw.robots.four_bar(gravity=(0.0, -9.81, 0.0)))
    found = equilibrium(robot)
    around = [
        robot.assemble({"crank_pivot": float(found.state["crank_pivot"]) + d}, guess=found.state)
        for d in (-0.01, 0, 0.01)
    ]
    energies = [float(robot.energy(state)[1]) for state in around]
    assert min(energies) == energies[1]
    assert robot.closure_error(found.state) < 1e-12
    np.testing.assert_allclose(robot.forward_dynamics(found.state, [0.0]), 0, atol=1e-9)
    assert sum(one.stable for one in equilibria(robot)) == 2


def test_the_bricard_linkage_finds_its_rest_in_other_rates_than_its_motor_s():
    """On the way down the motor's rate ceases to determine the motion."""
    found = equilibrium(built("bricard"))
    assert found.stable and found.residual < 1e-8
    assert robot_energy(built("bricard"), found.state) < robot_energy(
        built("bricard"), built("bricard").home
    )


def robot_energy(robot, state):
    return float(robot.energy(state)[1])


def test_the_forces_are_those_of_least_norm_within_their_bounds():
    robot = cables()
    S = robot.actuation(robot.home)
    free = robot.inverse_dynamics(robot.home, np.zeros(2))
    assert free.max() > 0 or free.min() < -1  # cables pull where their slides' forces are negative
    bounds = (-np.inf, -2.0)
    u = distributed_forces(robot, robot.home, np.zeros(2), lower=bounds[0], upper=bounds[1])
    np.testing.assert_allclose(S.T @ u, S.T @ free, atol=1e-9)
    assert (u <= -2.0).all()
    programme = minimize(
        lambda x: x @ x,
        u - 1.0,
        jac=lambda x: 2 * x,
        bounds=[bounds] * 3,
        constraints={"type": "eq", "fun": lambda x: S.T @ (x - free), "jac": lambda x: S.T},
        method="SLSQP",
        options={"ftol": 1e-14},
    )
    np.testing.assert_allclose(u, programme.x, atol=1e-5)


def test_within_wide_bounds_they_are_those_of_the_robot():
    robot = cables()
    np.testing.assert_array_equal(
        distributed_forces(robot, robot.home, np.zeros(2), lower=-1e3, upper=1e3),
        robot.inverse_dynamics(robot.home, np.zeros(2)),
    )
    weighted = distributed_forces(
        robot, robot.home, np.zeros(2), upper=-2.0, weights=[1.0, 1.0, 100.0]
    )
    plain = distributed_forces(robot, robot.home, np.zeros(2), upper=-2.0)
    assert abs(weighted[2]) <= abs(plain[2]) + 1e-12


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (
            lambda: distributed_forces(cables(), cables().home, [0, 0], lower=-20.0, upper=-10.0),
            "no forces within the bounds",
        ),
        (
            lambda: distributed_forces(cables(), cables().home, [0, 0], lower=1.0, upper=0.0),
            "the lower one is not below",
        ),
        (
            lambda: distributed_forces(cables(), cables().home, [0, 0], lower=[1.0, 2.0]),
            "one number, or one per actuator",
        ),
        (
            lambda: distributed_forces(cables(), cables().home, [0, 0], upper={"cable_1": 1.0}),
            "lack cable_2, cable_3",
        ),
        (
            lambda: distributed_forces(
                built("five_bar"), built("five_bar").home, [1e3, 0], upper=1e-3
            ),
            "needs",
        ),
        (
            lambda: equilibrium(arm(), guess=arm().state({"hinge_1": [0, 1], "hinge_2": [0, 1]})),
            "not a stack",
        ),
        (lambda: equilibrium(built("pendulum"), [20.0]), "no stable equilibrium is found"),
        (lambda: equilibrium(built("pendulum"), {"x": 1.0}), "there is no actuator 'x'"),
        (lambda: equilibria(built("pendulum"), [1.0, 2.0]), "give 1 number in"),
    ],
)
def test_refusals(ask, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        ask()
    assert "\n" not in str(refusal.value)


def test_weights_of_bounded_forces_may_be_given_by_name():
    robot, weights = cables(), [1.0, 4.0, 9.0]
    named = dict(zip(robot.actuators, weights, strict=True))
    first, second = (
        distributed_forces(robot, robot.home, [0, 0], upper=-2.0, weights=w)
        for w in (weights, named)
    )
    np.testing.assert_array_equal(first, second)


def test_a_table_that_stands_on_stiff_feet_has_modes_about_its_equilibrium():
    """The forces of what was found were too little balanced for `natural_modes`, which advised
    `equilibrium`; and what nothing holds wandered by rounding, 9 cm aside and a quarter turn."""
    k, m, g = 2e5, 4.0, 9.81
    feet = tuple((x, y, 0.0) for x in (0.3, -0.3) for y in (0.2, -0.2))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={
                "top": lw.Body(
                    mass=m,
                    centre_of_mass=(0, 0, 0.1),
                    inertia=lw.Inertia(xx=0.1, yy=0.12, zz=0.2),
                )
            },
            joints={"free": lw.FreeJoint(connects=("ground", "top"))},
            contacts={
                "feet": lw.Contact(
                    connects=("ground", "top"),
                    surfaces=(lw.Plane(), lw.Points(points=feet, radius=0.01)),
                    stiffness=k,
                    friction=lw.Sliding(coefficient=0.6),
                )
            },
        )
    )
    tilted = robot.state([0.5, 0.2, 0.012, 1, 0.003, 0.002, 0.1])
    found = equilibrium(robot, guess=tilted)
    depth = (m * g / (4 * k)) ** (2 / 3)
    np.testing.assert_allclose(found.state.positions[:3], [0.5, 0.2, 0.01 - depth], atol=1e-6)
    along = 4 * 1.5 * k * depth**0.5  # along z; about x and y it has the arms of the feet
    lifted = m * g * 0.1  # the mass centre above the middles of the feet
    squares = [along / m]
    for half, moment in ((0.2, 0.1), (0.3, 0.12)):
        squares.append((along * half**2 - lifted) / moment)
    modes = natural_modes(robot, found.state)
    np.testing.assert_allclose(modes.frequencies[:3], 0, atol=1e-4)
    expected = np.sqrt(np.sort(squares)) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequencies[3:], expected, rtol=1e-6)
