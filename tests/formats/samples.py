"""Small models in the files' own words, written for these tests."""

TREE = """
<mujoco model="tree">
  <compiler angle="degree" eulerseq="zYx"/>
  <option gravity="0.3 -0.2 -9.7"/>
  <default>
    <joint damping="0.05" armature="0.01"/>
    <geom density="700"/>
    <default class="arm">
      <joint axis="0 1 0" stiffness="2" springref="10"/>
      <geom type="capsule" size="0.03"/>
      <default class="stiff"><joint stiffness="5"/></default>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="base" pos="0.1 0.2 0.9" euler="10 -25 40" childclass="arm">
      <joint name="shoulder" range="-170 170" ref="15" pos="0 0.02 0.01"/>
      <geom fromto="0 0 0 0.1 0.05 0.4"/>
      <frame pos="0.02 0 0.05" axisangle="1 1 0 30">
        <geom type="box" size="0.05 0.04 0.03" mass="0.3"/>
        <body name="side" pos="0 0.1 0" zaxis="1 0.2 0.3">
          <joint name="rail" type="slide" axis="1 0 1" class="stiff" ref="0.05" springref="0.02"/>
          <inertial pos="0.01 0 0.05" quat="1 0.2 0 0" mass="0.7" diaginertia="0.004 0.005 0.006"/>
        </body>
      </frame>
      <body name="fork" pos="0.1 0.05 0.4" quat="0.9 0.1 -0.3 0.2">
        <joint name="yaw" axis="0 0 1" stiffness="0" ref="-20"/>
        <joint name="pitch" axis="1 0 0.2" pos="0 0 0.05" frictionloss="0"/>
        <geom type="ellipsoid" size="0.04 0.06 0.08" pos="0 0.03 0.05" euler="5 6 7"/>
        <geom type="cylinder" size="0.02 0.1" pos="0.05 0 0"/>
        <body name="hand" pos="0 0.02 0.2" xyaxes="0 1 0 -1 0.3 0">
          <joint name="wrist" type="ball" damping="0.2" stiffness="0" pos="0.01 0 0"/>
          <inertial pos="0 0.1 0" mass="0.5" fullinertia="0.01 0.012 0.014 0.001 0.0005 0.0002"/>
          <site name="tip" pos="0 0.15 0" euler="0 0 90"/>
          <site name="edge" type="capsule" size="0.01" fromto="0 0.1 0 0.1 0.3 0.2"/>
          <body name="finger" pos="0 0.2 0"><geom type="sphere" size="0.03"/></body>
        </body>
      </body>
    </body>
    <body name="drone" pos="1 2 3" euler="20 0 10"><freejoint name="flight"/>\
<geom type="box" size="0.1 0.2 0.05"/></body>
  </worldbody>
  <actuator>
    <motor name="m1" joint="shoulder"/>
    <general name="m2" joint="rail"/>
    <motor name="m3" joint="pitch"/>
  </actuator>
</mujoco>
"""

FOUR_BAR = """
<mujoco model="four-bar">
  <option gravity="0 -9.81 0"/>
  <worldbody>
    <body name="crank" pos="0 0 0">
      <joint name="drive"/>
      <inertial pos="0.1 0 0" mass="0.3" diaginertia="0.001 0.002 0.003"/>
      <body name="coupler" pos="0.2 0 0">
        <joint name="elbow"/>
        <inertial pos="0.2 0 0" mass="0.6" diaginertia="0.002 0.009 0.008"/>
      </body>
    </body>
    <body name="rocker" pos="0.5 0 0.0" euler="0 0 90">
      <joint name="pivot" damping="0.02"/>
      <inertial pos="0.15 0 0" mass="0.4" diaginertia="0.001 0.004 0.003"/>
    </body>
  </worldbody>
  <equality>{equality}</equality>
  <actuator><motor joint="drive"/></actuator>
</mujoco>
"""

SPATIAL = """
<mujoco model="loop in space">
  <worldbody>
    <body name="disc" pos="0 0 0.2" euler="0 10 0">
      <joint name="spin" axis="0 1 0"/>
      <inertial pos="0 0 0.01" mass="1" diaginertia="0.02 0.03 0.02"/>
      <body name="rod" pos="0.05 0 0.1">
        <joint name="ball" type="ball"/>
        <inertial pos="0.2 0.1 0" mass="0.4" diaginertia="0.003 0.006 0.007"/>
      </body>
    </body>
    <body name="slider" pos="0.4 0.3 0.25">
      <joint name="rail" type="slide" axis="1 0.2 0" ref="0.1"/>
      <joint name="roll" type="hinge" axis="1 0.2 0"/>
      <inertial pos="0 0 0" mass="0.8" diaginertia="0.001 0.001 0.002"/>
      <site name="seat" pos="0.01 0 0" euler="0 20 0"/>
    </body>
  </worldbody>
  {more}
  <equality>{equality}</equality>
  <actuator><motor joint="spin"/></actuator>
</mujoco>
"""

