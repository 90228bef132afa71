"""Mechanisms unlike the 3-PRR through the whole interface: chains, sliders on turning bodies, spatial tools, turned frames."""

import numpy as np
import pytest

import linkwork as lw

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
    assert np.allclose(robot.tool_pose(state), [0.4 * np.cos(0.7), 0.4 * np.sin(0.7), 0.7], atol=1e-15)
    run = robot.simulate(state, duration=0.5, rtol=1e-10, atol=1e-12)
    energy = (run.dataset["kinetic_energy"] + run.dataset["potential_energy"]).values
    assert np.ptp(energy) < 1e-9


def test_turns_between_samples_far_apart_are_counted():
    robot = lw.Robot(pendulum().model_copy(update={"gravity": (0, 0, 0)}))
    run = robot.simulate(robot.home.with_rates([20.0]), duration=1.0, save_at=[0, 0.5, 1.0])
    assert np.allclose(run.dataset["joint_position"].values[:, 0], [0, 10, 20], atol=1e-7)


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
            connects=(names[i], names[i + 1]), axis=axis, frames=(lw.Frame(position=(0.3 * (i > 0), 0, 0)), lw.Frame())
        )
        for i, axis in enumerate(axes)
    }
    reference = {"joint_1": 0.2, "joint_2": -0.6, "joint_3": 1.1, "joint_4": 0.4, "joint_5": 0.7, "joint_6": 0.1}
    tool = lw.Tool(body="link_6", frame=lw.Frame(position=(0.1, 0.05, 0)))
    return lw.Mechanism(
        bodies=dict.fromkeys(names[1:], ROD),
        joints=joints,
        actuators=tuple(joints),
        reference=reference,
        tools={"hand": tool},
    )


def test_following_a_path_that_turns_in_space():
    """Rates and accelerations belong to the positions when the rotation vector changes its direction, too."""
    robot = lw.Robot(arm())
    start = robot.tool_pose(robot.home)
    path = lw.paths.line(start, np.add(start, [0.02, 0.05, -0.03, 0.3, -0.2, 0.4]))
    motion = robot.follow(path, duration=1.0, samples=401)
    h = motion.time[1]
    assert np.abs(np.gradient(motion.positions, h, axis=0) - motion.joint_rates)[2:-2].max() < 1e-3
    assert np.abs(np.gradient(motion.joint_rates, h, axis=0) - motion.joint_accelerations)[2:-2].max() < 1e-2
    forces = robot.inverse_dynamics(motion)
    run = robot.simulate(motion.state.at(0), forces, duration=1.0, rtol=1e-9, atol=1e-11, save_at=[1.0])
    assert np.allclose(run.dataset["tool_pose"].values[-1], motion.tool[-1], atol=1e-6)


def test_angles_are_asked_for_the_short_way_round():
    robot = lw.Robot(lw.robots.prr3())
    again = robot.assemble({"pivot_1": robot.home["pivot_1"] + 2 * np.pi, "slide_1": robot.home["slide_1"]})
    assert np.allclose(again.positions, robot.home.positions, atol=1e-12)


@pytest.mark.parametrize(
    ("sentence", "action"),
    [
        ("has mobility 0", lambda: lw.Robot(fixed())),
        ("names no tool; add one", lambda: lw.Robot(lw.robots.bricard()).assemble(tool=[1, 2, 3])),
        ("rates [nan] do not fit", lambda: lw.Robot(pendulum()).home.with_rates([np.nan])),
        ("rates [1.0, 2.0] do not fit", lambda: lw.Robot(pendulum()).home.with_rates([1.0, 2.0])),
        ("the generalised inertia is singular", lambda: massless()),
        ("its loops are open by", lambda: lw.Robot(lw.robots.prr3()).gravity(lw.Robot(lw.robots.prr3(l1=0.35)).home)),
        ("its rates are those of pivot_1", lambda: lw.Robot(lw.robots.prr3()).gravity(other_actuators().home)),
        (
            "the end is [0.5, 0.3, nan]; give 3 finite numbers",
            lambda: lw.Robot(lw.robots.prr3()).follow(lw.paths.line([0.5, 0.3, 0.5], [0.5, 0.3, np.nan]), 1.0),
        ),
    ],
)
def test_refusals(sentence, action):
    with pytest.raises(lw.LinkworkError) as refusal:
        action()
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def fixed():
    return lw.Mechanism(bodies={"a": ROD}, joints={"weld": lw.FixedJoint(connects=("ground", "a"))})


def massless():
    robot = lw.Robot(pendulum().model_copy(update={"bodies": {"rod": lw.Body(mass=0)}}))
    return robot.forward_dynamics(robot.home, [1.0])


def other_actuators():
    return lw.Robot(lw.robots.prr3().model_copy(update={"actuators": ("pivot_1", "slide_2", "slide_3")}))
