"""Inverse and direct kinematics of the spatial robots in closed form, by plain vector geometry."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork import robots

from tests.oracle.published import DIETMAIER_BASE, DIETMAIER_PLATFORM

E = np.eye(3)
AZIMUTHS = np.radians([-90, 30, 150])


@lru_cache
def robot_of(name: str) -> lw.Robot:
    return lw.Robot(getattr(robots, name)())


def actuated(state: lw.State, robot: lw.Robot) -> np.ndarray:
    return np.array([state[name] for name in robot.actuators])


def turned(robot: lw.Robot, state: lw.State, body: str = "platform") -> float:
    """Return the angle [rad] by which a body is turned against the ground."""
    return Rotation.from_matrix(robot.body_poses(state)[body][1]).magnitude()


def random_poses(number: int, centre, reach: float, tilt: float, seed: int = 1) -> np.ndarray:
    """Return tool poses (x, y, z, rotation vector) around a centre."""
    random = np.random.default_rng(seed)
    return np.concatenate(
        [
            centre + reach * random.uniform(-1, 1, (number, 3)),
            tilt * random.uniform(-1, 1, (number, 3)),
        ],
        axis=1,
    )


# Deltas


@pytest.mark.parametrize(
    ("position", "angles"),
    [((0, 0, -0.9), (-20.5, -20.5, -20.5)), ((0.3, 0.5, -1.1), (47.5, -11.6, 21.4))],
)
def test_delta_inverse_kinematics_as_published(position, angles):
    """Williams, The Delta parallel robot, examples for the ABB FlexPicker IRB 360-1/1600: angles in
    degrees."""
    robot = robot_of("delta")
    state = robot.assemble(tool=position)
    assert np.allclose(np.degrees(actuated(state, robot)), angles, atol=0.05)


def test_delta_direct_kinematics_by_three_spheres():
    """P lies on three spheres of the rods' length about the elbows, moved inwards by the platform's
    radius."""
    robot, random = robot_of("delta"), np.random.default_rng(3)
    for angles in random.uniform(-0.3, 0.6, (4, 3)):
        state = robot.assemble(dict(zip(robot.actuators, angles, strict=True)))
        out = np.array([[np.cos(f), np.sin(f), 0] for f in AZIMUTHS])
        centres = (0.164 - 0.044 + 0.524 * np.cos(angles))[:, None] * out - 0.524 * np.sin(angles)[
            :, None
        ] * E[2]
        assert np.allclose(robot.tool_pose(state)[:3], three_spheres(centres, 1.244), atol=1e-12)
        assert turned(robot, state) < 1e-12


def three_spheres(centres: np.ndarray, radius: float) -> np.ndarray:
    """Return the lower point at one distance from three centres: below their circumcentre, across
    their plane."""
    a, b = centres[1] - centres[0], centres[2] - centres[0]
    normal = np.cross(a, b)
    middle = np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * normal @ normal)
    height = np.sqrt(radius**2 - middle @ middle) * normal / np.linalg.norm(normal)
    return centres[0] + middle - height * np.sign(height[2])


def test_linear_delta_in_closed_form():
    """q_i = z + sqrt(rod^2 - |horizontal gap|^2): the carriages are above the platform."""
    robot = robot_of("linear_delta")
    for pose in random_poses(4, np.zeros(3), 0.1, 0):
        state = robot.assemble(tool=pose[:3])
        gaps = [pose[:2] - 0.25 * np.array([np.cos(f), np.sin(f)]) for f in AZIMUTHS]
        expected = [pose[2] + np.sqrt(0.5**2 - gap @ gap) for gap in gaps]
        assert np.allclose(actuated(state, robot), expected, atol=1e-12)
        assert turned(robot, state) < 1e-12


def test_orthoglide_in_closed_form():
    """(P_i - rod - q_i)^2 + P_j^2 + P_k^2 = rod^2; in the isotropic pose the platform's velocity is
    that of the drives."""
    robot = robot_of("orthoglide")
    for pose in random_poses(4, np.zeros(3), 0.08, 0):
        state, P = robot.assemble(tool=pose[:3]), pose[:3]
        expected = [
            P[i] - 0.31 + np.sqrt(0.31**2 - P[i - 1] ** 2 - P[i - 2] ** 2) for i in range(3)
        ]
        assert np.allclose(actuated(state, robot), expected, atol=1e-12)
        assert turned(robot, state) < 1e-12
    v = np.array([0.3, -0.2, 0.5])
    twist = robot.twists(robot.home.with_rates(v)).reshape(-1, 6)[robot.bodies.index("platform")]
    assert np.allclose(twist, [0, 0, 0, *v], atol=1e-14)


def test_light_rods_as_bodies_move_like_distance_constraints():
    """Rods of 1 mg with their own joints give the geometry and the accelerations of massless
    ones."""
    position, rates, forces = [0.2, -0.1, -1.0], [0.4, -0.3, 0.5], [3.0, -2.0, 1.0]
    massless, robot = robot_of("delta"), lw.Robot(robots.delta(rod_mass=1e-6))
    expected = massless.assemble(tool=position, rates=rates)
    state = robot.assemble(tool=position, rates=dict(zip(robot.actuators, rates, strict=True)))
    assert np.allclose(actuated(state, robot), actuated(expected, massless), atol=1e-11)
    assert turned(robot, state) < 1e-11
    found = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
    by_rate = dict(zip(robot.rates, found, strict=True))
    assert np.allclose(
        [by_rate[name] for name in robot.actuators],
        massless.forward_dynamics(expected, forces),
        rtol=1e-4,
    )


# Gough-Stewart platform


def points(radius: float, azimuths) -> np.ndarray:
    f = np.radians(azimuths)
    return radius * np.stack([np.cos(f), np.sin(f), 0 * f], axis=1)


BASE = points(3.0, [-2.5, 2.5, 117.5, 122.5, 237.5, 242.5])
TOP = points(1.0, [-50, 50, 70, 170, 190, 290])


def lengths(pose: np.ndarray, A: np.ndarray = BASE, b: np.ndarray = TOP) -> np.ndarray:
    return np.linalg.norm(pose[:3] + Rotation.from_rotvec(pose[3:]).apply(b) - A, axis=1)


def slopes(function, pose: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Return the derivative by a central difference of fourth order."""
    return np.stack(
        [
            (
                8 * (function(pose + h) - function(pose - h))
                - (function(pose + 2 * h) - function(pose - 2 * h))
            )
            / (12 * step)
            for h in step * np.eye(6)
        ],
        axis=-1,
    )


