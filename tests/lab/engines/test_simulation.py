"""The engines' motions: against each other, against a conserved quantity, and the numbers a run
reports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linkwork.lab import engines
from linkwork.lab.engines.motion import along_tree, read_joints
from linkwork.lab.engines.tree import spanning_tree
from linkwork.robots import prr3

from tests.lab.engines.test_accelerations import bennett
from tests.oracle.closed_forms import DoublePendulum
from tests.oracle.lagrange import LagrangeOracle
from tests.oracle.random_mechanisms import random_state, spatial_loops

ENGINES = ("pinocchio", "mujoco", "exudyn")


@pytest.fixture(params=ENGINES)
def engine(request):
    pytest.importorskip(
        request.param, reason=f"the optional engine {request.param} is not installed"
    )
    return request.param


def push(time: float) -> np.ndarray:
    return np.array([0.6 * np.sin(5 * time), -0.45 * np.sin(7 * time), 0.3 * np.cos(6 * time)])


def test_the_3prr_moves_alike_in_all_engines():
    for name in ENGINES:
        pytest.importorskip(name, reason=f"the optional engine {name} is not installed")
    mechanism = prr3()
    positions = LagrangeOracle(mechanism).reference
    exact, soft, implicit = (
        engines.build(name, mechanism).simulate(positions, np.zeros(9), push, 0.3, 2e-3)
        for name in ENGINES
    )
    assert np.max(abs(exact.positions - positions)) > 0.03
    for run, tolerance in ((soft, 1e-6), (implicit, 3e-5)):
        for quantity in ("time", "positions", "rates", "accelerations", "body_positions"):
            np.testing.assert_allclose(
                getattr(run, quantity), getattr(exact, quantity), atol=tolerance
            )
    assert (
        exact.closure_error < 1e-10 and soft.closure_error < 1e-7 and implicit.closure_error < 1e-12
    )


def test_a_spatial_loop_moves_alike_in_all_engines():
    for name in ENGINES:
        pytest.importorskip(name, reason=f"the optional engine {name} is not installed")
    mechanism = spatial_loops(0)
    positions, speeds = random_state(mechanism, np.random.default_rng(3))
    rates = LagrangeOracle(mechanism).all_rates(positions, speeds)
    runs = [
        engines.build(name, mechanism).simulate(
            positions, rates, lambda _: np.zeros(len(speeds)), 0.1, 1e-3
        )
        for name in ENGINES
    ]
    for run in runs[1:]:
        np.testing.assert_allclose(run.positions, runs[0].positions, atol=2e-5)
        assert run.alignment_error < 1e-5


def test_energy_is_conserved_in_bennetts_linkage(engine):
    mechanism = bennett()
    oracle = LagrangeOracle(mechanism)
    positions = oracle.reference
    rates = oracle.all_rates(positions, [1.0])
    run = engines.build(engine, mechanism).simulate(
        positions, rates, lambda _: np.zeros(1), 0.2, 1e-3
    )

    def energy(k: int) -> float:
        kinetic, potential = 0.0, 0.0
        twists = oracle.twists(run.positions[k], run.rates[k, :1])
        for index, (name, body) in enumerate(mechanism.bodies.items()):
            rotation, origin = run.body_poses[k, index, :3, :3], run.body_positions[k, index]
            omega = rotation.T @ twists[name][:3]
            kinetic += (
                omega @ body.inertia.tensor() @ omega
                + body.mass * twists[name][3:] @ twists[name][3:]
            ) / 2
            potential -= body.mass * np.dot(
                mechanism.gravity, origin + rotation @ np.array(body.centre_of_mass)
            )
        return float(kinetic + potential)

    assert np.ptp(run.positions[:, 0]) > 0.1
    assert energy(-1) == pytest.approx(
        energy(0), abs={"pinocchio": 1e-8, "mujoco": 1e-4, "exudyn": 1e-4}[engine]
    )


@pytest.mark.parametrize(("name", "order"), [("pinocchio", 4), ("mujoco", 4), ("exudyn", 2)])
def test_the_integrators_have_their_order(name, order):
    pytest.importorskip(name, reason=f"the optional engine {name} is not installed")
    model = engines.build(name, DoublePendulum().mechanism())
    start = np.array([0.4, -1.1]), np.array([2.0, -1.5])

    def end(step: float) -> np.ndarray:
        return model.simulate(*start, lambda t: np.array([np.sin(9 * t), t]), 0.32, step).positions[
            -1
        ]

    best = end(0.001)
    coarse, fine = (np.max(abs(end(step) - best)) for step in (0.016, 0.008))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.35)


def test_poses_are_those_the_engines_compute():
    pin = pytest.importorskip("pinocchio", reason="the optional engine pinocchio is not installed")
    mujoco = pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    from linkwork.lab.engines.mujoco import MujocoEngine
    from linkwork.lab.engines.pinocchio import PinocchioEngine

    mechanism = spatial_loops(2, loops=2)
    positions, speeds = random_state(mechanism, np.random.default_rng(1))
    rates = LagrangeOracle(mechanism).all_rates(positions, speeds)
    motion = along_tree(mechanism, spanning_tree(mechanism), positions, rates)
    first, second = PinocchioEngine(mechanism), MujocoEngine(mechanism)
    pin.forwardKinematics(first.model, first.data, positions[first.columns], rates[first.columns])
    second.evaluation(positions, rates, np.zeros(len(speeds)))()
    for index, name in enumerate(mechanism.bodies):
        joint, seat = first.seats[name]
        np.testing.assert_allclose(
            (first.data.oMi[joint] * seat).homogeneous, motion.poses[index], atol=1e-12
        )
        label, pose = second.seats[name]
        body, twist = second.data.body(label), np.zeros(6)
        rotation = body.xmat.reshape(3, 3)
        np.testing.assert_allclose(rotation @ pose[:3, :3], motion.poses[index, :3, :3], atol=1e-12)
        np.testing.assert_allclose(
            body.xpos + rotation @ pose[:3, 3], motion.poses[index, :3, 3], atol=1e-12
        )
        mujoco.mj_objectVelocity(
            second.model, second.data, mujoco.mjtObj.mjOBJ_XBODY, body.id, twist, 0
        )
        twist[3:] += np.cross(twist[:3], rotation @ pose[:3, 3])
        np.testing.assert_allclose(twist, motion.twists[index], atol=1e-12)


def test_joints_are_read_off_the_bodies():
    """Angles stay near the start by whole turns, rates and accelerations match; a gap opened on
    purpose is found."""
    mechanism = prr3()
    oracle = LagrangeOracle(mechanism)
    positions, speeds = random_state(mechanism, np.random.default_rng(2))
    rates = oracle.all_rates(positions, speeds)
    motion = along_tree(mechanism, spanning_tree(mechanism), positions[None], rates[None])
    turned = positions + 2 * np.pi * np.array([0, 0, 0, 1, 0, -1, 0, 2, 0])
    joints = read_joints(mechanism, motion, turned)
    np.testing.assert_allclose(joints.positions[0], turned, atol=1e-12)
    np.testing.assert_allclose(joints.rates[0], rates, atol=1e-12)
    assert joints.closure_error < 1e-12 and joints.alignment_error < 1e-12
    torn = motion.poses.copy()
    torn[:, -1, 1, 3] += 1e-3
    assert read_joints(
        mechanism, replace(motion, poses=torn), turned
    ).closure_error == pytest.approx(1e-3)


def test_recorded_accelerations_are_those_of_the_recorded_states(engine):
    mechanism = prr3()
    run = engines.build(engine, mechanism).simulate(
        LagrangeOracle(mechanism).reference, np.zeros(9), push, 0.1, 2e-3
    )
    differences = np.gradient(run.rates[:, :3], run.time, axis=0)
    np.testing.assert_allclose(run.accelerations[2:-2], differences[2:-2], atol=1e-3)
