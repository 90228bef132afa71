"""Contacts of boxes against geometry, closed forms and identities."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import linkwork as lw
from linkwork.equations.algebra import quaternion_matrix, rotation_matrix

from tests.equations.evaluation import close
from tests.robot.test_contacts import BALL, FREE, SPHERE, R, at, g, m, on_floor, ran

SIZE = (0.6, 0.4, 0.3)


def posed(random) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Return a random pose of the second body, as coordinates, position and rotation."""
    q = random.normal(size=4)
    place = [*(0.5 * random.normal(size=3)), *(q / np.linalg.norm(q))]
    return place, np.array(place[:3]), np.array(ca.DM(quaternion_matrix(ca.SX(place[3:]))))


@pytest.mark.parametrize(("half", "exchanged"), [(0.0, False), (0.45, False), (0.45, True)])
def test_gaps_of_boxes_and_round_bodies_are_least_distances(half, exchanged):
    """Between a box and a middle line, by least squares within both."""
    random, h, near = np.random.default_rng(7), np.array(SIZE) / 2, 0
    frames = [lw.Frame(position=(0.1, -0.2, 0.05), rotation=(0.4, -1.1, 0.3)), lw.Frame()]
    box = lw.Box(size=SIZE, frame=frames[0])
    ball = lw.Capsule(radius=R, length=2 * half, frame=frames[1]) if half else SPHERE
    pair = (ball, box) if exchanged else (box, ball)
    contact = lw.Contact(connects=("ground", "ball"), surfaces=pair, stiffness=1.0)
    bodies, joints = {"ball": BALL}, {"f": FREE}
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, contacts={"pair": contact}))
    axes, origin = rotation_matrix(frames[0].rotation), np.array(frames[0].position)
    for _ in range(30):
        place, p, A = posed(random)
        ends = []
        for side in (-1, 1):
            line = np.array([0, 0, side * half])
            ends.append(axes.T @ ((A.T @ (line - p) if exchanged else p + A @ line) - origin))

        def square(x, ends=ends):
            return np.sum((ends[0] + x[3] * (ends[1] - ends[0]) - x[:3]) ** 2)

        bounds = [*zip(-h, h, strict=True), (0, 1)]
        best = minimize(square, [0, 0, 0, 0.5], bounds=bounds, tol=1e-16).fun
        if best > 1e-6:
            near += 1
            gap = float(robot.observe(robot.state(place)).gap("pair: contact"))
            close(gap, np.sqrt(best) - R, 1e-6)
    assert near > 9


def test_a_ball_runs_off_a_box_over_its_edge_and_keeps_its_energy():
    """It rests at the depth of its weight, rolls over a rim without a leap and falls."""
    box = lw.Box(size=(1.0, 1.0, 0.4), frame=lw.Frame(position=(0, 0, -0.2)))
    robot = on_floor(box, stiffness=1e5)
    depth = (m * g / 1e5) ** (1 / 1.5)
    run = ran(robot, at(robot, (0.45, 0, R - depth), (0.8, 0, 0)), 0.4, rtol=1e-9, atol=1e-11)
    data = run.dataset
    first = data["contact_force"].values[0, 0]
    close(first, [0, 0, m * g], 1e-9)
    happened = run.coords["event"].values
    assert happened[0] == happened[-1] == "floor: contact ends"
    x, z = data["joint_position"].values[-1, [0, 2]]
    assert x > 0.65 and z < 0.05


def test_a_ball_bounces_off_a_corner_along_the_line_between():
    box = lw.Box(size=(1.0, 1.0, 1.0), frame=lw.Frame(position=(-0.5, -0.5, -0.5)))
    n = np.array([1.0, 2.0, 2.0]) / 3
    robot = on_floor(box, gravity=(0, 0, 0), stiffness=1e5, restitution=0.6, impact_rate=1.5)
    run = ran(robot, at(robot, (R + 0.1) * n, -1.5 * n), 0.3)
    close(run["joint_rate"].values[-1, :3], 0.9 * n, 1e-6)


def test_a_box_rests_on_a_box_by_its_corners():
    """Four corners of the upper one press, each with a quarter of the weight; the places are named
    and the turning forces at rest are the slope of the energy."""
    lower = lw.Box(size=(1.0, 1.0, 0.2), frame=lw.Frame(position=(0, 0, -0.1)))
    upper = lw.Box(size=(0.2, 0.2, 0.2))
    robot = on_floor(lower, ball=upper, stiffness=1e5, exponent=1.0)
    depth = m * g / 4e5
    run = ran(robot, at(robot, (0.1, 0.2, 0.1 - depth)), 0.05)
    force = run["contact_force"].values[-1]
    assert force.shape == (16, 3)
    close(np.sort(force[:, 2]), [0.0] * 12 + [m * g / 4] * 4, 1e-7)
    tilted = robot.state([0.1, 0.2, 0.08, *np.array([0.99, 0.05, -0.08, 0.02]) / 0.9948])
    slopes = []
    for i in range(3):
        ends = []
        for side in (-1, 1):
            moved = tilted.positions.copy()
            moved[i] += side * 1e-6
            ends.append(robot.energy(robot.state(moved))[1])
        slopes.append((ends[1] - ends[0]) / 2e-6)
    close(-m * robot.forward_dynamics(tilted, [])[:3], slopes, 1e-6)


def test_corners_of_the_fixed_box_meet_faces_of_the_free_one():
    """A plate laid over a smaller box touches it only by that one's corners."""
    lower = lw.Box(size=(0.2, 0.2, 0.2), frame=lw.Frame(position=(0, 0, -0.1)))
    robot = on_floor(lower, ball=lw.Box(size=(1.0, 1.0, 0.1)), stiffness=1e5, exponent=1.0)
    depth = m * g / 4e5
    run = ran(robot, at(robot, (0, 0, 0.05 - depth)), 0.05)
    close(run["joint_position"].values[-1, :3], [0, 0, 0.05 - depth], 1e-9)


def test_points_meet_a_box():
    box = lw.Box(size=(1.0, 1.0, 0.2), frame=lw.Frame(position=(0, 0, -0.1)))
    feet = lw.Points(points=((0.1, 0, 0), (-0.1, 0.1, 0), (-0.1, -0.1, 0)), radius=0.02)
    contact = lw.Contact(connects=("ground", "ball"), surfaces=(box, feet), stiffness=1e5)
    bodies, joints = {"ball": BALL}, {"f": FREE}
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, contacts={"feet": contact}))
    seen = robot.observe(robot.state([0.0, 0, 0.05, 1, 0, 0, 0]))
    for i in (1, 2, 3):
        close(float(seen.gap(f"feet.{i}: contact")), 0.03, 1e-12)
