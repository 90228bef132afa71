"""The viewer: a hexapod in the browser, its platform dragged, its runs played.

Run it with `python 11_viewer.py --stay` and open the address that it prints. The address holds a
token: who does not have it is not let in.
"""

import sys

import numpy as np

import linkwork as lw
from linkwork.viewer import Viewer

robot = lw.Robot(lw.robots.stewart())
hold = np.asarray(robot.inverse_dynamics(robot.home, np.zeros(6)))
push = hold * (1.1, 1, 1, 1, 1, 1)  # one leg pushes a tenth more than the weight asks for
run = robot.simulate(robot.home, push, duration=1.0, save_at=np.linspace(0, 1, 101))

with Viewer(robot, run) as viewer:
    print("open", viewer.url)
    if "--stay" in sys.argv:
        viewer.wait()  # until Ctrl-C

# The same film without a server: one page that plays in any browser, and the poses in one picture.
lw.views.write_report(robot, run, "report.html")
lw.views.save_figure(lw.views.plot_motion(robot, run, poses=4), "viewer.svg")
