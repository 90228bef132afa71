"""Model files by suffix and root element."""

import pytest

import linkwork as lw
from linkwork.formats import load, save
from linkwork.mechanism import MechanismError

from tests.formats import samples


def test_the_root_element_says_what_an_xml_file_is(tmp_path):
    for name, text, kind in (
        ("a.xml", samples.URDF, "arm"),
        ("b.mjcf", samples.TREE, "tree"),
        ("c.XML", samples.TREE, "tree"),
    ):
        (tmp_path / name).write_text(text)
        assert load(str(tmp_path / name)).mechanism.name == kind


@pytest.mark.parametrize("suffix", [".yaml", ".yml"])
def test_native_files_are_mechanism_files(suffix, tmp_path):
    path = tmp_path / f"robot{suffix}"
    assert save(lw.robots.prr3(), path) == ()
    imported = load(path)
    assert imported.mechanism == lw.robots.prr3()
    assert imported.notes == ()


@pytest.mark.parametrize("suffix", [".xml", ".urdf", ".sdf"])
def test_what_model_files_leave_out_of_tools_is_told(suffix, tmp_path):
    """They have frames alone, not what a tool's pose is relative to, nor how it is led."""
    plain = lw.robots.puma560()
    fields = {name: getattr(plain, name) for name in type(plain).model_fields}
    body = next(iter(plain.tools.values())).body
    task = ("x", "y", "z", "roll", "pitch", "yaw")
    tools = {"tip": lw.Tool(body=body, relative_to="link_1", task=task), "rest": lw.Tool(body=body)}
    notes = save(lw.Mechanism(**fields | {"tools": tools}), tmp_path / f"robot{suffix}")
    told = [note for note in notes if note.startswith("tools.")]
    assert len(told) == 2 and "its task is left out" in told[0]
    assert told[1].endswith("is that in the ground, and not relative to 'link_1'")


@pytest.mark.parametrize("text", [samples.TREE, samples.URDF], ids=["mjcf", "urdf"])
def test_what_is_read_can_be_written_as_a_mechanism_file(text, tmp_path):
    source, target = tmp_path / "model.xml", tmp_path / "model.yaml"
    source.write_text(text)
    mechanism = load(source).mechanism
    save(mechanism, target)
    assert load(target).mechanism == mechanism


def test_suffixes_that_are_not_known(tmp_path):
    with pytest.raises(
        MechanismError,
        match=r"a model file ends in \.yaml, \.yml, \.xml, \.mjcf, \.urdf, \.sdf, \.world, not "
        r"'\.usd'",
    ):
        load(tmp_path / "robot.usd")
    with pytest.raises(
        MechanismError,
        match=r"a model is written as \.yaml, \.yml, \.xml, \.mjcf, \.urdf, \.sdf, \.world, not",
    ):
        save(lw.robots.prr3(), tmp_path / "robot.obj")


@pytest.mark.parametrize("name", ["arm.urdf", "arm.xml", "arm.yaml"])
def test_a_mechanism_is_not_loaded_from_a_model_file_whatever_its_name(name, tmp_path):
    (tmp_path / name).write_text(f"\n{samples.URDF}")
    with pytest.raises(
        MechanismError,
        match=r"is a model file, not a mechanism file; read it by linkwork\.formats\.load",
    ):
        lw.Mechanism.load(tmp_path / name)


def test_a_file_that_cannot_be_written(tmp_path):
    with pytest.raises(MechanismError, match="cannot be written: no such file or directory"):
        save(lw.robots.four_bar(), tmp_path / "no-folder" / "robot.xml")
