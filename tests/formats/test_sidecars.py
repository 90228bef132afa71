"""The conventions for loops beside URDF: the five-bar of the catalogue written in each of them
moves like it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.formats import load
from linkwork.mechanism import MechanismError

LINK = (
    '<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>'
    '<inertia ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="continuous" {4}><parent link="{1}"/><child link="{2}"/>'
    '<origin xyz="{3} 0 0"/><axis xyz="0 0 1"/></joint>'
)
CHAIN = {  # joint: parent, child, place, independent
    "motor_1": ("base", "proximal_1", 0, "true"),
    "motor_2": ("base", "proximal_2", 0.3, "true"),
    "elbow_1": ("proximal_1", "distal_1", 0.25, "false"),
    "elbow_2": ("proximal_2", "distal_2", 0.25, "false"),
}
LOOP = (
    '<loop name="tip" type="revolute"><predecessor link="distal_1"><origin xyz="0.35 0 '
    '0"/></predecessor>'
    '<successor link="distal_2"><origin xyz="0.35 0 0"/></successor><axis xyz="0 0 1"/></loop>'
)
FRAMES = "".join(
    f'<link name="end_{k}"><inertial><mass value="1e-13"/></inertial></link><joint '
    f'name="end_{k}_frame" type="fixed">'
    f'<parent link="distal_{k}"/><child link="end_{k}"/><origin xyz="0.35 0 0"/></joint>'
    for k in (1, 2)
)


def five_bar(extra="", independent=False):
    """Return the five-bar of the catalogue as URDF, open at its tip."""
    links = '<link name="base"/>'
    for k in (1, 2):
        for name, length, mass in (("proximal", 0.25, 0.4), ("distal", 0.35, 0.3)):
            links += LINK.format(f"{name}_{k}", length / 2, mass, mass * length**2 / 12)
    joints = "".join(
        JOINT.format(name, parent, child, x, f'independent="{said}"' if independent else "")
        for name, (parent, child, x, said) in CHAIN.items()
    )
    return f'<robot name="five-bar">{links}{joints}{extra}</robot>'


def read(text, tmp_path, sidecar=None, name="robot.yaml"):
    (tmp_path / "robot.urdf").write_text(text, encoding="utf-8")
    if sidecar is not None:
        (tmp_path / name).write_text(sidecar, encoding="utf-8")
    return load(tmp_path / "robot.urdf")


def assert_moves_like_the_five_bar(mechanism):
    known = lw.robots.five_bar()
    reference = {name: known.reference[name] for name in CHAIN}
    near, far = lw.Robot(known), lw.Robot(mechanism.model_copy(update={"reference": reference}))
    assert far.mobility == 2
    rates, forces = {"motor_1": 0.7, "motor_2": -1.2}, [0.3, -0.4]
    states = [
        robot.assemble(joints={"motor_1": 2.1, "motor_2": 1.0}, rates=rates)
        for robot in (near, far)
    ]
    a = [
        robot.forward_dynamics(state, forces)
        for robot, state in zip((near, far), states, strict=True)
    ]
    np.testing.assert_allclose(a[1], a[0], rtol=1e-9)


def test_a_loop_element(tmp_path):
    imported = read(five_bar(LOOP, independent=True), tmp_path)
    assert imported.mechanism.actuators == ("motor_1", "motor_2")
    assert imported.mechanism.joints["tip"].type == "revolute"
    assert_moves_like_the_five_bar(imported.mechanism)


def test_a_loop_without_a_word_on_the_actuators(tmp_path):
    imported = read(five_bar(LOOP), tmp_path)
    assert imported.mechanism.actuators == ()
    assert any(
        "nothing says which joints are driven; name the actuators" in note
        for note in imported.notes
    )


@pytest.mark.parametrize("kind", ["prismatic", "fixed", "spherical", "planar"])
def test_loops_of_other_types(kind, tmp_path):
    mechanism = read(five_bar(LOOP.replace('"revolute"', f'"{kind}"')), tmp_path).mechanism
    assert mechanism.joints["tip"].type == kind


LOOP_JOINT = (
    '<loop_joint name="tip" {}><link1 link="distal_1" rpy="0 0 1" xyz="0.35 0 0"/>'
    '<{} link="distal_2" xyz="0.35 0 0"/><axis xyz="0 0 1"/></loop_joint>'
)


@pytest.mark.parametrize(
    ("kind", "second", "joint"),
    [
        ("", "link2", "revolute"),  # as Drake had them
        ('type="continuous"', "link2", "revolute"),
        (
            'type="spherical"',
            "link1",
            "spherical",
        ),  # as the page of Isaac Sim has it, and exporters
    ],
)
def test_a_loop_joint_of_isaac_sim_and_of_drake(kind, second, joint, tmp_path):
    imported = read(five_bar(LOOP_JOINT.format(kind, second), independent=True), tmp_path)
    assert imported.mechanism.joints["tip"].type == joint
    assert not any("loop_joint" in note for note in imported.notes)
    if joint == "revolute":
        assert_moves_like_the_five_bar(imported.mechanism)


@pytest.mark.parametrize(
    "extra",
    [
        '<loop_joint name="tip"><parent link="distal_1"/><child link="distal_2"/></loop_joint>',
        '<force_element name="f"><torsional_spring stiffness="1"/></force_element>',
    ],
)
def test_what_ties_or_pushes_and_is_not_read_is_warned_of(extra, tmp_path):
    with pytest.warns(ModelWarning, match="is left out: it is no part of a mechanism known here"):
        read(five_bar(extra), tmp_path)


CONSTRAINT = (
    '<constraint name="tip" type="{}"><parent link="distal_1"/><parent_origin xyz="0.35 0 0"/>'
    '<parent_axis xyz="{}"/><child link="distal_2"/><child_origin xyz="0.35 0 0"/>'
    '<child_axis xyz="{}"/></constraint>'
)


@pytest.mark.parametrize("axes", ["0 0 1", "0 0 -1"])
def test_a_constraint_of_urdfdoms_proposal(axes, tmp_path):
    text = five_bar(CONSTRAINT.format("revolute", axes, axes), independent=True)
    assert_moves_like_the_five_bar(read(text, tmp_path).mechanism)


def test_axes_of_constraints_are_where_the_file_puts_them(tmp_path):
    """A hinge's axes agree on either side, those of a universal joint are square to each other."""
    one, two = np.array([0.6, 0, 0.8]), np.array([0, 0.8, -0.6])
    text = CONSTRAINT.format("{}", "0.6 0 0.8", "0 0.8 -0.6")
    for kind, own in (("revolute", "zz"), ("prismatic", "zz"), ("universal", "xy")):
        joint = read(five_bar(text.format(kind)), tmp_path).mechanism.joints["tip"]
        assert joint.type == kind
        for letter, frame, axis in zip(own, joint.frames, (one, two), strict=True):
            turn = Rotation.from_rotvec(frame.rotation).as_matrix()
            np.testing.assert_allclose(turn[:, "xyz".index(letter)], axis, atol=1e-15)
            assert frame.position == (0.35, 0, 0)
    for kind in ("fixed", "ball", "planar"):
        read(five_bar(text.format(kind)), tmp_path)


