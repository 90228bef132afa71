"""Mass of what triangles enclose, beside closed solutions."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from linkwork.errors import LinkworkError
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.triangles import Triangles, hull_of, weighed
from linkwork.solids.uniform import principal, shell, surface, volume

from tests.formats.meshes import lump, write_obj, write_stl

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])


def ring() -> Triangles:
    """Return a box (6, 4, 1) with a hole (2, 2, 1) in it, not in its middle."""
    import trimesh

    outer = trimesh.creation.box((6, 4, 1))
    inner = trimesh.creation.box((2, 2, 1))
    inner.apply_translation((1, 0.5, 0))
    inner.invert()
    both = trimesh.util.concatenate([outer, inner])
    return Triangles(np.array(both.vertices), np.array(both.faces))


@pytest.mark.parametrize("mode", ["exact", "legacy", "convex"])
def test_a_box_far_from_the_origin(mode):
    box = hull_of(CORNERS + np.array([50, -20, 30]))
    found = weighed(box, mode)
    assert found.mass == pytest.approx(6, rel=1e-13)
    assert found.centre == pytest.approx([50.5, -19, 31.5], rel=1e-13)
    assert found.inertia == pytest.approx(np.diag([6.5, 5.0, 2.5]), rel=1e-12, abs=1e-12)


def test_what_is_hollow_is_exact_and_legacy_counts_too_much():
    """Two boxes, one less the other: m = 24 - 4, I by the parallel axes."""
    exact, legacy = (weighed(ring(), mode) for mode in ("exact", "legacy"))
    centre = -4 / 20 * np.array([1, 0.5, 0])
    zz = 24 * (36 + 16) / 12 - 4 * 8 / 12 - 4 * 1.25 - 20 * (centre @ centre)
    assert exact.mass == pytest.approx(20, rel=1e-13)
    assert exact.centre == pytest.approx(centre, abs=1e-13)
    assert exact.inertia[2, 2] == pytest.approx(zz, rel=1e-12)
    assert legacy.mass > 21


def test_a_shell_of_triangles_is_that_of_the_shape():
    found = weighed(hull_of(CORNERS - np.array([0.5, 1.0, 1.5])), "shell")
    half = np.array([0.5, 1.0, 1.5])
    assert found.mass == pytest.approx(surface("box", half), rel=1e-13)
    assert np.diag(found.inertia) == pytest.approx(shell("box", half, found.mass), rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("sphere", [0.3]),
        ("capsule", [0.2, 0.5]),
        ("cylinder", [0.2, 0.5]),
        ("ellipsoid", [0.2, 0.3, 0.4]),
        ("box", [0.2, 0.3, 0.4]),
    ],
)
def test_hollow_shapes_are_the_difference_of_two_filled_ones(kind, size):
    """A layer of even thickness, which of an ellipsoid is even along its axes."""
    layer, size = 1e-6, np.array(size)
    outer = size + layer
    if kind == "capsule":
        outer[1] = size[1]
    within, beyond = volume(kind, size), volume(kind, outer)
    moments = principal(kind, outer, beyond) - principal(kind, size, within)
    expected = moments / (beyond - within)
    assert shell(kind, size, 1.0) == pytest.approx(expected, rel=1e-5)
    if kind != "ellipsoid":
        assert surface(kind, size) == pytest.approx((beyond - within) / layer, rel=1e-5)


def test_the_surface_of_a_long_ellipsoid():
    """A prolate spheroid: S = 2 pi a^2 (1 + c / (a e) asin e), Thomsen's is within 1 %."""
    a, c = 0.1, 0.3
    e = np.sqrt(1 - a**2 / c**2)
    exact = 2 * pi * a**2 * (1 + c / (a * e) * np.arcsin(e))
    assert surface("ellipsoid", np.array([a, a, c])) == pytest.approx(exact, rel=0.011)


def test_open_and_twisted_meshes_are_known():
    vertices, faces = lump()
    whole = Triangles(vertices, faces)
    assert whole.open_edges == 0
    assert Triangles(vertices, faces[1:]).open_edges == 3
    twisted = faces.copy()
    twisted[0] = twisted[0, ::-1]
    assert Triangles(vertices, twisted).open_edges == 3
    apart = Triangles(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert apart.open_edges == 0
    points, numbers = np.unique(apart.vertices, axis=0, return_inverse=True)
    assert (apart.joined().vertices == points).all()
    assert (apart.joined().faces == numbers.reshape(-1, 3)).all()


def test_files_hold_the_same_triangles(tmp_path):
    import trimesh

    vertices, faces = lump()
    expected = weighed(Triangles(vertices, faces), "exact")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    paths = [write_stl(tmp_path / "x.stl", vertices, faces)]
    paths += [write_obj(tmp_path / "X.OBJ", vertices, faces)]
    for suffix in ("ply", "glb", "off"):
        paths.append(tmp_path / f"x.{suffix}")
        mesh.export(paths[-1])
    for path in paths:
        found = weighed(read_mesh(path), "exact")
        assert found.mass == pytest.approx(expected.mass, rel=1e-6), path
        assert found.inertia == pytest.approx(expected.inertia, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize(
    ("points", "mode", "words"),
    [
        (CORNERS * [1, 1, 0], "exact", "encloses no volume"),
        (CORNERS * [1, 0, 0], "shell", "has no surface"),
    ],
)
def test_what_has_no_volume_is_refused(points, mode, words):
    faces = hull_of(CORNERS).faces
    with pytest.raises(LinkworkError, match=words):
        weighed(Triangles(points, faces), mode)
    with pytest.raises(LinkworkError, match="lie in a plane"):
        hull_of(points)
