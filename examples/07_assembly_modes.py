"""Assembly modes: the poses that one set of actuator positions allows, and the other way round.

A planar platform on three legs can be assembled in up to six ways, in two where base and platform
are similar triangles, as here. All are found, and the search says whether it is sure of that.
"""

import matplotlib.pyplot as plt

import linkwork as lw
from linkwork import analysis

robot = lw.Robot(lw.robots.rpr3())
legs = dict(zip(robot.actuators, [0.47, 0.52, 0.36], strict=True))  # m
modes = analysis.assembly_modes(robot, legs)
print(len(modes), "ways to assemble it; all found:", modes.sure)
for state in modes.states:
    x, y, angle = robot.tool_pose(state)
    print(f"  platform at ({x:.4f}, {y:.4f}) m, turned by {angle:.4f} rad")
    assert robot.closure_error(state) < 1e-12

# The other way round, the working modes: each leg of a five-bar may be bent to either side.
five_bar = lw.Robot(lw.robots.five_bar())
pose = five_bar.tool_pose(five_bar.home)
working = analysis.working_modes(five_bar, pose[:2])
print(len(working), "ways to reach one point with a five-bar")

figure, places = plt.subplots(1, len(working), figsize=(10, 3), layout="constrained")
for place, state in zip(places, working.states, strict=True):
    lw.views.plot_mechanism(five_bar, state, place)
lw.views.save_figure(figure, "assembly_modes.svg")
