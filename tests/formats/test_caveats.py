"""What makes a mechanism move otherwise than its file says is told wherever the file goes: read,
run, saved, studied."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load
from linkwork.formats.models import read
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element

from tests.cli.calls import call, refused

INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>'
GRIPPER = """<mujoco model="gripper"><asset><mesh name="m" file="m.stl"/></asset><worldbody>
<body name="arm"><joint name="a" axis="0 1 0" {joint}/>{inertial}
<body name="palm" pos="0.3 0 0"><geom type="mesh" mesh="m"/>
<joint name="b" axis="0 1 0"/>{more}</body></body></worldbody>
<actuator><motor joint="a"/></actuator><sensor/></mujoco>"""
MESH = "its type is mesh"
WEIGHT = (
    "<body 'palm'> has no mass here: all of it is that of meshes, which are not weighed; give "
    "it an <inertial>"
)


def model(folder, joint="", inertial=INERTIAL, more='<geom size="0.1"/>'):
    path = folder / "gripper.xml"
    path.write_text(GRIPPER.format(joint=joint, inertial=inertial, more=more))
    return path


def caveats(path):
    with pytest.warns(ModelWarning) as told:
        imported = load(path)
    assert tuple(str(warning.message) for warning in told) == imported.mechanism.caveats
    assert set(imported.mechanism.caveats) <= set(imported.notes)
    assert told[0].filename == __file__
    return imported.mechanism.caveats


def test_a_file_that_is_read_whole_has_none(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        imported = load(model(tmp_path, more=INERTIAL))
    assert not imported.mechanism.caveats
    assert any("<sensor>" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "<geom> is a mesh, whose mass is left out"),
        ({"more": ""}, WEIGHT),
        (
            {"more": INERTIAL, "joint": 'springyield="1 1"'},
            "<joint 'a'> says springyield, which is left out",
        ),
        (
            {"more": INERTIAL, "joint": 'frictionloss="1"'},
            "has dry friction, which is smoothed here",
        ),
        (
            {"more": INERTIAL, "joint": 'type="ball" damping="1 2"'},
            "has a damping that is not linear",
        ),
        (
            {"more": INERTIAL + "<composite count='3'/>"},
            "<composite> is left out: it makes bodies",
        ),
        (
            {"more": INERTIAL.replace("/>", "/><plugin/>")},
            "<plugin> is left out: it is not known here",
        ),
    ],
)
def test_what_changes_the_motion_is_warned_of(change, words, tmp_path):
    assert any(words in caveat for caveat in caveats(model(tmp_path, **change)))


@pytest.mark.parametrize("joint", ['range="-1 1"', 'actuatorfrcrange="-1 1"', 'margin="1"', ""])
def test_what_changes_nothing_is_at_most_noted(joint, tmp_path):
    assert not load(model(tmp_path, joint=joint, more=INERTIAL)).mechanism.caveats


def test_they_stay_with_the_mechanism_in_files_and_runs(tmp_path):
    with pytest.warns(ModelWarning, match="whose mass is left out") as told:
        robot = lw.Robot.from_file(model(tmp_path))
    assert told[0].filename == __file__
    (caveat,) = robot.mechanism.caveats
    run = robot.simulate(robot.home, duration=0.01)
    assert run.attrs["caveats"] == run.dataset.attrs["caveats"] == caveat
    run.save(tmp_path / "run.nc")
    assert xarray.open_dataset(tmp_path / "run.nc", engine="scipy").attrs["caveats"] == caveat
    many = robot.ensemble(robot.state(np.zeros((2, 2))), duration=0.01)
    assert many.dataset.attrs["caveats"] == caveat
    robot.mechanism.save(tmp_path / "again.yaml")
    with pytest.warns(ModelWarning, match="whose mass is left out"):
        assert lw.Robot.from_file(tmp_path / "again.yaml").mechanism == robot.mechanism
    assert "caveats" not in lw.Robot(lw.robots.prr3()).mechanism.text


@pytest.mark.long
def test_commands_print_them_and_strict_refuses_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = model(tmp_path).name
    warning = "linkwork: warning: gripper.xml, line 3: <geom> is a mesh, whose mass is left out"
    note = (
        "linkwork: note: gripper.xml, line 5: <sensor> is left out: sensors do not act on the "
        "motion"
    )
    words = {
        "info": ("info", name, "--json"),
        "simulate": ("simulate", name, "--duration", "0.01", "--out", "run.nc"),
        "analyse": ("analyse", name, "parameters"),
        "export": ("export", name, "gripper.yaml"),
    }
    for command in words.values():
        result = call(*command)
        assert result.exit_code == 0, result.output
        assert warning in result.stderr and note in result.stderr
        assert "warning" not in result.stdout
    words |= {
        "saved mechanism": ("info", "gripper.yaml"),
        "report": ("report", "run.nc", "--out", "run.html"),
        "convert": ("convert", name, "other.yaml"),
    }
    for command in list(words.values())[-3:]:
        result = call(*command)
        assert result.exit_code == 0, result.output
        assert warning in result.stderr
    assert "The model was not read whole: gripper.xml, line 3" in Path("run.html").read_text()
    for command in words.values():
        last = refused(
            *command,
            *(
                ("--overwrite",)
                if command[0] in ("export", "convert", "report", "simulate")
                else ()
            ),
            "--strict",
        )
        assert "whose mass is left out" in last and last.endswith(
            "--strict refuses what is warned of\n"
        )
    assert call("--strict", "info", "prr3").exit_code == 0
    assert call("--strict", "export", model(tmp_path, more=INERTIAL), "whole.yaml").exit_code == 0


def test_studies_tell_them_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = model(tmp_path).name
    vary, outputs = "{arm.mass: {type: values, values: [1, 2]}}", "{end: final joint_position.a}"
    Path("study.yaml").write_text(
        f"study: 1\nrobot: {name}\nduration: 0.01\nvary: {vary}\noutputs: {outputs}\n"
    )
    result = call("sweep", "study.yaml")
    assert result.exit_code == 0, result.output
    assert "linkwork: warning: gripper.xml, line 3: <geom> is a mesh" in result.stderr
    assert "is a mesh" in xarray.open_zarr("study/results.zarr").attrs["caveats"]
    assert "--strict refuses what" in refused("sweep", "study.yaml", "--strict")


def test_a_model_whose_masses_are_all_meshes_says_so(tmp_path):
    (told,) = [
        c
        for c in caveats(model(tmp_path, inertial='<geom type="mesh" mesh="m"/>', more=""))
        if "no mass here" in c
    ]
    assert (
        "and 1 more: <body> ('palm', 'arm') has no mass here: all of it is that of meshes" in told
    )


def test_a_remark_that_alters_the_motion_is_told_beside_the_same_one_that_does_not():
    """Both are left out with the same remark; one of them alone alters the motion."""
    notes, file = Notes(), Path("model.xml")
    for name, line, alters in (("cord", 3, False), ("spring", 4, True)):
        notes.on(Element("spatial", {"name": name}, file, line), "is left out", alters)
    assert notes.caveats() == ("model.xml, line 4: <spatial 'spring'> is left out",)
    assert "model.xml, line 3: <spatial 'cord'> is left out" in notes.sentences()


@pytest.mark.parametrize(
    ("options", "felt"),
    [
        ('<option density="1.2" wind="1 0 0"/>', True),
        ('<option viscosity="1e-5"/>', True),
        ('<option wind="1 0 0"/>', False),
        ('<option density="1.2"/><option density="0"/>', False),
    ],
)
def test_a_fluid_acts_where_it_resists(options, felt, tmp_path):
    path = model(tmp_path, more=INERTIAL)
    path.write_text(path.read_text().replace("<worldbody>", f"{options}<worldbody>"))
    mechanism = read(path).mechanism
    assert not mechanism.caveats and bool(mechanism.drags) == felt


@pytest.mark.parametrize(
    ("key", "z", "turned"),
    [("", 3, 0), ('mpos="1 2 3"', 3, 0), ('mpos="1 2 4"', 4, 0), ('mquat="1 1 0 0"', 3, np.pi / 2)],
)
def test_a_mocap_body_stands_where_the_keyframe_puts_it(key, z, turned, tmp_path):
    path = model(tmp_path, more=INERTIAL)
    hand = '<body name="hand" mocap="true" pos="1 2 3"/>'
    text = path.read_text().replace("<worldbody>", f"<worldbody>{hand}", 1)
    key = f'<keyframe><key name="home" {key}/></keyframe></mujoco>'
    path.write_text(text.replace("</mujoco>", key))
    imported = read(path)
    assert not imported.mechanism.caveats
    assert any("says mocap, which is left out" in note for note in imported.notes)
    (frame,) = (
        joint.frames[0]
        for joint in imported.mechanism.pairs.values()
        if joint.connects == ("ground", "hand")
    )
    assert frame.position == (1, 2, z) and frame.rotation == pytest.approx((turned, 0, 0))
