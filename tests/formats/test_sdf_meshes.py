"""Meshes of SDF: their masses are MuJoCo's of the same files, and they are shown."""

import mujoco
import numpy as np
import pytest

from linkwork.formats import load
from linkwork.mechanism import MechanismError, MeshFile

from tests.formats import meshes

MODEL = """<sdf version='1.11'><model name='m'>
<link name='a'><inertial auto='true'><density>700</density></inertial>
<collision name='c'><pose>0.3 0.1 -0.2 0 0 {turn}</pose>{geometry}</collision>
<collision name='d'><density>90</density>
<geometry><box><size>0.1 0.2 0.3</size></box></geometry></collision>
<visual name='v'><pose>0 0 0.5 0 0 0</pose>{geometry}</visual></link></model></sdf>"""
GEOMETRY = """<geometry><mesh><uri>{file}</uri><scale>2 -1 1.5</scale>{more}</mesh></geometry>"""
THEIRS = """<mujoco><compiler angle='radian'/><asset>
<mesh name='m' file='{file}' scale='2 -1 1.5' inertia='exact'/></asset><worldbody>
<body><freejoint/><geom type='mesh' mesh='m' density='700' pos='0.3 0.1 -0.2' euler='0 0 {turn}'/>
<geom type='box' size='0.05 0.1 0.15' density='90'/></body></worldbody></mujoco>"""


def read(tmp_path, file="lump.stl", more=""):
    meshes.write_stl(tmp_path / "lump.stl", *meshes.lump())
    vertices, faces = meshes.lump()
    meshes.write_stl(tmp_path / "open.stl", vertices, faces[1:])
    meshes.write_stl(tmp_path / "flat.stl", vertices * [1, 1, 0], faces)
    path = tmp_path / "model.sdf"
    path.write_text(MODEL.format(turn=0.4, geometry=GEOMETRY.format(file=file, more=more)))
    imported = load(path)
    return imported.mechanism, imported.notes


def test_a_mesh_weighs_what_it_weighs_in_mujoco(tmp_path):
    """To the single precision in which MuJoCo holds vertices."""
    mechanism, _ = read(tmp_path)
    theirs = THEIRS.format(file=tmp_path / "lump.stl", turn=0.4)
    model, body = mujoco.MjModel.from_xml_string(theirs), mechanism.bodies["a"]
    assert not mechanism.caveats
    assert body.mass == pytest.approx(model.body_mass[1], rel=1e-6)
    assert body.centre_of_mass == pytest.approx(model.body_ipos[1], abs=1e-6)
    moments = np.sort(np.linalg.eigvalsh(body.inertia.tensor()))
    assert moments == pytest.approx(np.sort(model.body_inertia[1]), rel=1e-5)


def test_a_mesh_is_shown(tmp_path):
    mechanism, _ = read(tmp_path)
    (shape,) = mechanism.bodies["a"].shapes
    assert isinstance(shape, MeshFile) and shape.scale == (2, -1, 1.5)
    assert shape.frame.position == (0, 0, 0.5)


@pytest.mark.parametrize(
    ("file", "more", "caveat", "note"),
    [
        ("none.stl", "", "whose mass is left out: its file is not there", "not shown: its file"),
        ("model.sdf", "", "whose mass is left out: its file is no mesh", "is not shown: meshes"),
        ("flat.stl", "", "whose mass is left out: it encloses no volume", "no volume"),
        ("open.stl", "", "is not closed; its mass is a guess", "not closed"),
        ("lump.stl", "<submesh><name>x</name></submesh>", "the whole mesh is", "says submesh"),
    ],
)
def test_what_cannot_be_weighed_or_shown_is_told(file, more, caveat, note, tmp_path):
    mechanism, notes = read(tmp_path, file, more)
    assert any(caveat in each for each in mechanism.caveats)
    assert any(note in each for each in notes)
    assert mechanism.bodies["a"].mass >= 0.1 * 0.2 * 0.3 * 90


def test_a_scale_of_other_than_three_numbers_is_refused_by_its_place(tmp_path):
    read(tmp_path)
    path = tmp_path / "model.sdf"
    path.write_text(path.read_text().replace("2 -1 1.5", "2 -1"))
    with pytest.raises(MechanismError, match="<scale>: scale holds 2 numbers; give 3"):
        load(path)
