"""The planar robots of the catalogue against the formulas that describe them, in plain NumPy, and
independent dynamics."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import double_pendulum, pendulum, rpr3, rrr3, slider_crank

from tests.oracle.closed_forms import DoublePendulum, SliderCrank
from tests.oracle.maximal import MaximalOracle

AZIMUTHS = np.pi * np.array([7, 11, 3]) / 6


def e(angle):
    """Return the unit vector at this angle."""
    return np.array([np.cos(angle), np.sin(angle)])


def corner(base, i):
    return base * np.array([(0, 0), (1, 0), (0.5, np.sqrt(0.75))])[i - 1]


def vertex(pose, radius, i):
    """Return where the platform's vertex i is at the pose (x, y, angle)."""
    return pose[:2] + radius * e(AZIMUTHS[i - 1] + pose[2])


def middle(base, angle=0.0):
    return np.array([base / 2, base / (2 * np.sqrt(3)), angle])


RRR = [(0.6, 0.22, 0.2, 0.08), (1.0, 0.4, 0.3, 0.1), (0.5, 0.15, 0.3, 0.05)]
RPR = [(1.0, 0.15), (0.4, 0.1)]


@pytest.mark.parametrize(("base", "proximal", "distal", "radius"), RRR)
def test_rrr3_loops_close_at_the_reference(base, proximal, distal, radius):
    q = rrr3(base, proximal, distal, radius).reference
    for i in (1, 2, 3):
        crank, link = q[f"motor_{i}"], q[f"motor_{i}"] + q[f"elbow_{i}"]
        tip = corner(base, i) + proximal * e(crank) + distal * e(link)
        assert np.allclose(tip, vertex(middle(base), radius, i), atol=1e-15)
        assert q[f"wrist_{i}"] == pytest.approx(-link, abs=1e-15)


@pytest.mark.parametrize(("base", "radius"), RPR)
def test_rpr3_loops_close_at_the_reference(base, radius):
    q = rpr3(base, radius).reference
    for i in (1, 2, 3):
        tip = corner(base, i) + q[f"slide_{i}"] * e(q[f"pivot_{i}"])
        assert np.allclose(tip, vertex(middle(base, np.pi / 3), radius, i), atol=1e-15)
        assert q[f"pivot_{i}"] + q[f"wrist_{i}"] == pytest.approx(np.pi / 3, abs=1e-15)


@pytest.mark.parametrize("offset", [0.0, 0.07, -0.1])
def test_slider_crank_closes_at_the_reference(offset):
    q = slider_crank(offset=offset).reference
    rod = q["crank"] + q["pin"]
    assert np.allclose(0.1 * e(q["crank"]) + 0.3 * e(rod), [q["slide"], offset], atol=1e-16)
    assert q["wrist"] == pytest.approx(-rod, abs=1e-15)


