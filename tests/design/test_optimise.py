"""Optimal designs against known optima, and the robots' own measures beside them."""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np
import pytest

import linkwork as lw
from linkwork import design
from linkwork.design.choices import choices
from linkwork.model.assembly import UnreachableError

from tests.analysis.mechanisms import arm
from tests.catalogue import WHOLE, built
from tests.robot.mixed_freedoms import three_legs

LINKS = ("wrist_*.frames.0.position.x", "link_*.com.x")
CORNERS = "wrist_*.frames.1.position.[xy]"


def test_an_arm_that_moves_alike_in_all_directions():
    """l1 = sqrt 2 l2, at the distance l2 of the tool from the base (Salisbury & Craig 1982)."""
    poses = [[0.6, 0.0], [0.0, 0.6]]
    number = "hinge_2.frames.0.position.x"
    found = design.optimise(arm(1.0, 0.6), {number: (0.7, 1.3)}, design.Isotropy(poses))
    assert found.values[number] == pytest.approx(0.6 * np.sqrt(2), rel=1e-6)
    assert found.after == pytest.approx(1.0) and found.stationarity < 1e-7
    assert found.before < 0.93 and not found.active
    assert "locally optimal" in repr(found) and number in repr(found)


def test_a_pendulum_is_balanced():
    """The torque over a swing is least where (I + m x^2) |a| + m g x |cos| is: by a scan of x."""
    link = lw.Body(mass=2.0, centre_of_mass=(0.1, 0, 0), inertia=lw.Inertia(zz=0.05))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"link": link},
            joints={"hinge": lw.RevoluteJoint(connects=("ground", "link"))},
            actuators=("hinge",),
            gravity=(0, -9.81, 0),
            tools={"end": lw.Tool(body="link", task=("angle",))},
        )
    )
    path = lw.paths.Path(lambda s: (2 * s[:, None], 2 + 0 * s[:, None], 0 * s[:, None]))
    told = design.PeakForce(path, 0.8, samples=41)
    found = design.optimise(robot, {"link.com.x": (-0.3, 0.3)}, told)
    free = robot.free("link.com.x")
    scan = np.linspace(-0.1, 0.1, 41)
    peaks = [told.value(free.with_parameters({"link.com.x": x})) for x in scan]
    assert found.after <= min(peaks) * (1 + 1e-9)
    assert abs(found.values["link.com.x"] - scan[np.argmin(peaks)]) < 0.006
    assert told.unit(robot) == "N m"


def test_a_drive_gets_as_stiff_as_masses_allow():
    """One mass on a drive: 2 pi f = sqrt(k / m), with the mass at its lower bound."""
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"cart": lw.Body(mass=3.0, inertia=lw.Inertia(zz=0.1))},
            joints={"slide": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))},
            actuators=("slide",),
            gravity=(0, 0, -9.81),
            tools={"end": lw.Tool(body="cart", task=("x",))},
        )
    )
    found = design.optimise(
        robot, {"cart.mass": (1.5, 4.0)}, design.Frequency([[0.0], [0.2]], {"slide": 800.0})
    )
    assert found.active == ("cart.mass",)
    assert found.after == pytest.approx(np.sqrt(800 / 1.5) / (2 * np.pi), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["orthoglide", *["rrs3"] * WHOLE])
def test_frequencies_that_are_lowest_together_are_raised_together(name):
    """Symmetric robots have two or three lowest ones."""
    robot = built(name).free("platform.mass")
    home = robot.tool_pose(robot.home)[: 3 if name == "orthoglide" else 6]
    stiff = design.Frequency(home, dict.fromkeys(robot.actuators, 1e3))
    mass = robot.parameters["platform.mass"]
    found = design.optimise(robot, {"platform.mass": (0.6 * mass, 2 * mass)}, stiff)
    lighter = robot.with_parameters({"platform.mass": 0.6 * mass})
    assert found.active == ("platform.mass",)
    assert found.after == pytest.approx(stiff.value(lighter), rel=1e-6)
    assert found.after > 1.05 * found.before


@pytest.mark.long
def test_frequencies_that_become_lowest_together():
    """An upright 3-PRR: where links and masses are best two frequencies are one, and a scan around
    finds nothing better."""
    robot = built("prr3")
    x, y, _ = robot.tool_pose(robot.home)
    stiff = design.Frequency([[x, y, 0.0]], dict.fromkeys(robot.actuators, 1e4))
    numbers = {LINKS: (0.8, 1.5), CORNERS: (0.6, 1.5), "platform.mass": (1.0, 2.0)}
    found = design.optimise(robot, numbers, stiff)
    assert found.after > 1.15 * found.before and found.stationarity < 1e-7
    assert not better_beside(robot, numbers, stiff, found, 0.02)


