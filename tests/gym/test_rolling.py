"""A rolling ball beside closed solutions, its energy, and Newton's and Euler's equations."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.gym import DecisionProcess, Environments, RollingBall
from linkwork.gym.catalogue import balancing
from linkwork.gym.catalogue._balancing import DISC

from tests.products import first

G = 9.81
DOWN = (0.0, 0.0, -G)


def plate(axis: tuple[float, float, float]) -> lw.Robot:
    """A plate on a hinge through its mass centre: it stays, or turns on evenly."""
    return lw.Robot(
        lw.Mechanism(
            name="plate",
            bodies={"plate": lw.Body(mass=2.0, inertia=lw.Inertia(xx=0.3, yy=0.3, zz=0.5))},
            joints={"hinge": lw.RevoluteJoint(connects=("ground", "plate"), axis=axis)},
            actuators=("hinge",),
        )
    )


def rolled(robot: lw.Robot, ball: RollingBall, start: lw.State, draws, steps: int, dt: float):
    """The ball's states after steps, and environments that it was rolled in."""
    process = DecisionProcess(
        robot,
        dt=dt,
        low=[-1.0],
        high=[1.0],
        observation=lambda t, state: [*ball.place(state), *ball.velocity(state)],
        reward=lambda t, state, action: 0.0,
        states=ball.states,
        rates=lambda t, state, action: ball.rates(state),
        draws={name: (value, value) for name, value in draws.items()},
        starts=start,
        horizon=10**9,
    )
    envs = Environments(process, 1)
    seen, _ = envs.reset(seed=0)
    found = [seen[0]]
    for _ in range(steps):
        found.append(envs.step([[0.0]])[0][0])
    return np.array(found), envs


@pytest.mark.parametrize(("inertia", "share"), [(2 / 5, 5 / 7), (2 / 3, 3 / 5)])
def test_on_a_tilted_plate_at_rest_it_rolls_by_five_sevenths_of_g(inertia, share):
    robot, tilt = plate((0.0, 1.0, 0.0)), 0.2
    ball = RollingBall("plate", 0.01, 0.05, DOWN, inertia)
    start = robot.assemble({"hinge": tilt})
    given = {"ball.x": 0.3, "ball.y": -0.1}
    found, _ = rolled(robot, ball, start, given, 100, 0.01)
    t = np.linspace(0, 1, 101)
    np.testing.assert_allclose(found[:, 0], 0.3 + share * G * np.sin(tilt) * t**2 / 2, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], share * G * np.sin(tilt) * t, atol=1e-12)
    np.testing.assert_allclose(found[:, [1, 3]], [[-0.1, 0.0]] * 101, atol=1e-12)


def test_energy_is_kept_on_a_plate_at_rest():
    """Kinetic energy of the motion and of the spin, also about the normal, and weight."""
    robot, r, k = plate((0.6, 0.8, 0.0)), 0.05, 2 / 5
    ball = RollingBall("plate", 0.01, r, DOWN)
    start = robot.assemble({"hinge": 0.3})
    R = Rotation.from_rotvec(0.3 * np.array([0.6, 0.8, 0.0])).as_matrix()
    begun = {"ball.hx": 0.4, "ball.hy": -0.7, "ball.hz": 0.9}
    found, envs = rolled(robot, ball, start, begun, 80, 0.01)
    h, n = np.array([envs.extra(f"ball.h{i}")[0] for i in "xyz"]), R[:, 2]
    first = np.array([*begun.values()])
    assert n @ h == pytest.approx(n @ first, abs=1e-13)  # nothing spins it about the normal

    def energy(place, velocity, about):
        spin = (about / k) ** 2 * k / 2
        height = R[2] @ [*place, 0.0]
        return (1 + k) * velocity @ velocity / 2 + spin + G * height

    energies = [energy(row[:2], row[2:], n @ first) for row in found]
    np.testing.assert_allclose(energies, energies[0], atol=1e-12)


def test_on_a_turntable_it_goes_round_at_two_sevenths_of_its_speed():
    """In the ground it goes round a circle, at rest or not, whatever its centre."""
    robot, turning = plate((0.0, 0.0, 1.0)), 3.0
    ball = RollingBall("plate", 0.0, 0.05, DOWN)
    start = robot.home.with_rates([turning])
    given = {"ball.x": 0.2, "ball.hx": 0.3, "ball.hy": 0.5, "ball.hz": 0.4}
    found, _ = rolled(robot, ball, start, given, 400, 0.005)
    t = 0.005 * np.arange(401)
    path = np.exp(1j * turning * t) * (found[:, 0] + 1j * found[:, 1])
    velocity = np.exp(1j * turning * t) * (found[:, 2] + 1j * found[:, 3]) + 1j * turning * path
    rate = 2 / 7 * turning
    centre = path[0] - velocity[0] / (1j * rate)
    circle = centre + (path[0] - centre) * np.exp(1j * rate * t)
    np.testing.assert_allclose(path, circle, atol=1e-9)


