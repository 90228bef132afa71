"""The same motion by several ways: how near they come to each other, for the paper's robot and for
another one."""

import dataclasses

import numpy as np
import pytest

import linkwork as lw
from linkwork.lab import engines, overlays
from linkwork.lab.comparison import (
    NOC,
    PRESCRIBED,
    compare,
    largest_differences,
    position_differences,
)

from tests.catalogue import built

BOUNDS = {"exudyn": (2e-5, 2e-3), "pinocchio": (5e-9, 5e-8), "mujoco": (5e-8, 5e-6)}
"""Of positions [m] and of accelerations [m/s^2], at steps of 1 ms."""


@pytest.mark.long
def test_forward_dynamics_undoes_inverse_dynamics(comparison):
    found = largest_differences(comparison.robot, comparison[PRESCRIBED], comparison[NOC])
    assert found["tool", "m"] < 1e-9
    assert found["joint position", "m"] < 1e-9
    assert found["acceleration", "m/s²"] < 1e-6
    assert comparison.spline_error.max() < 1e-6
    assert comparison[NOC].closure_error < 1e-12


@pytest.mark.parametrize("name", engines.CLASSES)
def test_engines_agree_with_linkwork(comparison, name):
    if name not in engines.available():
        pytest.skip(f"{name} is an optional extra and not installed")
    curve = comparison[name]
    found = largest_differences(comparison.robot, curve, comparison[NOC])
    position, acceleration = BOUNDS[name]
    assert found["tool", "m"] < position
    assert found["joint position", "m"] < position
    assert found["joint position", "rad"] < 20 * position
    assert found["acceleration", "m/s²"] < acceleration
    assert curve.closure_error < 1e-7
    assert curve.steps == 1000
    # a motion of this size, not one that stands still
    assert np.ptp(curve.positions, axis=0).min() > 0.05


def test_differences_are_the_largest_over_time_by_unit(comparison):
    robot, curve = comparison.robot, comparison[NOC]
    positions, accelerations, tool = (
        curve.positions.copy(),
        curve.accelerations.copy(),
        curve.tool.copy(),
    )
    positions[7, robot.coordinates.index("slide_2")] += 0.25
    positions[9, robot.coordinates.index("wrist_1")] -= 0.5
    accelerations[3, 2] += 4.0
    tool[5] += [0.3, 0.4, 2 * np.pi - 0.01]
    other = dataclasses.replace(curve, positions=positions, accelerations=accelerations, tool=tool)
    expected = {
        ("joint position", "m"): 0.25,
        ("joint position", "rad"): 0.5,
        ("acceleration", "m/s²"): 4.0,
        ("tool", "m"): 0.5,
        ("tool", "rad"): 0.01,
    }
    assert largest_differences(robot, other, curve) == pytest.approx(expected)


def test_quaternions_differ_by_the_angle_between_their_turns():
    robot = built("spatial_slider_crank")
    turn = np.array([np.cos(0.35), 0, np.sin(0.35), 0])  # by 0.7 rad
    a, b = np.zeros((2, 8)), np.zeros((2, 8))
    a[:, 4:], b[:, 4:] = (1, 0, 0, 0), (turn, -turn)
    differences = list(position_differences(robot, a, b))
    assert [unit for unit, _ in differences] == ["rad", "m", "rad", "rad", "rad"]
    np.testing.assert_allclose(differences[-1][1], 0.7)


def test_data_hold_all_curves_with_names_and_units(comparison):
    data = comparison.dataset
    assert list(data.source.values) == [curve.source for curve in comparison.curves]
    for curve in comparison.curves:
        np.testing.assert_array_equal(data.joint_position.sel(source=curve.source), curve.positions)
        np.testing.assert_array_equal(data.tool_pose.sel(source=curve.source), curve.tool)
    assert all(variable.attrs["units"] for variable in data.data_vars.values())
    assert data.time.attrs["units"] == "s"
    np.testing.assert_array_equal(data.actuator_force, comparison.forces)


@pytest.fixture(scope="module")
def arm_comparison(arm):
    circle = lw.paths.circle((0.45, 0.2), 0.1)
    start = arm.assemble(tool=[0.55, 0.2])
    motion = arm.follow(circle, 0.8, samples=801, guess=start)
    asked = [name for name in ("pinocchio",) if name in engines.available()]
    return compare(arm, motion, asked, step=1e-3)


def test_another_robot_goes_through_the_same_machinery(arm_comparison):
    for curve in arm_comparison.curves:
        found = largest_differences(arm_comparison.robot, curve, arm_comparison[NOC])
        assert set(found) == {
            ("joint position", "rad"),
            ("acceleration", "rad/s²"),
            ("tool", "m"),
            ("tool", "rad"),
        }
        assert found["tool", "m"] < 1e-8
    figure = overlays.series_figure(arm_comparison, "positions", "position", "m", "rad")
    assert {axes.get_ylabel() for axes in figure.axes} >= {"position [rad]"}
    assert "[N m]" in overlays.forces_figure(arm_comparison).axes[0].get_ylabel()
    overlays.path_figure(arm_comparison)
    overlays.summary_figure(arm_comparison)


def test_samples_and_steps_that_do_not_fit_are_refused(robot):
    motion = robot.follow(lw.paths.line([0.5, 0.29, 0.5], [0.52, 0.29, 0.5]), 0.1, samples=11)
    with pytest.raises(lw.LinkworkError, match="do not divide"):
        compare(robot, motion, engines.available()[:1], step=3e-3)
    motion = robot.follow(lw.paths.line([0.5, 0.29, 0.5], [0.52, 0.29, 0.5]), 0.1, samples=10)
    with pytest.raises(lw.LinkworkError, match="10 samples; give an odd number"):
        compare(robot, motion, [])
