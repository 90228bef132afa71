"""Shapes of bodies: what is refused and where, and that they travel with their body and enter no
equation."""

from math import cos, pi, sin

import pytest

from linkwork.mechanism import (
    Body,
    Box,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    Polygon,
    RevoluteJoint,
    Sphere,
    Tool,
)
from linkwork.mechanism.numbers import edited, free_numbers

TEXT = """linkwork: 1
bodies:
  arm:
    mass: 1
    shapes:
      - {type: box, size: [1, 2, 3]}
      - type: cylinder
        radius: 0.1
        length: 1
      - {shape}
joints: {hinge: {type: revolute, connects: [ground, arm]}}
"""
CORNERS = "the corners are not those of a convex polygon in their order"
PENTAGRAM = [[cos(4 * pi * k / 5), sin(4 * pi * k / 5)] for k in range(5)]


def arm(**fields):
    return Mechanism(
        bodies={"arm": Body(mass=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0), **fields)},
        joints={"hinge": RevoluteJoint(connects=("ground", "arm"))},
        tools={"tip": Tool(body="arm", frame=Frame(position=(1.0, 0.0, 0.0)))},
    )


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        ("{type: sphere, radius: 0}", "radius: 0 is not above 0; expected radius [m]"),
        (
            "{type: box, size: [1, 2, -3]}",
            "size.2: -3 is not above 0; expected lengths along x, y and z [m]",
        ),
        ("{type: box, size: [1, 2]}", "size: give 3 numbers, not 2"),
        (
            "{type: ball, radius: 1}",
            "type: 'ball' is not a type; the types are box, cylinder, sphere, "
            "capsule, ellipsoid, polygon, mesh",
        ),
        (
            "{radius: 1}",
            "type: is missing; the types are box, cylinder, sphere, "
            "capsule, ellipsoid, polygon, mesh",
        ),
        (
            "{type: capsule, radius: 1}",
            "length: is missing; expected length along z between the middles",
        ),
        (
            "{type: sphere, radius: 1, mass: 2}",
            "mass: is not a known field; the fields here are type, frame, colour",
        ),
        (
            "{type: sphere, radius: 1, colour: [0, 0, 1.5]}",
            "colour.2: 1.5 is above 1; expected red, green and blue",
        ),
        (
            "{type: sphere, radius: 1, colour: red}",
            "colour: 'red' is not a list; expected red, green and blue",
        ),
        (
            "{type: polygon, points: [[0, 0], [1, 0]], thickness: 1}",
            "points: give 3 entries or more, not 2",
        ),
        (
            "{type: polygon, points: [[0, 0], [1, 0], [0, 1], [1, 1]], thickness: 1}",
            f"points: {CORNERS}",
        ),
        ("{type: polygon, points: [[0, 0], [1, 0], [2, 0]], thickness: 1}", f"points: {CORNERS}"),
        (
            "{type: polygon, points: [[0, 0], [2, 0], [0.5, 0.5], [0, 2]], thickness: 1}",
            f"points: {CORNERS}",
        ),
        (f"{{type: polygon, points: {PENTAGRAM}, thickness: 1}}", f"points: {CORNERS}"),
    ],
)
def test_refusals_name_line_and_shape(shape, sentence):
    with pytest.raises(MechanismError) as refusal:
        Mechanism.parse(TEXT.replace("{shape}", shape))
    assert str(refusal.value).startswith(f"line 10: bodies.arm.shapes.2.{sentence}")


def test_polygons_run_either_way():
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    assert Polygon(points=corners, thickness=1.0).points == corners
    assert Polygon(points=corners[::-1], thickness=1.0).points == corners[::-1]


@pytest.mark.parametrize(
    "path",
    ["arm.shapes.0.size.x", "arm.shapes.0.frame.position.0", "arm.shapes.0.frame.rotation.z"],
)
def test_numbers_of_shapes_cannot_be_free(path):
    mechanism = arm(shapes=(Box(size=(1.0, 1.0, 1.0)),))
    with pytest.raises(
        MechanismError, match=f"'{path}' enters no equation of motion and cannot be free"
    ):
        free_numbers(mechanism, [path])
    changed = edited(mechanism, {path: 0.5}).bodies["arm"].shapes[0]
    assert changed != mechanism.bodies["arm"].shapes[0]


def test_a_body_called_shapes_has_free_numbers():
    bodies = {"shapes": Body(mass=2.0)}
    joints = {"axis": RevoluteJoint(connects=("ground", "shapes"))}
    assert free_numbers(Mechanism(bodies=bodies, joints=joints), ["shapes.mass"]) == {
        "shapes.mass": 2.0
    }


def test_a_body_keeps_its_shapes_under_a_payload():
    ball = Sphere(radius=0.1)
    loaded = arm(shapes=(ball,)).with_payload(2.0)
    assert loaded.bodies["arm"].mass == 3.0
    assert loaded.bodies["arm"].shapes == (ball,)


def test_shapes_are_written_and_read_back():
    mechanism = Mechanism.parse(TEXT.replace("{shape}", "{type: sphere, radius: 0.5}"))
    assert "- {type: sphere, radius: 0.5}" in mechanism.text
    assert Mechanism.parse(mechanism.text).bodies["arm"].shapes == mechanism.bodies["arm"].shapes
