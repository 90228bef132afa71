"""Robots of mixed freedoms: what they reach, in how many modes, by the closed forms of their
legs."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import singularity, working_modes, workspace

from tests.robot.mixed_freedoms import (
    BASE,
    FIRST,
    HEIGHT,
    SECOND,
    TOP,
    pose_of_three_legs,
    rotation_z,
    scara,
    three_cpr,
    three_legs,
)


def test_three_legs_reach_what_their_links_do():
    """Poses of a 3-RRS over tilt and its azimuth, by the closed form of the platform's way."""
    robot = lw.Robot(three_legs("RRS"))
    azimuths, tilts = np.linspace(-3.0, 3.0, 13), np.linspace(0.0, 1.2, 13)
    mapped = workspace(robot, {"z": 0.5, "azimuth": azimuths, "tilt": tilts})
    assert mapped["tilt"].attrs["units"] == "rad" and mapped["z"].attrs["units"] == "m"
    inside = np.empty((13, 13), bool)
    for (i, azimuth), (j, tilt) in product(enumerate(azimuths), enumerate(tilts)):
        position, R = pose_of_three_legs(0.5, azimuth, tilt)
        e = [rotation_z(angle)[:, 0] for angle in np.radians([0.0, 120.0, 240.0])]
        away = [np.linalg.norm(position + TOP * R @ leg - BASE * leg) for leg in e]
        inside[i, j] = max(away) < FIRST + SECOND and min(away) > SECOND - FIRST
    assert 0.2 < inside.mean() < 0.95
    np.testing.assert_array_equal(mapped["reachable"], inside)
    level = mapped["conditioning"].sel(tilt=0.0)
    np.testing.assert_allclose(level, 1.0, atol=1e-6)


def test_a_scara_arm_works_in_two_modes_and_shifts_where_its_links_reach():
    robot = lw.Robot(scara())
    assert sorted(np.sign(working_modes(robot).states["elbow"])) == [-1, 1]
    grid = {"x": np.linspace(-0.8, 0.8, 17), "y": np.linspace(-0.77, 0.77, 13), "z": 0.0, "rz": 0.4}
    mapped = workspace(robot, grid)
    reach = np.hypot(*np.meshgrid(grid["x"], grid["y"], indexing="ij"))
    np.testing.assert_array_equal(mapped["reachable"], (reach < 0.7) & (reach > 0.1))


def test_a_3_cpr_shifts_by_the_lengths_of_its_legs():
    """Its platform never turns: leg i, free along its foot's axis, is as long as
    hypot(TOP - BASE + x.e_i, z)."""
    robot = lw.Robot(three_cpr())
    assert robot.mobility == 3 and robot.task == ("x", "y", "z") and robot.notes == ()
    assert singularity(robot, robot.home).kinds == ()
    azimuths = 2 * np.pi / 3 * np.arange(3)
    for aside in np.random.default_rng(3).uniform(-0.2, 0.2, (5, 3)):
        x, y, z = np.array([0.0, 0.0, HEIGHT]) + aside
        state = robot.assemble(tool=[x, y, z])
        out = TOP - BASE + x * np.cos(azimuths) + y * np.sin(azimuths)
        found = [state[name] for name in robot.actuators]
        np.testing.assert_allclose(found, np.hypot(out, z), atol=1e-12)
        np.testing.assert_allclose(robot.tool_pose(state)[3:], 0, atol=1e-12)
    assert len(working_modes(robot)) == 8


def test_angles_that_have_no_rates_at_home_are_led_elsewhere():
    """The hand of a Puma points upwards at home, where roll and yaw are one; beside it they are
    led, and home is refused in a sentence or told as singular."""
    mechanism = lw.robots.puma560()
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    tools = {n: tool.model_copy(update={"task": names}) for n, tool in mechanism.tools.items()}
    robot = lw.Robot(mechanism.model_copy(update={"tools": tools}))
    aside = robot.state(robot.home.positions + np.array([0.1, 0.1, 0.1, 0.2, 0.3, 0.1]))
    x = robot.task_values(aside)
    grid = dict(zip(names, [x[0] + np.array([-0.01, 0.0, 0.01]), *x[1:]], strict=True))
    assert bool(workspace(robot, grid, guess=aside).reachable.all())
    assert len(working_modes(robot, x.tolist(), starts=2000)) == 8
    # Its wrist stays on its side, which no sample at home tells.
    far = robot.assemble(tool=[0.65, -0.04, 0.85, 2.15, 0.64, 2.14], guess=aside)
    assert far["joint_5"] > 0 and aside["joint_5"] > 0
    assert robot.conditioning(robot.home) < 1e-9 < 0.1 < robot.conditioning(aside)
    assert not singularity(robot, aside).kinds
    with pytest.raises(lw.LinkworkError, match="has no rate at this pose; lead the tool around"):
        singularity(robot, robot.home)
