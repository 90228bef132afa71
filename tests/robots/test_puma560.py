"""The Puma 560 against the numbers that Corke's Robotics Toolbox prints for it, and its tensors
against the published ones."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import puma560

NOMINAL = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0])
FORWARDS = np.array(
    [0.395, 0.126, 0.132, 11.2e-3, 9.26e-3, 3.96e-3]
)  # published Coulomb friction at the motors [N m]
RATIOS = np.array([62.6111, 107.815, 53.7063, 76.0364, 71.923, 76.686])


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(puma560())


def at(robot, q, rates=(0.0,) * 6):
    return robot.assemble(dict(zip(robot.coordinates, q, strict=True))).with_rates(rates)


def test_freedoms_and_mass(robot):
    assert (robot.mobility, robot.gruebler, len(robot.redundant)) == (6, 6, 0)
    assert not robot.planar
    assert sum(body.mass for body in puma560().bodies.values()) == pytest.approx(23.45)


def test_the_reference_is_the_nominal_pose_within_the_limits(robot):
    assert np.allclose(np.exp(1j * robot.home.positions), np.exp(1j * NOMINAL), atol=1e-15)
    assert robot.limits_passed(robot.home) == ()


def dh(q, d, a, alpha):
    """Return Denavit and Hartenberg's matrix, element by element."""
    ct, st, ca, sa = np.cos(q), np.sin(q), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def test_forward_kinematics(robot):
    table = [
        (0.672, 0, np.pi / 2),
        (0, 0.4318, 0),
        (0.15005, 0.0203, -np.pi / 2),
        (0.4318, 0, np.pi / 2),
        (0, 0, -np.pi / 2),
        (0, 0, 0),
    ]
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (5, 6)):
        poses, A = robot.body_poses(at(robot, q)), np.eye(4)
        for i, (angle, row) in enumerate(zip(q, table, strict=True), start=1):
            A = A @ dh(angle, *row)
            p, R = poses[f"link_{i}"]
            assert np.allclose(p, A[:3, 3], atol=1e-14)
            assert np.allclose(R, A[:3, :3], atol=1e-14)


def test_printed_gravity_load(robot):
    """Corke, Robotics, Vision and Control, sec. 9.2: at the nominal pose, and stretched out."""
    assert np.allclose(
        robot.gravity(at(robot, NOMINAL)), [0, 31.6399, 6.0351, 0, 0.0283, 0], atol=6e-5
    )
    stretched = [0, 0, -np.pi / 2, 0, 0, 0]
    assert np.allclose(
        robot.gravity(at(robot, stretched)), [0, 46.0069, 8.7722, 0, 0.0283, 0], atol=6e-5
    )


def test_printed_mass_matrix(robot):
    """Corke, Robotics, Vision and Control, sec. 9.2, with the rotors."""
    printed = [
        [3.6594, -0.4044, 0.1006, -0.0025, 0.0, 0.0],
        [-0.4044, 4.4137, 0.3509, 0.0, 0.0024, 0.0],
        [0.1006, 0.3509, 0.9378, 0.0, 0.0015, 0.0],
        [-0.0025, 0.0, 0.0, 0.1925, 0.0, 0.0],
        [0.0, 0.0024, 0.0015, 0.0, 0.1713, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.1941],
    ]
    assert np.allclose(robot.mass_matrix(at(robot, NOMINAL)), printed, atol=6e-5)


def test_printed_inverse_dynamics(robot):
    """The toolbox's own tests: torques at rest, accelerating, and moving with all rates 1, there
    with its friction."""
    ones = np.ones(6)
    accelerating = [3.35311, 36.0025, 7.42596, 0.190043, 0.203441, 0.194133]
    assert np.allclose(
        robot.inverse_dynamics(at(robot, NOMINAL), ones), accelerating, rtol=2e-6, atol=6e-5
    )
    moving = np.array([32.4952, 60.8670, 17.7436, 1.45452, 1.29911, 0.713781])
    frictions = [joint.effects()["angle"][0] for joint in puma560().joints.values()]
    smoothed = np.array(
        [friction.coulomb / np.hypot(1, friction.coulomb_rate) for friction in frictions]
    )
    found = robot.inverse_dynamics(at(robot, NOMINAL, ones), ones)
    assert np.allclose(found - smoothed + FORWARDS * RATIOS, moving, rtol=2e-6, atol=6e-5)


def test_tensors_move_as_the_published_ones_do():
    """k (1 - z z') about joint 3's axis z, taken from link 2 and given to link 3, and link 1's yy
    alone."""
    bodies = puma560().bodies
    published = {
        "link_2": np.diag([0.13, 0.524, 0.539]),
        "link_3": np.diag([0.066, 0.086, 0.0125]),
    }
    moved = {name: bodies[name].inertia.tensor() - tensor for name, tensor in published.items()}
    assert bodies["link_1"].inertia.yy == 0.35
    z_in_2, z_in_3 = (
        np.array([0, 0, 1]),
        np.array([0, -1, 0]),
    )  # joint 3's axis; link 3 is turned by -pi/2 about x
    k = moved["link_3"][0, 0]
    assert k > 0
    assert np.allclose(moved["link_3"], k * (np.eye(3) - np.outer(z_in_3, z_in_3)), atol=1e-15)
    assert np.allclose(moved["link_2"], -k * (np.eye(3) - np.outer(z_in_2, z_in_2)), atol=1e-15)


def test_a_base_without_height_is_refused():
    with pytest.raises(lw.MechanismError, match=r"base: is 0.0; give a size above zero"):
        puma560(base=0.0)
