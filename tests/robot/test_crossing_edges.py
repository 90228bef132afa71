"""Edges of boxes that cross, against geometry, closed forms, identities and MuJoCo."""

from __future__ import annotations

import os

import casadi as ca
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.equations import functions
from linkwork.errors import LinkworkError

from tests.equations.evaluation import close, values
from tests.robot.test_contacts import FREE, PLANE, TIGHT, m

whole = pytest.mark.skipif(
    os.environ.get("LINKWORK_HOSTILE") != "all",
    reason="compiles large kernels: set LINKWORK_HOSTILE=all",
)
HALF, k = 0.05, 1e5
RIM = HALF * np.sqrt(2)
BAR = lw.Box(size=(2.0, 2 * HALF, 2 * HALF))
LYING = BAR.model_copy(update={"frame": lw.Frame(rotation=(np.pi / 4, 0, 0))})
BODY = lw.Body(mass=m, inertia=lw.Inertia(xx=2e-3, yy=3e-3, zz=4e-3))


def boxes(first=LYING, second=BAR, joint=FREE, gravity=(0.0, 0.0, 0.0), **law) -> lw.Robot:
    """Return a body with a box beside one of ground, which meet by corners and edges."""
    law = {"stiffness": k, "exponent": 1.0, "edges": True} | law
    pair = lw.Contact(connects=("ground", "ball"), surfaces=(first, second), **law)
    parts = {"bodies": {"ball": BODY}, "joints": {"f": joint}, "contacts": {"pair": pair}}
    return lw.Robot(lw.Mechanism(**parts, gravity=gravity))


@pytest.fixture(scope="module")
def bars() -> lw.Robot:
    """A bar that lies on its edge, and one above."""
    return boxes()


def over(yaw: float, roll: float, depth: float) -> np.ndarray:
    """Return the pose of a level bar whose lowest edge is by a depth below the other's highest."""
    turn = Rotation.from_euler("z", yaw) * Rotation.from_euler("x", roll)
    corner = min((turn.apply((0, y, z)) for y in (-HALF, HALF) for z in (-HALF, HALF)), key=last)
    x, y, z = -corner
    return np.array([x, y, z + RIM - depth, *turn.as_quat()[[3, 0, 1, 2]]])


def last(point: np.ndarray) -> float:
    return point[2]


def gaps(robot: lw.Robot, pose: np.ndarray) -> np.ndarray:
    equations = robot.equations
    apart = ca.Function("g", [equations.tree.q], [ca.vertcat(*equations.gaps.values())])
    return np.array(apart(pose)).ravel()


