"""`linkwork convert`: what it writes, what it says, what it refuses."""

import json

import pytest
from typer.testing import CliRunner

import linkwork as lw
from linkwork.cli import app
from linkwork.formats import load

from tests.formats import samples


def call(*words):
    return CliRunner().invoke(app, ["convert", *map(str, words)])


def refused(*words):
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("linkwork: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def test_mjcf_becomes_a_mechanism_file_and_what_is_left_out_is_said(tmp_path):
    source, target = tmp_path / "arm.xml", tmp_path / "arm.yaml"
    source.write_text(samples.TREE.replace("</mujoco>", "<contact/></mujoco>"))
    result = call(source, target)
    assert result.exit_code == 0, result.output
    assert lw.Mechanism.load(target) == load(source).mechanism
    assert "- arm.xml, line " in result.stdout
    assert "<contact> is left out: contacts are no part of a mechanism" in result.stdout
    assert "1 spherical" in result.stdout
    assert f"{target} written" in result.stdout


FAR = """<mujoco><worldbody>
<body name="a"><joint name="j"/><geom size="0.1"/><site name="s" pos="1 0 0"/></body>
<body name="b" pos="9 0 0"><joint name="k"/><geom size="0.1"/><site name="t" pos="1 0 0"/></body>
</worldbody><equality><connect site1="s" site2="t"/></equality></mujoco>"""


@pytest.mark.parametrize("suffix", [".yaml", ".urdf"])
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('<mujoco><worldbody><body name="a"/></worldbody></mujoco>', "has mobility 0"),
        (FAR, "the loops do not close near the reference"),
    ],
)
def test_a_file_of_which_no_robot_is_made_is_written_and_that_is_said(text, why, suffix, tmp_path):
    source, target = tmp_path / "model.xml", tmp_path / f"again{suffix}"
    source.write_text(text)
    result = call(source, target)
    assert result.exit_code == 0 and target.is_file()
    assert f"linkwork: warning: {load(source).mechanism.name}: no robot is made of it" in (
        result.stderr
    )
    assert why in result.stderr
    target.unlink()
    assert why in refused(source, target, "--strict") and not target.exists()


def test_a_robot_of_the_catalogue_becomes_mjcf(tmp_path):
    target = tmp_path / "robot.xml"
    result = call("five_bar", target)
    assert result.exit_code == 0, result.output
    assert "MuJoCo's loops are soft" in result.stdout
    assert set(load(target).mechanism.joints) == set(lw.robots.five_bar().joints)


def test_a_file_that_exists_is_kept_unless_told_otherwise(tmp_path):
    target = tmp_path / "robot.yaml"
    target.write_text("precious")
    assert "exists; give another name, or --overwrite to replace it" in refused("prr3", target)
    assert target.read_text() == "precious"
    assert call("prr3", target, "--overwrite").exit_code == 0
    assert lw.Mechanism.load(target) == lw.robots.prr3()


def test_loops_are_written_beside_a_urdf(tmp_path):
    target, beside = tmp_path / "robot.urdf", tmp_path / "robot.yaml"
    result = call("prr3", target, "--loops", "beside", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["written"] == [str(target), str(beside)]
    assert beside.read_text().startswith("closed_loop: [[")
    target.unlink()
    assert "robot.yaml exists" in refused("prr3", target, "--loops", "beside")
    assert "loops stand beside URDF alone" in refused(
        "prr3", tmp_path / "one.xml", "--loops", "beside"
    )


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [
        ("none.xml", "b.yaml", "none.xml: cannot be read: no such file or directory"),
        ("delta", "b.urdf", "which URDF with loops has no word for"),
        (
            "prr3",
            "b.txt",
            "a model is written as .yaml, .yml, .xml, .mjcf, .urdf, .sdf, .world, not",
        ),
        ("nobody", "b.yaml", "there is no robot 'nobody'; name one of the catalogue"),
        ("bad.xml", "b.yaml", "bad.xml: line 1: is not well-formed XML"),
    ],
)
def test_refusals_are_one_sentence(source, target, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.xml").write_text("<mujoco")
    assert words in refused(source, target)
    assert not (tmp_path / target).exists()


def test_counts_are_data(tmp_path):
    result = call("prr3", tmp_path / "robot.yaml", "--json")
    found = json.loads(result.stdout)
    assert (found["bodies"], found["joints"]) == (7, {"prismatic": 3, "revolute": 6})
    assert found["actuators"] == ["slide_1", "slide_2", "slide_3"]
