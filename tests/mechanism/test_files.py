"""The YAML file and the code describe the same thing; refusals name file, line and element."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from linkwork.mechanism import Body, Mechanism, MechanismError, RevoluteJoint
from linkwork.mechanism.files import MAX_BYTES
from linkwork.robots import prr3

from tests.catalogue import WHOLE
from tests.mechanism.descriptions import TRAPS, mechanisms

ARM = """\
# an arm of two bodies
linkwork: 1
bodies:
  upper: {mass: 1.0}
  lower:
    mass: 2.0
    centre_of_mass: [0.1, 0, 0]
    inertia: {zz: 0.1}
joints:
  shoulder:
    type: revolute
    connects: [ground, upper]
    axis: [0, 0, 1]
  elbow:
    type: spherical
    connects: [upper, lower]
    frames:
      - position: [1, 0, 0]
      - position: [0, 0, 0]
    friction:
      turn: {viscous: 0.1}
actuators: [shoulder]
reference:
  shoulder: 0.5
  elbow.qw: 1.0
"""


@pytest.mark.long
@settings(max_examples=25 if WHOLE else 10, deadline=None, suppress_health_check=list(HealthCheck))
@given(mechanisms())
def test_round_trip_of_any_mechanism(mechanism):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.yaml"
        mechanism.save(path)
        again = Mechanism.load(path)
        assert again == mechanism
        assert (again.coordinates, again.rates) == (mechanism.coordinates, mechanism.rates)
        for field in ("bodies", "springs", "tools", "reference"):
            assert list(getattr(again, field)) == list(getattr(mechanism, field))
        again.save(Path(folder) / "y.yaml")
        assert path.read_bytes() == (Path(folder) / "y.yaml").read_bytes()


@pytest.mark.parametrize("name", TRAPS)
def test_names_that_yaml_might_misread(tmp_path, name):
    hinge = RevoluteJoint(connects=("ground", name))
    mechanism = Mechanism(
        name=name, bodies={name: Body(mass=1)}, joints={name: hinge}, actuators=(name,)
    )
    mechanism.save(tmp_path / "x.yaml")
    assert Mechanism.load(tmp_path / "x.yaml") == mechanism


def test_numbers_of_numpy_are_written_as_numbers(tmp_path):
    """A copy with other values is not looked through, and may hold NumPy's."""
    copied = prr3().model_copy(update={"gravity": tuple(np.array([0.1, -9.8, 1e-9]))})
    copied.save(tmp_path / "copied.yaml")
    assert Mechanism.load(tmp_path / "copied.yaml") == copied


def test_defaults_are_left_out(tmp_path):
    hinge = RevoluteJoint(connects=("ground", "a"))
    Mechanism(bodies={"a": Body(mass=1e-5)}, joints={"h": hinge}).save(tmp_path / "x.yaml")
    expected = (
        "linkwork: 1\nbodies:\n  a: {mass: 1.0e-05}\njoints:\n  h:\n    type: revolute\n    "
        "connects: [ground, a]\n"
    )
    assert (tmp_path / "x.yaml").read_text() == expected


