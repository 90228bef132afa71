"""The workspace: where the 3-PRR reaches, how well it is conditioned, and where it is singular."""

import numpy as np

import linkwork as lw
from linkwork import analysis

robot = lw.Robot(lw.robots.prr3())
angle = np.pi / 2
grid = {"x": np.linspace(0.2, 0.8, 121), "y": np.linspace(-0.1, 0.5, 121), "angle": angle}

# A map: at each pose the robot's conditioning, and what else `workspace` is asked for.
mapped = analysis.workspace(robot, grid)
print(mapped.attrs["message"])
print(f"{analysis.content(mapped):.4f} m^2 are reached with the platform turned by 90 degrees")

# The largest circle of poses that are well conditioned.
centre, radius = analysis.inscribed(mapped, at_least=0.1)
x, y = centre["x"], centre["y"]
print(f"a circle of {radius:.3f} m about ({x:.3f}, {y:.3f}) is well conditioned")

# How near is the next singular pose on a path? The distance along a motion tells.
path = lw.paths.together(lw.paths.circle([x, y], 0.8 * radius), lw.paths.swing(angle, 0.0))
motion = robot.follow(path, duration=1.0, samples=101)
near = analysis.along(robot, motion)
print(f"the circle keeps {float(near['tool_distance'].min()):.3f} m away from singular poses")

axes = lw.views.plot_workspace(mapped, "conditioning")
lw.views.plot_mechanism(robot, motion.state.at(0), axes)
lw.views.save_figure(axes, "workspace.svg")
