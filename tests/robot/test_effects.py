"""Friction, springs, dampers, rotors and limits against closed forms."""

from __future__ import annotations

import re

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import bennett

from tests.equations.evaluation import close

g = 9.81
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
TIMES = np.linspace(0, 2, 21)
CUBE = lw.Body(mass=2.0, inertia=lw.Inertia(xx=0.3, yy=0.3, zz=0.3))


def one_body(
    joint: lw.mechanism.PairJoint, body: lw.Body = CUBE, gravity=(0.0, 0.0, 0.0), **more
) -> lw.Robot:
    return lw.Robot(
        lw.Mechanism(bodies={"body": body}, joints={"joint": joint}, gravity=gravity, **more)
    )


def to_body(kind, **fields):
    return kind(connects=("ground", "body"), **fields)


def motion(robot: lw.Robot, state: lw.State, times=TIMES) -> np.ndarray:
    """Return the coordinates of all joints at times of a free run."""
    run = robot.simulate(state, duration=times[-1], save_at=times, **TIGHT)
    assert run.status is lw.Status.FINISHED, run.message
    return run["joint_position"].values


def oscillation(
    start: float, inertia: float, stiffness: float, damping: float, times=TIMES
) -> np.ndarray:
    """Return x of  m x'' = -k x - c x'  from rest at `start`: x_0 e^(-b t) (cos w t + b / w sin w
    t)."""
    b = damping / (2 * inertia)
    w = np.sqrt(stiffness / inertia - b**2)
    return start * np.exp(-b * times) * (np.cos(w * times) + b / w * np.sin(w * times))


# Springs and dampers


def test_a_damped_oscillator():
    """The weight shifts its rest by m g / k; damper and viscous friction add up; so does the mass
    of a rotor."""
    slide = to_body(
        lw.PrismaticJoint,
        spring=lw.Spring(stiffness=50.0, rest=0.3, damping=0.5),
        friction=lw.Friction(viscous=0.7),
        rotor_inertia=1.5,
    )
    robot = one_body(slide, gravity=(0, 0, -g))
    rest = 0.3 - 2 * g / 50
    found = motion(robot, robot.state([rest + 0.2]))[:, 0]
    close(found, rest + oscillation(0.2, 3.5, 50.0, 1.2), 1e-9)
    assert np.isclose(robot.energy(robot.home)[1], 50 * 0.3**2 / 2)
    close(robot.passive_forces(robot.home.with_rates([2.0])), [50 * 0.3 - 1.2 * 2], 1e-13)


def test_a_spring_of_a_free_turn_pulls_the_short_way_back():
    """A body of equal moments of inertia on a ball joint swings about a fixed axis: (I + J) x'' =
    -k x - c x'."""
    ball = to_body(
        lw.SphericalJoint,
        spring={"turn": lw.Spring(stiffness=20.0, damping=0.2)},
        friction={"turn": lw.Friction(viscous=0.1)},
        rotor_inertia={"turn": 0.2},
    )
    robot, axis = one_body(ball), np.array([2.0, -1.0, 2.0]) / 3
    for start in (2.5, -2.5, 4.0):
        quaternion = np.append(np.cos(start / 2), np.sin(start / 2) * axis)
        found = motion(robot, robot.state(quaternion))
        angle = 2 * np.arctan2(found[:, 1:] @ axis, found[:, 0])
        short = np.remainder(start + np.pi, 2 * np.pi) - np.pi
        error = angle - start + short - oscillation(short, 0.5, 20.0, 0.3)
        close(np.remainder(error + np.pi, 2 * np.pi) - np.pi, 0.0 * error, 1e-8)


