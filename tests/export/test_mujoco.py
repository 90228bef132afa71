"""A live model of MuJoCo moves as the robot does: open chains to rounding, loops to what MuJoCo's
constraints give way."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import (
    Body,
    Frame,
    FreeJoint,
    Inertia,
    Mechanism,
    PlanarJoint,
    RodJoint,
)

from tests.oracle.random_joints import random_tree

LOOPS = {  # about thrice what is left of MuJoCo's softness, relative to the greatest acceleration
    "prr3": 4e-7,
    "five_bar": 1e-7,
    "stewart": 1e-7,
    "agile_wrist": 1e-7,
    "bennett": 1e-7,
    "rrs3": 3e-7,
    "slider_crank": 4e-7,
}
RODS = ("delta", "linear_delta", "orthoglide", "par4")
ROUNDING = 1e-9
TREE = ("spherical", "planar", "cylindrical", "free", "universal", "prismatic", "revolute")
SCREWS = 6e-7
"""Screws are a hinge and a slide that MuJoCo's constraints couple, in trees, too."""


def drawn(robot, seed=1):
    """Return a state beside home with random rates, and random forces."""
    rng = np.random.default_rng(seed)
    positions = robot.home.positions + 0.02 * rng.standard_normal(len(robot.coordinates))
    state = robot.state(positions, 0.5 * rng.standard_normal(robot.mobility), tolerance=0.5)
    return state, rng.standard_normal(len(robot.actuators))


def errors(robot, live, state, forces):
    """Return how far coordinates, rates and accelerations are apart, the last one relative to the
    greatest one."""
    data = live.data(state, forces)
    v_dot = robot.forward_dynamics(state, forces)
    exact = dict(zip(robot.rates, robot.joint_accelerations(state, v_dot), strict=True))
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    found, greatest = live.accelerations(data), max(map(abs, exact.values()))
    return (
        apart(robot, live.positions(data), state),
        max(abs(value - rates[name]) for name, value in live.rates(data).items()),
        max(abs(value - exact[name]) for name, value in found.items()) / greatest,
    )


def apart(robot, positions, state):
    """Return the greatest difference of coordinates; a quaternion may have either sign."""
    found = []
    for name, joint in robot.mechanism.pairs.items():
        for part in joint.parts(name):
            if part.coordinates[0] in positions:
                ours = np.array([state[label] for label in part.coordinates])
                theirs = np.array([positions[label] for label in part.coordinates])
                other = ours + theirs if len(ours) == 4 else ours - theirs
                found.append(min(np.abs(ours - theirs).max(), np.abs(other).max()))
    return max(found)


@pytest.mark.parametrize("name", LOOPS)
def test_closed_robots_move_alike(name):
    robot = lw.Robot(name)
    live = robot.to_mujoco()
    positions, rates, accelerations = errors(robot, live, *drawn(robot))
    assert positions < 1e-12 and rates < 1e-12
    assert accelerations < LOOPS[name]
    assert any("soft" in note for note in live.notes)


def test_the_softness_is_mujocos_own_at_one():
    robot = lw.Robot("prr3")
    state, forces = drawn(robot)
    soft, stiff = (
        errors(robot, lw.export.mujoco(robot, softness), state, forces)[2] for softness in (1, 0.01)
    )
    assert soft == pytest.approx(100 * stiff, rel=0.05)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("seed", "kinds", "bound"),
    [
        (0, TREE, ROUNDING),
        (1, TREE[::-1], ROUNDING),
        (2, TREE, ROUNDING),
        (3, ("screw", "spherical", "screw"), SCREWS),
    ],
)
def test_trees_of_all_joints_move_alike(seed, kinds, bound):
    robot = lw.Robot(random_tree(seed, len(kinds), kinds=kinds))
    positions, rates, accelerations = errors(robot, robot.to_mujoco(), *drawn(robot, seed))
    assert positions < 1e-12 and rates < 1e-12
    assert accelerations < bound


def test_a_state_is_read_back():
    robot = lw.Robot("prr3")
    state = robot.assemble({"slide_1": 0.18, "slide_2": 0.16, "slide_3": 0.15})
    state = state.with_rates([0.1, -0.2, 0.3])
    live = robot.to_mujoco()
    data = live.data(state)
    q, v = live.positions(data), live.rates(data)
    again = robot.assemble(
        {name: q[name] for name in robot.independent},
        rates={name: v[name] for name in robot.independent},
    )
    np.testing.assert_allclose(again.positions, state.positions, atol=1e-12)
    np.testing.assert_allclose(again.rates, state.rates, atol=1e-12)


def test_mujoco_runs_on_from_a_state():
    robot = lw.Robot("five_bar")
    live, (state, forces) = robot.to_mujoco(), drawn(robot)
    run = robot.simulate(state, forces, duration=0.2)
    data = live.data(state, forces)
    while data.time < 0.2 - 1e-9:
        mj.mj_step(live.model, data)
    q = live.positions(data)
    assert max(abs(q[name] - run.final[name]) for name in q) < 1e-5


@pytest.mark.long
@pytest.mark.parametrize("name", RODS)
def test_robots_with_rods_move_alike(name):
    """In motion, too: MuJoCo leaves out how a tendon's constraint turns; links have none."""
    robot = lw.Robot(name)
    live = robot.to_mujoco()
    positions, rates, accelerations = errors(robot, live, *drawn(robot))
    assert positions < 1e-12 and rates < 1e-12
    assert accelerations < 3e-7
    assert {*live.positions(live.data())} <= {*robot.coordinates}
    assert any("rods are links of 1e-09 of the robot's mass" in note for note in live.notes)
    data = live.data(drawn(robot)[0])
    assert np.abs(data.efc_vel).max() < 1e-12 and np.abs(data.efc_pos).max() < 1e-12


