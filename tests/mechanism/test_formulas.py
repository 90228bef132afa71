"""Named quantities and formulas: worked out by few rules, kept when written, freed as one number,
refused in one sentence."""

from __future__ import annotations

import math

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import derive, functions
from linkwork.mechanism.formulas import value_of
from linkwork.mechanism.numbers import edited, free_numbers
from linkwork.mechanism.parameter_units import unit_of_parameter
from linkwork.mechanism.record import swapped

from tests.equations.evaluation import close, values

TEXT = """
linkwork: 1
name: let
let: {rod: 0.3, half: rod/2, lean: 30 deg, tilt: 0, m: 2}
gravity: [0, -9.81, 0]
bodies:
  a: {mass: m, centre_of_mass: [half, 0, 0], inertia: {zz: m*rod**2/12}}
  b:
    mass: 1
    centre_of_mass: [half, sin(lean)/10, 0]
    inertia: {zz: 0.01}
    shapes: [{type: sphere, radius: rod/10}]
joints:
  j:
    {type: revolute, connects: [ground, a],
     frames: [{rotation: [0, 0, lean + 15 deg]}, {turn: [0, 0, tilt]}]}
  k:
    {type: revolute, connects: [a, b],
     frames: [{position: [rod, 0, 0]}, {}], limits: {upper: 90 deg}}
actuators: [j]
tools: {tip: {body: b, frame: {position: [rod, 0, 0]}}}
reference: {j: 10 deg, k: 0.2}
"""


def test_numbers_follow_from_quantities():
    mechanism = lw.Mechanism.parse(TEXT)
    assert dict(mechanism.let) == {
        "rod": 0.3,
        "half": 0.15,
        "lean": math.pi / 6,
        "tilt": 0.0,
        "m": 2.0,
    }
    assert mechanism.bodies["a"].inertia.zz == 2 * 0.3**2 / 12
    assert mechanism.pairs["j"].frames[0].rotation[2] == math.pi / 6 + math.pi / 12
    assert mechanism.reference["j"] == math.radians(10)


def test_what_is_written_gives_the_mechanism_back_to_the_bit(tmp_path):
    mechanism = lw.Mechanism.parse(TEXT)
    mechanism.save(tmp_path / "x.yaml")
    found = lw.Mechanism.load(tmp_path / "x.yaml")
    assert found == mechanism
    for part in (
        "half: rod/2",
        "lean + 15 deg",
        "turn: [0.0, 0.0, tilt]",
        "radius: rod/10",
        "90 deg",
    ):
        assert part in found.text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2/30 deg", 2 / (30 * (math.pi / 180))),
        ("-a**2", -4.0),
        ("(a + b)/2 - 1e-3*b", 2.5 - 3e-3),
        ("atan2(-a, b)", math.atan2(-2.0, 3.0)),
        ("sqrt(a**2 + b**2)", math.sqrt(13.0)),
        (".5 deg", 0.5 * (math.pi / 180)),
        ("90 deg/a", math.pi / 4),
        ("cos(pi)", -1.0),
    ],
)
def test_values(text, value):
    assert value_of(text, {"a": 2.0, "b": 3.0}) == pytest.approx(value, rel=1e-15)


def test_a_freed_quantity_is_one_number_in_all_that_it_bears():
    mechanism = lw.Mechanism.parse(TEXT)
    paths = ["rod", "let.lean", "m", "tilt"]
    given = dict(zip(paths, (0.37, 0.6, 2.5, 0.1), strict=True))
    assert free_numbers(mechanism, paths)["rod"] == 0.3
    free, plain = derive(mechanism, free=paths), derive(edited(mechanism, given))
    q, v, u, p = plain.reference, np.array([0.3, -0.2]), np.array([1.0]), list(given.values())
    for name, arguments in {"motion": (q, v, u), "energy": (q, v), "bodies_motion": (q, v)}.items():
        expected = values(getattr(functions, name)(plain), *arguments)
        found = values(getattr(functions, name)(free), *arguments, p)
        for output in expected.keys() - {"pivot"}:
            close(found[output], expected[output], 1e-12)


