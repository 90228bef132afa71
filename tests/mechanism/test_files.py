"""The YAML file and the code describe the same thing."""

import pytest

from linkwork.mechanism import Mechanism, MechanismError
from linkwork.robots import prr3


def test_round_trip_gives_an_equal_mechanism(tmp_path):
    mechanism = prr3(l1=0.31, link_mass=1 / 3)
    mechanism.save(tmp_path / "x.yaml")
    assert Mechanism.load(tmp_path / "x.yaml") == mechanism


def test_saving_twice_gives_the_same_bytes(tmp_path):
    prr3().save(tmp_path / "a.yaml")
    Mechanism.load(tmp_path / "a.yaml").save(tmp_path / "b.yaml")
    assert (tmp_path / "a.yaml").read_bytes() == (tmp_path / "b.yaml").read_bytes()


def test_a_hand_written_file(tmp_path):
    path = tmp_path / "pendulum.yaml"
    path.write_text(
        """
        linkwork: 1
        name: pendulum
        bodies:
          rod: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: {zz: 1e-1}}
        joints:
          hinge: {type: revolute, connects: [ground, rod]}
        actuators: [hinge]
        """
    )
    mechanism = Mechanism.load(path)
    assert mechanism.bodies["rod"].inertia.zz == 0.1
    assert mechanism.joints["hinge"].frames[0].position == (0, 0, 0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "holds no mechanism; the first line should be 'linkwork: 1'"),
        ("- 1", "holds no mechanism"),
        ("name: x", "linkwork: None is not a format version"),
        ("linkwork: 7", "linkwork: 7 is not a format version this program reads; give 1"),
        ("linkwork: 1\nname: [", "line 2: is not YAML"),
        ("linkwork: 1\nname: a\nname: b", "line 3: the key 'name' is given twice"),
        ("linkwork: 1\nname: !!python/object/apply:os.system [ls]", "is not YAML"),
        ("linkwork: 1\nbodies: {}", "joints: is missing"),
        ("linkwork: 1\nbodies: {a: {mass: -1}}\njoints: {}", "bodies.a.mass: -1 is not accepted"),
        ("linkwork: 1\nbodies: 3\njoints: {}", "bodies: 3 is not accepted"),
    ],
)
def test_refusals_name_the_file(tmp_path, text, sentence):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(MechanismError) as refusal:
        Mechanism.load(path)
    assert str(refusal.value).startswith(str(path))
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(MechanismError, match="cannot be read: no such file"):
        Mechanism.load(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(MechanismError, match="is not UTF-8 text"):
        Mechanism.load(tmp_path / "binary.yaml")


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(MechanismError, match="cannot be written"):
        prr3().save(tmp_path / "no" / "such" / "folder.yaml")
