"""What holds for every robot of the catalogue: it says what it is and where it is from, closes, and
survives its file."""

import inspect

import numpy as np
import pytest

from linkwork import Mechanism, MechanismError, robots
from linkwork.cli.catalogue import subject

from tests.oracle.maximal import MaximalOracle

APPROXIMATE = ("five_bar", "four_bar")  # their references are rounded numbers

every_robot = pytest.mark.parametrize("name", robots.__all__)


@every_robot
def test_it_says_what_it_describes_and_where_it_is_from(name):
    text = inspect.getdoc(getattr(robots, name)) or ""
    assert text.startswith("Describe ")
    assert "\nSource: " in text
    assert "\nArgs:\n" in text


def test_the_list_of_robots_shows_what_each_describes():
    assert subject("Describe a planar four-bar.\n\nArgs: none") == "A planar four-bar."
    assert len({subject(getattr(robots, name).__doc__) for name in robots.__all__}) == len(
        robots.__all__
    )


@every_robot
def test_every_parameter_is_described_and_has_a_default(name):
    function = getattr(robots, name)
    arguments = (inspect.getdoc(function) or "").partition("Args:")[2].partition("Source:")[0]
    for parameter in inspect.signature(function).parameters.values():
        assert parameter.default is not inspect.Parameter.empty
        assert parameter.name in arguments


@every_robot
def test_loops_close_at_the_reference(name):
    mechanism = getattr(robots, name)()
    oracle = MaximalOracle(mechanism)
    residuals = oracle.residuals(oracle.poses(mechanism.reference))
    worst = max(
        (np.max(abs(residual), initial=0.0) for residual in residuals.values()), default=0.0
    )
    assert worst < (0.1 if name in APPROXIMATE else 1e-12)


@every_robot
def test_a_saved_robot_is_the_same(name, tmp_path):
    mechanism = getattr(robots, name)()
    path = tmp_path / "robot.yaml"
    mechanism.save(path)
    assert Mechanism.load(path) == mechanism


OTHERS = ("wide", None, [0.1], 1j, True, {"x": 1.0}, np.zeros((2, 2)), object(), float("nan"))


@every_robot
def test_arguments_of_another_kind_are_refused_by_name(name):
    describe = getattr(robots, name)
    for parameter in inspect.signature(describe).parameters.values():
        for other in OTHERS:
            alike = np.shape(other) == np.shape(parameter.default) == (1,)
            if alike or (isinstance(other, bool) and isinstance(parameter.default, bool)):
                continue
            with pytest.raises(MechanismError) as refusal:
                describe(**{parameter.name: other})
            assert "\n" not in str(refusal.value)
