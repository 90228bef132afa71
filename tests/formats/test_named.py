"""Robots by name or file, alike in code and on the command line."""

import re
import warnings
from pathlib import Path

import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats.named import named

from tests.cli.calls import refused
from tests.formats import samples


def test_a_robot_is_made_from_its_name():
    assert lw.Robot("prr3").mechanism == lw.robots.prr3()
    assert [named(name).mechanism for name in lw.robots.__all__] == [
        getattr(lw.robots, name)() for name in lw.robots.__all__
    ]


@pytest.mark.parametrize("suffix", [".yaml", ".yml", ".xml", ".mjcf", ".urdf", ".txt"])
def test_a_robot_is_made_from_a_file_of_every_format(suffix, tmp_path):
    path = tmp_path / f"robot{suffix}"
    if suffix in (".yaml", ".yml", ".txt"):
        path.write_text(lw.robots.pendulum().text)
    else:
        path.write_text(samples.URDF if suffix == ".urdf" else samples.TREE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        one, other = lw.Robot(path), lw.Robot(str(path))
    assert one.mechanism == other.mechanism
    if suffix != ".txt":
        assert lw.formats.load(path).mechanism == one.mechanism


def test_caveats_of_a_file_are_warned_of_at_the_line_that_asks(tmp_path):
    caveat = "it moves otherwise"
    lw.robots.pendulum().model_copy(update={"caveats": (caveat,)}).save(tmp_path / "robot.yaml")
    with pytest.warns(ModelWarning, match=caveat) as told:
        lw.Robot(tmp_path / "robot.yaml")
    assert len(told) == 1 and told[0].filename == __file__


@pytest.mark.parametrize(
    ("given", "nearest"),
    [
        ("prr4", "prr3"),
        ("five-bar", "five_bar"),
        ("Stewart", "stewart"),
        ("./prr3", "prr3"),
        ("orthoglid", "orthoglide"),
    ],
)
def test_the_nearest_name_is_told(given, nearest):
    sentence = f"there is no robot {given!r} (did you mean {nearest}?); name one of the catalogue"
    with pytest.raises(lw.LinkworkError, match=re.escape(sentence)):
        lw.Robot(given)
    assert sentence in refused("info", given)


def test_the_nearest_file_is_told(tmp_path, monkeypatch):
    lw.robots.five_bar().save(tmp_path / "five-bar.yaml")
    monkeypatch.chdir(tmp_path)
    near = re.escape("fivebar.yaml: cannot be read: no such file or directory (did you mean five-")
    with pytest.raises(lw.LinkworkError, match=near):
        lw.Robot("fivebar.yaml")
    with pytest.raises(lw.LinkworkError, match=r"no such file or directory$"):
        lw.Robot("quite/else.yaml")


@pytest.mark.parametrize("given", [5, None, lw.robots.prr3, ["prr3"]])
def test_what_is_neither_a_name_nor_a_mechanism_is_refused(given):
    with pytest.raises(lw.LinkworkError, match="a robot is made from a Mechanism, not from"):
        lw.Robot(given)


def test_a_path_is_no_name():
    with pytest.raises(lw.LinkworkError, match="there is no robot 'prr3'"):
        lw.Robot(Path("prr3"))
