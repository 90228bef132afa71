"""Descriptions are checked once, and refusals are one sentence with place, value and what would be
right."""

import math

import numpy as np
import pytest

from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, MechanismError, RevoluteJoint
from linkwork.robots import prr3


def changed(path, value):
    """Return the 3-PRR's fields with one of them replaced."""
    fields = prr3().model_dump()
    *parents, last = path.split(".")
    place = fields
    for key in parents:
        place = place[key]
    place[last] = value
    return fields


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        (
            "bodies.link_1.mass",
            -0.5,
            "bodies.link_1.mass: -0.5 is below 0; expected mass [kg], zero or more",
        ),
        ("bodies.link_1.mass", math.nan, "bodies.link_1.mass: nan is not a finite number"),
        (
            "bodies.link_1.mass",
            "heavy",
            "bodies.link_1.mass: 'heavy' is not a number; expected mass",
        ),
        (
            "bodies.link_1.weight",
            1.0,
            "bodies.link_1.weight: is not a known field; the fields here are mass,",
        ),
        (
            "bodies.link_1.inertia",
            {"xx": 1.0, "yy": 1.0, "zz": 3.0},
            (
                "bodies.link_1.inertia: principal moments 1, 1, 3 kg m^2 violate the triangle "
                "inequality"
            ),
        ),
        (
            "bodies.link_1.inertia",
            {"xx": 1.0, "zz": 3.0},
            "bodies.link_1.inertia: give xx, yy and zz, or zz alone",
        ),
        (
            "bodies.link_1.inertia",
            {"zz": 3.0, "xy": 1.0},
            "bodies.link_1.inertia: xy, xz and yz need xx and yy too",
        ),
        (
            "bodies.extra",
            {"mass": 1.0},
            "bodies.extra: no chain of joints connects it to ground; add a joint",
        ),
        (
            "bodies.ground",
            {"mass": 1.0},
            "bodies.ground: 'ground' is the fixed frame and cannot be described",
        ),
        (
            "joints.slide_1.axis",
            (0, 0, 0),
            "joints.slide_1.axis: axis [0.0, 0.0, 0.0] has no length; give a direction",
        ),
        (
            "joints.slide_1.axis",
            (0, 1),
            "joints.slide_1.axis: give 3 numbers, not 2; expected unit axis",
        ),
        (
            "joints.slide_1.type",
            "slider",
            (
                "joints.slide_1.type: 'slider' is not a type; the types are fixed, revolute, "
                "prismatic, screw,"
            ),
        ),
        (
            "joints.slide_1.connects",
            ("ground", "cart"),
            "joints.slide_1.connects: there is no body 'cart'; the body names",
        ),
        (
            "joints.slide_1.connects",
            ("link_1", "link_1"),
            "joints.slide_1: connects 'link_1' to itself; name two bodies",
        ),
        (
            "actuators",
            ("motor",),
            "actuators: there is no joint 'motor'; the joint names are slide_1",
        ),
        ("actuators", ("slide_1", "slide_1"), "actuators: 'slide_1' is named twice"),
        (
            "tools.centre.body",
            "hand",
            "tools.centre.body: there is no body 'hand'; the body names are slider_1",
        ),
        (
            "reference.elbow",
            0.1,
            "reference: there is no joint 'elbow'; the joint names are slide_1",
        ),
        ("name", "a.b", None),
    ],
)
def test_refusals(path, value, sentence):
    fields = changed(path, value)
    if sentence is None:
        Mechanism(**fields)
        return
    with pytest.raises(MechanismError) as refusal:
        Mechanism(**fields)
    assert str(refusal.value).startswith(sentence), str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["", " ", "a.b", " a", "a\nb"])
def test_names_are_printable_and_without_dots(name):
    fields = prr3().model_dump()
    fields["bodies"][name] = {"mass": 1.0}
    with pytest.raises(MechanismError, match="cannot be a name"):
        Mechanism(**fields)


def test_robot_functions_name_the_bad_argument():
    with pytest.raises(MechanismError, match="mass: -2"):
        prr3(link_mass=-2)
    with pytest.raises(MechanismError, match="l1 must exceed"):
        prr3(l1=0.1)


def test_data_are_frozen():
    mechanism = prr3()
    with pytest.raises(ValueError, match="frozen"):
        mechanism.name = "other"  # pyright: ignore[reportAttributeAccessIssue]


def test_axes_are_normalised():
    assert RevoluteJoint(connects=("ground", "a"), axis=(0, 3, 4)).axis == (0, 0.6, 0.8)


def test_inertia_of_a_plate_meets_the_triangle_inequality_with_equality():
    Inertia(xx=1.0, yy=2.0, zz=3.0)
    assert Body(mass=1).inertia.tensor().tolist() == np.zeros((3, 3)).tolist()


def test_rpy_and_quaternion_give_the_same_frame():
    roll, pitch, yaw = 0.3, -0.7, 1.9
    frame = Frame.from_rpy((1, 2, 3), roll, pitch, yaw)

    def about(axis, angle):
        return rotation_matrix(angle * np.eye(3)[axis])

    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    assert np.allclose(rotation_matrix(frame.rotation), expected, atol=1e-14)
    half = 0.5 * np.linalg.norm(frame.rotation)
    vector = np.sin(half) * np.array(frame.rotation) / np.linalg.norm(frame.rotation)
    again = Frame.from_quaternion((1, 2, 3), (np.cos(half), *vector))
    assert np.allclose(again.rotation, frame.rotation, atol=1e-14)


def test_quaternion_of_zero_length_is_refused():
    with pytest.raises(MechanismError, match="has no length"):
        Frame.from_quaternion((0, 0, 0), (0, 0, 0, 0))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: Frame(position=(0, 1e200, 0)),
            r"position\.1: 1e\+200 is above 1e\+50; expected p_BF",
        ),
        (
            lambda: Frame(rotation=(-1e200, 0, 0)),
            r"rotation\.0: -1e\+200 is below -1e\+50; expected rotation vector",
        ),
        (lambda: Body(mass=1e308), r"mass: 1e\+308 is above 1e\+50; expected mass \[kg\]"),
        (lambda: Inertia(zz=1e155), r"zz: 1e\+155 is above 1e\+50; expected moment of inertia"),
    ],
)
def test_numbers_whose_moments_of_inertia_are_not_finite_are_refused(make, words):
    with pytest.raises(MechanismError, match=words):
        make()
