"""The engines' motions where joints are balls, screws, rods and gears, and where springs, friction
and rotors act."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork.lab import engines
from linkwork.mechanism import Body, FreeJoint, Inertia, Mechanism, SphericalJoint
from linkwork.robots import andrews, bricard, delta

from tests.lab.engines.test_all_joints import case
from tests.oracle.maximal import MaximalOracle
from tests.oracle.published import ANDREWS_END, ANDREWS_START
from tests.oracle.random_joints import random_loops, random_tree
from tests.products import first

EVERY = ("pinocchio", "mujoco", "exudyn")
MOMENTS = np.array([0.02, 0.03, 0.045])


def brick(joint: FreeJoint | SphericalJoint, gravity: tuple[float, float, float]) -> Mechanism:
    inertia = Inertia(xx=MOMENTS[0], yy=MOMENTS[1], zz=MOMENTS[2])
    body = Body(mass=1.5, centre_of_mass=(0.0, 0.0, 0.1), inertia=inertia)
    return Mechanism(gravity=gravity, bodies={"brick": body}, joints={"joint": joint})


def angular_momentum(run: engines.EngineRun) -> np.ndarray:
    """Return the angular momentum about the mass centre (k, 3), the last three rates being the
    angular velocity."""
    R, omega = run.body_poses[:, 0, :3, :3], run.rates[:, -3:]
    local = np.einsum("kji,kj->ki", R, omega)
    return np.einsum("kij,kj->ki", R, MOMENTS * local)


@pytest.mark.parametrize("engine", EVERY)
def test_a_tumbling_body_keeps_its_angular_momentum(engine):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    mechanism = brick(FreeJoint(connects=("ground", "brick")), (0.0, 0.0, 0.0))
    positions, rates = np.array([0, 0, 0, 1, 0, 0, 0.0]), np.array([0, 0, 0, 0.1, 5.0, 0.2])
    rates[:3] = -np.cross(rates[3:], [0, 0, 0.1])  # the mass centre rests
    run = engines.build(engine, mechanism).simulate(positions, rates, np.zeros(0), 2.0, 2e-3)
    bound = {"pinocchio": 1e-9, "mujoco": 1e-6, "exudyn": 1e-4}[engine]
    momentum = angular_momentum(run)
    assert np.max(abs(momentum - momentum[0])) < bound
    assert np.max(abs(run.rates[:, 3])) > 1.0  # it turns over: the middle axis is unstable
    assert np.all(
        np.linalg.norm(np.diff(run.positions[:, 3:], axis=0), axis=1) < 0.02
    )  # quaternions do not jump


@pytest.mark.parametrize(("engine", "order"), [("pinocchio", 4), ("exudyn", 2)])
def test_the_integrators_have_their_order_on_quaternions(engine, order):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    model = engines.build(
        engine, brick(SphericalJoint(connects=("brick", "ground")), (0.0, 4.0, -9.0))
    )
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_quat(scalar_first=True)

    def end(step: float) -> np.ndarray:
        return model.simulate(turn, np.array([1.0, 5.0, -4.0]), np.zeros(0), 0.32, step).positions[
            -1
        ]

    best = end(0.0005)
    coarse, fine = (np.max(abs(end(step) - best)) for step in (0.016, 0.008))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize(
    ("engine", "step", "bound"),
    [("pinocchio", 3e-5, 1e-6), ("mujoco", 3e-5, 1e-4), ("exudyn", 3e-5, 3e-3)],
)
def test_andrews_squeezer_ends_as_published(engine, step, bound):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    mechanism = andrews()
    start = [mechanism.reference[name] for name in mechanism.coordinates]
    np.testing.assert_allclose(start[:7], ANDREWS_START[0], atol=1e-12)
    run = engines.build(engine, mechanism).simulate(
        np.array(start), np.zeros(10), np.array([0.033]), 0.03, step
    )
    np.testing.assert_allclose(run.positions[-1, :7], ANDREWS_END[0], atol=bound)
    np.testing.assert_allclose(run.rates[-1, :7], ANDREWS_END[1], atol=1e3 * bound)
    np.testing.assert_allclose(run.joint_accelerations[0, :2], ANDREWS_START[2][:2], rtol=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(
    "make",
    first(
        4,
        [
            partial(random_loops, 1, 1, rods=2),
            partial(random_loops, 1, effects=True),
            partial(
                random_tree,
                1,
                6,
                kinds=("spherical", "screw", "universal", "cylindrical", "planar", "revolute"),
            ),
            partial(random_tree, 1, 7, gears=1),
            delta,
        ],
    ),
    ids=first(4, ["rods", "loops with effects", "tree", "gear", "delta"]),
)
def test_all_engines_move_alike(make):
    it = case(make)
    runs = {}
    for engine in EVERY:
        pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
        if engine != "pinocchio" or not it.mechanism.gears:
            model = engines.build(engine, it.mechanism)
            runs[engine] = model.simulate(it.positions, it.rates, it.forces, 0.05, 2.5e-4)
    first = next(iter(runs.values()))
    scale = np.max(abs(first.positions - it.positions))
    assert scale > 0.005
    for run in runs.values():
        np.testing.assert_allclose(run.positions, first.positions, atol=3e-3 * scale)
        assert max(run.closure_error, run.alignment_error) < 1e-5
        middle = np.gradient(run.rates, run.time, axis=0)[2:-2]
        np.testing.assert_allclose(
            run.joint_accelerations[2:-2], middle, atol=2e-3 * np.max(abs(middle))
        )


@pytest.mark.parametrize("engine", EVERY)
def test_constant_forces_and_functions_are_the_same(engine):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    it = case(partial(random_tree, 2, 3, kinds=("spherical", "universal", "prismatic")))
    model = engines.build(engine, it.mechanism)
    held, asked = (
        model.simulate(it.positions, it.rates, forces, 0.02, 1e-3).positions
        for forces in (it.forces, lambda _: it.forces)
    )
    np.testing.assert_allclose(held, asked, atol=1e-12)


@pytest.mark.parametrize(("engine", "bound"), [("pinocchio", 1e-6), ("exudyn", 2e-3)])
def test_bricards_linkage_keeps_its_energy(engine, bound):
    """Six hinges, none of whose rows is superfluous in name, but one of which is in fact: all in
    all one freedom."""
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    mechanism = bricard()
    oracle = MaximalOracle(mechanism)
    poses = oracle.reference_poses()
    positions = oracle.coordinates(poses)
    run = engines.build(engine, mechanism).simulate(positions, np.zeros(6), np.zeros(1), 0.5, 1e-3)
    bodies = tuple(mechanism.bodies)

    def energy(k: int) -> float:
        placed = {
            b: (run.body_poses[k, i, :3, 3], run.body_poses[k, i, :3, :3])
            for i, b in enumerate(bodies)
        }
        speed = np.linalg.lstsq(
            oracle.rows(placed, oracle._rest).F @ (N := oracle.motions(placed)), run.rates[k]
        )[0]
        return sum(oracle.energy(placed, oracle.by_body(N @ speed)))

    assert np.max(abs(run.rates)) > 1.0
    assert energy(-1) == pytest.approx(energy(0), abs=bound)
