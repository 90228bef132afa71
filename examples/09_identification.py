"""Identification: masses and friction of a five-bar from measured motions and motor torques.

Not all masses can be told from motions of a robot with closed loops: the base parameters can. A
periodic motion that tells them apart well is planned, run (here: simulated, with noise), and
measured by a Fourier series; least squares give the parameters with their deviations.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkwork as lw
from linkwork import analysis

robot = lw.Robot(lw.robots.five_bar())
ranges = {name: (robot.home[name] - 0.5, robot.home[name] + 0.5) for name in robot.actuators}
bounds = {"ranges": ranges, "rates": 6.0, "accelerations": 60.0}
plan = analysis.exciting_trajectory(robot, period=2.0, trials=60, **bounds)
print(f"condition of the regressor: {plan.condition:.1f}")

# The measurement: encoders and torques, one sample each millisecond, with noise.
motion = plan.motion(robot, samples=2001)
random = np.random.default_rng(3)
angles = np.stack([motion.state[name] for name in robot.actuators], axis=-1)[:-1]
torques = robot.inverse_dynamics(motion).values[:-1]
angles = angles + random.normal(0, 1e-5, angles.shape)  # rad
torques = torques + random.normal(0, 0.02, torques.shape)  # N m

measured = analysis.periodic(robot, motion.time[:-1], angles, torques, period=2.0, harmonics=3)
found = analysis.identify(robot, measured)
for i, name in enumerate(found.names):
    value, true = found.values[i], found.described[i]
    print(f"{value:9.5f} +- {found.deviations[i]:.5f} (true {true:9.5f})  {name}")
assert (np.abs(found.values - found.described) < 5 * found.deviations).all()

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
off = found.values - found.described
axes.errorbar(range(len(off)), off, 2 * found.deviations, fmt="o", capsize=4)
axes.axhline(0, color="gray", linewidth=0.8)
axes.set(xlabel="base parameter", ylabel="found less true, with two deviations")
lw.views.save_figure(figure, "identification.svg")
