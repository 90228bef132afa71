"""Simple shapes, against geometry."""

import numpy as np
import pytest

from linkwork.scene.curves import across, arc, helix, hull, zigzag
from linkwork.scene.meshes import frame_along, turned


def test_hulls_have_the_dimension_of_their_points():
    tilted = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) @ tilted
    inside = np.vstack([corners, corners.mean(axis=0)])
    faces = hull(inside)
    assert {tuple(np.round(point, 9)) for face in faces for point in face} == {
        tuple(np.round(p, 9)) for p in corners
    }
    square = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0.4, 0.4, 0), (0, 1, 0)], float) @ tilted
    (outline,) = hull(square)
    np.testing.assert_allclose(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1), 1.0)
    (line,) = hull(np.array([(0, 0, 0), (2, 2, 2), (1, 1, 1)], float))
    np.testing.assert_allclose(np.linalg.norm(line[0] - line[1]), np.sqrt(12))
    assert hull(np.ones((3, 3)))[0].shape == (1, 3)


def test_an_arc_keeps_its_distance_and_divides_its_angle_evenly():
    points = arc(np.ones(3), np.array([3.0, 1, 1]), np.array([1.0, 1, 3])) - 1
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 2.0)
    steps = points[1:, None] @ points[:-1, :, None] / 4
    np.testing.assert_allclose(np.arccos(steps).ravel(), np.pi / 2 / (len(points) - 1))
    np.testing.assert_allclose(
        arc(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 3.0, 0]))[6] @ (1, 1, 0),
        2 * np.sqrt(2),
    )


@pytest.mark.parametrize("end", [(1.0, 0, 0), (-1.0, 0, 0), (0.0, 0, 0)])
def test_an_arc_without_an_angle_of_its_own_is_a_line(end):
    assert len(arc(np.zeros(3), np.array([1.0, 0, 0]), np.array(end))) == 2


def test_directions_across_an_axis_are_perpendicular():
    for axis in np.vstack([np.eye(3), -np.eye(3), np.ones((1, 3)) / np.sqrt(3)]):
        np.testing.assert_allclose(
            np.array([*across(axis), axis]) @ np.array([*across(axis), axis]).T,
            np.eye(3),
            atol=1e-12,
        )
        assert across(axis)[0][2] == 0


def test_a_spring_runs_from_end_to_end_and_to_both_sides():
    points = zigzag(np.zeros(3), np.array([2.0, 0, 0]), 0.1, np.array([0, 5.0, 0]))
    np.testing.assert_allclose(points[[0, -1]], [(0, 0, 0), (2, 0, 0)])
    assert (np.diff(points[:, 0]) > 0).all()
    assert (points[:, 1].min(), points[:, 1].max()) == pytest.approx((-0.05, 0.05))
    assert len(zigzag(np.zeros(3), np.zeros(3), 0.1, np.zeros(3))) == 2


def test_a_prism_and_a_thread_stand_about_their_axis():
    axis, centre = np.array([2.0, 3, 6]) / 7, np.array([1.0, 2, 3])
    prism = turned(np.array([(0.5, -1.0), (0.5, 1.0)]), 12).moved(centre, frame_along(axis))
    wall, (low, high) = prism.vertices[prism.facets], (prism.vertices[end] for end in prism.flat)
    for end, side in ((low, -1), (high, 1)):
        np.testing.assert_allclose((end - centre) @ axis, side)
        np.testing.assert_allclose(np.linalg.norm(np.cross(end - centre, axis), axis=1), 0.5)
    assert wall.shape == (12, 4, 3)
    np.testing.assert_allclose(
        np.linalg.norm(wall[:, 1] - wall[:, 0], axis=1), 2 * 0.5 * np.sin(np.pi / 12)
    )
    thread = helix(centre, axis, 0.5, 2.0) - centre
    np.testing.assert_allclose(thread[[0, -1]] @ axis, (-1, 1))
    np.testing.assert_allclose(np.linalg.norm(np.cross(thread, axis), axis=1), 0.5)
