"""Motions: a pick-and-place cycle within limits, and as fast as the motors can.

Limits of speed, acceleration and jerk are kept exactly, by laws in closed form. On the same way the
motors' torque allows more: the fastest law follows from the inverse dynamics of the closed loops.
"""

import numpy as np

import linkwork as lw
from linkwork import motions

robot = lw.Robot(lw.robots.delta())
x, y, z = robot.tool_pose(robot.home)[:3]

# Up, across and down, with blended corners: limits of the tool in x, y and z.
limits = motions.AxisLimits(speed=1.5, acceleration=30.0, jerk=1500.0)
ends = [x - 0.12, y, z - 0.03], [x + 0.12, y, z - 0.03]
cycle = motions.pick_and_place(*ends, lift=[0, 0, 0.06], limits=limits, blend=0.4)
speed, acceleration, jerk = cycle.extremes().max(axis=1)
print(f"{cycle.duration:.3f} s with {speed:.3f} m/s, {acceleration:.2f} m/s², {jerk:.0f} m/s³")
assert max(speed / 1.5, acceleration / 30, jerk / 1500) < 1 + 1e-12

# The robot follows: every joint, and the torques that it takes.
motion = motions.follow(robot, cycle, samples=401)
torques = robot.inverse_dynamics(motion)
print(f"at most {np.abs(torques.values).max():.1f} N m")
motions.write_csv("cycle.csv", motion, robot, forces=torques)

# A circle as fast as 40 N m allow.
circle = lw.paths.circle([x, y, z], 0.1)
fastest = motions.fastest(robot, circle, motions.ActuatorLimits(force=40.0))
used = robot.inverse_dynamics(motions.follow(robot, fastest, samples=401)).values
print(f"a circle in {fastest.duration:.3f} s with {np.abs(used).max():.1f} N m")
assert np.abs(used).max() < 40.4

lw.views.save_figure(lw.views.plot_timed_path(cycle, robot), "motions.svg")
