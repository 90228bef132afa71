"""Drake's own elements in URDF and SDF: joints, what ties two bodies, mimics; the rest is told."""

from math import pi

import numpy as np
import pytest

from linkwork.formats import load
from linkwork.formats.models import read
from linkwork.mechanism import MechanismError

MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
LINKS = "".join(f'<link name="{name}">{MASS}</link>' for name in "abc")
ENDS = '<parent link="{}"/><child link="{}"/>'
PIN = '<joint name="pin" type="continuous"><parent link="world"/><child link="a"/></joint>'


def urdf(folder, second, third='<joint name="third" type="fixed">', more=""):
    path = folder / "robot.urdf"
    path.write_text(
        f'<robot xmlns:drake="https://drake.mit.edu" name="r">{LINKS}{PIN}'
        f"{second}{ENDS.format('a', 'b')}</drake:joint>"
        f"{third}{ENDS.format('b', 'c')}</joint>{more}</robot>"
    )
    return path


@pytest.mark.parametrize(
    ("kind", "inside", "type_", "freedoms"),
    [
        ("ball", "", "spherical", ("turn",)),
        ("universal", "", "universal", ("angle_1", "angle_2")),
        ("planar", '<axis xyz="0 0 1"/>', "planar", ("x", "y", "angle")),
    ],
)
def test_joints_of_several_freedoms_are_damped_in_each(kind, inside, type_, freedoms, tmp_path):
    second = f'<drake:joint name="second" type="{kind}">{inside}<dynamics damping="0.2"/>'
    mechanism = read(urdf(tmp_path, second)).mechanism
    joint = mechanism.joints["second"]
    assert joint.type == type_ and not mechanism.caveats
    assert {name: own.viscous for name, own in joint.friction.items()} == dict.fromkeys(
        freedoms, 0.2
    )
    assert joint.frames[0] == joint.frames[1]


@pytest.mark.parametrize("axis", ["", '<axis xyz="1 0 0"/>', '<axis xyz="1 2 -1"/>'])
@pytest.mark.parametrize("tag", ["joint", "drake:joint"])
def test_planes_lie_across_the_axis_and_turn_as_little_as_they_can(axis, tag, tmp_path):
    """As those of Drake's PlanarJoint from URDF, in either spelling."""
    second = f'<{tag} name="second" type="planar">{axis}<dynamics damping="1 2 3"/>'
    text = urdf(tmp_path, second).read_text().replace("</drake:joint>", f"</{tag}>")
    path = tmp_path / "model.urdf"
    path.write_text(text)
    joint = read(path).mechanism.joints["second"]
    normal = np.array([1.0, 2, -1] if "2" in axis else [1.0, 0, 0])
    normal /= np.linalg.norm(normal)
    across = np.cross([0, 0, 1], normal)
    turn = across / np.linalg.norm(across) * np.arccos(normal[2])
    for frame in joint.frames:
        np.testing.assert_allclose(frame.orientation, turn, atol=1e-12)
    assert [joint.friction[name].viscous for name in ("x", "y", "angle")] == [1, 2, 3]


def test_screws_advance_per_turn_and_world_is_ground(tmp_path):
    second = (
        '<drake:joint name="second" type="screw"><axis xyz="0 1 0"/><dynamics damping="3"/>'
        '<drake:screw_thread_pitch value="0.04"/>'
    )
    mechanism = read(urdf(tmp_path, second)).mechanism
    joint = mechanism.joints["second"]
    assert mechanism.joints["pin"].connects == ("ground", "a")
    assert joint.pitch == pytest.approx(0.04 / (2 * pi)) and joint.axis == (0, 1, 0)
    assert joint.friction.viscous == 3 and "second" in mechanism.actuators


def tied(tag, numbers):
    """An element between `a` and `c` in URDF and in SDF."""
    tag = f"drake:{tag}"
    bodies = {"body_A": "a", "body_B": "c"}
    points = {"p_AP": "0.1 0 0", "p_BQ": "0 0.2 0"} | numbers
    theirs = [f'<{tag}_{key} name="{name}"/>' for key, name in bodies.items()]
    theirs += [f'<{tag}_{key} value="{value}"/>' for key, value in points.items()]
    ours = [f"<{tag}_{key}>{value}</{tag}_{key}>" for key, value in (bodies | points).items()]
    return (f"<{tag}>{''.join(parts)}</{tag}>" for parts in (theirs, ours))