def moving(t: float):
    """A plate that turns and moves in all ways: R, Omega, alpha, p, p', p'' at a time."""
    a, b = 0.3 * np.sin(2 * t), 0.2 * np.cos(3 * t)
    da, db = 0.6 * np.cos(2 * t), -0.6 * np.sin(3 * t)
    dda, ddb = -1.2 * np.sin(2 * t), -1.8 * np.cos(3 * t)
    X = Rotation.from_rotvec([a, 0, 0]).as_matrix()
    R = X @ Rotation.from_rotvec([0, b, 0]).as_matrix()
    ex, ey = np.eye(3)[:2]
    omega = da * ex + db * X @ ey
    alpha = dda * ex + ddb * X @ ey + db * np.cross(da * ex, X @ ey)
    p = np.array([0.1 * np.sin(t), 0.2 * t**2, 0.05 * np.cos(4 * t)])
    v = np.array([0.1 * np.cos(t), 0.4 * t, -0.2 * np.sin(4 * t)])
    dv = np.array([-0.1 * np.sin(t), 0.4, -0.8 * np.cos(4 * t)])
    return R, omega, alpha, p, v, dv


def test_on_a_plate_that_moves_in_all_ways_it_obeys_newton_and_euler():
    """I omega' = -r n x F with F = m (c'' - g), with the plate's accelerations, which the ball's
    own states do without."""
    r, k, height, g = 0.05, 2 / 5, 0.02, np.array(DOWN)
    ball = RollingBall("plate", height, r, DOWN, k)

    def by_momentum(t, z):
        R, omega, _, p, v, _ = moving(t)
        frame = SimpleNamespace(position=p, rotation=R, angular_velocity=omega, velocity=v)
        values = dict(zip([each.name for each in ball.states], z, strict=True))
        state = SimpleNamespace(body=lambda name: frame, extra=values.__getitem__)
        return np.asarray(ball.rates(state), float)

    def contact(t, x, y, w):
        R, omega, _, _, v, _ = moving(t)
        n, rho = R[:, 2], R @ [x, y, height]
        return R, omega, n, rho, np.cross(r * (w - omega), n), v + np.cross(omega, rho)

    def by_newton(t, z):
        (x, y), w = z[:2], z[2:]
        _, _, alpha, _, _, dv = moving(t)
        R, omega, n, rho, slipless, _ = contact(t, x, y, w)
        carried = dv + np.cross(alpha, rho) + np.cross(omega, np.cross(omega, rho) + slipless)
        bent = r * np.cross(w, np.cross(omega, n))
        turned = -np.cross(n, carried + bent - g) / (r * (1 + k))
        return np.concatenate([(R.T @ slipless)[:2], turned])

    x, y, w = 0.1, -0.2, np.array([1.0, -2.0, 5.0])
    _, _, n, _, _, V = contact(0.0, x, y, w)
    h = k * r * w + np.cross(n, V + r * np.cross(w, n))
    options = {"rtol": 1e-11, "atol": 1e-12, "method": "DOP853"}
    ours = solve_ivp(by_momentum, (0, 2), [x, y, *h], **options).y[:2, -1]
    theirs = solve_ivp(by_newton, (0, 2), [x, y, *w], **options).y[:2, -1]
    assert np.linalg.norm(theirs - [x, y]) > 0.2
    np.testing.assert_allclose(ours, theirs, atol=1e-8)


@pytest.mark.parametrize("hold", first(2, [1, 15, 5, 30]))
def test_it_is_pressed_on_the_platform_whatever_its_legs_are_told(hold):
    """n . (c'' - g) > 0 by differences of the centre's place, under actions from end to end."""
    process, count, radius = balancing(), 24, 0.05
    envs, robot, draw = Environments(process, count), process.robot, np.random.default_rng(hold)
    envs.reset(seed=0)
    centres, normals = [], []
    for k in range(60):
        if k % hold == 0:
            action = draw.choice([-1.0, 1.0], (count, 6))
        *_, over, _, _ = envs.step(action)
        assert not over.any()
        x, y = envs.extra("ball.x"), envs.extra("ball.y")
        frames = [robot.observe(state).body("platform") for state in envs.states]
        n = np.array([frame.rotation[:, 2] for frame in frames])
        place = np.stack([x, y, np.full(count, DISC / 2 + radius)], axis=1)
        rotation = np.array([frame.rotation for frame in frames])
        at = np.array([frame.position for frame in frames])
        centres.append(at + np.einsum("eij,ej->ei", rotation, place))
        normals.append(n)
    acceleration = np.diff(centres, 2, axis=0) / process.dt**2
    pressed = np.einsum("kei,kei->ke", acceleration - DOWN, np.array(normals)[1:-1])
    assert pressed.min() > 0.3 * G