def test_other_values_are_saved_with_their_formulas():
    free = lw.Robot(lw.Mechanism.parse(TEXT)).free("rod", "lean")
    other = free.with_parameters({"rod": 0.4})
    assert getattr(other.mechanism.bodies["b"].shapes[0], "radius", None) == 0.4 / 10
    assert "half: rod/2" in other.mechanism.text and "lean: 30 deg" in other.mechanism.text
    again = lw.Mechanism.parse(other.mechanism.text)
    assert again == other.mechanism
    close(lw.Robot(again).tool_pose(lw.Robot(again).home), other.tool_pose(other.home), 1e-12)
    turned = free.with_parameters({"lean": 0.5}).mechanism
    assert "lean: 0.5" in turned.text and lw.Mechanism.parse(turned.text) == turned


def test_units_of_quantities():
    mechanism = lw.Mechanism.parse(TEXT)
    units = {name: unit_of_parameter(mechanism, name) for name in mechanism.let}
    assert units == {"rod": "m", "half": "m", "lean": "rad", "tilt": "rad", "m": "kg"}


def test_a_payload_is_written_as_the_number_that_it_makes():
    loaded = lw.Mechanism.parse(TEXT).with_payload(1.0)
    assert lw.Mechanism.parse(loaded.text) == loaded
    assert "mass: m" in loaded.text and "radius: rod/10" in loaded.text


def test_a_number_that_a_formula_no_longer_gives():
    mechanism = lw.Mechanism.parse(TEXT)
    heavy = mechanism.bodies["a"].model_copy(update={"mass": 9.0})
    changed = swapped(mechanism, bodies={**mechanism.bodies, "a": heavy})
    assert "mass: 9.0" in changed.text
    with pytest.raises(
        lw.MechanismError, match=r"'let.m' bears on bodies.a.mass by 'm', but another"
    ):
        lw.Robot(changed).free("m")
    with pytest.raises(lw.MechanismError, match="the formula 'm' does not give the number"):
        lw.Mechanism(**changed.model_dump())


def test_quantities_are_named_in_code():
    plain = lw.robots.four_bar()
    named = plain.with_quantities(
        {"crank": 0.5, "half": "crank/2"},
        {"crank_pin.frames.0.position.x": "crank", "crank.com.x": "half"},
    )
    assert named.bodies == plain.bodies and named.joints == plain.joints
    free = lw.Robot(named).free("let.crank")
    longer = free.with_parameters({"let.crank": 0.51})
    assert longer.mechanism.bodies["crank"].centre_of_mass[0] == 0.51 / 2
    with pytest.raises(lw.MechanismError, match="'nil' asks for 'nil'"):
        plain.with_quantities({"a": 1.0}, {"gravity.y": "nil"})


