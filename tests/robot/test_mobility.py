"""Mobility counted, compared with Gruebler's formula, and explained: redundant rows, idle freedoms,
what is locked."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork import robots
from linkwork.equations import derive, functions
from linkwork.mechanism import Mechanism

from tests.equations.evaluation import close, values
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import random_loops, tilted

BAR = lw.Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(xx=0.01, yy=0.1, zz=0.1))


def sarrus() -> Mechanism:
    """Return a plate that two legs of three parallel hinges each, at right angles to each other,
    let only rise."""
    bodies, joints, reference = {"plate": BAR}, {}, {}
    for leg, azimuth in (("a", 0.0), ("b", np.pi / 2)):
        frame, end = lw.Frame(rotation=(0, 0, azimuth)), lw.Frame(position=(1, 0, 0))
        bodies |= {f"low_{leg}": BAR, f"high_{leg}": BAR}
        for name, ends, frames in (
            ("foot", ("ground", f"low_{leg}"), (frame, lw.Frame())),
            ("knee", (f"low_{leg}", f"high_{leg}"), (end, lw.Frame())),
            ("hand", (f"high_{leg}", "plate"), (end, frame)),
        ):
            joints[f"{name}_{leg}"] = lw.RevoluteJoint(connects=ends, axis=(0, 1, 0), frames=frames)
        reference |= {f"foot_{leg}": -1.0, f"knee_{leg}": 2.0 - np.pi, f"hand_{leg}": np.pi - 1.0}
    return Mechanism(bodies=bodies, joints=joints, reference=reference, actuators=("foot_a",))


def parallelogram(cranks: int) -> Mechanism:
    """Return a coupler on parallel cranks of equal length: one freedom, and one row too many for
    each crank beyond two."""
    bodies, joints, reference = {"coupler": BAR}, {}, {}
    for i in range(cranks):
        bodies[f"crank_{i}"] = BAR
        joints[f"base_{i}"] = lw.RevoluteJoint(
            connects=("ground", f"crank_{i}"), frames=(lw.Frame.planar(0.7 * i), lw.Frame())
        )
        joints[f"top_{i}"] = lw.RevoluteJoint(
            connects=(f"crank_{i}", "coupler"),
            frames=(lw.Frame.planar(1), lw.Frame.planar(0.7 * i)),
        )
        reference |= {f"base_{i}": 1.0, f"top_{i}": -1.0}
    return Mechanism(
        bodies=bodies,
        joints=joints,
        actuators=("base_0",),
        reference=reference,
        gravity=(0, -9.81, 0),
    )


CASES = {  # mobility, Gruebler's count
    "four-bar": (robots.four_bar(), 1, 1),
    "four-bar out of its plane": (tilted(robots.four_bar(), 3), 1, -2),
    "3-PRR out of its plane": (tilted(robots.prr3(), 3), 3, -3),
    "three parallel cranks": (parallelogram(3), 1, 0),
    "five parallel cranks": (parallelogram(5), 1, -2),
    "Bricard": (robots.bricard(), 1, 0),
    "Bennett": (robots.bennett(), 1, -2),
    "Sarrus": (sarrus(), 1, 0),
    "tripteron": (robots.tripteron(), 3, 0),
    "Stewart": (robots.stewart(), 6, 6),
    "rods and gears": (random_loops(1, 2, rods=2, gears=1, freedoms=2), 3, 3),
    "planar rods and gears": (random_loops(1, 2, planar=True, rods=1, gears=1), 2, 2),
}


@pytest.mark.parametrize("name", CASES)
def test_mobility_and_gruebler(name):
    """The oracle counts the mobility by its own rank; what Gruebler misses are the redundant
    rows."""
    mechanism, mobility, gruebler = CASES[name]
    robot, oracle = lw.Robot(mechanism), MaximalOracle(mechanism)
    assert (robot.mobility, robot.gruebler) == (mobility, gruebler)
    assert oracle.mobility(oracle.reference_poses()) == mobility
    assert len(robot.redundant) == mobility - gruebler
    assert all(row.partition(": ")[0] in mechanism.joints for row in robot.redundant)
    assert robot.idle == ()


@pytest.mark.parametrize(
    "name", ["four-bar out of its plane", "Bennett", "Sarrus", "five parallel cranks"]
)
def test_overconstrained_mechanisms_move_as_they_should(name):
    """Accelerations at the reference against the oracle, which meets dependent rows by singular
    values."""
    mechanism, n, _ = CASES[name]
    equations, v, u = derive(mechanism), np.full(CASES[name][1], 0.7), np.full(CASES[name][1], 0.3)
    q = equations.reference
    v_dot = values(functions.motion(equations), q, v, u)["accelerations"]
    bodies = values(functions.bodies_motion(equations), q, v)
    p, R = bodies["origins"].reshape(-1, 3), bodies["orientations"].reshape(-1, 3, 3)
    t = bodies["twists"].reshape(-1, 2, 3)
    poses = {body: (p[i], R[i]) for i, body in enumerate(mechanism.bodies)}
    twists = {body: (t[i, 0], t[i, 1]) for i, body in enumerate(mechanism.bodies)}
    oracle = MaximalOracle(mechanism)
    assert oracle.constraint_velocity_error(poses, twists) < 1e-12
    expected = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, u))
    close(values(functions.joints_motion(equations), q, v, v_dot)["accelerations"], expected, 1e-10)
    assert equations.mobility == n


def test_a_planar_mechanism_loses_its_rows_out_of_the_plane_symbolically():
    equations = derive(robots.prr3())
    assert len(equations.rows.names) == 4
    assert all("position across the axis" in name for name in equations.rows.names)
    assert lw.Robot(robots.prr3()).planar


def test_redundant_rows_are_named_by_joint_and_direction():
    """Out of its plane, a planar loop has one position and two directions too many; the joint that
    closes it has them."""
    assert derive(tilted(robots.four_bar(), 3)).redundant == (
        "rocker_pin: position along the axis",
        "rocker_pin: direction of the axis, 1",
        "rocker_pin: direction of the axis, 2",
    )
    assert [row.partition(":")[0] for row in derive(parallelogram(4)).redundant] == [
        "top_2",
        "top_3",
    ]


def test_idle_freedoms_are_found_and_named():
    robot = lw.Robot(robots.hexaglide(idle_spins=True))
    assert (robot.mobility, robot.gruebler) == (12, 12)
    assert robot.idle == tuple(
        f"rod_{i}: spin about the line through knuckle_{i} and ball_{i}" for i in range(1, 7)
    )
    assert lw.Robot(robots.hexaglide()).idle == ()


def test_a_rod_of_several_bodies_spins_as_one():
    """A telescopic leg between two ball joints: its tube and piston spin together."""
    legs = {
        "foot": lw.SphericalJoint(connects=("ground", "tube")),
        "slide": lw.PrismaticJoint(connects=("tube", "piston"), axis=(1, 0, 0)),
        "head": lw.SphericalJoint(
            connects=("piston", "slider"), frames=(lw.Frame(position=(0.5, 0, 0)), lw.Frame())
        ),
        "guide": lw.PrismaticJoint(
            connects=("ground", "slider"), frames=(lw.Frame(position=(0.8, 0, 0)), lw.Frame())
        ),
    }
    mechanism = Mechanism(
        bodies=dict.fromkeys(("tube", "piston", "slider"), BAR),
        joints=legs,
        reference={"slide": 0.4, "guide": 0.4},
    )
    robot = lw.Robot(mechanism)
    assert (robot.mobility, robot.gruebler) == (2, 2)
    assert robot.idle == ("tube and piston: spin about the line through foot and head",)


# Refusals


def triangle(base: float, reference: dict[str, float], **more) -> Mechanism:
    """Return two bars of 1 m between pins at the distance `base`."""
    joints = {
        "a": lw.RevoluteJoint(connects=("ground", "left")),
        "b": lw.RevoluteJoint(connects=("left", "right"), frames=(lw.Frame.planar(1), lw.Frame())),
        "c": lw.RevoluteJoint(
            connects=("right", "ground"), frames=(lw.Frame.planar(1), lw.Frame.planar(base))
        ),
    }
    return Mechanism(bodies={"left": BAR, "right": BAR}, joints=joints, reference=reference, **more)


def one_body(**joints) -> Mechanism:
    return Mechanism(bodies={"a": BAR}, joints=joints)


HINGE = lw.RevoluteJoint(connects=("ground", "a"))
NUT = lw.CylindricalJoint(connects=("ground", "a"))


@pytest.mark.parametrize(
    ("sentence", "mechanism"),
    [
        (
            "joints: the mechanism has mobility 0: the loop of a, c, b leaves it no motion; add "
            "a joint or free one",
            triangle(1.0, {"a": 1.0, "b": -2.0, "c": 1.0}),
        ),
        ("no joint lets a body move", one_body(weld=lw.FixedJoint(connects=("ground", "a")))),
        (
            "the loop of first, second leaves it no motion",
            one_body(first=HINGE, second=HINGE.model_copy(update={"axis": (1.0, 0.0, 0.0)})),
        ),
        (
            "the loop of g2 leaves it no motion",
            one_body(
                nut=NUT,
                g1=lw.GearJoint(ratios={"nut.angle": 1, "nut.slide": 1}),
                g2=lw.GearJoint(ratios={"nut.angle": 1, "nut.slide": -1}),
            ),
        ),
        ("reference: the loops do not close near the reference configuration", triangle(3.0, {})),
        (
            "joints.rod: the loop cannot close: length stays open by 0.",
            one_body(hinge=HINGE, rod=lw.RodJoint(connects=("ground", "a"), length=0.3)),
        ),
        (
            "of joint 'rod' stays open by ",
            one_body(
                slide=lw.PrismaticJoint(connects=("ground", "a")),
                rod=lw.RodJoint(
                    connects=("ground", "a"), frames=(lw.Frame.planar(0.4), lw.Frame()), length=0.3
                ),
            ),
        ),
        (
            "the loop of slide, rod leaves it no motion",
            one_body(
                slide=lw.PrismaticJoint(connects=("ground", "a")),
                rod=lw.RodJoint(connects=("ground", "a"), length=0.3),
            ),
        ),
    ],
)
def test_mechanisms_that_cannot_be(sentence, mechanism):
    with pytest.raises(lw.MechanismError) as refusal:
        lw.Robot(mechanism)
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("joint", [lw.SphericalJoint, lw.FreeJoint])
def test_a_quaternion_without_length_is_refused_and_one_of_any_other_length_is_scaled(joint):
    mechanism = one_body(ball=joint(connects=("ground", "a")))
    with pytest.raises(lw.MechanismError, match="the quaternion of joint 'ball' has no length"):
        lw.Robot(mechanism.model_copy(update={"reference": {"ball.qw": 0.0}}))
    robot = lw.Robot(mechanism.model_copy(update={"reference": {"ball.qw": 3.0, "ball.qy": -4.0}}))
    close(robot.equations.reference[-4:], [0.6, 0, -0.8, 0], 1e-15)


def test_a_gear_said_twice_is_redundant():
    again = lw.GearJoint(ratios={"nut.angle": 2, "nut.slide": -0.2})
    robot = lw.Robot(
        one_body(nut=NUT, g1=lw.GearJoint(ratios={"nut.angle": 1, "nut.slide": -0.1}), g2=again)
    )
    assert (robot.mobility, robot.gruebler, robot.redundant) == (1, 0, ("g2: ratio",))


def test_two_ball_joints_make_a_hinge():
    """Two points held leave the turn about the line through them; one of the six rows is too
    many."""
    points = [(lw.Frame(position=(x, 0.2, 0)),) * 2 for x in (0.0, 1.0)]
    balls = {
        f"ball_{i}": lw.SphericalJoint(connects=("ground", "a"), frames=frames)
        for i, frames in enumerate(points)
    }
    robot = lw.Robot(one_body(**balls))
    assert (robot.mobility, robot.gruebler, len(robot.redundant)) == (1, 0, 1)
    T = values(functions.maps(robot.equations), robot.equations.reference)["T"].reshape(6)
    close(np.cross(T[:3], [1, 0, 0]), np.zeros(3), 1e-13)
    close(T[3:], np.cross(T[:3], np.array([0.5, 0, 0]) - [0, 0.2, 0]), 1e-13)
