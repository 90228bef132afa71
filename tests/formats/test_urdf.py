"""URDF as Pinocchio itself understands it, and what is made of its frames, mimics and odd inertias."""

import numpy as np
import pinocchio as pin
import pytest

import linkwork as lw
from linkwork.formats import load
from linkwork.mechanism import Friction, Limits, MechanismError

from tests.formats import samples

LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>'
ARM = f"""<robot name="arm">
  {{extra}}<link name="base"/>{LINK.format("a")}{LINK.format("b")}
  <joint name="j" type="revolute"><parent link="base"/><child link="a"/>{{first}}</joint>
  <joint name="k" type="{{kind}}"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/>{{second}}</joint>
</robot>"""


def read(text, tmp_path, name="arm.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load(path)


def arm(extra="", first="", second="", kind="revolute"):
    return ARM.format(extra=extra, first=first, second=second, kind=kind)


def test_an_arm_moves_as_pinocchio_says(tmp_path):
    imported = read(samples.URDF, tmp_path)
    mechanism = imported.mechanism
    robot, theirs = lw.Robot(mechanism), pin.buildModelFromXML(samples.URDF)
    data = theirs.createData()
    rng = np.random.default_rng(0)
    order = [name for name in theirs.names if name != "universe"]
    assert robot.actuators == ("shoulder", "elbow", "stroke")
    for _ in range(3):
        values = dict(zip(order, rng.uniform(-1, 1, 3), strict=True))
        rates, forces = dict(zip(order, rng.normal(size=3), strict=True)), rng.normal(size=3)
        q = np.concatenate(
            [[np.cos(value), np.sin(value)] if name == "elbow" else [value] for name, value in values.items()]
        )
        a = pin.aba(
            theirs, data, q, np.array(list(rates.values())), np.array([forces[robot.actuators.index(n)] for n in order])
        )
        state = robot.state(values, rates)
        ours = dict(
            zip(robot.rates, robot.joint_accelerations(state, robot.forward_dynamics(state, forces)), strict=True)
        )
        np.testing.assert_allclose([ours[name] for name in order], a, rtol=1e-9, atol=1e-10)
        pin.framesForwardKinematics(theirs, data, q)
        poses = robot.body_poses(state)
        for link in ("upper", "fore", "ram", "pod"):
            place = data.oMf[theirs.getFrameId(link)]
            np.testing.assert_allclose(poses[link][0], place.translation, atol=1e-12)
            np.testing.assert_allclose(poses[link][1], place.rotation, atol=1e-12)
        np.testing.assert_allclose(
            robot.tool_pose(state)[:3], data.oMf[theirs.getFrameId("tool0")].translation, atol=1e-12
        )


def test_what_an_arm_says_of_itself(tmp_path):
    imported = read(samples.URDF, tmp_path)
    mechanism = imported.mechanism
    assert mechanism.name == "arm"
    assert mechanism.joints["shoulder"].limits == Limits(lower=-2, upper=2.5)
    assert mechanism.joints["elbow"].limits == Limits()
    assert mechanism.tools["tool0"].body == "pod"
    assert "pod" in mechanism.bodies and "tool0" not in mechanism.bodies
    first, second = imported.notes
    assert (
        first == "arm.urdf: the root link 'stand' is taken as ground and stands still, so that its mass plays no part"
    )
    assert second.startswith("arm.urdf: nothing says which joints are driven; all hinges and slides")


def test_dynamics_mimics_and_transmissions(tmp_path):
    extra = '<transmission name="t"><joint name="j"/></transmission>'
    text = arm(
        extra,
        first='<dynamics damping="0.3" friction="0.2"/>',
        second='<mimic joint="j" multiplier="-2" offset="0.5"/><axis xyz="0 0 1"/>',
    )
    imported = read(text, tmp_path)
    mechanism = imported.mechanism
    assert mechanism.joints["j"].friction == Friction(viscous=0.3, coulomb=0.2)
    assert mechanism.actuators == ("j",)
    robot = lw.Robot(mechanism)
    assert robot.mobility == 1
    state = robot.assemble(joints={"j": 0.4})
    assert state["k"] == pytest.approx(-2 * 0.4 + 0.5)
    assert any("<joint 'j'> has dry friction" in note for note in imported.notes)


def test_planar_and_floating_joints(tmp_path):
    mechanism = read(arm(second='<axis xyz="0 1 0"/>', kind="planar"), tmp_path).mechanism
    robot = lw.Robot(mechanism)
    p, R = robot.body_poses(robot.state({"j": 0, "k.x": 0.3, "k.y": 0.2, "k.angle": 0.7}))["b"]
    assert p[1] == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(R @ [0, 1, 0], [0, 1, 0], atol=1e-15)
    assert np.linalg.norm(p - [0, 0, 1]) == pytest.approx(np.hypot(0.3, 0.2))
    assert read(arm(kind="floating"), tmp_path).mechanism.joints["k"].type == "free"


def test_moments_that_no_body_has_are_raised_and_noted(tmp_path):
    text = arm().replace('ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="0.1" iyy="0.1" izz="0.5"', 1)
    imported = read(text, tmp_path)
    inertia = imported.mechanism.bodies["a"].inertia
    assert (inertia.xx, inertia.yy, inertia.zz) == pytest.approx((0.25, 0.25, 0.5))
    assert any("<link 'a'> has moments of inertia that no rigid body has" in note for note in imported.notes)


def test_light_links_that_carry_a_joint_stay_bodies(tmp_path):
    text = samples.URDF.replace('<link name="tool0"/>', '<link name="tool0"/><link name="wheel"/>').replace(
        "</robot>", '<joint name="w" type="continuous"><parent link="tool0"/><child link="wheel"/></joint></robot>'
    )
    mechanism = read(text, tmp_path).mechanism
    assert {"tool0", "wheel"} <= set(mechanism.bodies)
    assert mechanism.tools == {}


def test_elements_that_are_not_read_are_named(tmp_path):
    extra = "<gazebo/><material name='m'/>"
    imported = read(arm(extra, first="<spin/><joint_properties friction='0.0'/>"), tmp_path)
    assert any("<gazebo> is left out: it is no part of a mechanism known here" in note for note in imported.notes)
    assert any("<spin> in a <joint> is left out" in note for note in imported.notes)
    assert not any("joint_properties" in note or "material" in note for note in imported.notes)


REFUSED = {
    "<robot name='r'/>": "holds no links",
    "<robot><link name='a'/><link name='a'/></robot>": "<link 'a'>: has the name of another link",
    "<robot><link name='a'/><link name='b'/></robot>": "the links 'a', 'b' are carried by no joint; exactly one",
    "<robot><xacro:property name='x'/></robot>": "is a macro; expand the file with xacro first",
    arm(
        kind="screw"
    ): "<joint 'k'>: type 'screw' is not one of revolute, continuous, prismatic, fixed, floating, planar",
    arm(second='<axis xyz="0 0 0"/>'): "<axis>: axis has no length; give a direction such as '0 0 1'",
    arm(second='<origin xyz="0 0"/>').replace('<origin xyz="0 0 1"/>', ""): "<origin>: xyz holds 2 numbers; give 3",
    arm(second='<mimic joint="m"/>'): "<mimic>: there is no hinge or slide 'm'",
    arm(
        extra='<transmission><joint name="m"/></transmission>'
    ): "<joint 'm'>: is driven by a transmission and is not there",
    arm().replace('<mass value="1"/>', "", 1): "<inertial>: holds no <mass>; add one",
    arm().replace('value="1"', 'value="-1"', 1): "<link 'a'>: mass: ",
    arm().replace('name="k"', 'name="j"'): "<joint 'j'>: has the name of another joint",
    arm().replace('<child link="b"/>', '<child link="a"/>'): "<joint 'k'>: connects 'a' to itself",
    arm().replace('<child link="b"/>', '<child link="c"/>'): "<joint 'k'>: there is no link 'c'",
    arm().replace('<parent link="a"/>', ""): "<joint 'k'>: holds no <parent>; add one",
    arm().replace(
        '<parent link="a"/><child link="b"/>', '<parent link="b"/><child link="a"/>'
    ): "carries 'a', as 'j' does",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refusals_name_file_and_line(text, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(text, tmp_path)
    assert str(refusal.value).startswith(f"{tmp_path / 'arm.urdf'}: line ")
    assert REFUSED[text] in str(refusal.value)


def test_a_circle_of_links_is_refused(tmp_path):
    text = arm().replace("</robot>", "") + (
        '<link name="c"/><link name="d"/><joint name="m" type="fixed"><parent link="c"/><child link="d"/></joint>'
        '<joint name="n" type="fixed"><parent link="d"/><child link="c"/></joint></robot>'
    )
    with pytest.raises(MechanismError, match="hangs in a circle of joints that does not reach the root link"):
        read(text, tmp_path)
