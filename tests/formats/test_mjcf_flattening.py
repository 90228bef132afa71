"""What MuJoCo itself writes out moves as MuJoCo's compile of the same file; where it does not, the
reader says what would help."""

import sys
from types import SimpleNamespace

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load, xml

from tests.formats.test_mjcf_attachments import TIP, difference

FINGER = """<mujoco model="hand"><compiler {compiler} meshdir="shapes"/>
<default><geom contype="0" conaffinity="0"/><joint damping="0.3"/>
 <default class="thin"><geom size="0.02" density="700"/></default></default>
<asset><mesh name="bulb" builtin="sphere" params="1" scale="0.1 0.1 0.2"/>
 <mesh file="tip.obj"/></asset>
<worldbody><body name="base"><joint name="q" axis="0 0 1" range="-300 300"/><geom size="0.1"/>
 <body name="f" pos="0.123456789012345 0 0" euler="3.0123456789 2 10" childclass="thin">
  <joint name="k" axis="0 1 0" ref="0.1"/><geom type="mesh" mesh="{mesh}"/>
  <geom type="mesh" mesh="tip" euler="10 0 0"/><geom pos="0.3 0 0"/></body>
 <frame pos="0 0.2 0" euler="0 0 9">{attached}</frame></body></worldbody>
{more}</mujoco>"""
ATTACHED = '<attach body="f" prefix="p_"/>'
DRIVEN = '<actuator><position joint="p_k" kp="3"/><motor joint="q"/></actuator>'
ROPE = """<mujoco model="rope"><default><geom contype="0" conaffinity="0"/></default>
<worldbody><body name="hand"><joint name="h" axis="0 1 0" damping="0.1"/>
 <geom size="0.1" pos="0.1 0 0"/>
 <composite type="cable" vertex="0 0 0  0.1 0.02 0  0.2 0 0.03  0.3 0.01 0.05" initial="none"
  prefix="r"><joint kind="main" damping="0.015"/><geom type="capsule" size="0.02" density="800"/>
 </composite></body></worldbody></mujoco>"""
SAVED = """<mujoco model="rope"><default><geom contype="0" conaffinity="0"/></default>
<worldbody><body name="hand"><joint name="h" damping="0.1" axis="0 1 0"/>
 <geom size="0.1" pos="0.1 0 0"/>
<body name="rB_first"
  quat="0.31914045944902913 0.9425707961159271 0.09333289834876105 0.0316011319080479">
 <geom name="rG0" size="0.02" fromto="0 0 0 0.10198039164536403 0 0" type="capsule" density="800"/>
 <body name="rB_1" pos="0.10198039164536403 0 0"
  quat="0.9709671993376219 5.204170427930421e-18 1.3877787807814457e-17 0.23921266231212496">
  <joint name="rJ_1" type="ball" group="3" damping="0.015"/><geom name="rG1" size="0.02"
   fromto="0 0 0 0.10630145925578208 0 0" type="capsule" density="800"/>
  <body name="rB_last" pos="0.10630145925578208 0 0"
   quat="0.9886282294387917 -4.5536491244391186e-17 0.04900469670762912 -0.1421715993344427">
   <joint name="rJ_last" type="ball" group="3" damping="0.015"/><geom name="rG2" size="0.02"
    fromto="0 0 0 0.10246951663930834 0 0" type="capsule" density="800"/>
   <site name="rS_last" pos="0.10246951663930834 0 0" group="3"/>
  </body></body></body></body></worldbody></mujoco>"""
"""What MuJoCo 3.17.0 saves of it, but for contacts and its notes to itself."""
RATES = (0.3, 0.1, -0.4, 0.2, 0.5, 0.7, -0.6)
COMPILED = (
    *(70.52378263950574, 315.0094071303261, 54.921097778751914, 7.859536348933986),
    *(-592.9636131093969, -130.8177678230919, 43.54558208405287),
)
"""dv/dt that MuJoCo 3.17.0 gives for ROPE at qpos0 under RATES (qvel), in the bodies' axes."""


def written(folder, attached=ATTACHED, more=DRIVEN, compiler="", mesh="bulb"):
    (folder / "shapes").mkdir()
    (folder / "shapes" / "tip.obj").write_text(TIP)
    path = folder / "hand.xml"
    path.write_text(FINGER.format(attached=attached, more=more, compiler=compiler, mesh=mesh))
    return path


@pytest.mark.parametrize(
    "compiler",
    [
        "",
        'angle="radian" eulerseq="zYx"',
        'boundmass="0.3" boundinertia="0.1"',
        'settotalmass="7" inertiagrouprange="0 2" balanceinertia="true"',
    ],
)
def test_a_model_attached_to_itself_moves_as_mujocos(compiler, tmp_path, monkeypatch):
    """Reading leaves no file where one works; MuJoCo's own compile writes its log there."""
    path, here = written(tmp_path, compiler=compiler), tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    imported = load(path)
    assert not [*here.iterdir()]
    assert difference(path) < 1e-9
    assert not imported.mechanism.caveats
    told = [note for note in imported.notes if "written out by MuJoCo" in note]
    assert [note.partition(" is ")[0] for note in told] == [
        "hand.xml, line 10: <attach>",
        "hand.xml, line 4: <mesh 'bulb'>",
    ]


def test_a_mesh_that_mujoco_makes_is_weighed_alone(tmp_path):
    path = written(tmp_path, attached="", more="")
    assert difference(path) < 1e-9
    model = mj.MjModel.from_xml_path(str(path))
    mass = load(path).mechanism.bodies["f"].mass
    assert np.isclose(mass, model.body("f").mass[0], rtol=1e-12, atol=0)