def test_stewart_example_has_its_published_size():
    """The MathWorks example: legs of 3.15380068 m, tubes of 92.110671 kg, rods of 51.812253 kg, a
    top of 1216.926818 kg."""
    mechanism = robots.stewart()
    assert np.allclose(
        [mechanism.reference[f"leg_{i}"] for i in range(1, 7)], 3.15380068, atol=5e-9
    )
    masses = [mechanism.bodies[name].mass for name in ("tube_1", "rod_1", "platform")]
    assert np.allclose(masses, [92.110671, 51.812253, 1216.926818], atol=5e-7)


def test_stewart_leg_lengths_and_back():
    robot = robot_of("stewart")
    for pose in random_poses(4, (0, 0, 2.0), 0.25, 0.3):
        state = robot.assemble(tool=pose)
        assert np.allclose(actuated(state, robot), lengths(pose), atol=1e-12)
        back = robot.assemble(dict(zip(robot.actuators, lengths(pose), strict=True)))
        assert np.allclose(robot.tool_pose(back), pose, atol=1e-10)


def test_stewart_with_massless_legs_carries_its_platform():
    """The legs' forces balance the weight 11 938 N of the platform, in force and in moment about
    its centre."""
    robot = lw.Robot(robots.stewart(leg_density=0.0))
    weight = 1216.926817904303 * 9.81
    assert weight == pytest.approx(11938, abs=0.5)
    for pose in (np.array([0, 0, 2.0, 0, 0, 0]), *random_poses(2, (0, 0, 2.0), 0.2, 0.2)):
        u = robot.inverse_dynamics(robot.assemble(tool=pose), np.zeros(6))
        arms = Rotation.from_rotvec(pose[3:]).apply(TOP)
        forces = u[:, None] * (pose[:3] + arms - BASE) / lengths(pose)[:, None]
        assert np.allclose(forces.sum(0), [0, 0, weight], atol=1e-8 * weight)
        assert np.allclose(np.cross(arms, forces).sum(0), 0, atol=1e-8 * weight)


