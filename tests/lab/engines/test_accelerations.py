"""Each engine's accelerations against Lagrange multipliers in maximal coordinates and against
closed forms."""

from __future__ import annotations

from functools import cache
from math import atan, cos, pi, sin, tan

import numpy as np
import pytest

from linkwork.lab import engines
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, PrismaticJoint, RevoluteJoint
from linkwork.robots import prr3

from tests.oracle.closed_forms import DoublePendulum, SliderCrank
from tests.oracle.lagrange import LagrangeOracle
from tests.oracle.random_mechanisms import open_tree, planar_loops, random_state, spatial_loops

TOLERANCES = {"pinocchio": 1e-10, "mujoco": 1e-3, "exudyn": 2e-5}
"""Relative: rounding; MuJoCo's regularisation of its constraints; Exudyn's numerical derivatives of
its constraints."""


@pytest.fixture(params=TOLERANCES)
def engine(request):
    pytest.importorskip(
        request.param, reason=f"the optional engine {request.param} is not installed"
    )
    return request.param


def bennett(a: float = 0.4, alpha: float = 0.6, beta: float = 1.1, theta: float = 0.8) -> Mechanism:
    """Build Bennett's linkage: four skew revolutes that move only because a / sin(alpha) = b /
    sin(beta).

    tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2), theta_3 =
    -theta_1, theta_4 = -theta_2 (G. T. Bennett, A new mechanism, Engineering 76, 1903).
    """
    b = a * sin(beta) / sin(alpha)
    other = 2 * atan(sin((beta + alpha) / 2) / sin((beta - alpha) / 2) / tan(theta / 2))
    near = [
        Frame(position=(length, 0, 0), rotation=(twist, 0, 0))
        for length, twist in ((a, alpha), (b, beta))
    ]
    back = Frame(position=(-b, 0, 0), rotation=(-beta, 0, 0))
    return Mechanism(
        gravity=(1.0, -3.0, -9.0),
        bodies={
            f"link_{i}": Body(
                mass=0.5 + i,
                centre_of_mass=(0.1, 0.05 * i, 0.0),
                inertia=Inertia(xx=0.02, yy=0.03, zz=0.04, xy=0.004),
            )
            for i in (1, 2, 3)
        },
        joints={
            "first": RevoluteJoint(connects=("ground", "link_1")),
            "second": RevoluteJoint(connects=("link_1", "link_2"), frames=(near[0], Frame())),
            "third": RevoluteJoint(connects=("link_2", "link_3"), frames=(near[1], Frame())),
            "fourth": RevoluteJoint(connects=("link_3", "ground"), frames=(near[0], back)),
        },
        actuators=("first",),
        reference={"first": theta, "second": other, "third": -theta, "fourth": -other},
    )


def wedge(slope: float) -> Mechanism:
    """Push a wedge along x under a follower that moves along y: a planar loop of three prismatic
    joints."""
    body = Inertia(zz=0.01)
    return Mechanism(
        gravity=(0.0, -9.81, 0.0),
        bodies={"wedge": Body(mass=2.0, inertia=body), "follower": Body(mass=0.7, inertia=body)},
        joints={
            "face": PrismaticJoint(
                connects=("wedge", "follower"), axis=(-cos(slope), sin(slope), 0)
            ),
            "push": PrismaticJoint(connects=("ground", "wedge"), axis=(1, 0, 0)),
            "lift": PrismaticJoint(connects=("follower", "ground"), axis=(0, 1, 0)),
        },
        actuators=("push",),
    )


MECHANISMS = [
    prr3(gravity=(1.0, 2.0, -9.0)),
    open_tree(1),
    planar_loops(2, loops=2, freedoms=2),
    spatial_loops(0, loops=1, freedoms=1),
    spatial_loops(2, loops=2, freedoms=1),
    bennett(),
]


@cache
def moving(place: int) -> list[tuple[np.ndarray, ...]]:
    """Return coordinates, all rates and forces of one of the mechanisms, and its accelerations by
    multipliers."""
    mechanism, rng, found = MECHANISMS[place], np.random.default_rng(5), []
    oracle = LagrangeOracle(mechanism)
    for _ in range(3):
        positions, rates = random_state(mechanism, rng)
        forces = 3 * rng.normal(size=len(rates))
        expected = oracle.forward_dynamics(positions, rates, forces)
        found.append((positions, oracle.all_rates(positions, rates), forces, expected))
    return found


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "place",
    range(len(MECHANISMS)),
    ids=[item.name for item in MECHANISMS[:-1]] + ["bennett"],
)
def test_agrees_with_multipliers_at_random_states(engine, place):
    model = engines.build(engine, MECHANISMS[place])
    for *state, expected in moving(place):
        actual = model.accelerations(*state)
        assert np.max(abs(actual - expected)) < TOLERANCES[engine] * max(1.0, np.max(abs(expected)))


