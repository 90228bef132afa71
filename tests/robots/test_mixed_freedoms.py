"""The catalogue's robots that shift and turn: their inverse kinematics by plain geometry, leg by
leg, and what they are led in."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.analysis import singularity, working_modes, workspace
from linkwork.paths import Path

Z = np.array([0.0, 0.0, 1.0])


@lru_cache
def robot_of(name: str) -> lw.Robot:
    return lw.Robot(name)


def arms(name: str, targets: np.ndarray) -> np.ndarray:
    """Return the angles above level of driven links whose far ends see the points `targets` (K, 3)
    at the length of what hangs on them, elbows outside.

    With x, z in the arm's plane from the motor on and y across it:
    x cos a + z sin a = (x^2 + y^2 + z^2 + arm^2 - rod^2) / (2 arm).
    """
    base, arm, rod, azimuths = {
        "rrs3": (0.2, 0.15, 0.2, np.radians([0, 120, 240])),
        "par4": (0.25, 0.35, 0.8, np.radians([-45, 45, 135, 225])),
    }[name]
    e = np.stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths], axis=1)
    x, y, z = np.sum(e * targets, 1) - base, np.sum(np.cross(Z, e) * targets, 1), targets[:, 2]
    projection = (x**2 + y**2 + z**2 + arm**2 - rod**2) / (2 * arm)
    with np.errstate(invalid="ignore"):
        away = np.arccos(projection / np.hypot(x, z))
    return np.arctan2(z, x) + (-away if name == "rrs3" else away)


def balls(z: float, azimuth: float, tilt: float) -> np.ndarray:
    """Return the balls (3, 3) of the 3-RRS: R = Rz(f) Ry(t) Rz(-f), its centre aside by
    h = r (1 - cos t) / 2."""
    turn = Rotation.from_euler("z", azimuth)
    R = (turn * Rotation.from_euler("y", tilt) * turn.inv()).as_matrix()
    h = 0.15 * (1 - np.cos(tilt)) / 2
    angles = np.radians([0, 120, 240])
    seats = 0.15 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return np.array([-h * np.cos(2 * azimuth), h * np.sin(2 * azimuth), z]) + seats @ R.T


def vertices(x: float, y: float, z: float, turn: float) -> np.ndarray:
    """Return where the rods of the Par4 end (4, 3), in the middle between two: the tool is on the
    front bar, 0.05 m before the plate's middle."""
    shift = 0.05 * np.array([np.cos(turn) - 1, np.sin(turn), 0.0])
    angles = np.radians([-45, 45, 135, 225])
    e = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return np.array([x, y - 0.05, z]) + 0.1 * e + np.array([1, 1, -1, -1])[:, None] * shift


# By name: points that the driven links see from the task, the task, a pose, and spreads about it.
LED = {
    "rrs3": (balls, ("z", "azimuth", "tilt"), (0.25, 0.0, 0.0), (0.03, 3.0, 0.3)),
    "par4": (vertices, ("x", "y", "z", "rz"), (0.0, 0.05, -0.7), (0.15, 0.15, 0.08, 0.7)),
}
SIGN = {"rrs3": 1, "par4": -1}  # of the motors' angles above level
both = pytest.mark.parametrize("name", LED)


def near(name: str, number: int, seed: int) -> np.ndarray:
    _, task, centre, spread = LED[name]
    centre = np.pad(centre, (0, len(task) - len(centre)))
    shifts = np.random.default_rng(seed).uniform(-1, 1, (number, len(task)))
    return centre + shifts * spread


@both
def test_they_are_led_in_what_moves(name):
    robot = robot_of(name)
    assert robot.task == {"rrs3": ("z", "rx", "ry"), "par4": ("x", "y", "z", "rz")}[name]
    assert robot.notes == ()


