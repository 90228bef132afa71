"""Motions that pass, between two samples, where their actuators do not hold them: of two legs that
meet in a point, where both are in line."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.model.passing import singularities_passed

from tests.catalogue import built

APART = 0.8  # of the pins on the ground [m]


@cache
def two_legs(actuators=("jack_1", "jack_2")):
    """Two legs of variable length on pins of the ground, which meet in the pen."""
    bodies, joints = {}, {}
    for k, pin in ((1, 0.0), (2, APART)):
        bodies |= {f"sleeve_{k}": lw.Body(mass=0.7, inertia=lw.Inertia(zz=4e-3))}
        bodies |= {f"rod_{k}": lw.Body(mass=0.3, inertia=lw.Inertia(zz=3e-3))}
        joints[f"pin_{k}"] = lw.RevoluteJoint(
            connects=("ground", f"sleeve_{k}"),
            frames=(lw.Frame(position=(pin, 0, 0)), lw.Frame()),
        )
        joints[f"jack_{k}"] = lw.PrismaticJoint(
            connects=(f"sleeve_{k}", f"rod_{k}"), axis=(1, 0, 0)
        )
    joints["tip"] = lw.RevoluteJoint(connects=("rod_1", "rod_2"))
    return lw.Robot(
        lw.Mechanism(
            bodies=bodies,
            joints=joints,
            actuators=actuators,
            tools={"pen": lw.Tool(body="rod_1", task=("x", "y"))},
            reference={"pin_1": 0.75, "jack_1": 0.6, "pin_2": 2.3, "jack_2": 0.55},
        )
    )


def crossings(motion):
    """Return the times between which the pen crosses the line through both pins."""
    y = motion.tool[:, 1]
    places = np.flatnonzero(y[:-1] * y[1:] < 0)
    return [(motion.time[k], motion.time[k + 1]) for k in places]


@pytest.mark.parametrize("samples", [40, 102, 501])
@pytest.mark.parametrize("radius", [0.1, 0.3, 0.9])
def test_singularities_between_samples_are_where_both_legs_are_in_line(samples, radius):
    robot = two_legs()
    motion = robot.follow(lw.paths.circle((0.4, 0.41), radius), 1.0, samples=samples)
    expected = crossings(motion)
    assert len(expected) == (2 if radius > 0.41 else 0)
    assert singularities_passed(robot, motion) == expected


def test_turning_legs_hold_where_pushing_legs_do_not():
    robot = two_legs(("pin_1", "jack_1"))
    motion = robot.follow(lw.paths.circle((0.4, 0.41), 0.9), 1.0, samples=102)
    assert crossings(motion) and singularities_passed(robot, motion) == []


def test_forces_of_a_motion_that_passes_a_singularity_are_warned_of():
    robot = two_legs()
    motion = robot.follow(lw.paths.line((1.2, 0.1), (1.2, -0.1)), 1.0, samples=40)
    with pytest.warns(ModelWarning, match=r"between 0\.487\d+ s and 0\.512\d+ s the motion passes"):
        robot.inverse_dynamics(motion)
    assert len(crossings(motion)) == 1


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", ["prr3", "five_bar", "stewart", "delta", "hexaglide", "puma560"])
def test_motions_among_regular_poses_are_not_warned_of_however_coarse(name):
    robot = built(name)
    home = robot.tool_pose(robot.home)[..., : len(robot.task)]
    ends = (home - 0.02).tolist(), (home + 0.02).tolist()
    for samples in (3, 50):
        motion = robot.follow(lw.paths.line(*ends), 1.0, samples=samples)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            robot.inverse_dynamics(motion)
