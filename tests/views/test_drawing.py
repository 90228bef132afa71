"""Pictures of mechanisms: points against the robot's own kinematics, hulls against geometry."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.views import plot_mechanism
from linkwork.views.skeleton import hull, skeleton
from linkwork.views.style import new_figure, svg


def test_the_two_sides_of_every_joint_meet(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42])
    for joint in skeleton(robot, state).joints:
        gap = joint.far - joint.near
        slid = state[joint.name] if joint.type == "prismatic" else 0.0
        np.testing.assert_allclose(gap, slid * joint.axis, atol=1e-12)


def test_points_are_those_of_the_papers_robot(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42])
    drawn = skeleton(robot, state)
    corners = drawn.bodies["platform"][:3]
    np.testing.assert_allclose(np.linalg.norm(corners[:, :2] - [0.52, 0.27], axis=1), 0.15, atol=1e-12)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, 0.15 * np.sqrt(3), atol=1e-12)
    for i in (1, 2, 3):
        ends = drawn.bodies[f"link_{i}"]
        assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_allclose(drawn.tools["centre"][0], [0.52, 0.27, 0], atol=1e-12)


def test_hulls_have_the_dimension_of_their_points():
    tilted = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) @ tilted
    inside = np.vstack([corners, corners.mean(axis=0)])
    faces = hull(inside)
    assert {tuple(np.round(point, 9)) for face in faces for point in face} == {tuple(np.round(p, 9)) for p in corners}
    square = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0.4, 0.4, 0), (0, 1, 0)], float) @ tilted
    (outline,) = hull(square)
    np.testing.assert_allclose(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1), 1.0)
    (line,) = hull(np.array([(0, 0, 0), (2, 2, 2), (1, 1, 1)], float))
    np.testing.assert_allclose(np.linalg.norm(line[0] - line[1]), np.sqrt(12))
    assert hull(np.ones((3, 3)))[0].shape == (1, 3)


def test_axes_are_equal_and_have_units(robot):
    axes = plot_mechanism(robot, robot.home, names=True)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    written = {name for text in axes.texts for name in text.get_text().split("\n")}
    assert set(robot.joints) <= written
    low, high = axes.dataLim.min, axes.dataLim.max
    points = skeleton(robot, robot.home).points[:, :2]
    assert (low <= points.min(axis=0)).all() and (points.max(axis=0) <= high).all()


def test_a_stack_is_drawn_pose_by_pose_with_the_last_in_full(robot):
    state = robot.assemble(tool=[[0.5, 0.29, 0.5], [0.51, 0.29, 0.5], [0.52, 0.29, 0.5]])
    plates = [patch for patch in plot_mechanism(robot, state).patches if len(patch.get_xy()) == 4]
    brightness = [sum(plate.get_facecolor()[:3]) for plate in plates]
    assert len(plates) == 3
    assert brightness == sorted(brightness, reverse=True)
    np.testing.assert_allclose(plates[-1].get_xy()[:3].mean(axis=0), [0.52, 0.29], atol=1e-9)


def test_a_spatial_robot_is_drawn_in_three_dimensions(spatial):
    axes = plot_mechanism(spatial, spatial.home, names=True)
    assert (axes.get_xlabel(), axes.get_zlabel()) == ("x [m]", "z [m]")
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    np.testing.assert_allclose(np.ptp(limits, axis=1) / axes._box_aspect, np.ptp(limits[0]) / axes._box_aspect[0])
    assert "wing_2" in svg(axes.figure)


def test_axes_and_stacks_that_do_not_fit_are_refused(robot, spatial):
    with pytest.raises(lw.LinkworkError, match="drawn in three dimensions"):
        plot_mechanism(spatial, spatial.home, new_figure(3, 3).add_subplot())
    with pytest.raises(lw.LinkworkError, match="drawn in two dimensions"):
        plot_mechanism(robot, robot.home, new_figure(3, 3).add_subplot(projection="3d"))
    stack = robot.state(np.broadcast_to(robot.home.positions, (2, 2, 9)))
    with pytest.raises(lw.LinkworkError, match="is no sequence of poses"):
        plot_mechanism(robot, stack)
