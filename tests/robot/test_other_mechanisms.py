"""Mechanisms unlike the 3-PRR through the whole interface: chains, sliders on turning bodies,
spatial tools, turned frames."""

import numpy as np
import pytest

import linkwork as lw

from tests.robot.oracle_state import Seen

ROD = lw.Body(mass=1.5, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(xx=0.01, yy=0.03, zz=0.03))


def pendulum(tool=None):
    return lw.Mechanism(
        gravity=(0, -9.81, 0),
        bodies={"rod": ROD},
        joints={"hinge": lw.RevoluteJoint(connects=("ground", "rod"))},
        actuators=("hinge",),
        tools={"tip": tool or lw.Tool(body="rod", frame=lw.Frame.planar(0.4))},
    )


def test_a_pendulum_through_every_method():
    """(I + m c^2) q'' + m g c cos q = u, in closed form."""
    robot = lw.Robot(pendulum())
    state = robot.assemble({"hinge": 0.7}).with_rates([2.0])
    inertia, weight = 0.03 + 1.5 * 0.04, 1.5 * 9.81 * 0.2 * np.cos(0.7)
    assert np.allclose(robot.mass_matrix(state), [[inertia]], rtol=1e-14)
    assert np.allclose(robot.coriolis(state), [0], atol=1e-15)
    assert np.allclose(robot.gravity(state), [weight], rtol=1e-14)
    assert np.allclose(robot.forward_dynamics(state, [1.0]), [(1 - weight) / inertia], rtol=1e-14)
    assert np.allclose(robot.inverse_dynamics(state, [3.0]), [3 * inertia + weight], rtol=1e-14)
    assert np.allclose(
        robot.tool_pose(state), [0.4 * np.cos(0.7), 0.4 * np.sin(0.7), 0.7], atol=1e-15
    )
    run = robot.simulate(state, duration=0.5, rtol=1e-10, atol=1e-12)
    energy = (run["kinetic_energy"] + run["potential_energy"]).values
    assert np.ptp(energy) < 1e-9


def test_turns_of_a_tree_joint_between_samples_far_apart_are_counted():
    robot = lw.Robot(pendulum().model_copy(update={"gravity": (0, 0, 0)}))
    run = robot.simulate(robot.home.with_rates([20.0]), duration=1.0, save_at=[0, 0.5, 1.0])
    assert np.allclose(run["joint_position"].values[:, 0], [0, 10, 20], atol=1e-7)


def test_turns_of_a_joint_that_closes_a_loop_do_not_depend_on_the_times_that_are_saved():
    """The short coupler turns all round between crank and rocker; all angles add up to the same at
    every time."""
    mechanism = lw.robots.four_bar(
        ground=0.5, crank=0.6, coupler=0.3, rocker=0.7, gravity=(0, 0, 0)
    )
    reference = {"crank_pivot": 1.0, "crank_pin": 0.3, "rocker_pivot": 1.5, "rocker_pin": 0.2}
    robot = lw.Robot(
        mechanism.model_copy(update={"reference": reference, "actuators": ("crank_pin",)})
    )
    start = robot.home.with_rates([20.0])
    ends = []
    for times in (None, [0.0, 1.0]):
        run = robot.simulate(start, duration=1.0, save_at=times)
        named = dict(zip(robot.coordinates, run["joint_position"].values.T, strict=True))
        total = (
            named["crank_pivot"] + named["crank_pin"] - named["rocker_pivot"] + named["rocker_pin"]
        )
        assert np.abs(total - total[0]).max() < 1e-9
        ends.append(run["joint_position"].values[-1])
    assert ends[0][1] > 12
    assert np.abs(ends[1] - ends[0]).max() < 1e-6


@pytest.mark.parametrize(("rotation", "angle"), [((np.pi, 0, 0), 0.3), ((0, 0, 1.0), 1.3)])
def test_the_angle_of_a_turned_tool_is_that_of_its_x_axis(rotation, angle):
    robot = lw.Robot(pendulum(lw.Tool(body="rod", frame=lw.Frame(rotation=rotation))))
    assert np.isclose(robot.tool_pose(robot.assemble({"hinge": 0.3}))[2], angle, atol=1e-14)


def test_a_slider_on_a_turning_body_is_planar():
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "rod")),
        "slide": lw.PrismaticJoint(connects=("rod", "hand"), axis=(1, 0, 0)),
    }
    mechanism = lw.Mechanism(
        bodies={"rod": ROD, "hand": ROD},
        joints=joints,
        actuators=("hinge", "slide"),
        tools={"hand": lw.Tool(body="hand")},
    )
    robot = lw.Robot(mechanism.model_copy(update={"reference": {"slide": 0.5}}))
    assert robot.planar
    state = robot.assemble(tool=[0.3, 0.4])
    assert np.allclose([state["hinge"], state["slide"]], [np.arctan2(0.4, 0.3), 0.5], atol=1e-12)


def arm():
    """Return a spatial 6R arm with a tool."""
    axes = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    names = ["ground", *(f"link_{i}" for i in range(1, 7))]
    joints = {
        f"joint_{i + 1}": lw.RevoluteJoint(
            connects=(names[i], names[i + 1]),
            axis=axis,
            frames=(lw.Frame(position=(0.3 * (i > 0), 0, 0)), lw.Frame()),
        )
        for i, axis in enumerate(axes)
    }
    reference = {
        "joint_1": 0.2,
        "joint_2": -0.6,
        "joint_3": 1.1,
        "joint_4": 0.4,
        "joint_5": 0.7,
        "joint_6": 0.1,
    }
    tool = lw.Tool(body="link_6", frame=lw.Frame(position=(0.1, 0.05, 0)))
    return lw.Mechanism(
        bodies=dict.fromkeys(names[1:], ROD),
        joints=joints,
        actuators=tuple(joints),
        reference=reference,
        tools={"hand": tool},
    )


