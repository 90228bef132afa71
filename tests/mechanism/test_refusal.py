"""Wrong values are refused in plain words, whether they come from a file or from code."""

import pytest

from linkwork.mechanism import (
    Body,
    CylindricalJoint,
    Mechanism,
    MechanismError,
    PointSpring,
    RevoluteJoint,
)

ENDS = {"connects": ("ground", "a")}


@pytest.mark.parametrize(
    ("make", "fields", "sentence"),
    [
        (Body, {}, "mass: is missing; expected mass [kg], zero or more"),
        (Body, {"mass": None}, "mass: is empty; expected mass [kg], zero or more"),
        (
            Body,
            {"mass": [1.0] * 99},
            "mass: a list is not a number; expected mass [kg], zero or more",
        ),
        (
            Body,
            {"mass": "1" * 99 + "x"},
            f"mass: '{'1' * 55} ... is not a number; expected mass [kg], zero or more",
        ),
        (
            Body,
            {"mas": 1.0},
            "mas: is not a known field (did you mean mass?); the fields here are mass, centre_of",
        ),
        (Body, {"Mass": 1.0}, "Mass: is not a known field (did you mean mass?)"),
        (Body, {"self": 1.0}, "self: is not a known field; the fields here are mass"),
        (
            Body,
            {"mass": 1, "inertia": 2},
            "inertia: 2 is not a mapping of fields; give the fields zz, xx, yy, xy",
        ),
        (
            Body,
            {"mass": 1, "centre_of_mass": {"x": 1}},
            "centre_of_mass: {'x': 1} is not a list; expected mass centre",
        ),
        (
            RevoluteJoint,
            {"connects": ("a",)},
            "connects: give 2 names, not 1; expected names of the first and the",
        ),
        (
            RevoluteJoint,
            {"connects": ()},
            "connects: give 2 entries, not 0; expected names of the first and the",
        ),
        (
            RevoluteJoint,
            {"connects": ("a", 1)},
            "connects.1: 1 is not text; put it in quotes to use it as a name: '1'",
        ),
        (
            RevoluteJoint,
            {"connects": ("a", ["b"])},
            "connects.1: ['b'] is not text; expected names of the first and",
        ),
        (RevoluteJoint, ENDS | {"axis": ()}, "axis: give 3 entries, not 0; expected unit axis"),
        (
            RevoluteJoint,
            ENDS | {"axis": (1, 0, 0, 0)},
            "axis: give 3 numbers, not 4; expected unit axis",
        ),
        (
            RevoluteJoint,
            ENDS | {"frames": [{"position": [1, "x", 2]}, {}]},
            "frames.0.position.1: 'x' is not a number",
        ),
        (
            RevoluteJoint,
            ENDS | {"frames": [{}, {"position": [1]}]},
            "frames.1.position: give 3 numbers, not 1",
        ),
        (
            RevoluteJoint,
            ENDS | {"type": "fixed"},
            "type: 'fixed' is not accepted: input should be 'revolute'",
        ),
        (
            RevoluteJoint,
            ENDS | {"friction": {"coulomb_rate": 0}},
            "friction.coulomb_rate: 0 is not above 0; expected",
        ),
        (
            CylindricalJoint,
            ENDS | {"rotor_inertia": 1},
            "rotor_inertia: 1 is not a mapping from names to values; exp",
        ),
        (
            CylindricalJoint,
            ENDS | {"spring": {"angel": {}}},
            "spring: there is no freedom 'angel'; the freedoms of a",
        ),
        (
            PointSpring,
            {"connects": ("a", "b"), "points": [[0, 0, 0], [0]]},
            "points.1: give 3 numbers, not 1",
        ),
        (
            PointSpring,
            {"connects": ("a", "b"), "points": [[0, 0, 0]]},
            "points: give 2 entries, not 1; expected a poin",
        ),
        (
            RevoluteJoint,
            {"connects": ("a", "b"), "frames": [[0.3, 0, 0], {}]},
            "frames.0: [0.3, 0, 0] is not a mapping of fields; give the fields position, rotation",
        ),
    ],
)
def test_of_a_part(make, fields, sentence):
    with pytest.raises(MechanismError) as refusal:
        make(**fields)
    assert str(refusal.value).startswith(sentence), str(refusal.value)


@pytest.mark.parametrize(
    ("word", "here"),
    [
        ("hinge", "revolute"),
        ("slider", "prismatic"),
        ("Ball", "spherical"),
        ("cardan", "universal"),
    ],
)
def test_types_are_told_by_what_others_call_them(word, here):
    with pytest.raises(MechanismError, match=rf"gear; what others call {word} is {here} here$"):
        Mechanism(bodies={"a": {"mass": 1}}, joints={"j": {"type": word}})


@pytest.mark.parametrize(
    ("joint", "sentence"),
    [
        (3, "joints.j: 3 is not a mapping of fields; give a type and its fields"),
        (None, "joints.j: is empty; give a type and its fields"),
        (
            {},
            (
                "joints.j.type: is missing; the types are fixed, revolute, prismatic, screw, "
                "cylindrical, universal,"
            ),
        ),
        (Body(mass=1), "joints.j.type: is missing; the types are fixed"),
        ({"type": None}, "joints.j.type: is missing; the types are fixed"),
        ({"type": [1]}, "joints.j.type: [1] is not a type; the types are fixed"),
        (
            {"type": "sferical"},
            "joints.j.type: 'sferical' is not a type (did you mean spherical?); the types are",
        ),
        (
            {"type": "revolute"},
            "joints.j.connects: is missing; expected names of the first and the second body",
        ),
        (
            {"type": "rod", **ENDS, "axis": 1},
            "joints.j.axis: is not a known field; the fields here are type, connects",
        ),
    ],
)
def test_of_a_joint_named_like_anything(joint, sentence):
    for name in ("j", "type", "revolute", "[key]"):
        with pytest.raises(MechanismError) as refusal:
            Mechanism(bodies={"a": {"mass": 1.0}}, joints={name: joint})
        assert str(refusal.value).startswith(sentence.replace("joints.j", f"joints.{name}")), str(
            refusal.value
        )


def test_parts_of_a_refusal():
    with pytest.raises(MechanismError) as refusal:
        Mechanism(bodies={"a": {"mass": -1.0}}, joints={})
    assert refusal.value.where == ("bodies", "a", "mass")
    assert refusal.value.what == "-1.0 is below 0; expected mass [kg], zero or more"
    assert refusal.value.place == ""


def test_a_name_that_cannot_be_printed_stays_on_one_line():
    with pytest.raises(MechanismError) as refusal:
        Mechanism(bodies={"a\nb": {"mass": -1.0}}, joints={})
    assert "\n" not in str(refusal.value)