def test_stewart_with_heavy_legs_at_rest():
    """Virtual work: the forces times the legs' virtual lengths are the change of all weights'
    potential energy."""
    robot = robot_of("stewart")

    def potential(pose: np.ndarray) -> np.ndarray:
        tips = pose[:3] + Rotation.from_rotvec(pose[3:]).apply(TOP)
        along = (tips - BASE) / lengths(pose)[:, None]
        half = 0.375 * lengths(np.array([0, 0, 2.0, 0, 0, 0]))[0]
        heights = (
            92.11067113599903 * half * along[:, 2] + 51.81225251399943 * (tips - half * along)[:, 2]
        )
        return 9.81 * (heights.sum() + 1216.926817904303 * pose[2])

    for pose in random_poses(3, (0, 0, 2.0), 0.2, 0.2):
        u = robot.inverse_dynamics(robot.assemble(tool=pose), np.zeros(6))
        assert np.allclose(slopes(lengths, pose).T @ u, slopes(potential, pose), atol=1e-4)


DIETMAIER_LENGTHS = np.array([1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071])


def test_stewart_takes_the_points_of_dietmaier():
    """The platform with 40 real postures (Dietmaier 1998): legs in all directions; each posture
    found is assembled."""

    def gap(pose):
        return lengths(pose, DIETMAIER_BASE, DIETMAIER_PLATFORM) - DIETMAIER_LENGTHS

    random = np.random.default_rng(4)
    starts = np.concatenate(
        [random.uniform(-1, 1, (30, 3)), random.uniform(-2, 2, (30, 3))], axis=1
    )
    found = [
        solution.x
        for start in starts
        if (solution := least_squares(gap, start, xtol=1e-15)).cost < 1e-24
    ]
    postures = [
        pose
        for k, pose in enumerate(found)
        if all(abs(pose - other).max() > 1e-3 for other in found[:k])
    ]
    assert len(postures) >= 4
    for pose in postures[:2]:
        home = lw.Frame(position=tuple(pose[:3]), rotation=tuple(pose[3:]))
        robot = lw.Robot(
            robots.stewart(
                DIETMAIER_BASE.tolist(), DIETMAIER_PLATFORM.tolist(), home, platform_radius=0.5
            )
        )
        assert np.allclose(actuated(robot.home, robot), DIETMAIER_LENGTHS, atol=1e-10)
        assert robot.mobility == 6
        assert robot.closure_error(robot.home) < 1e-12


# Hexaglide


def test_hexaglide_in_closed_form():
    robot = robot_of("hexaglide")
    rails, sides = np.array([0.5, 0.1, 0.1, -0.5, -0.1, -0.1]), np.array([1, 1, -1, 1, 1, -1])
    b = points(0.2, [30, 105, 120, -30, -105, -120])
    for pose in random_poses(4, (0.05, 0, -0.45), 0.08, 0.25):
        d = pose[:3] + Rotation.from_rotvec(pose[3:]).apply(b)
        expected = d[:, 0] + sides * np.sqrt(0.7**2 - (d[:, 1] - rails) ** 2 - d[:, 2] ** 2)
        state = robot.assemble(tool=pose)
        assert np.allclose(actuated(state, robot), expected, atol=1e-12)
        back = robot.assemble(dict(zip(robot.actuators, expected, strict=True)))
        assert np.allclose(robot.tool_pose(back), pose, atol=1e-10)


# Agile Wrist


