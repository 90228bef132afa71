"""What URDF says that nobody reads is told, and of what stands there twice the first counts, as in
Pinocchio; so do quaternions from version 1.1 on."""

import numpy as np
import pinocchio as pin
import pytest

import linkwork as lw
from linkwork.formats import load
from linkwork.mechanism import MechanismError

LINK = (
    "<link name='{0}'><inertial><origin {1}/><mass value='1'/><inertia ixx='0.1' iyy='0.2' "
    "izz='0.25' ixy='0' ixz='0' iyz='0'/></inertial>{2}</link>"
)
ORIGIN = "<origin xyz='0.1 0.2 0.3' {0}/>"


def arm(joint="<origin xyz='0.1 0.2 0.3'/>", inertial="xyz='0.1 0 0'", more="", version=""):
    links = LINK.format("a", "", "") + LINK.format("b", inertial, more)
    return (
        f"<robot name='r' {version}>{links}<joint name='j' type='continuous'><parent link='a'/>"
        f"<child link='b'/>{joint}</joint></robot>"
    )


def apart(path):
    """Return how far the acceleration of the joint is from Pinocchio's."""
    robot, model = lw.Robot(load(path).mechanism), pin.buildModelFromUrdf(str(path))
    state = robot.state({"j": 0.4}, {"j": 1.2})
    turn = np.array([np.cos(0.4), np.sin(0.4)])
    wanted = pin.aba(model, model.createData(), turn, np.array([1.2]), np.zeros(1))
    return np.abs(robot.forward_dynamics(state, [0.0]) - wanted).max()


@pytest.mark.parametrize(("version", "told"), [("", True), ("1.0", True), ("1.1", False)])
def test_quaternions_count_from_the_version_on_that_has_them(version, told, tmp_path):
    turned = "quat_xyzw='0.3 -0.2 0.6 0.8'"
    text = arm(ORIGIN.format(turned), f"xyz='0.1 0 0' {turned}", version=f"version='{version}'")
    (tmp_path / "m.urdf").write_text(text if version else text.replace("version=''", ""))
    assert apart(tmp_path / "m.urdf") < 1e-12
    caveats = " ".join(load(tmp_path / "m.urdf").mechanism.caveats)
    assert ("says quat_xyzw, which counts from version 1.1 of URDF on" in caveats) == told


@pytest.mark.parametrize(
    ("turned", "words"),
    [
        ("quat_xyzw='0 0 0 1' rpy='0 0 0'", "as rpy and quat_xyzw; keep one of them"),
        ("quat_xyzw='0 0 0 0'", "quat_xyzw has no length"),
    ],
)
def test_quaternions_that_are_refused(turned, words, tmp_path):
    (tmp_path / "m.urdf").write_text(arm(ORIGIN.format(turned), version="version='1.1'"))
    with pytest.raises(MechanismError, match=words):
        load(tmp_path / "m.urdf")


@pytest.mark.parametrize(
    ("joint", "more", "tag"),
    [
        (ORIGIN.format("") + "<origin xyz='1 1 1'/>", "", "origin"),
        ("<axis xyz='1 0 0'/><axis xyz='0 1 0'/>", "", "axis"),
        (2 * "<dynamics damping='0.1'/>", "", "dynamics"),
        ("", "<inertial><mass value='7'/></inertial>", "inertial"),
    ],
)
def test_of_what_stands_there_twice_the_first_counts(joint, more, tag, tmp_path):
    (tmp_path / "m.urdf").write_text(arm(joint, more=more))
    notes = " ".join(load(tmp_path / "m.urdf").notes)
    assert f"<{tag}> in a <{'link' if more else 'joint'}> is left out: the first counts" in notes
    if tag != "dynamics":  # which Pinocchio does not take into its dynamics
        assert apart(tmp_path / "m.urdf") < 1e-12


def test_attributes_that_urdf_has_not_are_warned_of(tmp_path):
    (tmp_path / "m.urdf").write_text(arm("<dynamics dampin='1'/>"))
    (caveat,) = load(tmp_path / "m.urdf").mechanism.caveats
    assert caveat.endswith("<dynamics> says dampin, which is left out: URDF has none")


@pytest.mark.parametrize(
    ("said", "warned"),
    [
        ("<dynamics D='1' K='7000' mu_coulomb='0' mu_viscous='16' damping='0.1'/>", False),
        ("<origin xyz='0.1 0.2 0.3' euler='0 0 1'/>", True),
    ],
)
def test_the_words_of_other_programs_are_noted_where_they_place_nothing(said, warned, tmp_path):
    (tmp_path / "m.urdf").write_text(arm(said).replace("izz=", "iyx='0' izz="))
    imported = load(tmp_path / "m.urdf")
    assert bool(imported.mechanism.caveats) == warned
    told = " ".join(imported.notes)
    words = ("iyx", *(("euler",) if warned else ("D", "K", "mu_coulomb", "mu_viscous")))
    assert all(f"says {word}, which is left out" in told for word in words)


def test_numbers_with_blanks_are_read_where_pinocchio_leaves_moments_out(tmp_path):
    (tmp_path / "m.urdf").write_text(arm())
    right = load(tmp_path / "m.urdf")
    (tmp_path / "m.urdf").write_text(arm().replace("ixx='0.1'", "ixx='0.1 '"))
    imported = load(tmp_path / "m.urdf")
    assert imported.mechanism.bodies == right.mechanism.bodies and not imported.mechanism.caveats
    assert any("<inertia> has blanks behind numbers" in note for note in imported.notes)
    assert pin.buildModelFromUrdf(str(tmp_path / "m.urdf")).inertias[1].inertia[2, 2] == 0
