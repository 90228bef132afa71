"""A model file of another program: MJCF is read, simulated exactly, and written again.

In MuJoCo a `connect` holds a loop by a stiff constraint force; here the loop is closed by
coordinates, and stays closed to rounding. What a file has and a mechanism has not is warned of.
"""

from pathlib import Path

import numpy as np

import linkwork as lw
from linkwork.formats import load, save

Path("four_bar.xml").write_text("""\
<mujoco model="four-bar">
  <option gravity="0 -9.81 0"/>
  <worldbody>
    <body name="crank">
      <joint name="drive"/>
      <inertial pos="0.1 0 0" mass="0.3" diaginertia="0.001 0.002 0.002"/>
      <body name="coupler" pos="0.2 0 0">
        <joint name="elbow"/>
        <inertial pos="0.2 0 0" mass="0.6" diaginertia="0.002 0.009 0.009"/>
      </body>
    </body>
    <body name="rocker" pos="0.5 0 0">
      <joint name="pivot" damping="0.02"/>
      <inertial pos="0 0.15 0" mass="0.4" diaginertia="0.004 0.001 0.004"/>
    </body>
  </worldbody>
  <equality><connect name="pin" body1="coupler" body2="rocker" anchor="0.3 0.3 0"/></equality>
  <actuator><motor joint="drive"/></actuator>
</mujoco>
""")
robot = lw.Robot.from_file("four_bar.xml")
print(robot.mobility, "freedom; the loop is closed by:", robot.mechanism.joints["pin"].type)

run = robot.simulate(robot.home, [0.0], duration=2.0, save_at=np.linspace(0, 2, 201))
print(run.message)
print(f"the loop is open by {run.closure_error:.1e} of the robot's length at most")
assert run.closure_error < 1e-12

# The native format, and back to MJCF; the notes say what MuJoCo takes otherwise.
save(robot.mechanism, "four_bar.yaml")
assert load("four_bar.yaml").mechanism == robot.mechanism
for note in save(robot.mechanism, "again.xml"):
    print("-", note)

lw.views.save_figure(lw.views.plot_motion(robot, run, poses=8), "model_file.svg")
