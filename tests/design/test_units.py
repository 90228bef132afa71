"""Robots in micrometres and nanograms, quick or slow ones: designs are the same but for units."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import design

from tests.oracle.scaling import Scale

SCALES = [(1e-6, 1e-9, 1.0), (1e4, 1e6, 1.0), (1e-3, 1e-6, 1e-3), (1.0, 1.0, 1e5)]


def cart(L, M, T):
    """Return a mass on a vertical slide."""
    mechanism = lw.Mechanism(
        bodies={"cart": lw.Body(mass=3.0, inertia=lw.Inertia(zz=0.1))},
        joints={"slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(0, 1, 0))},
        actuators=("slide",),
        gravity=(0, -9.81, 0),
        tools={"end": lw.Tool(body="cart", task=("y",))},
    )
    return lw.Robot(Scale(mechanism, L, M, T).mechanism)


@pytest.mark.parametrize(("L", "M", "T"), SCALES)
def test_the_mass_that_takes_the_least_force(L, M, T):
    """Of a mass on a vertical slide that is led up slowly the least weight: m (g + a)."""
    robot = cart(L, M, T)
    path = lw.paths.line([0.0], [0.2 * L])
    found = design.optimise(robot, {"cart.mass": (1.5 * M, 4 * M)}, design.PeakForce(path, T, 101))
    assert found.chosen["cart.mass"] == pytest.approx(1.5 * M)
    steepest = 0.2 * 84 / (5 * np.sqrt(5))  # of the polynomial of degree 7 from rest to rest
    assert found.after / (M * L / T**2) == pytest.approx(1.5 * (9.81 + steepest), rel=1e-3)


@pytest.mark.parametrize(("L", "M", "T"), SCALES)
def test_the_length_of_a_slide_stays_within_its_range(L, M, T):
    """A hinge at (x, 0) and a slide of the length 0.9 - x move the tool at (0.9, 0) alike in all
    directions where that is the length at the reference, 0.6, which the slide's range leaves out.
    """
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "guide")),
        "slide": lw.PrismaticJoint(
            connects=("guide", "rod"), axis=(1, 0, 0), limits=lw.Limits(lower=0.7, upper=1.0)
        ),
    }
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    mechanism = lw.Mechanism(
        bodies={"guide": body, "rod": body},
        joints=joints,
        actuators=("hinge", "slide"),
        gravity=(0, 0, -9.81),
        tools={"end": lw.Tool(body="rod", task=("x", "y"))},
        reference={"slide": 0.6},
    )
    robot = lw.Robot(Scale(mechanism, L, M, T).mechanism)
    number, poses = "hinge.frames.0.position.x", [[0.9 * L, 0.0]]
    found = design.optimise(robot, {number: (-0.3 * L, 0.3 * L)}, design.Isotropy(poses))
    assert found.chosen[number] / L == pytest.approx(0.2, abs=1e-6)
    assert found.before < found.after < 1


@pytest.mark.parametrize(("L", "M", "T"), SCALES)
def test_a_slow_robot_is_held_as_a_quick_one(L, M, T):
    robot = cart(L, M, T)
    drive = {"slide": 800.0 * M / T**2}
    found = design.optimise(
        robot, {"cart.mass": (1.5 * M, 4.0 * M)}, design.Frequency([[0.2 * L]], drive)
    )
    assert found.after * T == pytest.approx(np.sqrt(800 / 1.5) / (2 * np.pi), rel=1e-6)
