"""Shapes as faces: their volumes, how they are seen and lit, and that pictures show them where
their bodies are."""

from math import pi

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import linkwork as lw
from linkwork.mechanism import Body, Box, Capsule, Cylinder, Frame, Inertia, Polygon, Sphere
from linkwork.scene.colours import LINK
from linkwork.scene.meshes import brightness, piece_of
from linkwork.scene.skeleton import skeleton
from linkwork.views import plot_mechanism

RED = (0.75, 0.25, 0.25)
PLACED = Frame(position=(0.3, -0.2, 0.5), rotation=(0.3, 0.7, -0.4))
SHAPES = {  # volume, area seen along z, largest part by which facets may be less
    "box": (Box(size=(0.1, 0.2, 0.4), frame=PLACED, colour=RED), 0.008, 0.02, 1e-12),
    "cylinder": (Cylinder(radius=0.2, length=0.5, frame=PLACED), pi * 0.04 * 0.5, pi * 0.04, 0.012),
    "sphere": (Sphere(radius=0.3, frame=PLACED), 4 / 3 * pi * 0.027, pi * 0.09, 0.04),
    "capsule": (
        Capsule(radius=0.3, length=0.2, frame=PLACED),
        pi * 0.09 * 0.2 + 4 / 3 * pi * 0.027,
        pi * 0.09,
        0.03,
    ),
    "polygon": (
        Polygon(points=((0, 0), (0, 1), (2, 1), (2, 0)), thickness=0.1, frame=PLACED),
        0.2,
        2.0,
        1e-12,
    ),
}


def area(polygon):
    x, y = polygon[:, :2].T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def pendulum(*shapes, planar=False):
    inertia = Inertia(zz=0.1) if planar else Inertia(xx=0.1, yy=0.1, zz=0.1)
    arm = Body(mass=1.0, centre_of_mass=(0.5, 0.0, 0.0), inertia=inertia, shapes=shapes)
    axis = (0.0, 0.0, 1.0) if planar else (1.0, 1.0, 1.0)
    joints = {"hinge": lw.RevoluteJoint(connects=("ground", "arm"), axis=axis)}
    return lw.Robot(lw.Mechanism(bodies={"arm": arm}, joints=joints))


@pytest.mark.parametrize("kind", SHAPES)
def test_faces_enclose_the_shape(kind):
    shape, volume, shadow, less = SHAPES[kind]
    solid = piece_of(shape)
    around = ConvexHull(solid.corners)
    assert volume * (1 - less) <= around.volume <= volume * (1 + 1e-12)
    assert sum(map(face_area, solid.faces)) == pytest.approx(around.area, rel=1e-9)
    assert shadow * (1 - less) <= area(solid.shadow) <= shadow * (1 + 1e-12)


def face_area(face):
    """Return the area of a plane polygon in space."""
    crosses = sum(
        (np.cross(a, b) for a, b in zip(face, np.roll(face, -1, axis=0), strict=True)), np.zeros(3)
    )
    return np.linalg.norm(crosses) / 2


def test_faces_are_bright_where_they_look_to_the_light():
    for kind, expected in {"box": [0, 0, 0, 0, 0, 1], "polygon": [0, 1, 0, 0, 0, 0]}.items():
        solid = piece_of(SHAPES[kind][0])
        lit = brightness(solid.faces, np.array([0.0, 0.0, 1.0]))
        assert sorted(lit) == pytest.approx(sorted(expected), abs=1e-12)
        top = solid.faces[int(np.argmax(lit))]
        assert (top[:, 2] == solid.corners[:, 2].max()).all()


def test_a_picture_in_space_shows_every_shape_where_its_body_is():
    shapes = [shape for shape, *_ in SHAPES.values()]
    robot = pendulum(*shapes)
    state = robot.state([0.7])
    _, *drawn = plot_mechanism(robot, state).collections  # the first is the stand on ground
    p, R = robot.body_poses(state)["arm"]
    solids = skeleton(robot, state).solids["arm"]
    for shape, solid, collection in zip(shapes, solids, drawn[: len(shapes)], strict=True):
        middle = p + R @ shape.frame.position
        assert len(collection.get_facecolor()) == len(solid.faces)
        if shape.type != "polygon":
            np.testing.assert_allclose(solid.corners.mean(axis=0), middle, atol=1e-12)
    red, grey = drawn[0].get_facecolor(), drawn[2].get_facecolor()
    assert (red[:, 0] > 2 * red[:, 1]).all() and np.ptp(
        red[:, 0]
    ) > 0.05  # of its colour, and shaded
    assert np.ptp(grey[:, 0]) > 0.05


def test_a_picture_in_the_plane_shows_outlines_instead_of_bars():
    from matplotlib.colors import to_hex

    plate = Polygon(points=((0, 0), (0.6, -0.1), (0.6, 0.1)), thickness=0.01, colour=RED)
    robot = pendulum(plate, Sphere(radius=0.1), planar=True)
    axes = plot_mechanism(robot, robot.state([pi / 2]))
    triangle, disc = axes.patches
    assert triangle.get_facecolor()[:3] == pytest.approx(RED)
    assert to_hex(disc.get_facecolor()) == LINK
    corners = {tuple(corner) for corner in np.round(triangle.get_xy()[:3], 9)}
    assert corners == {(0, 0), (0.1, 0.6), (-0.1, 0.6)}
    bare = plot_mechanism(pendulum(planar=True), robot.state([pi / 2]))
    assert not any(line.get_linewidth() > 4 for line in axes.lines)
    assert any(line.get_linewidth() > 4 for line in bare.lines)


def test_nothing_of_a_shape_is_cut_off():
    robot = pendulum(Box(size=(4.0, 1.0, 1.0)))
    axes = plot_mechanism(robot, robot.home)
    low, high = axes.get_xlim()
    assert low <= -2 and high >= 2
