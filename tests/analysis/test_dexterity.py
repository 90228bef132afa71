"""Indices of dexterity against closed forms: two-link arm, five-bar, isotropic robots."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import (
    content,
    dexterity,
    global_conditioning,
    jacobians,
    singularity,
    workspace,
)

from tests.analysis.mechanisms import arm
from tests.catalogue import built
from tests.robot.mixed_freedoms import three_cpr, three_legs, turned

SIGNS = ((1, 1), (-1, 1), (1, -1), (-1, -1))


def test_an_arm_of_two_links():
    """|det J| = l1 l2 |sin q2|, and the singular values of the textbook's J."""
    robot = arm(1.0, 0.6)
    q = np.array([[0.3, 0.9], [1.2, -2.0], [0.0, np.pi / 2]])
    found = dexterity(robot, robot.state(q))
    np.testing.assert_allclose(found.manipulability, 0.6 * np.abs(np.sin(q[:, 1])), rtol=1e-12)
    for k, (one, two) in enumerate(q):
        a, b = np.exp(1j * one), 0.6 * np.exp(1j * (one + two))
        J = np.array([[-(a + b).imag, -b.imag], [(a + b).real, b.real]])
        assert found.conditioning[k] == pytest.approx(1 / np.linalg.cond(J))
    folded = dexterity(robot, robot.state([0.4, 0.0]))
    assert folded.manipulability == pytest.approx(0, abs=1e-12)
    assert folded.conditioning == pytest.approx(0, abs=1e-12)


def test_the_transmission_angle_of_a_five_bar_is_that_between_its_distal_links():
    robot = built("five_bar")
    tips = np.array([[0.15, 0.4], [0.1, 0.35], [0.2, 0.45]])
    states = robot.assemble(tool=tips)
    found, between = dexterity(robot, states), np.array(states["tip"])
    np.testing.assert_allclose(
        np.sin(found.transmission_angle), np.abs(np.sin(between))[:, None] * [1, 1], rtol=1e-9
    )
    np.testing.assert_allclose(found.transmissibility, np.sin(found.transmission_angle))


def test_robots_that_move_alike_in_all_directions():
    for robot in (built("agile_wrist"), built("tripteron"), lw.Robot(three_legs("RRS"))):
        found = dexterity(robot, robot.home)
        assert found.conditioning == pytest.approx(1.0, abs=1e-9)
        np.testing.assert_allclose(found.transmissibility, 1.0, atol=1e-9)


@pytest.mark.long
def test_the_global_index_is_the_mean_over_what_is_reached():
    """A ring, in which the conditioning depends on the distance alone: by quadrature over it."""
    robot = arm(1.0, 0.6)
    grid = np.linspace(-1.7, 1.7, 341)
    mapped = workspace(robot, {"x": grid, "y": grid})
    elbow = np.linspace(1e-4, np.pi - 1e-4, 4001)
    reach = np.abs(1 + 0.6 * np.exp(1j * elbow))
    condition = dexterity(robot, robot.state(np.stack([0 * elbow, elbow], axis=1))).conditioning
    ring = np.trapezoid(condition * reach, reach) / np.trapezoid(reach, reach)
    assert global_conditioning(mapped) == pytest.approx(ring, rel=0.01)
    with pytest.raises(lw.LinkworkError, match="nothing of the workspace is reached"):
        global_conditioning(workspace(robot, {"x": grid + 9, "y": grid}))


def test_axes_that_decrease_hold_as_much_as_those_that_grow():
    robot, x, y = arm(1.0, 0.6), np.linspace(0.5, 1.7, 5), np.linspace(0.0, 1.0, 5)
    grown, *others = (workspace(robot, {"x": x[::i], "y": y[::j]}) for i, j in SIGNS)
    for other in others:
        assert content(other) == pytest.approx(content(grown))
        assert global_conditioning(other) == pytest.approx(global_conditioning(grown))


def test_coordinates_are_named_by_what_their_rates_are():
    """An azimuth and a tilt are told as tilt (cos azimuth, sin azimuth)."""
    robot = lw.Robot(three_legs("RRS"))
    state = robot.assemble(tool={"z": 0.5, "azimuth": 0.3, "tilt": 0.2})
    found = jacobians(robot, ("z", "azimuth", "tilt"))
    J = robot.jacobian(state, found.what) @ np.linalg.inv(robot.actuation(state))
    np.testing.assert_allclose(found(state.q).J, J, rtol=1e-9)
    assert dexterity(robot, state, what=("z", "azimuth", "tilt")).what == found.what


def test_refusals():
    with pytest.raises(lw.LinkworkError, match="names no tool"):
        dexterity(built("bricard"), built("bricard").home)
    with pytest.raises(lw.LinkworkError, match="characteristic length"):
        dexterity(built("prr3"), built("prr3").home, length=-1.0)


LEANING = (0.3, -0.2, 0.5)


@pytest.mark.parametrize("kind", ["RRS", "RPS"])
def test_what_a_leaning_tool_is_led_in_is_told_by_all_alike(kind):
    """On a ground that leans z and two tilts are no coordinates of the pose. Its position, which
    moves along one direction alone where the platform is level, was told as the task by some."""
    robot = lw.Robot(turned(three_legs(kind), LEANING))
    home = robot.home
    assert robot.task == ()
    assert singularity(robot, home).held == "the tool"
    for ask in (
        robot.task_coordinates,
        lambda: robot.jacobian(home),
        lambda: dexterity(robot, home),
    ):
        with pytest.raises(lw.LinkworkError, match="name the coordinates"):
            ask()
    # What is asked for by so many numbers is still that part of the pose.
    place = robot.tool_pose(robot.assemble({name: home[name] + 0.05 for name in robot.actuators}))
    beside = robot.assemble(tool=place[:3])
    np.testing.assert_allclose(robot.tool_pose(beside)[:3], place[:3], atol=1e-9)


@pytest.mark.parametrize("make", [lw.robots.delta, lw.robots.stewart, three_cpr])
def test_a_leaning_robot_is_as_dexterous_as_an_upright_one(make):
    upright, leaning = lw.Robot(make()), lw.Robot(turned(make(), LEANING))
    assert leaning.task == upright.task
    found = [dexterity(robot, robot.home).singular_values for robot in (upright, leaning)]
    np.testing.assert_allclose(*found, rtol=1e-9)
    assert leaning.conditioning(leaning.home) == pytest.approx(upright.conditioning(upright.home))
