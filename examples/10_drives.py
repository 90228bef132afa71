"""A drive between the controller and the joint: DC motors with coils and gears."""

import numpy as np

import linkwork as lw
from linkwork import control

robot = lw.Robot(lw.robots.prr3())
goal = robot.assemble(tool=[0.52, 0.31, 0.6])

# Current and voltage of a motor obey R i + L i' + k n v = U; its states belong to the run.
motor = control.DCMotor(resistance=1.2, inductance=2e-3, torque_constant=0.05, gear=400.0)
motors = dict.fromkeys(robot.actuators, motor)

# The law now commands volts. It is stiff: coils are quicker than the platform.
law = control.PD(goal, kp=400.0, kd=4.0)
t = np.linspace(0, 1.5, 301)
run = robot.simulate(robot.home, law, duration=1.5, drives=motors, method="rodas", save_at=t)
print(run.message)
print("states of the drives:", list(run.dataset["extra"].values))
print("commands in", run.dataset["command"].attrs["units"])

off = run.dataset["tool_pose"].values[-1] - robot.tool_pose(goal)
print(f"off the goal by {1e3 * np.abs(off[:2]).max():.2f} mm after 1.5 s")

lw.views.save_figure(run.plot(["command", "actuator_force", "tool_pose"]), "drives.svg")