def test_a_joint_inside_gazebo_closes_a_loop_as_all_joints_are_at_zero(tmp_path):
    """The tips are at 0.6 and 0.9 m then."""
    inside = (
        '<gazebo><joint name="tip" type="{}"><parent>distal_1</parent><child>distal_2</child>'
        "<pose>0.35 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint></gazebo>"
    )
    loop = LOOP.replace('"0.35 0 0"', '"0.65 0 0"', 1)
    found, expected = (
        read(five_bar(text), tmp_path).mechanism.joints["tip"]
        for text in (inside.format("revolute"), loop)
    )
    assert found.type == "revolute" and found.connects == expected.connects
    assert found.frames[0].position == pytest.approx(expected.frames[0].position)
    assert found.frames[1] == expected.frames[1] and found.axis == expected.axis
    assert read(five_bar(inside.format("ball")), tmp_path).mechanism.joints["tip"].type == (
        "spherical"
    )


def test_a_screw_inside_gazebo_closes_a_loop(tmp_path):
    """A slide is led by a screw's nut: radians per metre of a left-hand thread, as in SDF."""
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    text = f"""<robot name="lift"><link name="base"/><link name="nut">{body}<link name="lift">{body}
<joint name="turn" type="continuous"><parent link="base"/><child link="nut"/><axis xyz="0 0 1"/>
</joint><joint name="up" type="prismatic"><parent link="base"/><child link="lift"/>
<axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint>
<gazebo><joint name="thread" type="screw"><parent>lift</parent><child>nut</child>
<axis><xyz>0 0 1</xyz></axis><thread_pitch>50</thread_pitch></joint></gazebo></robot>"""
    mechanism = read(text, tmp_path).mechanism
    assert mechanism.joints["thread"].pitch == -1 / 50
    robot = lw.Robot(mechanism)
    state = robot.assemble({"turn": 0.5})
    # The nut turns and does not rise: it has risen against the lift by as much as that went down.
    assert robot.mobility == 1 and state["up"] == pytest.approx(0.5 / 50)


