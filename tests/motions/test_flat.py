"""Motors behind springs: their motion and torques from the links', tried by simulating."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork import motions
from linkwork.mechanism.transmissions import Combination
from linkwork.robots import five_bar

from tests.equations.evaluation import close


def arm(damping: float = 0.0, **more) -> lw.Mechanism:
    """Return two links in a plane with weight, the first behind a spring, the second, too."""
    link = lw.Body(mass=1.5, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.03))
    elastic: Any = {"stiffness": 90.0, "damping": damping, "motor_inertia": 0.07}
    return lw.Mechanism(
        bodies={"upper": link, "lower": link},
        joints={
            "shoulder": lw.RevoluteJoint(
                connects=("ground", "upper"), elastic=elastic, friction=lw.Friction(viscous=0.2)
            ),
            "elbow": lw.RevoluteJoint(
                connects=("upper", "lower"),
                frames=(lw.Frame(position=(0.4, 0, 0)), lw.Frame()),
                elastic=elastic | {"stiffness": 60.0},
            ),
        },
        actuators=("shoulder", "elbow"),
        gravity=(0, -9.81, 0),
        **more,
    )


def returned(robot: lw.Robot, motion: lw.Motion, tolerance: float) -> None:
    """Simulate from the motion's first state under its torques, and compare."""
    forces = robot.inverse_dynamics(motion)
    run = robot.simulate(
        motion.state.at(0),
        forces,
        duration=motion.time[-1],
        save_at=motion.time[::100],
        rtol=1e-11,
        atol=1e-13,
    )
    close(run["joint_position"].values, motion.positions[::100], tolerance)


def test_a_simulation_under_the_torques_returns_the_motion_of_the_links():
    robot = lw.Robot(arm())
    way = motions.point_to_point(
        {"shoulder": -1.0, "elbow": 0.3},
        {"shoulder": 0.6, "elbow": -0.8},
        motions.AxisLimits(speed=2.5),
        law="septic",
    )
    motion = motions.follow(robot, way, samples=2001)
    close(motion.state["shoulder"], way.sample(motion.time)[0][:, 0], 1e-12)
    assert np.abs(motion.state["shoulder motor"] - motion.state["shoulder"]).max() > 0.05
    returned(robot, motion, 1e-7)


def test_one_link_takes_spong_s_torque():
    """f = J q'' + m g c cos q,  theta = q + f / k,  u = B theta'' + f, derivatives by hand."""
    described = arm()
    joints = {name: joint for name, joint in described.joints.items() if "elbow" not in name}
    joints["shoulder"] = joints["shoulder"].model_copy(update={"friction": lw.Friction()})
    robot = lw.Robot(
        described.model_copy(
            update={
                "bodies": {n: described.bodies[n] for n in ("upper", "shoulder rotor")},
                "joints": joints,
                "transmissions": {"spring": described.transmissions["shoulder spring"]},
                "actuators": ("shoulder motor",),
            }
        )
    )
    t = np.linspace(0, 2, 21)
    q, d1, d2, d3, d4 = (1.3**k * np.sin(1.3 * t + k * np.pi / 2) for k in range(5))
    motion = motions.flat(robot, t, ["shoulder"], *(x[:, None] for x in (q, d1, d2, d3, d4)))
    J, w, k, B = 0.03 + 1.5 * 0.2**2, 1.5 * 9.81 * 0.2, 90.0, 0.07
    f = J * d2 + w * np.cos(q)
    ddf = J * d4 - w * (np.sin(q) * d2 + np.cos(q) * d1**2)
    close(motion.state["shoulder motor"], q + f / k, 1e-12)
    close(robot.inverse_dynamics(motion).values[:, 0], B * (d2 + ddf / k) + f, 1e-11)


def test_a_five_bar_between_elastic_motors():
    """Its loop, and a spring with ratios as a gear makes them."""
    described = five_bar()
    first, second = described.actuators
    fields = {name: getattr(described, name) for name in ("bodies", "reference", "gravity")}
    joints = dict(described.joints)
    elastic = {"stiffness": 200.0, "motor_inertia": 0.01}
    joints[first] = type(joints[first])(
        **{**joints[first].model_dump(exclude={"elastic"}), "elastic": elastic}
    )
    joints["wheel"] = lw.RevoluteJoint(connects=("ground", "rotor"), rotor_inertia=2e-4)
    fields["bodies"] = {**described.bodies, "rotor": lw.Body(mass=0.0)}
    spring = lw.SlackSpring(stiffness=300.0)
    line = Combination(ratios={"wheel": 0.1, second: -1.0}, spring=spring, offset=0.02)
    robot = lw.Robot(
        lw.Mechanism(
            joints=joints, actuators=(first, "wheel"), transmissions={"gear": line}, **fields
        )
    )
    start = [float(robot.home[name]) for name in (first, second)]
    way = motions.point_to_point(
        dict(zip((first, second), start, strict=True)),
        {first: start[0] + 0.3, second: start[1] - 0.2},
        motions.AxisLimits(speed=1.0),
        law="septic",
    )
    returned(robot, motions.follow(robot, way, samples=2001), 1e-7)


