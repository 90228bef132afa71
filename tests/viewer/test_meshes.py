"""Meshes are closed, look outwards, and have the volume of what they show."""

import numpy as np
import pytest

from linkwork.mechanism import Capsule
from linkwork.scene import meshes
from linkwork.scene.meshes import BALL, BLOCK, POST, Mesh

FOUR = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])


def is_closed(mesh: Mesh) -> bool:
    """Tell whether each edge (by its ends' places) is passed as often in one direction as in the
    other."""
    corners = np.round(mesh.vertices, 9) + 0.0
    passed: dict[tuple, int] = {}
    for face in mesh.faces:
        a, b, c = (tuple(corners[k]) for k in face)
        for start, end in ((a, b), (b, c), (c, a)):
            passed[start, end] = passed.get((start, end), 0) + 1
            passed[end, start] = passed.get((end, start), 0) - 1
    return not any(count for (start, end), count in passed.items() if start != end)


def prism(sides: int) -> float:
    """Return the area of a regular polygon in the unit circle."""
    return sides / 2 * np.sin(2 * np.pi / sides)


@pytest.mark.parametrize(
    ("mesh", "volume", "within"),
    [
        (POST, prism(meshes.SIDES), 1e-12),
        (BALL, 4 / 3 * np.pi, 0.06),
        (BLOCK, 1.0, 1e-12),
        (meshes.piece_of(Capsule(radius=1.0, length=3.0)).mesh, (3 + 4 / 3) * np.pi, 0.03),
        (meshes.solid(FOUR), 1 / 6, 1e-12),
        (
            meshes.plate(
                np.array([(0, 0, 2), (3, 0, 2), (3, 1, 2), (0, 1, 2), (1, 0.5, 2.0)]), 0.1
            ),
            0.3,
            1e-12,
        ),
        (
            meshes.tube(np.array([(0, 0, 0), (0, 0, 1), (0, 0, 3.0)]), 0.1),
            3 * prism(meshes.TUBE_SIDES) * 0.01,
            1e-12,
        ),
        (
            meshes.coil(5, 0.2, 0.01),
            0.7 * np.hypot(2 * np.pi * 5 * 0.2 / 0.7, 1) * prism(8) * 1e-4,
            0.15,
        ),
    ],
)
def test_volume(mesh, volume, within):
    assert mesh.volume == pytest.approx(volume, rel=within)
    assert is_closed(mesh)


def test_a_moved_mesh_keeps_its_volume_and_its_points_move():
    R = meshes.frame_along(np.array([1.0, 2.0, -2.0]))
    moved = BLOCK.moved(np.array([1.0, 0, 0]), R)
    assert moved.volume == pytest.approx(1.0)
    assert moved.vertices.mean(axis=0) == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("axis", [(0, 0, 2), (0, 0, -1), (1, 0, 0), (1, -2, 3)])
def test_frame_along_is_a_rotation_with_z_along_the_axis(axis):
    axis = np.array(axis, float)
    R = meshes.frame_along(axis)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1)
    assert R[:, 2] == pytest.approx(axis / np.linalg.norm(axis))
