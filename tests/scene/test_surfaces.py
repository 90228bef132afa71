"""Surfaces of contacts in pictures: planes and fields where bodies come to lie on them, and what
touches them."""

from math import pi

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import Box
from linkwork.scene.fixtures import fixtures_of
from linkwork.scene.meshes import BALL, PlacedMesh
from linkwork.scene.parts import Bar, Hull, corners
from linkwork.scene.scene import scene_of
from linkwork.views import plot_mechanism
from linkwork.views.film import film

HEIGHTS = tuple(tuple(0.1 * np.sin(0.3 * i) * np.cos(0.2 * j) for j in range(9)) for i in range(12))
SLOPE = lw.Frame(position=(0.3, -0.2, 0.1), rotation=(0.4, -0.3, 0.2))
UPRIGHT = lw.Frame(position=(-0.4, -0.5, 0.6), rotation=(-pi / 2, 0, 0))  # z along y of the plane


def falling(*surfaces, planar=False, **body) -> lw.Robot:
    """Return a body that moves freely, with contacts of these surfaces of the ground and own
    ones."""
    free = (lw.PlanarJoint if planar else lw.FreeJoint)(connects=("ground", "stone"))
    contacts = {
        f"contact_{k}": lw.Contact(connects=("ground", "stone"), surfaces=pair, stiffness=1e5)
        for k, pair in enumerate(surfaces)
    }
    stone = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1), **body)
    return lw.Robot(lw.Mechanism(bodies={"stone": stone}, joints={"free": free}, contacts=contacts))


def along(robot: lw.Robot) -> lw.State:
    """Return three states in which the stone is moved and turned."""
    q = np.repeat(robot.home.q[None], 3, axis=0)
    q[:, 0], q[:, 1] = [0.0, 0.7, 1.5], [0.2, 0.9, 0.4]
    return robot.state(q)


def test_a_plane_is_one_sheet_below_all_that_moves_over_it():
    feet = lw.Sphere(radius=0.1), lw.Points(points=((0.4, 0, -0.2),))
    robot = falling(*((lw.Plane(frame=SLOPE), foot) for foot in feet))
    states = along(robot)
    scene = scene_of(robot, states.at(0), states)
    (floor,) = [part for part in scene.parts if part.role == "floor"]
    assert floor.name == "contact_0" and floor.bodies == ("ground",)
    assert isinstance(floor.form, Hull) and len(floor.form.points) == 4

    # In the plane's own axes: as high as the plane, and farther than any centre of the stone.
    turn = rotation_matrix(SLOPE.orientation)
    own = (floor.form.points - SLOPE.position) @ turn
    assert np.abs(own[:, 2]).max() < 1e-12
    centres = (states.q[:, :3] - SLOPE.position) @ turn
    for k in range(2):
        assert own[:, k].min() < centres[:, k].min() - 0.1
        assert own[:, k].max() > centres[:, k].max() + 0.1


def test_a_plane_far_below_makes_no_picture_small():
    """A ball of 0.2 m, dropped from so many of its sizes; it may be led anywhere."""
    for sizes, drawn in ((4, 1), (6, 0)):
        plane = lw.Plane(frame=lw.Frame(position=(0, 0, -0.2 * sizes)))
        robot = falling((plane, lw.Sphere(radius=0.1)))
        shown, led = scene_of(robot, robot.home, robot.home), scene_of(robot, robot.home)
        assert [part.role for part in shown.parts].count("floor") == drawn
        assert [part.role for part in led.parts].count("floor") == 1