def test_agrees_with_the_double_pendulum(engine):
    pendulum = DoublePendulum()
    model = engines.build(engine, pendulum.mechanism())
    q, rates, accelerations = np.array([0.4, -1.1]), np.array([2.0, -1.5]), np.array([3.0, 7.0])
    actual = model.accelerations(q, rates, pendulum.force(q, rates, accelerations))
    np.testing.assert_allclose(actual, accelerations, rtol=TOLERANCES[engine])


def test_agrees_with_the_slider_crank(engine):
    """Its guide is the last joint and stays in the tree; one of its joints is described against the
    tree's direction."""
    crank = SliderCrank()
    model = engines.build(engine, crank.mechanism())
    theta, rate, h = 0.9, 1.7, 1e-5
    ahead, behind = (np.array(crank.coordinates(theta + sign * h)) for sign in (1, -1))
    positions, rates = np.array(crank.coordinates(theta)), (ahead - behind) / (2 * h) * rate
    actual = model.accelerations(positions, rates, np.array([crank.force(theta, rate, 4.0)]))
    np.testing.assert_allclose(actual, 4.0, rtol=max(TOLERANCES[engine], 1e-8))


def test_a_cut_prismatic_joint_halves_its_body(engine):
    """y = k x + const, k = tan(slope):  (m_1 + k^2 m_2) x'' = f - k m_2 g."""
    slope = 0.5
    k, x = tan(slope), 0.2
    model = engines.build(engine, wedge(slope))
    positions = np.array(
        [x / cos(slope), x, -k * x]
    )  # the joint "lift" measures the ground from the follower
    rates = positions / x * 0.3
    actual = model.accelerations(positions, rates, np.array([5.0]))
    np.testing.assert_allclose(
        actual, (5.0 - k * 0.7 * 9.81) / (2.0 + k**2 * 0.7), rtol=TOLERANCES[engine]
    )


def test_a_planar_body_may_turn_about_any_axis_of_the_ground(engine):
    """The double pendulum laid in the xz plane: the same motion, its gravity turned with it."""
    pendulum = DoublePendulum()
    upright = pendulum.mechanism()
    shoulder = RevoluteJoint(
        connects=("ground", "bar_1"), frames=(Frame(rotation=(pi / 2, 0, 0)), Frame())
    )
    turned = upright.model_copy(
        update={
            "gravity": (0.0, 0.0, -9.81),
            "joints": {"shoulder": shoulder, "elbow": upright.joints["elbow"]},
        }
    )
    state = np.array([0.4, -1.1]), np.array([2.0, -1.5]), np.array([1.0, 2.0])
    expected, actual = (
        engines.build(engine, item).accelerations(*state) for item in (upright, turned)
    )
    np.testing.assert_allclose(actual, expected, rtol=1e-7)


def test_pinocchio_inverts_its_forward_dynamics():
    pytest.importorskip("pinocchio", reason="the optional engine pinocchio is not installed")
    from linkwork.lab.engines.pinocchio import PinocchioEngine

    for mechanism in (MECHANISMS[0], MECHANISMS[3], bennett()):
        rng = np.random.default_rng(7)
        oracle, model = LagrangeOracle(mechanism), PinocchioEngine(mechanism)
        positions, rates = random_state(mechanism, rng)
        accelerations = rng.normal(size=len(rates))
        actual = model.inverse_dynamics(
            positions, oracle.all_rates(positions, rates), accelerations
        )
        expected = oracle.inverse_dynamics(positions, rates, accelerations)
        np.testing.assert_allclose(actual, expected, rtol=1e-8, atol=1e-8)


def test_softness_moves_mujoco_towards_the_exact_accelerations():
    pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    from linkwork.lab.engines.mujoco import MujocoEngine

    mechanism = prr3()
    oracle = LagrangeOracle(mechanism)
    positions, forces = oracle.reference, np.array([2.0, -1.0, 3.0])
    rates = oracle.all_rates(positions, np.array([0.2, -0.3, 0.1]))
    expected = oracle.forward_dynamics(positions, [0.2, -0.3, 0.1], forces)
    errors = [
        np.max(
            abs(
                MujocoEngine(mechanism, softness).accelerations(positions, rates, forces) - expected
            )
        )
        for softness in (1.0, 1e-1, 1e-2)
    ]
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(10, rel=0.1)


def test_the_bare_evaluation_is_the_same_computation():
    pytest.importorskip("pinocchio", reason="the optional engine pinocchio is not installed")
    pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    from linkwork.lab.engines.mujoco import MujocoEngine
    from linkwork.lab.engines.pinocchio import PinocchioEngine

    mechanism = prr3()
    state = LagrangeOracle(mechanism).reference, np.zeros(9), np.array([1.0, 2.0, 3.0])
    for model, result in ((PinocchioEngine(mechanism), "ddq"), (MujocoEngine(mechanism), "qacc")):
        expected = model.accelerations(*state)
        model.evaluation(state[0], state[1], np.zeros(3))()
        model.evaluation(*state)()
        np.testing.assert_array_equal(getattr(model.data, result)[model.drives], expected)
