"""All joint types and effects in the engines: against multipliers in maximal coordinates, each
other, and the Robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pytest

import linkwork as lw
from linkwork import robots
from linkwork.lab import engines
from linkwork.lab.engines import EngineError
from linkwork.mechanism import Mechanism

from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import TREE, curved, random_loops, random_motion, random_tree
from tests.products import first, sampled

TOLERANCES = {"pinocchio": 1e-10, "mujoco": 2e-2, "exudyn": 5e-6}
"""Relative: rounding; MuJoCo's regularisation of its constraints; Exudyn's numerical derivatives of
its constraints."""
EVERY = tuple(TOLERANCES)
WITHOUT_SCREWS = [kind for kind in TREE[False] if kind != "screw"]


@dataclass(frozen=True)
class Case:
    """Hold a mechanism at a state: all coordinates and rates, actuator forces, derivatives of all
    rates, body poses."""

    mechanism: Mechanism
    positions: np.ndarray
    rates: np.ndarray
    forces: np.ndarray
    exact: np.ndarray
    poses: dict[str, np.ndarray]


@cache
def case(make: Callable[[], Mechanism], seed: int = 0) -> Case:
    """Take a random state near the reference, and the oracle's accelerations there."""
    mechanism, rng = make(), np.random.default_rng(seed)
    oracle = MaximalOracle(mechanism)
    poses, twists = random_motion(oracle, rng)
    forces = rng.normal(size=len(mechanism.actuators))
    exact = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, forces))
    matrices = {
        name: np.block([[R, p[:, None]], [np.zeros(3), 1.0]]) for name, (p, R) in poses.items()
    }
    return Case(
        mechanism, oracle.coordinates(poses), oracle.rates(poses, twists), forces, exact, matrices
    )


MECHANISMS = {
    **{f"tree {seed}": partial(random_tree, seed, 9) for seed in (0, 1)},
    **{f"tree with effects {seed}": partial(random_tree, seed, 9, effects=True) for seed in (0, 1)},
    "planar tree with effects": partial(random_tree, 0, planar=True, effects=True),
    **{f"loops {seed}": partial(random_loops, seed) for seed in (0, 2)},
    **{
        f"loops with effects {seed}": partial(random_loops, seed, effects=True)
        for seed in (0, 1, 2)
    },
    "planar loops with effects": partial(random_loops, 1, planar=True, effects=True),
    "over-actuated loops": partial(random_loops, 3, actuation=2),
    "rods": partial(random_loops, 1, 1, rods=2),
    "planar rods": partial(random_loops, 0, 1, rods=2, planar=True),
    "platform on rods alone": partial(random_loops, 0, 1, platform="bare"),
    "platform on rods and a free joint": partial(random_loops, 1, 1, platform="free"),
    "geared tree": partial(random_tree, 1, 7, gears=1),
    "geared loop": partial(random_loops, 0, 1, gears=1),
    "planetary gear": lambda: curved(random_tree(0, 7, gears=1)),
}
LACKING = {
    ("pinocchio", "geared tree"): "Pinocchio has no constraint that could hold a gear",
    ("pinocchio", "geared loop"): "Pinocchio has no constraint that could hold a gear",
    ("pinocchio", "planetary gear"): "Pinocchio has no constraint that could hold a gear",
    ("mujoco", "planetary gear"): "MJCF holds those of one coordinate of a gear up to the power 4",
    ("exudyn", "planetary gear"): "Exudyn couples two coordinates, not more",
    ("exudyn", "geared loop"): "Exudyn couples two coordinates, not more",
    ("exudyn", "tree with effects 0"): "Exudyn has no rotor for a free turn",
    ("exudyn", "tree with effects 1"): "Exudyn has no rotor for a free turn",
    ("exudyn", "loops with effects 2"): "Exudyn has no rotor for a free turn",
}


@pytest.mark.sample(6)
@pytest.mark.parametrize(
    ("engine", "name"), dict.fromkeys([*sampled(EVERY, tuple(MECHANISMS)), *LACKING])
)
def test_agrees_with_maximal_coordinates(engine, name):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    it = case(MECHANISMS[name])
    if (engine, name) in LACKING:
        with pytest.raises(EngineError, match=LACKING[engine, name]):
            engines.build(engine, it.mechanism)
        return
    model = engines.build(engine, it.mechanism, guess=it.poses)
    actual = model.joint_accelerations(it.positions, it.rates, it.forces)
    assert np.max(abs(actual - it.exact)) < TOLERANCES[engine] * max(1.0, np.max(abs(it.exact)))
    driven = [it.mechanism.rates.index(name) for name in it.mechanism.actuators]
    own = model.accelerations(it.positions, it.rates, it.forces)
    np.testing.assert_allclose(
        own, actual[driven], atol=1e-2 * TOLERANCES[engine] * float(np.max(abs(actual)))
    )


