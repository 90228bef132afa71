"""Springs and dampers by a time constant and a damping ratio are those of MuJoCo's compiler: by the
inertia that joints, tendons and actuators have, and by the mass of bodies that only slide."""

import mujoco as mj
import pytest

from linkwork.formats import load

MODEL = """<mujoco>
<compiler angle="radian"/>
<worldbody>
 <site name="w" pos="1 1 1"/>
 <body name="a"><joint name="j1" axis="0 1 0" armature="0.2" springdamper="0.3 0.8"/>
  <inertial pos="0.1 0 0.2" mass="1.2" diaginertia="0.1 0.2 0.15"/>
  <body name="b" pos="0.5 0 0"><joint name="j2" axis="0 1 0.3" springdamper="0.2 0.5"/>
   <inertial pos="0.2 0 0" mass="0.7" diaginertia="0.1 0.1 0.12"/><site name="s" pos="0.1 0.2 0"/>
  </body>
  <body name="c" pos="0 0 0.4"><joint name="j3" axis="1 0 0" springdamper="0.4 1"/>
   <inertial pos="0 0.1 0" mass="0.5" diaginertia="0.1 0.2 0.12"/>
  </body>
 </body>
 <body name="cart">
  <joint name="x" type="slide" axis="1 0 0" armature="0.7" springdamper="0.3 0.8"/>
  <joint name="y" type="slide" axis="0 1 0" springdamper="0.5 0.9"/>
  <inertial pos="{at}" mass="2" diaginertia="1 1 1"/>
 </body>
</worldbody>
<tendon>{tendons}</tendon>
<actuator><motor joint="j3" gear="2" armature="0.05" damping="0.3"/>
 <motor tendon="two" gear="1.5" armature="0.1"/></actuator>
</mujoco>"""
LINES = {
    "along": '<fixed name="two"><joint joint="j2" coef="0.4"/><joint joint="j1" coef="-2"/>'
    "</fixed>",
    "beside": '<fixed name="two" armature="0.3"><joint joint="j2" coef="0.4"/>'
    '<joint joint="j3" coef="1"/></fixed>'
    '<spatial name="three" armature="0.2"><site site="w"/><site site="s"/></spatial>',
    "cart": '<fixed name="two"><joint joint="x" coef="0.4"/><joint joint="y" coef="1"/></fixed>',
}


@pytest.mark.parametrize("at", ["0 0 0", "0 0 0.1"])
@pytest.mark.parametrize("tendons", LINES.values(), ids=LINES)
def test_they_are_those_of_mujocos_compiler(tendons, at, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(MODEL.format(tendons=tendons, at=at))
    model, joints = mj.MjModel.from_xml_path(str(path)), load(path).mechanism.joints
    for name, added in {"j1": 0, "j2": 0, "j3": 0.3 * 2**2, "x": 0, "y": 0}.items():
        joint = model.joint(name)
        assert joints[name].spring.stiffness == pytest.approx(joint.stiffness[0], rel=1e-12)
        viscous = model.dof_damping[joint.dofadr[0]] + added
        assert joints[name].friction.viscous == pytest.approx(viscous, rel=1e-12)


def test_the_spring_of_a_free_joint_is_that_of_each_way_and_of_its_turn(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text("""<mujoco><worldbody><body><joint type="free" springdamper="0.3 0.8"/>
<geom size="0.1"/></body></worldbody></mujoco>""")
    stiffness = mj.MjModel.from_xml_path(str(path)).jnt_stiffness[0]
    ((_, joint),) = load(path).mechanism.joints.items()
    found = [own.spring.stiffness for own in joint.effects().values()]
    assert found == pytest.approx([stiffness] * 4, rel=1e-12)