def test_a_spring_between_points_pulls_along_their_line():
    """A point mass on a spring of rest length l_0 falls and bounces: m x'' = m g - k (x - l_0) - c
    x'."""
    mass = lw.Body(mass=2.0, inertia=lw.Inertia(xx=0.01, yy=0.01, zz=0.01))
    spring = lw.PointSpring(
        connects=("ground", "body"),
        points=((0, 0, 1.0), (0, 0, 0)),
        stiffness=80.0,
        rest_length=0.5,
        damping=0.6,
    )
    robot = one_body(to_body(lw.FreeJoint), mass, gravity=(0, 0, -g), springs={"spring": spring})
    below = 0.5 + 2 * g / 80
    found = motion(robot, robot.state([0, 0, 1 - below - 0.2, 1, 0, 0, 0]))
    close(1 - found[:, 2], below + oscillation(0.2, 2.0, 80.0, 0.6), 1e-9)
    close(found[:, [0, 1]], 0 * found[:, :2], 1e-12)


def parallelogram(spring: lw.Spring) -> lw.Mechanism:
    """Return a parallelogram of uniform rods with the same spring in all four hinges."""
    rod = lw.Body(mass=1.2, centre_of_mass=(0.25, 0, 0), inertia=lw.Inertia(zz=1.2 * 0.25 / 12))
    joints = {
        "foot_1": lw.RevoluteJoint(connects=("ground", "crank_1"), spring=spring),
        "foot_2": lw.RevoluteJoint(
            connects=("ground", "crank_2"), frames=(lw.Frame.planar(0.5), lw.Frame()), spring=spring
        ),
        "top_1": lw.RevoluteJoint(
            connects=("crank_1", "coupler"),
            frames=(lw.Frame.planar(0.5, angle=1.2), lw.Frame()),
            spring=spring,
        ),
        "top_2": lw.RevoluteJoint(
            connects=("crank_2", "coupler"),
            frames=(lw.Frame.planar(0.5, angle=1.2), lw.Frame.planar(0.5)),
            spring=spring,
        ),
    }
    bodies = dict.fromkeys(("crank_1", "crank_2", "coupler"), rod)
    reference = {"foot_1": -0.3, "foot_2": -0.3, "top_1": -0.9, "top_2": -0.9}
    return lw.Mechanism(bodies=bodies, joints=joints, gravity=(0, 0, 0), reference=reference)


def test_springs_in_all_joints_of_a_loop():
    """x the cranks' angle: foot = x, top = -1.2 - x, so 2 k ((x - r)^2 + (1.2 + x + r)^2) / 2; J =
    2 m l^2 / 3 + m l^2."""
    k, r, c = 3.0, 0.2, 0.05
    robot = lw.Robot(parallelogram(lw.Spring(stiffness=k, rest=r, damping=c)))
    assert len(robot.equations.topology.cuts) == 1
    inertia, rest = 5 / 3 * 1.2 * 0.25, -0.6
    start = robot.assemble({"foot_1": -0.3})
    found = motion(robot, start)
    expected = rest + oscillation(-0.3 - rest, inertia, 4 * k, 4 * c)
    close(found[:, robot.coordinates.index("foot_1")], expected, 1e-9)
    close(robot.energy(start)[1], k * ((-0.3 - r) ** 2 + (1.2 - 0.3 + r) ** 2), 1e-12)


def test_a_spring_winds_up_alike_in_the_tree_and_where_it_closes_a_loop():
    """In the Bennett linkage q_3 = -q_1, so a spring in hinge 3 does what it would do in hinge 1,
    turn after turn."""
    ends = []
    for wound in ("hinge_1", "hinge_3"):
        plain = bennett(gravity=(0, 0, 0))
        joints = {
            name: joint.model_copy(
                update={"spring": lw.Spring(stiffness=1e-2 if name == wound else 1e-9)}
            )
            for name, joint in plain.joints.items()
        }
        robot = lw.Robot(plain.model_copy(update={"joints": joints}))
        run = robot.simulate(robot.home.with_rates([12.0]), duration=1.5, **TIGHT)
        ends.append(run["joint_position"].values[-1])
        energy = run["kinetic_energy"].values + run["potential_energy"].values
        close(energy, energy[0] * np.ones_like(energy), 1e-9)
    assert ends[0][0] > 2 * np.pi
    close(ends[1], ends[0], 1e-6)


# Friction


SLOPE = 0.4


