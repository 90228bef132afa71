"""Platforms that only shift: the 3-UPU, whose legs' constraints may let go of its turns, and a
Tripteron that carries a wrist, by their closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import assembly_modes, input_output, singularity, working_modes, workspace

BASE, TOP, HEIGHT = 0.3, 0.15, 0.4
Z = np.array([0.0, 0.0, 1.0])
AZIMUTHS = 2 * np.pi / 3 * np.arange(3)


def legs(p):
    """Return the legs (3, 3) of a 3-UPU from base to platform that has not turned, and the
    directions (3, 3) about which each does not let it turn: across both axes of its joints."""
    e = np.stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS), 0 * AZIMUTHS], axis=1)
    tangents = np.cross(Z, e)
    away = np.asarray(p) + (TOP - BASE) * e
    across = away - tangents * np.sum(tangents * away, axis=1)[:, None]
    return away, across / np.linalg.norm(across, axis=1)[:, None]


@cache
def upu(base=BASE, top=TOP):
    """A 3-UPU: the first axis of each universal joint lies along the tangent of base or
    platform."""
    bodies, joints, reference = {}, {}, {}
    heavy = lw.Inertia(xx=4e-3, yy=4e-3, zz=4e-4)
    for i, azimuth in enumerate(AZIMUTHS, start=1):
        radial = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        seat, tilt = (0.0, 0.0, azimuth + np.pi / 2), np.arctan2(top - base, HEIGHT)
        bodies[f"barrel_{i}"] = lw.Body(mass=1.0, centre_of_mass=(0, 0, 0.1), inertia=heavy)
        bodies[f"rod_{i}"] = lw.Body(mass=0.6, centre_of_mass=(0, 0, -0.1), inertia=heavy)
        joints[f"lower_{i}"] = lw.UniversalJoint(
            connects=("ground", f"barrel_{i}"),
            frames=(lw.Frame(position=tuple(base * radial), rotation=seat), lw.Frame()),
        )
        joints[f"jack_{i}"] = lw.PrismaticJoint(connects=(f"barrel_{i}", f"rod_{i}"))
        joints[f"upper_{i}"] = lw.UniversalJoint(
            connects=(f"rod_{i}", "platform"),
            frames=(lw.Frame(), lw.Frame(position=tuple(top * radial), rotation=seat)),
            axes=((0, 1, 0), (1, 0, 0)),
        )
        reference |= {
            f"jack_{i}": float(np.hypot(HEIGHT, top - base)),
            f"lower_{i}.angle_1": float(tilt),
            f"upper_{i}.angle_2": float(-tilt),
        }
    platform = lw.Body(mass=2.0, inertia=lw.Inertia(xx=0.01, yy=0.01, zz=0.02))
    return lw.Robot(
        lw.Mechanism(
            name="3-UPU",
            bodies=bodies | {"platform": platform},
            joints=joints,
            actuators=("jack_1", "jack_2", "jack_3"),
            tools={"tip": lw.Tool(body="platform")},
            reference=reference,
        )
    )


@pytest.mark.long
def test_a_3_upu_shifts_by_the_lengths_of_its_legs():
    robot = upu()
    assert robot.mobility == 3 and robot.task == ("x", "y", "z") and robot.notes == ()
    assert singularity(robot, robot.home).kinds == ()
    motion = robot.follow(lw.paths.circle((0.02, -0.03, 0.45), 0.1), 1.0, samples=21)
    lengths = np.array([np.linalg.norm(legs(p)[0], axis=1) for p in motion.tool])
    found = np.array([motion.state[name] for name in robot.actuators]).T
    np.testing.assert_allclose(found, lengths, atol=1e-12)
    state = robot.assemble(tool=motion.tool[5])
    A, B = input_output(robot, state)
    along = legs(motion.tool[5])[0] / lengths[5][:, None]
    np.testing.assert_allclose(A / np.diag(B)[:, None], along, atol=1e-9)
    # Of all ways to stand there those that have not turned have legs of two signs each.
    modes = working_modes(robot)
    straight = [
        np.allclose(robot.tool_pose(modes.states.at(k))[3:], 0, atol=1e-6)
        for k in range(len(modes))
    ]
    lengths = np.abs(modes.states["jack_1"][straight])
    assert sum(straight) == 8 and np.allclose(lengths, np.linalg.norm(legs((0, 0, HEIGHT))[0][0]))
    assert len(assembly_modes(robot)) >= 2


@pytest.mark.sample(1)
@pytest.mark.parametrize(("count", "half"), [(21, 0.3), (40, 0.5), (61, 0.3)])
def test_a_3_upu_works_up_to_where_its_platform_may_turn(count, half):
    """Where the directions that hold the platform lie in one plane, over the circle through its
    base's joints: poses of the grid that lie right there lead to no other branch."""
    robot, axis = upu(), np.linspace(-half, half, count)
    mapped = workspace(robot, {"x": axis, "y": axis, "z": HEIGHT})
    poses = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.full((count, count), HEIGHT)], -1)
    held = np.array([[np.linalg.det(legs(p)[1]) for p in row] for row in poses])
    np.testing.assert_array_equal(mapped["reachable"], held > 1e-9)
    lengths = np.array([[np.linalg.norm(legs(p)[0], axis=1) for p in row] for row in poses])
    found = mapped["actuator_position"].values[held > 1e-9]
    np.testing.assert_allclose(found, lengths[held > 1e-9], atol=1e-12)