URDF = """
<robot name="arm">
  <link name="stand"><inertial><mass value="5"/>\
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper">
    <inertial>
      <origin xyz="0.1 0.02 0.3" rpy="0.1 0.2 0.3"/>
      <mass value="1.5"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0.0005"/>
    </inertial>
    <visual><geometry><box size="1 1 1"/></geometry></visual>
  </link>
  <link name="fore">
    <inertial>
      <origin xyz="0 0.1 0"/><mass value="0.8"/>
      <inertia ixx="0.01" iyy="0.011" izz="0.012" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="ram">
    <inertial><mass value="0.4"/>\
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="pod">
    <inertial>
      <origin xyz="0.05 0 0"/><mass value="0.2"/>
      <inertia ixx="0.001" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="tool0"/>
  <joint name="shoulder" type="revolute">
    <parent link="stand"/><child link="upper"/>
    <origin xyz="0 0 0.5" rpy="0.2 -0.1 0.4"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-2" upper="2.5" effort="10" velocity="3"/>
    <dynamics damping="0.0" friction="0.0"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="0.2 0 0.6" rpy="1.2 0 -0.3"/><axis xyz="1 0 0"/>
  </joint>
  <joint name="stroke" type="prismatic">
    <parent link="fore"/><child link="ram"/>
    <origin xyz="0 0.4 0"/><axis xyz="0 1 1"/>\
<limit lower="-0.2" upper="0.2" effort="1" velocity="1"/>
  </joint>
  <joint name="mount" type="fixed"><parent link="ram"/><child link="pod"/>\
<origin xyz="0 0 0.1" rpy="0 0 1"/></joint>
  <joint name="flange" type="fixed"><parent link="pod"/><child link="tool0"/>\
<origin xyz="0 0.05 0" rpy="0 0.5 0"/></joint>
</robot>
"""

LOOPS = """<connect name="c" body1="coupler" body2="rocker" anchor="0.3 0 0"/>
<weld body1="coupler" body2="rocker" relpose="0 0 0 1 0 0 0"/>\
<joint joint1="drive" joint2="pivot" polycoef="0 1"/>"""
TENDONS = """<tendon><spatial name="t" stiffness="3"><site site="hub"/><site site="seat"/></spatial>
<fixed name="f"><joint joint="rail" coef="2"/><joint joint="spin" coef="3"/></fixed></tendon>
<keyframe><key name="home" qpos="0 1 0 0 0 0 0"/></keyframe>"""
SDF = """
<sdf version="1.9">
  <world name="w">
    <gravity>0 0 -9.81</gravity>
    <frame name="hook"><pose>0 0 2 0 0 0</pose></frame>
    <model name="bar" canonical_link="crank">
      <pose relative_to="hook" degrees="true">0 0 0 0 0 90</pose>
      <link name="crank">
        <inertial><pose>0.1 0 0 0 0 0.2</pose><mass>0.3</mass>
          <inertia><ixx>0.001</ixx><iyy>0.002</iyy><izz>0.002</izz><ixy>0.0001</ixy></inertia>
        </inertial>
        <visual name="v"><geometry><box><size>0.2 0.02 0.02</size></box></geometry></visual>
      </link>
      <frame name="tip" attached_to="crank"><pose>0.2 0 0 0 0.6 0</pose></frame>
      <link name="coupler">
        <pose relative_to="tip"/>
        <inertial auto="true"/>
        <collision name="c"><pose>0.2 0 0 0 1.57 0</pose><density>500</density>
          <geometry><cylinder><radius>0.02</radius><length>0.4</length></cylinder></geometry>
        </collision>
      </link>
      <model name="far">
        <pose relative_to="coupler">0.4 0 0 0 1.2 0</pose>
        <link name="rocker"><pose rotation_format="quat_xyzw">0 0 0 0 0 0 1</pose></link>
      </model>
      <joint name="a" type="revolute">
        <parent>world</parent><child>crank</child>
        <axis><xyz expressed_in="__model__">0 1 0</xyz>
          <limit><lower>-2</lower><upper>2</upper><effort>5</effort></limit>
          <dynamics><damping>0.1</damping><spring_stiffness>1</spring_stiffness></dynamics>
        </axis>
      </joint>
      <joint name="b" type="universal">
        <parent>crank</parent><child>coupler</child>
        <axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>
      </joint>
      <joint name="c" type="ball"><parent>coupler</parent><child>far::rocker</child></joint>
      <joint name="d" type="screw">
        <pose relative_to="far::rocker">0.3 0 0 0 0 0</pose>
        <parent>world</parent><child>far::rocker</child>
        <screw_thread_pitch>0.01</screw_thread_pitch>
        <axis><xyz>0 1 0</xyz><mimic joint="a"><multiplier>2</multiplier></mimic></axis>
      </joint>
    </model>
  </world>
</sdf>
"""

MODELS = {
    "tree.xml": TREE,
    "four_bar.xml": FOUR_BAR.format(equality=LOOPS),
    "spatial.xml": SPATIAL.format(
        more=TENDONS,
        equality='<connect site1="hub" site2="seat"/><tendon tendon1="f"/><tendon tendon1="t"/>',
    ).replace('<joint name="spin"', '<site name="hub" pos="0 0 0.1"/><joint name="spin"'),
    "arm.urdf": URDF,
    "bar.sdf": SDF,
}