@pytest.mark.sample(8)
@pytest.mark.parametrize("kind", TREE[False])
@pytest.mark.parametrize("engine", EVERY)
def test_every_joint_type_in_both_directions(engine, kind):
    pytest.importorskip(engine, reason=f"the optional engine {engine} is not installed")
    for make in (forwards, backwards):
        it = case(partial(make, kind))
        actual = engines.build(engine, it.mechanism).joint_accelerations(
            it.positions, it.rates, it.forces
        )
        assert np.max(abs(actual - it.exact)) < 1e-6 * max(1.0, np.max(abs(it.exact)))


def forwards(kind: str) -> Mechanism:
    return directed(kind, 0)


def backwards(kind: str) -> Mechanism:
    return directed(kind, 1)


def directed(kind: str, side: int) -> Mechanism:
    """Build a body on this joint and one on a hinge; the first joint's body of this side is the
    ground."""
    return next(
        mechanism
        for seed in range(20)
        if next(
            iter((mechanism := random_tree(seed, 2, kinds=[kind, "revolute"])).pairs.values())
        ).connects[side]
        == "ground"
    )


@pytest.mark.parametrize("seed", first(2, range(4)))
def test_trees_are_the_same_in_pinocchio_and_mujoco(seed):
    """To rounding: neither has a constraint there (but for screws, which MuJoCo does not have)."""
    for name in ("pinocchio", "mujoco"):
        pytest.importorskip(name, reason=f"the optional engine {name} is not installed")
    rng = np.random.default_rng(seed)
    kinds = [str(kind) for kind in rng.permutation(WITHOUT_SCREWS)]
    it = case(partial(random_tree, seed, 8, kinds=tuple(kinds), effects=True))
    first, second = (
        engines.build(name, it.mechanism).joint_accelerations(it.positions, it.rates, it.forces)
        for name in ("pinocchio", "mujoco")
    )
    np.testing.assert_allclose(first, second, atol=1e-9 * float(np.max(abs(second))))


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "name",
    first(
        3,
        [
            "loops with effects 1",
            "rods",
            "geared loop",
            "loops 0",
            "platform on rods and a free joint",
        ],
    ),
)
def test_softness_moves_mujoco_towards_the_exact_accelerations(name):
    pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    from linkwork.lab.engines.mujoco import MujocoEngine

    it = case(MECHANISMS[name])
    coarse, fine = (
        np.max(
            abs(
                MujocoEngine(it.mechanism, softness).joint_accelerations(
                    it.positions, it.rates, it.forces
                )
                - it.exact
            )
        )
        for softness in (1e-2, 1e-4)
    )
    assert coarse / fine == pytest.approx(100, rel=0.2)


@pytest.mark.parametrize(
    "name", ["tree with effects 0", "loops 2", "loops with effects 0", "platform on rods alone"]
)
def test_pinocchio_inverts_its_forward_dynamics(name):
    pytest.importorskip("pinocchio", reason="the optional engine pinocchio is not installed")
    from linkwork.lab.engines.pinocchio import PinocchioEngine

    it = case(MECHANISMS[name])
    driven = [it.mechanism.rates.index(name) for name in it.mechanism.actuators]
    found = PinocchioEngine(it.mechanism, it.poses).inverse_dynamics(
        it.positions, it.rates, it.exact[driven]
    )
    np.testing.assert_allclose(found, it.forces, atol=1e-7)


@cache
def robot(name: str) -> lw.Robot:
    return lw.Robot(getattr(robots, name)())


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "name", first(3, ["five_bar", "stewart", "agile_wrist", "rrr3", "delta", "andrews"])
)
def test_robots_at_random_states(name):
    """Independent rates, coordinates and code on one side; multipliers, regularisation on the
    other."""
    it, rng = robot(name), np.random.default_rng(3)
    models = {e: engines.build(e, it.mechanism) for e in engines.available()}
    bounds = {"pinocchio": 1e-9, "mujoco": 1e-4, "exudyn": 1e-6}
    for _ in range(3):
        start = dict(zip(it.coordinates, it.home.positions, strict=True))
        wanted = {label: start[label] + rng.uniform(-0.05, 0.05) for label in it.actuators}
        state = it.assemble(wanted, rates=rng.normal(size=it.mobility))
        forces = 3 * rng.normal(size=len(it.actuators))
        expected = it.joint_accelerations(state, it.forward_dynamics(state, forces))
        for engine, model in models.items():
            actual = model.joint_accelerations(state.positions, it.joint_rates(state), forces)
            assert np.max(abs(actual - expected)) < bounds[engine] * np.max(abs(expected)), engine