def block(coulomb: float, rate: float) -> lw.Robot:
    """Return a block on a slope with Coulomb friction."""
    axis = (np.cos(SLOPE), 0, -np.sin(SLOPE))
    friction = lw.Friction(coulomb=coulomb, coulomb_rate=rate)
    return one_body(to_body(lw.PrismaticJoint, axis=axis, friction=friction), gravity=(0, 0, -g))


def test_a_block_slides_down_against_coulomb_friction():
    """Well above the smoothing rate the block falls by g sin(slope) - F / m."""
    robot = block(3.0, 1e-3)
    state = robot.home.with_rates([0.5])
    slowed = g * np.sin(SLOPE) - 1.5
    close(robot.forward_dynamics(state, []), [slowed], 1e-5)
    found = motion(robot, state, TIMES / 4)[:, 0]
    close(found, 0.5 * TIMES / 4 + slowed * (TIMES / 4) ** 2 / 2, 1e-5)
    close(
        robot.forward_dynamics(robot.home.with_rates([-0.5]), []), [g * np.sin(SLOPE) + 1.5], 1e-5
    )


def test_a_block_that_friction_holds_creeps():
    """It creeps at the rate where F w / sqrt(w^2 + r^2) = m g sin(slope)."""
    robot = block(10.0, 0.02)
    share = 2 * g * np.sin(SLOPE) / 10.0
    run = robot.simulate(robot.home, duration=1.0)
    close(run["joint_rate"].values[-1], [0.02 * share / np.sqrt(1 - share**2)], 1e-7)


def test_friction_takes_the_energy_that_is_lost():
    """The smoothed force as the description defines it, (c + F / sqrt(w^2 + r^2)) w, for every
    rate."""
    hinge = to_body(
        lw.RevoluteJoint, friction=lw.Friction(viscous=0.3, coulomb=0.8, coulomb_rate=0.1)
    )
    robot = one_body(hinge)
    for w in (-2.0, -0.05, 0.0, 0.1, 3.0):
        expected = -(0.3 + 0.8 / np.hypot(w, 0.1)) * w
        close(robot.passive_forces(robot.home.with_rates([w])), [expected], 1e-13)


# Rotors


def test_a_geared_rotor_counts_by_the_square_of_its_ratio():
    """An arm driven over a gear q_m = n q: (I + n^2 J) q'' = n tau, the motor's torque tau."""
    n, J = 30.0, 2e-4
    arm = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    shaft = lw.Body(mass=0.0)
    joints = {
        "arm": lw.RevoluteJoint(connects=("ground", "arm")),
        "motor": lw.RevoluteJoint(connects=("ground", "shaft"), rotor_inertia=J),
        "gear": lw.GearJoint(ratios={"motor": 1.0, "arm": -n}),
    }
    robot = lw.Robot(
        lw.Mechanism(bodies={"arm": arm, "shaft": shaft}, joints=joints, actuators=("motor",))
    )
    state = robot.home.with_rates([9.0])
    found = dict(
        zip(
            robot.rates,
            robot.joint_accelerations(state, robot.forward_dynamics(state, [0.5])),
            strict=True,
        )
    )
    close([found["arm"], found["motor"] / n], 2 * [n * 0.5 / (0.1 + n**2 * J)], 1e-12)
    close(robot.energy(state)[0], (J + 0.1 / n**2) * 81 / 2, 1e-12)


# Limits


def test_limits_passed_are_reported_by_state_and_along_a_run():
    """Nothing stops the motion at a limit; a sentence says which is passed, from when on and how
    far."""
    slide = to_body(lw.PrismaticJoint, limits=lw.Limits(lower=-0.1, upper=0.5))
    robot = one_body(slide)
    assert robot.limits_passed(robot.state([0.5])) == ()
    assert robot.limits_passed(robot.state([-0.3])) == (
        "joint is below its lower limit -0.1: it reaches -0.3",
    )
    run = robot.simulate(robot.home.with_rates([1.0]), duration=1.0, save_at=np.linspace(0, 1, 11))
    assert run.status is lw.Status.FINISHED
    assert robot.limits_passed(run) == (
        "joint is above its upper limit 0.5 from t = 0.6 s on: it reaches 1",
    )
    stack = robot.state([[0.0], [0.7], [0.9]])
    assert robot.limits_passed(stack) == ("joint is above its upper limit 0.5: it reaches 0.9",)


