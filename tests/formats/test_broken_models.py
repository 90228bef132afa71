"""Model files that contradict themselves: each is refused, or told, in one sentence; MuJoCo refuses
those of MJCF, too."""

import mujoco as mj
import pytest

from linkwork.formats import load
from linkwork.mechanism import MechanismError

from tests.cli.calls import call, refused

BODY = '<body name="{0}"><joint name="{1}"/><geom name="g{0}" size="0.1"/></body>'
TWO = BODY.format("a", "j") + BODY.format("b", "k")
ONCE = "names are given once"


def mjcf(world=TWO, rest=""):
    return f"<mujoco>{rest}<worldbody>{world}</worldbody></mujoco>"


def of(inside, name="a"):
    return f'<body name="{name}"><joint name="j"/>{inside}</body>'


INERTIAL = '<inertial pos="0 0 0" mass="{}" diaginertia="{} 1 1"/>'


def twice(section, element):
    return mjcf(rest=f"<{section}>{2 * element}</{section}>")


WRONG = {
    "geoms": (mjcf(TWO.replace("gb", "ga")), f"<geom 'ga'>: has the name of another geom; {ONCE}"),
    "actuators": (
        twice("actuator", '<motor name="m" joint="j"/>'),
        f"<motor 'm'>: has the name of another actuator; {ONCE}",
    ),
    "tendons": (
        twice("tendon", '<fixed name="t"><joint joint="j" coef="1"/></fixed>'),
        f"<fixed 't'>: has the name of another tendon; {ONCE}",
    ),
    "equalities": (
        twice("equality", '<joint name="e" joint1="j" joint2="k"/>'),
        f"<joint 'e'>: has the name of another equality; {ONCE}",
    ),
    "keys": (
        twice("keyframe", '<key name="home" qpos="1 2"/>'),
        f"<key 'home'>: has the name of another key; {ONCE}",
    ),
    "meshes": (
        twice("asset", '<mesh name="m" file="a.stl"/>'),
        f"<mesh 'm'>: has the name of another mesh; {ONCE}",
    ),
    "classes": (
        twice("default", '<default class="x"/>'),
        "<default>: gives class 'x' again; keep one of both",
    ),
    "flag": (
        mjcf(rest='<option><flag gravity="off"/></option>'),
        "<flag>: gravity 'off' is not one of enable, disable",
    ),
    "mass": (mjcf(of(INERTIAL.format(-1, 1))), "<body 'a'>: mass -1 is below 0; give zero or more"),
    "moment": (mjcf(of(INERTIAL.format(1, -1))), "<body 'a'>: has a moment of inertia -1 below 0"),
    "mass of a geom": (
        mjcf(of('<geom size="0.1" mass="-1"/><geom size="0.1"/>')),
        "<geom>: mass '-1' is below 0; give zero or more",
    ),
    "density of a geom": (
        mjcf(of('<geom size="0.1" density="-1"/><geom size="0.1"/>')),
        "<geom>: density '-1' is below 0; give zero or more",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_mjcf_that_mujoco_refuses_is_refused(wrong, tmp_path):
    text, words = WRONG[wrong]
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(MechanismError) as refusal:
        load(path)
    assert str(refusal.value) == f"{path}: line 1: {words}"
    with pytest.raises(ValueError):
        mj.MjModel.from_xml_string(text)


def test_bounds_raise_a_mass_below_zero_as_in_mujoco(tmp_path):
    text = mjcf(of(INERTIAL.format(-1, 1)), '<compiler boundmass="0.5"/>')
    (tmp_path / "model.xml").write_text(text)
    mass = load(tmp_path / "model.xml").mechanism.bodies["a"].mass
    assert mass == mj.MjModel.from_xml_string(text).body_mass[1] == 0.5


def test_names_of_copies_and_of_what_is_only_seen_are_free(tmp_path):
    seen = '<camera name="c"/><light name="c"/><site name="s"/><geom name="g" size="0.1"/>'
    text = mjcf(f'<replicate count="2" offset="1 0 0">{of(seen)}</replicate>')
    (tmp_path / "model.xml").write_text(text)
    assert len(load(tmp_path / "model.xml").mechanism.bodies) == 2
    assert mj.MjModel.from_xml_string(text).nbody == 3


@pytest.mark.parametrize(("inside", "alters"), [("flex", True), ("skin", False)])
def test_what_is_soft_is_warned_of_and_what_is_only_seen_is_noted(inside, alters, tmp_path):
    (tmp_path / "model.xml").write_text(mjcf(rest=f"<deformable><{inside}/></deformable>"))
    imported = load(tmp_path / "model.xml")
    assert any("<deformable> is left out" in note for note in imported.notes)
    assert bool(imported.mechanism.caveats) == alters


def test_a_joint_that_mimics_itself_is_refused(tmp_path):
    (tmp_path / "model.urdf").write_text(
        "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='continuous'>"
        "<parent link='a'/><child link='b'/><mimic joint='j'/></joint></robot>"
    )
    with pytest.raises(MechanismError, match="<mimic>: 'j' mimics itself; name another joint"):
        load(tmp_path / "model.urdf")


def test_of_several_worlds_the_first_counts(tmp_path):
    link = "<model name='{0}'><link name='{0}'/></model>"
    worlds = "".join(f"<world name='{x}'>{link.format(x)}</world>" for x in "vw")
    (tmp_path / "model.sdf").write_text(f"<sdf version='1.9'>{worlds}</sdf>")
    mechanism = load(tmp_path / "model.sdf").mechanism
    assert set(mechanism.bodies) == {"v"}
    assert "<world 'w'> is left out: the first world counts" in mechanism.caveats[0]


def test_a_folder_is_no_target(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.xml").write_text(mjcf())
    assert ". exists; give another name" in refused("convert", "model.xml", ".")
    assert call("convert", "model.xml", "model.yaml").exit_code == 0


SDF = """<sdf version='1.9'><model name='m'><link name='a'>{inertial}</link>
<joint name='j' type='revolute'><parent>world</parent><child>a</child>{axis}{more}</joint></model>
</sdf>"""
AXIS = "<axis><xyz>0 0 1</xyz>{}</axis>"
MASS = "<inertial>{}<mass>2</mass></inertial>"


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"inertial": MASS.format("") + MASS}, "<inertial> in a <link> is left out: the first"),
        ({"axis": 2 * AXIS.format("")}, "<axis> in a <joint> is left out: the first counts"),
        ({"axis": AXIS.format("<dynamics><dampin/></dynamics>")}, "<dampin> in a <dynamics> is"),
        ({"more": "<springs/>"}, "<springs> in a <joint> is left out: it is not known here"),
        ({"inertial": MASS.format("<pose relative_to='j'/>")}, "<pose> says relative_to, which"),
    ],
)
def test_what_sdf_says_again_or_has_not_is_warned_of(parts, words, tmp_path):
    plain = {"inertial": MASS.format(""), "axis": AXIS.format(""), "more": ""}
    (tmp_path / "model.sdf").write_text(SDF.format(**plain | parts))
    (caveat,) = load(tmp_path / "model.sdf").mechanism.caveats
    assert words in caveat
    (tmp_path / "model.sdf").write_text(SDF.format(**plain))
    assert not load(tmp_path / "model.sdf").mechanism.caveats