def test_a_field_is_drawn_by_its_heights_where_bodies_are():
    field = lw.HeightField(frame=SLOPE, heights=HEIGHTS, spacing=(0.5, 0.4))
    robot = falling((field, lw.Sphere(radius=0.1)))
    (floor,) = [p for p in scene_of(robot, robot.home, robot.home).parts if p.role == "floor"]
    assert isinstance(floor.form, PlacedMesh) and not floor.form.mesh.convex
    own = (corners(floor) - SLOPE.position) @ rotation_matrix(SLOPE.orientation)
    places = np.rint(own[:, :2] / field.spacing).astype(int)
    assert np.allclose(own[:, :2], places * field.spacing, atol=1e-12)
    assert np.allclose(own[:, 2], np.array(HEIGHTS)[tuple(places.T)], atol=1e-12)
    assert 4 <= len(own) < np.size(HEIGHTS)
    # Seen from above, its triangles run counter-clockwise.
    a, b, c = own[floor.form.mesh.faces].swapaxes(0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize("shapes", [(), (Box(size=(0.2, 0.2, 0.2)),)])
def test_what_touches_is_drawn_unless_the_body_has_shapes(shapes):
    feet = lw.Points(points=((0.1, 0, 0), (-0.1, 0, 0)), radius=0.03)
    step = Box(frame=lw.Frame(position=(0.5, 0, 0)), size=(0.3, 0.3, 0.1))
    robot = falling((lw.Plane(), feet), (step, lw.Sphere(radius=0.05)), shapes=shapes)
    parts = [p for p in scene_of(robot, robot.home, robot.home).parts if p.role == "member"]
    balls = [corners(p) for p in parts if p.bodies == ("stone",) and p.form.mesh is BALL]
    radii = sorted(float(np.ptp(ball, axis=0).max()) / 2 for ball in balls)
    assert radii == ([] if shapes else pytest.approx([0.03, 0.03, 0.05]))
    (edges,) = [corners(p) for p in parts if p.bodies == ("ground",)]
    assert np.allclose(np.ptp(edges, axis=0), step.size)
    assert np.allclose(edges.mean(axis=0), step.frame.position)


def test_in_the_plane_surfaces_are_the_lines_in_which_they_cut_it():
    rows = tuple((0.1 * np.sin(0.5 * i), 0.1 * np.sin(0.5 * i) + 0.4) for i in range(9))
    field = lw.HeightField(frame=UPRIGHT, heights=rows, spacing=(0.1, 1.2))
    plane = lw.Plane(frame=lw.Frame(position=(0, -0.3, 0), rotation=(-pi / 2, 0, 0)))
    feet = lw.Points(points=((-0.2, -0.1, 0), (0.2, -0.1, 0)))
    robot = falling((field, feet), (plane, feet), planar=True)
    lines = {
        part.name: part.form.points
        for part in scene_of(robot, robot.home, robot.home).parts
        if part.role == "floor" and isinstance(part.form, Bar)
    }
    # Halfway between the rows; what is solid lies to the right.
    x, y, z = lines["contact_0"].T
    assert np.abs(z).max() < 1e-12 and (np.diff(x) > 0).all()
    told = 0.1 * np.sin(5 * (x - UPRIGHT.position[0])) + 0.2 + UPRIGHT.position[1]
    assert np.allclose(y, told, atol=1e-12)
    (left, right), heights = lines["contact_1"][:, 0], lines["contact_1"][:, 1]
    assert left < -0.2 and right > 0.2 and np.allclose(heights, -0.3)


@pytest.mark.parametrize("planar", [False, True])
def test_all_painters_draw_them(planar):
    frame = UPRIGHT if planar else lw.Frame(position=(-1, -1, -0.5))
    field = lw.HeightField(frame=frame, heights=HEIGHTS, spacing=(0.3, 0.3))
    robot = falling((field, lw.Points(points=((0.1, -0.1, 0),))), planar=planar)
    bare = lw.Robot(robot.mechanism.model_copy(update={"contacts": {}}))
    states = along(robot)
    made = {}
    for name, own in (("with", robot), ("bare", bare)):
        axes = plot_mechanism(own, own.state(states.q))
        drawn = len(axes.collections) + len(axes.lines) + len(axes.patches)
        strip = film(own, np.arange(3.0), own.state(states.q))
        made[name] = drawn, len(strip.parts) + len(strip.fixed), len(fixtures_of(own).parts)
        assert np.isfinite(strip.reach).all()
    assert all(more > less for more, less in zip(made["with"], made["bare"], strict=True))
    assert fixtures_of(robot).parts[0].role == "floor"
