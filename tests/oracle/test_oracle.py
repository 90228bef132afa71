"""The oracle against closed forms, against the paper's formulation, against itself with 40
digits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import cos, sin

import mpmath
import numpy as np
import pytest
from numpy.typing import ArrayLike

from linkwork.lab.textbook import Textbook
from linkwork.mechanism import Mechanism
from linkwork.robots._prr3 import prr3

from tests.oracle import (
    LagrangeOracle,
    OracleError,
    open_tree,
    planar_loops,
    random_state,
    spatial_loops,
)
from tests.oracle.closed_forms import DOWN, DoublePendulum, Pendulum, SliderCrank

RANDOM: dict[str, Callable[[], Mechanism]] = {
    **{
        f"tree {s} planar {p}": partial(open_tree, s, planar=p)
        for s in (0, 1)
        for p in (True, False)
    },
    **{
        f"planar {s}, {loops} loops": partial(planar_loops, s, loops)
        for s in (0, 1)
        for loops in (1, 2, 3)
    },
    **{
        f"spatial {s}, {loops} loops": partial(spatial_loops, s, loops)
        for s in (0, 1)
        for loops in (1, 2)
    },
    "spatial 2, 2 loops, more freedoms": partial(spatial_loops, 2, loops=2, freedoms=2),
}


def close(actual: ArrayLike, expected: ArrayLike, tolerance: float) -> None:
    actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    assert np.max(abs(actual - expected)) <= tolerance * (1 + np.max(abs(expected)))


@pytest.mark.parametrize("digits", [None, 40])
def test_pendulum_in_a_tilted_plane(digits):
    pendulum = Pendulum()
    oracle = LagrangeOracle(pendulum.mechanism(), digits)
    q, rate, acceleration = 0.8, 1.7, -2.3
    tau = pendulum.force(q, rate, acceleration)
    close(oracle.inverse_dynamics([q], [rate], [acceleration]), [tau], 1e-14)
    close(oracle.forward_dynamics([q], [rate], [tau]), [acceleration], 1e-14)


def test_pendulum_reaction_carries_weight_and_centripetal_force():
    pendulum = Pendulum(tilt=0.0)
    q, rate = 0.8, 1.7
    reaction = LagrangeOracle(pendulum.mechanism()).joint_reactions([q], [rate], [0.0])["hinge"]
    alpha = -pendulum.force(q, rate, 0.0) / (pendulum.I + pendulum.m * pendulum.a**2)
    radial, tangential = np.array([sin(q), -cos(q)]), np.array([cos(q), sin(q)])
    acceleration = pendulum.a * (alpha * tangential - rate**2 * radial)
    close(reaction[3:5], pendulum.m * (acceleration - np.array(DOWN[:2])), 1e-14)


def test_double_pendulum():
    pendulum = DoublePendulum()
    oracle = LagrangeOracle(pendulum.mechanism())
    rng = np.random.default_rng(3)
    for q, rates, accelerations in rng.normal(size=(20, 3, 2)):
        tau = pendulum.force(q, rates, accelerations)
        close(oracle.inverse_dynamics(q, rates, accelerations), tau, 1e-13)
        close(oracle.forward_dynamics(q, rates, tau), accelerations, 1e-12)


def test_slider_crank():
    crank = SliderCrank()
    oracle = LagrangeOracle(crank.mechanism())
    rng = np.random.default_rng(4)
    for theta, rate, acceleration in rng.normal(scale=3, size=(20, 3)):
        q = np.array(crank.coordinates(theta))
        tau = crank.force(theta, rate, acceleration)
        close(oracle.inverse_dynamics(q, [rate], [acceleration]), [tau], 1e-12)
        close(oracle.forward_dynamics(q, [rate], [tau]), [acceleration], 1e-12)
        close(oracle.assemble(q + np.array([0, 0.1, -0.1, 0.05])), q, 1e-12)


def test_agrees_with_the_textbook_on_the_3prr():
    robot = prr3(gravity=(0.4, -9.0, 1.0))
    textbook, oracle = Textbook(robot), LagrangeOracle(robot)
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, rates = random_state(robot, rng, 0.03)
        agree(textbook, oracle, q, rates, *rng.normal(size=(2, 3)))


@pytest.mark.sample(7)
@pytest.mark.parametrize("name", RANDOM)
def test_agrees_with_the_textbook_on_random_mechanisms(name):
    mechanism = RANDOM[name]()
    rng = np.random.default_rng(6)
    q, rates = random_state(mechanism, rng)
    agree(
        Textbook(mechanism), LagrangeOracle(mechanism), q, rates, *rng.normal(size=(2, len(rates)))
    )


def agree(textbook, oracle, q, rates, accelerations, forces, tolerance=1e-11):
    L = textbook.L(q)
    close(textbook.solve(q, q[textbook.a]), q, tolerance)
    close(L @ rates, oracle.all_rates(q, rates), tolerance)
    close(
        L @ accelerations + textbook.Ldot(q, rates) @ rates,
        oracle.all_accelerations(q, rates, accelerations),
        tolerance,
    )
    close(
        textbook.T(q) @ rates,
        np.concatenate([t for b, t in oracle.twists(q, rates).items() if b != "ground"]),
        tolerance,
    )
    close(textbook.M(q), oracle.mass_matrix(q), tolerance)
    close(textbook.C(q, rates) @ rates, oracle.coriolis(q, rates), tolerance)
    close(textbook.G(q), oracle.gravity(q), tolerance)
    close(
        textbook.forward_dynamics(q, rates, forces),
        oracle.forward_dynamics(q, rates, forces),
        tolerance,
    )
    close(
        textbook.inverse_dynamics(q, rates, accelerations),
        oracle.inverse_dynamics(q, rates, accelerations),
        tolerance,
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "mechanism", [prr3(), planar_loops(3, 2), spatial_loops(3)], ids=lambda m: m.name
)
def test_forty_digits(mechanism):
    rng = np.random.default_rng(7)
    q, rates = random_state(mechanism, rng, 0.02)
    forces = rng.normal(size=len(rates))
    exact, double = LagrangeOracle(mechanism, 40), LagrangeOracle(mechanism)
    accelerations = exact.forward_dynamics(q, rates, forces)
    assert max(abs(exact.inverse_dynamics(q, rates, accelerations) - forces)) < 1e-34
    close(double.forward_dynamics(q, rates, forces), accelerations, 1e-12)


def test_forty_digits_are_right_where_a_formula_gives_them():
    mp = mpmath.mp.clone()
    mp.dps = 40
    crank = SliderCrank()
    q = LagrangeOracle(crank.mechanism(), 40).assemble(crank.coordinates(0.75))
    r, l, theta = mp.mpf(crank.r), mp.mpf(crank.l), mp.mpf(0.75)  # noqa: E741
    assert abs(q[3] - r * mp.cos(theta) - mp.sqrt(l**2 - (r * mp.sin(theta)) ** 2)) < 1e-38
    pendulum = DoublePendulum()
    m, a, I = (mp.mpf(value[1]) for value in (pendulum.m, pendulum.a, pendulum.I))  # noqa: E741
    oracle, (q1, q2) = LagrangeOracle(pendulum.mechanism(), 40), (0.3, 0.4)
    assert abs(oracle.mass_matrix([q1, q2])[1, 1] - I - m * a**2) < 1e-38
    assert (
        abs(
            oracle.gravity([q1, q2])[1] - m * a * mp.mpf(-DOWN[1]) * mp.cos(mp.mpf(q1) + mp.mpf(q2))
        )
        < 1e-38
    )


def test_reactions_balance_every_body():
    """Add up, about the ground's origin, all wrenches on each body: they make its rate of
    momentum."""
    mechanism = spatial_loops(8, loops=2)
    oracle, rng = LagrangeOracle(mechanism), np.random.default_rng(8)
    q, rates = random_state(mechanism, rng)
    forces = rng.normal(size=len(rates))
    reactions = oracle.joint_reactions(q, rates, forces)
    h = 1e-5
    ahead, behind = (momenta(mechanism, *stepped(oracle, q, rates, forces, s)) for s in (h, -h))
    X = Textbook(mechanism).configuration(q).X
    for body, data in mechanism.bodies.items():
        c = X[body][:3, :3] @ data.centre_of_mass + X[body][:3, 3]
        weight = data.mass * np.array(mechanism.gravity)
        total = np.concatenate([np.cross(c, weight), weight])
        for name, joint in mechanism.joints.items():
            if body in joint.connects:
                total += (1 if joint.connects[1] == body else -1) * at_origin(
                    mechanism, X, name, reactions, forces
                )
        close(total, (ahead[body] - behind[body]) / (2 * h), 1e-7)


def at_origin(mechanism, X, name, reactions, forces):
    """Return a joint's whole wrench on its second body, about the ground's origin."""
    joint, frame = mechanism.joints[name], Textbook(mechanism).tree.frames[name]
    first, second = X[joint.connects[0]] @ frame[0], X[joint.connects[1]] @ frame[1]
    moment, force = reactions[name][:3].copy(), reactions[name][3:].copy()
    if name in mechanism.actuators:
        drive = forces[mechanism.actuators.index(name)] * first[:3, :3] @ joint.axis
        moment, force = (
            (moment + drive, force) if joint.type == "revolute" else (moment, force + drive)
        )
    return np.concatenate([moment + np.cross(second[:3, 3], force), force])


def stepped(oracle, q, rates, forces, h):
    """Move a state along its motion by h, to second order in the actuated coordinates."""
    accelerations = oracle.forward_dynamics(q, rates, forces)
    actuated = [oracle.moving.index(name) for name in oracle.mechanism.actuators]
    return oracle.assemble(
        q, q[actuated] + h * rates + h**2 / 2 * accelerations
    ), rates + h * accelerations


def momenta(mechanism, q, rates):
    """Return each body's (angular, linear) momentum about the ground's origin."""
    X, twists = Textbook(mechanism).configuration(q).X, LagrangeOracle(mechanism).twists(q, rates)
    result = {}
    for body, data in mechanism.bodies.items():
        R, p = X[body][:3, :3], X[body][:3, 3]
        linear = data.mass * twists[body][3:]
        angular = R @ data.inertia.tensor() @ R.T @ twists[body][:3] + np.cross(
            p + R @ data.centre_of_mass, linear
        )
        result[body] = np.concatenate([angular, linear])
    return result


@pytest.mark.parametrize(("make", "closure"), [(planar_loops, 3), (spatial_loops, 6)])
def test_random_loops_are_closed_mobile_and_repeatable(make, closure):
    for seed in range(6):
        mechanism = make(seed, loops=2)
        moving = [joint for joint in mechanism.joints.values() if joint.type != "fixed"]
        loops = len(mechanism.joints) - len(mechanism.bodies)
        assert len(mechanism.actuators) == len(moving) - closure * loops
        reference = np.array(list(mechanism.reference.values()))
        close(LagrangeOracle(mechanism).reference, reference, 1e-12)
        assert Mechanism(**mechanism.model_dump()) == mechanism == make(seed, loops=2)


def test_dependent_actuators_are_refused():
    mechanism = planar_loops(0, 1, freedoms=2).model_copy(update={"actuators": ("joint_1",)})
    with pytest.raises(OracleError, match="do not determine the motion"):
        LagrangeOracle(mechanism).gravity(np.array(list(mechanism.reference.values())))


def test_open_loops_are_refused():
    crank = SliderCrank()
    with pytest.raises(OracleError, match="do not close"):
        LagrangeOracle(crank.mechanism().model_copy(update={"actuators": ("guide",)})).assemble(
            np.array(crank.coordinates(1.0)), np.array([2.0])
        )
