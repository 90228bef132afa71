"""Meshes of files in pictures, films and the viewer: at their places, affordable, and told where
they are not there."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.scene.fixtures import fixtures_of
from linkwork.scene.meshes import FINEST, piece_of
from linkwork.solids.triangles import Triangles, simplified
from linkwork.views import plot_mechanism
from linkwork.views.canvas import PAINTED
from linkwork.views.film import TRIANGLES, film

from tests.formats.meshes import lump, write_stl

PLACED = lw.Frame(position=(0.3, -0.2, 0.5), rotation=(0.3, 0.7, -0.4))


@pytest.fixture(params=[False, True], ids=["plane", "space"])
def robot(request, tmp_path):
    """Return a pendulum with a mesh, in the plane or in space, and the mesh's points in ground."""
    vertices, faces = lump()
    file = str(write_stl(tmp_path / "x.stl", vertices, faces))
    shape = lw.MeshFile(file=file, scale=(2.0, 2.0, -2.0), density=1000.0, frame=PLACED)
    axis = (0.0, 1.0, 0.2) if request.param else (0.0, 0.0, 1.0)
    joint = lw.RevoluteJoint(connects=("ground", "arm"), axis=axis)
    body = lw.Body(shapes=(shape,))
    return lw.Robot(lw.Mechanism(bodies={"arm": body}, joints={"j": joint}, actuators=("j",)))


def corners(robot):
    from linkwork.equations.algebra import rotation_matrix

    points = lump()[0] * (2.0, 2.0, -2.0)
    return points @ np.array(rotation_matrix(PLACED.rotation)).T + PLACED.position


def test_the_viewer_has_the_mesh_where_it_is(robot):
    (shown,) = (part for part in fixtures_of(robot).parts if part.role == "member")
    points = shown.position + (shown.mesh.vertices * shown.scale) @ shown.turn.T
    key = np.lexsort(points.round(6).T), np.lexsort(corners(robot).round(6).T)
    assert points[key[0]] == pytest.approx(corners(robot)[key[1]], abs=1e-7)
    assert shown.mesh.volume == pytest.approx(robot.mechanism.bodies["arm"].mass / 1000, rel=1e-6)


def test_pictures_show_it_where_it_is(robot):
    axes: Any = plot_mechanism(robot, robot.home)
    spots = corners(robot)
    if robot.planar:
        shown = np.concatenate([path.vertices for path in axes.collections[-1].get_paths()])
        assert np.ptp(shown, axis=0) == pytest.approx(np.ptp(spots[:, :2], axis=0), rel=0.02)
    else:
        low, high = np.transpose([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
        assert np.all(low <= spots.min(axis=0)) and np.all(spots.max(axis=0) <= high)
        assert any(len(found.get_facecolor()) > 30 for found in axes.collections)


def test_films_hold_its_triangles(robot):
    states = robot.assemble(joints={"j": np.linspace(0, 0.3, 4)})
    made = film(robot, np.linspace(0, 1, 4), states)
    (part,) = (part for part in made.parts if part.kind == "mesh")
    assert 0 < len(part.faces) <= 3 * TRIANGLES and max(part.faces) < len(part.corners) / 3
    drawn = made.drawn(part)[0]
    assert np.ptp(drawn, axis=0) == pytest.approx(np.ptp(corners(robot), axis=0), abs=1e-4)
    assert json.loads(made.data)["parts"][0][5] == list(part.faces)


def test_a_mesh_that_went_missing_is_told_and_the_body_is_drawn_without(tmp_path, robot):
    (tmp_path / "x.stl").unlink()
    with pytest.warns(ModelWarning, match="x.stl' is not shown: it is not there"):
        plot_mechanism(robot, robot.home)


@pytest.mark.long
@pytest.mark.parametrize("most", [FINEST, PAINTED, TRIANGLES])
def test_large_meshes_are_drawn_by_few_triangles(most):
    """A ball keeps its size and nearly its volume."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5)
    small = simplified(Triangles(np.array(ball.vertices), np.array(ball.faces)), most)
    assert most / 5 < len(small.faces) <= most
    assert np.linalg.norm(small.vertices, axis=1) == pytest.approx(1, abs=1e-6)
    a, b, c = small.corners.swapaxes(0, 1)
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(4 / 3 * np.pi, rel=30 / most)


def test_pieces_of_one_file_are_read_once(tmp_path):
    vertices, faces = lump()
    file = str(write_stl(tmp_path / "x.stl", vertices, faces))
    one, other = (piece_of(lw.MeshFile(file=file)) for _ in range(2))
    assert one.mesh is other.mesh