def test_a_hand_written_file(tmp_path):
    (tmp_path / "arm.yaml").write_text("\ufeff" + ARM.replace("\n", "\r\n"), encoding="utf-8")
    arm = Mechanism.load(tmp_path / "arm.yaml")
    assert arm.bodies["lower"].inertia.zz == 0.1
    assert arm.joints["elbow"].frames[0].position == (1, 0, 0)
    assert arm.joints["elbow"].effects()["turn"][0].viscous == 0.1
    assert arm.reference == {"shoulder": 0.5, "elbow.qw": 1.0}


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "linkwork: 1\n",
            "",
            "line 2: linkwork: is missing; the first line should be 'linkwork: 1'",
        ),
        (
            "linkwork: 1",
            "linkwork: 7",
            "line 2: linkwork: 7 is not a format version this program reads; give 1",
        ),
        (
            "{mass: 1.0}",
            "{mass: -1}",
            "line 4: bodies.upper.mass: -1 is below 0; expected mass [kg], zero or more",
        ),
        ("{mass: 1.0}", "{mass: '1,5'}", "line 4: bodies.upper.mass: '1,5' is not a number"),
        (
            "{mass: 1.0}",
            "",
            "line 4: bodies.upper: is empty; give the fields mass, centre_of_mass, inertia",
        ),
        ("    mass: 2.0\n", "", "line 5: bodies.lower.mass: is missing"),
        (
            "    mass: 2.0\n",
            "    mas: 2.0\n",
            "line 6: bodies.lower.mas: is not a known field (did you mean mass?)",
        ),
        ("0.1, 0, 0]", "0.1, 0]", "line 7: bodies.lower.centre_of_mass: give 3 numbers, not 2"),
        (
            "{zz: 0.1}",
            "\n      zz: 1\n      xx: 3\n      yy: 1\n",
            "line 8: bodies.lower.inertia: principal moments",
        ),
        (
            "type: revolute",
            "type: revolut",
            "line 11: joints.shoulder.type: 'revolut' is not a type (did you mean",
        ),
        ("    type: revolute\n", "", "line 10: joints.shoulder.type: is missing; the types are"),
        (
            "type: revolute",
            "type: screw",
            "line 10: joints.shoulder.pitch: is missing; expected advance",
        ),
        ("[ground, upper]", "[ground, uper]", "line 12: joints.shoulder.connects"),
        (
            "[ground, upper]",
            "[ground, 1]",
            "line 12: joints.shoulder.connects.1: 1 is not text; put it in quotes",
        ),
        (
            "[ground, upper]",
            "\n    - ground\n    - on\n",
            "line 14: joints.shoulder.connects.1: on without quotes means",
        ),
        (
            "axis: [0, 0, 1]",
            "axis: [0, 0, 0]",
            "line 13: joints.shoulder.axis: axis [0.0, 0.0, 0.0] has no length",
        ),
        (
            "axis: [0, 0, 1]",
            "axis:\n      - 0\n      - z\n      - 1\n",
            "line 15: joints.shoulder.axis.1: 'z' is not a",
        ),
        (
            "- position: [0, 0, 0]",
            "- positon: [0, 0, 0]",
            "line 19: joints.elbow.frames.1.positon: is not a known",
        ),
        (
            "turn: {viscous",
            "turn: {viscos",
            "line 21: joints.elbow.friction.turn.viscos: is not a known field (did",
        ),
        (
            "turn: {viscous: 0.1}",
            "spin: {}",
            "line 20: joints.elbow.friction: there is no freedom 'spin'",
        ),
        (
            "actuators: [shoulder]",
            "actuators: shoulder",
            "line 22: actuators: 'shoulder' is not a list",
        ),
        (
            "shoulder: 0.5",
            "shoulder: .nan",
            "line 24: reference.shoulder: nan is not a finite number",
        ),
        ("  elbow.qw: 1.0", "  elbow.qw: x", "line 25: reference.elbow.qw: 'x' is not a number"),
        (
            "actuators:",
            "self: 1\nactuators:",
            "line 22: self: is not a known field; the fields here are name",
        ),
        (
            "actuators:",
            "tools: {t: {body: hand}}\nactuators:",
            "line 22: tools.t.body: there is no body 'hand'",
        ),
    ],
)
def test_refusals_name_file_line_and_element(tmp_path, old, new, sentence):
    assert old in ARM
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.replace(old, new, 1))
    with pytest.raises(MechanismError) as refusal:
        Mechanism.load(path)
    assert str(refusal.value).startswith(f"{path}: {sentence}"), str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.place.startswith(f"{path}: line ")


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "- 1", "mechanism", "42"])
def test_documents_that_hold_no_mechanism(tmp_path, text):
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(
        MechanismError, match=r"x.yaml: line [12]: holds no mechanism; the first line should be"
    ):
        Mechanism.load(tmp_path / "x.yaml")


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(ARM)), st.integers(0, 12), st.text(max_size=8) | st.sampled_from(TRAPS))
def test_a_damaged_file_is_read_or_refused_in_one_line(start, length, patch):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.yaml"
        path.write_bytes((ARM[:start] + patch + ARM[start + length :]).encode("utf-8"))
        try:
            Mechanism.load(path)
        except MechanismError as refusal:
            assert str(refusal).startswith(f"{path}: line ")
            assert "\n" not in str(refusal)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_are_refused_in_one_line(content):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.yaml"
        path.write_bytes(content)
        with pytest.raises(MechanismError) as refusal:
            Mechanism.load(path)
        assert "\n" not in str(refusal.value)


def test_files_that_are_no_text(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_bytes(b"linkwork: 1\n\xff\xfe\x00\x80")
    with pytest.raises(
        MechanismError, match="line 2: is not UTF-8 text; a mechanism file is YAML text"
    ):
        Mechanism.load(path)
    path.write_bytes(b"linkwork: 1\nname: a\0b")
    with pytest.raises(MechanismError, match=r"line 2: holds the character U\+0000"):
        Mechanism.load(path)


def test_places_that_cannot_be_read(tmp_path):
    with pytest.raises(MechanismError, match=r"none\.yaml: cannot be read: no such file"):
        Mechanism.load(tmp_path / "none.yaml")
    with pytest.raises(MechanismError, match="cannot be read: is a directory"):
        Mechanism.load(tmp_path)
    with pytest.raises(MechanismError, match="cannot be read: embedded null byte"):
        Mechanism.load("a\0b")


def test_a_file_without_permission(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text(ARM)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read every file")
    with pytest.raises(MechanismError, match="cannot be read: permission denied"):
        Mechanism.load(path)


def test_a_huge_file_is_refused_unread(tmp_path):
    with (tmp_path / "x.yaml").open("wb") as file:
        file.truncate(1000 * MAX_BYTES)
    with pytest.raises(
        MechanismError, match="is larger than 20 MB; a mechanism file is far smaller"
    ):
        Mechanism.load(tmp_path / "x.yaml")


def test_places_that_cannot_be_written(tmp_path):
    with pytest.raises(MechanismError, match="cannot be written: no such file"):
        prr3().save(tmp_path / "no" / "such" / "folder.yaml")
    (tmp_path / "taken").mkdir()
    with pytest.raises(MechanismError, match="cannot be written: is a directory"):
        prr3().save(tmp_path / "taken")
    with pytest.raises(MechanismError, match="cannot be written: not a directory"):
        prr3().save(Path(__file__) / "x.yaml")
    with pytest.raises(MechanismError, match="cannot be written: embedded null byte"):
        prr3().save(tmp_path / "a\0b")
    with pytest.raises(MechanismError, match="cannot be written"):
        prr3().save("")
    for name in ("robot.xml", "robot.urdf", "robot.txt"):
        with pytest.raises(MechanismError, match=r"would be YAML .*; give one in \.yaml, or write"):
            prr3().save(tmp_path / name)
        assert not (tmp_path / name).exists()
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize("name", ["robot.xml", "robot.URDF", "robot.mjcf"])
def test_model_files_are_sent_to_the_formats(tmp_path, name):
    (tmp_path / name).write_text("<robot/>")
    with pytest.raises(
        MechanismError,
        match=r"read it by linkwork.formats.load\(path\).mechanism, or turn it .* convert'",
    ):
        Mechanism.load(tmp_path / name)