@both
def test_inverse_kinematics_in_closed_form(name):
    robot, (ends, task, *_) = robot_of(name), LED[name]
    for values in near(name, 6, 1):
        state = robot.assemble(tool=dict(zip(task, values, strict=True)))
        found = [state[label] for label in robot.actuators]
        np.testing.assert_allclose(found, SIGN[name] * arms(name, ends(*values)), atol=1e-11)


@both
def test_direct_kinematics_keeps_what_the_legs_hold(name):
    """No torsion and the way aside of the one; upright bars and halves that never turn of the
    other."""
    robot, random = robot_of(name), np.random.default_rng(2)
    for shift in random.uniform(-0.15, 0.15, (4, len(robot.actuators))):
        targets = {
            label: robot.home[label] + d for label, d in zip(robot.actuators, shift, strict=True)
        }
        state = robot.assemble(targets)
        poses = robot.body_poses(state)
        if name == "par4":
            for half in ("left", "right"):
                np.testing.assert_allclose(poses[half][1], np.eye(3), atol=1e-12)
            np.testing.assert_allclose(poses["front"][1], poses["back"][1], atol=1e-12)
            np.testing.assert_allclose(poses["front"][1] @ Z, Z, atol=1e-12)
            continue
        z, azimuth, tilt, torsion = robot.task_values(state, ("z", "azimuth", "tilt", "torsion"))
        assert torsion == pytest.approx(0, abs=1e-12) and tilt > 0.01
        centre = balls(z, azimuth, tilt).mean(0)
        np.testing.assert_allclose(poses["platform"][0], centre, atol=1e-12)


@both
def test_following_a_path_takes_the_motors_along_their_closed_forms(name):
    robot, (ends, task, *_) = robot_of(name), LED[name]
    start, change = near(name, 2, 3)
    change = 0.2 * (change - start)

    def values(s):
        return start + np.multiply.outer(s**2, change)

    path = Path(lambda s: (values(s), np.outer(2 * s, change), np.outer(2 + 0 * s, change)))
    motion = robot.follow(path, 1.0, samples=21, what=task)
    expected = SIGN[name] * np.array([arms(name, ends(*row)) for row in motion.tool])
    found = np.array([motion.state[label] for label in robot.actuators]).T
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.long
@both
def test_the_workspace_is_what_all_legs_reach(name):
    robot, (ends, *_) = robot_of(name), LED[name]
    if name == "rrs3":
        grid = {"z": 0.28, "azimuth": np.linspace(-3, 3, 9), "tilt": np.linspace(0.05, 1.0, 9)}
        poses = [(0.28, f, t) for f in grid["azimuth"] for t in grid["tilt"]]
    else:
        grid = {"x": np.linspace(-0.8, 0.8, 9), "y": np.linspace(-0.7, 0.8, 9)}
        grid |= {"z": -0.75, "rz": 0.3}
        poses = [(x, y, -0.75, 0.3) for x in grid["x"] for y in grid["y"]]
    mapped = workspace(robot, grid)
    inside = [np.isfinite(arms(name, ends(*pose))).all() for pose in poses]
    assert 0.1 < np.mean(inside) < 0.95
    np.testing.assert_array_equal(np.ravel(mapped["reachable"]), inside)


@pytest.mark.long
@pytest.mark.parametrize("rod_mass", [0.0, 0.1])
def test_the_par4_s_workspace_keeps_to_one_branch_of_legs(rod_mass):
    """Its legs hold the halves of the plate where that is flat, but for a few poses that ways lead
    around: none is reached but as closed forms say, with elbows outward and halves unturned, and
    most are. With rods of mass all legs are one stage."""
    robot, ends = lw.Robot(lw.robots.par4(rod_mass=rod_mass)), LED["par4"][0]
    sides = np.linspace(-0.9, 0.8, 9), np.linspace(-0.8, 0.9, 9)
    heights, turns = np.linspace(-1.1, 0.3, 9), np.linspace(-3.0, 3.0, 7)
    axes = {"x": sides[0], "y": sides[1], "z": heights, "rz": turns}
    mapped = workspace(robot, axes)
    grid = np.meshgrid(*axes.values(), indexing="ij")
    poses = np.stack([part.ravel() for part in grid], axis=1)
    closed = np.array([-arms("par4", ends(*pose)) for pose in poses])
    within, reached = np.isfinite(closed).all(axis=1), np.ravel(mapped["reachable"])
    assert not (reached & ~within).any() and reached.sum() > 0.95 * within.sum()
    found = mapped["actuator_position"].values.reshape(closed.shape)
    np.testing.assert_allclose(np.exp(1j * found[reached]), np.exp(1j * closed[reached]), atol=1e-9)