@pytest.mark.long
def test_links_led_beyond_a_fold_do_not_leap_to_another_assembly_mode():
    """Of a 3-RRS, whose platform falls where its motors go on beyond where they determine it."""
    described = lw.robots.rrs3()
    joints = dict(described.joints)
    for name in described.actuators:
        fields = joints[name].model_dump(exclude={"elastic"})
        elastic = {"stiffness": 200.0, "motor_inertia": 0.01}
        joints[name] = type(joints[name])(**fields, elastic=elastic)
    kept = {name: getattr(described, name) for name in ("bodies", "reference", "gravity")}
    robot = lw.Robot(lw.Mechanism(joints=joints, actuators=described.actuators, **kept))
    ends = [[0.86745736] * 3, [0.27198472, 0.18059837, 1.64544324]]
    around = [dict(zip(described.actuators, values, strict=True)) for values in ends]
    timed = motions.point_to_point(*around, motions.AxisLimits(speed=1.0), law="septic")
    with pytest.raises(lw.LinkworkError, match="would leap to another assembly mode"):
        motions.follow(robot, timed, samples=51)


@pytest.mark.parametrize(
    ("mechanism", "law", "said"),
    [
        (arm(damping=0.1), "septic", "shoulder spring: has a damper beside its spring"),
        (arm(), "trapezoidal", "the accelerations of the path leap at t = .* law='septic'"),
        (
            arm(
                contacts={
                    "floor": lw.Contact(
                        connects=("ground", "lower"),
                        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
                        stiffness=1e4,
                    )
                }
            ),
            "septic",
            "floor: contact: presses or sticks",
        ),
        (
            arm().model_copy(update={"actuators": ("shoulder motor",)}),
            "septic",
            r"3 freedoms \(.*\), but shoulder, elbow are led and shoulder driven",
        ),
    ],
)
def test_what_is_not_flat_is_refused_by_name(mechanism, law, said):
    limits = motions.AxisLimits(speed=2.0, acceleration=5.0)
    way = motions.point_to_point(
        {"shoulder": 0.0, "elbow": 0.0}, {"shoulder": 0.5, "elbow": 0.5}, limits, law=law
    )
    with pytest.raises(lw.LinkworkError, match=said):
        motions.follow(lw.Robot(mechanism), way)


def test_derivatives_that_do_not_fit_are_refused():
    t, robot = np.linspace(0, 1, 5), lw.Robot(arm())
    with pytest.raises(lw.LinkworkError, match="2 arrays are given; a flat motion takes positions"):
        motions.flat(robot, t, ["shoulder", "elbow"], np.zeros((5, 2)), np.zeros((5, 2)))
    with pytest.raises(lw.LinkworkError, match="the positions have the shape"):
        motions.flat(robot, t, ["shoulder", "elbow"], *[np.zeros((4, 2))] * 5)
    for times, said in ((t[::-1], "0.75 s after 1 s, at index 1"), (0 * t, "at index 1")):
        with pytest.raises(lw.LinkworkError, match=said):
            motions.flat(robot, times, ["shoulder", "elbow"], *[np.zeros((5, 2))] * 5)
    with pytest.raises(lw.LinkworkError, match="no actuator of slide_1"):
        motions.flat(lw.Robot("prr3"), t, ["slide_1"], *[np.zeros((5, 1))] * 5)


def test_the_fastest_law_of_links_behind_springs_is_refused():
    """It advised a path of polynomials, which this is."""
    ends = {"shoulder": 0.0, "elbow": 0.5}, {"shoulder": 0.5, "elbow": 1.0}
    path = motions.point_to_point(*ends, motions.AxisLimits(speed=1.0), law="septic")
    with pytest.raises(lw.LinkworkError, match=r"torques without bound; .* design.optimal_motion"):
        motions.fastest(lw.Robot(arm()), path, motions.ActuatorLimits(force=30.0))
