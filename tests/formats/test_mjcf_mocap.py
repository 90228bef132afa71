"""Mocap bodies: fixed where the keyframe puts them, and moved by free numbers as MuJoCo's are."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

from tests.formats import mujoco_side as side

LED = """<mujoco>
<compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody>
 <body name="hand" mocap="true" pos="0.3 0 0.9"><site name="grip" pos="0 0.1 0"/></body>
 <body name="a" pos="0 0 1"><joint name="j1" axis="0 1 0"/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0.5 0 0"/>
  <body name="b" pos="0.5 0 0"><joint name="j2" axis="0 1 0.3"/>
   <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/><site name="tip" pos="0.4 0 0"/>
  </body></body>
</worldbody>
<tendon><spatial name="lead" stiffness="80" damping="2" springlength="0.05">
 <site site="grip"/><site site="tip"/></spatial></tendon>
<keyframe><key name="home" qpos="0.2 0.3" mpos="0.6 0.1 0.8" mquat="0.9 0.1 0.2 0.3"/></keyframe>
</mujoco>"""


@pytest.mark.parametrize("shift", [(0, 0, 0), (0.2, -0.1, 0.3)])
def test_what_a_mocap_body_pulls_moves_as_in_mujoco(tmp_path, shift):
    path = tmp_path / "led.xml"
    path.write_text(LED)
    mechanism = load(path).mechanism
    (name,) = (n for n, joint in mechanism.pairs.items() if joint.connects == ("ground", "hand"))
    places = [f"joints.{name}.frames.0.position.{axis}" for axis in "xyz"]
    robot = lw.Robot(mechanism, free=places)
    moved = np.array([0.6, 0.1, 0.8]) + shift
    robot = robot.with_parameters(dict(zip(places, moved.tolist(), strict=True)))
    model = mj.MjModel.from_xml_path(str(path))
    data = mj.MjData(model)
    mj.mj_resetDataKeyframe(model, data, 0)
    data.mocap_pos[0] = moved
    state = robot.state({"j1": 0.4, "j2": -0.7}, {"j1": 1.1, "j2": -2.0})
    side.set_state(model, data, {"j1": 0.4, "j2": -0.7}, {"j1": 1.1, "j2": -2.0})
    assert robot.forward_dynamics(state, []) == pytest.approx(data.qacc, rel=1e-12)


def test_what_is_welded_to_a_mocap_body_stands_with_it(tmp_path):
    """A weld holds bodies as they stand at qpos0, where the mocap body is as it says itself."""
    path = tmp_path / "led.xml"
    weld = '<equality><weld body1="hand" body2="c"/></equality></mujoco>'
    body = '<body name="c" pos="0.4 0.2 1"><freejoint/><geom size="0.1"/></body></worldbody>'
    path.write_text(
        LED.replace("</worldbody>", body)
        .replace("</mujoco>", weld)
        .replace('0.2 0.3" mpos', '0.2 0.3 0.4 0.2 1 1 0 0 0" mpos')
    )
    robot = lw.Robot(load(path).mechanism)
    model = mj.MjModel.from_xml_path(str(path))
    R, at = np.zeros(9), np.array([0.4, 0.2, 1]) - [0.3, 0, 0.9]
    mj.mju_quat2Mat(R, model.key_mquat[0])
    expected = model.key_mpos[0] + R.reshape(3, 3) @ at
    assert robot.body_poses(robot.home)["c"][0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "key",
    ['qpos="0.3"', 'qpos="0.3 1 4 5 6 0.6 0.8"', 'mpos="7"', 'mpos="7 8 9" mquat="0.6 0.8"'],
)
def test_what_a_keyframe_does_not_say_to_the_end_stays_as_mujoco_has_it(key, tmp_path):
    path = tmp_path / "short.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><joint name="a"/><joint name="s" type="slide" ref="2"/>'
        '<geom size=".1"/></body><body name="f" pos="1 2 3"><freejoint name="f"/><geom size=".1"/>'
        '</body><body name="m" mocap="true" pos="4 5 6"/></worldbody>'
        f'<keyframe><key name="home" {key}/></keyframe></mujoco>'
    )
    robot = lw.Robot(load(path).mechanism)
    model = mj.MjModel.from_xml_path(str(path))
    data = mj.MjData(model)
    mj.mj_resetDataKeyframe(model, data, 0)
    mj.mj_forward(model, data)
    places = robot.body_poses(robot.home)
    for name in "afm":
        assert places[name][0] == pytest.approx(data.body(name).xpos, abs=1e-12)
        assert places[name][1] == pytest.approx(data.body(name).xmat.reshape(3, 3), abs=1e-12)
