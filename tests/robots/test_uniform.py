"""Mass, mass centre and inertia of uniform solids against Gauss quadrature over their volume."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork.mechanism import Frame
from linkwork.robots.poses import QuaternionPose as Pose
from linkwork.robots.poses import inverse, product, rotated, turn
from linkwork.robots.rods import pointing
from linkwork.robots.uniform import cube, disc, rod, tube, tube_mass

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


def interval(low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    return low + (high - low) * (NODES + 1) / 2, (high - low) * WEIGHTS / 2


def cylinder_points(
    inner: float, outer: float, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return points and volumes of a tube about z; eight equal angles integrate its quadratic
    moments exactly."""
    (r, wr), (z, wz), f = interval(inner, outer), interval(low, high), np.arange(8) * np.pi / 4
    R, F, Z = np.meshgrid(r, f, z, indexing="ij")
    volumes = (wr * r)[:, None, None] * np.full(8, np.pi / 4)[:, None] * wz
    return np.stack([R * np.cos(F), R * np.sin(F), Z], axis=-1).reshape(-1, 3), volumes.ravel()


def cube_points(side: float) -> tuple[np.ndarray, np.ndarray]:
    x, w = interval(-side / 2, side / 2)
    points = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, (w[:, None, None] * w[:, None] * w).ravel()


@pytest.mark.parametrize(
    ("body", "points", "volumes"),
    [
        (tube(3.0, 0.8, (0.03, 0.05), 0.1, (0, 0, 1)), *cylinder_points(0.03, 0.05, 0.1, 0.9)),
        (tube(3.0, 0.8, (0.03, 0.05), 0.1, (0, 0, -1)), *cylinder_points(0.03, 0.05, -0.9, -0.1)),
        (disc(2.0, 0.4, 0.05), *cylinder_points(0.0, 0.4, -0.025, 0.025)),
        (cube(1.5, 0.2), *cube_points(0.2)),
    ],
)
def test_mass_centre_and_inertia(body, points, volumes):
    masses = body.mass * volumes / volumes.sum()
    centre = masses @ points / body.mass
    apart = points - centre
    inertia = np.eye(3) * (masses @ (apart**2).sum(1)) - apart.T * masses @ apart
    assert np.allclose(body.centre_of_mass, centre, atol=1e-15)
    assert np.allclose(body.inertia.tensor(), inertia, atol=1e-15)


def test_rod_along_x_is_the_turned_rod_along_z():
    along_z, along_x = (rod(1.2, 0.5, 0.02, 0.1, axis) for axis in np.eye(3)[[2, 0]])
    swap = np.eye(3)[[2, 1, 0]]
    assert np.allclose(along_x.centre_of_mass, swap @ along_z.centre_of_mass)
    assert np.allclose(along_x.inertia.tensor(), swap @ along_z.inertia.tensor() @ swap.T)


def test_tube_mass_is_density_times_volume():
    _, volumes = cylinder_points(0.03, 0.05, 0.0, 0.8)
    assert tube_mass(7800.0, 0.8, (0.03, 0.05)) == pytest.approx(7800 * volumes.sum())


def test_quaternions_turn_as_matrices_do():
    random = np.random.default_rng(8)
    for _ in range(5):
        r, s, v = random.normal(size=(3, 3))
        A, B = Rotation.from_rotvec(r), Rotation.from_rotvec(s)
        a, b = (Pose.of(Frame(rotation=tuple(x))).quaternion for x in (r, s))
        assert np.allclose(rotated(product(a, b), v), (A * B).apply(v))
        assert np.allclose(rotated(inverse(a), v), A.inv().apply(v))
        assert np.allclose(Pose(s, a).point(v), s + A.apply(v))


@pytest.mark.parametrize(
    "direction", [*np.eye(3), *-np.eye(3), *np.random.default_rng(9).normal(size=(8, 3))]
)
def test_universal_joint_points_where_it_should(direction):
    """Rot(e1, a) Rot(e2, b) e3 is the direction, and b stays away from pi/2."""
    u = direction / np.linalg.norm(direction)
    aim = pointing(u)
    turns = product(turn(aim.axes[0], aim.angles[0]), turn(aim.axes[1], aim.angles[1]))
    assert np.allclose(rotated(turns, aim.axis), u, atol=1e-15)
    assert np.allclose(turns, aim.quaternion)
    assert abs(aim.angles[1]) <= np.pi / 4 + 1e-12
