"""Bodies that weigh what their shapes weigh, beside MuJoCo and closed solutions."""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.mechanism import Mechanism, MechanismError

from tests.formats.meshes import lump, write_stl

PLACED = lw.Frame(position=(0.3, -0.2, 0.5), rotation=(0.3, 0.7, -0.4))
FILE = """linkwork: 1
bodies:
  arm:
    shapes:
      - {{type: mesh, file: {file}, scale: [0.001, 0.001, -0.001], density: 2700{more}}}
joints:
  j: {{type: revolute, connects: [ground, arm], axis: [0, 1, 0]}}
"""


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a closed mesh in mm, and one that lacks a triangle."""
    vertices, faces = lump()
    (tmp_path / "parts").mkdir()
    write_stl(tmp_path / "parts" / "arm.stl", 1000 * vertices, faces)
    write_stl(tmp_path / "parts" / "open.stl", 1000 * vertices, faces[1:])
    return tmp_path


def written(folder, file="parts/arm.stl", more=""):
    path = folder / "arm.yaml"
    path.write_text(FILE.format(file=file, more=more))
    return path


def test_simple_shapes_weigh_what_mujoco_says():
    shapes = (
        lw.Box(size=(0.1, 0.2, 0.4), density=500.0, frame=PLACED),
        lw.Cylinder(radius=0.1, length=0.4, density=700.0),
        lw.Capsule(radius=0.1, length=0.4, density=800.0, frame=PLACED),
        lw.Sphere(radius=0.2, density=900.0, frame=PLACED),
        lw.Ellipsoid(radii=(0.1, 0.2, 0.3), density=600.0, frame=PLACED),
        lw.Sphere(radius=9.0),
    )
    sizes = "0.05 0.1 0.2", "0.1 0.2", "0.1 0.2", "0.2", "0.1 0.2 0.3"
    geoms = ""
    for shape, size in zip(shapes, sizes, strict=False):
        x, y, z, w = Rotation.from_rotvec(shape.frame.rotation).as_quat()
        place = " ".join(map(repr, shape.frame.position))
        geoms += f'<geom type="{shape.type}" size="{size}" density="{shape.density}"'
        geoms += f' pos="{place}" quat="{w} {x} {y} {z}"/>'
    theirs = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><joint/>{geoms}</body></worldbody></mujoco>"
    )
    ours = lw.Body(shapes=shapes)
    assert ours.mass == pytest.approx(theirs.body_mass[1], rel=1e-12)
    assert ours.centre_of_mass == pytest.approx(theirs.body_ipos[1], abs=1e-13)
    moments = np.linalg.eigvalsh(ours.inertia.tensor())
    assert moments == pytest.approx(np.sort(theirs.body_inertia[1]), rel=1e-12)


def test_a_polygon_is_a_prism():
    """A right triangle of legs a and b: I about z through its centre is m (a^2 + b^2) / 18."""
    a, b, thick = 0.3, 0.6, 0.1
    prism = lw.Polygon(points=((0, 0), (a, 0), (0, b)), thickness=thick, density=1000.0)
    body = lw.Body(shapes=(prism,))
    assert body.mass == pytest.approx(1000 * a * b / 2 * thick, rel=1e-12)
    assert body.centre_of_mass == pytest.approx((a / 3, b / 3, 0), abs=1e-13)
    assert body.inertia.zz == pytest.approx(body.mass * (a**2 + b**2) / 18, rel=1e-12)


def test_a_mesh_in_a_file_weighs_and_travels(folder):
    mechanism = Mechanism.load(written(folder))
    model = folder / "model.xml"
    model.write_text(
        '<mujoco><asset><mesh name="x" file="parts/arm.stl" scale="0.001 0.001 -0.001" '
        'inertia="exact"/></asset><worldbody><body><joint/><geom type="mesh" mesh="x" '
        'density="2700"/></body></worldbody></mujoco>'
    )
    theirs, arm = mujoco.MjModel.from_xml_path(str(model)), mechanism.bodies["arm"]
    assert arm.mass == pytest.approx(theirs.body_mass[1], rel=1e-12)
    assert arm.centre_of_mass == pytest.approx(theirs.body_ipos[1], abs=1e-13)
    moments = np.linalg.eigvalsh(arm.inertia.tensor())
    assert moments == pytest.approx(np.sort(theirs.body_inertia[1]), rel=1e-12)
    # Written elsewhere it names the same file, and holds the numbers.
    (folder / "deep").mkdir()
    mechanism.save(folder / "deep" / "arm.yaml")
    assert "file: ../parts/arm.stl" in (folder / "deep" / "arm.yaml").read_text()
    assert Mechanism.load(folder / "deep" / "arm.yaml") == mechanism
    text = mechanism.text
    (folder / "parts" / "arm.stl").unlink()
    assert Mechanism.parse(text) == mechanism


def test_an_open_mesh_is_weighed_by_its_hull_or_surface(folder):
    hull, shell = (
        Mechanism.load(written(folder, "parts/open.stl", f", inertia: {how}")).bodies["arm"].mass
        for how in ("convex", "shell")
    )
    assert 0 < hull < 2700 * 4 / 3 * pi * 0.07 * 0.14 * 0.112
    assert shell > 0


@pytest.mark.parametrize(
    ("file", "more", "words"),
    [
        ("parts/none.stl", "", r"line 5: bodies\.arm\.shapes\.0\.file: there is no file 'parts"),
        ("parts/open.stl", "", r"line 5: bodies\.arm\.shapes\.0: the mesh '.*open\.stl' is not cl"),
        ("parts/arm.stl", "}\n    inertia: {zz: 1", r"line 6: bodies\.arm\.inertia: is given with"),
        ("parts/arm.stl", ", inertia: legacy", r"line 5: .*inertia"),
        ("arm.yaml", "", r"arm\.yaml' is no mesh known here"),
        ("parts/arm.stl", ", colour: 7", r"line 5: bodies\.arm\.shapes\.0\.colour"),
    ],
)
def test_refusals_name_file_line_and_element(folder, file, more, words):
    with pytest.raises(MechanismError, match=words):
        Mechanism.load(written(folder, file, more))


def test_what_weighs_nothing_is_as_before(folder):
    with pytest.raises(MechanismError, match="mass: is missing"):
        lw.Body(shapes=(lw.Sphere(radius=1.0),))
    heavy = lw.Body(mass=2.0, shapes=(lw.Sphere(radius=1.0, density=1000.0),))
    assert heavy.mass == 2 and heavy.inertia.tensor().max() == 0
    with pytest.raises(MechanismError, match="a factor is 0"):
        lw.MeshFile(file="x.stl", scale=(1.0, 0.0, 1.0))
