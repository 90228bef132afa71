"""All legs nearly stretched at once: the index of leg-singularity falls as the sine of the knees,
though all singular values of the tool's rows vanish together."""

import numpy as np
import pytest
from scipy.optimize import brentq

import linkwork as lw
from linkwork.analysis import singularity
from linkwork.model import dexterity

from tests.analysis.mechanisms import SOLID, rrs
from tests.catalogue import built

KNEES = (0.01, 1.5e-4)


def rrr3(knee):
    """A 3-RRR, its platform turned in the middle so that the legs do not meet in one point."""
    turn, vertex = 0.6, 7 / 6 * np.pi + 0.6
    away = [0.3 + 0.08 * np.cos(vertex), 0.1 * np.sqrt(3) + 0.08 * np.sin(vertex)]
    link = np.linalg.norm(away) / (2 * np.cos(knee / 2))
    robot = lw.Robot(lw.robots.rrr3(proximal=link, distal=link))
    return robot, robot.assemble(tool=[0.3, 0.1 * np.sqrt(3), turn])


def five_bar(knee):
    """A five-bar over the middle of its base."""
    link = np.hypot(0.15, 0.4) / (2 * np.cos(knee / 2))
    robot = lw.Robot(lw.robots.five_bar(proximal=link, distal=link))
    return robot, robot.assemble(tool=[0.15, 0.4])


def delta(knee):
    """The Delta robot as low as its arms and rods reach when they meet at the angle `knee`."""
    inward, arm, rod = 0.164 - 0.044, 0.524, 1.244
    q = brentq(lambda q: inward + arm * np.cos(q) + rod * np.cos(q + knee), 1.2, 2.0, xtol=1e-15)
    robot = lw.Robot(lw.robots.delta(height=arm * np.sin(q) + rod * np.sin(q + knee)))
    return robot, robot.home


def upright(knee):
    """A 3-RRS."""
    robot = rrs(np.pi - knee)
    return robot, robot.home


def hexapod(knee, link=0.5):
    """A platform on six cranks and rods; each crank turns in the upright plane of its leg."""
    cranks, joints, reference, rise = {}, {}, {"pose.z": 0.8, "pose.qw": 1.0}, 0.8
    for i, (foot, tip) in enumerate(zip(hexagon(0.5, 0.2), hexagon(0.3, 0.8), strict=True)):
        out, azimuth = np.hypot(*(tip - foot)), np.arctan2(*(tip - foot)[::-1])
        length = np.hypot(out, rise) / (2 * np.cos(knee / 2))
        base = lw.Frame(position=(*foot, 0.0), rotation=(0.0, 0.0, azimuth))
        joints[f"crank_{i}"] = lw.RevoluteJoint(
            connects=("ground", f"arm_{i}"), axis=(0.0, -1.0, 0.0), frames=(base, lw.Frame())
        )
        joints[f"rod_{i}"] = lw.RodJoint(
            connects=(f"arm_{i}", "platform"),
            frames=(lw.Frame(position=(length, 0, 0)), lw.Frame(position=(*tip, 0.0))),
            length=length,
        )
        cranks[f"arm_{i}"] = SOLID
        reference[f"crank_{i}"] = np.arctan2(rise, out) - knee / 2
    mechanism = lw.Mechanism(
        bodies=cranks | {"platform": SOLID},
        joints=joints | {"pose": lw.FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(name for name in joints if name.startswith("crank")),
        tools={"centre": lw.Tool(body="platform")},
        reference=reference,
    )
    robot = lw.Robot(mechanism)
    return robot, robot.home


def hexagon(radius, half):
    angles = [a + s * half for a in np.arange(3) * 2 * np.pi / 3 for s in (-1, 1)]
    return [radius * np.array([np.cos(a), np.sin(a)]) for a in angles]


LEGGED = {"rrr3": rrr3, "five_bar": five_bar, "delta": delta, "rrs": upright, "hexapod": hexapod}


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", LEGGED)
def test_the_index_falls_as_the_sine_of_all_knees(name):
    near = [(knee, singularity(*LEGGED[name](knee))) for knee in KNEES]
    shares = np.array([told.leg / np.sin(knee) for knee, told in near])
    np.testing.assert_allclose(shares, shares[-1], rtol=0.01)
    assert 0.1 < shares[-1] < 10
    assert all(told.actuator > 0.01 and told.constraint > 1e-3 for _, told in near)


@pytest.mark.parametrize("name", ["rrs", "hexapod"])
def test_legs_that_are_all_stretched_are_singular(name):
    robot, state = LEGGED[name](0.0)
    told = singularity(robot, state)
    assert told.kinds == ("I",) and told.leg < 1e-12
    if name == "hexapod":
        assert dexterity.conditioning(robot, state.q[None]) == 0.0


def test_one_leg_that_is_nearly_stretched_weighs_as_before():
    """Its ratio of singular values, beside two bent legs: ten times nearer, ten times less."""
    robot = built("five_bar")
    middle, away = np.array([0.15, 0.35]), np.array([0.4, 0.3])
    found = []
    for knee in (0.02, 0.002):
        reach = np.sqrt(0.25**2 + 0.35**2 + 2 * 0.25 * 0.35 * np.cos(knee))
        point = reach * away / np.linalg.norm(away)
        told = singularity(robot, robot.assemble(tool=point, guess=robot.assemble(tool=middle)))
        found.append(told.leg / np.sin(knee))
    assert found[0] == pytest.approx(found[1], rel=0.02) and 0.05 < found[0] < 5


def test_a_slider_crank_slides_as_the_sine_of_its_crank():
    """Its single singular value has no other to be compared with: near a dead centre the slider
    stands, and with the slider driven the crank lets it."""
    robot = built("slider_crank")
    crank = robot.actuators[0]
    for turn in (0.0, np.pi):
        near = [
            singularity(robot, robot.assemble({crank: turn + angle})).leg / np.sin(angle)
            for angle in (1e-2, 1e-4)
        ]
        assert near[0] == pytest.approx(near[1], rel=0.02) and 0.1 < near[0] < 10
    driven = lw.Robot(robot.mechanism.model_copy(update={"actuators": ("slide",)}))
    stood = driven.assemble({crank: 1e-4})
    assert singularity(driven, stood).actuator == pytest.approx(
        singularity(driven, driven.assemble({crank: 1e-2})).actuator / 100, rel=0.02
    )
