"""Dry friction that brings bodies to rest, and other stiffness that appears on the way: the stiff
method takes over."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw

from tests.catalogue import built
from tests.equations.evaluation import close

MASS, COULOMB = 2.0, 3.0
RATES = (1e-4, 1e-6, 1e-9)


def block(rate: float, **mechanism) -> lw.Robot:
    """Return a block on a level slide with dry friction."""
    slide = lw.PrismaticJoint(
        connects=("ground", "block"), friction=lw.Friction(coulomb=COULOMB, coulomb_rate=rate)
    )
    bodies, joints = {"block": lw.Body(mass=MASS)}, {"slide": slide}
    return lw.Robot(
        lw.Mechanism(
            bodies=bodies, joints=joints, actuators=("slide",), gravity=(0, 0, 0), **mechanism
        )
    )


def stopping(v: float, rate: float) -> float:
    """Return the distance in which a block of this speed comes to rest: the integral of m sqrt(w^2
    + r^2) / F over w."""
    return MASS / COULOMB * (v * np.hypot(v, rate) + rate**2 * np.arcsinh(v / rate)) / 2


@pytest.mark.parametrize("rate", RATES)
def test_a_block_comes_to_rest_where_and_when_friction_has_taken_its_energy(rate):
    robot, v, end = block(rate), 1.5, MASS * 1.5 / COULOMB
    run = robot.simulate(
        robot.home.with_rates([v]), duration=5.0, max_steps=5000, save_at=[0.5 * end, end, 5.0]
    )
    assert run.success
    assert run.attrs["method"].startswith("Sharp-Smart 7(6), from 1")
    assert run.attrs["method"].endswith("s Rodas5P")
    x, w = run["joint_position"].values[:, 0], run["joint_rate"].values[:, 0]
    assert x[-1] == pytest.approx(stopping(v, rate), abs=1e-8)
    assert w[0] == pytest.approx(v / 2, abs=1e-3 * rate + 1e-8)
    assert 0 <= w[1] < 2 * rate  # at the time m v / F nearly all of it is gone
    assert abs(w[2]) < 1e-12


def test_a_block_that_is_pushed_less_than_friction_bears_creeps():
    """F w / sqrt(w^2 + r^2) = u:  w = r u / sqrt(F^2 - u^2); then a force that friction does not
    bear moves it again."""
    robot, u, rate = block(1e-6), 2.0, 1e-6
    creep = rate * u / np.sqrt(COULOMB**2 - u**2)
    run = robot.simulate(robot.home.with_rates([0.3]), [u], duration=2.0)
    assert run["joint_rate"].values[-1, 0] == pytest.approx(creep, rel=1e-6)
    pulled = lw.Sampled(np.array([0.0, 2.0, 4.0]), np.array([u, 5.0, 5.0]), "hold")
    whole = robot.simulate(robot.home.with_rates([0.3]), pulled, duration=4.0)
    assert whole["joint_rate"].values[-1, 0] == pytest.approx(
        2.0 * (5.0 - COULOMB) / MASS, rel=1e-5
    )
    later = robot.resume(run, [5.0], duration=2.0)
    assert later["joint_position"].values[-1, 0] == pytest.approx(
        whole["joint_position"].values[-1, 0], rel=1e-8
    )


def test_members_of_an_ensemble_come_to_rest_as_they_do_alone():
    robot, speeds = block(1e-6), np.array([[1.5], [0.2], [0.0], [3.0]])
    starts = robot.state(np.zeros((4, 1)), speeds)
    found = robot.ensemble(starts, duration=3.0, max_steps=5000, save_at=[0.05, 2.9])
    assert found.success
    close(found.final.q[:, 0], np.array([stopping(v, 1e-6) for v in speeds[:, 0]]), 1e-8)
    for i in range(4):
        alone = robot.simulate(starts.at(i), duration=3.0, max_steps=5000, save_at=[0.05, 2.9])
        assert (found.steps[i], found.nfev[i]) == (alone.steps, alone.nfev)
        close(found.dataset.joint_position.values[i], alone["joint_position"].values, 1e-15)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_block_under_a_sampled_controller_comes_to_rest(compiled):
    robot = block(1e-6)
    law = lw.control.Sampler(lambda t, state: [-1.0 * state["slide"]], rate=2.0, compiled=compiled)
    run = robot.simulate(robot.home.with_rates([1.0]), law, duration=20.0, max_steps=50_000)
    assert run.success
    assert "Rodas5P" in run.attrs["method"]
    assert abs(run["joint_rate"].values[-1, 0]) < 1e-6


@pytest.mark.long
def test_a_pendulum_with_dry_friction_stops_off_its_lowest_point():
    """m l^2 a = -m g l sin(x) - F w / sqrt(w^2 + r^2), against an implicit Runge-Kutta method of
    another house."""
    friction, rate = 1.0, 1e-5
    hinge = lw.RevoluteJoint(
        connects=("ground", "bob"), friction=lw.Friction(coulomb=friction, coulomb_rate=rate)
    )
    bob = lw.Body(mass=0.5, centre_of_mass=(0, -0.8, 0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"bob": bob}, joints={"hinge": hinge}, gravity=(0, -9.81, 0))
    )

    def slope(t, y):
        return y[1], (-0.5 * 9.81 * 0.8 * np.sin(y[0]) - friction * y[1] / np.hypot(y[1], rate)) / (
            0.5 * 0.64
        )

    run = robot.simulate(robot.state([2.0], [0.0]), duration=6.0, max_steps=20_000)
    assert run.success
    reference = solve_ivp(slope, (0, 6), [2.0, 0.0], method="Radau", rtol=1e-10, atol=1e-13)
    close(run.attrs["final_q"], reference.y[:1, -1], 1e-7)
    assert abs(0.5 * 9.81 * 0.8 * np.sin(run.attrs["final_q"][0])) < friction
    assert abs(run.attrs["final_q"][0]) > 1e-3


def test_a_robot_with_loops_stays_where_its_slides_bear_the_forces():
    rate, forces = 1e-7, np.array([0.5, -0.3, 0.2])
    mechanism = lw.robots.prr3()
    friction = lw.Friction(coulomb=0.8, coulomb_rate=rate)
    rubbing = {
        f"slide_{i}": mechanism.joints[f"slide_{i}"].model_copy(update={"friction": friction})
        for i in (1, 2, 3)
    }
    robot = lw.Robot(mechanism.model_copy(update={"joints": mechanism.joints | rubbing}))
    run = robot.simulate(robot.home, forces, duration=1.0, max_steps=20_000)
    assert run.success
    assert run.closure_error < 1e-12
    close(run.attrs["final_v"], rate * forces / np.sqrt(0.64 - forces**2), 1e-5 * rate)


def test_a_stiff_damper_is_met_by_the_stiff_method_too():
    """The flyball governor, published as stiff: as few steps as the stiff method takes, and its
    result."""
    robot = built("flyball_governor")
    forces = np.zeros(len(robot.actuators))
    own = robot.simulate(robot.home, forces, duration=1.0, save_at=[1.0])
    asked = robot.simulate(
        robot.home, forces, duration=1.0, save_at=[1.0], method="rodas", rtol=1e-10, atol=1e-12
    )
    assert "Rodas5P" in own.attrs["method"]
    close(own["joint_position"].values, asked["joint_position"].values, 1e-6)
    explicit = robot.simulate(robot.home, forces, duration=1.0, save_at=[1.0], method="sharp_smart")
    assert explicit.attrs["method"] == "Sharp-Smart 7(6)"
    assert own.steps < explicit.steps / 2


def test_a_fingertip_of_files_goes_on_by_the_stiff_method_by_itself():
    """1 N m over 0.01 rad/s on 8e-6 kg m2, an eigenvalue of -1.25e7/s, as a humanoid's file has it.

    It creeps where its weight m g r is borne: at 0.01 rad/s m g r / sqrt(1 - (m g r)^2).
    """
    m, r = 0.01, 0.02
    tip = lw.Body(
        mass=m, centre_of_mass=(r, 0, 0), inertia=lw.Inertia(xx=8e-6, yy=8e-6 - m * r**2, zz=8e-6)
    )
    joint = lw.RevoluteJoint(
        connects=("ground", "tip"), axis=(0, 1, 0), friction=lw.Friction(coulomb=1.0)
    )
    arm = lw.Body(mass=1.0, centre_of_mass=(0, 0, -0.5), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    hinge = lw.RevoluteJoint(connects=("ground", "arm"), axis=(0, 1, 0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"tip": tip, "arm": arm}, joints={"joint": joint, "hinge": hinge})
    )
    start = robot.home.with_rates({"joint": 0.0, "hinge": 1.0})
    run = robot.simulate(start, duration=1.0, max_steps=20_000)
    assert run.success and run.attrs["method"].endswith("Rodas5P")
    weight = m * 9.81 * r
    creep = 0.01 * weight / np.sqrt(1 - weight**2)
    assert float(run.final["joint"]) == pytest.approx(creep, rel=1e-4)


def test_runs_that_are_not_stiff_keep_their_method_however_long():
    robot = built("pendulum")
    state = robot.home.with_rates(np.ones(robot.mobility))
    own = robot.simulate(state, duration=400.0, save_at=[400.0])
    asked = robot.simulate(state, duration=400.0, save_at=[400.0], method="sharp_smart")
    assert own.steps > 2048
    assert (own.attrs["method"], own.attrs["final_q"].tolist()) == (
        asked.attrs["method"],
        asked.attrs["final_q"].tolist(),
    )


def test_an_explicit_method_that_is_asked_for_is_kept_and_the_sentence_names_friction():
    robot = block(1e-9)
    run = robot.simulate(
        robot.home.with_rates([1.5]), duration=5.0, max_steps=3000, method="dormand_prince"
    )
    assert run.status is lw.Status.TOO_MANY_STEPS
    assert 'take method="rodas", for the dry friction of slide is stiff there' in run.message
    stiff = robot.simulate(robot.home.with_rates([1.5]), duration=5.0, max_steps=30, method="rodas")
    assert "rodas" not in stiff.message
