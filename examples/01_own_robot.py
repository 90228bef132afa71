"""Your own robot: a five-bar, described in code and in a file.

A mechanism is bodies and joints between them. A loop is nothing special: it is what one gets when
joints close a cycle. Which joint is cut is never said, and nothing is tuned.
"""

import linkwork as lw

# In code: a frame of a joint is given on both of its bodies; left out, it is the body's own frame.
crank, rod, base = 0.2, 0.35, 0.3  # m
at = lw.Frame.planar  # (x, y, angle) in the plane


def bar(length, mass):
    """A slender bar along its x axis."""
    inertia = lw.Inertia(zz=mass * length**2 / 12)
    return lw.Body(mass=mass, centre_of_mass=(length / 2, 0, 0), inertia=inertia)


in_code = lw.Mechanism(
    name="five-bar",
    gravity=(0, -9.81, 0),
    bodies={
        "left": bar(crank, 0.4),
        "right": bar(crank, 0.4),
        "rod_1": bar(rod, 0.5),
        "rod_2": bar(rod, 0.5),
    },
    joints={
        "motor_1": lw.RevoluteJoint(connects=("ground", "left")),
        "motor_2": lw.RevoluteJoint(connects=("ground", "right"), frames=(at(base), at())),
        "elbow_1": lw.RevoluteJoint(connects=("left", "rod_1"), frames=(at(crank), at())),
        "elbow_2": lw.RevoluteJoint(connects=("right", "rod_2"), frames=(at(crank), at())),
        "pin": lw.RevoluteJoint(connects=("rod_1", "rod_2"), frames=(at(rod), at(rod))),
    },
    actuators=("motor_1", "motor_2"),
    tools={"pen": lw.Tool(body="rod_1", frame=at(rod))},
    reference={"motor_1": 2.2, "motor_2": 0.9, "elbow_1": -1.2, "elbow_2": 1.2},
)

# In a file: the same fields in YAML. `linkwork info five-bar.yaml` reads it as well.
in_code.save("five-bar.yaml")
robot = lw.Robot.from_file("five-bar.yaml")
assert robot.mechanism == in_code

# The reference is a rough guess: the loops are closed from there, and two freedoms are counted.
print(robot.mobility, "freedoms; home:", robot.home.positions.round(3))
print("forces that hold it:", robot.inverse_dynamics(robot.home, [0, 0]).round(3), "N m")

lw.views.save_figure(lw.views.plot_mechanism(robot, robot.home, names=True), "own_robot.svg")