REFUSALS = {
    "an unknown name": (
        "half: rod/2",
        "half: rodd/2",
        "line 4: let.half: 'rodd/2' asks for 'rodd', which is no named quantity (did you mean rod",
    ),
    "a circle": (
        "rod: 0.3, half: rod/2",
        "rod: half*2, half: rod/2",
        "line 4: let.rod: follows from itself: rod -> half -> rod",
    ),
    "itself": ("m: 2}", "m: m}", "let.m: follows from itself: m -> m"),
    "a division by zero": ("half: rod/2", "half: rod/tilt", "let.half: 'rod/tilt' divides by zero"),
    "an angle for a mass": (
        "mass: m,",
        "mass: 30 deg,",
        "line 7: bodies.a.mass: '30 deg' is an angle, and a number in kg stands here",
    ),
    "two units": (
        "mass: m,",
        "mass: rod,",
        "let.rod: is in m in bodies.a.centre_of_mass.0 and in kg in bodies.a.mass",
    ),
    "code": ("half: rod/2", "half: __import__('os')", "is no formula: it holds other signs"),
    "an attribute": (
        "half: rod/2",
        "half: rod.real",
        "is no formula: write numbers, names and functions only",
    ),
    "a function": ("mass: m,", "mass: exp(m),", "there is no function 'exp'; there are sin, cos"),
    "arguments": ("half: rod/2", "half: 'sin(rod, 2)'", "sin takes 1 argument"),
    "a huge power": (
        "half: rod/2",
        "half: 9**9**9**9",
        "has no finite value with these quantities",
    ),
    "a root": ("half: rod/2", "half: sqrt(-rod)", "has no finite value"),
    "a complex power": ("half: rod/2", "half: (-rod)**0.5", "has no finite value"),
    "brackets": ("half: rod/2", "half: " + "(" * 400, "is no formula"),
    "no formula": ("mass: m,", "mass: m m,", "is no formula: write it as rod/2"),
    "a negative mass": ("mass: m,", "mass: -m,", "bodies.a.mass: -2.0 is below 0"),
    "an axis": (
        "type: revolute, connects: [ground, a]",
        "type: revolute, axis: [0, sin(lean), 1], connects: [ground, a]",
        "joints.j.axis.1: is a vector of unit length",
    ),
    "a word of Python's": (
        "let: {",
        "let: {lambda: 3, ",
        "'lambda' cannot be the name of a quantity",
    ),
    "a function's name": ("let: {", "let: {sin: 3, ", "'sin' cannot be the name of a quantity"),
    "no number": ("half: rod/2", "half: [1]", "let.half: [1] is not a number"),
    "a weighed shape": (
        "    mass: 1\n    centre_of_mass: [half, sin(lean)/10, 0]\n    inertia: {zz: 0.01}\n"
        "    shapes: [{",
        "    shapes: [{density: 1000, ",
        "gives the body its mass, which would not follow",
    ),
    "formulas apart": (
        "actuators: [j]",
        "formulas: {a: b}",
        "write formulas in the places of the numbers",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_refused_formulas(name):
    old, new, sentence = REFUSALS[name]
    assert old in TEXT
    with pytest.raises(lw.MechanismError) as refusal:
        lw.Mechanism.parse(TEXT.replace(old, new))
    assert sentence in str(refusal.value) and "\n" not in str(refusal.value)


PATHS = {
    "half": "'half' follows from the formula 'rod/2' and has no value of its own",
    "a.mass": "'a.mass' follows from the formula 'm' and has no value of its own",
    "spare": "'let.spare' stands in no formula, so that nothing follows from it",
    "range": "'range' enters no equation of motion",
}


@pytest.mark.parametrize("path", PATHS)
def test_refused_paths(path):
    text = TEXT.replace("m: 2}", "m: 2, spare: 1, range: 1}").replace(
        "upper: 90 deg", "upper: range"
    )
    with pytest.raises(lw.LinkworkError) as refusal:
        lw.Robot(lw.Mechanism.parse(text)).free(path)
    assert PATHS[path] in str(refusal.value)


def test_values_that_no_description_may_hold():
    free = lw.Robot(lw.Mechanism.parse(TEXT)).free("m")
    with pytest.raises(lw.MechanismError, match=r"bodies.a.mass: -1.0 is below 0"):
        free.with_parameters({"m": -1.0})


def test_a_divisor_that_becomes_zero():
    free = lw.Robot(lw.Mechanism.parse(TEXT.replace("sin(lean)/10", "0.01*rod/m"))).free("m")
    with pytest.raises(lw.MechanismError, match=r"'0.01\*rod/m' divides by zero"):
        free.with_parameters({"m": 0.0})


def test_angles_in_degrees_turn_shapes_that_weigh_their_body():
    text = """
linkwork: 1
bodies: {a: {shapes: [{type: box, size: [1, 2, 3], density: 2, frame: {rotation: [0, 0, TURN]}}]}}
joints: {j: {type: revolute, connects: [ground, a]}}
"""
    turned = lw.Mechanism.parse(text.replace("TURN", "90 deg"))
    expected = lw.Mechanism.parse(text.replace("TURN", repr(math.pi / 2)))
    assert turned.bodies["a"].inertia == expected.bodies["a"].inertia
    assert lw.Mechanism.parse(turned.text) == turned and "90 deg" in turned.text