def test_joints_inside_gazebo_that_are_left_out_are_warned_of(tmp_path):
    inside = (
        '<gazebo><link name="extra"/><joint name="{}" type="revolute"><parent>distal_1</parent>'
        "<child>{}</child></joint></gazebo>"
    )
    for name, child, why in (
        ("tip", "extra", "it leads to a link that only a <gazebo> has"),
        ("motor_1", "distal_2", "another joint has its name"),
    ):
        with pytest.warns(ModelWarning, match=f"<joint '{name}'> in a <gazebo> is left out: {why}"):
            mechanism = read(five_bar(inside.format(name, child)), tmp_path).mechanism
        assert mechanism.joints.keys() == CHAIN.keys()


def test_a_joint_inside_gazebo_may_be_told_from_other_links(tmp_path):
    text = five_bar(
        '<gazebo><joint name="tip" type="revolute"><parent>distal_1</parent>'
        '<child>distal_2</child><pose relative_to="{0}">0.9 0 0 0.4 0.5 0</pose><axis>'
        '<xyz expressed_in="{0}">0 0 1</xyz></axis></joint></gazebo>'
    )
    for told in ("base", "__model__"):
        tip = read(text.format(told), tmp_path).mechanism.joints["tip"]
        for frame, x in zip(tip.frames, (0.65, 0.35), strict=True):
            turn = Rotation.from_rotvec(frame.rotation)
            assert frame.position == pytest.approx((x, 0, 0), abs=1e-15)
            assert turn.apply(tip.axis) == pytest.approx((0, 0, 1), abs=1e-15)
    with pytest.raises(MechanismError, match="relative_to 'hand' is no link of the robot"):
        read(text.format("hand"), tmp_path)


def test_a_link_that_two_joints_carry_closes_a_loop(tmp_path):
    """A frame of one distal link on the other's tip, as programs for CAD write loops."""
    pin = '<link name="pin"/><joint name="weld" type="fixed"><parent link="distal_2"/>'
    pin += '<child link="pin"/><origin xyz="0.35 0 0"/></joint>'
    pin += JOINT.format("tip", "distal_1", "pin", 0.35, 'independent="false"')
    imported = read(five_bar(pin, independent=True), tmp_path)
    assert imported.mechanism.joints["tip"].connects == ("distal_1", "distal_2")
    assert any("carries 'pin', as 'weld' does: it closes a loop" in n for n in imported.notes)
    assert_moves_like_the_five_bar(imported.mechanism)
    with pytest.raises(MechanismError, match="'distal_2' to itself, by way of fixed joints"):
        read(five_bar(pin.replace('parent link="distal_1"', 'parent link="distal_2"')), tmp_path)


def test_motors_that_the_model_does_not_have_are_noted(tmp_path):
    sidecar = "closed_loop: [[end_1, end_2]]\ntype: [3d]\nname_mot: [motor_1, motor_9, motor_2]\n"
    imported = read(five_bar(FRAMES), tmp_path, sidecar)
    assert imported.mechanism.actuators == ("motor_1", "motor_2")
    assert "robot.yaml: the motor 'motor_9' is left out: robot.urdf has no such joint" in (
        imported.notes
    )


def test_a_coupling_is_a_gear_along_both_chains(tmp_path):
    coupling = (
        '<coupling name="belt" type="rolling"><predecessor link="distal_1"/><successor '
        'link="proximal_2"/>'
        '<ratio value="6"/></coupling>'
    )
    gear = read(five_bar(coupling), tmp_path).mechanism.joints["belt"]
    assert gear.ratios == {"elbow_1": 6, "motor_1": 6, "motor_2": -1}


def test_closed_loops_of_3d_between_frames(tmp_path):
    sidecar = "closed_loop: [[end_1, end_2]]\ntype: ['3d']\nname_mot: ['motor_1', 'motor_2']\n"
    imported = read(five_bar(FRAMES), tmp_path, sidecar)
    mechanism = imported.mechanism
    assert mechanism.joints["loop_1"].type == "spherical"
    assert mechanism.joints["loop_1"].connects == ("distal_1", "distal_2")
    assert list(mechanism.bodies) == ["proximal_1", "distal_1", "proximal_2", "distal_2"]
    assert mechanism.tools == {}
    assert imported.notes[0] == "robot.yaml: closes the loops of robot.urdf"
    assert_moves_like_the_five_bar(mechanism)


