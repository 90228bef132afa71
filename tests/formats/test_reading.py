"""What is said beside a model file: a root that floats, where packages are, the reference."""

import json

import numpy as np
import pinocchio as pin
import pytest

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.formats import load
from linkwork.formats.reading import Reading
from linkwork.formats.xml import Element
from linkwork.mechanism import MechanismError

from tests.cli.calls import call, refused
from tests.formats import samples

ARM = """<mujoco model="arm"><worldbody><body name="base" pos="0.1 0 0.5" euler="0 0 30">
<inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.2 0.15"/>
<body name="link" pos="0 0 0.2"><joint name="j" axis="0 1 0"/>
<inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.02 0.03"/></body></body>{more}</worldbody>
</mujoco>"""
BLOCK = '<body name="block"><geom size="0.1"/></body>'


def written(folder, text, name="arm.urdf"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def joint_accelerations(robot, state, forces):
    values = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
    return dict(zip(robot.rates, values, strict=True))


def test_a_root_that_floats_moves_as_pinocchios_free_flyer(tmp_path):
    """Its twist is in the root's axes there, in the ground's here:  (R v)' = R (v' + w x v)."""
    robot = lw.Robot.from_file(written(tmp_path, samples.URDF), floating=True)
    theirs = pin.buildModelFromXML(samples.URDF, pin.JointModelFreeFlyer())
    data, rng = theirs.createData(), np.random.default_rng(3)
    assert robot.mobility == theirs.nv == 9 and "stand" in robot.bodies
    assert robot.actuators == ("shoulder", "elbow", "stroke")
    q = pin.randomConfiguration(theirs, -np.ones(theirs.nq), np.ones(theirs.nq))
    v, forces = rng.normal(size=9), rng.normal(size=3)
    index = {name: theirs.joints[theirs.getJointId(name)] for name in robot.actuators}
    tau = np.zeros(9)
    for name, force in zip(robot.actuators, forces, strict=True):
        tau[index[name].idx_v] = force
    R = pin.Quaternion(*np.roll(q[3:7], 1)).toRotationMatrix()
    base = ("x", "y", "z", "qw", "qx", "qy", "qz"), ("x", "y", "z", "wx", "wy", "wz")
    place = dict(zip(base[0], [*q[:3], *np.roll(q[3:7], 1)], strict=True))
    twist = dict(zip(base[1], [*(R @ v[:3]), *(R @ v[3:6])], strict=True))
    angles = {"elbow": np.arctan2(q[index["elbow"].idx_q + 1], q[index["elbow"].idx_q])}
    state = robot.state(
        {f"floating_base.{name}": value for name, value in place.items()}
        | {name: angles.get(name, q[joint.idx_q]) for name, joint in index.items()},
        {f"floating_base.{name}": value for name, value in twist.items()}
        | {name: v[joint.idx_v] for name, joint in index.items()},
    )
    ours, a = joint_accelerations(robot, state, forces), pin.aba(theirs, data, q, v, tau)
    linear, angular = R @ (a[:3] + np.cross(v[3:6], v[:3])), R @ a[3:6]
    expected = dict(zip(base[1], [*linear, *angular], strict=True))
    for name, value in expected.items():
        assert ours[f"floating_base.{name}"] == pytest.approx(value, rel=1e-9, abs=1e-10)
    for name, joint in index.items():
        assert ours[name] == pytest.approx(a[joint.idx_v], rel=1e-9)


def test_a_body_fixed_to_ground_floats_from_where_it_is_in_mjcf_and_the_native_format(tmp_path):
    text = ARM.format(more="")
    floats = text.replace('euler="0 0 30">', 'euler="0 0 30"><freejoint name="f"/>')
    other = lw.Robot(load(written(tmp_path, floats, "free.xml")).mechanism)
    load(written(tmp_path, text, "arm.xml")).mechanism.save(tmp_path / "arm.yaml")
    v = np.random.default_rng(0).normal(size=(3, 3))
    for suffix in ("xml", "yaml"):
        robot = lw.Robot.from_file(tmp_path / f"arm.{suffix}", floating=True)
        assert robot.mobility == 7 and robot.mechanism.joints["floating_base"].type == "free"
        p, R = robot.body_poses(robot.home)["base"]
        np.testing.assert_allclose(p, [0.1, 0, 0.5], atol=1e-15)
        # The joint's rates are in the axes in which the base was fixed, MuJoCo's in the ground's.
        moving = [
            robot.home.with_rates(_named("floating_base", v[0], v[1]) | {"j": v[2, 0]}),
            other.home.with_rates(_named("f", R @ v[0], R @ v[1]) | {"j": v[2, 0]}),
        ]
        ours, theirs = (
            joint_accelerations(each, state, np.zeros(0))["j"]
            for each, state in zip((robot, other), moving, strict=True)
        )
        assert ours == pytest.approx(theirs, rel=1e-10)


def _named(joint, linear, angular):
    """Return the rates of a free joint by name."""
    names = ("x", "y", "z", "wx", "wy", "wz")
    return {f"{joint}.{n}": x for n, x in zip(names, (*linear, *angular), strict=True)}


def test_what_cannot_float_is_refused_and_what_floats_is_noted(tmp_path):
    two = written(tmp_path, ARM.format(more=BLOCK), "two.xml")
    with pytest.raises(MechanismError, match=r"two\.xml: the bodies 'base', 'block' are fixed"):
        load(two, floating=True)
    with pytest.raises(MechanismError, match=r"two\.xml: no body is fixed to ground; a root"):
        load(
            written(
                tmp_path,
                ARM.format(more="").replace('<body name="link', '<joint/><body name="link'),
                "two.xml",
            ),
            floating=True,
        )
    ball = '<robot name="b"><link name="world"/><link name="ball"/><joint name="f" {}</robot>'
    carried = 'type="floating"><parent link="world"/><child link="ball"/></joint>'
    imported = load(written(tmp_path, ball.format(carried)), floating=True)
    assert list(imported.mechanism.joints) == ["f"]
    assert "arm.urdf: the root floats already" in imported.notes
    with pytest.raises(LinkworkError, match="floating is 1; give True or False"):
        load(two, floating=1)  # pyright: ignore[reportArgumentType]


def test_files_of_packages_are_found_and_nothing_else(tmp_path):
    """A package is a stated folder, lies in one, or is a folder around the model's file."""
    for folder in ("own/urdf", "shelf/other/meshes", "own/meshes", "away"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("own/meshes/a.stl", "shelf/other/meshes/b.stl", "own/urdf/c.stl", "away/d.stl"):
        (tmp_path / name).write_text("")
    element = Element("mesh", {}, tmp_path / "own/urdf/robot.urdf", 7)
    plain, stated = Reading(), Reading.asked(packages=str(tmp_path / "shelf"))
    assert plain.found("package://own/meshes/a.stl", element) == tmp_path / "own/meshes/a.stl"
    assert plain.found("c.stl", element) == tmp_path / "own/urdf/c.stl"
    for how in (stated, Reading.asked(packages=[tmp_path / "shelf/other"])):
        for uri in ("package://other/meshes/b.stl", "model://other/meshes/b.stl"):
            assert how.found(uri, element) == tmp_path / "shelf/other/meshes/b.stl"
    with pytest.raises(MechanismError, match="line 7: <mesh>: there is no package 'other' around"):
        plain.found("package://other/meshes/b.stl", element)
    for uri in ("package://own/../away/d.stl", "../../away/d.stl", "file:///etc/hostname", "x\0"):
        with pytest.raises(MechanismError, match="is not there, or lies outside"):
            stated.found(uri, element)
    with pytest.raises(LinkworkError, match="the package path holds 'nowhere', which is no folder"):
        load(written(tmp_path, samples.URDF), packages=["nowhere"])
    with pytest.raises(LinkworkError, match="a folder of the package path is 3; give the path"):
        load(written(tmp_path, samples.URDF), packages=3)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("how", ["text", "yaml", "json", "mechanism", "command"])
def test_a_reference_has_units_and_may_be_a_file(how, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, given = written(tmp_path, samples.URDF), {"shoulder": "40 deg", "stroke": "12mm"}
    reference = given
    if how == "yaml":
        reference = written(tmp_path, "shoulder: 40 deg\nstroke: 12 mm\n", "pose.yaml")
    elif how == "json":
        reference = str(written(tmp_path, json.dumps(given), "pose.json"))
    elif how == "mechanism":
        text = "name: other\nreference: {shoulder: 40deg, stroke: 0.012}\n"
        reference = written(tmp_path, text, "pose.yml")
    if how == "command":
        asked = ("arm.urdf", "arm.yaml", "--reference", "shoulder=40deg,stroke=12mm")
        assert call("export", *asked).exit_code == 0
        mechanism = lw.Mechanism.load("arm.yaml")
    else:
        mechanism = lw.Robot.from_file(path, reference=reference).mechanism
    expected = {"shoulder": np.radians(40), "stroke": 0.012}
    assert dict(mechanism.reference) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ({"shoulder": "4 mm"}, "the reference: shoulder: '4 mm': the unit is not known; it is an"),
        ({"stroke": "4 deg"}, "stroke: '4 deg': the unit is not known; it is no angle, in m, cm"),
        ({"elbow": "much"}, "the reference: elbow: 'much' is not a number"),
        ({"elbow": "1e400"}, "the reference: elbow: 1e400 is not a finite number"),
        ({"hip": 1.0}, "there is no joint 'hip'"),
        ("pose.txt", "pose.txt: a file of joint coordinates ends in .yaml, .yml, .json"),
        ("none.yaml", "none.yaml: cannot be read: no such file"),
        ("list.yaml", r"list.yaml is \[1\]; give joint coordinates by name"),
        (7, "the reference is 7; give joint coordinates by name"),
    ],
)
def test_references_that_mean_nothing_are_refused(reference, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, "[1]", "list.yaml")
    with pytest.raises(LinkworkError, match=words):
        load(written(tmp_path, samples.URDF), reference=reference)


@pytest.mark.long
def test_commands_let_roots_float_and_look_into_packages(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, samples.URDF)
    facts = json.loads(call("info", "arm.urdf", "--floating", "--json").stdout)
    assert facts["mobility"] == 9
    assert call("analyse", "--floating", "arm.urdf", "parameters").exit_code == 0
    assert "no body is fixed to ground" in refused("info", "prr3", "--floating")
    assert "is no folder" in refused("info", "arm.urdf", "--package-path", "nowhere")
