"""A live model of Pinocchio has the robot's accelerations, with its loops closed by constraints."""

import numpy as np
import pytest

import linkwork as lw

from tests.oracle.random_joints import random_tree

pytest.importorskip("pinocchio")
ROBOTS = ["prr3", "five_bar", "double_pendulum", "slider_crank", "n_four_bar"]
SPATIAL = ["stewart", "hexaglide", "agile_wrist", "bennett", "spatial_slider_crank"]
CLOSE = 1e-9
KINDS = ("spherical", "planar", "screw", "free", "universal", "prismatic", "cylindrical")


def drawn(robot, seed=1):
    """Return a state beside home with random rates, and random forces."""
    rng = np.random.default_rng(seed)
    positions = robot.home.positions + 0.02 * rng.standard_normal(len(robot.coordinates))
    state = robot.state(positions, 0.5 * rng.standard_normal(robot.mobility), tolerance=0.5)
    return state, rng.standard_normal(len(robot.actuators))


def error(robot, state, forces):
    """Return the greatest difference of accelerations over the greatest of them."""
    found = robot.to_pinocchio().accelerations(state, forces)
    v_dot = robot.forward_dynamics(state, forces)
    exact = dict(zip(robot.rates, robot.joint_accelerations(state, v_dot), strict=True))
    assert {*robot.independent} <= {*found}
    apart = max(abs(value - exact[name]) for name, value in found.items())
    return apart / max(map(abs, exact.values()))


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", ROBOTS + SPATIAL)
def test_closed_robots_move_alike(name):
    robot = lw.Robot(name)
    assert error(robot, *drawn(robot)) < CLOSE


@pytest.mark.sample(1)
@pytest.mark.parametrize(("seed", "kinds"), [(0, KINDS), (1, KINDS[::-1]), (2, KINDS)])
def test_trees_of_all_joints_move_alike(seed, kinds):
    mechanism = random_tree(seed, 7, kinds=kinds)
    turning = tuple(
        name for name in mechanism.actuators if not name.rpartition(".")[2].startswith("w")
    )
    robot = lw.Robot(mechanism.model_copy(update={"actuators": turning}))
    assert error(robot, *drawn(robot, seed)) < CLOSE


@pytest.mark.parametrize("name", ["puma560", "andrews"])
def test_springs_and_friction_of_robots_act(name):
    robot = lw.Robot(name)
    state, forces = drawn(robot)
    assert np.abs(robot.to_pinocchio().applied(state)).max() > 0.1
    assert error(robot, state, forces) < CLOSE


@pytest.mark.sample(1)
@pytest.mark.parametrize(("seed", "kinds"), [(3, KINDS), (4, KINDS[::-1])])
def test_what_acts_in_trees_of_all_joints_acts(seed, kinds):
    """Springs and friction in every freedom, balls too, forwards and backwards."""
    mechanism = random_tree(seed, 7, kinds=kinds)
    laws = {
        "friction": lw.Friction(viscous=0.3, coulomb=0.2),
        "spring": lw.Spring(stiffness=2.0, damping=0.1),
    }
    joints = {}
    for name, joint in mechanism.joints.items():
        parts = [part.name for part in joint.parts(name)]
        single = isinstance(joint.friction, lw.Friction)
        own = {key: law if single else dict.fromkeys(parts, law) for key, law in laws.items()}
        joints[name] = type(joint).model_validate({**dict(joint), **own})
    robot = lw.Robot(mechanism.model_copy(update={"joints": joints, "actuators": ()}))
    live, (state, _) = robot.to_pinocchio(), drawn(robot, seed)
    assert np.count_nonzero(np.abs(live.applied(state)) > 1e-3) > len(kinds)
    assert error(robot, state, ()) < CLOSE


def test_contacts_act():
    """A ball that has sunk 1 mm into the floor and slides."""
    floor = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=1e4,
        friction={"coefficient": 0.3},
    )
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.004, yy=0.004, zz=0.004))
    mechanism = lw.Mechanism(
        name="ball",
        bodies={"ball": body},
        joints={"free": lw.FreeJoint(connects=("ground", "ball"))},
        contacts={"floor": floor},
        gravity=(0.0, 0.0, -9.81),
    )
    robot = lw.Robot(mechanism)
    state = robot.state([0.0, 0.0, 0.099, 1.0, 0.0, 0.0, 0.0]).with_rates([0.3, *[0.0] * 5])
    assert robot.to_pinocchio().applied(state)[2] == pytest.approx(1e4 * 0.001**1.5, rel=1e-6)
    assert error(robot, state, ()) < CLOSE


def test_a_state_is_read_back():
    robot = lw.Robot(random_tree(0, 3, kinds=("spherical", "screw", "revolute")))
    robot = lw.Robot(robot.mechanism.model_copy(update={"actuators": ()}))
    live, (state, _) = robot.to_pinocchio(), drawn(robot)
    q, v = live.configuration(state)
    again = robot.state(live.positions(q), live.rates(q, v))
    assert live.configuration(again)[0] == pytest.approx(q, abs=1e-12)
    assert robot.joint_rates(again) == pytest.approx(robot.joint_rates(state), abs=1e-12)


def test_free_numbers_have_their_values():
    robot = lw.Robot("prr3").free("platform.mass").with_parameters({"platform.mass": 5.0})
    assert error(robot, *drawn(robot)) < CLOSE


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("delta", r"joints\.rod_1_left: is a rod"),
        ("rrs3", "platform: all of its joints close loops"),
    ],
)
def test_what_pinocchio_cannot_hold_is_refused(name, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        lw.Robot(name).to_pinocchio()


def test_bristles_are_refused():
    mechanism = lw.robots.prr3()
    friction = lw.Friction(coulomb=0.2, bristle=lw.Bristle(stiffness=1e4))
    slide = mechanism.joints["slide_1"].model_copy(update={"friction": friction})
    joints = {**mechanism.joints, "slide_1": slide}
    with pytest.raises(
        lw.LinkworkError, match="Pinocchio leaves out friction that sticks by bristles"
    ):
        lw.Robot(mechanism.model_copy(update={"joints": joints})).to_pinocchio()


def test_what_does_not_fit_is_refused(monkeypatch):
    robot = lw.Robot("prr3")
    live = robot.to_pinocchio()
    with pytest.raises(lw.LinkworkError, match=r"the robot is 'prr3'; give a linkwork\.Robot"):
        lw.export.pinocchio("prr3")
    stack = robot.assemble({f"slide_{i}": np.full(2, 0.16) for i in (1, 2, 3)})
    with pytest.raises(lw.LinkworkError, match="one state, not a stack"):
        live.configuration(stack)
    for forces in ([1.0, 2.0], [np.nan, 0.0, 0.0], {"pivot_1": 1.0}, np.zeros((2, 3))):
        with pytest.raises(lw.LinkworkError, match=r"force|actuator"):
            live.accelerations(robot.home, forces)
    monkeypatch.setitem(__import__("sys").modules, "pinocchio", None)
    with pytest.raises(lw.LinkworkError, match=r"pip install 'linkwork\[engines\]'"):
        robot.to_pinocchio()


def test_rotors_are_armature():
    mechanism = lw.robots.prr3()
    slide = mechanism.joints["slide_1"].model_copy(update={"rotor_inertia": 0.3})
    joints = {**mechanism.joints, "slide_1": slide}
    robot = lw.Robot(mechanism.model_copy(update={"joints": joints}))
    assert error(robot, *drawn(robot)) < CLOSE
    assert max(robot.to_pinocchio().model.armature) == 0.3
