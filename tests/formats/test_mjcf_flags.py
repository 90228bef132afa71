"""What the flags of options switch off does not act, as in MuJoCo."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

from tests.model_collections import MuJoCoSide, apart

MODEL = """<mujoco><option density="80" viscosity="0.3"><flag {flags}/></option>{more}
<default><geom contype="0" conaffinity="0"/><joint damping="0.3"/></default>
<worldbody><site name="w" pos="0 0 1"/>
 <body name="a" gravcomp="0.7"><joint name="h" axis="0 1 0" stiffness="5" springdamper="{sd}"/>
  <geom type="box" size=".1 .2 .3" pos=".3 0 0"/><site name="s" pos=".3 0 0"/></body>
 <body name="b"><joint name="k" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>
 <body name="c"><joint name="m" axis="1 1 0" armature="0.1"/><geom size=".1" pos=".2 0 0"/></body>
</worldbody>
<tendon><spatial name="t" stiffness="20" damping="2" springlength="0.1">
 <site site="w"/><site site="s"/></spatial>
 <fixed name="f" range="-0.5 -0.1" limited="true"><joint joint="m" coef="1"/></fixed></tendon>
<equality><joint joint1="h" joint2="k"/></equality>
<actuator><motor joint="h" damping="0.4"/></actuator>
</mujoco>"""


def written(tmp_path, flags, sd="0 0", more=""):
    path = tmp_path / "model.xml"
    said = " ".join(f'{name}="disable"' for name in flags.split())
    path.write_text(MODEL.format(flags=said, sd=sd, more=more))
    return path


@pytest.mark.sample(5)
@pytest.mark.parametrize(
    "flags",
    ["", "spring", "damper", "spring damper", "equality", "constraint", "gravity", "limit"],
)
@pytest.mark.parametrize("sd", ["0 0", "0.3 1"], ids=["", "springdamper"])
def test_what_is_switched_off_does_not_act(flags, sd, tmp_path):
    path = written(tmp_path, flags, sd)
    mechanism = load(path).mechanism
    robot = lw.Robot(mechanism)
    held = not {"equality", "constraint"} & {*flags.split()}
    assert robot.mobility == (2 if held else 3)
    stopped = not {"limit", "constraint"} & {*flags.split()}
    assert bool(mechanism.caveats) == stopped == ("f" in mechanism.transmissions)
    if not stopped:
        assert apart(robot, MuJoCoSide(path)) < 1e-9
    else:
        lines = {name: line for name, line in mechanism.transmissions.items() if name != "f"}
        loose = lw.Robot(mechanism.model_copy(update={"transmissions": lines}))
        assert apart(loose, MuJoCoSide(path)) < 1e-9


def test_the_last_word_on_a_flag_holds(tmp_path):
    more = '<option><flag equality="enable" gravity="disable"/></option>'
    mechanism = load(written(tmp_path, "equality", more=more)).mechanism
    assert lw.Robot(mechanism).mobility == 2 and not np.any(mechanism.gravity)


def test_friction_and_controls(tmp_path):
    path = written(tmp_path, "frictionloss actuation limit")
    path.write_text(path.read_text().replace('damping="0.3"', 'frictionloss="0.3"'))
    imported = load(path)
    joints = imported.mechanism.pairs.values()
    assert not imported.mechanism.caveats
    assert not any(each.friction.coulomb for joint in joints for each in joint.effects().values())
    assert any("switches actuators off" in note for note in imported.notes)
    assert imported.mechanism.actuators == ("h",)
