"""The catalogue against published values, closed forms and an independent formulation."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import bricard, five_bar, four_bar, n_four_bar, prr3

from tests.oracle.lagrange import LagrangeOracle


@pytest.mark.parametrize(
    ("mechanism", "mobility", "redundant"),
    [
        (prr3(), 3, 0),
        (five_bar(), 2, 0),
        (four_bar(), 1, 0),
        (n_four_bar(3), 1, 0),
        (bricard(), 1, 1),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_mobility_redundancy_and_dynamics(mechanism, mobility, redundant):
    robot = lw.Robot(mechanism)
    assert robot.mobility == mobility
    assert len(robot.redundant) == redundant
    random = np.random.default_rng(2)
    state, forces = (
        robot.home.with_rates(0.3 * random.normal(size=mobility)),
        random.normal(size=mobility),
    )
    oracle = LagrangeOracle(mechanism)
    expected = oracle.forward_dynamics(state.positions, state.rates, forces)
    assert np.allclose(robot.forward_dynamics(state, forces), expected, rtol=1e-10, atol=1e-10)


def test_four_bar_configuration_and_rates_of_its_source():
    """RigidBodyDynamics.jl, example 3: three joint coordinates to 16 digits, and rates
    (.5, -.47295, .341) good to 1e-3."""
    robot = lw.Robot(four_bar())
    state = robot.assemble({"crank_pivot": 1.6707963267948966}).with_rates([0.5])
    found = [state["crank_pivot"], state["crank_pin"], state["rocker_pivot"]]
    assert np.allclose(
        found, [1.6707963267948966, -1.4591054166649482, 1.5397303602625536], atol=1e-9
    )
    rates = dict(zip(robot.joints, robot.joint_rates(state), strict=True))
    assert np.allclose([rates["crank_pin"], rates["rocker_pivot"]], [-0.47295, 0.341], atol=2e-3)


@pytest.mark.parametrize("loops", [1, 2, 5])
def test_n_four_bar_on_its_regular_branch(loops):
    """IFToMM A02: all cranks stay parallel; ((N + 1)/3 + N) theta'' = -((N + 1)/2 + N) g cos
    theta."""
    robot = lw.Robot(n_four_bar(loops))
    for theta in (1.2, 0.8, 2.0):
        targets = {"pivot_0": theta}
        state = robot.assemble(targets).with_rates([-1.0])
        assert np.allclose([state[f"pivot_{i}"] for i in range(loops + 1)], theta, atol=1e-10)
        inertia, weight = (loops + 1) / 3 + loops, (loops + 1) / 2 + loops
        expected = -weight * 9.81 * np.cos(theta) / inertia
        assert np.allclose(robot.forward_dynamics(state, [0.0]), expected, rtol=1e-11)


def test_n_four_bar_swings_as_the_benchmark_says_until_the_singular_pose():
    """IFToMM A02, N = 2: from upright at 1 m/s; the closed one-freedom equation gives theta(t)
    before the cranks lie down."""
    robot = lw.Robot(n_four_bar(2))
    run = robot.simulate(robot.home.with_rates([-1.0]), duration=0.4, rtol=1e-10, atol=1e-12)
    assert run.status is lw.Status.FINISHED
    from scipy.integrate import solve_ivp

    reference = solve_ivp(
        lambda t, y: [y[1], -3.5 * 9.81 * np.cos(y[0]) / 3],
        (0, 0.4),
        [np.pi / 2, -1],
        rtol=1e-12,
        atol=1e-13,
    )
    assert np.isclose(
        run["joint_position"].sel(coordinate="pivot_0").values[-1],
        reference.y[0, -1],
        atol=1e-8,
    )


def test_five_bar_tool_in_closed_form():
    """The tip lies where the circles about the two elbows meet."""
    robot = lw.Robot(five_bar())
    state = robot.assemble(tool=[0.15, 0.42])
    tip = robot.tool_pose(state)[:2]
    assert np.allclose(tip, [0.15, 0.42], atol=1e-12)
    for motor, base in (("motor_1", 0.0), ("motor_2", 0.3)):
        elbow = np.array([base + 0.25 * np.cos(state[motor]), 0.25 * np.sin(state[motor])])
        assert np.isclose(np.linalg.norm(tip - elbow), 0.35, atol=1e-12)


def test_bricard_keeps_its_energy_over_the_regular_part_of_its_motion():
    robot = lw.Robot(bricard())
    run = robot.simulate(robot.home, duration=0.6, rtol=1e-10, atol=1e-12)
    assert run.status is lw.Status.FINISHED
    energy = (run["kinetic_energy"] + run["potential_energy"]).values
    assert np.ptp(energy) < 1e-8
    assert run.closure_error < 1e-12