def test_following_a_path_that_turns_in_space():
    """Rates and accelerations belong to the positions when the rotation vector changes its
    direction, too."""
    robot = lw.Robot(arm())
    start = robot.tool_pose(robot.home)
    path = lw.paths.line(start, np.add(start, [0.02, 0.05, -0.03, 0.3, -0.2, 0.4]))
    motion = robot.follow(path, duration=1.0, samples=201)
    h = motion.time[1]
    assert np.abs(np.gradient(motion.positions, h, axis=0) - motion.joint_rates)[2:-2].max() < 4e-3
    assert (
        np.abs(np.gradient(motion.joint_rates, h, axis=0) - motion.joint_accelerations)[2:-2].max()
        < 4e-2
    )
    forces = robot.inverse_dynamics(motion)
    run = robot.simulate(
        motion.state.at(0), forces, duration=1.0, rtol=1e-9, atol=1e-11, save_at=[1.0]
    )
    assert np.allclose(run["tool_pose"].values[-1], motion.tool[-1], atol=1e-6)


def test_an_angle_a_turn_on_is_the_same_pose_and_keeps_its_turn():
    robot = lw.Robot(lw.robots.prr3())
    asked = robot.home["pivot_1"] + 2 * np.pi
    again = robot.assemble({"pivot_1": asked, "slide_1": robot.home["slide_1"]})
    assert again["pivot_1"] == pytest.approx(asked, abs=1e-12)
    turns = (again.positions - robot.home.positions) / np.where(
        robot.labels.angular, 2 * np.pi, 1e6
    )
    assert np.allclose(turns, np.round(turns), atol=1e-12)


@pytest.mark.parametrize("legs", [0, 1, 3])
def test_a_floating_robot_without_loops_falls_freely_and_keeps_its_angular_momentum(legs):
    """p = M g t and L about the mass centre are those at the start, whatever the motors in the hips
    do."""
    gravity = np.array([0.0, 0.0, -9.81])
    leg = lw.Body(
        mass=0.5, centre_of_mass=(0, 0, -0.2), inertia=lw.Inertia(xx=0.02, yy=0.02, zz=0.001)
    )
    bodies = {"base": lw.Body(mass=2.0, inertia=lw.Inertia(xx=0.1, yy=0.15, zz=0.2))}
    joints = {"float": lw.FreeJoint(connects=("ground", "base"))}
    for i in range(legs):
        frames = (lw.Frame(position=(0.2 * i, 0.1, 0)), lw.Frame())
        joints[f"hip_{i}"] = lw.RevoluteJoint(
            connects=("base", f"leg_{i}"), axis=(0, 1, 0.2 * i), frames=frames
        )
        bodies[f"leg_{i}"] = leg
    hips = tuple(joints)[1:]
    robot = lw.Robot(
        lw.Mechanism(gravity=tuple(gravity), bodies=bodies, joints=joints, actuators=hips)
    )
    start = robot.home.with_rates(
        dict(zip(robot.independent, np.linspace(-0.5, 0.8, robot.mobility), strict=True))
    )
    torques = dict.fromkeys(hips, 0.2)
    run = robot.simulate(
        start, torques, duration=1.0, save_at=[0.0, 0.4, 1.0], rtol=1e-10, atol=1e-12
    )
    assert run.status is lw.Status.FINISHED
    named = [dict(zip(robot.rates, rates, strict=True)) for rates in run["joint_rate"].values]
    states = [
        robot.state(positions, {name: rates[name] for name in robot.independent})
        for positions, rates in zip(run["joint_position"].values, named, strict=True)
    ]
    linear, angular = np.transpose([momenta(robot, state) for state in states], (1, 0, 2))
    mass = 2.0 + 0.5 * legs
    assert np.allclose(linear - linear[0], mass * np.outer([0, 0.4, 1.0], gravity), atol=1e-9)
    assert np.allclose(angular, angular[0], atol=1e-9)
    assert np.abs(angular[0]).max() > 0.01
    Seen.of(robot, states[-1]).agree([0.2] * legs, 1e-10)
    ensemble = robot.ensemble(start, torques, duration=1.0, rtol=1e-10, atol=1e-12)
    assert np.allclose(ensemble.final.at(0).positions, states[-1].positions, atol=1e-9)
    halves = [robot.simulate(start, torques, duration=0.5, rtol=1e-10, atol=1e-12)]
    halves.append(robot.resume(halves[0], torques, duration=0.5, rtol=1e-10, atol=1e-12))
    assert np.allclose(halves[1]["joint_position"].values[-1], states[-1].positions, atol=1e-9)


def momenta(robot, state):
    """Return the momentum and the angular momentum about the mass centre, body by body."""
    parts = []
    for (name, body), twist in zip(
        robot.mechanism.bodies.items(), robot.twists(state), strict=True
    ):
        p, R = robot.body_poses(state)[name]
        inertia = R @ np.diag([body.inertia.xx, body.inertia.yy, body.inertia.zz]) @ R.T
        parts.append((body.mass, p + R @ body.centre_of_mass, twist[:3], twist[3:], inertia))
    masses = np.array([part[0] for part in parts])
    centre = masses @ [part[1] for part in parts] / masses.sum()
    linear = sum(m * v for m, _, _, v, _ in parts)
    return linear, sum(m * np.cross(c - centre, v) + inertia @ w for m, c, w, v, inertia in parts)
