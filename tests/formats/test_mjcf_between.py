"""Actuators of MJCF between two sites: slider-cranks, and sites seen from others, do what they do
in MuJoCo and are written as they were read."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save

from tests.formats.test_mjcf_actuators import ARM, compared

SITED = ARM.replace(
    '<body name="a"',
    '<site name="w" pos="-0.3 0.4 1.2" zaxis="1 0.3 -0.5"/>'
    '<site name="w2" pos="-0.1 0 1.2" zaxis="0.5 0 1"/><body name="a"',
).replace(
    '<body name="d" pos="0.4 0 0.1">',
    '<site name="b" pos="0.2 0 0.1" euler="0.5 -0.2 0.3"/><body name="d" pos="0.4 0 0.1">'
    '<site name="d" pos="0.1 0.05 0" euler="0.2 0.4 -0.3"/>',
)
CRANKS = """
<position name="far" cranksite="d" slidersite="w" cranklength="3" kp="20" kv="1.5" gear="-1.3"/>
<position name="on" cranksite="d" slidersite="s" cranklength="2" kp="11" dampratio="0.8"/>
<position name="broken" cranksite="b" slidersite="w2" cranklength="0.1" kp="5" dampratio="0.5"/>
<motor name="pulled" cranksite="w" slidersite="d" cranklength="2.5" gear="0.7"/>"""
SEEN = """
<position name="x" site="d" refsite="w" gear="1 0.3 -0.2 0 0 0" kp="20" kv="3"/>
<position name="y" site="d" refsite="s" gear="0 1.5 0.4 0 0 0" kp="9" dampratio="0.7"/>
<position name="r" site="d" refsite="w" gear="0 0 0 0.6 -0.8 0" kp="7" kv="0.6" ctrlrange="-1 1"/>
<position name="q" site="b" refsite="d" gear="0 0 0 0 0 1" kp="7" dampratio="1.2" ctrlrange="-1 1"/>
<general name="both" site="d" refsite="b" gear="0.5 0 1 0 0.2 0" biastype="affine" biasprm="1 -3 -1"
 gainprm="2"/>"""


@pytest.mark.sample(1)
@pytest.mark.parametrize("actuators", [CRANKS, SEEN])
def test_controls_do_what_they_do_in_mujoco(actuators, tmp_path):
    path, again = tmp_path / "arm.xml", tmp_path / "again.xml"
    path.write_text(SITED.format(joint="", actuators=actuators))
    imported = load(path)
    assert not imported.mechanism.caveats
    assert len(imported.mechanism.actuators) == actuators.count("name=")
    assert compared(path, tmp_path) < 1e-12
    save(imported.mechanism, again)
    assert compared(again, tmp_path) < 1e-12


@pytest.mark.parametrize(
    ("actuator", "told"),
    [
        ('<motor site="w" refsite="d" gear="1 0 0 0 0 0"/>', "moves by joints by which its site"),
        (
            '<position site="d" refsite="w" gear="0 0 0 0 0 1"/>',
            "takes its command as it is, and MuJoCo the nearest of those a whole turn apart",
        ),
        ('<motor site="w" refsite="w2" gear="1 0 0 0 0 0"/>', "acts on nothing that moves"),
        ('<motor site="d" refsite="w" gear="0"/>', "acts on nothing that moves"),
    ],
)
def test_what_differs_from_mujoco_is_told(actuator, told, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(SITED.format(joint="", actuators=actuator))
    assert any(told in note for note in load(path).notes)


def test_rates_of_displacements_are_those_of_lengths(tmp_path):
    """By differences along a motion, the rod's end and where it does not reach included."""
    path = tmp_path / "arm.xml"
    lines = "".join(each for each in (CRANKS + SEEN).splitlines(True) if 'name="r"' not in each)
    path.write_text(SITED.format(joint="", actuators=lines))
    robot = lw.Robot(load(path).mechanism)
    w, h = np.array([0.7, -0.5, 0.3, 0.9]), 1e-6
    names = [name for name in robot.actuators if name not in ("q", "both")]

    def lengths(t):
        q = dict(zip(robot.coordinates, 0.3 + t * w, strict=True))
        state = robot.state(q, dict(zip(robot.rates, w, strict=True)))
        seen = robot.observe(state)
        return np.array([seen[name] for name in names]), [seen.rate(name) for name in names]

    differences = (lengths(h)[0] - lengths(-h)[0]) / (2 * h)
    assert lengths(0)[1] == pytest.approx(differences, rel=1e-7, abs=1e-8)
