"""COLLADA files: what stands in their scene, beside the mesh that was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork.errors import LinkworkError
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.triangles import Triangles, weighed

from tests.formats.meshes import lump

NODE = """<node><translate>10 20 30</translate><rotate>0 0 2 90</rotate><scale>1 2 {z}</scale>
<instance_node url="#inner"/></node>"""
FILE = """<?xml version="1.0"?>{doctype}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="f" count="0">{numbers}</float_array><technique_common>
<accessor source="#f" stride="4"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{faces}</mesh></geometry>
</library_geometries>
<library_nodes><node id="inner"><matrix>0 0 1 0  1 0 0 0  0 1 0 5  0 0 0 1</matrix>
<instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="all">{node}</visual_scene></library_visual_scenes>
{scene}</COLLADA>"""
SCENE = '<scene><instance_visual_scene url="#all"/></scene>'
INPUTS = """<input semantic="NORMAL" source="#s" offset="0"/>
<input semantic="VERTEX" source="#v" offset="1"/>"""


def primitive(kind: str, faces: np.ndarray) -> str:
    """Return triangles as elements of some kind."""

    def words(corners: np.ndarray) -> str:
        return " ".join(f"0 {corner}" for corner in corners.ravel())

    if kind == "triangles":
        return f"<triangles>{INPUTS}<p>{words(faces)}</p></triangles>"
    if kind == "polylist":
        counts = " ".join("3" for _ in faces)
        return f"<polylist>{INPUTS}<vcount>{counts}</vcount><p>{words(faces)}</p></polylist>"
    rows = "".join(f"<p>{words(face)}</p>" for face in faces)
    return f"<{kind}>{INPUTS}{rows}</{kind}>"


def written(
    path: Path, kind="triangles", z=3.0, doctype="", scene=SCENE, node=NODE, more=""
) -> Path:
    vertices, faces = lump()
    numbers = " ".join(f"{x!r} {y!r} {z!r} 7" for x, y, z in vertices.tolist())
    shown = primitive(kind, faces) if kind else ""
    text = FILE.format(
        numbers=numbers, faces=shown + more, node=node.format(z=z), scene=scene, doctype=doctype
    )
    path.write_text(text)
    return path


@pytest.mark.parametrize("kind", ["triangles", "polylist", "polygons", "tristrips", "trifans"])
@pytest.mark.parametrize("z", [3.0, -3.0])
def test_what_stands_in_nodes_is_in_metres(tmp_path, kind, z):
    """Nodes in a node, mirrored ones included: the same solid as by hand, with its faces out."""
    vertices, faces = lump()
    found = read_mesh(written(tmp_path / "x.DAE", kind, z))
    inner = vertices[:, [2, 0, 1]] + [0, 0, 5]
    turn = Rotation.from_euler("z", 90, degrees=True)
    placed = 0.01 * (turn.apply(inner * [1, 2, z]) + np.array([10, 20, 30]))
    expected = weighed(Triangles(placed, faces if z > 0 else faces[:, ::-1]))
    own = weighed(found)
    assert found.open_edges == 0
    assert own.mass == pytest.approx(expected.mass, rel=1e-12)
    assert own.centre == pytest.approx(expected.centre, rel=1e-12)
    assert own.inertia == pytest.approx(expected.inertia, rel=1e-9, abs=1e-20)


def test_polygons_and_strips_of_more_than_three_corners(tmp_path):
    square = f"<polylist>{INPUTS}<vcount>4 3</vcount><p>0 0 0 1 0 2 0 3 0 4 0 5 0 6</p></polylist>"
    strip = f"<tristrips>{INPUTS}<p>0 0 0 1 0 2 0 3</p></tristrips>"
    found = read_mesh(written(tmp_path / "x.dae", "", more=square + strip)).faces
    many = len(lump()[0])
    assert found.tolist()[:3] == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert (found[3:] - many).tolist() == [[0, 1, 2], [2, 1, 3]]


def test_without_a_scene_the_geometries_are_shown(tmp_path):
    vertices, _ = lump()
    path = written(tmp_path / "x.dae", scene="")
    path.write_text(path.read_text().replace("library_visual_scenes", "extra"))
    assert read_mesh(path).vertices == pytest.approx(0.01 * vertices)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"doctype": "<!DOCTYPE COLLADA [<!ENTITY a 'b'>]>"}, "has a document type"),
        ({"node": ""}, "holds no triangles"),
        ({"node": "<node><lookat>1</lookat></node>"}, "a <lookat>, which is not read"),
        ({"kind": "", "more": f"<triangles>{INPUTS}<p>0 0 0 1 0 999</p></triangles>"}, "points"),
        ({"kind": "", "more": f"<triangles>{INPUTS}<p>0 0 x</p></triangles>"}, "can be read"),
        ({"scene": SCENE + "<"}, "can be read"),
    ],
)
def test_what_cannot_be_read_is_told(tmp_path, change, words):
    with pytest.raises(LinkworkError, match=words):
        read_mesh(written(tmp_path / "x.dae", **change))


def test_a_node_in_itself_is_refused(tmp_path):
    path = written(tmp_path / "x.dae")
    path.write_text(
        path.read_text().replace('<instance_geometry url="#g"/>', '<instance_node url="#inner"/>')
    )
    with pytest.raises(LinkworkError, match="more than 20000 nodes"):
        read_mesh(path)


def test_names_inside_a_geometry_come_first(tmp_path):
    """Files with two geometries that call their points alike, as some programs write them."""
    path = written(tmp_path / "x.dae")
    text = path.read_text()
    start, end = text.index("<geometry"), text.index("</library_geometries>")
    other = text[start:end].replace('id="g"', 'id="h"').replace(" 7 ", " 9 ")
    first = other.partition('count="0">')[2].split()[0]
    path.write_text(text[:end] + other.replace(first, "77", 1) + text[end:])
    assert read_mesh(path).vertices == pytest.approx(
        read_mesh(written(tmp_path / "y.dae")).vertices
    )
