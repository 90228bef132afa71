"""Motions without mass are told when a file is read, those that run are not."""

import warnings

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load, weightless

HEAVY = '<inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
POINT = '<inertial pos="0 0 0.1" mass="1" diaginertia="0 0 0"/>'
MODEL = """<mujoco model="arm"><compiler boundinertia="0"/><worldbody><body name="a">
<joint name="first" axis="0 0 1"/>{heavy}<body name="b" pos="0.3 0 0">{joint}{own}{further}</body>
</body></worldbody>{more}</mujoco>"""
JOINT = '<joint name="second" axis="0 0 1" armature="{}"/>'
CHILD = f'<body name="c" pos="0.1 0 0">{HEAVY}</body>'
GEAR = '<equality><joint joint1="second" joint2="first" polycoef="0 2"/></equality>'


def written(folder, own="", further="", more="", armature=0.0, joint=JOINT):
    path, joint = folder / "arm.xml", joint.format(armature)
    path.write_text(MODEL.format(heavy=HEAVY, joint=joint, own=own, further=further, more=more))
    return path


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"own": POINT},
        {"own": POINT, "joint": '<joint name="second" type="ball"/>'},
        {"further": f'<body name="c" pos="0 0 0.1">{POINT}</body>'},
    ],
)
def test_what_moves_no_mass_is_told_and_does_not_run(parts, tmp_path):
    path = written(tmp_path, **parts)
    with pytest.warns(ModelWarning, match="the motion of 'second' moves no mass, and forces"):
        robot = lw.Robot(load(path).mechanism)
    with pytest.raises(lw.LinkworkError, match="some motion moves no mass"):
        robot.forward_dynamics(robot.home.with_rates([1.0] * robot.mobility), [])


@pytest.mark.parametrize(
    "parts",
    [
        {"own": HEAVY},
        {"armature": 0.1},
        {"further": CHILD},
        {"further": CHILD.replace('">', '"><joint name="third" axis="1 0 0"/>', 1)},
        {"more": GEAR},
    ],
)
def test_what_runs_is_not_told(parts, tmp_path):
    path = written(tmp_path, **parts)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        robot = lw.Robot(load(path).mechanism)
    assert robot.simulate(robot.home, duration=0.01).success


TWINS = '<joint name="second" axis="0 0 1"/><joint name="third" axis="0 0 1" pos="0 0 1"/>'
GIMBAL = (
    '<joint name="second" axis="0 0 1"/><joint name="third" axis="0 1 0"/>'
    '<joint name="fourth" axis="0 0 1"/>'
)
APART = '<keyframe><key name="home" qpos="0 0 0.5 0"/></keyframe>'
GEARED = '<equality><joint joint1="third" joint2="second" polycoef="0 2"/></equality>'
LINK = '<body name="{}" pos="{}"><joint name="{}" axis="0 0 1"/>{}</body>'
ARM = LINK.format("e", "0.1 0 0", "fifth", "")
LOOP = LINK.format("c", "0.1 0 0", "third", "{}" + ARM) + LINK.format("d", "0.3 0 0", "fourth", "")
PIN = '<equality><connect body1="e" body2="d" anchor="0.1 0.1 0"/></equality>'


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"joint": TWINS, "own": HEAVY}, "'second', 'third' can move together so that"),
        (
            {"joint": GIMBAL, "own": HEAVY},
            "'second', 'fourth' can move together where the reference has them so that no mass "
            "moves, .* or a reference in which their axes",
        ),
        (
            {"further": LINK.format("c", "0.1 0 0", "third", ""), "more": GEARED},
            "'second', 'third' can move together so that no mass moves",
        ),
        (
            {"own": HEAVY, "further": LOOP.format(""), "more": PIN},
            "'third', 'fifth', 'fourth' can move together so that no mass moves",
        ),
    ],
)
def test_joints_that_move_no_mass_together_are_told_together(parts, told, tmp_path):
    with pytest.warns(ModelWarning, match=told):
        robot = lw.Robot(load(written(tmp_path, **parts)).mechanism)
    assert robot.simulate(robot.home, duration=0.01).status.name == "NON_FINITE"


@pytest.mark.parametrize(
    "parts",
    [
        {"joint": GIMBAL, "own": HEAVY, "more": APART},
        {"own": HEAVY, "further": LOOP.format(HEAVY), "more": PIN},
    ],
)
def test_what_moves_mass_at_the_reference_is_not_told(parts, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        robot = lw.Robot(load(written(tmp_path, **parts)).mechanism)
    assert robot.simulate(robot.home, duration=0.01).success


@pytest.mark.parametrize(
    "extra",
    [
        {"joint": '<joint name="second" axis="0 0 1" springdamper="0.1 1"/>'},
        {"more": '<actuator><position joint="second" kp="3" dampratio="1"/></actuator>'},
        {"more": '<actuator><muscle joint="second" lengthrange="0 1"/></actuator>'},
    ],
)
def test_what_follows_from_the_inertia_is_nothing_where_nothing_has_mass(extra, tmp_path):
    with pytest.warns(ModelWarning, match="the motion of 'second' moves no mass"):
        mechanism = load(written(tmp_path, **extra)).mechanism
    joint, drive = mechanism.joints["second"], mechanism.drives.get("second", {})
    assert joint.spring.stiffness == joint.friction.viscous == 0
    assert not drive.get("bias_rate") and not drive.get("peak_force")


def test_ends_that_meet_are_told_where_no_run_begins_from_there(tmp_path):
    path = tmp_path / "arm.xml"
    for key, meets in (('damping="5"', True), ('stiffness="9"', False)):
        path.write_text(
            f'<mujoco><worldbody><body name="arm"><joint name="pin"/>{HEAVY}<site name="s" '
            'pos="1 0 0"/></body><site name="t" pos="1 0 0"/></worldbody><tendon><spatial '
            f'name="tie" {key}><site site="s"/><site site="t"/></spatial></tendon></mujoco>'
        )
        mechanism = load(path).mechanism
        found = [told for told in mechanism.caveats if "the ends of the spring 'tie' meet" in told]
        assert len(found) == meets
        robot = lw.Robot(mechanism)
        assert robot.simulate(robot.home, duration=0.01).success != meets
        away = load(path, reference={"pin": 0.5}).mechanism
        assert lw.Robot(away).simulate(lw.Robot(away).home, duration=0.01).success


@pytest.mark.parametrize("seed", range(5))
def test_a_definite_inertia_settles_it_without_the_motions_that_loops_leave(seed, monkeypatch):
    """They took time with the cube of all rows; where some motion of the tree moves no mass they
    are looked at as ever."""
    random = np.random.default_rng(seed)
    J, C = random.standard_normal((9, 7)), random.standard_normal((3, 7))
    still = np.linalg.svd(C)[2][-1]  # a motion that the rows leave
    light = J - np.outer(J @ still, still)
    (found,) = weightless.unresisted(light.T @ light, C).T
    size = np.linalg.norm(light, axis=0) * still
    np.testing.assert_allclose(abs(found @ size), np.linalg.norm(size), rtol=1e-9)
    monkeypatch.setattr(np.linalg, "svd", None)
    assert weightless.unresisted(J.T @ J, C).shape == (7, 0)
