"""Limits of tendons: loads rest on the stops that they become where they rest in MuJoCo."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

HUNG = """<mujoco>
<compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody>
 <site name="nail" pos="0.1 0 0"/>
 <body name="bob" pos="0 0 -0.5">
  <joint name="x" type="slide" axis="1 0 0" damping="30"/>
  <joint name="z" type="slide" axis="0 0 1" damping="30"/>
  <geom size="0.05" mass="3"/><site name="eye" pos="0 0 0.05"/>
 </body>
 <body name="wheel"><joint name="w" axis="0 1 0" damping="0.5"/>
  <geom type="box" size="0.1 0.1 0.1" mass="4" pos="0.3 0 0"/></body>
 <body name="motor"><joint name="m" axis="0 1 0" damping="0.5" stiffness="200"/>
  <geom size="0.2" mass="1"/></body>
</worldbody>
<tendon>
 <spatial name="string" limited="true" range="0 0.7" {} margin="0.01">
  <site site="nail"/><site site="eye"/></spatial>
 <fixed name="mesh" range="-0.1 0.1" {}><joint joint="w" coef="1"/>
 <joint joint="m" coef="-0.3"/></fixed>
</tendon>
</mujoco>"""
RIGID = 'solimplimit="0.95 0.95 0.1"'


def resting(text):
    """Return where MuJoCo's model comes to rest, by joint."""
    model = mj.MjModel.from_xml_string(text)
    data = mj.MjData(model)
    for _ in range(20_000):
        mj.mj_step(model, data)
    assert np.abs(data.qvel).max() < 1e-8
    return {model.joint(k).name: data.qpos[k] for k in range(model.njnt)}


@pytest.mark.parametrize(
    "law", [RIGID, f'{RIGID} solreflimit="0.05 0.8"', f'{RIGID} solreflimit="-900 -40"']
)
def test_loads_rest_where_they_rest_in_mujoco(tmp_path, law):
    text = HUNG.format(law, law)
    path = tmp_path / "hung.xml"
    path.write_text(text)
    imported = load(path)
    (caveat,) = {note.partition(" has ")[2] for note in imported.mechanism.caveats}
    assert "whose ends are stops here" in caveat
    robot = lw.Robot(imported.mechanism)
    run = robot.simulate(robot.home, [], duration=20.0, method="rodas")
    end = dict(zip(robot.coordinates, run["joint_position"].values[-1], strict=True))
    expected = resting(text)
    string = np.hypot(end["x"] - 0.1, -0.45 + end["z"])
    depths = string - 0.69, end["w"] - 0.1
    assert min(depths) > 1e-4
    wanted = np.hypot(expected["x"] - 0.1, -0.45 + expected["z"]) - 0.69, expected["w"] - 0.1
    assert depths == pytest.approx(wanted, rel=1e-6)


def test_stiffness_is_by_the_inertia_that_mujoco_finds(tmp_path):
    path = tmp_path / "hung.xml"
    path.write_text(HUNG.format('armature="0.1"', ""))
    model = mj.MjModel.from_xml_path(str(path))
    lines = load(path).mechanism.transmissions
    k = 1 / (0.95 * 0.02) ** 2 * 0.95**2 / 0.05
    stiff = [lines[name].stop.stiffness for name in ("string", "mesh")]
    assert stiff == pytest.approx(k / model.tendon_invweight0, rel=1e-9)
    assert (lines["string"].stop.lower, lines["string"].stop.upper) == (None, 0.69)
    assert (lines["mesh"].stop.lower, lines["mesh"].stop.upper) == (-0.1, 0.1)


def test_a_range_that_nothing_reaches_is_told(tmp_path):
    path = tmp_path / "hung.xml"
    path.write_text(HUNG.format("", "").replace('site="eye"', 'site="nail"'))
    assert any("the tendon moves nothing" in note for note in load(path).mechanism.caveats)


def test_a_string_between_two_points_with_a_slack_spring_is_a_cable(tmp_path):
    path = tmp_path / "hung.xml"
    path.write_text(HUNG.format('stiffness="50" springlength="0.2 0.4"', ""))
    spring = load(path).mechanism.transmissions["string"].spring
    assert (spring.stiffness, spring.rest, spring.slack) == pytest.approx((50, 0.2, 0.2))


def test_a_margin_that_leaves_no_room_is_told(tmp_path):
    path = tmp_path / "hung.xml"
    path.write_text(HUNG.format("", 'margin="0.2"'))
    imported = load(path).mechanism
    assert imported.transmissions.get("mesh") is None
    assert any("its margin leaves no room" in note for note in imported.caveats)
