"""Masses of MJCF bodies from geoms and meshes, beside MuJoCo's own compiler."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from linkwork.errors import ModelWarning
from linkwork.formats import load
from linkwork.formats.models import Imported

from tests.formats.meshes import lump, write_msh, write_obj, write_stl

TURNED = 'pos="0.1 0 0.2" euler="10 20 30"'
MODEL = """<mujoco><compiler {compiler}/><asset>{asset}</asset><worldbody>
<body name="a" pos="0.1 0.2 0.3"><joint name="j" axis="1 0 0"/>{body}</body></worldbody></mujoco>"""
GEOM = f'<geom type="mesh" mesh="x" {TURNED}/>'


@pytest.fixture(autouse=True)
def files(tmp_path):
    vertices, faces = lump()
    write_stl(tmp_path / "x.stl", vertices, faces)
    write_msh(tmp_path / "x.msh", vertices, faces)
    path = write_obj(tmp_path / "x.obj", vertices, faces)
    (tmp_path / "groups.obj").write_text(path.read_text() + "o second\nf 1 2 3\nf 4 5 6\n")
    write_obj(tmp_path / "points.obj", vertices, faces[:0])


def model(tmp_path, body=GEOM, asset='<mesh name="x" file="x.stl"/>', compiler=""):
    path = tmp_path / "model.xml"
    path.write_text(MODEL.format(body=body, asset=asset, compiler=compiler))
    return path


def compared(path, near=1e-12) -> Imported:
    """Check the one body against MuJoCo: mass, centre and moments to rounding, axes as exactly as
    MuJoCo's own iteration finds them."""
    theirs, imported = mujoco.MjModel.from_xml_path(str(path)), load(path)
    ours = imported.mechanism.bodies["a"]
    size = np.sqrt(theirs.body_inertia[1].max() / theirs.body_mass[1])
    assert ours.mass == pytest.approx(theirs.body_mass[1], rel=near)
    assert ours.centre_of_mass == pytest.approx(theirs.body_ipos[1], rel=0, abs=near * size)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, theirs.body_iquat[1])
    tensor = ours.inertia.tensor()
    moments = np.linalg.eigvalsh(tensor)
    assert moments == pytest.approx(np.sort(theirs.body_inertia[1]), rel=near)
    R = turn.reshape(3, 3)
    assert tensor == pytest.approx(
        R @ np.diag(theirs.body_inertia[1]) @ R.T, rel=0, abs=1e-6 * moments[-1]
    )
    return imported


@pytest.mark.parametrize("mode", ["legacy", "exact", "convex", "shell"])
@pytest.mark.parametrize("file", ["x.stl", "x.obj", "x.msh", "groups.obj", "points.obj"])
def test_meshes_weigh_what_mujoco_says(tmp_path, file, mode):
    moved = 'scale="1 2 0.5" refpos="0.1 0.2 0.3" refquat="1 0.2 0.3 0.4"'
    asset = f'<mesh name="x" file="{file}" inertia="{mode}" {moved}/>'
    compared(model(tmp_path, asset=asset))


@pytest.mark.parametrize(
    "how", ['scale="-1 1 1"', 'scale="-1 -2 -1"', 'inertia="convex" maxhullvert="12"']
)
def test_mirrored_meshes_and_small_hulls(tmp_path, how):
    body = '<geom type="mesh" mesh="x" mass="2"/><geom size="0.1" pos="1 0 0"/>'
    compared(model(tmp_path, body, f'<mesh name="x" file="x.stl" {how}/>'))


@pytest.mark.parametrize("compiler", ["", 'fitaabb="true"'])
@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "ellipsoid", "box"])
def test_simple_shapes_fitted_to_a_mesh(tmp_path, kind, compiler):
    """The box around a mesh follows MuJoCo's axes, which it finds to eight digits."""
    body = f'<geom type="{kind}" mesh="x" {TURNED} fitscale="1.3"/>'
    compared(model(tmp_path, body, compiler=compiler), near=1e-6 if compiler else 1e-12)


@pytest.mark.parametrize("hollow", ["true", "false"])
@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("sphere", "0.1"),
        ("capsule", "0.1 0.3"),
        ("cylinder", "0.1 0.3"),
        ("ellipsoid", "0.1 0.2 0.4"),
        ("box", "0.1 0.2 0.4"),
    ],
)
def test_filled_and_hollow_shapes(tmp_path, kind, size, hollow):
    body = f'<geom type="{kind}" size="{size}" shellinertia="{hollow}" {TURNED}/>'
    near = 2e-11 if kind == "ellipsoid" else 1e-12
    compared(model(tmp_path, body + '<geom size="0.1" density="300"/>'), near)


@pytest.mark.parametrize(
    ("body", "compiler"),
    [
        (GEOM + '<geom size="0.1" group="4"/>', 'inertiagrouprange="0 2" settotalmass="3"'),
        (GEOM + '<geom size="0.01" pos="1 0 0"/>', 'boundinertia="0.01" boundmass="0.1"'),
        ('<geom size="0.1" mass="0"/>', 'boundmass="0.1" boundinertia="0.001"'),
        (GEOM + '<geom size="0.1" mass="1e-15"/>', ""),
        (GEOM + '<inertial pos="0 0 0" mass="3" diaginertia="1 2 2.5"/>', ""),
        (
            GEOM + '<inertial pos="0 0 0" mass="3" diaginertia="1 2 2.5"/>',
            'inertiafromgeom="true"',
        ),
        ('<inertial pos="0 0 0" mass="3" diaginertia="1 2 4"/>', 'balanceinertia="true"'),
        (
            GEOM + '<geom size="0.1" contype="0" conaffinity="0"/>',
            'discardvisual="true"',
        ),
    ],
)
def test_settings_of_the_compiler(tmp_path, body, compiler):
    compared(model(tmp_path, body, compiler=compiler))