def test_a_3_upu_is_told_to_let_go_where_it_may_turn():
    robot, away = upu(), np.array([1e-3, 1e-4, 1e-5, 0.0])
    assert abs(np.linalg.det(legs((0, BASE, HEIGHT))[1])) < 1e-12
    told = [singularity(robot, robot.assemble(tool=(0, BASE - d, HEIGHT))) for d in away]
    held = [one.constraint for one in told]
    np.testing.assert_allclose(held[:2] / away[:2], held[2] / away[2], rtol=0.02)
    assert told[2].kinds == () and told[3].kinds == ("constraint",)
    over = lw.paths.line((0, 0.2, HEIGHT), (0, 0.4, HEIGHT))
    with pytest.raises(lw.LinkworkError, match="another branch"):
        robot.follow(over, 1.0)


def test_a_3_upu_that_may_turn_from_the_start_is_bent_and_says_so():
    """Base and platform alike: all legs are parallel."""
    with pytest.warns(lw.errors.ModelWarning, match="branches of motion meet at the given refer"):
        robot = upu(0.2, 0.2)
    assert robot.mobility == 3 and "branches of motion meet" in robot.notes[0]
    assert singularity(robot, robot.home).kinds == ()


def wrist(task, *axes):
    """Return a Tripteron whose platform carries hinges in a row, all through its centre, and a tool
    0.08 m under it."""
    carrier = lw.robots.tripteron()
    bodies, joints, last = dict(carrier.bodies), dict(carrier.joints), "platform"
    for k, axis in enumerate(axes, start=1):
        bodies[f"wrist_{k}"] = lw.Body(mass=0.1, inertia=lw.Inertia(xx=1e-4, yy=1e-4, zz=1e-4))
        joints[f"turn_{k}"] = lw.RevoluteJoint(connects=(last, f"wrist_{k}"), axis=axis)
        last = f"wrist_{k}"
    turns = tuple(f"turn_{k + 1}" for k in range(len(axes)))
    tool = lw.Tool(body=last, frame=lw.Frame(position=(0, 0, -0.08)), task=task)
    made = {
        "bodies": bodies,
        "joints": joints,
        "actuators": (*carrier.actuators, *turns),
        "tools": {"tip": tool},
    }
    return lw.Robot(carrier.model_copy(update=made))


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("task", "axes", "modes"),
    [
        (None, ((0, 0, 1),), 1),
        (("x", "y", "z", "tilt_x", "tilt_y"), ((1, 0, 0), (0, 1, 0)), 2),
        (None, ((0, 0, 1), (0, 1, 0), (1, 0, 0)), 2),
    ],
)
def test_a_tripteron_with_a_wrist_is_led_as_its_platform_and_hinges_stand(task, axes, modes):
    """Its drives are the coordinates of the platform's centre, which is 0.08 m along the tool's z
    axis from it; the wrist alone turns."""
    robot = wrist(task, *axes)
    names, n = robot.task, 3 + len(axes)
    assert robot.mobility == len(names) == n and singularity(robot, robot.home).kinds == ()
    start = robot.task_values(robot.home)
    shift = np.concatenate([[0.05, 0.03, -0.04], [0.3, -0.2, 0.4][: n - 3]])
    motion = robot.follow(lw.paths.line(start, start + shift), 1.0, samples=11)
    drives = np.array([motion.state[name] for name in robot.actuators]).T
    _, R = robot.body_poses(motion.state)[f"wrist_{len(axes)}"]
    np.testing.assert_allclose(robot.task_values(motion.state), motion.tool, atol=1e-12)
    np.testing.assert_allclose(motion.tool[:, :3] + 0.08 * R[..., 2], drives[:, :3], atol=1e-12)
    product = np.eye(3)
    for axis, angle in zip(axes, drives[:, 3:].T, strict=True):
        product = product @ np.array([turned(axis, a) for a in angle])
    np.testing.assert_allclose(R, product, atol=1e-12)
    assert len(working_modes(robot)) == modes
    grid = {name: np.linspace(v - 0.1, v + 0.1, 3) for name, v in zip(names, start, strict=True)}
    assert workspace(robot, grid)["reachable"].values.all()


def turned(axis, angle):
    """Return the rotation about an axis of the frame."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_a_tripteron_s_wrist_that_points_along_its_first_axis_says_what_it_cannot():
    """An azimuth and a tilt where the wrist's first hinge does not tilt."""
    robot = wrist(("x", "y", "z", "azimuth", "tilt"), (0, 0, 1), (1, 0, 0))
    assert singularity(robot, robot.home).kinds == ("I",)
    with pytest.raises(lw.LinkworkError, match="the guess is leg-singular"):
        workspace(robot, {"x": 0, "y": 0, "z": -0.08, "azimuth": 0.1, "tilt": [0.1, 0.2]})
    bent = robot.assemble({"slide_1": 0, "slide_2": 0, "slide_3": 0, "turn_1": 0, "turn_2": 0.3})
    values = dict(zip(robot.task, robot.task_values(bent), strict=True))
    mapped = workspace(robot, values | {"tilt": np.linspace(0.1, 0.5, 5)}, guess=bent)
    assert mapped["reachable"].values.all()
