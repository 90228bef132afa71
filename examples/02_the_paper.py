"""The paper: direct dynamics of the planar 3-PRR robot by the natural orthogonal complement.

Forces that move the platform along a path are found by inverse dynamics and given to the robot as
inputs; forward dynamics has to find the path again. `linkwork reproduce` makes the whole report.
"""

import numpy as np

import linkwork as lw

robot = lw.Robot(lw.robots.prr3())

# The path of the platform's centre: a circle, while the platform swings.
circle, swing = lw.paths.circle([0.45, 0.29], 0.05), lw.paths.swing(1.2, 0.2)
motion = robot.follow(lw.paths.together(circle, swing), duration=1.0, samples=501)

# Figure 4 of the paper: the forces of the three sliders, M v' + C v + G = tau.
forces = robot.inverse_dynamics(motion)

# Figures 5 to 7: forces in, motion out.
t = np.linspace(0, 1, 101)
run = robot.simulate(motion.state.at(0), forces, duration=1.0, rtol=1e-10, save_at=t)
found, wanted = run.dataset["joint_position"].values, motion.positions[::5]
print(run.message)
print(f"off the path by {np.abs(found - wanted).max():.1e} m, rad")
print(f"loops open by {run.closure_error:.1e} of the robot's length")
assert np.abs(found - wanted).max() < 1e-6

# The equations as the paper prints them, in NumPy: the same accelerations.
state = motion.state.at(100)
book = lw.lab.textbook.Textbook(robot.mechanism)
u = forces.values[100]
q, rates = state.positions, state.rates
printed = book.forward_dynamics(q, rates, u)
assert np.allclose(robot.forward_dynamics(state, u), printed, rtol=1e-10)

lw.views.save_figure(run.plot(["actuator_force", "joint_acceleration"]), "the_paper.svg")