def test_a_closed_loop_of_6d_with_a_hinge_before_it(tmp_path):
    extra = (
        '<link name="wrist"/>'
        '<joint name="tip" type="continuous"><parent link="distal_1"/><child '
        'link="wrist"/><origin xyz="0.35 0 0"/>'
        '<axis xyz="0 0 1"/></joint>'
    )
    sidecar = "closed_loop:\n  - [tip, end_2]\nname_mot: [motor_1, motor_2]\n"
    mechanism = read(five_bar(extra + FRAMES), tmp_path, sidecar, "robot.yaml").mechanism
    assert mechanism.joints["loop_1"].type == "fixed"
    assert mechanism.joints["loop_1"].connects == ("wrist", "distal_2")
    assert_moves_like_the_five_bar(mechanism)


def test_the_file_may_have_the_models_own_name(tmp_path):
    sidecar = "closed_loop: [[end_1, end_2]]\ntype: [3d]\nname_mot: [motor_1]\n"
    (tmp_path / "bar.urdf").write_text(five_bar(FRAMES), encoding="utf-8")
    (tmp_path / "bar.yaml").write_text(sidecar, encoding="utf-8")
    assert load(tmp_path / "bar.urdf").mechanism.actuators == ("motor_1",)


def test_a_mechanism_file_of_the_same_name_is_no_file_of_loops(tmp_path):
    lw.robots.five_bar().save(tmp_path / "robot.yaml")
    assert "loop_1" not in read(five_bar(), tmp_path).mechanism.joints


def ball_chain(
    masses=(0, 0), axes=("1 0 0", "0 1 0", "0 0 1"), places=("0.1 0 0", "0 0 0", "0 0 0")
):
    links, joints = '<link name="base"/>', ""
    names = ["base", "x_link", "y_link", "arm"]
    for k, name in enumerate(names[1:]):
        links += LINK.format(name, 0.1, (*masses, 1.0)[k], 0.01 if k == 2 else 0)
        joints += (
            f'<joint name="b{k}" type="revolute"><parent link="{names[k]}"/><child link="{name}"/>'
            f'<origin xyz="{places[k]}" rpy="0.1 0.2 {k}"/><axis xyz="{axes[k]}"/></joint>'
        )
    return f'<robot name="ball">{links}{joints}</robot>'


NO_LOOPS = "closed_loop: []\nname_mot: []\n"


def test_hinges_stay_apart_where_nothing_is_merged(tmp_path):
    text = ball_chain(masses=(1e-6, 1e-6), places=("0.1 0 0", "5e-5 0 0", "0 0 0"))
    merged = read(text, tmp_path, NO_LOOPS)
    assert merged.mechanism.caveats[0].endswith("left out (merging=False, --no-merging keeps them)")
    apart = load(tmp_path / "robot.urdf", merging=False)
    assert not apart.mechanism.caveats
    assert {name: joint.type for name, joint in apart.mechanism.joints.items()} == dict.fromkeys(
        ("b0", "b1", "b2"), "revolute"
    )
    with pytest.raises(LinkworkError, match="merging is 'no'; give True or False"):
        load(tmp_path / "robot.urdf", merging="no")  # pyright: ignore[reportArgumentType]


def test_three_hinges_through_one_point_are_a_spherical_joint(tmp_path):
    plain = read(ball_chain(), tmp_path).mechanism
    assert [joint.type for joint in plain.joints.values()] == ["revolute"] * 3
    imported = read(ball_chain(), tmp_path, NO_LOOPS)
    assert {name: joint.type for name, joint in imported.mechanism.joints.items()} == {
        "b2": "spherical"
    }
    assert "robot.urdf: b0, b1 and b2 are one spherical joint, 'b2'" in imported.notes
    near, far = lw.Robot(plain), lw.Robot(imported.mechanism)
    for robot in (near, far):
        p, R = robot.body_poses(robot.home)["arm"]
        np.testing.assert_allclose(p, near.body_poses(near.home)["arm"][0], atol=1e-12)
        np.testing.assert_allclose(R, near.body_poses(near.home)["arm"][1], atol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        ball_chain(masses=(0, 0.1)),
        ball_chain(axes=("1 0 0", "1 0 0", "0 0 1")).replace('rpy="0.1 0.2 1"', ""),
        ball_chain(places=("0 0 0", "0 0 0.1", "0 0 0")),
        ball_chain(places=("1e-5 0 0", "0 0 1e-6", "0 0 0")),
    ],
)
def test_three_hinges_that_are_no_spherical_joint(text, tmp_path):
    mechanism = read(text, tmp_path, NO_LOOPS).mechanism
    assert [joint.type for joint in mechanism.joints.values()] == ["revolute"] * 3


