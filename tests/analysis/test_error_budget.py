"""Errors of the tool against closed forms, loops closed with other numbers, and random errors."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import error_budget
from linkwork.analysis._error_budget import largest

from tests.analysis.mechanisms import arm
from tests.catalogue import built


def test_an_arm_of_two_links():
    """dx = a / l1 dl1 + i a dq1 ...: the ellipse and the worst case by all corners."""
    robot = arm(1.0, 0.6)
    q = np.array([[0.3, 0.9], [1.2, -2.0]])
    elbow = next(name for name in robot.joints if name != robot.actuators[0])
    found = error_budget(
        robot,
        robot.state(q),
        {f"{elbow}.frames.0.position.x": 3e-4},
        resolution={robot.actuators[0]: 4e-4, robot.actuators[1]: 1e-3},
    )
    for k, (one, two) in enumerate(q):
        a, b = np.exp(1j * one), 0.6 * np.exp(1j * (one + two))
        parts: Any = np.array([3e-4 * a, 2e-4j * (a + b), 5e-4j * b])
        J = np.stack([parts.real, parts.imag])
        C = J @ J.T / 3
        np.testing.assert_allclose(found.covariance[k, 3:5, 3:5], C, rtol=1e-9, atol=1e-20)
        half, axes = found.ellipsoid
        np.testing.assert_allclose(half[k, :2] ** 2, np.linalg.eigvalsh(C)[::-1], rtol=1e-9)
        assert half[k, 2] == pytest.approx(0, abs=1e-12)
        np.testing.assert_allclose(
            np.abs(C @ axes[k, :2, 0]), np.abs(half[k, 0] ** 2 * axes[k, :2, 0]), atol=1e-18
        )
        corners = [abs(np.dot(signs, parts)) for signs in product((-1, 1), repeat=3)]
        assert found.worst[k] == pytest.approx(max(corners), rel=1e-12)
        assert found.worst_turn[k] == pytest.approx(7e-4, rel=1e-9)
        np.testing.assert_allclose(found.bounds[k, 3:5], np.abs(J).sum(axis=1), rtol=1e-9)
    assert sum(each.share for each in found.contributions) == pytest.approx(1)


@pytest.mark.parametrize("tilt", [0.5, np.pi / 2])
def test_play_in_the_plane_is_that_of_no_body_s_own_axes(tilt):
    """Uniform in a circle of the plane, however the first link's frame is turned against it."""
    body = lw.Body(mass=1, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    back = lw.Frame(rotation=(-tilt, 0, 0))
    elbow = lw.Frame(position=(1, 0, 0), rotation=(-tilt, 0, 0))
    described = lw.Mechanism(
        bodies={"upper": body, "fore": body},
        joints={
            "hip": lw.RevoluteJoint(connects=("ground", "upper"), frames=(lw.Frame(), back)),
            "elbow": lw.RevoluteJoint(connects=("upper", "fore"), frames=(elbow, lw.Frame())),
        },
        actuators=("hip", "elbow"),
        tools={"tip": lw.Tool(body="fore", frame=lw.Frame(position=(0.6, 0, 0)))},
    )
    robot = lw.Robot(described)
    found = error_budget(robot, robot.state([0.3, 0.8]), clearances={"elbow": 1e-3})
    np.testing.assert_allclose(found.covariance[3:5, 3:5], 2.5e-7 * np.eye(2), atol=1e-15)
    assert found.worst == pytest.approx(1e-3)


def test_what_leads_a_planar_robot_out_of_its_plane_counts_nowhere():
    """A single source's worst case is sqrt(3) of its deviation, as that of a number in -s .. s."""
    robot = arm(1.0, 0.6)
    elbow = next(name for name in robot.joints if name != robot.actuators[0])
    paths = {f"joints.{elbow}.frames.0.position.{axis}": 1e-4 for axis in "xyz"}
    told = error_budget(robot, robot.state([[0.3, 0.9]]), paths)
    for name, worst in zip(paths, (1e-4, 1e-4, 0.0), strict=True):
        alone = error_budget(robot, robot.state([[0.3, 0.9]]), {name: 1e-4})
        assert alone.worst[0] == pytest.approx(worst, rel=1e-9)
        assert alone.deviation[0] == pytest.approx(worst / np.sqrt(3), rel=1e-9)
    assert [each.worst for each in told.contributions] == pytest.approx([1e-4, 1e-4, 0.0])
    assert told.bounds[0, 5] == 0


def test_all_rods_of_a_delta_too_long():
    """Over its middle the platform sinks by rod / h of what all rods are too long, h the height of
    the elbows over it; what the motors measure is a step of their arms."""
    robot = built("delta")
    told = error_budget(robot, robot.home, {"rod_*.length": 1e-5}, resolution=1e-4)
    rods = [J for source, J in zip(told.sources, told.sensitivities, strict=True) if source.numbers]
    angle = robot.home["motor_1"]
    h = 0.9 - 0.524 * np.sin(angle)
    np.testing.assert_allclose(np.sum(rods, axis=0).ravel()[:5], 0, atol=1e-12)
    assert np.sum(rods) == pytest.approx(-1.244 / h, rel=1e-9)
    r = 0.164 + 0.524 * np.cos(angle) - 0.044
    motors = told.sensitivities[-3:]
    sinks = -0.524 * (np.cos(angle) + np.sin(angle) * r / h)
    assert np.sum(motors, axis=0)[5, 0] == pytest.approx(sinks, rel=1e-9)
    assert len(rods) == 6
    assert "rod_1_left.length" in repr(told)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", ["prr3", "five_bar", "stewart"])
def test_numbers_against_loops_that_are_closed_again(name):
    """Central differences of the direct kinematics with other numbers, away from home."""
    robot = built(name)
    home = robot.tool_pose(robot.home)[: len(robot.actuators)]
    state = robot.assemble(tool=home + 0.03 * np.cos(np.arange(home.size)))
    joint = robot.joints[-1] if name != "stewart" else "ball_2"
    tool = f"{next(iter(robot.mechanism.tools))}.frame.position.y"
    turn = f"{next(iter(robot.mechanism.joints))}.frames.0.turn.{'y' if name == 'stewart' else 'z'}"
    told = error_budget(robot, state, {tool: 1e-3, turn: 1e-3}, clearances={joint: 1e-3})
    J = np.concatenate(told.sensitivities, axis=-1)
    paths = [path for source in told.sources for path in source.numbers]
    free = robot.free(*paths)
    actuated = {name: float(state[name]) for name in robot.actuators}
    for k, path in enumerate(paths):
        frames = []
        for sign in (1, -1):
            other = free.with_parameters({path: free.parameters[path] + sign * 1e-5})
            frames.append(placed(other, other.assemble(actuated)))
        (p, R), (p_0, R_0) = frames
        W = (R - R_0) / 2e-5 @ R_0.T
        turned = np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2
        np.testing.assert_allclose(J[:, k], [*turned, *(p - p_0) / 2e-5], atol=2e-6)


def placed(robot, state):
    """Return the tool's position and orientation."""
    tool = robot.mechanism.first_tool
    p, R = robot.body_poses(state)[tool.body]
    return p + R @ np.array(tool.frame.position), R


def test_an_orthoglide_is_least_sensitive_where_it_is_isotropic():
    """Caro, Wenger, Bennis & Chablat (ASME IDETC 2004, Sensitivity analysis of the Orthoglide): the
    legs count alike, least where it is isotropic, most towards singular poses. There each leg leads
    the tool along its own rods, by as much as both of them are too long."""
    robot = built("orthoglide")
    home = robot.tool_pose(robot.home)[:3]
    steps = np.array([[0, 0, 0], [1, 0, 0], [0, -1, 0], [0.6, 0.6, 0.6], [1.2, 1.2, 1.2]])
    states = robot.assemble(tool=home + 0.1 * steps)
    told = error_budget(robot, states, {"rod_*.length": 1e-5})
    J = np.concatenate(told.sensitivities, axis=-1)[:, 3:]
    legs = J[0].reshape(3, 3, 2).sum(axis=-1)
    np.testing.assert_allclose(np.abs(legs).round(9), np.eye(3), atol=1e-9)
    assert told.worst[0] == pytest.approx(1e-5 * np.sqrt(3), rel=1e-9)
    assert (told.worst[1:] > 1.0001 * told.worst[0]).all()
    assert told.worst[4] > told.worst[3]


def test_a_named_quantity_is_one_source():
    """Of a length that three joints bear: the sum of their sensitivities; play beside it."""
    plain = built("prr3")
    paths = [f"wrist_{i}.frames.0.position.x" for i in (1, 2, 3)]
    robot = lw.Robot(plain.mechanism.with_quantities({"rod": 0.3}, dict.fromkeys(paths, "rod")))
    named = error_budget(robot, robot.home, {"rod": 1e-5}, clearances={"wrist_1": 1e-5})
    each = error_budget(plain, plain.home, dict.fromkeys(paths, 1e-5), clearances={"wrist_1": 1e-5})
    together = np.sum(each.sensitivities[:3], axis=0)
    np.testing.assert_allclose(named.sensitivities[0], together, atol=1e-12)
    # Play lies in the frame on the platform, for a formula places the one on the link.
    assert named.sources[1].numbers[0] == "joints.wrist_1.frames.1.position.x"
    play = [
        next(one.worst for one in told.contributions if one.source.kind == "clearance")
        for told in (named, each)
    ]
    assert play[0] == pytest.approx(play[1], rel=1e-9)


def test_random_errors_have_the_deviation_foretold_and_stay_within_the_worst_case():
    """Loops closed with numbers drawn within their tolerances (fixed seed)."""
    robot = built("prr3")
    tolerances = {f"wrist_{i}.frames.0.position.x": 2e-4 for i in (1, 2, 3)}
    tolerances |= {f"slide_{i}.frames.0.position.y": 1e-4 for i in (1, 2, 3)}
    state = robot.assemble(tool=robot.tool_pose(robot.home) + np.array([0.05, 0.03, -0.2]))
    told = error_budget(robot, state, tolerances, clearances={"pivot_1": 1e-4}, resolution=2e-4)
    paths = [path for source in told.sources for path in source.numbers]
    free, random, count = robot.free(*paths), np.random.default_rng(1905), 4000
    p = free.p[:, None] + np.array([*tolerances.values(), 0, 0])[:, None] * random.uniform(
        -1, 1, (len(paths), count)
    )
    angle, radius = 2 * np.pi * random.uniform(size=count), np.sqrt(random.uniform(size=count))
    p[-2:] += 1e-4 * radius * np.array([np.cos(angle), np.sin(angle)])
    measured = np.array([[state[name]] for name in robot.actuators])
    measured = measured + 1e-4 * random.uniform(-1, 1, (3, count))
    functions = free.functions()
    q = functions.closed.map(count)(measured, np.tile(state.q[:, None], count), p)
    poses = functions.tool_pose.map(count)(q, p)[:3, :].full().T
    offs = (poses - robot.tool_pose(state))[:, [2, 0, 1]]
    C = told.covariance[2:5, 2:5]
    scale = np.sqrt(np.diag(C))
    spread = np.cov(offs.T) / np.outer(scale, scale)
    np.testing.assert_allclose(spread, C / np.outer(scale, scale), atol=0.05)
    far = np.linalg.norm(offs[:, 1:], axis=1).max()
    assert 0.4 * told.worst < far < 1.001 * told.worst
    assert np.abs(offs[:, 0]).max() < 1.001 * told.worst_turn


def test_the_largest_sum_of_vectors():
    """All corners of a zonotope in space; a ball among them adds its radius where it points."""
    random = np.random.default_rng(7)
    for _ in range(20):
        parts = random.standard_normal((9, 3))
        corners = max(np.linalg.norm(s @ parts) for s in product((-1, 1), repeat=9))
        assert largest([part[:, None] for part in parts]) == pytest.approx(corners, rel=1e-9)
        with_ball = largest([*(part[:, None] for part in parts), 0.7 * np.eye(3)])
        assert with_ball == pytest.approx(corners + 0.7, rel=1e-9)


def test_bad_input_is_refused():
    robot = built("five_bar")
    home = robot.home
    cases = [
        ({}, "no source of errors is given"),
        ({"tolerances": {"elbow_1.frames.0.position.x": -1}}, "tolerance of 'elbow_1"),
        ({"tolerances": {"nothing.x": 1e-5}}, "leads to no number"),
        ({"tolerances": {"rod_*.length": 1e-5}}, "matches no number that can be free"),
        (
            {"tolerances": {"elbow_*.frames.0.position.x": 1e-5, "elbow_1.frames.*.x": 1e-5}},
            "name it once",
        ),
        ({"clearances": {"elbow_9": 1e-5}}, "elbow_9"),
        ({"clearances": {"elbow_1": np.nan}}, "clearance of 'elbow_1'"),
        ({"resolution": {"elbow_1": 1e-5}}, "elbow_1"),
        ({"resolution": "fine"}, "the resolution"),
    ]
    for given, sentence in cases:
        with pytest.raises(lw.LinkworkError, match=sentence):
            error_budget(robot, home, **given)
    with pytest.raises(lw.LinkworkError, match="give a State"):
        error_budget(robot, [0.1, 0.2], resolution=1e-5)  # pyright: ignore
    with pytest.raises(lw.LinkworkError, match="at state 1 the tool can move"):
        stacked = robot.state(np.stack([home.positions, straightened(robot).positions]))
        error_budget(robot, stacked, resolution=1e-5)
    bennett = built("bennett")
    with pytest.raises(lw.LinkworkError, match="more constraints than it needs"):
        error_budget(bennett, bennett.home, {"hinge_2.frames.0.position.x": 1e-5})
    with pytest.raises(lw.LinkworkError, match="1 actuator and the mobility 2"):
        driven_once = lw.Robot(robot.mechanism.model_copy(update={"actuators": ("motor_1",)}))
        error_budget(driven_once, driven_once.home, resolution=1e-5)


def straightened(robot):
    """Return a five-bar with its distal links in a line."""
    c, r = 0.15, 0.25
    # Elbows 0.7 m apart, symmetric about the middle of the base.
    cosine = (0.35 - c) / r
    angle = np.arccos(cosine)
    q = {"motor_1": np.pi - angle, "motor_2": angle}
    return robot.state(
        {
            **q,
            "elbow_1": -q["motor_1"],
            "elbow_2": np.pi - q["motor_2"],
            "tip": np.pi,
        }
    )


def test_actuators_without_a_coordinate_or_with_free_ratios():
    """A rate of a ball joint cannot be held; a sum of coordinates is one with its ratios free."""
    cube = lw.Inertia(xx=1, yy=1, zz=1)
    ball = lw.SphericalJoint(connects=("ground", "arm"))
    described = lw.Mechanism(
        bodies={"arm": lw.Body(mass=1.0, inertia=cube)},
        joints={"ball": ball},
        actuators=ball.rates("ball"),
        tools={"tip": lw.mechanism.Tool(body="arm")},
    )
    robot = lw.Robot(described)
    with pytest.raises(lw.LinkworkError, match=r"'ball\.wx' has no coordinate that could be held"):
        error_budget(robot, robot.home, {"ball.frames.0.position.x": 1e-4})
    two = arm(1.0, 0.6).mechanism
    first, second = two.actuators
    belt = lw.mechanism.Combination(ratios={first: 1.0, second: 2.0})
    belted = {**{of: getattr(two, of) for of in type(two).model_fields}}
    belted |= {"transmissions": {"belt": belt}, "actuators": (first, "belt")}
    robot = lw.Robot(lw.Mechanism(**belted))
    state = robot.state([0.3, 0.9])
    found = error_budget(robot, state, {f"transmissions.belt.ratios.{second}": 1e-3})
    # 2 dq_2 + q_2 dr = 0
    assert found.sensitivities[0][2, 0] == pytest.approx(-0.9 / 2)


def test_what_only_orients_is_ranked_by_its_rotation():
    robot = built("agile_wrist")
    told = error_budget(robot, robot.home, resolution={"motor_1": 1e-3, "motor_2": 3e-3})
    first, second = told.contributions
    assert told.turns and first.source.name == "motor_2"
    assert 0.5 < first.turn_share < 1 and first.turn_share > second.turn_share
    assert "worst alone [rad]" in repr(told) and f"{first.turn_share:.1%}" in repr(told)
