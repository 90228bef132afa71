"""The compiled robot against maximal coordinates with multipliers: at home, assembled elsewhere,
and at the end of a run."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw

from tests.equations.evaluation import close
from tests.oracle import pairs
from tests.oracle.random_joints import curved, random_loops, random_tree, tilted
from tests.robot.oracle_state import Seen


def prs3() -> lw.Mechanism:
    """Return a 3-PRS robot: a platform on three ball joints, each at the end of a rod that is
    hinged to a slider."""
    solid = lw.Body(
        mass=1.0, centre_of_mass=(0.1, 0.02, 0), inertia=lw.Inertia(xx=0.02, yy=0.03, zz=0.04)
    )
    bodies, joints, reference, tilt = {"platform": solid}, {}, {}, -2 * np.pi / 3
    for i, azimuth in enumerate(2 * np.pi / 3 * np.arange(3), start=1):
        out, turned = (
            np.array([np.cos(azimuth), np.sin(azimuth), 0]),
            pairs.turned((0, 0, 1), azimuth),
        )
        base = lw.Frame(position=tuple(0.5 * out), rotation=(0, 0, azimuth))
        bodies |= {f"slider_{i}": solid, f"rod_{i}": solid}
        ball = lw.SphericalJoint(
            connects=(f"rod_{i}", "platform"),
            frames=(lw.Frame(position=(0.6, 0, 0)), lw.Frame(position=tuple(0.2 * out))),
        )
        joints |= {
            f"slide_{i}": lw.PrismaticJoint(
                connects=("ground", f"slider_{i}"), frames=(base, lw.Frame())
            ),
            f"hinge_{i}": lw.RevoluteJoint(connects=(f"slider_{i}", f"rod_{i}"), axis=(0, 1, 0)),
            f"ball_{i}": ball,
        }
        R = (turned @ pairs.turned((0, 1, 0), tilt)).T
        reference |= {f"slide_{i}": 0.1, f"hinge_{i}": tilt}
        reference |= dict(zip(ball.coordinates(f"ball_{i}"), pairs.quaternion(R), strict=True))
    actuators = ("slide_1", "slide_2", "slide_3")
    return lw.Mechanism(bodies=bodies, joints=joints, reference=reference, actuators=actuators)


CASES = {
    "tree": lambda: curved(random_tree(4, 3, effects=True, gears=1)),
    "tilted loop": lambda: tilted(random_loops(4, 1, planar=True, effects=True), 4),
    "3-PRS": prs3,
}


@pytest.fixture(params=CASES, scope="module")
def robot(request):
    return lw.Robot(CASES[request.param]())


def forces(robot: lw.Robot) -> np.ndarray:
    return np.random.default_rng(2).normal(size=len(robot.actuators))


@pytest.mark.sample(2)
def test_at_home_and_assembled_elsewhere(robot):
    """Coordinates, rates, accelerations and energies; inverse dynamics there and back."""
    random, u = np.random.default_rng(1), forces(robot)
    shift = next(name for name in robot.independent if name in robot.coordinates)
    for state in (robot.home, robot.assemble({shift: robot.home[shift] + 0.05})):
        moving = state.with_rates(random.normal(size=robot.mobility))
        assert robot.closure_error(moving) < 1e-12
        Seen.of(robot, moving).agree(u, 1e-9)
        again = robot.inverse_dynamics(moving, robot.forward_dynamics(moving, u))
        close(again, u, 1e-9)
    assert np.isclose(state[shift], robot.home[shift] + 0.05)


def test_a_state_is_made_from_its_coordinates_and_any_rates(robot):
    """Positions give everything back; so do n rates of any joints that determine the motion."""
    moving = robot.home.with_rates(np.random.default_rng(3).normal(size=robot.mobility))
    rates = dict(zip(robot.rates, robot.joint_rates(moving), strict=True))
    L = np.abs(robot.rate_map(moving))
    others = [
        name
        for name, row in zip(robot.rates, L, strict=True)
        if name not in robot.independent and row.any()
    ]
    names = [*others[:1], *robot.independent]
    A = robot.rate_map(moving)[[robot.rates.index(name) for name in names]]
    kept = (
        names[: robot.mobility]
        if np.linalg.cond(A[: robot.mobility]) < 1e3
        else list(robot.independent)
    )
    again = robot.state(moving.positions, {name: rates[name] for name in kept})
    close(again.q, moving.q, 1e-12)
    close(again.rates, moving.rates, 1e-9)
    close(robot.twists(again), robot.twists(moving), 1e-9)


@pytest.mark.sample(2)
def test_along_a_run_and_at_its_end(robot):
    """What the run records at its end is what the oracle has there; energy changes by the power
    that the oracle counts."""
    start, u = (
        robot.home.with_rates(0.3 * np.random.default_rng(4).normal(size=robot.mobility)),
        forces(robot),
    )
    times = np.linspace(0, 0.2, 41)
    run = robot.simulate(start, u, duration=0.2, rtol=1e-10, atol=1e-12, save_at=times)
    assert run.status is lw.Status.FINISHED, run.message
    assert run.closure_error < 1e-12
    told = ("joint_position", "joint_rate", "joint_acceleration")
    data = {name: run[name].values for name in (*told, "kinetic_energy", "potential_energy")}
    seen = []
    for positions, rates in zip(data["joint_position"], data["joint_rate"], strict=True):
        named = dict(zip(robot.rates, rates, strict=True))
        seen.append(
            Seen.of(
                robot, robot.state(positions, {name: named[name] for name in robot.independent})
            )
        )
    seen[-1].agree(u, 1e-8)
    close(data["joint_acceleration"][-1], seen[-1].joint_accelerations(u), 1e-8)
    energies = np.array([one.oracle.energy(one.poses, one.twists) for one in seen])
    close(np.transpose([data["kinetic_energy"], data["potential_energy"]]), energies, 1e-8)
    power = np.array([one.oracle.power(one.poses, one.twists, u) for one in seen])
    work = (
        np.sum(power[:-1:2] + 4 * power[1::2] + power[2::2]) * (times[2] - times[0]) / 6
    )  # Simpson's rule
    assert np.isclose(
        energies[-1].sum() - energies[0].sum(),
        work,
        rtol=0,
        atol=1e-5 * max(1, np.abs(power).max()),
    )