@pytest.mark.parametrize(
    ("mechanism", "mobility", "mass"),
    [
        (rrr3(), 3, 3 * (0.5 + 0.3) + 0.8),
        (rpr3(), 3, 3 * (1.2 + 0.5) + 1.5),
        (slider_crank(), 1, 2.0),
        (slider_crank(offset=0.05), 1, 2.0),
        (pendulum(), 1, 1.0),
        (pendulum((0.5, 0.4, 0.3), (1.0, 2.0, 3.0)), 3, 6.0),
        (double_pendulum(), 2, 2.0),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_freedoms_masses_and_dynamics(mechanism, mobility, mass):
    robot = lw.Robot(mechanism)
    assert (robot.mobility, robot.gruebler, len(robot.redundant), len(robot.idle)) == (
        mobility,
        mobility,
        0,
        0,
    )
    assert robot.independent == mechanism.actuators
    assert sum(body.mass for body in mechanism.bodies.values()) == pytest.approx(mass, rel=1e-15)
    random = np.random.default_rng(3)
    for _ in range(3):
        rates, forces = random.normal(size=mobility), random.normal(size=mobility)
        state = robot.home.with_rates(rates)
        oracle = MaximalOracle(mechanism)
        poses = oracle.reference_poses()
        twists = oracle.twists(poses, dict(zip(mechanism.actuators, rates, strict=True)))
        accelerations = oracle.joint_accelerations(
            poses, twists, oracle.accelerations(poses, twists, forces)
        )
        found = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
        assert np.allclose(found, accelerations, rtol=1e-10, atol=1e-9)


def test_rrr3_inverse_kinematics():
    """The elbows found by assembly lie where the circles about corner and vertex meet, on the
    reference's side."""
    base, proximal, distal, radius = RRR[0]
    robot = lw.Robot(rrr3())
    random = np.random.default_rng(4)
    for _ in range(10):
        pose = middle(base) + random.uniform(-1, 1, 3) * (0.04, 0.04, 0.3)
        state = robot.assemble(tool=pose)
        for i in (1, 2, 3):
            reach = vertex(pose, radius, i) - corner(base, i)
            length = np.linalg.norm(reach)
            inner = np.arccos((length**2 + proximal**2 - distal**2) / (2 * length * proximal))
            motor = np.arctan2(reach[1], reach[0]) + inner
            assert np.allclose(e(state[f"motor_{i}"]), e(motor), atol=1e-12)


def test_rpr3_leg_lengths():
    """A leg is as long as its corner is from its vertex."""
    base, radius = RPR[0]
    robot = lw.Robot(rpr3())
    random = np.random.default_rng(5)
    for _ in range(10):
        pose = middle(base, np.pi / 3) + random.uniform(-1, 1, 3) * (0.1, 0.1, 0.4)
        state = robot.assemble(tool=pose)
        lengths = [np.linalg.norm(vertex(pose, radius, i) - corner(base, i)) for i in (1, 2, 3)]
        assert np.allclose([state[f"slide_{i}"] for i in (1, 2, 3)], lengths, atol=1e-12)


def test_rpr3_platform_on_light_legs_moves_by_the_sum_of_their_forces():
    """From rest: m P'' = sum of u_i d_i, I phi'' = sum of their moments about the centre."""
    robot = lw.Robot(rpr3(cylinder_mass=0.0, piston_mass=0.0))
    forces, state, pose = np.array([1.0, -2.0, 0.7]), robot.home, middle(1.0, np.pi / 3)
    wrench = np.zeros(3)
    for i, force in enumerate(forces, start=1):
        leg, arm = e(state[f"pivot_{i}"]), vertex(pose, 0.15, i) - pose[:2]
        wrench += force * np.array([arm[0] * leg[1] - arm[1] * leg[0], *leg])
    twist_rate = robot.twist_map(state)[-6:] @ robot.forward_dynamics(state, forces)
    assert np.allclose(twist_rate[2:5], wrench / [1.5 * 0.15**2 / 2, 1.5, 1.5], rtol=1e-11)


def rrr3_bodies(pose):
    """Return the motors' angles, and mass, inertia, place and angle of every body of the default
    robot."""
    base, proximal, distal, radius = RRR[0]
    motors, bodies = [], [(0.8, 0.8 * radius**2 / 2, *pose)]
    for i in (1, 2, 3):
        tip, root = vertex(pose, radius, i), corner(base, i)
        length = np.linalg.norm(tip - root)
        inner = np.arccos((length**2 + proximal**2 - distal**2) / (2 * length * proximal))
        motors.append(np.angle(complex(*(tip - root))) + inner)
        elbow = root + proximal * e(motors[-1])
        bodies.append((0.5, 0.5 * proximal**2 / 12, *(root + elbow) / 2, motors[-1]))
        bodies.append(
            (0.3, 0.3 * distal**2 / 12, *(elbow + tip) / 2, np.angle(complex(*(tip - elbow))))
        )
    return np.array(motors), np.array(bodies)


def rpr3_bodies(pose):
    """Return the legs' lengths, and mass, inertia, place and angle of every body of the default
    robot."""
    base, radius = RPR[0]
    lengths, bodies = [], [(1.5, 1.5 * radius**2 / 2, *pose)]
    for i in (1, 2, 3):
        tip, root = vertex(pose, radius, i), corner(base, i)
        lengths.append(np.linalg.norm(tip - root))
        leg = (tip - root) / lengths[-1]
        angle = np.angle(complex(*leg))
        bodies.append((1.2, 1.2 * 0.3**2 / 12, *(root + 0.15 * leg), angle))
        bodies.append((0.5, 0.5 * 0.3**2 / 12, *(tip - 0.15 * leg), angle))
    return np.array(lengths), np.array(bodies)


@pytest.mark.parametrize(
    ("describe", "bodies", "angle"),
    [(rrr3, rrr3_bodies, 0.0), (rpr3, rpr3_bodies, np.pi / 3)],
    ids=["rrr3", "rpr3"],
)
def test_energies_from_the_bodies_places(describe, bodies, angle):
    """T = sum of m |c'|^2/2 + I w^2/2 and V = g sum of m y, the bodies placed by hand and moved by
    differences."""
    robot = lw.Robot(describe(gravity=(0.0, -9.81, 0.0)))
    random, h = np.random.default_rng(8), 1e-6
    for _ in range(3):
        pose = middle(0.6 if describe is rrr3 else 1.0, angle) + random.uniform(-1, 1, 3) * (
            0.03,
            0.03,
            0.2,
        )
        step = h * random.normal(size=3)
        (before, _, after), (first, here, last) = zip(
            *map(bodies, (pose - step, pose, pose + step)), strict=True
        )
        mass, inertia, _, height, _ = here.T
        _, _, x, y, turn = (last - first).T / (2 * h)
        state = robot.assemble(tool=pose).with_rates((after - before) / (2 * h))
        kinetic, potential = robot.energy(state)
        assert np.isclose(kinetic, mass @ (x**2 + y**2) / 2 + inertia @ turn**2 / 2, rtol=1e-8)
        assert np.isclose(potential, 9.81 * mass @ height, rtol=1e-12)


def test_slider_crank_in_closed_form():
    """Slider's place and driving torque as functions of the crank's angle."""
    closed = SliderCrank()
    mechanism = slider_crank(
        crank=closed.r,
        rod=closed.l,
        masses=closed.m,
        centres=(closed.a, closed.b),
        inertias=closed.I,
    )
    robot = lw.Robot(mechanism)
    for theta, rate, acceleration in np.random.default_rng(6).normal(scale=3, size=(10, 3)):
        state = robot.assemble({"crank": theta}).with_rates([rate])
        place = closed.r * np.cos(theta) + np.sqrt(closed.l**2 - (closed.r * np.sin(theta)) ** 2)
        assert state["slide"] == pytest.approx(place, abs=1e-12)
        torque = closed.force(theta, rate, acceleration)
        found = robot.inverse_dynamics(state, [acceleration])
        assert np.allclose(found, [torque], rtol=1e-10, atol=1e-10)


def test_double_pendulum_in_closed_form():
    masses, lengths = (1.2, 0.7), (0.6, 0.9)
    closed = DoublePendulum(m=masses, a=lengths, I=(0.0, 0.0), l1=lengths[0])
    robot = lw.Robot(double_pendulum(lengths, masses))
    for q, rates, accelerations in np.random.default_rng(7).normal(size=(10, 3, 2)):
        state = robot.assemble({"hinge_1": q[0], "hinge_2": q[1]}).with_rates(rates)
        expected = closed.force(q, rates, accelerations)
        assert np.allclose(
            robot.inverse_dynamics(state, accelerations), expected, rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize(
    ("describe", "sentence"),
    [
        (
            lambda: rrr3(proximal=0.05),
            "leg 1: proximal and distal links of 0.05 m and 0.2 m do not meet over a distance",
        ),
        (lambda: rrr3(base=-1.0), "base: is -1.0; give a size above zero"),
        (lambda: rrr3(platform_mass=-1.0), "platform_mass: is -1.0; give zero or more"),
        (lambda: rpr3(radius=float("nan")), "radius: is nan"),
        (
            lambda: slider_crank(offset=0.4),
            "the rod of 0.3 m does not reach the slider's line; rod must exceed 0.329289 m",
        ),
        (
            lambda: pendulum((1.0, 2.0), (1.0,)),
            "2 lengths and 1 masses; give one mass at the end of each rod",
        ),
        (lambda: pendulum((), ()), "0 lengths and 0 masses"),
        (lambda: pendulum((1.0, 0.0), (1.0, 1.0)), r"lengths\[1\]: is 0.0"),
    ],
)
def test_what_cannot_be_built_is_refused_in_one_sentence(describe, sentence):
    with pytest.raises(lw.MechanismError, match=sentence) as refusal:
        describe()
    assert "\n" not in str(refusal.value)