@pytest.mark.long
def test_poses_that_come_to_lie_on_other_branches_are_taken_up_again():
    """The same measure over a workspace: IPOPT alone ends on another branch of some pose."""
    robot = built("prr3")
    steps = np.meshgrid([-0.03, 0, 0.03], [-0.03, 0, 0.03], [-0.1, 0, 0.1])
    poses = robot.tool_pose(robot.home) + np.stack(steps, axis=-1).reshape(-1, 3)
    stiff = design.Frequency(poses, dict.fromkeys(robot.actuators, 1e4))
    numbers = {LINKS: (0.8, 1.5), CORNERS: (0.6, 1.5), "platform.mass": (1.0, 2.0)}
    found = design.optimise(robot, numbers, stiff)
    assert found.after > 2.2 * found.before
    assert found.active == (CORNERS, "platform.mass")
    assert not better_beside(robot, numbers, stiff, found, 0.003)


def better_beside(robot, numbers, measure, found, step):
    """Return the values of designs beside one that is found which are better, of those that reach
    all poses: legs are nearly stretched there."""
    own, start = choices(robot, numbers), np.array([*found.chosen.values()])
    beside = start + step * np.random.default_rng(0).uniform(-1, 1, (24, len(start)))
    better, reaching = [], 0
    for z in np.clip(beside, own.lower, own.upper):
        with suppress(UnreachableError):
            value = measure.value(own.robot.with_parameters(own.values(z)))
            reaching += 1
            better += [value] * (value > found.after * (1 + 1e-9))
    assert reaching >= 8
    return better


@pytest.mark.long
def test_what_points_is_judged_by_where_it_points():
    """Azimuth and tilt are led as tilt (cos azimuth, sin azimuth), and judged alike: the optimum is
    at an end, as a scan tells."""
    robot = lw.Robot(three_legs("RRS", task=("z", "azimuth", "tilt")))
    alike = design.Isotropy([[0.5, 0.3, 0.2]])
    found = design.optimise(robot, {"knee_1.frames.0.position.x": (0.28, 0.32)}, alike)
    scan = [
        alike.value(robot.free(*found.values).with_parameters(dict.fromkeys(found.values, length)))
        for length in (0.28, 0.32)
    ]
    assert found.after == pytest.approx(max(scan), rel=1e-6)


def test_frequencies_are_those_of_forces_with_a_potential():
    """Moments of actuators about axes that turn with an arm hold it, and their stiffness is not
    symmetric."""
    body = lw.Body(mass=2, centre_of_mass=(0.1, 0, -0.3), inertia=lw.Inertia(xx=0.1, yy=1, zz=1))
    ball = lw.SphericalJoint(connects=("ground", "arm"))
    drives, tools = ball.rates("ball"), {"end": lw.Tool(body="arm")}
    robot = lw.Robot(
        lw.Mechanism(bodies={"arm": body}, joints={"ball": ball}, actuators=drives, tools=tools)
    )
    with pytest.raises(lw.LinkworkError, match="the stiffness is not symmetric here"):
        design.Frequency([[0.9, 0.5, 0.3]], dict.fromkeys(drives, 30.0)).value(robot)


def test_a_robot_of_three_legs_under_a_bound():
    """The 3-PRR: less force with a bound of isotropy, which holds to the digit; designs beside it
    that keep the bound need more force, as the robot itself tells."""
    robot = built("prr3")
    home = robot.tool_pose(robot.home)
    offsets = np.stack(np.meshgrid([-0.03, 0.03], [-0.03, 0.03], [-0.1, 0.1]), -1).reshape(-1, 3)
    alike = design.Isotropy(home + offsets)
    line = lw.paths.line([*(home - [0.03, 0, 0])], [*(home + np.array([0.03, 0.03, 0.1]))])
    force = design.PeakForce(line, 0.3, samples=15)
    numbers = {LINKS: (0.8, 1.5), CORNERS: (0.6, 1.5), "platform.mass": (1.0, 2.0)}
    found = design.optimise(robot, numbers, force, {alike: 0.6})
    bound, before, after = found.constraints[alike]
    assert before < bound == 0.6 and after == pytest.approx(0.6, abs=1e-7)
    assert found.after < 0.75 * found.before and found.stationarity < 1e-7
    assert robot.closure_error(robot.home) < 1e-12
    # Steps to all sides within the bounds.
    factors = np.array([found.chosen[", ".join(LINKS)], found.chosen[CORNERS]])
    better = []
    for step in ([0.004, 0], [-0.004, 0], [0, 0.004], [0.003, 0.003], [-0.003, 0.003]):
        one, two = (factors + step) / factors
        moved = {
            path: value * (one if path.endswith((".0.position.x", "mass.x")) else two)
            for path, value in found.values.items()
            if path != "platform.mass"
        }
        beside = found.robot.with_parameters(moved)
        if alike.value(beside) >= 0.6 - 1e-9:
            better.append(force.value(beside) < found.after)
    assert better and not any(better)


def test_forces_between_samples_are_told():
    """Six samples of a way along which forces rise and fall, against fifty."""
    robot = built("prr3")
    home = robot.tool_pose(robot.home)
    steps = np.array([[0.04, -0.02, 0.1], [-0.03, 0.03, -0.1]])
    line = lw.paths.line(*(home + steps).tolist())
    force = design.PeakForce(line, 0.3, samples=6)
    with pytest.warns(lw.errors.ModelWarning, match="between its samples PeakForce is") as told:
        found = design.optimise(robot, {"platform.mass": (1.0, 2.0)}, force)
    fine = design.PeakForce(line, 0.3, samples=51).value(found.robot)
    assert f"is {fine:.6g}, not {found.after:.6g}" in str(told[0].message) and fine > found.after


