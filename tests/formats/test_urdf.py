"""URDF as Pinocchio itself understands it, and what is made of its frames, mimics and odd
inertias."""

import numpy as np
import pinocchio as pin
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load
from linkwork.formats.xml import Element
from linkwork.mechanism import Friction, Lift, Limits, MechanismError

from tests.formats import samples
from tests.model_collections import MuJoCoSide, apart

LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" '
    'izz="0.1"/></inertial></link>'
)
ARM = f"""<robot name="arm">
  {{extra}}<link name="base"/>{LINK.format("a")}{LINK.format("b")}
  <joint name="j" type="revolute"><parent link="base"/><child link="a"/>{{first}}</joint>
  <joint name="k" type="{{kind}}"><parent link="a"/><child link="b"/>
    <origin xyz="0 0 1"/>{{second}}</joint>
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
            [
                [np.cos(value), np.sin(value)] if name == "elbow" else [value]
                for name, value in values.items()
            ]
        )
        a = pin.aba(
            theirs,
            data,
            q,
            np.array(list(rates.values())),
            np.array([forces[robot.actuators.index(n)] for n in order]),
        )
        state = robot.state(values, rates)
        ours = dict(
            zip(
                robot.rates,
                robot.joint_accelerations(state, robot.forward_dynamics(state, forces)),
                strict=True,
            )
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
    assert mechanism.joints["shoulder"].limits == Limits(lower=-2, upper=2.5, speed=3)
    assert mechanism.joints["elbow"].limits == Limits()
    assert mechanism.tools["tool0"].body == "pod"
    assert "pod" in mechanism.bodies and "tool0" not in mechanism.bodies
    first, second, third = imported.notes
    assert third.startswith("arm.urdf: limits of effort and reductions are the mechanism's drives")
    assert mechanism.drives["shoulder"] == {"type": "saturated", "limit": 10}
    assert first == (
        "arm.urdf: the root link 'stand' is taken as ground and stands still, so that its "
        "mass plays no part"
    )
    assert second.startswith(
        "arm.urdf: nothing says which joints are driven; all hinges and slides"
    )


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


def accelerations(text, tmp_path, q, v, u):
    """Return those of linkwork and of Pinocchio for a chain of hinges and slides, in the file's
    order of joints."""
    robot = lw.Robot(read(text, tmp_path).mechanism)
    complete = text.replace('"/></inertial>', '" ixy="0" ixz="0" iyz="0"/></inertial>')
    theirs = pin.buildModelFromXML(
        complete.replace("</joint>", '<limit effort="1" velocity="1"/></joint>')
    )
    order = [name for name in theirs.names if name != "universe"]
    state = robot.state(dict(zip(order, q, strict=True)), dict(zip(order, v, strict=True)))
    forces = [u[order.index(name)] for name in robot.actuators]
    ours = dict(
        zip(
            robot.rates,
            robot.joint_accelerations(state, robot.forward_dynamics(state, forces)),
            strict=True,
        )
    )
    return [ours[name] for name in order], pin.aba(
        theirs, theirs.createData(), *map(np.array, (q, v, u))
    )


def test_moments_that_no_body_has_are_kept_and_noted(tmp_path):
    text = arm(first='<axis xyz="0.6 0 0.8"/>').replace(
        'ixx="0.1" iyy="0.1" izz="0.1"', 'ixx="0.1" iyy="0.2" izz="0.9"'
    )
    imported = read(text, tmp_path)
    assert any(
        "<link> ('a', 'b') has moments of inertia that no rigid body has" in note
        for note in imported.notes
    )
    assert not imported.mechanism.caveats
    ours, theirs = accelerations(text, tmp_path, [0.3, -0.7], [1.2, 2.0], [0.1, -0.2])
    np.testing.assert_allclose(ours, theirs, rtol=1e-11)
    imported.mechanism.save(tmp_path / "arm.yaml")
    assert lw.Mechanism.load(tmp_path / "arm.yaml") == imported.mechanism


def test_rounding_below_zero_in_moments_is_zero(tmp_path):
    for moments in ('ixx="-8.05e-19" iyy="7.5e-20" izz="0.003"', 'ixx="0" iyy="-1e-20" izz="0"'):
        text = arm().replace('ixx="0.1" iyy="0.1" izz="0.1"', moments, 1)
        tensor = read(text, tmp_path).mechanism.bodies["a"].inertia.tensor()
        assert np.linalg.eigvalsh(tensor)[0] >= -1e-30
        np.testing.assert_allclose(
            np.diag(tensor), [float(word.split('"')[1]) for word in moments.split()], atol=1e-18
        )
    with pytest.raises(MechanismError, match=r"line 2: <link 'a'>: inertia\.yy: -0\.01 is below 0"):
        read(arm().replace('iyy="0.1"', 'iyy="-0.01"', 1), tmp_path)


def test_the_mass_of_links_that_are_frames_stays_with_their_bodies(tmp_path):
    pod = (
        '<link name="pod"><inertial><mass value="1e-6"/><inertia ixx="1e-7" iyy="1e-7" '
        'izz="1e-7"/></inertial></link>'
    )
    fixed = (
        '<joint name="f" type="fixed"><parent link="b"/><child link="pod"/><origin xyz="0 30 1" '
        'rpy="1 2 3"/></joint>'
    )
    text = arm(extra=pod + fixed)
    assert set(read(text, tmp_path).mechanism.bodies) == {"a", "b"}
    ours, theirs = accelerations(text, tmp_path, [0.3, -0.7], [1.2, 2.0], [0.1, -0.2])
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)
    without, _ = accelerations(arm(), tmp_path, [0.3, -0.7], [1.2, 2.0], [0.1, -0.2])
    assert abs(np.subtract(ours, without)).max() > 1e-5


@pytest.mark.parametrize(
    "solid",
    [
        "box size='0 0 0'",
        "box size='1 1 -1'",
        "sphere radius='0'",
        "cylinder radius='1' length='0'",
    ],
)
def test_a_visual_without_size_is_noted_and_refuses_nothing(solid, tmp_path):
    visual = f"<visual><geometry><{solid}/></geometry></visual>"
    imported = read(arm().replace('<link name="a">', f'<link name="a">{visual}'), tmp_path)
    words = f"arm.urdf, line 2: <visual> is not shown: its {solid.partition(' ')[0]} has no size"
    assert any(words in note for note in imported.notes)
    assert not imported.mechanism.bodies["a"].shapes and not imported.mechanism.caveats


@pytest.mark.parametrize(
    "visual, words",
    [
        ("<visual/>", "holds no <geometry>"),
        ("<visual><geometry><box size='1 1'/></geometry></visual>", "size holds 2 numbers; give 3"),
        (
            "<visual><geometry><cylinder radius='1'/></geometry></visual>",
            "line 2: <cylinder>: has no attribute 'length'; add it",
        ),
        (
            "<visual><origin xyz='0 0 x'/><geometry><sphere radius='1'/></geometry></visual>",
            "xyz holds 'x', which is not a number",
        ),
    ],
)
def test_a_visual_that_is_wrong_is_noted_and_refuses_nothing(visual, words, tmp_path):
    imported = read(arm().replace('<link name="a">', f'<link name="a">{visual}'), tmp_path)
    assert any("<visual> is not shown" in note and words in note for note in imported.notes)
    assert not imported.mechanism.bodies["a"].shapes and not imported.mechanism.caveats


@pytest.mark.parametrize("shared", [True, False])
def test_a_colour_that_is_wrong_is_noted_and_refuses_nothing(shared, tmp_path):
    steel = '<material name="m"><color rgba="1 0 0"/></material>'
    own = '<material name="m"/>' if shared else steel
    visual = f'<visual><geometry><sphere radius="0.1"/></geometry>{own}</visual>'
    text = arm().replace('<link name="a">', f'<link name="a">{visual}')
    text = text.replace("<link", (steel if shared else "") + "<link", 1)
    imported = read(text, tmp_path)
    assert imported.mechanism.bodies["a"].shapes[0].colour is None
    assert any("<material 'm'> gives no colour: line" in note for note in imported.notes)


def test_fixed_joints_that_are_driven_or_mimicked(tmp_path):
    drive = '<transmission><joint name="{}"/></transmission>'
    fixed = (
        LINK.format("c")
        + '<joint name="m" type="fixed"><parent link="b"/><child link="c"/>{}</joint>'
    )
    imported = read(arm(fixed.format("") + drive.format("m") + drive.format("k")), tmp_path)
    assert imported.mechanism.actuators == ("k",)
    assert any(
        "<joint 'm'> is driven by a transmission, which is left out" in note
        for note in imported.notes
    )
    imported = read(arm(fixed.format('<mimic joint="j"/>')), tmp_path)
    assert any(
        "<joint 'm'> is fixed, so that it mimics no other" in note for note in imported.notes
    )
    assert not imported.mechanism.gears and not imported.mechanism.caveats
    with pytest.warns(
        ModelWarning, match="<joint 'k'> mimics a joint that is fixed; it moves freely here"
    ):
        imported = read(arm(fixed.format(""), second='<mimic joint="m"/>'), tmp_path)
    assert not imported.mechanism.gears


def test_names_that_a_mechanism_does_not_take_are_changed_and_noted(tmp_path):
    text = arm(second='<mimic joint="j"/>', extra='<transmission><joint name="j"/></transmission>')
    for old, new in (("a", "ground"), ("b", "link.0"), ("j", "j.1"), ("k", " k\u200b")):
        text = text.replace(f'name="{old}"', f'name="{new}"').replace(f'="{old}"', f'="{new}"')
    imported = read(text, tmp_path)
    mechanism = imported.mechanism
    assert list(mechanism.bodies) == ["ground_2", "link_0"]
    assert list(mechanism.joints) == ["j_1", "k_", "k__mimic"]
    assert mechanism.actuators == ("j_1",)
    assert mechanism.joints["k_"].connects == ("ground_2", "link_0")
    assert any("<link 'ground'> is called 'ground_2' here" in note for note in imported.notes)
    assert lw.Robot(mechanism).mobility == 1


def test_light_links_that_carry_a_joint_stay_bodies(tmp_path):
    text = samples.URDF.replace(
        '<link name="tool0"/>', '<link name="tool0"/><link name="wheel"/>'
    ).replace(
        "</robot>",
        (
            '<joint name="w" type="continuous"><parent link="tool0"/><child '
            'link="wheel"/></joint></robot>'
        ),
    )
    mechanism = read(text, tmp_path).mechanism
    assert {"tool0", "wheel"} <= set(mechanism.bodies)
    assert mechanism.tools == {}


def test_elements_that_are_not_read_are_named(tmp_path):
    extra = "<gazebo/><material name='m'/>"
    imported = read(arm(extra, first="<spin/><joint_properties friction='0.0'/>"), tmp_path)
    assert any(
        "<gazebo> is left out: it is no part of a mechanism known here" in note
        for note in imported.notes
    )
    assert any("<spin> in a <joint> is left out" in note for note in imported.notes)
    assert not any("joint_properties" in note or "material" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("old", "new", "alters"),
    [
        ("</robot>", '<xacro:property name="m" value="3"/></robot>', False),
        ("</robot>", '<xacro:leg name="l"/></robot>', True),
        ("</link>", '<xacro:sphere_inertial r="1"/></link>', True),
    ],
)
def test_macros_that_make_nothing_are_left_out_and_others_are_told(old, new, alters, tmp_path):
    imported = read(arm().replace(old, new), tmp_path)
    assert any("is a macro; expand the file with xacro first" in note for note in imported.notes)
    assert any("macro" in caveat for caveat in imported.mechanism.caveats) == alters


def test_what_only_a_macro_would_make_is_refused_with_that_reason(tmp_path):
    text = arm().replace('<child link="b"/>', '<child link="l"/>')
    with pytest.raises(MechanismError, match=r"<xacro:leg>: is a macro; .*there is no link 'l'"):
        read(text.replace("</robot>", "<xacro:leg/></robot>"), tmp_path)
    with pytest.raises(MechanismError, match=r"which is a macro; expand the file with xacro"):
        read(arm().replace('value="1"', 'value="${m}"', 1), tmp_path)
    with pytest.raises(MechanismError, match=r"xacro arm\.urdf\.xacro > robot\.urdf"):
        read(arm(), tmp_path, "arm.urdf.xacro")


@pytest.mark.parametrize("text", ["${x + 1} 0 0", "$(optenv IMU_XYZ 0.19 0 0.149)", "0 0 -${z}"])
def test_macros_of_several_words_are_told_as_such_and_not_counted(text, tmp_path):
    element = Element("origin", {"xyz": text}, tmp_path / "robot.urdf", 1)
    with pytest.raises(MechanismError, match="which is a macro; expand the file with xacro first"):
        element.vector("xyz")


@pytest.mark.parametrize(
    "off",
    ["<gravity>false</gravity>", "<turnGravityOff>true</turnGravityOff>", "<gravity>1</gravity>"],
)
def test_weight_that_gazebo_switches_off_is_carried(off, tmp_path):
    def mechanism(reference):
        gazebo = f"<gazebo {reference}>{off}</gazebo></robot>"
        return read(arm().replace("</robot>", gazebo), tmp_path).mechanism

    found, body = mechanism('reference="b"'), mechanism("").bodies["b"]
    assert not found.caveats
    lift = Lift(body="b", point=body.centre_of_mass, mass=body.mass)
    assert found.lifts == ({} if "1" in off else {"b": lift})
    told = [caveat for caveat in mechanism("").caveats if "it is told of no link" in caveat]
    assert len(told) == ("1" not in off)


REFUSED = {
    "<robot name='r'/>": "holds no links",
    "<robot><link name='a'/><link name='a'/></robot>": "<link 'a'>: has the name of another link",
    (
        "<robot><link name='a'/><link name='b'/></robot>"
    ): "the links 'a', 'b' are carried by no joint; exactly one",
    "<robot><xacro:property name='x'/></robot>": "is a macro; expand the file with xacro first",
    arm(kind="screw"): (
        "<joint 'k'>: type 'screw' is not one of revolute, continuous, prismatic, fixed, "
        "floating, planar, spherical"
    ),
    arm(
        second='<axis xyz="0 0 0"/>'
    ): "<axis>: axis has no length; give a direction such as '0 0 1'",
    arm(second='<origin xyz="0 0"/>').replace(
        '<origin xyz="0 0 1"/>', ""
    ): "<origin>: xyz holds 2 numbers; give 3",
    arm().replace('value="1"', 'value="-1"', 1): "<link 'a'>: mass: ",
    arm().replace('name="k"', 'name="j"'): "<joint 'j'>: has the name of another joint",
    arm().replace('<child link="b"/>', '<child link="a"/>'): "<joint 'k'>: connects 'a' to itself",
    arm().replace('<child link="b"/>', '<child link="c"/>'): "<joint 'k'>: there is no link 'c'",
    arm().replace('<parent link="a"/>', ""): "<joint 'k'>: holds no <parent>; add one",
    arm().replace(
        '<parent link="a"/><child link="b"/>', '<parent link="b"/><child link="a"/>'
    ): "the links 'base', 'b' are carried by no joint; exactly one",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refusals_name_file_and_line(text, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(text, tmp_path)
    assert str(refusal.value).startswith(f"{tmp_path / 'arm.urdf'}: line ")
    assert REFUSED[text] in str(refusal.value)


def test_a_joint_without_axis_and_without_room_is_fixed(tmp_path):
    """Pinocchio reads it as a joint that moves nothing: inertia at the others is the same."""
    text = samples.URDF.replace('<axis xyz="0 1 1"/>', '<axis xyz="0 0 0"/>')
    imported = read(text.replace('lower="-0.2"', 'lower="0.2"'), tmp_path)
    robot, theirs = lw.Robot(imported.mechanism), pin.buildModelFromUrdf(str(tmp_path / "arm.urdf"))
    M = pin.crba(theirs, theirs.createData(), pin.neutral(theirs))
    assert robot.actuators == ("shoulder", "elbow") and not imported.mechanism.caveats
    np.testing.assert_allclose(robot.mass_matrix(robot.home), M[:2, :2], rtol=1e-12, atol=1e-12)
    assert sum("<joint 'stroke'> is fixed: its axis has no" in note for note in imported.notes) == 1
    with pytest.raises(MechanismError, match="axis has no length"):
        read(text, tmp_path)


def test_an_inertial_without_a_mass_is_told(tmp_path):
    with pytest.warns(ModelWarning, match="<inertial> of 'a' holds no <mass>, which is zero then"):
        imported = read(arm().replace('<mass value="1"/>', '<density value="500"/>', 1), tmp_path)
    assert imported.mechanism.bodies["a"].mass == 0


def test_a_circle_of_links_is_refused(tmp_path):
    text = arm().replace("</robot>", "") + (
        '<link name="c"/><link name="d"/><joint name="m" type="fixed"><parent link="c"/><child '
        'link="d"/></joint>'
        '<joint name="n" type="fixed"><parent link="d"/><child link="c"/></joint></robot>'
    )
    with pytest.raises(
        MechanismError, match="hangs in a circle of joints that does not reach the root link"
    ):
        read(text, tmp_path)


def test_joints_that_are_not_there_refuse_nothing(tmp_path):
    """Pinocchio reads such files as well."""
    drive = '<transmission><joint name="m"/></transmission><transmission><joint name="j"/>'
    imported = read(arm(drive + "</transmission>"), tmp_path)
    assert imported.mechanism.actuators == ("j",) and not imported.mechanism.caveats
    assert any("<joint 'm'> is driven by a transmission, which is" in n for n in imported.notes)
    with pytest.warns(ModelWarning, match="there is none 'm'; it moves freely here"):
        imported = read(arm(second='<mimic joint="m"/>'), tmp_path)
    assert not imported.mechanism.gears


def test_a_mimic_by_nothing_holds_its_joint_at_the_offset(tmp_path):
    """As of fingers that the synergy of a hand leaves alone."""
    imported = read(arm(second='<mimic joint="j" multiplier="0.0" offset="0.4"/>'), tmp_path)
    robot = lw.Robot(imported.mechanism)
    assert robot.mobility == 1 and not imported.mechanism.caveats
    assert imported.mechanism.joints["k_mimic"].type == "fixed"
    assert float(robot.home["k"]) == pytest.approx(0.4, abs=1e-12)


def test_negative_moments_are_kept_and_warned_of(tmp_path):
    text = arm(first='<axis xyz="0.6 0 0.8"/>').replace(
        'izz="0.1"/>', 'izz="0.1" ixy="0.12" ixz="0" iyz="0" />', 1
    )
    with pytest.warns(
        ModelWarning, match="<link 'a'> has a principal moment of inertia below zero"
    ):
        ours, theirs = accelerations(text, tmp_path, [0.3, -0.7], [1.2, 2.0], [0.1, -0.2])
    np.testing.assert_allclose(ours, theirs, rtol=1e-11)


def test_what_other_programs_read_of_a_link_changes_nothing(tmp_path):
    for words, alters in (("<contact/>", False), ("<self_filter/>", False), ("<mass/>", True)):
        text = arm().replace('<link name="a">', f'<link name="a">{words}')
        assert bool(read(text, tmp_path).mechanism.caveats) == alters


def test_springs_of_gazebo_and_what_it_says_of_the_motion(tmp_path):
    spring = (
        '<gazebo reference="j"><springStiffness>4</springStiffness><springReference>0.2'
        "</springReference></gazebo>"
    )
    imported = read(arm(spring), tmp_path)
    assert imported.mechanism.joints["j"].spring == lw.Spring(stiffness=4, rest=0.2)
    assert not imported.mechanism.caveats
    text = arm('<gazebo reference="a"><kinematic>{}</kinematic></gazebo>')
    assert not read(text.format("false"), tmp_path).mechanism.caveats
    with pytest.warns(ModelWarning, match="<kinematic> in a <gazebo> is left out: bodies move by"):
        read(text.format("true"), tmp_path)


def test_reductions_and_limits_of_effort_are_drives(tmp_path):
    """The command is the motor's torque; the joint's is 50 x 0.5 times that within its effort."""
    drive = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
        '<joint name="j"><mechanicalReduction>0.5</mechanicalReduction></joint>'
        '<actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>'
    )
    limit = '<limit effort="20" velocity="1"/>'
    robot = lw.Robot(read(arm(drive, first='<axis xyz="0 0 1"/>' + limit), tmp_path).mechanism)
    assert robot.actuators == ("j",)
    servo = {"type": "servo", "gain": 25, "least_force": -20, "largest_force": 20}
    assert robot.mechanism.drives == {"j": servo}
    for command, force in ((0.1, 2.5), (3.0, 20.0)):
        runs = [
            robot.simulate(robot.home, [u], drives=drives, duration=0.01).final
            for u, drives in ((command, robot.drives), (force, None))
        ]
        assert runs[0]["j"] == pytest.approx(runs[1]["j"], rel=1e-9)


def test_a_reduction_that_is_no_number_is_1_and_noted(tmp_path):
    drive = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
        '<joint name="j"/><actuator name="m"><mechanicalReduction>reduction</mechanicalReduction>'
        "</actuator></transmission>"
    )
    imported = read(arm(drive), tmp_path)
    assert imported.mechanism.actuators == ("j",) and not imported.mechanism.drives
    assert any("<mechanicalReduction> is no number" in note for note in imported.notes)


@pytest.mark.parametrize("effort", ["0", "inf", "1e60", "much", "-3"])
def test_limits_of_effort_that_bound_nothing_are_none(effort, tmp_path):
    text = arm(first=f'<limit effort="{effort}" velocity="1"/>')
    assert not read(text, tmp_path).mechanism.drives


PAIR = (
    "<transmission name='t'><type>transmission_interface/{}Transmission</type>"
    "<actuator name='m2'><role>actuator2</role><mechanicalReduction>7</mechanicalReduction>"
    "</actuator><actuator name='m1'><role>actuator1</role><mechanicalReduction>5"
    "</mechanicalReduction></actuator>"
    "<joint name='{}'><role>joint1</role><mechanicalReduction>2</mechanicalReduction></joint>"
    "<joint name='k'><role>joint2</role><mechanicalReduction>3</mechanicalReduction></joint>"
    "</transmission>"
)


@pytest.mark.parametrize(
    ("kind", "torques"),
    [
        ("Differential", [[2 * 5, 3 * 5], [2 * 7, -3 * 7]]),
        ("FourBarLinkage", [[2 * 5, -3 * 2 * 5], [0, 3 * 7]]),
    ],
)
def test_transmissions_of_two_motors_act_on_both_joints(kind, torques, tmp_path):
    """Rows: torques on j and k by one newton metre of either motor, the first one first."""
    robot = lw.Robot(read(arm(PAIR.format(kind, "j")), tmp_path).mechanism)
    assert robot.actuators == ("m1", "m2")
    S = robot.actuation(robot.home)
    order = [robot.independent.index(name) for name in ("j", "k")]
    np.testing.assert_allclose(S[:, order], torques)


def test_a_pair_that_is_not_whole_drives_what_is_there(tmp_path):
    imported = read(arm(PAIR.format("Differential", "m")), tmp_path)
    assert imported.mechanism.actuators == ("k",)
    assert any("does not lead from two motors to two hinges" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("velocity", "speed"), [("2", 2), ("0", None), ("-1", None), ("1e60", None), ("fast", None)]
)
def test_limits_of_velocity_are_limits_of_speed(velocity, speed, tmp_path):
    """Written, they are the same again: of what has ends as of what has none."""
    limit = f'<limit lower="-1" upper="2" velocity="{velocity}"/>'
    imported = read(arm(first=limit), tmp_path)
    assert imported.mechanism.joints["j"].limits == Limits(lower=-1, upper=2, speed=speed)
    assert not any("velocity" in note for note in imported.notes)
    free = lw.RevoluteJoint(connects=("ground", "b"), limits=Limits(speed=speed))
    ball = lw.Body(mass=1, inertia=lw.Inertia(xx=1, yy=1, zz=1))
    mechanism = lw.Mechanism(bodies={"b": ball}, joints={"turn": free})
    path = tmp_path / "turn.urdf"
    lw.formats.save(mechanism, path)
    assert load(path).mechanism.joints["turn"].limits == free.limits
    assert ("<limit" in path.read_text()) == (speed is not None)


def test_rotors_behind_gears_add_to_the_inertia(tmp_path):
    """Drake's elements: gear_ratio^2 rotor_inertia at the joint."""
    drive = (
        '<transmission type="SimpleTransmission"><actuator name="m">'
        '<drake:gear_ratio value="10"/><drake:rotor_inertia value="0.002"/></actuator>'
        '<joint name="{}"/></transmission>'
    )
    first, second, _ = (
        read(arm(extra=drive.format(name)), tmp_path).mechanism.joints
        for name in ("j", "k", "none")
    )
    assert first["j"].rotor_inertia == pytest.approx(0.2)
    assert (first["k"].rotor_inertia, second["k"].rotor_inertia) == (0, pytest.approx(0.2))


