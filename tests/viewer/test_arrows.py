"""Arrows: their power is that of what they show, their lengths are in proportion, moments turn the
right way round."""

import numpy as np
import pytest

from linkwork import Robot, robots
from linkwork.mechanism import (
    GROUND,
    Body,
    Frame,
    Inertia,
    Mechanism,
    SphericalJoint,
    UniversalJoint,
)
from linkwork.viewer.arrows import ArrowField, Arrows, arc_about, drawn


def on_a(joint, *actuators: str) -> Robot:
    """Return a body on one joint with these rates actuated, a little away from where its axes
    coincide."""
    body = Body(mass=1.0, centre_of_mass=(0.1, 0.2, 0.3), inertia=Inertia(xx=0.1, yy=0.1, zz=0.1))
    names = joint.coordinates("joint")
    reference = dict(
        zip(names, (0.8, 0.3, 0.4, 0.33), strict=True)
        if len(names) == 4
        else zip(names, (0.4, 0.7), strict=True)
    )
    return Robot(
        Mechanism(
            bodies={"arm": body}, joints={"joint": joint}, actuators=actuators, reference=reference
        ),
        actuators,
    )


TURNED = (
    Frame(rotation=(0.3, -0.2, 0.5)),
    Frame(position=(0.1, 0.0, 0.2), rotation=(0.1, 0.4, 0.0)),
)
UNIVERSAL = UniversalJoint(connects=("ground", "arm"), frames=TURNED)
BALL = SphericalJoint(connects=("ground", "arm"), frames=TURNED)


@pytest.mark.parametrize(
    "robot",
    [
        on_a(UNIVERSAL, "joint.angle_1", "joint.angle_2"),
        on_a(BALL, "joint.wx", "joint.wy", "joint.wz"),
    ],
    ids=["universal", "spherical"],
)
def test_moments_of_joints_of_many_freedoms_work_on_their_rates(robot):
    require_power(robot)


@pytest.mark.parametrize("name", ["prr3", "five_bar", "stewart", "delta", "agile_wrist", "puma560"])
def test_actuators_work_on_their_joints_as_the_actuated_rates_do(name):
    require_power(Robot(getattr(robots, name)()))


def require_power(robot: Robot) -> None:
    """Sum over the actuators of f . (v of the outer body - v of the inner one), or m .
    (omega - omega), is u . q'."""
    field = ArrowField.of(robot, 1.0)
    random = np.random.default_rng(4)
    state = robot.home.with_rates(random.standard_normal(robot.mobility))
    u = random.standard_normal(len(robot.actuators))
    twists, poses = robot.twists(state), robot.body_poses(state)

    def motion(body: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if body == GROUND:
            return np.zeros(3), np.zeros(3)
        origin, R = poses[body]
        centre = origin + R @ np.array(robot.mechanism.bodies[body].centre_of_mass)
        omega, v = twists[robot.bodies.index(body)].reshape(2, 3)
        return omega, v + np.cross(omega, point - centre)

    vectors, power = field.forces(state, u), 0.0
    for label, place, value, turning in zip(
        robot.actuators, vectors.places, vectors.values, vectors.turning, strict=True
    ):
        inner, outer = robot.mechanism.joints[label.partition(".")[0]].connects
        relative = [b - a for a, b in zip(motion(inner, place), motion(outer, place), strict=True)]
        power += value @ relative[0 if turning else 1]
    rates = robot.joint_rates(state)[[robot.rates.index(label) for label in robot.actuators]]
    assert power == pytest.approx(u @ rates, rel=1e-9)


def test_velocities_are_those_of_small_motions():
    robot = Robot(robots.prr3())
    v, h = np.array([0.3, -0.2, 0.5]), 1e-6
    state = robot.home.with_rates(v)
    targets = {
        name: float(robot.home[name]) + h * x for name, x in zip(robot.actuators, v, strict=True)
    }
    later = robot.assemble(targets)
    found = ArrowField.of(robot, 1.0).velocities(state)
    moved = (robot.tool_pose(later) - robot.tool_pose(robot.home)) / h
    assert found.values[-1][:2] == pytest.approx(moved[:2], abs=1e-5)
    assert found.places[-1][:2] == pytest.approx(robot.tool_pose(robot.home)[:2])


def test_reactions_are_the_robot_s():
    robot = Robot(robots.five_bar())
    u = np.array([1.0, -2.0])
    vectors, reactions = (
        ArrowField.of(robot, 1.0).reactions(robot.home, u),
        robot.reactions(robot.home, u),
    )
    assert vectors.values == pytest.approx(reactions.wrenches[:, 3:])
    motors = [robot.mechanism.joints[name].frames[0].position for name in robot.actuators]
    assert vectors.places[
        [reactions.joints.index(name) for name in robot.actuators]
    ] == pytest.approx(np.array(motors))


def test_lengths_are_in_proportion_and_what_is_negligible_is_left_out():
    vectors = Arrows.of([(np.zeros(3), np.array([0, 0, s]), False) for s in (4.0, -2.0, 0.01)])
    arrows = drawn(vectors, vectors.largest(), 10.0).arrows
    assert arrows.shape == (2, 2, 3)
    lengths = arrows[:, 1, 2] - arrows[:, 0, 2]
    assert lengths[0] == pytest.approx(-2 * lengths[1])
    assert lengths[0] == pytest.approx(2.8)


def test_a_moment_turns_by_the_right_hand_rule():
    points = arc_about(np.array([1.0, 2.0, 3.0]), np.array([0, 0, 1.0]), 0.5, 1.0) - (1, 2, 3)
    assert np.linalg.norm(points, axis=1) == pytest.approx(0.5)
    assert (np.cross(points[:-1], points[1:])[:, 2] > 0).all()
    vectors = Arrows.of([(np.zeros(3), np.array([0, 0, -3.0]), True)])
    found = drawn(vectors, vectors.largest(), 1.0)
    start, end = found.arcs[0]
    assert np.cross(start, end)[2] < 0
    assert len(found.arrows) == 1 and found.arrows[0, 0] == pytest.approx(found.arcs[-1, 1])


def test_nothing_is_drawn_of_nothing():
    found = drawn(Arrows.of(()), (0.0, 0.0), 1.0)
    assert found.arrows.shape == found.arcs.shape == (0, 2, 3)
