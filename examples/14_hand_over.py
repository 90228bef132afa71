"""The model leaves: a stepper for a control program, C for a controller, an FMU for simulators.

A stepper is the robot in a loop that something else keeps: hardware, a bus, one's own program. What
is written as C or as an FMU are the same equations, without Linkwork.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkwork as lw

robot = lw.Robot("five_bar")
stepper = robot.stepper(robot.home, dt=1e-3)
x, y = robot.tool_pose(robot.home)[:2]
goal = robot.assemble(tool=[x + 0.06, y - 0.05])
motors = [goal.coordinates.index(name) for name in robot.actuators]
wanted, tick = goal.positions[motors], 2 * np.pi / 4096  # rad of an encoder


# One's own controller, at 1 kHz: encoders are read, their differences are the rates.
def controlled(stepper, seconds, kp=30.0, kd=1.5):
    """Lead the motors to what is wanted; return times, and how far the motors are off."""
    before, off = None, []
    for _ in range(round(seconds / stepper.dt)):
        read = np.round(stepper.positions[motors] / tick) * tick
        rates = 0 * read if before is None else (read - before) / stepper.dt
        stepper.step(kp * (wanted - read) - kd * rates)
        before = read
        off.append(wanted - stepper.positions[motors])
    return np.arange(1, len(off) + 1) * stepper.dt, np.array(off)


time, off = controlled(stepper, 1.0)
print(stepper, f"the loops are open by {stepper.closure_error:.1e} of the robot's length")
print(f"the motors stay off by {np.abs(off[-1]).max():.1e} rad; an encoder counts {tick:.1e} rad")

# What the controller asked for goes on as any state does, in a run.
rest = robot.resume(stepper.run, duration=0.2)
print(rest.message)

# The same equations as C99 and as a Functional Mock-up Unit (its sources; platforms adds binaries).
for export, path in (
    (lw.export.c(robot, ["motion", "step_rk4", "start"], name="five_bar"), "five_bar_c"),
    (lw.export.fmu(robot, "3.0", platforms=()), "five_bar.fmu"),
):
    export.write(path)
    print(export)

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(time, np.degrees(off), label=list(robot.actuators))
axes.set(xlabel="time / s", ylabel="error / °")
axes.legend()
lw.views.save_figure(figure, "hand_over.svg")