@pytest.mark.parametrize("tag", ["linear_bushing_rpy", "tendon_constraint", "prismatic_spring"])
def test_what_drake_adds_to_the_motion_is_warned_of(tag, tmp_path):
    with pytest.warns(ModelWarning, match=f"drake:{tag}"):
        read(arm(extra=f'<drake:{tag} name="x"/>'), tmp_path)


BALL = """<robot name="r"><link name="a"/>{links}
<joint name="j" type="spherical"><origin xyz="0.1 0 0.3" rpy="0.2 0 0"/><parent link="a"/>
<child link="b"/><axis xyz="0 0 0"/><dynamics damping="0.3"{more}/></joint>
<joint name="k" type="continuous"><origin xyz="0.3 0 0"/><parent link="b"/><child link="c"/>
<axis xyz="0 1 0"/></joint></robot>"""
SOLID = """<link name="{}"><inertial><origin xyz="0.1 0.2 0"/><mass value="2"/>
<inertia ixx="0.2" iyy="0.3" izz="0.25" ixy="0.01" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="gone.stl" scale="0.001"/></geometry></visual></link>"""


def test_balls_of_bullet_move_as_mujoco_says(tmp_path):
    path, links = tmp_path / "ball.urdf", SOLID.format("b") + SOLID.format("c")
    path.write_text(BALL.format(links=links, more=""))
    mechanism = load(path).mechanism
    assert mechanism.joints["j"].type == "spherical" and not mechanism.caveats
    seen = path.read_text().replace("<visual>", "<!--").replace("</visual>", "-->")
    (tmp_path / "bare.urdf").write_text(seen)
    assert apart(lw.Robot(mechanism), MuJoCoSide(tmp_path / "bare.urdf")) < 1e-9
    path.write_text(BALL.format(links=links, more=' friction="0.1"'))
    (caveat,) = load(path).mechanism.caveats
    assert "has dry friction, which is left out" in caveat
