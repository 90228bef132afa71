"""Robots of mixed freedoms: what they reach, in how many modes, by the closed forms of their
legs."""

from __future__ import annotations

from itertools import product

import numpy as np

import linkwork as lw
from linkwork.analysis import working_modes, workspace

from tests.robot.mixed_freedoms import (
    BASE,
    FIRST,
    SECOND,
    TOP,
    pose_of_three_legs,
    rotation_z,
    scara,
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
