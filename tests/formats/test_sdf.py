"""SDF: robots of the catalogue written in it move as they do, and each of its conventions against a
model made by hand."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load, save
from linkwork.mechanism import (
    GROUND,
    Inertia,
    Limits,
    MechanismError,
    RevoluteJoint,
    ScrewJoint,
    SphericalJoint,
    UniversalJoint,
)

from tests.formats import samples

KINDS = {"spherical": "ball"}
LINK = (
    "<link name='{0}'><pose>{1}</pose><inertial><pose>0.1 0 0.02 0 0 0.3</pose><mass>{2}</mass>"
    "<inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz><ixy>0.001</ixy></inertia></inertial>"
    "</link>"
)
SDF = "<sdf version='{version}'><model name='m'>{parts}</model></sdf>"
JOINT = (
    "<joint name='{name}' type='{kind}'><parent>{parent}</parent><child>{child}</child>"
    "{more}</joint>"
)


def read(text, folder, name="model.sdf", **how):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return load(path, **how)


def model(*parts, version="1.9"):
    return SDF.format(version=version, parts="".join(parts))


def joint(name, kind, parent, child, more="<axis><xyz>0 0 1</xyz></axis>"):
    return JOINT.format(name=name, kind=kind, parent=parent, child=child, more=more)


def posed(tag, p, R):
    angles = Rotation.from_matrix(R).as_euler("xyz")
    return f"<{tag}>{' '.join(repr(float(x)) for x in (*p, *angles))}</{tag}>"


def as_sdf(robot):
    """Return the text of an SDF model of a robot at home; its joints are at zero there."""
    mechanism, home = robot.mechanism, robot.home
    poses = {GROUND: (np.zeros(3), np.eye(3)), **robot.body_poses(home)}
    parts = []
    for name, body in mechanism.bodies.items():
        moments = body.inertia.tensor()
        inertia = "".join(
            f"<i{a}{b}>{float(moments[i, j])!r}</i{a}{b}>"
            for (i, a), (j, b) in itertools.combinations_with_replacement(enumerate("xyz"), 2)
        )
        centre = posed("pose", body.centre_of_mass, np.eye(3))
        inertial = f"{centre}<mass>{body.mass!r}</mass><inertia>{inertia}</inertia>"
        place = posed("pose", *poses[name])
        parts.append(f"<link name='{name}'>{place}<inertial>{inertial}</inertial></link>")
    for name, pair in mechanism.pairs.items():
        parts.append(_as_joint(name, pair, poses, name in mechanism.actuators))
    return model(*parts)


def _as_joint(name, pair, poses, driven):
    """The child is never the world; the other way round a joint has the opposite axis."""
    first, second = (1, 0) if pair.connects[1] == GROUND else (0, 1)
    frame, effort = pair.frames[second], f"<limit><effort>{int(driven)}</effort></limit>"
    turn = Rotation.from_rotvec(frame.rotation).as_matrix()
    more, axes = posed("pose", frame.position, turn), ()
    if pair.type == "universal":
        (_, one), (_, R) = poses[pair.connects[0]], poses[pair.connects[1]]
        own = one @ Rotation.from_rotvec(pair.frames[0].rotation).as_matrix()
        axes = (R @ turn).T @ own @ pair.axes[0], pair.axes[1]
    elif hasattr(pair, "axis"):
        axes = ((second - first) * np.array(pair.axis),)
    for tag, axis in zip(("axis", "axis2"), axes, strict=False):
        xyz = " ".join(repr(float(x)) for x in axis)
        more += f"<{tag}><xyz>{xyz}</xyz>{effort}</{tag}>"
    ends = ("world" if pair.connects[k] == GROUND else pair.connects[k] for k in (first, second))
    return joint(f"j:{name}", KINDS.get(pair.type, pair.type), *ends, more)


def accelerations(robot, state, forces):
    values = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
    return dict(zip(robot.rates, values, strict=True))


@pytest.mark.parametrize("name", ["agile_wrist", "bennett", "spatial_slider_crank", "tripteron"])
def test_a_robot_of_the_catalogue_written_in_sdf_moves_like_it(name, tmp_path):
    theirs = lw.Robot(getattr(lw.robots, name)())
    ours = lw.Robot(
        read(as_sdf(theirs), tmp_path).mechanism.model_copy(
            update={"gravity": theirs.mechanism.gravity}
        )
    )
    assert ours.mobility == theirs.mobility
    assert set(ours.actuators) == {f"j:{name}" for name in theirs.actuators}
    rates = dict(
        zip(theirs.independent, np.random.default_rng(1).normal(size=theirs.mobility), strict=True)
    )
    forces = dict(zip(theirs.actuators, range(1, 7), strict=False))
    state = theirs.home.with_rates(rates)
    every = dict(zip(theirs.rates, theirs.joint_rates(state), strict=True))
    same = {name: every[name.removeprefix("j:")] for name in ours.independent}
    a = accelerations(ours, ours.home.with_rates(same), [forces[n[2:]] for n in ours.actuators])
    b = accelerations(theirs, state, [forces[n] for n in theirs.actuators])
    alone = [n for n, pair in theirs.mechanism.pairs.items() if pair.rates(n) == (n,)]
    scale = max(abs(value) for value in b.values())
    for each in alone:
        assert a[f"j:{each}"] == pytest.approx(b[each], rel=1e-9, abs=1e-10 * scale)


def test_a_tree_with_frames_moves_as_pinocchio_says(tmp_path):
    """The links of the URDF stand where the frames and relative poses of the SDF put them."""
    inertial = (
        '<inertial><origin xyz="0.1 0 0.02" rpy="0 0 0.3"/><mass value="{}"/><inertia ixx="0.02" '
        'iyy="0.03" izz="0.04" ixy="0.001" ixz="0" iyz="0"/></inertial>'
    )
    hinge = (
        '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}" '
        'rpy="{}"/><axis xyz="{}"/><limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
    )
    urdf = (
        f'<robot name="r"><link name="w"/><link name="a">{inertial.format(1)}</link>'
        f'<link name="b">{inertial.format(2)}</link>'
        + hinge.format("j", "w", "a", "0.1 0.2 0.3", "0 0.4 0", "0 0 1")
        + hinge.format("k", "a", "b", "0.5 0 0", "0.7 0 0", "0.6 0.8 0")
        + "</robot>"
    )
    axis = Rotation.from_euler("x", 0.7).apply([0.6, 0.8, 0])
    text = model(
        LINK.format("a", "0.1 0.2 0.3 0 0.4 0", 1),
        "<frame name='tip' attached_to='a'><pose>0.5 0 0 0 0 0</pose></frame>",
        LINK.format("b", "0.7 0 0", 2)
        .replace(
            "<pose>0.7 0 0</pose>", "<pose relative_to='tip' degrees='true'>0 0 0 {!r} 0 0</pose>"
        )
        .format(float(np.degrees(0.7))),
        joint("j", "revolute", "world", "a"),
        joint(
            "k",
            "revolute",
            "tip",
            "b",
            "<axis><xyz expressed_in='a'>" + " ".join(map(repr, axis.tolist())) + "</xyz></axis>",
        ),
    )
    robot = lw.Robot(read(text, tmp_path).mechanism)
    assert robot.mechanism.tools["tip"].body == "a"
    q, v, u = np.random.default_rng(5).normal(size=(3, 2))
    theirs = pin.buildModelFromXML(urdf)
    a = pin.aba(theirs, theirs.createData(), q, v, u)
    ours = accelerations(robot, robot.state({"j": q[0], "k": q[1]}, {"j": v[0], "k": v[1]}), u)
    assert [ours["j"], ours["k"]] == pytest.approx(a, rel=1e-10)


def by_hand(*joints, bodies=("a",)):
    solid = lw.Body(
        mass=2.0,
        centre_of_mass=(0.1, 0.0, 0.02),
        inertia=Inertia(**_turned(0.3)),
    )
    return lw.Robot(lw.Mechanism(bodies=dict.fromkeys(bodies, solid), joints=dict(joints)))


def _turned(angle):
    R = Rotation.from_euler("z", angle).as_matrix()
    tensor = R @ np.array([[0.02, 0.001, 0], [0.001, 0.03, 0], [0, 0, 0.04]]) @ R.T
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    at = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return {name: float(tensor[i]) for name, i in zip(names, at, strict=True)}


BY_HAND = {
    "screw": (
        ("screw", "<screw_thread_pitch>0.02</screw_thread_pitch><axis><xyz>0 1 1</xyz></axis>"),
        ScrewJoint(connects=(GROUND, "a"), axis=(0, 1, 1), pitch=0.02 / (2 * np.pi)),
    ),
    "old screw": (
        ("screw", "<thread_pitch>-314.15926535897933</thread_pitch><axis><xyz>0 1 1</xyz></axis>"),
        ScrewJoint(connects=(GROUND, "a"), axis=(0, 1, 1), pitch=1 / (100 * np.pi)),
    ),
    "ball": (("ball", ""), SphericalJoint(connects=(GROUND, "a"))),
    "universal": (
        ("universal", "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"),
        UniversalJoint(connects=(GROUND, "a")),
    ),
    "spring": (
        (
            "revolute",
            "<axis><xyz>0 1 0</xyz><dynamics><damping>0.4</damping><spring_stiffness>3"
            "</spring_stiffness><spring_reference>0.2</spring_reference></dynamics></axis>",
        ),
        RevoluteJoint(
            connects=(GROUND, "a"),
            axis=(0, 1, 0),
            friction=lw.Friction(viscous=0.4),
            spring=lw.Spring(stiffness=3, rest=0.2),
        ),
    ),
}


@pytest.mark.parametrize("kind", BY_HAND)
def test_each_kind_of_joint_is_that_of_a_model_by_hand(kind, tmp_path):
    (name, more), described = BY_HAND[kind]
    text = model(LINK.format("a", "0 0 0 0 0 0", 2), joint("j", name, "world", "a", more))
    ours, theirs = lw.Robot(read(text, tmp_path).mechanism), by_hand(("j", described))
    rates = np.random.default_rng(2).normal(size=ours.mobility)
    a, b = (
        accelerations(
            robot,
            robot.home.with_rates(dict(zip(ours.independent, rates, strict=True))),
            np.zeros(len(robot.actuators)),
        )
        for robot in (ours, theirs)
    )
    assert a == pytest.approx(b, rel=1e-10)


def test_axes_that_are_not_square_to_each_other_are_two_hinges(tmp_path):
    more = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>1 1 0</xyz></axis2>"
    text = model(LINK.format("a", "0 0 0 0 0 0", 2), joint("j", "revolute2", "world", "a", more))
    ours = lw.Robot(read(text, tmp_path).mechanism)
    p = ours.body_poses(ours.state({"j": 0.4, "j_2": 0.7}))["a"][1]
    turns = (
        Rotation.from_rotvec([0.4, 0, 0]),
        Rotation.from_rotvec(0.7 * np.array([1, 1, 0]) / 2**0.5),
    )
    np.testing.assert_allclose(p, (turns[0] * turns[1]).as_matrix(), atol=1e-14)


@pytest.mark.parametrize(
    ("version", "more", "axis"),
    [
        ("1.4", "", (0, 0, 1)),  # axes were in the model's frame
        ("1.6", "", (0, -1, 0)),  # and are in the joint's from 1.5 on
        ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", (0, 0, 1)),
        ("1.9", "", (0, -1, 0)),
    ],
)
def test_axes_are_in_the_frame_that_the_version_says(version, more, axis, tmp_path):
    text = model(
        LINK.format("a", f"0 0 0 {np.pi / 2} 0 0", 1),
        joint("j", "revolute", "world", "a", f"<axis><xyz>0 0 1</xyz>{more}</axis>"),
        version=version,
    )
    robot = lw.Robot(read(text, tmp_path).mechanism)
    turned = robot.body_poses(robot.state({"j": 0.3}))["a"][1]
    start = Rotation.from_euler("x", np.pi / 2)
    expected = Rotation.from_rotvec(0.3 * np.array(axis)) * start
    np.testing.assert_allclose(turned, expected.as_matrix(), atol=1e-14)


def test_gearboxes_and_mimics_are_gears(tmp_path):
    """theta_2 = -ratio theta_1, both from the reference body; k = 2 (j - 0.1) + 0.5."""
    links = "".join(LINK.format(name, f"{k} 0 0 0 0 0", 1) for k, name in enumerate("abc"))
    mimic = (
        "<axis><xyz>0 0 1</xyz><mimic joint='j'><multiplier>2</multiplier><offset>0.5</offset>"
        "<reference>0.1</reference></mimic></axis>"
    )
    hinges = joint("j", "revolute", "c", "a"), joint("k", "revolute", "b", "c")
    gear = joint(
        "g",
        "gearbox",
        "a",
        "b",
        "<gearbox_ratio>3</gearbox_ratio><gearbox_reference_body>c</gearbox_reference_body>"
        "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>",
    )
    fixed = joint("f", "fixed", "world", "c", "")
    robot = lw.Robot(read(model(links, *hinges, gear, fixed), tmp_path).mechanism)
    assert robot.mobility == 1
    # k turns c relative to b: the turn of b relative to c is -k.
    assert robot.assemble({"j": 0.2})["k"] == pytest.approx(3 * 0.2)
    following = hinges[0] + joint("k", "revolute", "c", "b", mimic)
    robot = lw.Robot(read(model(links, following, fixed), tmp_path).mechanism)
    assert robot.actuators == ("j",)
    assert robot.assemble({"j": 0.2})["k"] == pytest.approx(2 * (0.2 - 0.1) + 0.5)


def test_what_nothing_holds_floats_and_what_is_static_stands(tmp_path):
    arm = LINK.format("a", "0 0 1 0 0 0", 1) + LINK.format("b", "1 0 1 0 0 0", 1)
    free = read(model(arm, joint("j", "revolute", "a", "b")), tmp_path)
    assert free.mechanism.joints["floating_base"].connects == (GROUND, "a")
    robot = lw.Robot(free.mechanism)
    assert robot.mobility == 7
    np.testing.assert_allclose(robot.body_poses(robot.home)["b"][0], [1, 0, 1], atol=1e-15)
    stands = "<static>true</static>" + arm
    world = (
        "<sdf version='1.9'><world name='w'><gravity>0 0 -1.6</gravity><model name='one'>"
        f"{LINK.format('a', '0 0 0 0 0 0', 1)}</model><model name='two'>"
        f"<pose>0 0 3 0 0 0</pose>{stands}</model></world></sdf>"
    )
    imported = read(world, tmp_path)
    assert list(imported.mechanism.bodies) == ["one::a"]
    assert imported.mechanism.gravity == (0, 0, -1.6)
    assert any("<model 'two'> stands still: it is static" in note for note in imported.notes)


def test_static_models_need_no_link(tmp_path):
    inner = "<model name='rails'><model name='rail'><static>1</static></model></model>"
    imported = read(model(inner, LINK.format("a", "0 0 0 0 0 0", 1)), tmp_path)
    assert imported.mechanism.bodies.keys() == {"a"}
    with pytest.raises(MechanismError, match="<model 'rail'>: holds no link"):
        read(model("<model name='rail'/>", LINK.format("a", "0 0 0 0 0 0", 1)), tmp_path)


def test_models_inside_models_and_included_ones(tmp_path):
    """The gripper stands by its palm's frame at the arm's tip, wherever its file puts the palm."""
    (tmp_path / "shelf/gripper").mkdir(parents=True)
    palm = LINK.format("palm", "0 0 5 0 0 0", 1) + LINK.format("jaw", "0 0 6 0 0 0", 1)
    grip = joint("close", "prismatic", "palm", "jaw")
    (tmp_path / "shelf/gripper/hand.sdf").write_text(model(palm, grip))
    (tmp_path / "shelf/gripper/model.config").write_text(
        "<model><name>g</name><sdf version='1.9'>hand.sdf</sdf></model>"
    )
    text = model(
        LINK.format("arm", "0 0 1 0 0 0", 1),
        "<frame name='tip' attached_to='arm'><pose>0 0 0.5 0 0 0</pose></frame>",
        "<include{}><uri>model://gripper</uri><name>grip</name><placement_frame>palm"
        "</placement_frame><pose relative_to='tip'>0.1 0 0 0 0 0</pose></include>",
        joint("s", "revolute", "world", "arm"),
        joint("mount", "fixed", "arm", "{}palm", ""),
    )
    for merge, path in (("", "grip::"), (" merge='true'", "")):
        mechanism = read(
            text.format(merge, path), tmp_path, packages=[tmp_path / "shelf"]
        ).mechanism
        robot = lw.Robot(mechanism)
        assert robot.mobility == 2 and f"{path}close" in robot.joints
        np.testing.assert_allclose(
            robot.body_poses(robot.home)[f"{path}jaw"][0], [0.1, 0, 2.5], atol=1e-14
        )
    with pytest.raises(MechanismError, match="there is no package 'gripper' around the file"):
        read(text.format("", "grip::"), tmp_path)


def test_an_include_that_is_not_there_is_told_where_nothing_needs_it(tmp_path):
    arm = LINK.format("arm", "0 0 1 0 0 0", 1) + joint("s", "revolute", "world", "arm")
    sun = "<include><uri>model://sun</uri></include>"
    text = f"<sdf version='1.6'><world name='w'>{sun}<model name='m'>{{}}</model></world></sdf>"
    with pytest.warns(ModelWarning, match="<include> is left out: 'model://sun' is not there"):
        assert set(read(text.format(arm), tmp_path).mechanism.bodies) == {"m::arm"}
    with pytest.raises(MechanismError, match="there is no package 'sun' around the file"):
        read(text.format(""), tmp_path)


def test_a_loop_whose_actuator_is_locked_leaves_a_spin(tmp_path):
    """The mimic locks the four-bar; the coupler still turns about its own axis, between ball and
    universal joint, and no rounding takes the actuator for what moves."""
    robot = lw.Robot(read(samples.SDF, tmp_path).mechanism)
    assert robot.mobility == 1 and robot.actuators == ("a", "b.angle_1", "b.angle_2")
    assert robot.independent == ("b.angle_2",)


def test_masses_by_density_and_those_that_are_not_given(tmp_path):
    box = (
        "<collision name='c'><density>200</density><geometry><box><size>1 2 3</size></box>"
        "</geometry></collision>"
    )
    link = f"<link name='a'><inertial auto='true'/>{box}</link><link name='b'/>"
    imported = read(model(link, joint("j", "revolute", "a", "b")), tmp_path)
    a, b = imported.mechanism.bodies["a"], imported.mechanism.bodies["b"]
    assert a.mass == pytest.approx(1200)
    assert a.inertia.xx == pytest.approx(1200 / 12 * 13) and b.inertia.xx == b.mass == 1
    assert any("<link 'b'> says nothing of its mass" in note for note in imported.notes)


@pytest.mark.parametrize("wrong", ["0.1 inch", "${r}"])
def test_a_visual_whose_numbers_are_wrong_is_not_shown_and_refuses_nothing(wrong, tmp_path):
    """libsdformat, by which Gazebo and Drake read, takes the number in front of other letters."""
    visual = "<visual name='v'><geometry><sphere><radius>{}</radius></sphere></geometry></visual>"
    link = LINK.format("a", "0 0 0 0 0 0", 1)
    texts = [
        model(
            link.replace("</link>", f"{visual.format(size)}</link>"),
            joint("j", "revolute", "world", "a"),
        )
        for size in ("0.1", wrong)
    ]
    right, found = (read(text, tmp_path) for text in texts)
    assert found.mechanism.bodies["a"].shapes == () != right.mechanism.bodies["a"].shapes
    assert not found.mechanism.caveats
    assert [note for note in found.notes if "<visual 'v'> is not shown: " in note]


def test_limits_efforts_and_shapes(tmp_path):
    limit = "<axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>2</upper>{}</limit></axis>"
    visual = (
        "<visual name='v'><pose>0 0 0.5 0 0 0</pose><geometry><cylinder><radius>0.1</radius>"
        "<length>1</length></cylinder></geometry></visual><visual name='w'><geometry><ellipsoid>"
        "<radii>1 2 3</radii></ellipsoid></geometry></visual></link>"
    )
    links = LINK.format("a", "0 0 0 0 0 0", 1).replace("</link>", visual)
    text = model(
        links,
        LINK.format("b", "1 0 0 0 0 0", 1),
        joint(
            "j", "revolute", "world", "a", limit.format("<effort>5</effort><velocity>2</velocity>")
        ),
        joint("k", "revolute", "a", "b", limit.format("<effort>0</effort>")).replace(
            "</joint>",
            "<drake:rotor_inertia>0.002</drake:rotor_inertia>"
            "<drake:gear_ratio>10</drake:gear_ratio></joint>",
        ),
    )
    imported = read(text, tmp_path)
    mechanism = imported.mechanism
    assert not [note for note in imported.notes if "velocity" in note]
    assert mechanism.joints["k"].rotor_inertia == pytest.approx(0.2)
    assert mechanism.joints["j"].rotor_inertia == 0
    assert mechanism.actuators == ("j",)
    assert mechanism.drives == {"j": {"type": "saturated", "limit": 5}}
    assert mechanism.joints["j"].limits == Limits(upper=2, speed=2)
    assert mechanism.joints["k"].limits == Limits(upper=2)
    shape, other = mechanism.bodies["a"].shapes
    assert other.radii == (1, 2, 3)
    assert shape.length == 1 and shape.frame.position == (0, 0, 0.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("<link name='b'><kinematic>1</kinematic></link>", "<link 'b'> is moved from outside"),
        ("<drake:linear_bushing_rpy/>", "<drake:linear_bushing_rpy> is left out"),
    ],
)
def test_what_changes_the_motion_is_warned_of(change, words, tmp_path):
    with pytest.warns(ModelWarning, match=words):
        read(model(LINK.format("a", "0 0 0 0 0 0", 1), change), tmp_path)


def test_elements_without_text_and_infinite_ends_say_nothing(tmp_path):
    """As sdformat takes them, and programs write them."""
    more = "<axis><xyz>0 0 1</xyz><dynamics><damping/></dynamics><limit><effort/>{}</limit></axis>"
    ends = "<lower>-inf</lower><upper>2</upper><velocity>inf</velocity>"
    more = more.format(ends)
    link = LINK.format("a", "0 0 0 0 0 0", 1).replace("</link>", "<gravity/><pose/></link>")
    link = link.replace("<pose>0 0 0 0 0 0</pose>", "")
    mechanism = read(model(link, joint("j", "revolute", "world", "a", more)), tmp_path).mechanism
    assert mechanism.joints["j"].friction.viscous == 0
    assert mechanism.joints["j"].limits == Limits(upper=2)
    assert not mechanism.lifts and not mechanism.drives and mechanism.actuators == ("j",)


def test_an_initial_position_is_noted_where_it_says_one(tmp_path):
    said = "<axis><xyz>0 0 1</xyz><initial_position>{}</initial_position></axis>"
    for value, noted in (("0.7", True), ("0.0", False)):
        one = model('<link name="a"/>', joint("j", "revolute", "world", "a", said.format(value)))
        notes = read(one, tmp_path).notes
        assert any("joints begin where the poses" in note for note in notes) == noted


def test_links_without_gravity_have_no_weight(tmp_path):
    """A double pendulum whose second link does not pull at the first, beside one without gravity
    at all; properties of contacts change nothing."""
    links = LINK.format("a", "0 0 0 0 0 0", 1) + LINK.format("b", "1 0 0 0 0 0", 2)
    y = "<axis><xyz>0 1 0</xyz></axis>"
    joints = joint("j", "revolute", "world", "a", y) + joint("k", "revolute", "a", "b", y)
    off, contact = "<gravity>false</gravity></link>", "<contact/><gravity>0</gravity></link>"
    texts = links.replace("</link>", off), links.replace("</link>", contact)
    imported = [read(model(text, joints), tmp_path) for text in texts]
    assert not any(each.mechanism.caveats for each in imported)
    lifts = imported[0].mechanism.lifts
    assert {name: lift.mass for name, lift in lifts.items()} == {"a": 1, "b": 2}
    assert lifts == imported[1].mechanism.lifts
    robot = lw.Robot(imported[0].mechanism)
    assert robot.forward_dynamics(robot.home, [0.0, 0.0]) == pytest.approx([0, 0], abs=1e-12)
    for suffix in ("sdf", "urdf"):
        save(imported[0].mechanism, tmp_path / f"again.{suffix}")
        again = load(tmp_path / f"again.{suffix}").mechanism.lifts
        assert {name: lift.mass for name, lift in again.items()} == {"a": 1, "b": 2}
    light = lifts["b"].model_copy(update={"mass": 1.5})
    other = imported[0].mechanism.model_copy(update={"lifts": {"b": light}})
    with pytest.raises(MechanismError, match="SDF has no place for lifts, as for 'b'"):
        save(other, tmp_path / "again.sdf")


A, B = LINK.format("a", "0 0 0 0 0 0", 1), LINK.format("b", "1 0 0 0 0 0", 1)
REFUSED = {
    "no type": (model(A, "<joint name='j'/>"), "<joint 'j'>: type '' is not one of revolute"),
    "no child": (model(A, "<joint name='j' type='ball'/>"), "holds no <parent>; name a link"),
    "no such": (model(A, joint("j", "ball", "a", "c")), "there is no 'c'; the names here are a, j"),
    "itself": (model(A, joint("j", "ball", "a", "a")), "<joint 'j'>: connects 'a' to itself"),
    "twice": (model(A, A), "<link 'a'>: has the name of another part of its model"),
    "circle": (
        model(
            A,
            "<frame name='f'><pose relative_to='g'/></frame>"
            "<frame name='g'><pose relative_to='f'/></frame>",
            joint("j", "ball", "world", "f"),
        ),
        "is given by way of itself",
    ),
    "attached": (
        model(A, "<frame name='f' attached_to='f'/>", joint("j", "ball", "f", "a")),
        "<frame 'f'>: is attached to itself",
    ),
    "pose": (
        model("<link name='a'><pose>1 2</pose></link>"),
        "<pose>: pose holds 2 numbers; give 6",
    ),
    "number": (
        model("<link name='a'><inertial><mass>x</mass></inertial></link>"),
        "mass holds 'x'",
    ),
    "axis": (
        model(A, joint("j", "revolute", "world", "a", "<axis><xyz>0 0 0</xyz></axis>")),
        "<axis>: xyz has no length",
    ),
    "flag": (model(A, "<static>perhaps</static>"), "<static>: holds 'perhaps'; give true or false"),
    "mimic": (
        model(A, joint("j", "revolute", "world", "a", "<axis><mimic joint='k'/></axis>")),
        "<mimic>: there is no axis of a joint 'k' to mimic",
    ),
    "gear": (
        model(
            A,
            B,
            joint("j", "gearbox", "a", "b", "<gearbox_reference_body>a</gearbox_reference_body>"),
        ),
        "no hinge about its axis leads from 'a' to 'a'; add one",
    ),
    "uri": (model(A, "<include/>"), "<include>: holds no <uri>; add one"),
    "empty": (model(""), "<model 'm'>: holds no link"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_name_file_line_and_element(case, tmp_path):
    text, words = REFUSED[case]
    with pytest.raises(MechanismError) as refusal:
        read(text, tmp_path)
    assert str(refusal.value).startswith(f"{tmp_path / 'model.sdf'}: line ")
    assert words in str(refusal.value)


def test_joints_with_names_of_links_and_links_called_world_as_in_old_files(tmp_path):
    parts = "<link name='world'/><link name='arm'/>"
    text = model(parts, joint("arm", "revolute", "world", "arm"), version="1.5")
    imported = read(text, tmp_path)
    mechanism = imported.mechanism
    assert set(mechanism.bodies) == {"world", "arm"}
    assert mechanism.joints["arm_joint"].connects == ("world", "arm")
    assert mechanism.joints["floating_base"].connects == ("ground", "world")
    assert any("has the name of a link or a frame" in each for each in imported.notes)
    twice = model(parts, "<link name='arm'/>")
    with pytest.raises(MechanismError, match="has the name of another part"):
        read(twice, tmp_path)


def test_a_joint_called_world_is_not_the_world(tmp_path):
    imported = read(
        model(LINK.format("a", "0 0 1 0 0 0", 1), joint("world", "revolute", "world", "a")),
        tmp_path,
    )
    assert imported.mechanism.joints["world_joint"].connects == (GROUND, "a")
    assert any("or of the world, and _joint behind it here" in note for note in imported.notes)


def test_a_limit_of_speed_that_is_no_number_bounds_nothing(tmp_path):
    axis = "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><velocity>2.5'</velocity></limit></axis>"
    link = LINK.format("a", "0 0 0 0 0 0", 2.0)
    imported = read(model(link, joint("j", "revolute", "world", "a", axis)), tmp_path)
    limits = imported.mechanism.joints["j"].limits
    assert limits.lower == -1 and limits.speed is None and not imported.mechanism.caveats
    assert any("bounds no speed" in note and "not a number" in note for note in imported.notes)


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_a_link_called_ground_moves_unless_a_joint_holds_it(kind, tmp_path):
    tie = joint("tie", kind, "world", "ground", "<axis><xyz>0 1 0</xyz></axis>")
    hinge = joint("j", "revolute", "ground", "a")
    links = LINK.format("ground", "0 0 1 0 0 0", 1) + LINK.format("a", "0 1 1 0 0 0", 1)
    imported = read(model(links, tie, hinge), tmp_path)
    assert set(imported.mechanism.bodies) == {"ground_2", "a"}
    assert imported.mechanism.joints["tie"].connects == ("ground", "ground_2")
    assert set(imported.mechanism.joints) == {"tie", "j"}