def sdf(folder, more, joint=""):
    path = folder / "robot.sdf"
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    chain = zip(("world", "a", "b"), "abc", strict=True)
    joints = "".join(
        f'<joint name="j{child}" type="revolute"><parent>{parent}</parent><child>{child}</child>'
        f"<axis><xyz>0 0 1</xyz></axis>{joint if child == 'c' else ''}</joint>"
        for parent, child in chain
    )
    path.write_text(
        '<sdf version="1.9" xmlns:drake="https://drake.mit.edu"><model name="r">'
        f"{links}{joints}{more}</model></sdf>"
    )
    return path


@pytest.mark.parametrize(
    ("tag", "numbers", "type_"),
    [
        ("ball_constraint", {}, "spherical"),
        ("distance_constraint", {"distance": "0.3"}, "rod"),
        ("distance_constraint", {"distance": "0.3", "stiffness": "40", "damping": "2"}, None),
        ("linear_spring_damper", {"free_length": "0.3", "stiffness": "40", "damping": "2"}, None),
    ],
)
def test_points_are_tied_in_urdf_and_in_sdf_alike(tag, numbers, type_, tmp_path):
    theirs, ours = tied(tag, numbers)
    second = '<drake:joint name="second" type="ball">'
    turning = '<joint name="third" type="continuous">'
    for path in (urdf(tmp_path, second, turning, theirs), sdf(tmp_path, ours)):
        mechanism = read(path).mechanism
        if type_ is None:
            spring = mechanism.springs[tag]
            assert (spring.stiffness, spring.rest_length, spring.damping) == (40, 0.3, 2)
            held, points = spring.connects, spring.points
        else:
            joint = mechanism.joints[tag]
            assert joint.type == type_ and getattr(joint, "length", 0.3) == 0.3
            held, points = joint.connects, tuple(frame.position for frame in joint.frames)
        assert held == ("a", "c") and points == ((0.1, 0, 0), (0, 0.2, 0))


def test_planar_joints_and_mimics_of_sdf(tmp_path):
    planar = (
        '<link name="d"/><frame name="on_a" attached_to="a"><pose>0 0 1 0 0 0</pose></frame>'
        '<drake:joint name="plane" type="planar"><drake:parent>on_a</drake:parent>'
        "<drake:child>d</drake:child><drake:damping>1 2 0</drake:damping></drake:joint>"
    )
    mimic = '<drake:mimic joint="jb" multiplier="2" offset="0.5"/>'
    mechanism = read(sdf(tmp_path, planar, mimic)).mechanism
    plane, gear = mechanism.joints["plane"], mechanism.joints["jc_mimic"]
    assert plane.connects == ("a", "d") and plane.frames[0].position == (0, 0, 1)
    assert {name: own.viscous for name, own in plane.friction.items()} == {"x": 1, "y": 2}
    assert dict(gear.ratios) == {"jc": 1.0, "jb": -2.0} and gear.offset == 0.5
    assert "jc" not in mechanism.actuators


def test_a_ball_of_sdf_is_damped_by_its_first_axis_as_in_drake(tmp_path):
    ball = (
        '<link name="d"/><joint name="ball" type="ball"><parent>c</parent><child>d</child><axis>'
        "<xyz>0 0 1</xyz><dynamics><damping>0.1</damping>{}</dynamics></axis></joint>"
    )
    read_ball = read(sdf(tmp_path, ball.format(""))).mechanism
    assert read_ball.joints["ball"].friction["turn"].viscous == 0.1 and not read_ball.caveats
    for name in ("friction", "spring_stiffness"):
        more = read(sdf(tmp_path, ball.format(f"<{name}>2</{name}>"))).mechanism
        assert any(f"says {name}, which a ball has not here" in each for each in more.caveats)


def test_what_is_soft_or_bent_is_told_and_what_is_not_there_refused(tmp_path):
    bushing = "<drake:linear_bushing_rpy/>"
    ball = '<drake:joint name="second" type="ball">'
    for path in (urdf(tmp_path, ball, more=bushing), sdf(tmp_path, bushing)):
        assert any("a bushing, soft in all six" in each for each in read(path).mechanism.caveats)
    bent = '<drake:joint name="curve" type="curvilinear"/>'
    assert any("only planar ones" in each for each in read(sdf(tmp_path, bent)).mechanism.caveats)
    theirs, _ = tied("ball_constraint", {})
    path = urdf(tmp_path, ball, more=theirs.replace('name="c"', 'name="z"'))
    with pytest.raises(MechanismError, match="<drake:ball_constraint>: there is no link 'z'"):
        load(path)
    path = urdf(tmp_path, ball, more=theirs.replace('name="c"', 'name="a"'))
    with pytest.raises(MechanismError, match="connects 'a' to itself"):
        load(path)
