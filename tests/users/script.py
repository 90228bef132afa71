# pyright: strict, reportUnknownMemberType=false
"""A script such as users write, over the public names: pyright checks it strictly, and it runs.

Types of other packages are not complete: what is unknown of their members is left to them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import linkwork as lw
from linkwork import analysis, control, formats, motions, paths, simulation, sweeps, views

lw.robots.five_bar().save("five-bar.yaml")
Path("model.urdf").write_text(
    '<robot name="arm"><link name="base"/><link name="arm"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="pin" type="continuous"><parent link="base"/><child link="arm"/>'
    '<axis xyz="0 1 0"/></joint></robot>'
)
Path("study.yaml").write_text(
    "study: 1\nrobot: pendulum\nduration: 0.1\n"
    "vary: {rod_1.mass: {type: levels, low: 1, high: 2, count: 3}}\n"
    "outputs: {energy: final energy}\n"
)
robot = lw.Robot("prr3")
other = lw.Robot(Path("five-bar.yaml"))
third = lw.Robot.from_file("five-bar.yaml")
mech: lw.Mechanism = lw.robots.five_bar()
bar = lw.Mechanism(
    name="pendulum",
    gravity=(0, -9.81, 0),
    bodies={"bar": lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))},
    joints={
        "hinge": lw.RevoluteJoint(
            connects=("ground", "bar"),
            friction=lw.Friction(viscous=0.1),
            spring=lw.Spring(stiffness=1.0),
            limits=lw.Limits(lower=-3, upper=3),
        )
    },
    actuators=("hinge",),
    tools={"tip": lw.Tool(body="bar", frame=lw.Frame.planar(1.0, 0.0))},
)
bar.save("bar.yaml")
pendulum = lw.Robot(bar, independent=["hinge"], free=["bar.mass"])
heavy: lw.Robot = pendulum.with_parameters({"bar.mass": 2.0})
free = pendulum.free("bar.com.x")

state: lw.State = robot.assemble(tool=[0.5, 0.29, 1.2])
value = float(state["slide_1"])
moving = state.with_rates([0.1, 0.0, 0.0])
started = robot.state(state.positions, {"slide_1": 0.1})
chart = robot.in_chart(moving, ["slide_1", "slide_3", "pivot_1"])

path = paths.together(paths.circle([0.45, 0.29], 0.05), paths.swing(1.2, 0.2))
motion: lw.Motion = robot.follow(path, duration=1.0, samples=501)
forces = robot.inverse_dynamics(motion)
u = robot.inverse_dynamics(moving, [0.0, 0.0, 1.0])
norm = float(np.linalg.norm(u))
acceleration = robot.forward_dynamics(moving, {"slide_1": 2.0})
M, C, G, f = (
    robot.mass_matrix(state),
    robot.coriolis(state),
    robot.gravity(state),
    robot.passive_forces(state),
)
kinetic, potential = robot.energy(moving)
origin, turn = robot.body_poses(state)["platform"]
wrench = robot.reactions(moving, u)["pivot_1"]
held = robot.holding_forces(state)
model = robot.linearise(state, held)
poles: np.ndarray = model.poles

run: lw.Run = robot.simulate(motion.state.at(0), forces, duration=1.0, samples=101)
print(run.status is lw.Status.FINISHED, run.message, run.final["slide_1"], run.time[-1])
positions = run["joint_position"].sel(coordinate="slide_1").values
data = run.dataset["tool_pose"].values
fine = run.resampled(501)
run.save("run.nc")
loaded = lw.Run.load("run.nc")
longer = robot.resume(loaded, [0.0, 0.0, 0.0], duration=0.5)
run.plot(["tool_pose"]).savefig("run.svg")


def law(t: float, state: control.Observation) -> dict[str, object]:
    kp = state.parameter("kp", 400.0)
    return {"slide_1": kp * (0.2 - state["slide_1"]) - 40 * state.rate("slide_1")}


soft = robot.simulate(robot.home, law, duration=0.5, parameters={"kp": 900.0})
pd = control.PD(robot.home, kp=100.0, kd=10.0)
gravity = control.PDWithGravity(robot.home, 100.0, 10.0, robot)
pid = control.PID(robot.home, 100.0, 10.0, ki={"slide_1": 1.0, "slide_2": 1.0, "slide_3": 2.0})
ct = control.ComputedTorque(motion, 400.0, 40.0, robot)
sm = control.SlidingMode(motion, 10.0, 20.0, 0.1, robot)
lqr = control.LQR.about(robot, robot.home, np.ones(6), np.ones(3))
sampled = control.Sampler(ct, rate=1000, delay=1e-3)
motor = control.DCMotor(resistance=1.2, inductance=2e-3, torque_constant=0.05, gear=400.0)
event = control.Event(lambda t, s: s["slide_1"] - 0.3, terminal=True, name="far")
push = control.Wrench("platform", force=lambda t, s: (5 * lw.math.sin(10 * t), 0.0, 0.0))
driven = robot.simulate(
    robot.home,
    pd,
    duration=0.5,
    drives={"slide_1": motor},
    wrenches=[push],
    events=[event],
    method="rodas",
)
members: lw.Ensemble = robot.ensemble(
    robot.home, law, {"kp": np.linspace(100, 900, 8)}, duration=0.5, samples=11, progress=True
)
print(members.failed, members.final["slide_1"], members.message(0))

modes = analysis.working_modes(robot, [0.5, 0.29, 1.2])
nearest: lw.State = modes[0]
assert next(mode["pivot_1"] for mode in modes) == nearest["pivot_1"]
for mode in modes.states:
    print(mode["slide_1"])
told = analysis.singularity(robot, state)
mapped = analysis.workspace(robot, {"x": np.linspace(0, 1, 5), "y": 0.3, "angle": 0.5})
natural = analysis.natural_modes(robot, state)
rest = analysis.equilibrium(pendulum)
base = analysis.base_parameters(robot)
found = analysis.identify(robot, run)
views.save_figure(views.plot_mechanism(robot, robot.home, names=True), "pose.svg")
views.save_figure(views.plot_motion(robot, run), "motion.svg")
views.save_figure(views.plot_mechanism(robot, state).figure, "axes.svg")
views.write_report(robot, run, "report.html")
imported = formats.load("model.urdf")
notes: tuple[str, ...] = formats.save(imported.mechanism, "model.yaml")
timed = motions.point_to_point(
    {"slide_1": 0.1}, {"slide_1": 0.2}, motions.AxisLimits(1.0, 2.0, 20.0)
)
study = sweeps.Study.load("study.yaml")
signal = lw.Sampled(np.linspace(0, 1, 5), np.zeros((5, 3)), "linear")
assert simulation.Status.FINISHED is lw.Status.FINISHED
try:
    robot.assemble(tool=[9.0, 9.0, 0.0])
except lw.UnreachableError as error:
    print(error)
