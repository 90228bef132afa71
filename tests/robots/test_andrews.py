"""Andrews' squeezer: the published start and end, and an independent solution at every digit."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import andrews
from linkwork.robots._andrews import ANGLES

from tests.oracle import andrews as equations
from tests.oracle.published import ANDREWS_END, ANDREWS_START

MOTION = ("joint_position", "joint_rate", "joint_acceleration")


def angles(robot, values):
    """Return the seven published angles, rates or accelerations out of those of all joints."""
    return values[..., [robot.coordinates.index(name) for name in ANGLES]]


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(andrews())


@pytest.mark.parametrize("beta", [equations.START[0], -0.0620, 0.5, 2.0, 4.0, -1.5])
def test_loops_close_at_the_reference(beta):
    """IFToMM A03 starts at beta = -0.0620; the crank can stand anywhere."""
    reference = andrews(beta).reference
    assert np.allclose(equations.closures([reference[name] for name in ANGLES]), 0, atol=1e-16)


def test_reference_is_the_published_start():
    assert np.allclose(
        [andrews().reference[name] for name in ANGLES], ANDREWS_START[0], rtol=0, atol=1e-15
    )


def test_joints_at_P_close_the_loops_by_angle():
    q = andrews(0.3).reference
    second = q["beta"] + q["Theta"]
    assert q["P_3"] == pytest.approx(q["gamma"] - second, abs=1e-15)
    assert q["P_4"] == pytest.approx(q["Phi"] + q["delta"] - second, abs=1e-15)
    assert q["P_6"] == pytest.approx(q["Omega"] + q["epsilon"] - second, abs=1e-15)


def test_freedoms(robot):
    assert (robot.mobility, robot.gruebler, len(robot.redundant), len(robot.idle)) == (1, 1, 0, 0)
    assert robot.independent == ("beta",)
    assert robot.planar


def test_published_accelerations_at_the_start(robot):
    acceleration = robot.forward_dynamics(robot.home, [equations.torque])
    found = angles(robot, robot.joint_accelerations(robot.home, acceleration))
    assert np.allclose(found, ANDREWS_START[2], rtol=1e-11, atol=1e-7)


def test_accelerations_along_the_motion(robot):
    for q, v in zip(*equations.motion([0.005, 0.01, 0.02, 0.027]), strict=True):
        state = robot.assemble({"beta": q[0]}).with_rates(v[:1])
        assert np.allclose(np.sin(angles(robot, state.positions) - q), 0, atol=1e-12)
        assert np.allclose(angles(robot, robot.joint_rates(state)), v, rtol=1e-11, atol=1e-9)
        acceleration = robot.forward_dynamics(state, [equations.torque])
        found = angles(robot, robot.joint_accelerations(state, acceleration))
        assert np.allclose(found, equations.accelerations(q, v)[0], rtol=1e-9, atol=1e-6)


TIGHT = {"rtol": 1e-12, "atol": 1e-14}


def test_published_motion(robot):
    """At 1e-5, which the printed values allow everywhere."""
    run = robot.simulate(robot.home, [equations.torque], duration=0.03, rtol=1e-9)
    assert run.status is lw.Status.FINISHED
    for quantity, published in zip(MOTION, ANDREWS_END, strict=False):
        assert np.allclose(angles(robot, run.variables[quantity].values[-1]), published, rtol=1e-5)


@pytest.mark.long
def test_motion_of_the_independent_solution(robot):
    times = np.array([0.0, 0.01, 0.02, 0.03])
    run = robot.simulate(
        robot.home, [equations.torque], duration=0.03, method="dop853", **TIGHT, save_at=times
    )
    q, v = equations.motion(times)
    assert np.allclose(
        angles(robot, run.variables["joint_position"].values), q, rtol=1e-10, atol=1e-11
    )
    assert np.allclose(angles(robot, run.variables["joint_rate"].values), v, rtol=1e-10, atol=1e-8)
    assert run.closure_error * robot.equations.tree.length < 1e-14


@pytest.mark.long
def test_iftomm_problem_A03():
    """The same mechanism from beta = -0.0620 for 0.05 s, against the independent solution."""
    mechanism = andrews(beta=-0.0620)
    robot = lw.Robot(mechanism)
    times = np.array([0.0, 0.025, 0.05])
    run = robot.simulate(
        robot.home, [equations.torque], duration=0.05, rtol=1e-11, atol=1e-13, save_at=times
    )
    q, _ = equations.motion(times, np.array([mechanism.reference[name] for name in ANGLES]))
    assert np.allclose(
        angles(robot, run.variables["joint_position"].values), q, rtol=1e-8, atol=1e-9
    )


@pytest.mark.parametrize("beta", [float("nan"), float("inf")])
def test_an_angle_that_is_not_finite_is_refused(beta):
    with pytest.raises(lw.MechanismError, match=f"beta: is {beta}; give a finite angle"):
        andrews(beta)


def test_total_mass_is_the_published_one():
    assert sum(body.mass for body in andrews().bodies.values()) == pytest.approx(0.21023, rel=1e-12)
