"""MJCF trees as MuJoCo itself understands them: masses, places, axes, accelerations; and what is
noted or refused."""

import re

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load
from linkwork.mechanism import (
    CylindricalJoint,
    FreeJoint,
    MechanismError,
    PlanarJoint,
    RevoluteJoint,
    UniversalJoint,
)
from linkwork.mechanism.record import swapped

from tests.formats import samples
from tests.formats.mujoco_side import accelerations, compiled, set_state

BODY = (
    '<mujoco>{head}<worldbody><body name="b" pos="0.1 0.2 0.3" euler="10 20 '
    '30">{body}</body></worldbody>{tail}</mujoco>'
)
INERTIAL = '<inertial pos="0.05 0.02 0.2" mass="1.3" diaginertia="0.02 0.025 0.03"/>'


def read(text, tmp_path, name="model.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load(path)


def assert_same_bodies(mechanism, text):
    model, _ = compiled(text)
    for name, body in mechanism.bodies.items():
        theirs = model.body(name)
        R = np.zeros(9)
        mj.mju_quat2Mat(R, theirs.iquat)
        R = R.reshape(3, 3)
        assert body.mass == pytest.approx(theirs.mass[0], rel=1e-12, abs=1e-15)
        np.testing.assert_allclose(body.centre_of_mass, theirs.ipos, atol=1e-12)
        np.testing.assert_allclose(
            body.inertia.tensor(), R @ np.diag(theirs.inertia) @ R.T, rtol=1e-9, atol=1e-12
        )


def assert_same_motion(mechanism, text, seed=0):
    """Compare poses, axes and accelerations at qpos0 and at a random state."""
    rng = np.random.default_rng(seed)
    robot, (model, data) = lw.Robot(mechanism), compiled(text)
    mj.mj_forward(model, data)
    check_places(robot, robot.home, data)
    check_axes(robot, data)
    coordinates = dict(
        zip(
            robot.coordinates,
            robot.home.positions + rng.uniform(-0.8, 0.8, len(robot.coordinates)),
            strict=True,
        )
    )
    for label in [label for label in coordinates if label.endswith(".qw")]:
        labels = [f"{label[:-1]}{part}" for part in "wxyz"]
        q = np.array([coordinates[part] for part in labels])
        coordinates |= dict(zip(labels, q / np.linalg.norm(q), strict=True))
    state = robot.state(coordinates, rng.normal(size=robot.mobility))
    forces = rng.normal(size=len(mechanism.actuators))
    set_state(
        model,
        data,
        coordinates,
        dict(zip(robot.rates, robot.joint_rates(state), strict=True)),
        forces,
    )
    check_places(robot, state, data)
    ours = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
    theirs = accelerations(model, data)
    assert set(theirs) == set(robot.rates)
    np.testing.assert_allclose([theirs[name] for name in robot.rates], ours, rtol=1e-9, atol=1e-9)


def check_places(robot, state, data):
    for name, (p, R) in robot.body_poses(state).items():
        try:
            body = data.body(name)
        except KeyError:  # a massless body between two joints
            continue
        np.testing.assert_allclose(p, body.xpos, atol=1e-12)
        np.testing.assert_allclose(R, body.xmat.reshape(3, 3), atol=1e-12)


def check_axes(robot, data):
    """Compare the joints' places and axes in the world, at qpos0."""
    poses = robot.body_poses(robot.home)
    for name, joint in robot.mechanism.joints.items():
        if joint.type not in ("revolute", "prismatic"):
            continue
        (p, R), frame = poses[joint.connects[1]], joint.frames[1]
        np.testing.assert_allclose(
            R @ turned(frame.rotation, joint.axis), data.joint(name).xaxis, atol=1e-12
        )
        if joint.type == "revolute":
            np.testing.assert_allclose(p + R @ frame.position, data.joint(name).xanchor, atol=1e-12)


def turned(rotation, vector):
    """Turn a vector by a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(rotation)
    if angle == 0:
        return np.array(vector)
    k, v = np.array(rotation) / angle, np.array(vector)
    return v * np.cos(angle) + np.cross(k, v) * np.sin(angle) + k * (k @ v) * (1 - np.cos(angle))


def test_a_tree_is_the_tree_that_mujoco_reads(tmp_path):
    imported = read(samples.TREE, tmp_path)
    mechanism = imported.mechanism
    assert imported.notes == ()
    assert_same_bodies(swapped(mechanism, bodies=named_bodies(mechanism)), samples.TREE)
    assert_same_motion(mechanism, samples.TREE)
    assert mechanism.name == "tree"
    assert mechanism.actuators == ("shoulder", "rail", "pitch")
    assert mechanism.gravity == (0.3, -0.2, -9.7)
    assert mechanism.tools["tip"].body == "hand"
    assert mechanism.joints["shoulder"].limits.upper == pytest.approx(np.deg2rad(170))
    assert mechanism.joints["rail"].spring.rest == 0.02
    assert mechanism.reference["yaw"] == pytest.approx(np.deg2rad(-20))


def test_tools_are_the_sites(tmp_path):
    mechanism, (model, data) = read(samples.TREE, tmp_path).mechanism, compiled(samples.TREE)
    mj.mj_forward(model, data)
    poses = lw.Robot(mechanism).body_poses(lw.Robot(mechanism).home)
    assert list(mechanism.tools) == ["tip", "edge"]
    for name, tool in mechanism.tools.items():
        (p, R), site = poses[tool.body], data.site(name)
        np.testing.assert_allclose(p + R @ tool.frame.position, site.xpos, atol=1e-12)
        for axis, column in zip(np.eye(3), site.xmat.reshape(3, 3).T, strict=True):
            np.testing.assert_allclose(R @ turned(tool.frame.rotation, axis), column, atol=1e-12)


def named_bodies(mechanism):
    return {name: body for name, body in mechanism.bodies.items() if body.mass}


def test_a_tree_far_from_its_reference(tmp_path):
    mechanism = read(samples.TREE, tmp_path).mechanism
    for seed in (1, 2):
        assert_same_motion(mechanism, samples.TREE, seed)


GEOMS = {
    "sphere": '<geom type="sphere" size="0.1" pos="0.1 0 0.2"/>',
    "shapes": '<geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0" euler="10 0 5"/>'
    '<geom type="capsule" size="0.1 0.2" mass="2"/>',
    "fromto": '<geom type="cylinder" size="0.05" fromto="0 0 0 0.1 0.2 0.3"/>'
    '<geom type="box" size="0.02" fromto="0 0.1 0 0 0 1"/>'
    '<geom type="ellipsoid" size="0.03" fromto="0 0.1 0 0.3 0 1"/><geom type="capsule" '
    'size="0.03" fromto="0 0 1 0 0 0"/>',
    "density": '<geom type="ellipsoid" size="0.1 0.2 0.3" density="123" quat="1 2 3 4"/>',
    "massless": (
        '<geom type="box" size="0.1 0.1 0.1" mass="0"/><geom type="sphere" size="0.2" '
        'density="10"/>'
    ),
}


@pytest.mark.parametrize("shape", GEOMS)
def test_geoms_weigh_what_mujoco_says(shape, tmp_path):
    text = BODY.format(head="", body="<joint/>" + GEOMS[shape], tail="")
    assert_same_bodies(read(text, tmp_path).mechanism, text)


@pytest.mark.parametrize(
    "compiler",
    [
        'inertiafromgeom="true"',
        'inertiafromgeom="false"',
        'inertiafromgeom="auto" boundmass="3" boundinertia="0.5"',
        'settotalmass="7" inertiafromgeom="true"',
        'inertiagrouprange="1 2" inertiafromgeom="true"',
        'balanceinertia="true"',
        'balanceinertia="true" boundinertia="0.03"',
        'balanceinertia="true" boundinertia="0.015"',
    ],
)
def test_the_compilers_settings_for_mass(compiler, tmp_path):
    unbalanced = '<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.05" euler="3 4 5"/>'
    inertial = unbalanced if "balance" in compiler else INERTIAL
    geoms = (
        '<geom type="sphere" size="0.1" group="2"/><geom type="box" size="0.1 0.2 0.1" group="4" '
        'mass="1"/>'
    )
    text = BODY.format(head=f"<compiler {compiler}/>", body=f"<joint/>{inertial}{geoms}", tail="")
    assert_same_bodies(read(text, tmp_path).mechanism, text)


@pytest.mark.parametrize("order", ["xyz", "ZYX", "zxz", "xYz", "Yxz"])
@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_euler_angles_of_all_orders(order, angle, tmp_path):
    head = f'<compiler eulerseq="{order}" angle="{angle}"/>'
    text = BODY.format(head=head, body='<joint axis="1 2 3" ref="0.3"/>' + INERTIAL, tail="")
    assert_same_motion(read(text, tmp_path).mechanism, text.replace("<joint ", '<joint name="b" '))


def test_several_joints_with_names_are_a_chain_that_keeps_them(tmp_path):
    joints = (
        '<joint name="x" axis="1 0 0" ref="5"/><joint name="y" axis="0 1 0" pos="0 0 0.1"/><joint '
        'name="z" type="slide"/>'
    )
    text = BODY.format(head="", body=joints + INERTIAL, tail="")
    mechanism = read(text, tmp_path).mechanism
    assert list(mechanism.joints) == ["x", "y", "z"]
    assert [name for name, body in mechanism.bodies.items() if body.mass == 0] == ["b_x", "b_y"]
    assert_same_motion(mechanism, text)


SEVERAL = {
    UniversalJoint: (
        '<joint name="{0}.angle_1" axis="1 1 0" pos="0.1 0.1 0.2" ref="12"/>'
        '<joint name="{0}.angle_2" axis="-1 1 0" pos="0.05 0.15 0.2" ref="-7"/>'
    ),
    CylindricalJoint: (
        '<joint name="{0}.slide" type="slide" axis="0 2 1" ref="0.1"/>'
        '<joint name="{0}.angle" axis="0 2 1" pos="1 0 0" ref="9"/>'
    ),
    PlanarJoint: (
        '<joint name="{0}.x" type="slide" axis="0 1 0" ref="0.2"/><joint name="{0}.y" '
        'type="slide" axis="0 0 1" ref="-0.1"/>'
        '<joint name="{0}.angle" axis="1 0 0" pos="0.3 0.2 0.1" ref="30"/>'
    ),
}


@pytest.mark.parametrize("kind", SEVERAL)
def test_several_joints_are_one_where_no_name_is_lost(kind, tmp_path):
    text = BODY.format(head="", body=SEVERAL[kind].format("j") + INERTIAL, tail="")
    mechanism = read(text, tmp_path).mechanism
    assert [type(joint) for joint in mechanism.joints.values()] == [kind]
    assert_same_motion(mechanism, text)
    nameless = BODY.format(head="", body=without_names(SEVERAL[kind]) + INERTIAL, tail="")
    assert [type(joint) for joint in read(nameless, tmp_path).mechanism.joints.values()] == [kind]


def without_names(text):
    return re.sub(r' name="[^"]*"', "", text)


def test_two_hinges_with_names_of_their_own_stay_two(tmp_path):
    text = BODY.format(
        head="",
        body='<joint name="a" axis="1 0 0"/><joint name="b2" axis="0 1 0"/>' + INERTIAL,
        tail="",
    )
    assert [type(joint) for joint in read(text, tmp_path).mechanism.joints.values()] == [
        RevoluteJoint
    ] * 2


@pytest.mark.parametrize("lead", [0.02, -0.3])
def test_a_slide_that_follows_a_hinge_on_its_axis_is_a_screw(lead, tmp_path):
    slide = '<joint name="s.advance" type="slide" axis="0 1 1" ref="0.1"/>'
    joints = f'{slide}<joint name="s" axis="0 1 1" pos="0.1 0 0" ref="25"/>'
    equality = f'<equality><joint joint1="s.advance" joint2="s" polycoef="0.05 {lead}"/></equality>'
    text = BODY.format(head="", body=joints + INERTIAL, tail=equality)
    mechanism = read(text, tmp_path).mechanism
    (screw,) = mechanism.joints.values()
    assert (screw.type, screw.pitch) == ("screw", lead)
    robot, (model, data) = lw.Robot(mechanism), compiled(text)
    for turn in (np.deg2rad(25), 1.3):
        p, R = robot.body_poses(robot.state({"s": turn}))["b"]
        data.qpos[:] = 0.1 + 0.05 + lead * (turn - np.deg2rad(25)), turn
        mj.mj_kinematics(model, data)
        np.testing.assert_allclose(p, data.body("b").xpos, atol=1e-12)
        np.testing.assert_allclose(R, data.body("b").xmat.reshape(3, 3), atol=1e-12)


def test_a_free_joint_made_of_slides_and_a_ball(tmp_path):
    slides = "".join(
        f'<joint name="f.{n}" type="slide" axis="{a}" ref="0.{k}"/>'
        for k, (n, a) in enumerate(TURNED_AXES, 1)
    )
    text = BODY.format(
        head="", body=f'{slides}<joint name="f.turn" type="ball" pos="0.1 0 0"/>{INERTIAL}', tail=""
    )
    mechanism = read(text, tmp_path).mechanism
    (joint,) = mechanism.joints.values()
    assert isinstance(joint, FreeJoint)
    robot, (model, data) = lw.Robot(mechanism), compiled(text)
    data.qpos[:] = (
        0.3,
        -0.2,
        0.5,
        *np.array([0.8, 0.2, -0.4, 0.4]) / np.linalg.norm([0.8, 0.2, -0.4, 0.4]),
    )
    mj.mj_kinematics(model, data)
    E = np.array([axis.split() for _, axis in TURNED_AXES], float)
    E /= np.linalg.norm(E, axis=1)[:, None]
    quaternion = [data.qpos[3], *(E @ data.qpos[4:])]
    key = f'<keyframe><key name="home" qpos="{" ".join(map(str, data.qpos))}"/></keyframe>'
    at_key = lw.Robot(read(text.replace("</mujoco>", f"{key}</mujoco>"), tmp_path).mechanism)
    for one, state in ((robot, robot.state([*data.qpos[:3], *quaternion])), (at_key, at_key.home)):
        np.testing.assert_allclose(one.body_poses(state)["b"][0], data.body("b").xpos, atol=1e-12)
        np.testing.assert_allclose(
            one.body_poses(state)["b"][1], data.body("b").xmat.reshape(3, 3), atol=1e-12
        )


TURNED_AXES = (("x", "0 1 1"), ("y", "1 0 0"), ("z", "0 1 -1"))


def test_the_keyframe_home_is_the_reference(tmp_path):
    keys = '<keyframe><key name="other" qpos="0 0"/><key name="home" qpos="0.3 -0.2"/></keyframe>'
    text = BODY.format(
        head="",
        body='<joint name="p" ref="40"/><joint name="q" axis="1 0 0"/>' + INERTIAL,
        tail=keys,
    )
    assert read(text, tmp_path).mechanism.reference == {"p": 0.3, "q": -0.2}


def test_included_files_are_read_from_the_models_own_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "leg.xml").write_text(
        f'<mujocoinclude><body name="leg"><joint name="j"/>{INERTIAL}</body></mujocoinclude>'
    )
    text = '<mujoco><worldbody><include file="parts/leg.xml"/></worldbody></mujoco>'
    assert list(read(text, tmp_path).mechanism.bodies) == ["leg"]


@pytest.mark.parametrize("beside_the_model", [True, False])
def test_an_included_file_includes_from_the_models_folder_or_else_from_its_own(
    beside_the_model, tmp_path
):
    parts = {"parts/leg.xml": '<include file="foot.xml"/>', "parts/foot.xml": '<body name="near"/>'}
    if beside_the_model:
        parts["foot.xml"] = '<body name="first"/>'
    (tmp_path / "parts").mkdir()
    for name, text in parts.items():
        (tmp_path / name).write_text(f"<mujocoinclude>{text}</mujocoinclude>")
    text = '<mujoco><worldbody><include file="parts/leg.xml"/></worldbody></mujoco>'
    names = [*read(text, tmp_path).mechanism.bodies]
    assert names == (["first"] if beside_the_model else ["near"])
    model = mj.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert names == [model.body(k).name for k in range(1, model.nbody)]


LEFT_OUT = {
    (
        "<contact><exclude body1='b' body2='world'/></contact>"
    ): "<contact> is left out: contacts are no part of a mechanism",
    "<sensor/>": "<sensor> is left out",
    (
        "<actuator><motor joint='j' ctrlrange='1 -1'/></actuator>"
    ): "<motor> says ctrlrange '1 -1': no limit, here as in MuJoCo, for the lower end is above",
    "<wings/>": "<wings> is left out: it is not known",
    "<option><flag actuation='disable'/></option>": "switches actuators off, which is left out",
    "<equality><flex/></equality>": (
        "<flex> is left out: only connect, weld, joint and tendon are joints"
    ),
    (
        "<equality><connect body1='b' anchor='0 0 0' active='false'/></equality>"
    ): "<connect> is left out: it is not active",
    (
        "<tendon><spatial name='t'><site site='s'/></spatial></tendon>"
    ): "<spatial 't'> is left out: it neither holds nor pulls",
    (
        "<tendon><fixed name='t' range='0 1'><joint joint='j' coef='1'/></fixed></tendon>"
    ): "<fixed 't'> has a range, whose ends are stops here",
    (
        "<actuator><motor name='m' site='s' refsite='s'/></actuator>"
    ): "<motor 'm'> is left out: it acts on nothing that moves",
    "<actuator><muscle joint='j'/></actuator>": "<muscle> is taken as a plain actuator",
}


@pytest.mark.parametrize("tail", LEFT_OUT)
def test_what_is_left_out_is_named_with_its_line(tail, tmp_path):
    text = BODY.format(
        head="\n", body='<joint name="j"/><site name="s"/>' + INERTIAL, tail="\n" + tail
    )
    (note,) = read(text, tmp_path).notes
    assert note.startswith("model.xml, line 3: ")
    assert LEFT_OUT[tail] in note


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            '<geom type="mesh" mesh="hull" name="hull"/>',
            "<geom 'hull'> is a mesh, whose mass is left out",
        ),
        (
            '<joint type="ball" damping="1 2 3"/>',
            "has a damping that is not linear; it is against the turn as a whole",
        ),
        ('<joint frictionloss="0.3"/>', "has dry friction, which is smoothed here"),
        ('<joint type="ball" frictionloss="0.3"/>', "it is against the turn as a whole"),
        (
            '<joint springyield="1 1"/>',
            "says springyield, which is left out: springs do not yield",
        ),
        ('<joint name="a.b"/>', "<joint 'a.b'> is called 'a_b' here"),
        ('<composite count="4"/>', "<composite> is left out: it makes bodies"),
        ('<joint type="free" stiffness="2"/>', "has a spring, so that its turn is counted from"),
    ],
)
def test_what_is_taken_otherwise_is_noted(body, words, tmp_path):
    note, *_ = read(BODY.format(head="", body=body, tail=""), tmp_path).notes
    assert words in note


def test_many_remarks_of_one_kind_are_one_sentence(tmp_path):
    geoms = "".join(f'<geom type="mesh" mesh="m" name="g{k}"/>' for k in range(9))
    mass, weight, shape = read(BODY.format(head="", body=geoms, tail=""), tmp_path).notes
    assert "has no mass here" in weight
    assert "line 1 and 8 more: <geom> ('g0', 'g1', 'g2', 'g3', ...) is a mesh" in mass
    assert (
        "line 1 and 8 more: <geom> ('g0', 'g1', 'g2', 'g3', ...) is a mesh that is not shown"
        in shape
    )


REFUSED = {
    "<joint type='hing'/>": "<joint>: type 'hing' is not one of hinge, slide, ball, free",
    "<joint axis='0 0 0'/>": (
        "<joint>: axis '0 0 0' has no length; give a direction such as '0 0 1'"
    ),
    "<joint axis='1 0'/>": "<joint>: axis holds 2 numbers; give 3",
    "<joint axis='1 0 up'/>": "<joint>: axis holds 'up', which is not a number",
    "<joint axis='1 0 inf'/>": "<joint>: axis holds inf, which is not a finite number",
    (
        "<joint name='j'/><joint name='j'/>"
    ): "<joint 'j'>: has the name of another joint; names are given once",
    "<joint damping='-1'/>": "<joint>: viscous: ",
    "<joint limited='true' range='2 1'/>": "the lower limit",
    "<joint class='none'/>": "<joint>: there is no default class 'none'",
    "<joint/><freejoint/>": (
        "a free joint is the only joint of a body that stands directly in the world"
    ),
    "<body name='b'/>": "<body 'b'>: has the name of another body; names are given once",
    "<geom type='box' size='1 1'/>": "<geom>: size holds 2 numbers; a box has 3",
    "<geom size='0'/>": "<geom>: size '0' is not positive",
    "<geom type='capsule' size='1' fromto='1 1 1 1 1 1'/>": "fromto gives one point twice",
    "<inertial pos='0 0 0' diaginertia='1 1 1'/>": "<inertial>: has no attribute 'mass'; add it",
    "<inertial mass='1' diaginertia='1 1 9'/>": "violate the triangle inequality",
    "<body quat='0 0 0 0'/>": "<body>: quat '0 0 0 0' has no length; give a direction",
    (
        "<body quat='1 0 0 0' euler='1 2 3'/>"
    ): "<body>: gives its orientation as quat and euler; keep one of them",
    "<body xyaxes='1 0 0 2 0 0'/>": "<body>: xyaxes gives two parallel axes; turn one of them",
    "<include file='other.xml'/>": "other.xml: cannot be read: no such file or directory",
    "<include file='../other.xml'/>": (
        "<include>: file '../other.xml' lies outside the model's folder and is not opened"
    ),
    "<include file='model.xml'/>": "<include>: file 'model.xml' is included twice; include it once",
}


@pytest.mark.parametrize("body", REFUSED)
def test_refusals_name_file_line_and_element(body, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(BODY.format(head="\n", body=body, tail=""), tmp_path)
    assert str(refusal.value).startswith(f"{tmp_path / 'model.xml'}: line 2: ")
    assert REFUSED[body] in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("head", "tail", "words"),
    [
        ('<compiler eulerseq="xyw"/>', "", "eulerseq 'xyw' is not three letters of x, y, z"),
        ('<compiler coordinate="global"/>', "", "coordinate must be 'local'"),
        ('<compiler angle="grad"/>', "", "angle 'grad' is not one of degree, radian"),
        ("<default><default/></default>", "", "<default>: has no attribute 'class'; add it"),
        ("", '<actuator><motor joint="k"/></actuator>', "there is no joint 'k' to drive"),
        (
            "",
            '<equality><connect body1="b" body2="c" anchor="0 0 0"/></equality>',
            "there is no body 'c'",
        ),
        (
            "",
            '<equality><connect body1="b" body2="b" anchor="0 0 0"/></equality>',
            "holds 'b' to itself",
        ),
        ("", '<equality><weld site1="s" site2="t"/></equality>', "there is no site 's'"),
        ("", '<equality><joint joint1="k"/></equality>', "there is no joint 'k'"),
        (
            "",
            '<keyframe><key name="home" qpos="1 2 3"/></keyframe>',
            "qpos holds 3 numbers; give 1",
        ),
        ("", "<worldbody><joint/></worldbody>", "stands in the world itself, which does not move"),
    ],
)
def test_refusals_outside_of_bodies(head, tail, words, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(BODY.format(head=head, body='<joint name="j"/>' + INERTIAL, tail=tail), tmp_path)
    assert words in str(refusal.value)
    assert str(refusal.value).count("model.xml: line 1: ") == 1


def test_a_keyframe_with_an_empty_quaternion_does_not_turn_the_body(tmp_path):
    """MuJoCo takes a quaternion without length as no turn."""
    path = tmp_path / "box.xml"
    path.write_text(
        "<mujoco><worldbody><body name='box'><freejoint/><geom size='0.1'/></body></worldbody>"
        "<keyframe><key name='home' qpos='1 2 3 0 0 0 0'/></keyframe></mujoco>"
    )
    robot = lw.Robot(load(path).mechanism)
    position, turn = robot.body_poses(robot.home)["box"]
    np.testing.assert_allclose(position, [1, 2, 3])
    np.testing.assert_allclose(turn, np.eye(3))


def test_a_keyframe_with_a_turn_of_rounding_is_read(tmp_path):
    """The parts of a quaternion stay together, where its qw is 1 to rounding, too."""
    path = tmp_path / "box.xml"
    path.write_text(
        "<mujoco><worldbody><body name='box'><freejoint/><geom size='0.1'/></body></worldbody>"
        "<keyframe><key name='home' qpos='1 2 3 1 0 0 -8e-15'/></keyframe></mujoco>"
    )
    robot = lw.Robot(load(path).mechanism)
    position, turn = robot.body_poses(robot.home)["box"]
    np.testing.assert_allclose(position, [1, 2, 3])
    np.testing.assert_allclose(turn, np.eye(3), atol=2e-14)
