"""Computed torque: a controller that knows the robot's dynamics, and one that is wrong about them.

A controller is compiled into the equations of motion: it costs a few instructions per evaluation,
not a call of Python. Its gains are free numbers, changed without compiling anything anew.
"""

import numpy as np

import linkwork as lw
from linkwork import control

robot = lw.Robot(lw.robots.prr3())
path = lw.paths.together(lw.paths.circle([0.48, 0.3], 0.04), lw.paths.swing(1.2, 0.2))
motion = robot.follow(path, duration=1.0, samples=501)
beside = robot.assemble(tool=[0.51, 0.31, 1.15])  # not where the path begins


def error(law, **gains):
    """Start beside the path; return the run, and how far the tool is from the path over time."""
    run = robot.simulate(beside, law, duration=1.0, parameters=gains, save_at=motion.time)
    gap = run.dataset["tool_pose"].values[:, :2] - motion.tool[:, :2]
    return run, np.linalg.norm(gap, axis=1)


# The model that the controller believes in: the robot itself, or one with a platform too heavy.
exact = control.ComputedTorque(motion, model=robot, kp=400.0, kd=40.0)
heavy = lw.Robot(lw.robots.prr3(platform_mass=2.0))
wrong = control.ComputedTorque(motion, model=heavy, kp=400.0, kd=40.0)

for name, law, gains in (
    ("exact model", exact, {}),
    ("wrong model", wrong, {}),
    ("wrong model, stiffer", wrong, {"kp": 3600.0, "kd": 120.0}),
):
    run, gap = error(law, **gains)
    gap *= 1e3  # mm
    print(f"{name}: {gap[0]:.1f} mm at first, {gap[250:].max():.4f} mm in the second half")

lw.views.save_figure(run.plot(["tool_pose", "actuator_force"]), "computed_torque.svg")
