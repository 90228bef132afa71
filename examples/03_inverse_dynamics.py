"""Inverse dynamics along a path: what must the motors of a Delta robot give for a pick and place?

The tool is led along a path; positions, rates and accelerations of all joints follow from exact
derivatives, and the forces from the equations of motion.
"""

import numpy as np

import linkwork as lw

robot = lw.Robot(lw.robots.delta())
x, y, z = robot.tool_pose(robot.home)[:3]

# Up, across and down again, through four points, from rest to rest in 0.4 s.
ways = [[-0.12, 0, -0.03], [-0.10, 0, 0.03], [0.10, 0, 0.03], [0.12, 0, -0.03]]  # from home
path = lw.paths.through(np.add(ways, [x, y, z]))
motion = robot.follow(path, duration=0.4, samples=401)
torques = robot.inverse_dynamics(motion)

for name, peak in zip(robot.actuators, np.abs(torques.values).max(axis=0), strict=True):
    print(f"{name}: {peak:.2f} N m at most")

# The same torques as inputs of a simulation lead the tool along the same path.
run = robot.simulate(motion.state.at(0), torques, duration=0.4, save_at=motion.time)
off = np.abs(run.dataset["tool_pose"].values[:, :3] - motion.tool[:, :3]).max()
print(f"the tool is off its path by {off:.1e} m")
assert off < 1e-6

axes = lw.views.plot_motion(robot, run, poses=5)  # the robot on its way, and the tool's path
lw.views.save_figure(axes, "inverse_dynamics.svg")
