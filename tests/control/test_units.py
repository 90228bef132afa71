"""Robots in micrometres and nanograms, quick or slow ones: controllers are the same but for
units."""

import numpy as np
import pytest

import linkwork as lw

from tests.oracle.scaling import Scale

SCALES = [(1e-6, 1e-9, 1.0), (1e4, 1e6, 1.0), (1.0, 1.0, 1e-5), (1.0, 1.0, 1e5)]


@pytest.mark.parametrize(("L", "M", "T"), SCALES)
def test_a_cart_is_held_at_least_cost(L, M, T):
    """m x'' = u at least q x^2 + r u^2: K = sqrt(q / r), sqrt(2 m sqrt(q / r))."""
    mechanism = lw.Mechanism(
        bodies={"cart": lw.Body(mass=3.0, inertia=lw.Inertia(zz=0.1))},
        joints={"slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))},
        actuators=("slide",),
    )
    robot = lw.Robot(Scale(mechanism, L, M, T).mechanism)
    F = M * L / T**2
    found = lw.control.LQR.about(robot, robot.home, [40 / L**2, 0.0], [0.1 / F**2])
    k = np.sqrt(40.0 / 0.1)
    assert np.allclose(found.gains / [F / L, F / L * T], [[k, np.sqrt(2 * 3 * k)]], rtol=1e-9)


@pytest.mark.parametrize(("L", "M", "T"), SCALES)
def test_a_five_bar_is_held_at_any_size_and_pace(L, M, T):
    found = []
    for factors in ((1.0, 1.0, 1.0), (L, M, T)):
        scale = Scale(lw.robots.five_bar(), *factors)
        robot = lw.Robot(scale.mechanism)
        units = np.array([1.0, 1.0, scale.T, scale.T])
        Q = (np.eye(4) + 0.1) * units * units[:, None]
        R = np.array([[1.0, 0.2], [0.2, 1.5]]) / scale.energy**2
        law = lw.control.LQR.about(robot, robot.home, Q, R)
        found.append(law.gains / scale.energy / units)
    assert np.allclose(found[1], found[0], rtol=1e-8, atol=1e-8 * np.abs(found[0]).max())
