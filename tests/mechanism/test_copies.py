"""Copies of a description with other values are checked as descriptions are."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import MechanismError


@pytest.fixture(scope="module")
def prr3():
    return lw.robots.prr3()


def test_an_axis_is_of_unit_length(prr3):
    slide = prr3.joints["slide_1"].model_copy(update={"axis": [2, 0, 0]})
    assert slide.axis == (1.0, 0.0, 0.0)
    assert prr3.model_copy() == prr3 and prr3.model_copy(deep=True) == prr3


@pytest.mark.parametrize(
    ("update", "words"),
    [
        ({"gravty": (0, 0, 0)}, "gravty: is not a known field .did you mean gravity"),
        ({"gravity": (0, np.nan, 0)}, "gravity.1: nan is not a finite number"),
        ({"gravity": (0, 1)}, "gravity: give 3 numbers, not 2"),
        ({"actuators": ("nix",)}, "actuators: there is no joint 'nix'"),
        ({"reference": {"x": 1.0}}, "reference: there is no joint 'x'"),
        ({"tools": {"t": lw.Tool(body="nobody")}}, "tools.t.body: there is no body 'nobody'"),
        ({"bodies": {}}, "there is no body 'slider_1'"),
    ],
)
def test_a_mechanism_that_is_none_is_refused(update, words, prr3):
    with pytest.raises(MechanismError, match=words):
        prr3.model_copy(update=update)


@pytest.mark.parametrize(
    ("part", "update", "words"),
    [
        (lw.Body(mass=1.0), {"mass": -1.0}, "mass: -1.0 is below 0"),
        (lw.Spring(), {"stiffness": "stiff"}, "stiffness: 'stiff'"),
        (lw.Limits(lower=0.0), {"upper": -1.0}, "the lower limit 0.0 is not below the upper"),
    ],
)
def test_so_are_its_parts(part, update, words):
    for copied in (part.model_copy, part.copy):  # pydantic's former name checked nothing
        with pytest.raises(MechanismError, match=words):
            copied(update=update)


def test_a_motor_behind_a_spring_is_made_in_a_copy_too(prr3):
    elastic = prr3.joints["slide_1"].model_copy(
        update={"elastic": {"stiffness": 1e4, "motor_inertia": 0.1}}
    )
    copy = prr3.model_copy(update={"joints": {**prr3.joints, "slide_1": elastic}})
    assert "slide_1 motor" in copy.joints and "slide_1 motor" in copy.actuators