@pytest.mark.parametrize(("yaw", "roll"), [(np.pi / 2, np.pi / 4), (1.0, 0.6), (0.05, 0.9)])
def test_crossing_edges_press_along_the_line_between_them(bars, yaw, roll):
    """Each of both has half the depth, so that they press with k/2 of it, straight up; MuJoCo has
    the same depth and normal."""
    depth = 1e-4
    pose = over(yaw, roll, depth)
    found = gaps(bars, pose)
    assert found.size == 40 and (found < 0).sum() == 2
    close(found[found < 0], [-depth / 2] * 2, 1e-9)
    force = values(functions.terms(bars.equations), pose, np.zeros(6))["f"].ravel()[:3]
    close(force, [0, 0, k * depth / 2], 1e-4)
    box = '<geom type="box" size="1 0.05 0.05"/>'
    numbers = [" ".join(map(repr, map(float, part))) for part in (pose[:3], pose[3:])]
    bodies = (
        f"<body euler='45 0 0'>{box}</body>"
        f"<body pos='{numbers[0]}' quat='{numbers[1]}'><freejoint/>{box}</body>"
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    deepest = min(data.contact, key=lambda place: place.dist)
    close(deepest.dist, 2 * found.min(), 1e-8)
    close(np.abs(deepest.frame[:3]), [0, 0, 1], 1e-6)


def test_gaps_of_edges_have_no_leaps(bars):
    """Small motions change them little: past parallel edges, and where one comes to lie in a
    face."""
    steps = np.linspace(-1, 1, 201)
    past = [over(1e-9 * s, np.pi / 4 + 1e-3 * s, 1e-3) for s in steps]
    tilted = [over(0.0, 1e-9 * s, RIM - HALF + 1e-3) for s in steps]
    random = np.random.default_rng(3)
    ends = [over(*random.uniform(0.1, 1.5, 2), 0.02) for _ in range(2)]
    between = [ends[0] + (s + 1) / 2 * (ends[1] - ends[0]) for s in steps]
    for way in (past, tilted, between):
        found = np.array([gaps(bars, pose) for pose in way])
        moved = np.abs(np.diff(way, axis=0)).sum(axis=1)
        assert (np.abs(np.diff(found, axis=0)) < 5 * moved[:, None] + 1e-12).all()
        assert (found[:, 16:] < 0).any()


def test_forces_of_edges_are_the_slope_of_the_energy():
    """Q = -dU/dq along every rate, with edges that lie in faces, cross, and end within; in motion
    what is missing of that work is the power that contacts take."""
    law = {"exponent": 1.5, "dissipation": 0.5}
    robot = boxes(lw.Box(size=(0.3, 0.2, 0.1)), lw.Box(size=(0.25, 0.1, 0.2)), **law)
    of, random, pressed = robot.equations, np.random.default_rng(1), 0
    energy, terms = functions.energy(of), functions.terms(of)
    map_ = ca.Function("n", [of.tree.q], [of.tree.derivative_map])
    taken = sum((of_one.power for of_one in of.touching), ca.SX(0))
    power = ca.Function("p", [of.tree.q, of.v], [taken])
    for _ in range(6):
        q = np.array([*random.normal(size=3) * 0.1, *random.normal(size=4)])
        q[3:] /= np.linalg.norm(q[3:])
        v = random.normal(size=6)
        moved = np.array(map_(q)) @ v
        pressed += (gaps(robot, q)[16:] < 0).sum()

        def stored(e, q=q, moved=moved):
            return values(energy, q + e * moved, np.zeros(6))["potential"][0]

        slope = (stored(-2e-5) - 8 * stored(-1e-5) + 8 * stored(1e-5) - stored(2e-5)) / 12e-5
        close(values(terms, q, 0 * v)["f"] @ v / k, -slope / k, 1e-6 * max(1.0, abs(slope) / k))
        work, lost = values(terms, q, 0.1 * v)["f"] @ (0.1 * v), float(power(q, 0.1 * v))
        assert lost < 0
        close((work - lost) / k, -0.1 * slope / k, 1e-6 * max(1.0, abs(slope) / k))
    assert pressed > 10


@whole
def test_crossing_bars_bounce():
    """Half an oscillation of k/2 with the mass, and away with the same rate."""
    joint = lw.PrismaticJoint(connects=("ground", "ball"), axis=(0, 0, 1))
    upper = lw.Box(size=(2 * HALF, 2.0, 2 * HALF), frame=lw.Frame(rotation=(0, np.pi / 4, 0)))
    robot = boxes(second=upper, joint=joint)
    start = robot.state([2 * RIM + 1e-5]).with_rates([-1e-3])
    lasts = np.pi * np.sqrt(2 * m / k)
    run = robot.simulate(start, duration=0.012 + lasts, **TIGHT)
    close(run.dataset["joint_rate"].values[-1], [1e-3], 1e-7)
    times = run.coords["event_time"].values
    close(times[[0, -1]], [0.01, 0.01 + lasts], 1e-6)
    close(run.dataset["energy_balance"].values, np.zeros(len(run.dataset.time)), 1e-8)


@whole
def test_a_block_stands_over_the_rim_of_a_table():
    """With its middle above the table; corners alone let it turn over."""
    table, block = lw.Box(size=(1.0, 1.0, 0.2)), lw.Box(size=(0.4, 0.1, 0.1))
    for edges, stays in ((True, True), (False, False)):
        robot = boxes(
            table, block, gravity=(0, 0, -9.81), edges=edges, exponent=1.5, dissipation=1.0
        )
        run = robot.simulate(robot.state([0.49, 0, 0.15, 1, 0, 0, 0]), duration=0.2)
        assert run.status is lw.Status.FINISHED
        close(run.dataset["energy_balance"].values, np.zeros(len(run.dataset.time)), 1e-8)
        assert (abs(run.dataset["joint_position"].values[-1, 5]) < 0.02) == stays


def test_edges_of_what_has_none():
    with pytest.raises(LinkworkError, match="plane and box have no edges that cross"):
        boxes(first=PLANE)