def test_agile_wrist_in_closed_form():
    """w_i . v_i = 0 with w_i = cos q_i e_j + sin q_i e_k and v_i = R e_k: tan q_i = -(v_i . e_j) /
    (v_i . e_k)."""
    robot = robot_of("agile_wrist")
    for vector in np.random.default_rng(5).uniform(-0.5, 0.5, (5, 3)):
        R = Rotation.from_rotvec(vector).as_matrix()
        state = robot.assemble(tool=[0, 0, 0, *vector])
        v = [R[:, (i + 2) % 3] for i in range(3)]
        expected = [np.arctan(-v[i][(i + 1) % 3] / v[i][(i + 2) % 3]) for i in range(3)]
        assert np.allclose(actuated(state, robot), expected, atol=1e-12)
        rates = np.array([0.3, -0.7, 0.5])
        omega = robot.twists(state.with_rates(rates)).reshape(-1, 6)[
            robot.bodies.index("platform"), :3
        ]
        for i in range(3):
            w = np.cos(expected[i]) * E[(i + 1) % 3] + np.sin(expected[i]) * E[(i + 2) % 3]
            assert np.cross(w, v[i]) @ omega == pytest.approx(
                np.cross(E[i], w) @ v[i] * rates[i], abs=1e-12
            )


def test_agile_wrist_is_isotropic_in_its_reference():
    robot = robot_of("agile_wrist")
    rates = np.array([0.3, -0.7, 0.5])
    omega = robot.twists(robot.home.with_rates(rates)).reshape(-1, 6)[
        robot.bodies.index("platform"), :3
    ]
    assert np.allclose(omega, rates, atol=1e-14)


@pytest.mark.parametrize("body", ["proximal_1", "distal_2"])
def test_agile_wrist_links_are_quarter_circles(body):
    """Mass centre and inertia by summing over many points of the arc."""
    mechanism = robots.agile_wrist()
    start, radius = {"proximal_1": (E[0], 0.15), "distal_2": (E[2], 0.12)}[body]
    end = np.roll(start, 1)
    t = (np.arange(20000) + 0.5) / 20000 * np.pi / 2
    arc = radius * (np.outer(np.cos(t), start) + np.outer(np.sin(t), end))
    centre = arc.mean(0)
    apart = arc - centre
    described = mechanism.bodies[body]
    inertia = described.mass * (np.eye(3) * (apart**2).sum(1).mean() - apart.T @ apart / len(t))
    assert np.allclose(described.centre_of_mass, centre, atol=1e-9)
    assert np.allclose(described.inertia.tensor(), inertia, atol=1e-9)


# Tripteron


def test_tripteron_is_decoupled():
    """P_i = q_i, no turn, and each leg's two links span their gap."""
    robot = robot_of("tripteron")
    for P in np.random.default_rng(6).uniform(-0.12, 0.12, (4, 3)):
        state = robot.assemble({f"slide_{i + 1}": P[i] for i in range(3)})
        assert np.allclose(robot.tool_pose(state), [*P, 0, 0, 0], atol=1e-12)
        for i in range(3):
            a, b = state[f"root_{i + 1}"], state[f"elbow_{i + 1}"]
            reach = 0.3 * np.array([np.cos(a) - np.sin(a + b), np.sin(a) + np.cos(a + b)])
            assert np.allclose(reach, [P[(i + 1) % 3] + 0.3, P[(i + 2) % 3] + 0.3], atol=1e-12)
            assert state[f"tip_{i + 1}"] == pytest.approx(-a - b, abs=1e-12)


# Bennett linkage


def test_bennett_keeps_its_closure_relation():
    """tan(q_1/2) tan(q_2/2) = sin((beta + alpha)/2) / sin((beta - alpha)/2), opposite angles equal
    and opposite."""
    robot = robot_of("bennett")
    alpha = np.pi / 6
    beta = np.arcsin(0.5 * np.sin(alpha) / 0.3)
    constant = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    state = robot.home
    for crank in (1.0, 0.6, 1.5, 2.2, 2.8):
        state = robot.assemble({"hinge_1": crank}, guess=state)
        one, two, three, four = (state[f"hinge_{i}"] for i in (1, 2, 3, 4))
        assert np.tan(one / 2) * np.tan(two / 2) == pytest.approx(constant, rel=1e-11)
        assert np.allclose(np.exp(1j * np.array([one + three, two + four])), 1, atol=1e-11)
        rates = dict(zip(robot.rates, robot.joint_rates(state.with_rates([1.0])), strict=True))
        assert rates["hinge_2"] == pytest.approx(
            -np.sin(two) / np.sin(one), rel=1e-9
        )  # from the relation's derivative
