"""Conditioning against numerical differences, against a robot known to be isotropic, and at a
singular pose."""

import numpy as np
import pytest

from linkwork import Robot, robots
from linkwork.analysis import along, jacobians, workspace
from linkwork.model.dexterity import conditioning
from linkwork.scene.fixtures import fixtures_of
from linkwork.viewer.conditioning import colour
from linkwork.viewer.pursuit import Pursuit


def of(robot: Robot, state=None) -> tuple[float, Pursuit]:
    pursuit = Pursuit(robot, fixtures_of(robot).size)
    return float(conditioning(robot, (state or robot.home).q[None])[0]), pursuit


def test_it_is_that_of_the_jacobian_by_differences():
    robot = Robot(robots.prr3())
    found, _ = of(robot)
    h, home = 1e-5, {name: float(robot.home[name]) for name in robot.actuators}

    def pose(name: str, step: float) -> np.ndarray:
        return robot.tool_pose(robot.assemble(home | {name: home[name] + step}))

    J = np.stack([(pose(name, h) - pose(name, -h)) / (2 * h) for name in robot.actuators], axis=1)
    J[2] *= jacobians(robot).characteristic_length
    assert found == pytest.approx(1 / np.linalg.cond(J), rel=1e-6)


def test_the_agile_wrist_is_isotropic_in_its_reference_configuration():
    """Gosselin and Hamel 1994: all axes at right angles, J is a multiple of a rotation."""
    assert of(Robot(robots.agile_wrist()))[0] == pytest.approx(1.0, abs=1e-9)


def test_it_vanishes_where_a_leg_is_stretched():
    robot = Robot(robots.five_bar())
    first, pursuit = of(robot)
    out = pursuit.assembler.still(robot.home.q)
    goal = pursuit.tool_goal(out["position"] + (5, 0, 0), out["orientation"].reshape(3, 3))
    assert of(robot, pursuit.lead(robot.home, goal).state)[0] < 0.1 * first


def test_runs_maps_and_the_viewer_tell_the_same_number():
    robot = Robot(robots.prr3())
    run = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=0.2, save_at=[0.0, 0.1, 0.2])
    states = robot.state(run.dataset.joint_position.values)
    expected = along(robot, states)["conditioning"].values
    np.testing.assert_allclose(run.dataset.conditioning, expected, rtol=1e-9)
    seen = [of(robot, states.at(k))[0] for k in range(3)]
    np.testing.assert_allclose(seen, expected, rtol=1e-9)
    x, y, angle = robot.tool_pose(states.at(2))
    mapped = workspace(robot, {"x": x, "y": y, "angle": angle}, guess=states.at(2))
    np.testing.assert_allclose(mapped["conditioning"], expected[2], rtol=1e-9)


def test_one_freedom_without_a_tool_or_with_one():
    for name in ("four_bar", "slider_crank", "bricard"):
        assert 0 < of(Robot(getattr(robots, name)()))[0] <= 1


def test_colours_run_from_vermilion_to_blue():
    assert colour(0.0) == (213, 94, 0)
    assert colour(1.0) == (0, 114, 178)
    reds = [colour(x)[0] for x in np.geomspace(0.03, 0.5, 8)]
    assert reds == sorted(reds, reverse=True)