def test_a_delta_of_other_rods():
    """One factor of all rods: by a scan over it."""
    robot = built("delta")
    home = robot.tool_pose(robot.home)[:3]
    told = design.Isotropy(home + np.array([[0, 0, 0.1], [0.3, 0, 0], [0, -0.3, -0.1]]))
    found = design.optimise(robot, {"rod_*.length": (0.7, 1.2)}, told)
    free = robot.free(*found.values)
    factors = found.chosen["rod_*.length"] + np.array([-0.05, -0.01, 0.01, 0.05])
    others = [
        told.value(free.with_parameters({path: 1.244 * factor for path in found.values}))
        for factor in factors
    ]
    assert max(others) < found.after and found.after > 1.1 * found.before
    assert len({*found.values.values()}) == 1


def test_bad_input_is_refused():
    robot = arm(1.0, 0.6)
    number, alike = "hinge_2.frames.0.position.x", design.Isotropy([[0.6, 0.0], [0.9, 0.9]])
    unnamed = design.Frequency([[1, 1]], 1e4)  # pyright: ignore
    cases = [
        (({}, alike), "give bounds by path"),
        (({number: (1.2, 1.4)}, alike), "leave out its value 1"),
        (({number: (1.2, 0.4)}, alike), "give a lower and a larger"),
        (({"rod_*.com.x": (1.2, 1.4)}, alike), "the factor 1 of the robot as it is"),
        (({"hinge_2.frames.1.position.[xy]": (0.5, 2)}, alike), "are zero, and stay so"),
        (({number: (0.7, 1.3), (number,): (0.7, 1.3)}, alike), "name it once"),
        (({"rod_9.mass": (1, 2)}, alike), "rod_9"),
        (({number: (0.7, 1.3)}, "stiff"), "give design.Isotropy"),
        (({number: (0.7, 1.3)}, alike, {alike: -1}), "bound of Isotropy"),
        (({number: (0.7, 1.3)}, alike, {alike: 0.99}), "from this start none keeps all"),
        (({"rod_2.mass": (0.5, 2)}, alike), "nothing that is measured depends on 'rod_2.mass'"),
        (({number: (0.7, 1.3)}, design.Frequency([[1, 0.5]])), "nothing holds the robot"),
        (({number: (0.7, 1.3)}, unnamed), "give it by joint, such as"),
        (({(): (0.7, 1.3)}, alike), r"\(\) names no number"),
        (({number: (0.7, 1.3)}, design.Isotropy([[3.0, 0.0]])), "with the tool at"),
        (({number: (0.7, 1.3)}, design.Frequency([[1, 1]], {"hinge_9": 1.0})), "hinge_9"),
        (({number: (0.7, 1.3)}, design.Isotropy(np.zeros((0, 2)))), "the poses are none"),
    ]
    for given, sentence in cases:
        with pytest.raises(lw.LinkworkError, match=sentence):
            design.optimise(robot, *given)
    for measure in (alike, design.PeakForce(lw.paths.line([0.6, 0], [0.9, 0]), 1.0)):
        with pytest.raises(lw.LinkworkError, match=r"the robot is 'arm'; give a link"):
            measure.value("arm")  # pyright: ignore
    with pytest.raises(lw.LinkworkError, match="give 3 or more"):
        design.PeakForce(lw.paths.line([0.6, 0], [0.9, 0]), 1.0, samples=2)
    with pytest.raises(lw.LinkworkError, match=r"^the path is 'line'; give one made by"):
        design.PeakForce("line", 0.3)  # pyright: ignore


def test_lower_bounds_of_sizes_are_above_zero():
    """Factors of masses and lengths, and numbers that are above 0 by themselves; a centre of mass
    may come to lie on the other side."""
    delta, two = built("delta"), arm(1.0, 0.6)
    alike = design.Isotropy([[0, 0, -0.9]])
    above = "give a factor above 0"
    cases = [
        (delta, "rod_*.length", (-1, 2), above),
        (delta, "arm_*.mass", (0, 2), above),
        (delta, "motor_*.frames.1.position.x", (-1, 2), above),
        (delta, "rod_1_left.length", (0, 2), "rod_1_left.length: 0.0 is not above 0; expected"),
        (delta, "platform.mass", (-1, 20), "platform.mass: -1.0 is below 0; expected mass"),
    ]
    for robot, number, bounds, sentence in cases:
        told = f"the lower bound {bounds[0]} of {number!r}: "
        with pytest.raises(lw.LinkworkError, match=f"^{re.escape(told)}.*{sentence}"):
            design.optimise(robot, {number: bounds}, alike)
    kept = {"rod_*.com.x": (-1, 2), "hinge_2.frames.0.position.x": (-1, 2)}
    assert choices(two, kept).lower.tolist() == [-1, -1]