@pytest.mark.sample(1)
@both
def test_each_leg_bends_in_two_ways(name):
    """Both have an elbow outside and inside for each motor while the platform is as at home; the
    Par4's halves, led by no number, may also stand turned."""
    robot = robot_of(name)
    modes = working_modes(robot)
    halves = [body for body in ("left", "right") if body in robot.bodies]
    as_home = np.ones(len(modes), bool)
    for k, positions in enumerate(modes.states.positions):
        poses = robot.body_poses(robot.state(positions))
        as_home[k] = all(np.allclose(poses[half][1], np.eye(3), atol=1e-6) for half in halves)
    assert as_home.sum() == 2 ** len(robot.actuators)


def test_a_leg_of_the_3_rrs_that_stretches_is_singular_as_its_knee_straightens():
    """Tilted away from leg 1 until its ball is proximal + distal away: near that the knee is as the
    root of what is left to tilt."""
    robot, z, f = robot_of("rrs3"), 0.28, np.pi
    hip = np.array([0.2, 0.0, 0.0])
    last = brentq(lambda tilt: np.linalg.norm(balls(z, f, tilt)[0] - hip) - 0.35, 0.05, 1.2)
    left = 10.0 ** -np.arange(5, 10)
    states = [robot.assemble(tool={"z": z, "azimuth": f, "tilt": last - d}) for d in left]
    legs = [singularity(robot, state).leg for state in states]
    np.testing.assert_allclose(legs / np.sqrt(left), legs[-1] / np.sqrt(left[-1]), rtol=2e-3)
    with pytest.raises(lw.UnreachableError):
        robot.assemble(tool={"z": z, "azimuth": f, "tilt": last + 1e-3})
    assert singularity(robot, robot.home).kinds == ()


def test_the_plate_of_the_par4_is_singular_flat():
    """At a quarter turn its bars lie along its halves: the loops' regularity goes with the
    cosine."""
    robot, turns = robot_of("par4"), np.array([1.54, 1.56, 1.57, 1.5707])
    states = [robot.assemble(tool=[0.0, 0.05, -0.7, turn]) for turn in turns]
    loops = [singularity(robot, state).constraint for state in states]
    np.testing.assert_allclose(loops / np.cos(turns), loops[0] / np.cos(turns[0]), rtol=0.02)
    assert singularity(robot, robot.home).kinds == ()


@pytest.mark.long
def test_the_par4_is_not_led_to_folded_legs_behind_the_fold_of_its_plate():
    """The determinant of all legs and the plate comes back to its sign where the plate and a leg
    are folded; single legs tell it. In front of the fold what is reached by the arms is found."""
    robot, (ends, task, centre, spread) = robot_of("par4"), LED["par4"]
    refused, middle = [], np.pad(centre, (0, 1))
    for values in middle + np.random.default_rng(5).uniform(-3, 3, (60, 4)) * spread:
        closed = -arms("par4", ends(*values))
        try:
            state = robot.assemble(tool=dict(zip(task, values, strict=True)))
        except lw.UnreachableError as error:
            refused.append(str(error))
            assert not np.isfinite(closed).all() or abs(values[3]) > np.pi / 2
            continue
        found = np.array([state[label] for label in robot.actuators])
        np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * closed), atol=1e-9)
    assert any("on another branch" in text for text in refused)
