"""Elastic joints and backlash against closed forms and Spong's equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork.mechanism.record import swapped
from linkwork.mechanism.transmissions import Combination
from linkwork.robots import five_bar

from tests.equations.evaluation import close

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
ARM = """
linkwork: 1
bodies:
  arm: {mass: 1.5, centre_of_mass: [0.3, 0, 0], inertia: {xx: 0.01, yy: 0.05, zz: 0.05}}
joints:
  hip:
    type: revolute
    connects: [ground, arm]
    axis: [0, 1, 0]
    elastic: {stiffness: 80, damping: 0.2, motor_inertia: 0.08}
    friction: {viscous: 0.1}
actuators: [hip]
"""


def ran(robot: lw.Robot, state: lw.State, forces=None, **options) -> lw.Run:
    run = robot.simulate(state, forces, **TIGHT | options)
    assert run.status is lw.Status.FINISHED, run.message
    close(run["energy_balance"].values, np.zeros(len(run.dataset.time)), 1e-8)
    return run


def test_an_elastic_arm_moves_by_spong_s_equations():
    """J q'' = f + m g c cos q - b q',  B theta'' = u - f, integrated by another program."""
    J = 0.05 + 1.5 * 0.3**2

    def slopes(t, y):
        q, theta, w, omega = y
        f = 80 * (theta - q) + 0.2 * (omega - w)
        return (
            w,
            omega,
            (f + 1.5 * 9.81 * 0.3 * np.cos(q) - 0.1 * w) / J,
            (2 * np.sin(3 * t) - f) / 0.08,
        )

    robot = lw.Robot(lw.Mechanism.parse(ARM))
    assert robot.actuators == ("hip motor",) and robot.mobility == 2
    start = robot.state({"hip": 0.2, "hip motor": 0.25})
    run = ran(robot, start, lambda t, state: [2 * lw.math.sin(3 * t)], duration=1.0)
    expected = solve_ivp(slopes, (0, 1), [0.2, 0.25, 0, 0], rtol=1e-12, atol=1e-13).y[:, -1]
    close(run["joint_position"].values[-1], expected[:2], 1e-8)
    close(run["joint_rate"].values[-1], expected[2:], 1e-7)


def test_motors_in_a_closed_loop():
    """A five-bar with elastic drives: its loop stays closed, its energy is kept."""
    mechanism = five_bar()
    elastic = {"stiffness": 200.0, "motor_inertia": 0.01}
    fields = mechanism.model_dump(exclude_defaults=True)
    for name in mechanism.actuators:
        fields["joints"][name] |= {"elastic": elastic, "type": mechanism.joints[name].type}
    for name, joint in mechanism.joints.items():
        fields["joints"][name]["type"] = joint.type
    robot = lw.Robot(lw.Mechanism(**fields))
    assert robot.mobility == 4 and set(robot.actuators) == {
        f"{name} motor" for name in mechanism.actuators
    }
    run = ran(robot, robot.home.with_rates(np.full(4, 0.5)), [0.2, -0.1], duration=0.3)
    assert run["closure_error"].values.max() < 1e-13 * robot.size


def test_a_joint_behind_its_spring_is_not_driven():
    robot = lw.Robot(lw.Mechanism.parse(ARM))
    with pytest.raises(lw.LinkworkError, match="the actuators do not drive hip"):
        robot.inverse_dynamics(robot.home, [1.0, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("revolute", "spherical", "only joints of one freedom are elastic: revolute, prismatic"),
        ("stiffness: 80", "stiffness: 0", "joints.hip.elastic.stiffness: 0 is not above 0"),
        ("  arm:", "  hip rotor: {}\n  arm:", "'hip rotor' is what the elastic joint 'hip' is"),
    ],
)
def test_elastic_joints_that_are_none(old, new, said):
    with pytest.raises(lw.MechanismError, match=said):
        lw.Mechanism.parse(ARM.replace(old, new))


def test_files_hold_what_is_made(tmp_path):
    mechanism = lw.Mechanism.parse(ARM)
    mechanism.save(tmp_path / "arm.yaml")
    assert lw.Mechanism.load(tmp_path / "arm.yaml") == mechanism
    joint = lw.RevoluteJoint(
        connects=("ground", "arm"), elastic={"stiffness": 1.0, "motor_inertia": 1.0}
    )
    past = swapped(mechanism, joints={**mechanism.joints, "hip": joint})
    with pytest.raises(lw.MechanismError, match="its motor is not made"):
        lw.Robot(past)


def test_wheels_with_backlash():
    """Teeth cross the play freely, and half an oscillation of both wheels' inertia turns them."""
    inertias, radii, play, k = (2e-3, 5e-3), (0.02, 0.05), 4e-4, 1e6
    wheels = {
        name: lw.Body(mass=1.0, inertia=lw.Inertia(xx=own, yy=own, zz=own))
        for name, own in zip(("a", "b"), inertias, strict=True)
    }
    stop = lw.Stop(lower=-play / 2, upper=play / 2, stiffness=k, exponent=1.0)
    mesh = Combination(ratios=dict(zip(("p", "w"), radii, strict=True)), stop=stop)
    robot = lw.Robot(
        lw.Mechanism(
            bodies=wheels,
            joints={
                "p": lw.RevoluteJoint(connects=("ground", "a")),
                "w": lw.RevoluteJoint(connects=("ground", "b")),
            },
            transmissions={"mesh": mesh},
        )
    )
    run = ran(robot, robot.home.with_rates([1.0, 0.0]), duration=0.05)
    mass = 1 / sum(r**2 / own for r, own in zip(radii, inertias, strict=True))
    first, bounce = play / 2 / radii[0], np.pi * np.sqrt(mass / k)
    times = [first, first + bounce, first + bounce + 2 * first, first + 2 * bounce + 2 * first]
    close(run.coords["event_time"].values, times, 1e-10)
    assert list(run.coords["event"].values) == [
        f"mesh: {side} stop {what}" for side in ("upper", "lower") for what in ("begins", "ends")
    ]
    rates = run["joint_rate"].values[-1]
    close(np.array(inertias) @ (rates / radii * [1, -1]), inertias[0] / radii[0], 1e-9)


def test_a_transmission_s_stop_begins_somewhere():
    with pytest.raises(lw.MechanismError, match="the stop begins nowhere"):
        Combination(ratios={"p": 1.0}, stop=lw.Stop(stiffness=1.0))


@pytest.mark.parametrize("stiffness", ["rigid", float("inf")])
def test_rigid_contact_is_refused(stiffness):
    with pytest.raises(lw.MechanismError, match="rigid contact, by complementarity conditions"):
        lw.Stop(lower=0.0, stiffness=stiffness)