@pytest.mark.parametrize("save_at", [None, np.linspace(0, 1, 11)], ids=["ends", "saved"])
def test_limits_passed_are_reported_for_members_as_for_single_runs(save_at):
    """Members of one push each: u t / m at most, u t^2 / 2 m far."""
    slide = to_body(lw.PrismaticJoint, limits=lw.Limits(upper=0.6, speed=1.1))
    robot = one_body(slide, actuators=("joint",))
    m = float(robot.mass_matrix(robot.home)[0, 0])
    pushes = m * np.array([[1.0], [1.16], [1.9]])
    many = robot.ensemble(robot.home, pushes, duration=1.0, save_at=save_at)
    for member, push in enumerate(pushes):
        run = robot.simulate(robot.home, push, duration=1.0, save_at=save_at)
        alone = robot.limits_passed(run if save_at is not None else run.final)
        told = tuple(
            re.sub(" from t = 1 s on" if save_at is None else "$", "", said)
            for said in many.limits_passed(member)
        )
        assert told == alone and len(told) == (0, 1, 2)[member]


def test_limits_of_speed_are_reported_by_state_and_along_a_run():
    """Under 2 N per kg the rate is 2 t; a turn's limit is that of its whole angular velocity."""
    robot = one_body(to_body(lw.PrismaticJoint, limits=lw.Limits(upper=9.0, speed=1.0)))
    assert robot.limits_passed(robot.home.with_rates([1.0 + 1e-12])) == ()
    assert robot.limits_passed(robot.home.with_rates([-1.5])) == (
        "joint is above its limit of speed 1: it reaches 1.5",
    )
    robot = lw.Robot(robot.mechanism.model_copy(update={"actuators": ("joint",)}))
    m = float(robot.mass_matrix(robot.home)[0, 0])
    run = robot.simulate(robot.home, [2 * m], duration=1.0, save_at=np.linspace(0, 1, 11))
    assert robot.limits_passed(run) == (
        "joint is above its limit of speed 1 from t = 0.6 s on: it reaches 2",
    )
    with pytest.raises(lw.LinkworkError, match="the run is one of another robot, with the joints"):
        lw.Robot("four_bar").limits_passed(run)
    ball = one_body(to_body(lw.SphericalJoint, limits={"turn": lw.Limits(speed=1.0)}))
    for rate, passed in ((0.57, False), (0.58, True)):
        told = ball.limits_passed(ball.home.with_rates(3 * [rate]))
        assert bool(told) == passed
    assert told == (f"joint.turn is above its limit of speed 1: it reaches {0.58 * 3**0.5:.6g}",)


@pytest.mark.parametrize("speed", [0, -1.0, np.nan, np.inf, "fast"])
def test_a_limit_of_speed_is_a_positive_number(speed):
    with pytest.raises(lw.MechanismError, match=r"^speed: "):
        lw.Limits(speed=speed)


def test_the_limit_of_a_free_turn_is_the_angle_between_the_frames():
    limits = {"turn": lw.Limits(upper=0.5)}
    robot = one_body(to_body(lw.SphericalJoint, limits=limits))
    for angle, passed in ((0.49, False), (0.51, True), (-0.51, True), (2 * np.pi - 0.49, False)):
        sentences = robot.limits_passed(robot.state([np.cos(angle / 2), 0, np.sin(angle / 2), 0]))
        assert bool(sentences) == passed
        if passed:
            assert sentences == ("joint.turn is above its upper limit 0.5: it reaches 0.51",)


@pytest.mark.parametrize("freedom", ["x", "y", "angle"])
def test_limits_of_joints_with_several_freedoms(freedom):
    robot = one_body(to_body(lw.PlanarJoint, limits={freedom: lw.Limits(lower=-1.0)}))
    beyond = robot.state({f"joint.{name}": -2.0 for name in ("x", "y", "angle")})
    assert robot.limits_passed(beyond) == (
        f"joint.{freedom} is below its lower limit -1: it reaches -2",
    )