@pytest.mark.parametrize(
    ("file", "compiler"),
    [
        ("there/x.stl", ""),
        ("x.stl", 'meshdir="there"'),
        ("x.stl", 'assetdir="there"'),
        ("x.stl", 'assetdir="elsewhere" meshdir="there"'),
        ("C:\\parts/x.stl", 'strippath="true" meshdir="there"'),
    ],
)
def test_where_meshes_lie(tmp_path, file, compiler):
    (tmp_path / "there").mkdir()
    (tmp_path / "x.stl").rename(tmp_path / "there" / "x.stl")
    body = f'<geom type="mesh" mesh="x" {TURNED}/>'
    compared(model(tmp_path, body, f'<mesh file="{file}"/>', compiler))


def test_vertices_in_the_model_itself(tmp_path):
    corners = "0 0 0 1 0 0 0 1 0 0 0 1"
    compared(model(tmp_path, asset=f'<mesh name="x" vertex="{corners}"/>'))
    faces = "0 2 1 0 1 3 0 3 2"
    asset = f'<mesh name="x" vertex="{corners}" face="{faces}" inertia="exact"/>'
    imported = compared(model(tmp_path, asset=asset))
    assert any("is not closed: at 3 edges" in note for note in imported.notes)


def test_what_is_weighed_as_mujoco_does_is_told(tmp_path):
    imported = compared(model(tmp_path, asset='<mesh name="x" file="groups.obj"/>'))
    assert any("has several groups in its OBJ file" in note for note in imported.notes)
    assert not imported.mechanism.caveats


INSIDE_OUT = (
    '<mesh name="x" inertia="exact" vertex="0 0 0 1 0 0 0 1 0 0 0 1" '
    'face="0 1 2 0 3 1 0 2 3 1 3 2"/>'
)


def test_meshes_that_are_not_there_are_told_in_one_sentence(tmp_path):
    path = tmp_path / "model.xml"
    asset = "".join(f'<mesh name="m{k}" file="part{k}.stl"/>' for k in range(6))
    geoms = "".join(f'\n<geom type="mesh" mesh="m{k}"/>' for k in (0, 1, 1, 2, 3, 4, 5))
    path.write_text(MODEL.format(compiler="", asset=asset, body=f'<geom size="0.1"/>{geoms}'))
    with pytest.warns(ModelWarning, match="whose mass is left out"):
        imported = load(path)
    files = "its file 'part0.stl', 'part1.stl', 'part2.stl', 'part3.stl', ... is not in"
    for what in ("is not shown", "whose mass is left out"):
        (told,) = [note for note in imported.notes if what in note and "mesh" in note]
        assert "and 6 more: <geom>" in told and files in told


@pytest.mark.parametrize(
    ("asset", "words"),
    [
        ('<mesh name="x" file="none.stl"/>', "its file 'none.stl' is not in "),
        (
            '<mesh name="x" file="broken.stl"/>',
            "its file 'broken.stl' holds no mesh of finite points",
        ),
        ('<mesh name="x" file="short.msh"/>', "is not as long as an MSH file"),
        ('<mesh name="x" file="x.step"/>', "is no mesh known here; give one of .stl, .obj"),
        ('<mesh name="y" file="x.stl"/>', "there is no mesh 'x'"),
        ('<mesh name="x"><plugin instance="made"/></mesh>', "it is made by MuJoCo itself"),
        (INSIDE_OUT, "its triangles face inwards"),
    ],
)
def test_meshes_that_cannot_be_weighed_are_told(tmp_path, asset, words):
    for name in ("broken.stl", "x.step"):
        (tmp_path / name).write_text("no mesh at all")
    (tmp_path / "short.msh").write_bytes((tmp_path / "x.msh").read_bytes()[:-4])
    with pytest.warns(ModelWarning, match="has no mass here"):
        imported = load(model(tmp_path, asset=asset))
    (told,) = (note for note in imported.notes if "whose mass is left out" in note)
    assert told.startswith("model.xml, line 2: <geom> is a mesh, whose mass is left out: ")
    assert words in told and told in imported.mechanism.caveats


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("moved", [0, 3])
@pytest.mark.parametrize("corners", [4, 5, 7, 12, 101])
def test_polygons_that_are_not_flat_are_cut_as_mujoco_cuts_them(tmp_path, corners, moved, seed):
    write_drum(tmp_path / "drum.obj", corners, moved, seed)
    compared(model(tmp_path, GEOM, '<mesh name="x" file="drum.obj"/>'), near=1e-9)


def write_drum(path, corners, moved, seed):
    """Write a drum whose two ends are polygons that are not flat, with a dent from five corners on,
    in numbers that single precision holds."""
    turns = 2 * np.pi * np.arange(corners) / corners
    radii = np.where(np.arange(corners) == 3, 0.25 if corners > 4 else 0.5, 1.0)
    heights = np.random.default_rng(seed).normal(size=(2, corners)) / 8 + [[0], [1]]
    rim = np.transpose([radii * np.cos(turns), radii * np.sin(turns)])
    points = np.concatenate([np.column_stack([rim, heights[k]]) for k in (0, 1)])
    lines = [f"v {x} {y} {z}" for x, y, z in np.round(64 * (points + moved)) / 64]
    below = np.arange(1, corners + 1)
    above, after = below + corners, np.roll(below, -1)
    sides = np.transpose([below, after, after + corners, above])
    faces = [above, below[::-1], *sides]
    path.write_text("\n".join([*lines, *("f " + " ".join(map(str, face)) for face in faces)]))