def test_a_file_that_needs_nothing_of_it_is_read_here(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    imported = load(written(tmp_path, attached="", more="", mesh="tip"))
    assert not any("MuJoCo" in note for note in imported.notes)


def test_remarks_on_what_is_written_out_name_no_line(tmp_path):
    sensor = '<sensor><jointpos joint="p_k"/></sensor>'
    notes = load(written(tmp_path, more=sensor)).notes
    told = "hand.xml: <sensor> is left out: sensors do not act on the motion"
    assert told in notes


def test_without_mujoco_it_is_said_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.warns(ModelWarning):
        notes = load(written(tmp_path, more="")).notes
    mesh, made = (note for note in notes if "pip install 'mujoco>=3.16'" in note)
    assert "line 10: <attach> is left out: it makes bodies" in made
    assert "line 4: <mesh 'bulb'> is made by MuJoCo alone: MuJoCo, which is not installed" in mesh


@pytest.mark.parametrize(
    ("attached", "sentence"),
    [
        (
            '<attach body="nowhere" prefix="p_"/>',
            "refuses the file: XML Error: could not find body",
        ),
        ("".join(f'<attach body="base" prefix="{k}_"/>' for k in range(20)), "has more than"),
    ],
)
def test_what_mujoco_does_not_write_out_is_left_out_with_the_reason(attached, sentence, tmp_path):
    with pytest.warns(ModelWarning, match=sentence):
        imported = load(written(tmp_path, attached=attached, more="", mesh="tip"))
    assert {*imported.mechanism.bodies} == {"base", "f"}


def test_flexible_bodies_stay_left_out(tmp_path):
    flexible = (
        ATTACHED + '<flexcomp name="s" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2"/>'
    )
    with pytest.warns(ModelWarning) as told:
        imported = load(written(tmp_path, attached=flexible, more="", mesh="tip"))
    remarks = [str(each.message) for each in told]
    assert ["is left out: it makes bodies" in remark for remark in remarks] == [True, False]
    assert "is left out: it is soft" in remarks[1]
    assert {*imported.mechanism.bodies} == {"base", "f"}


def test_composites_are_those_of_a_mujoco_that_has_them(tmp_path, monkeypatch):
    """The text that MuJoCo 3.17 saves is read; accelerations are those of its own compile."""
    path, asked = tmp_path / "rope.xml", []
    path.write_text(ROPE)
    spec = SimpleNamespace(compiler=SimpleNamespace(savecompiled=True), to_xml=lambda: SAVED)
    specs = SimpleNamespace(from_file=lambda name: asked.append(name) or spec)
    former = SimpleNamespace(__version__="3.17.0", MjSpec=specs, FatalError=mj.FatalError)
    monkeypatch.setitem(sys.modules, "mujoco", former)
    mechanism = load(path).mechanism
    assert asked == [str(path)] and spec.compiler.savecompiled is False
    assert not mechanism.caveats
    robot = lw.Robot(mechanism)
    assert robot.rates == ("h", *(f"rJ_{k}.w{axis}" for k in ("1", "last") for axis in "xyz"))
    # The bodies' axes at qpos0 are those in which a ball's rates are told here.
    state = robot.state((0, *(1, 0, 0, 0) * 2), dict(zip(robot.rates, RATES, strict=True)))
    found = robot.forward_dynamics(state, np.zeros(len(robot.actuators)))
    np.testing.assert_allclose(found, COMPILED, rtol=1e-9)


def test_a_mujoco_without_composites_is_told(tmp_path):
    path = tmp_path / "rope.xml"
    path.write_text(ROPE)
    needed = r"MuJoCo 4\.\d+\.\d+ has no composite any more; .* pip install 'mujoco>=3\.16,<4'"
    with pytest.warns(ModelWarning, match=needed):
        assert {*load(path).mechanism.bodies} == {"hand"}


def test_a_mujoco_that_cannot_save_so_is_told(tmp_path, monkeypatch):
    def from_file(name):
        raise AttributeError("MjSpec")

    specs = SimpleNamespace(from_file=from_file)
    old = SimpleNamespace(__version__="3.1.0", MjSpec=specs, FatalError=mj.FatalError)
    monkeypatch.setitem(sys.modules, "mujoco", old)
    with pytest.warns(ModelWarning, match="MuJoCo 3.1.0 is too old; a later one writes it out"):
        load(written(tmp_path, more="", mesh="tip"))


def test_text_without_lines_of_a_file_refuses_without_them(tmp_path):
    root = xml.parsed(b"<a><b/></a>", tmp_path / "model.xml", lined=False)
    assert str(root.children[0].refusal("is not so")) == f"{tmp_path / 'model.xml'}: <b>: is not so"


@pytest.mark.parametrize("rigid", [False, True])
def test_soft_parts_are_warned_of_and_rigid_ones_noted(rigid, tmp_path):
    part = '<flexcomp name="s" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2"{}/>'
    path = tmp_path / "model.xml"
    path.write_text(
        '<mujoco><worldbody><body><joint name="h"/><geom size="0.1"/>'
        f"{part.format(' rigid=' + repr('true') if rigid else '')}</body></worldbody></mujoco>"
    )
    imported = load(path)
    (note,) = imported.notes
    assert ("rigid and without mass" if rigid else "is soft, and bodies are rigid here") in note
    assert len(imported.mechanism.caveats) == (not rigid)