def test_hinges_of_a_large_robot_meet_within_its_own_rounding(tmp_path):
    imported = read(ball_chain(places=("1e3 0 0", "0 0 1e-2", "0 0 0")), tmp_path, NO_LOOPS)
    assert [joint.type for joint in imported.mechanism.joints.values()] == ["spherical"]
    assert "the distances of 0.01 m" in imported.mechanism.caveats[0]


def test_driven_hinges_stay_hinges(tmp_path):
    mechanism = read(ball_chain(), tmp_path, "closed_loop: []\nname_mot: [b1]\n").mechanism
    assert [joint.type for joint in mechanism.joints.values()] == ["revolute"] * 3


@pytest.mark.parametrize(
    ("kind", "type_"),
    [
        ("SPHERICAL", "spherical"),
        ("FIXED", "fixed"),
        ("UJOINT_ZX", "universal"),
        ("UJOINT_YZ", "universal"),
    ],
)
def test_types_of_joints(kind, type_, tmp_path):
    sidecar = f"closed_loop: []\nname_mot: [motor_1]\njoint_name: [elbow_1]\njoint_type: [{kind}]\n"
    joint = read(five_bar(), tmp_path, sidecar).mechanism.joints["elbow_1"]
    assert joint.type == type_
    if type_ == "universal":
        assert joint.axes == tuple(tuple(np.eye(3)["XYZ".index(letter)]) for letter in kind[-2:])


def test_the_type_of_a_joint_that_is_not_there_is_noted(tmp_path):
    """As the reader of the collection that such files are from does it: the type says nothing."""
    loops = "closed_loop: []\nname_mot: [motor_1]\n"
    sidecar = loops + "joint_name: [left_ball, elbow_1]\njoint_type: [SPHERICAL, FIXED]\n"
    read_ = read(five_bar(), tmp_path, sidecar)
    assert (
        "robot.yaml: the type of 'left_ball' is left out: robot.urdf has no such joint"
        in read_.notes
    )
    assert read_.mechanism.joints["elbow_1"].type == "fixed"


REFUSED = {
    (
        "closed_loop: [[end_1, end_9]]\nname_mot: []"
    ): "robot.yaml: line 1: closed_loop.0: there is no link or joint 'end_9'",
    (
        "closed_loop:\n- [end_1]\nname_mot: []"
    ): "robot.yaml: line 2: closed_loop.0: is not a pair of frames",
    (
        "closed_loop: [[end_1, end_2]]\ntype: [5d]"
    ): "robot.yaml: line 2: type.0: '5d' is not one of 6d, 3d",
    (
        "closed_loop: [[end_1, end_2]]\ntype: [6d, 6d]"
    ): "closed_loop: is not a list of pairs of frames with one type each",
    "closed_loop: 3": "closed_loop: is not a list of pairs of frames",
    "name_mot: [[motor_1]]": "name_mot: is not a list of names",
    (
        "joint_name: [elbow_1]\njoint_type: [UJOINT_XX]"
    ): "joint_type.0: 'UJOINT_XX' is not SPHERICAL, FIXED or UJOINT_XY etc.",
    "joint_name: [elbow_1]": "joint_type: holds 0 types for the 1 joints of joint_name",
    "name_mot: [motor_1\n": "robot.yaml: line ",
    "closed_loop: [[end_1, distal_1]]\ntype: [6d]": "connects 'distal_1' to itself",
}


@pytest.mark.parametrize("sidecar", REFUSED)
def test_refusals_name_the_file_and_the_line(sidecar, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(five_bar(FRAMES), tmp_path, sidecar)
    assert REFUSED[sidecar] in str(refusal.value)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (
            LOOP.replace("revolute", "helical"),
            "<loop 'tip'>: type 'helical' is not one of revolute",
        ),
        (LOOP.replace("distal_2", "distal_3"), "<successor>: there is no link 'distal_3'"),
        (LOOP.replace('"tip"', '"motor_1"'), "has the name of another joint"),
        (LOOP + LOOP, "has the name of another joint"),
        (
            '<coupling name="c"><predecessor link="distal_1"/></coupling>',
            "holds no <successor>; add one",
        ),
    ],
)
def test_loop_elements_that_are_refused(extra, words, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(five_bar(extra), tmp_path)
    assert words in str(refusal.value)


def test_unknown_keys_are_noted(tmp_path):
    assert (
        "robot.yaml: colour is left out: it is not known here"
        in read(five_bar(), tmp_path, NO_LOOPS + "colour: red\n").notes
    )
