"""SDF that is written: read again it moves the same, with coordinates that count from home."""

from __future__ import annotations

import re

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save
from linkwork.formats.sdf.writer import to_sdf
from linkwork.mechanism import Limits, MechanismError, Spring

from tests.formats.test_urdf_written import arm, difference, turning


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "name", ["prr3", "slider_crank", "bennett", "spatial_slider_crank", "agile_wrist", "stewart"]
)
def test_what_is_written_is_read_as_the_same_robot(name, tmp_path):
    robot = lw.Robot(name)
    save(robot.mechanism, tmp_path / "robot.sdf")
    other = lw.Robot(load(tmp_path / "robot.sdf").mechanism)
    assert other.mobility == robot.mobility
    assert other.mechanism.gravity == robot.mechanism.gravity
    assert difference(robot, other) < 1e-9


def test_screws_universal_joints_gears_and_what_acts(tmp_path):
    """All count from home: limits and rests of springs move with the coordinate."""
    robot = lw.Robot(arm())
    save(robot.mechanism, tmp_path / "arm.sdf")
    mechanism = load(tmp_path / "arm.sdf").mechanism
    joint = mechanism.pairs["elbow"]
    home = dict(zip(robot.coordinates, robot.home.positions.tolist(), strict=True))["elbow"]
    assert home != 0.0
    effects = joint.effects()["angle"]
    assert effects.limits == Limits(lower=-1.0 - home, upper=2.0 - home)
    assert effects.spring == Spring(stiffness=3.0, rest=0.1 - home)
    other = lw.Robot(mechanism)
    rates = np.random.default_rng(2).normal(size=robot.mobility)
    names = [each.replace("_angle", ".angle") for each in robot.independent]
    assert {*other.independent} == {*names}
    states = [one.state(one.home.positions, rates) for one in (robot, other)]
    forces = np.arange(1.0, 1.0 + len(robot.actuators))
    assert other.actuators == robot.actuators and other.independent == robot.independent
    np.testing.assert_allclose(
        other.forward_dynamics(states[1], forces),
        robot.forward_dynamics(states[0], forces),
        rtol=1e-9,
    )


def test_rotors_of_driven_joints_are_read_again(tmp_path):
    robot = lw.Robot(turning((0.3, 0.2)))
    save(robot.mechanism, tmp_path / "turning.sdf")
    other = lw.Robot(load(tmp_path / "turning.sdf").mechanism)
    assert difference(robot, other) < 1e-12
    _, notes = to_sdf(robot.mechanism.model_copy(update={"actuators": ("shoulder",)}))
    assert any("rotor inertias are left out but of driven joints" in note for note in notes)


def test_limits_of_speed_come_back(tmp_path):
    """Also where one axis of two has a limit alone, and the other is without."""
    ball = lw.Body(mass=1, inertia=lw.Inertia(xx=1, yy=1, zz=1))
    limits = {"angle_1": Limits(speed=2.5), "angle_2": Limits(lower=-1, upper=1)}
    joints = {
        "cross": lw.UniversalJoint(
            connects=("ground", "a"), axes=((1, 0, 0), (0, 1, 0)), limits=limits
        ),
        "hinge": lw.RevoluteJoint(connects=("a", "b"), limits=Limits(speed=4)),
    }
    save(lw.Mechanism(bodies={"a": ball, "b": ball}, joints=joints), tmp_path / "arm.sdf")
    back = load(tmp_path / "arm.sdf").mechanism.joints
    for name, joint in joints.items():
        for freedom, effects in joint.effects().items():
            assert back[name].effects()[freedom].limits == effects.limits
    one = (tmp_path / "arm.sdf").read_text()
    bare = re.sub(r"(<axis2>.*?)<limit>.*?</limit>(.*?</axis2>)", r"\1\2", one, flags=re.S)
    (tmp_path / "bare.sdf").write_text(bare)
    cross = load(tmp_path / "bare.sdf").mechanism.joints["cross"]
    assert cross.limits == {"angle_1": limits["angle_1"]}


def test_an_axis_of_a_late_version_is_in_the_frame_of_its_joint(tmp_path):
    """1.11 is later than 1.5, though less as a number."""
    text = (
        "<sdf version='{}'><model name='m'><link name='a'><pose>0 0 0 0 0 1.5707963267948966</pose>"
        "</link><joint name='j' type='prismatic'><parent>world</parent><child>a</child>"
        "<axis><xyz>1 0 0</xyz></axis></joint></model></sdf>"
    )
    for version, axis in (("1.4", (0, -1, 0)), ("1.6", (1, 0, 0)), ("1.11", (1, 0, 0))):
        path = tmp_path / "model.sdf"
        path.write_text(text.format(version))
        joint = load(path).mechanism.joints["j"]
        np.testing.assert_allclose(joint.axis, axis, atol=1e-12)  # pyright: ignore


def test_what_changes_is_said():
    _, notes = to_sdf(lw.robots.slider_crank())
    assert "bodies.crank: its link is called 'crank link'" in notes
    assert "coordinates count from home, where SDF's joints are at zero" in notes


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("delta", "joint 'rod_1_left', a rod joint, is none of SDF's; write .xml (MJCF) or .yaml"),
        ("andrews", "SDF has no place for springs, as for 'CD'"),
    ],
)
def test_refusals(name, sentence, tmp_path):
    with pytest.raises(MechanismError, match=re.escape(sentence)):
        save(getattr(lw.robots, name)(), tmp_path / "robot.sdf")
    assert not [*tmp_path.iterdir()]


def test_names_of_what_was_inside_models_have_no_colons(tmp_path):
    """SDF keeps them, and its readers refuse them in the names of elements."""
    bodies = {name: lw.Body(mass=1.0) for name in ("m::a", "m_a")}
    joints = {
        "m::j": lw.RevoluteJoint(connects=("ground", "m::a")),
        "k": lw.PrismaticJoint(connects=("m::a", "m_a"), axis=(1, 0, 0)),
        "g": lw.GearJoint(ratios={"m::j": 1.0, "k": 2.0}),
    }
    tools = {"m::tip": lw.Tool(body="m::a")}
    mechanism = lw.Mechanism(bodies=bodies, joints=joints, tools=tools, gravity=(0, -9.8, 0))
    notes = save(mechanism, tmp_path / "model.sdf")
    text = (tmp_path / "model.sdf").read_text()
    assert "::" not in text and sum("'::'" in note for note in notes) == 1
    again = load(tmp_path / "model.sdf").mechanism
    assert {*again.bodies} == {"m_a_", "m_a"} and {*again.pairs} == {"m_j", "k"}
    assert {*again.tools} == {"m_tip"} and lw.Robot(again).mobility == 1