def test_mujoco_runs_on_with_rods():
    robot = lw.Robot("delta")
    live, (state, forces) = robot.to_mujoco(), drawn(robot)
    run = robot.simulate(state, forces, duration=0.1)
    live.model.opt.integrator, live.model.opt.timestep = mj.mjtIntegrator.mjINT_RK4, 5e-4
    data = live.data(state, forces)
    while data.time < 0.1 - 1e-9:
        mj.mj_step(live.model, data)
    q = live.positions(data)
    assert max(abs(q[name] - run.final[name]) for name in robot.actuators) < 1e-6


def test_a_rod_from_ground_and_names_that_are_taken():
    """A pendulum of a body on a rod: beside the closed solution, at rest g sin(angle) across."""
    weight = Body(mass=2.0, inertia=Inertia(xx=0.1, yy=0.1, zz=0.1))
    joints = {
        "a": RodJoint(connects=("ground", "a link"), length=2.0),
        "guide": PlanarJoint(connects=("ground", "a link")),
    }
    mechanism = Mechanism(
        name="weight", bodies={"a link": weight}, joints=joints, actuators=(), gravity=(0, -9.81, 0)
    )
    robot = lw.Robot(mechanism.model_copy(update={"reference": {"guide.x": 1.2, "guide.y": -1.6}}))
    live = robot.to_mujoco()
    found = live.accelerations(live.data())
    across = 9.81 * 0.6
    assert found["guide.x"] == pytest.approx(-across * 0.8, rel=1e-6)
    assert found["guide.y"] == pytest.approx(-across * 0.6, rel=1e-6)


def test_free_numbers_have_their_values():
    robot = lw.Robot("prr3").free("platform.mass").with_parameters({"platform.mass": 5.0})
    assert errors(robot, robot.to_mujoco(), *drawn(robot))[2] < LOOPS["prr3"]


def floating(connects):
    body = Body(mass=1.0, inertia=Inertia(xx=0.1, yy=0.2, zz=0.15))
    frames = (Frame(position=(0.1, 0.0, 0.2)), Frame(position=(0.0, 0.3, 0.0)))
    return Mechanism(
        name="floating",
        bodies={"block": body},
        joints={"root": FreeJoint(connects=connects, frames=frames)},
        actuators=(),
    )


def test_what_does_not_fit_is_refused(monkeypatch):
    robot = lw.Robot("prr3")
    live = robot.to_mujoco()
    with pytest.raises(lw.LinkworkError, match=r"the robot is 'prr3'; give a linkwork\.Robot"):
        lw.export.mujoco("prr3")
    for softness in (0, -1.0, float("nan"), "soft"):
        with pytest.raises(lw.LinkworkError, match="softness"):
            lw.export.mujoco(robot, softness)
    stack = robot.assemble({f"slide_{i}": np.full(2, 0.16) for i in (1, 2, 3)})
    with pytest.raises(lw.LinkworkError, match="one state, not a stack"):
        live.data(stack)
    for forces in ([1.0, 2.0], [np.nan, 0.0, 0.0], {"pivot_1": 1.0}, np.zeros((2, 3))):
        with pytest.raises(lw.LinkworkError, match=r"force|actuator"):
            live.data(robot.home, forces)
    with pytest.raises(lw.LinkworkError):
        live.data(lw.Robot("five_bar").home)
    with pytest.raises(lw.LinkworkError, match=r"joints\.root: leads from 'block' to ground"):
        lw.Robot(floating(("block", "ground"))).to_mujoco()
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(lw.LinkworkError, match=r"pip install 'linkwork\[engines\]'"):
        robot.to_mujoco()


def test_a_floating_body_is_read_between_the_joints_frames():
    robot = lw.Robot(floating(("ground", "block")))
    positions, rates, accelerations = errors(robot, robot.to_mujoco(), *drawn(robot))
    assert positions < 1e-12 and rates < 1e-12
    assert accelerations < ROUNDING


def test_motors_behind_springs_are_rotors_without_mass_of_their_own():
    """A robot with an elastic joint was refused, with the advice to give mass to a body that the
    description does not have."""
    link = lw.Body(
        mass=0.8, centre_of_mass=(0.1, 0, 0.05), inertia=Inertia(xx=3e-3, yy=4e-3, zz=5e-3)
    )
    elastic = lw.mechanism.elastic.Elastic(stiffness=60.0, damping=0.1, motor_inertia=0.02)
    hip = lw.RevoluteJoint(connects=("base", "thigh"), axis=(0, 1, 0), elastic=elastic)
    knee = lw.RevoluteJoint(
        connects=("thigh", "shank"),
        frames=(Frame(position=(0, 0, -0.3)), Frame()),
        axis=(1, 0, 0),
    )
    robot = lw.Robot(
        Mechanism(
            bodies={"base": link, "thigh": link, "shank": link},
            joints={"free": FreeJoint(connects=("ground", "base")), "hip": hip, "knee": knee},
            actuators=("hip", "knee"),
        )
    )
    live = robot.to_mujoco()
    assert any("hip rotor: moves without mass" in note for note in live.notes)
    assert max(errors(robot, live, *drawn(robot))) < 1e-7
